"""A vector before its manifest entry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isocodec import Field, Frames, encode
from isocodec.format.events import LayerComplete

from .dump import dump
from .streams import bare

"""Bytes that a file may grow by when it is cut: a number of symbols, a checksum."""


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
    beyond : str or None
        Of a file over the limits: the clause that a decoder finds violated which goes on nevertheless.
    layers : bool
        Whether the manifest also states the decoded state after each layer.
    mesh : str
        The mesh that it was made on as text, if the file does not hold it.
    """

    name: str
    data: bytes
    dimension: int
    features: tuple[str, ...]
    clause: str | None = None
    layers: bool = False
    mesh: str = ""
    beyond: str | None = None


def encoded(
    name: str, field: ArrayLike, isovalue: float | Sequence[float], *features: str, states: bool = False,
    mask: ArrayLike | None = None, **options,
) -> Draft:
    """A vector as the reference encoder writes it, but for the promise of a single tolerance."""
    data = encode(Field(field, mask), isovalue, **{"profile": "baseline", "order": "isovalues", **options})
    data = bare(data) if isinstance(options.get("precision"), float) else data
    return Draft(name, data, np.ndim(field), features, layers=states)


def encoded_series(
    name: str, fields: Sequence[ArrayLike], isovalue: float | Sequence[float], *features: str, states: bool = False,
    mask: ArrayLike | None = None, **options,
) -> Draft:
    """A vector of a series of frames as the reference encoder writes it."""
    data = encode(
        Frames([Field(each, mask) for each in fields]), isovalue, **{"profile": "baseline", "interval": 0, **options}
    )
    return Draft(name, data, np.ndim(fields[0]), ("series of frames", *features), layers=states)


def within(data: bytes, kind: str) -> tuple[int, bytes]:
    """Where the middle of a file's longest layer of a kind lies, and the file up to it: the layer is not complete."""
    found = [e for e in dump(data).events if isinstance(e, LayerComplete)]
    event = max((e for e in found if e.layer.kind == kind), key=lambda e: e.bytes)
    size = event.offset - event.bytes // 2
    done = [e for e in dump(data[:size]).events if isinstance(e, LayerComplete)]
    assert len(done) == event.number - 1, f"{kind} is not cut in its middle"
    return size, data[:size]
