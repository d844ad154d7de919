"""Layer programs: a compact description of the layers of a chunk (spec clause 3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

from isospec.container import (
    ALL,
    ESCAPE,
    LAYER_LIMIT,
    MAX_PARTS,
    MAX_RADIX,
    MAX_UNIT,
    Operation,
    OperationByte,
    write_varint,
)

from ..errors import FormatError
from .header import varint
from .kinds import LayerKind

MAX_BITS = 52
_step = cache(OperationByte.parse)


@dataclass(frozen=True)
class Layer:
    """One layer of a stream.

    Attributes
    ----------
    kind : str
        A `LayerKind`, or its name.
    level : int
        Level up to which the mesh is uniform when the layer is complete.
    plane : int
        For ``values``: bits of the numbers that remain to be coded afterwards; otherwise 0.
    parts : int
        For ``offsets``: number of equal parts of every ``2**unit`` samples of an edge afterwards; otherwise 0.
    unit : int
    births : bool
        For ``adapt``: whether the layer may add components.
    """

    kind: str
    level: int
    plane: int = 0
    parts: int = 0
    unit: int = 0
    births: bool = False


@dataclass
class Progress:
    """State of a program, on which the next operation builds."""

    full_level: int
    level: int = -1
    bits: tuple[int, int] | None = None
    plane: int = 0
    parts: int = 1
    layers: int = 0
    lean_level: int = -1

    def begin(self, lean: Progress | None) -> Progress:
        """State of the programs when a further isovalue begins, which may be predicted from an earlier one."""
        return Progress(self.full_level, layers=self.layers, lean_level=-1 if lean is None else lean.level)

    def copy(self) -> Progress:
        """Copy the state."""
        return replace(self)

    def add(self, layer: Layer) -> None:
        """Update the state with a layer."""
        self.level = layer.level
        self.layers += 1
        if layer.kind == LayerKind.VALUES:
            self.plane = layer.plane
        elif layer.kind == LayerKind.OFFSETS and layer.level == self.full_level:
            self.parts = layer.parts


def mask_layers(n: int, full_level: int) -> list[Layer]:
    """Layers of a mask (clause 5.10.1): a coarse base, and all rounds up to the full grid."""
    base = min(n, full_level)
    rounds = [Layer(LayerKind.REFINE, level) for level in range(base + 1, full_level + 1)]
    return [Layer(LayerKind.BASE, base), *rounds]


def write_program(layers: Sequence[Layer], progress: Progress, bits: tuple[int, int]) -> bytes:
    """Write the shortest program of some consecutive layers; ``progress`` is advanced past them.

    ``bits`` are the bits above and below the isovalue, which the first ``values`` operation of a file states.
    """
    steps: list[tuple[Operation, int | None, bytes]] = []
    i = 0
    while i < len(layers):
        kind = layers[i].kind
        j = i + 1
        while j < len(layers) and _continues(layers[j - 1], layers[j]):
            j += 1
        extra = b""
        argument: int | None
        full = layers[j - 1].level == progress.full_level
        unit = layers[i].unit
        if kind == LayerKind.BASE:
            operation, argument = Operation.BASE, None if full else layers[i].level
            end = i + 1
            while end < len(layers) and layers[end].kind == LayerKind.REFINE:
                end += 1
            if end > i + 1 and layers[end - 1].level == progress.full_level:
                operation, j = Operation.BASE_AND_REFINE, end
        elif kind == LayerKind.ADAPTIVE_BASE:
            operation, argument = Operation.ADAPTIVE_BASE, layers[i].level
        elif kind == LayerKind.LEAF_BASE:
            operation, argument = Operation.LEAF_BASE, 0
        elif kind == LayerKind.ADAPT:
            operation, argument = Operation.ADAPT, int(layers[i].births)
        elif kind == LayerKind.REFINE:
            operation, argument = Operation.REFINE, None if full else j - i
        elif kind == LayerKind.VALUES:
            operation = Operation.VALUES
            if progress.bits is None:
                progress.bits, progress.plane = bits, max(bits)
                extra = _write_bits(bits)
            if layers[i].plane == progress.plane:
                j = i + 1  # a layer that only lets new vertices catch up is a separate operation
            argument = progress.plane - layers[j - 1].plane
            argument = None if layers[j - 1].plane == 0 else argument
        else:
            coarse = progress.level != progress.full_level
            argument = layers[i].parts // (1 if coarse else progress.parts) - 1
            operation, extra = Operation.OFFSETS, bytes([unit]) if coarse else b""
        if expand(operation, argument or 0, argument is None, progress, unit) != list(layers[i:j]):
            raise ValueError(f"no program gives the layers {list(layers[i:j])}")
        if argument is not None and argument >= ESCAPE:
            extra = write_varint(argument) + extra
        steps.append((operation, argument, extra))
        for layer in layers[i:j]:
            progress.add(layer)
        i = j
    return b"".join(
        OperationByte.build({
            "more": s < len(steps) - 1, "operation": operation,
            "argument": ALL if argument is None else min(argument, ESCAPE),
        }) + extra
        for s, (operation, argument, extra) in enumerate(steps)
    )


def _continues(one: Layer, other: Layer) -> bool:
    """Whether one operation gives both layers."""
    if one.kind != other.kind:
        return False
    return one.kind == LayerKind.REFINE or (one.kind == LayerKind.VALUES and one.plane == other.plane + 1)


def _write_bits(bits: tuple[int, int]) -> bytes:
    head = min(bits[0], 15) << 4 | min(bits[1], 15)
    return bytes([head]) + b"".join(write_varint(b) for b in bits if b >= 15)


@dataclass
class ProgramReader:
    """Reads a program operation by operation, as its bytes arrive.

    Attributes
    ----------
    at : int
        Byte offset of the next operation.
    progress : Progress
        State of the programs; the caller's object is not changed.
    layers : list of Layer
    done : bool
    """

    at: int
    progress: Progress
    layers: list[Layer] = field(default_factory=list)
    done: bool = False

    def read(self, data: bytes | bytearray, end: int) -> bool:
        """Continue with the bytes up to ``end``; returns whether the program is complete.

        Raises
        ------
        FormatError
            If an operation is unknown or cannot follow on those before it.
        """
        while not self.done and self._operation(data, end):
            pass
        return self.done

    def _operation(self, data: bytes | bytearray, end: int) -> bool:
        """Read one operation, if it has arrived completely."""
        start = self.at
        if start >= end:
            return False
        step = _step(bytes(data[start : start + 1]))
        at = start + 1
        argument = step.argument
        if argument == ESCAPE:
            number = varint(data, at, end, "3.6.2")
            if number is None:
                return False
            argument, at = number
        state = self.progress
        if step.operation == Operation.VALUES and state.bits is None:
            found = _read_bits(data, at, end)
            if found is None:
                return False
            state.bits, at = found
            state.plane = max(state.bits)
        unit = 0
        if step.operation == Operation.OFFSETS and 0 <= state.level < state.full_level:
            if at >= end:
                return False
            unit, at = data[at], at + 1
        try:
            fresh = expand(step.operation, argument, step.argument == ALL, state, unit)
        except ValueError as error:
            raise FormatError(str(error), code="program", offset=start, clause="3.6") from None
        if state.layers + len(fresh) > LAYER_LIMIT:
            raise FormatError(f"more than {LAYER_LIMIT:,} layers", code="layers", offset=start, clause="11.1")
        for layer in fresh:
            state.add(layer)
        self.layers += fresh
        self.at = at
        self.done = not step.more
        return True


def read_program(data: bytes | bytearray, at: int, end: int, progress: Progress) -> tuple[list[Layer], int] | None:
    """Read the layers of the program at ``at``, and the place after it; None if ``end`` comes first.

    ``progress`` is advanced only if the whole program has arrived. Raises the same errors as ``ProgramReader.read``.
    """
    reader = ProgramReader(at, progress.copy())
    if not reader.read(data, end):
        return None
    vars(progress).update(vars(reader.progress))
    return reader.layers, reader.at


def _read_bits(data: bytes | bytearray, at: int, end: int) -> tuple[tuple[int, int], int] | None:
    if at >= end:
        return None
    bits = [data[at] >> 4, data[at] & 15]
    place = at + 1
    for i in range(2):
        if bits[i] == 15:
            number = varint(data, place, end, "3.6.4")
            if number is None:
                return None
            bits[i], place = number
            if not 15 <= bits[i] <= MAX_BITS:
                raise FormatError("number of value bits out of range", code="bits", offset=at, clause="3.6.4")
    return (bits[0], bits[1]), place


def expand(operation: int, argument: int, stated_all: bool, state: Progress, unit: int = 0) -> list[Layer]:
    """Layers of one operation after those of ``state``; ValueError if it cannot follow them."""
    full = state.full_level
    if operation in (Operation.BASE, Operation.BASE_AND_REFINE, Operation.ADAPTIVE_BASE):
        if state.level >= 0:
            raise ValueError("a second base")
        level = full if stated_all else argument
        if level > full:
            raise ValueError(f"the base is at level {level}, but the full grid is level {full}")
        if operation == Operation.ADAPTIVE_BASE:
            return [Layer(LayerKind.ADAPTIVE_BASE, level)]
        layers = [Layer(LayerKind.BASE, level)]
        if operation == Operation.BASE_AND_REFINE:
            layers += [Layer(LayerKind.REFINE, i) for i in range(level + 1, full + 1)]
        return layers
    if operation == Operation.LEAF_BASE:
        if state.level >= 0:
            raise ValueError("a second base")
        if argument or stated_all or state.lean_level < 0:
            raise ValueError("a leaf base, but no earlier isovalue to take leaves from")
        return [Layer(LayerKind.LEAF_BASE, state.lean_level)]
    if state.level < 0:
        raise ValueError("a layer before the base")
    if operation == Operation.ADAPT:
        if stated_all or argument > 1:
            raise ValueError(f"unknown kind {argument} of adaptive refinement")
        if state.level == full:
            raise ValueError("adaptive refinement of the full grid")
        return [Layer(LayerKind.ADAPT, state.level, births=bool(argument))]
    if operation == Operation.REFINE:
        count = full - state.level if stated_all else argument
        if count < 1 or state.level + count > full:
            raise ValueError(f"{count} rounds of refinement from level {state.level}, but the full grid is level "
                             f"{full}")
        return [Layer(LayerKind.REFINE, state.level + i) for i in range(1, count + 1)]
    if operation == Operation.VALUES:
        count = state.plane if stated_all else argument
        if count > state.plane:
            raise ValueError("more bits of values are asked for than there are")
        planes = range(state.plane - 1, state.plane - count - 1, -1) if count else [state.plane]
        return [Layer(LayerKind.VALUES, state.level, plane) for plane in planes]
    if operation == Operation.OFFSETS:
        if state.bits is not None:
            raise ValueError("offsets after values")
        radix = argument + 1
        before = state.parts if state.level == full else 1
        if stated_all or not 1 < radix <= MAX_RADIX or before * radix > MAX_PARTS:
            raise ValueError(f"offsets cannot divide {before} parts into {radix} each")
        if unit > MAX_UNIT:
            raise ValueError(f"offsets have a unit of 2**{unit} samples, which is too large")
        return [Layer(LayerKind.OFFSETS, state.level, 0, before * radix, unit)]
    raise ValueError(f"unknown operation {operation}")
