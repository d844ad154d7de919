"""Where samples lie in the world: notes in a file's metadata that decoding does not depend on (spec clause 3.7.2)."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OptionError

PLACEMENT = "placement"
"""Name of the note that holds the numbers."""
CRS = "crs"
"""Name of the note that says which coordinate reference system they belong to, as ``EPSG:32631``."""

_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?")
"""As JSON has them."""


def unplaced(n: int) -> NDArray[np.float64]:
    """What holds without a placement: in the plane x runs along axis 1, in space x, y, z are the axes 0, 1, 2."""
    return np.column_stack([np.eye(n)[::-1] if n == 2 else np.eye(n), np.zeros(n)])


def placement_of(given: ArrayLike, n: int) -> NDArray[np.float64]:
    """A placement from what a user gives.

    Parameters
    ----------
    given : (n,) or (n, n + 1) array_like
        Distances of neighbouring samples along each axis of the array; or a row for each coordinate x, y (, z): what a
        step along each axis adds to it, and what it is at sample 0.
    n : int
        Axes of the field.

    Returns
    -------
    (n, n + 1) float64

    Raises
    ------
    OptionError
        If it is neither, or lays different samples on one point.
    """
    try:
        matrix = np.array(given, np.float64)
    except (TypeError, ValueError):
        raise OptionError(f"the placement {given!r} is not made of numbers", code="placement") from None
    if not np.isfinite(matrix).all():
        raise OptionError("the placement has numbers that are not finite", code="placement")
    if matrix.shape == (n,):
        distances = matrix
        matrix = unplaced(n)
        matrix[:, :n] *= distances
    if matrix.shape != (n, n + 1):
        raise OptionError(
            f"a placement of shape {matrix.shape}, needed is {(n,)} or {(n, n + 1)}: the field has {n} axes",
            code="placement",
        )
    steps = matrix[:, :n]
    if np.linalg.matrix_rank(steps / (np.abs(steps).max() or 1.0)) < n:
        raise OptionError("the placement lays different samples on one point", code="placement")
    return matrix


def write_placement(placement: NDArray[np.float64]) -> str:
    """The text of a note: the numbers row by row, as short as they can be read back."""
    return " ".join(repr(number).removesuffix(".0") for number in (placement + 0.0).ravel().tolist())


def read_placement(metadata: Mapping[str, str], n: int) -> NDArray[np.float64] | None:
    """Inverse of ``write_placement``; None where a file has no such note, or one that says nothing."""
    numbers = metadata.get(PLACEMENT, "").split(" ")
    if len(numbers) != n * (n + 1) or not all(map(_NUMBER.fullmatch, numbers)):
        return None
    try:
        return placement_of(np.array(numbers, np.float64).reshape(n, n + 1), n)
    except OptionError:
        return None
