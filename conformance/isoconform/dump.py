"""The decoded state of a file as canonical text (spec annex C.1): what a decoder under test prints.

A decoder prints one line a fact and ends with an exit code: 0 if the file is complete and right, 5 if it ends too
early (the text then says what was received), 4 if it violates the specification and 6 if it needs more than the
decoder's limits, both without text.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from isocodec.errors import FormatError, IsoError, KernelError, LimitError, TruncatedError
from isocodec.layers.events import Event, IsovalueRead, LayerComplete
from isocodec.limits import Limits
from isocodec.stream.decoder import Decoder
from isospec.container import Double

COMPLETE = 0
COORDINATES = "coordinates"
"""Line before coordinates."""
NO_COORDINATES = f"{COORDINATES}\n"
"""What a decoder that reads coordinates prints where there are none."""
CUT_OFF = TruncatedError.exit_code
REFUSED = (FormatError.exit_code, LimitError.exit_code)


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


def canonical(decoder: Decoder) -> str:
    """Text of the states of all isovalues that have come, and of the mask; empty before the header."""
    lines: list[str] = []
    for number in range(len(decoder.isovalues)):
        state = decoder.state(number)
        assert state is not None
        # the shape is the same for all
        lines += [f"isovalue {number}", *state.lines()[1:]] if number else state.lines()
    mask = decoder.mask_state()
    if mask is not None:
        # neither values nor explicit vertices
        lines += ["mask", *mask.lines()[1:]]
    return "".join(f"{line}\n" for line in lines)


def canonical_coordinates(decoder: Decoder) -> str:
    """Text of the coordinates of a mapped grid; a line only where there are none."""
    mapped = decoder.mapped()
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
    try:
        for event in _events(decoder, data, piece):
            events.append(event)
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
    return Output(code, canonical(decoder), error, decoder.symbols, events, canonical_coordinates(decoder))


def canonical_layers(data: bytes) -> Iterator[tuple[LayerComplete, int, str]]:
    """Every layer of a file, the number of its isovalue, and the canonical text after it."""
    decoder = Decoder()
    isovalue = 0
    for event in _events(decoder, data, 0):
        if isinstance(event, IsovalueRead):
            isovalue = event.number
        elif isinstance(event, LayerComplete):
            yield event, isovalue, canonical(decoder)


def _events(decoder: Decoder, data: bytes, piece: int) -> Iterator[Event]:
    piece = piece or max(len(data), 1)
    for at in range(0, len(data), piece):
        decoder.feed(data[at : at + piece])
        yield from decoder
