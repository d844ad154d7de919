"""Layer programs: what the layers of a chunk are, in a few bytes (spec clause 3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isospec.container import ALL, ESCAPE, LAYER_LIMIT, MAX_PARTS, MAX_RADIX, Operation, OperationByte, write_varint

from ..errors import FormatError
from .header import varint

MAX_BITS = 52


@dataclass(frozen=True)
class Layer:
    """One layer of a stream.

    Attributes
    ----------
    kind : str
        ``base``, ``refine``, ``values`` or ``offsets``.
    level : int
        Uniform level of the mesh when the layer is complete.
    plane : int
        ``values``: bits of the numbers that are still missing afterwards; else 0.
    parts : int
        ``offsets``: equal parts that edges are divided into afterwards; else 0.
    """

    kind: str
    level: int
    plane: int = 0
    parts: int = 0


@dataclass
class Progress:
    """Where a program stands: what the next operation builds on."""

    full_level: int
    level: int = -1
    bits: tuple[int, int] | None = None
    plane: int = 0
    parts: int = 1
    layers: int = 0

    def add(self, layer: Layer) -> None:
        """Take note of a layer."""
        self.level = layer.level
        self.layers += 1
        if layer.kind == "values":
            self.plane = layer.plane
        elif layer.kind == "offsets":
            self.parts = layer.parts


def write_program(layers: Sequence[Layer], progress: Progress, bits: tuple[int, int]) -> bytes:
    """Shortest program of some consecutive layers; ``progress`` is moved behind them.

    ``bits`` are the bits above and below the isovalue, which the first ``values`` operation of a file states.
    """
    steps: list[tuple[Operation, int, bytes]] = []
    i = 0
    while i < len(layers):
        kind = layers[i].kind
        j = i + 1
        while kind in ("refine", "values") and j < len(layers) and layers[j].kind == kind:
            j += 1
        extra = b""
        full = layers[j - 1].level == progress.full_level
        if kind == "base":
            operation, argument = Operation.BASE, ALL if full else layers[i].level
            end = i + 1
            while end < len(layers) and layers[end].kind == "refine":
                end += 1
            if end > i + 1 and layers[end - 1].level == progress.full_level:
                operation, j = Operation.BASE_AND_REFINE, end
        elif kind == "refine":
            operation, argument = Operation.REFINE, ALL if full else j - i
        elif kind == "values":
            operation = Operation.VALUES
            before = max(bits) if progress.bits is None else progress.plane
            argument = ALL if layers[j - 1].plane == 0 else before - layers[j - 1].plane
            if progress.bits is None:
                progress.bits = bits
                extra = _write_bits(bits)
        else:
            operation, argument = Operation.OFFSETS, (layers[i].parts // progress.parts - 1) // 2
        if ESCAPE <= argument != ALL or (argument == ALL and operation == Operation.OFFSETS):
            argument, extra = ESCAPE, write_varint(argument) + extra
        steps.append((operation, argument, extra))
        for layer in layers[i:j]:
            progress.add(layer)
        i = j
    return b"".join(
        OperationByte.build({"more": s < len(steps) - 1, "operation": operation, "argument": argument}) + extra
        for s, (operation, argument, extra) in enumerate(steps)
    )


def _write_bits(bits: tuple[int, int]) -> bytes:
    head = min(bits[0], 15) << 4 | min(bits[1], 15)
    return bytes([head]) + b"".join(write_varint(b) for b in bits if b >= 15)


def read_program(data: bytes | bytearray, at: int, end: int, progress: Progress) -> tuple[list[Layer], int] | None:
    """Layers of the program at ``at`` and the place behind it; None if ``end`` comes first.

    ``progress`` is moved only when the whole program is there.

    Raises
    ------
    FormatError
        If an operation is unknown or cannot follow on those before it.
    """
    state = Progress(**vars(progress))
    layers: list[Layer] = []
    more = True
    while more:
        if at >= end:
            return None
        start = at
        step = OperationByte.parse(bytes(data[at : at + 1]))
        at += 1
        argument = step.argument
        if argument == ESCAPE:
            number = varint(data, at, end, "3.6.2")
            if number is None:
                return None
            argument, at = number
        stated_all = step.argument == ALL
        if step.operation == Operation.VALUES and state.bits is None:
            found = _read_bits(data, at, end)
            if found is None:
                return None
            state.bits, at = found
            state.plane = max(state.bits)
        try:
            fresh = expand(step.operation, argument, stated_all, state)
        except ValueError as error:
            raise FormatError(str(error), code="program", offset=start, clause="3.6") from None
        if state.layers + len(fresh) > LAYER_LIMIT:
            raise FormatError(f"more than {LAYER_LIMIT} layers", code="layers", offset=start, clause="11.1")
        for layer in fresh:
            state.add(layer)
        layers += fresh
        more = step.more
    vars(progress).update(vars(state))
    return layers, at


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


def expand(operation: int, argument: int, stated_all: bool, state: Progress) -> list[Layer]:
    """Layers of one operation, after those of ``state``; ValueError if it cannot follow on them."""
    full = state.full_level
    if operation in (Operation.BASE, Operation.BASE_AND_REFINE):
        if state.level >= 0:
            raise ValueError("a second base")
        level = full if stated_all else argument
        if level > full:
            raise ValueError(f"base at level {level}, the full grid is level {full}")
        layers = [Layer("base", level)]
        if operation == Operation.BASE_AND_REFINE:
            layers += [Layer("refine", i) for i in range(level + 1, full + 1)]
        return layers
    if state.level < 0:
        raise ValueError("a layer before the base")
    if operation == Operation.REFINE:
        if state.parts > 1:
            raise ValueError("refinement after offsets")
        count = full - state.level if stated_all else argument
        if count < 1 or state.level + count > full:
            raise ValueError(f"{count} rounds of refinement from level {state.level}, the full grid is level {full}")
        return [Layer("refine", state.level + i) for i in range(1, count + 1)]
    if operation == Operation.VALUES:
        if state.parts > 1:
            raise ValueError("values after offsets")
        count = state.plane if stated_all else argument
        if count > state.plane:
            raise ValueError("more value bits than there are")
        planes = range(state.plane - 1, state.plane - count - 1, -1) if count else [state.plane]
        return [Layer("values", state.level, plane) for plane in planes]
    if operation == Operation.OFFSETS:
        if state.bits is not None:
            raise ValueError("offsets after values")
        if state.level != full:
            raise ValueError("offsets before the full grid")
        radix = 2 * argument + 1
        if stated_all or not 3 <= radix <= MAX_RADIX or state.parts * radix > MAX_PARTS:
            raise ValueError(f"offsets in {radix} parts of {state.parts}")
        return [Layer("offsets", full, 0, state.parts * radix)]
    raise ValueError(f"unknown operation {operation}")
