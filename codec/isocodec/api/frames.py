"""Series of frames: one curve after the other, and which frame is asked for (spec clauses 3.5.7, 5.11)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import chain
from numbers import Integral

from numpy.typing import ArrayLike

from ..drawing.contour import Contour
from ..errors import OptionError, TruncatedError
from ..format.chunks import octets
from ..format.events import End, FrameRead
from ..format.header import read_header
from ..limits import Limits
from ..stream.decoder import Decoder
from ..stream.mesh_decoder import MeshDecoder


def decode_frames(
    data: bytes | bytearray | memoryview | Iterable[bytes], *, smooth: bool = False,
    mesh: tuple[ArrayLike, ArrayLike] | None = None, limits: Limits | None = None,
) -> Iterator[list[Contour]]:
    """Decode a file frame by frame; no more than two frames are in memory.

    Parameters
    ----------
    data : bytes, or iterable of bytes
        The file, or pieces of it as they come.
    smooth, mesh, limits
        As in `decode`.

    Yields
    ------
    list of Contour
        Of each frame the curves or surfaces of all isovalues, in the file's order. A file without frames has one.

    Raises
    ------
    FormatError
        If the bytes are no valid file; ``TruncatedError`` if they end too early, after the frames that are complete.
    LimitError
        If the file needs more than the limits allow.
    """
    pieces = iter([bytes(octets(data))] if isinstance(data, (bytes, bytearray, memoryview)) else data)
    begun = bytearray()
    while (found := read_header(begun)) is None and (piece := next(pieces, None)) is not None:
        begun += piece
    on_mesh = found is not None and found[0].cells is not None
    decoder: Decoder | MeshDecoder = MeshDecoder(mesh, limits) if on_mesh else Decoder(limits)
    draw = decoder.drawn if isinstance(decoder, MeshDecoder) else partial(decoder.drawn, smooth=smooth)
    for piece in chain([bytes(begun)], pieces):
        decoder.feed(piece)
        for event in decoder:
            if isinstance(event, End) or (isinstance(event, FrameRead) and event.number == 0):
                before = isinstance(event, FrameRead)
                yield [draw(i, before=before) for i in range(len(decoder.isovalues))]
    decoder.close()


def frame_of(frame: int | None) -> int:
    """The frame that is asked for, the first if None.

    Raises
    ------
    OptionError
        If it is no number from 0 on.
    """
    if frame is None:
        return 0
    if isinstance(frame, bool) or not (isinstance(frame, Integral) and frame >= 0):
        raise OptionError(f"frame is {frame}; it must be a whole number from 0 on", code="frame")
    return int(frame)


def check_frame(decoder: Decoder | MeshDecoder, frame: int) -> None:
    """Refuse a frame that a decoder which has taken the file has not met.

    Raises
    ------
    TruncatedError, OptionError
        If the file ends before it begins, or does not have it.
    """
    last = decoder.frame
    if last >= frame:
        return
    if not decoder.complete:
        raise TruncatedError(f"the file ends before frame {frame} begins", code="truncated")
    there = f"its frames are 0 to {last}" if last else "it holds one frame only"
    raise OptionError(f"the file has no frame {frame}", code="frame", remedy=there)
