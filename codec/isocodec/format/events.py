"""Events of a decoder, in the order of the bytes (spec clause 8.2)."""

from __future__ import annotations

from dataclasses import dataclass

from .chunks import Promises
from .coordinate_record import CoordinatesRecord
from .header import Header
from .program import Layer


@dataclass(frozen=True)
class Event:
    """Something that a decoder has received.

    Attributes
    ----------
    offset : int
        Byte offset in the file at which it ends; for a layer, the position of the coder's four-byte window at that
        moment. It does not depend on how the bytes were fed; a layer may be reported up to four bytes earlier.
    """

    offset: int


@dataclass(frozen=True)
class HeaderRead(Event):
    """The header has been read."""

    header: Header


@dataclass(frozen=True)
class IsovalueRead(Event):
    """A further isovalue begins; the layers that follow belong to it.

    Attributes
    ----------
    number : int
        Number of the isovalue in the file; the one in the header is 0.
    isovalue : float
    lean : int or None
        Number of the earlier isovalue that it is predicted from, or None.
    """

    number: int
    isovalue: float
    lean: int | None


@dataclass(frozen=True)
class TurnRead(Event):
    """The layers that follow belong to several isovalues in turn.

    Attributes
    ----------
    first, count : int
        Number of the first of these isovalues, and how many they are.
    """

    first: int
    count: int


@dataclass(frozen=True)
class SeriesRead(Event):
    """The file holds a series of frames.

    Attributes
    ----------
    interval : int
        Frames whose number is a multiple of this are key frames, not predicted from earlier ones; 0 if only the first
        is.
    """

    interval: int


@dataclass(frozen=True)
class FrameRead(Event):
    """An isovalue of a further frame begins; the layers that follow belong to it.

    Attributes
    ----------
    frame : int
        Number of the frame; the first is 0.
    number : int
        Number of the isovalue, as in the first frame.
    lean : int or None
        Number of the isovalue that it is predicted from, or None.
    before : bool
        Whether that isovalue is one of the frame before.
    """

    frame: int
    number: int
    lean: int | None
    before: bool


@dataclass(frozen=True)
class LayerComplete(Event):
    """A layer has been decoded completely.

    Attributes
    ----------
    number : int
        Number of the layer in the file, from 1.
    layer : Layer
    symbols : dict of str to int
        Symbols by syntax element.
    bytes : int
        Number of entropy-coded bytes.
    """

    number: int
    layer: Layer
    symbols: dict[str, int]
    bytes: int


@dataclass(frozen=True)
class MetadataRead(Event):
    """A metadata chunk has been read.

    Attributes
    ----------
    metadata : dict of str to str
        Notes of this chunk.
    """

    metadata: dict[str, str]


@dataclass(frozen=True)
class MaskComplete(Event):
    """The mask is complete, so that it is known which samples are missing.

    Attributes
    ----------
    bytes : int
        Number of entropy-coded bytes.
    """

    bytes: int


@dataclass(frozen=True)
class DomainRead(Event):
    """The mesh of the file has been decoded, with its vertices and cells."""

    vertices: int
    cells: int


@dataclass(frozen=True)
class MeshLayerComplete(Event):
    """A layer of a file on a mesh has been decoded.

    Attributes
    ----------
    number : int
        Number of the layer in the file, in a series in the frame, from 1.
    kind : str
        ``signs``, ``levels``, ``cut``, ``offsets`` or ``values``.
    bytes : int
        Number of entropy-coded bytes.
    """

    number: int
    kind: str
    bytes: int


@dataclass(frozen=True)
class PromisesRead(Event):
    """The promises (guaranteed distances) for the layers of the current isovalue have been read."""

    promises: Promises


@dataclass(frozen=True)
class CoordinatesRead(Event):
    """The coordinates of samples have been read; their numbers are decoded when something is drawn."""

    coordinates: CoordinatesRecord


@dataclass(frozen=True)
class ChunkSkipped(Event):
    """An ancillary chunk that the decoder does not use was skipped."""

    type: int
    length: int


@dataclass(frozen=True)
class End(Event):
    """The end of the file has been reached, and its checksum verified."""
