"""Runs made of any bytes: grown against the reference decoder until they say something that a decoder can read.

Random bytes behind a valid program decode to symbols drawn from the models themselves, and soon to one that is an
error: a component that starts where one has been. The reference tells where; the bytes from there on are drawn anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from isocodec.errors import FormatError, IsoError, LimitError, TruncatedError
from isocodec.format.events import LayerComplete
from isocodec.limits import Limits
from isocodec.stream.decoder import Decoder

from .dump import grid_of

SMALL = Limits(vertices=3000, simplices=12000, steps=20000)
"""What a file for fuzzing may need of a decoder at most: slow ones are to get through many."""
MOST_SYMBOLS = 1200
TRIES = 40
"""How often bytes are drawn anew before what there is has to do."""
WORTH, MOST_DULL = 16, 3
"""Runs of fewer symbols are drawn anew, but not more often than that."""
FAR = 1 << 13
"""Length stated of a chunk whose run is still growing."""


@dataclass(frozen=True)
class Probe:
    """What the reference makes of the bytes so far.

    Attributes
    ----------
    error : IsoError or None
        What is wrong, the end of the bytes apart.
    layers, symbols : int
        Complete layers and symbols received, of all isovalues.
    used : int
        Bytes of the file that the last complete layer needs (clause 8.2.3).
    shifted : int
        Bytes of the last run that its coder has moved past.
    """

    error: IsoError | None
    layers: int
    symbols: int
    used: int
    shifted: int


class ReferenceBroke(Exception):
    """The reference decoder failed on a file otherwise than by an error of its own.

    Attributes
    ----------
    data : bytes
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(f"the reference decoder failed on {len(data)} bytes")
        self.data = data


def probe(data: bytes) -> Probe:
    """Decode a file, or the start of one, within small limits.

    Raises
    ------
    ReferenceBroke
    """
    decoder = Decoder(SMALL)
    error: IsoError | None = None
    layers = used = 0
    try:
        decoder.feed(data)
        for event in decoder:
            if isinstance(event, LayerComplete):
                layers, used = event.number, event.offset
        decoder.close()
    except TruncatedError:
        pass
    except (FormatError, LimitError) as wrong:
        error = wrong
    except Exception as bug:
        raise ReferenceBroke(data) from bug
    shifted = 0
    grid = grid_of(decoder)
    if grid and grid.runs and not isinstance(error, LimitError):
        reg = grid.coder.reg
        shifted = reg.pos + reg.unknown // 8 - 4
    return Probe(error, layers, sum(decoder.symbols.values()), used, shifted)


def run_bytes(random: Random, count: int) -> bytes:
    """Bytes of a run: mostly random ones, among them stretches of zeros (rare 1s), ones (rare 0s) and repetitions."""
    out = b""
    while len(out) < count:
        size = random.randint(1, 12)
        match random.randrange(8):
            case 0:
                out += bytes(random.randint(1, 3))
            case 1:
                out += b"\xff" * random.randint(1, 3)
            case 2:
                out += bytes([random.randrange(256)]) * min(size, 5)
            case _:
                out += random.randbytes(size)
    return out[:count]


def grown(start: bytes, random: Random, size: int, tries: int = TRIES, lead: bytes = b"") -> tuple[bytes, Probe]:
    """A run of up to ``size`` bytes behind the start of a file, which ends with a program.

    The chunk that it stands in has to state a length that is not reached. If all tries fail, the probe says what is
    wrong with the run. ``lead`` is what it begins with at first.
    """
    before = probe(start).symbols
    run = (lead + run_bytes(random, size))[: max(size, len(lead))]
    found = probe(start + run)
    back, last, dull = 0, -1, 0
    for _ in range(tries - 1):
        if found.error is None and found.symbols <= MOST_SYMBOLS:
            if dull == MOST_DULL or not before < found.symbols < before + WORTH:
                break
            # mostly a curve that ends where it began, or none
            run, dull = lead + run_bytes(random, size), dull + 1
        elif found.error is None:
            run = run[: len(run) // 2]
        else:
            place = (found.error.offset or 0) - len(start)
            # what led there may leave no way out: each time at the same place, one byte more goes
            back = back + 1 if place <= last else 0
            last = max(place, last)
            keep = max(place - back, 0)
            # the way out is mostly that there is no further component: a 0
            run = (run[:keep] + b"\xff" * random.randrange(3) + run_bytes(random, size))[:size]
        found = probe(start + run)
    return run, found
