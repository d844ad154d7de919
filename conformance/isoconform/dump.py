"""The decoded state of a file as canonical text (spec annex B.1): what a decoder under test prints.

A decoder prints one line a fact and ends with an exit code: 0 if the file is complete and right, 5 if it ends too
early (the text then says what was received), 4 if it violates the specification and 6 if it needs more than the
decoder's limits, both without text.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from isocodec.errors import FormatError, InputError, IsoError, KernelError, LimitError, TruncatedError
from isocodec.format.events import Event, FrameRead, LayerComplete
from isocodec.limits import Limits
from isocodec.stream.decoder import Decoder
from isocodec.stream.grid_contents import GridContents
from isospec.container import Double

COMPLETE = 0
COORDINATES = "coordinates"
"""Line before coordinates."""
NO_COORDINATES = f"{COORDINATES}\n"
"""What a decoder that reads coordinates prints where there are none."""
CUT_OFF = TruncatedError.exit_code
REFUSED = (FormatError.exit_code, LimitError.exit_code)
OTHER_MESH = InputError.exit_code
"""The mesh that a file was made on is missing, or is another one."""


@dataclass(frozen=True)
class Output:
    """What a decoder had to say about a file.

    Attributes
    ----------
    exit_code : int
    text : str
        Canonical text with a final newline; empty for a file that was refused or ends within its header.
    coordinates : str
        Canonical text of coordinates, of the reference decoder.
    error : IsoError or None
        Of the reference decoder.
    symbols : dict of str to int
        Symbols by syntax element, of the reference decoder.
    events : list of Event
        Likewise.
    """

    exit_code: int
    text: str
    error: IsoError | None = None
    symbols: dict[str, int] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    coordinates: str = NO_COORDINATES


class Frames:
    """Texts of the frames of a series that are over, which a decoder keeps no longer than it needs them."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def take(self, decoder: Decoder, event: Event) -> None:
        """Keep the text of the frame before the one that begins with an event."""
        if isinstance(event, FrameRead) and event.number == 0:
            self.lines += _frame_lines(decoder, event.frame - 1, before=True)


def grid_of(decoder: Decoder) -> GridContents | None:
    """Contents of the file of a grid; None of other files, and before the header has come."""
    return decoder.contents if isinstance(decoder.contents, GridContents) else None


def _frame_lines(decoder: Decoder, frame: int, before: bool = False) -> list[str]:
    """Text of the isovalues of a frame that have come."""
    lines = [f"frame {frame}"] if frame else []
    grid = grid_of(decoder)
    if grid is None:
        return lines
    for number in range(len(decoder.isovalues)):
        state = grid.state(number, before=before)
        if state is None:
            assert frame, "all isovalues of the first frame come before others"
            break
        # the shape is the same for all
        of_isovalue = state.lines() if number == frame == 0 else state.lines()[1:]
        lines += [f"isovalue {number}", *of_isovalue] if number else of_isovalue
    return lines


def canonical(decoder: Decoder, past: Frames | None = None) -> str:
    """Text of the states of all isovalues that have come, and of the mask; empty before the header.

    ``past`` are the frames before the present one.
    """
    lines = [*(past.lines if past else []), *_frame_lines(decoder, decoder.present[0])]
    grid = grid_of(decoder)
    mask = grid.mask_state() if grid else None
    if mask is not None:
        # neither values nor explicit vertices
        lines += ["mask", *mask.lines()[1:]]
    return "".join(f"{line}\n" for line in lines)


def canonical_coordinates(decoder: Decoder) -> str:
    """Text of the coordinates of a mapped grid; a line only where there are none."""
    grid = grid_of(decoder)
    mapped = grid.mapped() if grid else None
    if mapped is None:
        return NO_COORDINATES
    lines = [COORDINATES, " ".join(["periodic", *map(str, mapped.periodic)])]
    for number, (one, values) in enumerate(zip(mapped.coordinates, mapped.values, strict=True)):
        lines.append(f"c {number} {one.period} {Double.build(one.origin).hex()} {Double.build(one.unit).hex()}")
        lines += [f"n {' '.join(map(str, node))} {value}" for node, value in np.ndenumerate(values)]
    return "".join(f"{line}\n" for line in lines)


def parted(text: str) -> tuple[str, str]:
    """What a decoder says of the state, and what of coordinates, if it reads these."""
    state, word, rest = text.partition(f"{COORDINATES}\n")
    return state, word + rest


def dump(data: bytes, *, layers: int = 0, piece: int = 0, limits: Limits | None = None) -> Output:
    """Decode a file with the reference decoder.

    Parameters
    ----------
    data : bytes
    layers : int
        Stop when that many layers are complete; 0 decodes the whole file.
    piece : int
        Feed that many bytes at a time; 0 feeds all at once. The result does not depend on it.
    limits : Limits, optional
        Of the decoder.
    """
    decoder = Decoder(limits)
    events: list[Event] = []
    code, error = COMPLETE, None
    past = Frames()
    try:
        for event in _events(decoder, data, piece):
            events.append(event)
            past.take(decoder, event)
            if isinstance(event, LayerComplete) and event.number == layers:
                break
        else:
            decoder.close()
    except TruncatedError as cut:
        code, error = cut.exit_code, cut
    except KernelError:
        # the file is not to blame
        raise
    except IsoError as wrong:
        return Output(wrong.exit_code, "", wrong, {}, events)
    return Output(code, canonical(decoder, past), error, decoder.symbols, events, canonical_coordinates(decoder))


def canonical_layers(data: bytes) -> Iterator[tuple[LayerComplete, int, str]]:
    """Every layer of a file, the number of its isovalue, and the canonical text after it."""
    decoder = Decoder()
    past = Frames()
    for event in _events(decoder, data, 0):
        past.take(decoder, event)
        if isinstance(event, LayerComplete):
            yield event, decoder.present[1], canonical(decoder, past)


def _events(decoder: Decoder, data: bytes, piece: int) -> Iterator[Event]:
    piece = piece or max(len(data), 1)
    for at in range(0, len(data), piece):
        decoder.feed(data[at : at + piece])
        yield from decoder
