"""What the reference decoder reads, symbol by symbol: it runs as plain Python, with ears in the coder.

The process has to run kernels as plain Python (see `plain`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import prod
from typing import Any

from isocodec.entropy import guesses, mixer, range_coder
from isocodec.errors import IsoError
from isocodec.format.events import LayerComplete
from isocodec.format.program import Layer
from isocodec.grid.models import contexts
from isocodec.kernel import Execution
from isocodec.kernel.execution import SETTING
from isocodec.stream.decoder import Decoder
from isocodec.stream.grid_contents import GridContents

from .plain import interpreted

CONTEXTS = (
    ("ORIGIN", "ORIGIN", "origin", (3,)), ("COMPONENT", "COMPONENT", "component", ()),
    ("ROOT", "ROOT", "location", ()), ("PATH", "PATH", "location", (2,)), ("FIRST", "FIRST", "base sign", (3, 2, 4)),
    ("BASE_CURVE", "CURVE", "base sign", (3, 4, 2, 2, 3, 2)),
    ("BASE_SURFACE", "SURFACE", "base sign", (3, 3, 4, 4, 2, 2)),
    ("SIGNIFICANT", "TREE", "significance", (25, 3)), ("SIGNIFICANT_LEAF", "LEAF", "significance", (4, 5, 3)),
    ("SIGN", "SIGN", "refinement sign", (2, 7, 80)), ("VALUE", "VALUE", "value bit", (52, 2, 3)),
    ("OFFSET", "OFFSET", "offset bit", (2, 8, 3, 3)), ("LEVEL", "LEVEL", "level", (3, 2, 4)),
    ("LEVEL_PATH", "LEVEL_PATH", "level", (64,)), ("SPLIT", "SPLIT", "split", (3, 2, 4, 8)),
    ("CONTINUE", "CONTINUE", "continue", ()), ("SEED", "SEED", "base sign", (2, 4, 2)),
    ("OFFSET_LEAN", "OFFSET_LEAN", "offset bit", (8, 16)), ("CONTRARY", "CONTRARY", "significance", ()),
    ("VALUE_NEAR", "VALUE_NEAR", "value bit", (16, 2, 16)), ("OFFSET_NEAR", "OFFSET_NEAR", "offset bit", (2, 4, 2, 16)),
)
"""Names of contexts in the implementation and in clause 7.1, the syntax element, and the numbers of their values."""
@dataclass
class Symbol:
    """A symbol that was received.

    Attributes
    ----------
    layer : Layer
    number : int
        Of the layer in the file, from 1.
    element, context : str
        As clauses 5.2 and 7.1 name them.
    mixing : str
        Main profile: network, kind, and the number of rows that the network saw, or how many opinions there are; empty
        if it is not mixed.
    probability : int
        Of a 1, in 2**-16.
    width : int
        Range before the symbol (clause 6.2).
    bit : int
    says : list of str
        What became known before the next symbol: vertices, numbers of values, parts of edges.
    """

    layer: Layer
    number: int
    element: str
    context: str
    mixing: str
    probability: int
    width: int
    bit: int
    says: list[str] = field(default_factory=list)


def context_name(number: int) -> tuple[str, str]:
    """Name of a context as clause 7.1 has it, and its syntax element."""
    for name, spoken, element, sizes in reversed(CONTEXTS):
        rest = number - getattr(contexts, name)
        if rest < 0:
            continue
        values = []
        for i in range(len(sizes)):
            below = prod(sizes[i + 1 :])
            values.append(rest // below)
            rest %= below
        return f"{spoken}({', '.join(map(str, values))})" if values else spoken, element
    raise ValueError(f"no context has the number {number}")


@contextmanager
def replaced(instead: Iterable[tuple[Callable[..., Any], Callable[..., Any]]]) -> Iterator[None]:
    """Put functions of the reference decoder in the place of others, wherever these are used."""
    before = []
    for module in [m for name, m in sys.modules.items() if name.startswith("isocodec.")]:
        for name, thing in list(vars(module).items()):
            for old, new in instead:
                if thing is old:
                    setattr(module, name, new)
                    before.append((module, name, old))
    try:
        yield
    finally:
        for module, name, old in before:
            setattr(module, name, old)


def _place(position: Sequence[int]) -> str:
    return f"({', '.join(map(str, position))})"


class Tracer:
    """Decodes a file and writes down its symbols.

    Attributes
    ----------
    decoder : Decoder
    symbols : list of Symbol
    error : IsoError or None
        With which decoding ended, the end of the bytes included.

    Raises
    ------
    RuntimeError
        If the kernels are compiled.
    """

    def __init__(self, data: bytes) -> None:
        if not interpreted():
            raise RuntimeError(f"symbols are seen with {SETTING}={Execution.PYTHON.value} only")
        self.decoder = Decoder()
        self.symbols: list[Symbol] = []
        self.error: IsoError | None = None
        self._done = self._vertices = 0
        self._geometry: dict[str, str] = {}
        self._tube: object = None
        self._told = (0, 0, 0)
        with self._listening():
            try:
                self.decoder.feed(data)
                for event in self.decoder:
                    self._done += isinstance(event, LayerComplete)
                    self._look()
                self.decoder.close()
            except IsoError as error:
                self.error = error
            self._look()

    def _look(self) -> None:
        """Write down what has become known since the last time."""
        contents = self.decoder.contents
        tubes = contents.tubes if isinstance(contents, GridContents) else []
        tube = next((t for t in reversed(tubes) if t), None)
        if tube is None:
            return
        if tube is not self._tube:
            self._tube, self._vertices, self._geometry = tube, 0, {}
        count = int(tube.state.counters.vertices)
        vertex = tube.state.vertex[:count, : tube.n].tolist()
        above = tube.state.vertex[:count, 3].tolist()
        says = [f"{_place(vertex[i])} {'above' if above[i] else 'below'}" for i in range(self._vertices, count)]
        told = tube.estimates
        geometry = {}
        for i, (number, left) in enumerate(zip(told.number.tolist(), told.left.tolist(), strict=True)):
            geometry[_place(vertex[i])] = f"number {number}, {left} bits missing"
        edges = zip(told.edges.tolist(), told.parts.tolist(), told.offset.tolist(), strict=True)
        for (low, high), parts, number in edges:
            geometry[f"{_place(vertex[low])} to {_place(vertex[high])}"] = f"part {number} of {parts}"
        if self._geometry:
            says += [f"{name} {what}" for name, what in geometry.items() if self._geometry.get(name, what) != what]
        if self.symbols:
            self.symbols[-1].says += says
        self._vertices, self._geometry = count, geometry

    def _note(self, context: int, mixing: str) -> None:
        p, width, bit = self._told
        layer = self.decoder.grid.layers[self._done]
        name, element = context_name(context)
        self.symbols.append(Symbol(layer, self._done + 1, element, name, mixing, p, width, bit))

    @contextmanager
    def _listening(self) -> Iterator[None]:
        """Put ears where a symbol is coded, wherever that is used."""
        emit, code, blended, counted = range_coder.emit, range_coder.code, mixer.blended, mixer.counted
        decided = guesses.decided

        def heard(cd: Any, p: int, bit: int) -> int:
            self._look()
            before = cd.reg.range
            bit = emit(cd, p, bit)
            if bit >= 0:
                self._told = (int(p), before, int(bit))
            return bit

        def coded(cd: Any, context: int, bit: int) -> int:
            bit = code(cd, context, bit)
            if bit >= 0:
                self._note(int(context), "")
            return bit

        def mixed(cd: Any, net: int, flip: bool, kind: int, context: int, bit: int) -> int:
            rows = int(cd.blend.row[0])
            bit = blended(cd, net, flip, kind, context, bit)
            if bit >= 0:
                self._note(int(context), f"network {net}, kind {kind}, {rows} rows" + (", flipped" if flip else ""))
            return bit

        def by_opinions(cd: Any, kind: int, bit: int) -> int:
            # of a value bit the first opinion is that of the context which baseline files have alone
            count, context = int(cd.blend.row[0]), int(cd.blend.row[1])
            bit = decided(cd, kind, bit)
            if bit >= 0 and mixer.mixing(cd):
                self._note(context, f"{count} opinions")
            return bit

        def counted_on(cd: Any, context: int, bit: int) -> int:
            bit = counted(cd, context, bit)
            if bit >= 0:
                self._note(int(context), "panel")
            return bit

        instead: list[tuple[Callable[..., int], Callable[..., int]]] = [
            (emit, heard), (code, coded), (blended, mixed), (counted, counted_on), (decided, by_opinions),
        ]
        with replaced(instead):
            yield
