"""A vector before its manifest entry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isocodec import encode


@dataclass(frozen=True)
class Draft:
    """A vector as its author describes it.

    Attributes
    ----------
    name : str
    data : bytes
    dimension : int
    features : tuple of str
        What it exercises, syntax elements apart.
    clause : str or None
        Clause of the specification that the file violates; None if it violates none.
    layers : bool
        Whether the manifest also states the decoded state after each layer.
    """

    name: str
    data: bytes
    dimension: int
    features: tuple[str, ...]
    clause: str | None = None
    layers: bool = False


def encoded(name: str, field: ArrayLike, isovalue: float, *features: str, layers: bool = False, **options) -> Draft:
    """A vector as the reference encoder writes it."""
    data = encode(field, isovalue, **options)
    return Draft(name, data, np.ndim(field), features, layers=layers)
