"""Events of a decoder, in the order of the bytes (spec clause 8.2)."""

from __future__ import annotations

from dataclasses import dataclass

from .chunks import Promises
from .coordinate_record import CoordinatesRecord
from .header import Header
from .program import Layer


@dataclass(frozen=True)
class Event:
    """Something that has been received.

    Attributes
    ----------
    offset : int
        Byte offset at which it ends in the file, for a layer where the coder's window of four bytes lies then. It
        does not depend on how the bytes were fed; a layer may be reported up to four bytes earlier.
    """

    offset: int


@dataclass(frozen=True)
class HeaderRead(Event):
    """The header is there."""

    header: Header


@dataclass(frozen=True)
class IsovalueRead(Event):
    """Another isovalue begins: the layers that follow are its own.

    Attributes
    ----------
    number : int
        Its number in the file; the header's is 0.
    isovalue : float
    lean : int or None
        Number of the earlier isovalue that it leans on.
    """

    number: int
    isovalue: float
    lean: int | None


@dataclass(frozen=True)
class SeriesRead(Event):
    """The file holds a series of frames.

    Attributes
    ----------
    interval : int
        Frames whose number is a multiple of it lean on none before them; 0 if only the first does.
    """

    interval: int


@dataclass(frozen=True)
class FrameRead(Event):
    """An isovalue of a further frame begins: the layers that follow are its own.

    Attributes
    ----------
    frame : int
        Number of the frame; the first is 0.
    number : int
        Number of the isovalue, as in the first frame.
    lean : int or None
        Number of the isovalue that it leans on.
    before : bool
        Whether that is one of the frame before.
    """

    frame: int
    number: int
    lean: int | None
    before: bool


@dataclass(frozen=True)
class LayerComplete(Event):
    """A layer has been decoded to its end.

    Attributes
    ----------
    number : int
        Its number in the file, from 1.
    layer : Layer
    symbols : dict of str to int
        Symbols by syntax element.
    bytes : int
        Entropy-coded bytes that it took.
    """

    number: int
    layer: Layer
    symbols: dict[str, int]
    bytes: int


@dataclass(frozen=True)
class BaseComplete(LayerComplete):
    """The base is there."""


@dataclass(frozen=True)
class LevelComplete(LayerComplete):
    """A round of refinement is there."""


@dataclass(frozen=True)
class GeometryRefined(LayerComplete):
    """One more bit of all values, or of all offsets, is there."""


@dataclass(frozen=True)
class MetadataRead(Event):
    """A metadata chunk."""

    metadata: dict[str, str]


@dataclass(frozen=True)
class MaskComplete(Event):
    """The mask is complete: it is known which samples are missing.

    Attributes
    ----------
    bytes : int
        Entropy-coded bytes that it took.
    """

    bytes: int


@dataclass(frozen=True)
class DomainRead(Event):
    """The domain is there: vertices and cells of its mesh."""

    vertices: int
    cells: int


@dataclass(frozen=True)
class MeshLayerComplete(Event):
    """A layer of an explicit domain has been decoded.

    Attributes
    ----------
    number : int
        Its number in the file, from 1.
    kind : str
        ``signs``, ``levels``, ``offsets`` or ``values``.
    bytes : int
        Entropy-coded bytes that it took.
    """

    number: int
    kind: str
    bytes: int


@dataclass(frozen=True)
class PromisesRead(Event):
    """The writer's promises for the layers of the present isovalue have come."""

    promises: Promises


@dataclass(frozen=True)
class CoordinatesRead(Event):
    """The coordinates of samples have come; the numbers are decoded when something is drawn there."""

    coordinates: CoordinatesRecord


@dataclass(frozen=True)
class ChunkSkipped(Event):
    """An ancillary chunk that a decoder has no use for."""

    type: int
    length: int


@dataclass(frozen=True)
class End(Event):
    """The end of the file, its checksum verified."""
