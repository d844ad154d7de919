"""Records that `to_pictures` takes, until pictures have a module of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from ..cost import Cost

__all__ = ["Cost", "Output", "OutputOptions"]

OutputOptions = Any


class Output(NamedTuple):
    """A writer of pictures of one kind of content."""

    kind: str
    suffixes: tuple[str, ...]
    title: str
    render: Callable[..., bytes | Iterable[bytes]]
    dimensions: tuple[int, ...] = (2,)
    several: tuple[int, ...] = ()
    holds: str = ""
    coordinates: str = "samples"
    sampled: bool = True
    extra: str = ""
    libraries: tuple[str, ...] = ()
    cost: Mapping[int, Cost] = {}
    more: Any = None
