"""The incremental encoder: a field in, bytes out as layers get done (spec clause 8.1)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import MAX_PARTS, Checksum, ChunkType, Operation, Profile
from isospec.elements import BY_LAYER, ELEMENTS

from ..entropy.baseline import models, rates
from ..entropy.coder import ENCODE, POS, REGISTERS, Coder, finish, start
from ..errors import OptionError
from ..grid.field import OFFSET_BITS, check_field
from ..jit import DONE
from ..limits import Limits
from ..passes.tube import Truth, Tube
from .container import LayerRecord, write_chunk, write_index, write_metadata
from .decoder import begin_layer
from .header import Header, write_header
from .program import Layer, Progress, expand, write_program

DEFAULT_TOLERANCE = 0.05
"""Largest distance in cells between decoded and extracted curve when nothing else is asked for."""
RUN_BYTES = 1 << 16
"""A run is ended at the first end of a layer after this many bytes."""
INDEX_SHARE = 100
"""A level index is written if it takes at most this fraction of the data."""
BASE_CYCLES = 4
"""The default base has cubes of 1 / 2**BASE_CYCLES of the root's edge: already near the curve, for few bytes."""


class Encoder:
    """Encodes one isocontour of a field; iterating, once, yields the bytes of the file, chunk by chunk.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats
    isovalue : float
    exact : bool
        Integer data: send the values next to the curve to the last bit.
    tolerance : float, optional
        Largest distance, in cells, between the decoded and the extracted curve: crossings are told as finely
        as that takes. The default, if nothing else is asked for, is 0.05.
    signs_only : bool
        Send no geometry: which samples lie above is exact, crossings are drawn half-way.
    step : float, optional
        Float data: send the values next to the curve to within half this step.
    base_level : int, optional
        Uniform level of the base; the level of the full grid makes a single-rate file.
    plan : sequence of (str, int or None), optional
        Instead of all these but ``step``: the layers one by one, as ``("base", level)``, ``("refine", rounds)``,
        ``("values", bits)``, ``("offsets", radix)``, where None means as far as it goes. Values may stand between
        rounds; offsets need the full grid and an odd radix.
    profile : str
        ``baseline``.
    metadata : mapping of str to str, optional
    progress : callable, optional
        Called with the layers done and their total.

    Raises
    ------
    InputError
        If the field or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.
    """

    def __init__(
        self,
        field: ArrayLike,
        isovalue: float,
        *,
        exact: bool = False,
        tolerance: float | None = None,
        signs_only: bool = False,
        step: float | None = None,
        base_level: int | None = None,
        plan: Sequence[tuple[str, int | None]] | None = None,
        profile: str = "baseline",
        metadata: Mapping[str, str] | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        asked = [
            name
            for name, given in (
                ("exact", exact), ("tolerance", tolerance is not None), ("signs_only", signs_only),
                ("step", step is not None),
            )
            if given
        ]  # fmt: skip
        if plan is not None and (base_level is not None or asked not in ([], ["step"])):
            raise OptionError("a plan contradicts the other options", code="options", remedy="give the plan alone")
        if not asked:
            tolerance = DEFAULT_TOLERANCE
        if len(asked) > 1:
            raise OptionError(f"{' and '.join(asked)} contradict one another", code="options", remedy="choose one")
        if profile.upper() not in Profile.__members__:
            names = ", ".join(p.name.lower() for p in Profile)
            raise OptionError(f"unknown profile {profile!r}", code="profile", remedy=f"choose one of: {names}")
        self.field = check_field(field, isovalue, step)
        if exact and not self.field.integer:
            raise OptionError(
                "exact is for integer data, and the field holds floats", code="exact", remedy="use step or tolerance"
            )
        self._metadata = dict(metadata or {})
        self._report = progress
        self.header = Header(self.field.values.shape, self.field.isovalue, step, Profile[profile.upper()])

        coder = Coder(np.zeros(REGISTERS, np.int64), np.zeros(1 << 16, np.uint8), *models(), rates())
        truth = Truth(self.field.signs, self.field.numbers, self.field.crossings)
        self._tube = Tube(self.field.values.shape, coder, Limits(), truth)
        self.layers: list[Layer] = []
        self.records: list[LayerRecord] = []
        self._run_bytes = 0
        self._progress = Progress(self._tube.full_level)
        if plan is None:
            plan = self._default_plan(base_level, exact or step is not None, None if exact or step else tolerance)
        self._plan = [_operation(kind, number) for kind, number in plan]
        self._extend()

    def _default_plan(
        self, base_level: int | None, values: bool, tolerance: float | None
    ) -> list[tuple[str, int | None]]:
        """Base, refinement to the full grid, then all values, or offsets as fine as the tolerance asks for."""
        full = self._tube.full_level
        level = min(BASE_CYCLES * self._tube.n, full) if base_level is None else base_level
        if not 0 <= level <= full:
            raise OptionError(
                f"base level {level}; for this field it lies between 0 and {full}", code="base-level",
                remedy=f"the full grid is level {full}",
            )  # fmt: skip
        plan: list[tuple[str, int | None]] = [("base", level)]
        if level < full:
            plan.append(("refine", None))
        if values:
            plan.append(("values", None))
        return plan + [("offsets", radix) for radix in _radices(tolerance)]

    def _extend(self) -> None:
        """Turn operations of the plan into layers, up to the first values: they wait until their range is known."""
        state = self._progress
        while self._plan:
            operation, number = self._plan[0]
            if operation == Operation.VALUES and state.bits is None:
                if len(self.layers) > len(self.records):
                    return
                later = any(o == Operation.REFINE for o, _ in self._plan)
                state.bits = self.field.number_bits() if later else self._tube.value_bits()
                state.plane = max(state.bits)
                self._tube.bits_above, self._tube.bits_below = state.bits
            try:
                fresh = expand(operation, number or 0, number is None, state)
            except ValueError as error:
                raise OptionError(f"the plan cannot be carried out: {error}", code="plan") from None
            for layer in fresh:
                state.add(layer)
            self.layers += fresh
            del self._plan[0]

    def __iter__(self) -> Iterator[bytes]:
        if self.records:
            raise OptionError("an encoder can be iterated only once", code="iterated", remedy="make another one")
        checksum = 0
        for piece in self._pieces():
            checksum = zlib.crc32(piece, checksum)
            yield piece
        yield Checksum.build(checksum)

    def _pieces(self) -> Iterator[bytes]:
        """The file but for its checksum."""
        yield write_header(self.header)
        if self._metadata:
            yield write_chunk(ChunkType.METADATA, write_metadata(self._metadata), ancillary=True)
        program = Progress(self._tube.full_level)
        done = 0
        while done < len(self.layers):
            end, run = self._encode_run(done)
            last = end == len(self.layers)
            bits = (self._tube.bits_above, self._tube.bits_below)
            payload = write_program(self.layers[done:end], program, bits) + run
            done = end
            index = b""
            if last:
                index = write_index(self.layers, self.records)
                if len(index) * INDEX_SHARE > self._run_bytes:
                    index = b""
            yield write_chunk(ChunkType.LAYERS, payload, last=last and not index)
            if index:
                yield write_chunk(ChunkType.INDEX, index, ancillary=True, last=True)

    def _encode_run(self, first: int) -> tuple[int, bytes]:
        """Encode layers from number ``first`` on until the run is long enough; their end and the bytes."""
        tube = self._tube
        start(tube.coder.reg, ENCODE)
        begun = 0
        i = first
        while i < len(self.layers):
            before = tube.tally()[: len(ELEMENTS)]
            self._advance(i)
            counts = dict(zip(ELEMENTS, map(int, tube.tally()[: len(ELEMENTS)] - before), strict=True))
            used = int(tube.coder.reg[POS]) + 4
            self.records.append(
                LayerRecord(used - begun, {name: counts[name] for name in BY_LAYER[self.layers[i].kind]})
            )
            begun = used
            i += 1
            self._extend()
            if self._report:
                self._report(i, len(self.layers))
            if used >= RUN_BYTES:
                break
        run = finish(tube.coder)
        # what the decoder's window reads past the end of the run belongs to no layer
        self._trim(first, i, len(run))
        self._run_bytes += len(run)
        return i, run

    def _trim(self, first: int, end: int, length: int) -> None:
        place = 0
        for i in range(first, end):
            stop = min(place + self.records[i].bytes, length)
            self.records[i] = LayerRecord(stop - place, self.records[i].symbols)
            place = stop

    def _advance(self, number: int) -> None:
        tube = self._tube
        begin_layer(tube, self.layers[number])
        while tube.advance() != DONE:
            buf = tube.coder.buf
            wider = np.zeros(2 * len(buf), np.uint8)
            wider[: len(buf)] = buf
            tube.coder = tube.coder._replace(buf=wider)


def _operation(kind: str, number: int | None) -> tuple[Operation, int | None]:
    """An entry of a plan as an operation and its argument."""
    if kind not in ("base", "refine", "values", "offsets"):
        raise OptionError(f"unknown layer {kind!r} in a plan", code="plan", remedy="base, refine, values or offsets")
    if kind == "offsets":
        if number is None or number % 2 == 0:
            raise OptionError(f"offsets with radix {number}, needed is an odd number", code="plan")
        number //= 2
    return Operation[kind.upper()], number


def _radices(tolerance: float | None) -> list[int]:
    """Parts that layers of offsets divide into, so that crossings end up within ``tolerance`` of where they are.

    The middle of the right one of m parts is at most 1 / 2m off. Of the odd numbers that will do, the smallest is
    taken that is a product of small factors: one layer each, so that crossings get finer step by step.
    """
    if tolerance is None:
        return []
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise OptionError(f"the tolerance is {tolerance}, needed is a positive number", code="tolerance")
    if tolerance < 0.5 / (MAX_PARTS * 0.9):
        raise OptionError(
            f"a tolerance of {tolerance} cells is too fine for offsets", code="tolerance", remedy="use exact or step"
        )
    # offsets are rounded to 30 bits before they are told
    parts = max(math.ceil(0.5 / (tolerance - 2.0**-OFFSET_BITS)), 1) | 1
    while True:
        rest, factors = parts, []
        for factor in (13, 11, 7, 5, 3):
            while rest % factor == 0:
                rest //= factor
                factors.append(factor)
        if rest == 1:
            return factors[::-1]
        parts += 2

