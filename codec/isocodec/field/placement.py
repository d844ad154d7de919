"""Where samples lie in the world: notes in a file's metadata that decoding does not depend on (spec clause 3.7.2)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OptionError

PLACEMENT = "placement"
"""Name of the note that holds the numbers."""
CRS = "crs"
"""Name of the note that says which coordinate reference system they belong to, as ``EPSG:32631``."""
FRAME_STEP = "frame_step"
"""Name of the note that says how much time passes from a frame of a series to the next: ``2 s``."""
LEAST, MOST = 1e-30, 1e30
"""Sizes of numbers, but for 0: coordinates then fit single precision, their squares double precision."""
_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?")
"""As JSON has them."""


class Noted:
    """A file with notes, of which some say where the samples lie."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis of the field."""
        raise NotImplementedError

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file."""
        raise NotImplementedError

    @property
    def placement(self) -> NDArray[np.float64] | None:
        """Where samples lie, as `Contour.placement`."""
        return read_placement(self.metadata, len(self.shape))

    @property
    def crs(self) -> str | None:
        """Reference system of the coordinates, as the file names it."""
        return self.metadata.get(CRS)


def unplaced(n: int) -> NDArray[np.float64]:
    """What holds without a placement: in the plane x runs along axis 1, in space x, y, z are the axes 0, 1, 2."""
    return np.column_stack([np.eye(n)[::-1] if n == 2 else np.eye(n), np.zeros(n)])


def placement_of(given: ArrayLike, n: int) -> NDArray[np.float64]:
    """A placement from what a user gives.

    Parameters
    ----------
    given : (n,), (n, n + 1) or (n + 1, n + 1) array_like
        Distances of neighbouring samples along each axis of the array; or a row for each coordinate x, y (, z): what a
        step along each axis adds to it, and what it is at sample 0. A last row of 0 .. 0 1 may follow.
    n : int
        Axes of the field.

    Returns
    -------
    (n, n + 1) float64

    Raises
    ------
    OptionError
        If it is none of these, lays different samples on one point, or has numbers beyond `LEAST` and `MOST`.
    """
    try:
        matrix = np.asarray(given)
    except ValueError:
        matrix = np.array(None)
    if matrix.dtype.kind not in "iuf":
        raise OptionError(f"the placement {given!r} is not made of numbers", code="placement")
    matrix = matrix.astype(np.float64)
    if matrix.shape == (n,):
        distances = matrix
        matrix = unplaced(n)
        coordinate, axis = matrix.nonzero()
        matrix[coordinate, axis] = distances[axis]
    if matrix.shape == (n + 1, n + 1) and (matrix[n] == np.eye(n + 1)[n]).all():
        matrix = matrix[:n]
    if matrix.shape != (n, n + 1):
        raise OptionError(
            f"a placement of shape {matrix.shape}, needed is {(n,)} or {(n, n + 1)}: the field has {n} axes",
            code="placement",
        )
    size = np.abs(matrix[matrix != 0])
    if not ((size >= LEAST) & (size <= MOST)).all():
        raise OptionError(
            f"the placement has numbers that are neither 0 nor between {LEAST:g} and {MOST:g}", code="placement",
            remedy="take another unit",
        )
    if _determinant([[Fraction(number) for number in row[:n]] for row in matrix.tolist()]) == 0:
        raise OptionError("the placement lays different samples on one point", code="placement")
    return matrix


def _determinant(rows: list[list[Fraction]]) -> Fraction:
    """Without rounding: readers have to agree on which matrices are singular."""
    if len(rows) == 1:
        return rows[0][0]
    minors = [[row[:i] + row[i + 1 :] for row in rows[1:]] for i in range(len(rows))]
    return sum(((-1) ** i * rows[0][i] * _determinant(minors[i]) for i in range(len(rows))), Fraction(0))


def write_placement(placement: NDArray[np.float64]) -> str:
    """The text of a note: the numbers row by row, as short as they can be read back."""
    return " ".join(repr(number).removesuffix(".0") for number in (placement + 0.0).ravel().tolist())


def read_placement(metadata: Mapping[str, str], n: int) -> NDArray[np.float64] | None:
    """Inverse of ``write_placement``; None where a file has no such note, or one that says nothing."""
    count = n * (n + 1)
    numbers = metadata.get(PLACEMENT, "").split(" ", count)
    if len(numbers) != count or not all(map(_NUMBER.fullmatch, numbers)):
        return None
    try:
        return placement_of(np.array(numbers, np.float64).reshape(n, n + 1), n)
    except OptionError:
        return None
