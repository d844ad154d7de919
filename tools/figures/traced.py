"""A curve, symbol by symbol, as JSON: run on its own with kernels as plain Python (see `walk` and `hyperbola`)."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from isocodec.entropy.range_coder import ONE
from isocodec.grid.lattice.access import vertex
from isocodec.grid.lattice.grid import edge_of, phase_of, position
from isocodec.grid.models.mesh_questions import COARSER, FINER, OF_LEAF
from isocodec.grid.models.parabola import MOST
from isocodec.grid.passes import adaptive_mesh, refinement
from isoconform.trace import Tracer

WORDS = {int(COARSER): "<=", int(FINER): "=>", int(OF_LEAF): "KR"}
"""Published symbols of the answers 0 and 1 about a triangle behind a gate, and about a leaf: Keep or Refine."""


class WalkTracer(Tracer):
    """Takes down the last points of the curve, too, before each symbol.

    Attributes
    ----------
    points : list of lists of (x0, x1)
        For each symbol, in samples, as far as the predictor remembers them.
    words : dict of int to str
        Published names of the symbols on the mesh, by number of the symbol.
    places : dict of int to list of (x0, x1)
        Corners of the triangle that a gate leads to, or the middle that is kept or refined.
    """

    def __init__(self, data: bytes) -> None:
        self.points: list[list[tuple[float, float]]] = []
        self.words: dict[int, str] = {}
        self.places: dict[int, list[list[int]]] = {}
        self._behind: dict[int, int] = {}
        super().__init__(data)

    @contextmanager
    def _listening(self) -> Iterator[None]:
        with super()._listening():
            ask = adaptive_mesh.ask

            def asked(st: Any, cd: Any, question: Any, context: int, bit: int) -> int:
                bit = ask(st, cd, question, context, bit)
                if bit >= 0 and int(question.what) in WORDS:
                    number = len(self.symbols) - 1
                    self.words[number] = WORDS[int(question.what)][bit]
                    if question.what == OF_LEAF:
                        self.places[number] = [[int(question.x), int(question.y)]]
                    else:
                        # the triangle becomes the next leaf
                        self._behind[number] = int(st.counters.leaves)
                return bit

            for module in (adaptive_mesh, refinement):
                module.ask = asked
            try:
                yield
            finally:
                for module in (adaptive_mesh, refinement):
                    module.ask = ask

    def _look(self) -> None:
        super()._look()
        tube: Any = self._tube
        if tube is not None:
            for number, leaf in list(self._behind.items()):
                if leaf < tube.state.counters.leaves:
                    self.places[number] = corners_of(tube.state, leaf)
                    del self._behind[number]
        trail: list[tuple[float, float]] = []
        if tube is not None:
            state = tube.state
            count = int(state.base.points)
            for i in range(max(count - MOST, 0), count):
                slot = i % MOST
                trail.append((state.trail[2 * slot] / 2, state.trail[2 * slot + 1] / 2))
        del self.points[len(self.symbols) :]
        self.points.append(trail)


def corners_of(state: Any, leaf: int) -> list[list[int]]:
    """Corners of a leaf of the tube, as sample indices (3, 2)."""
    cls, b0, b1, b2, level = (int(number) for number in state.leaf[leaf, :5])
    grid = state.grid
    edge, phase = edge_of(grid, level), phase_of(2, level)
    corners = [position(edge, b0, b1, b2, vertex(grid.tables, phase, cls, j)) for j in range(3)]
    return [[int(x), int(y)] for x, y, _ in corners]


def traced(data: bytes) -> list[dict[str, Any]]:
    """Each symbol: its layer (from 1), element, context and bit, the points before it, the vertices known after it.

    Vertices come with their signs; symbols on the mesh with their published name and what they are about. ``right`` is
    whether the bit is the likelier one in its context.
    """
    tracer = WalkTracer(data)
    out = []
    for number, (symbol, points) in enumerate(zip(tracer.symbols, tracer.points, strict=False)):
        # numbers of geometry are left out
        vertices = [said.rsplit(" ", 1) for said in symbol.says if said.endswith((" above", " below"))]
        out.append(
            {
                "layer": symbol.number, "element": symbol.element, "context": symbol.context, "bit": symbol.bit,
                "right": (2 * symbol.probability >= ONE) == symbol.bit,
                "points": points, "word": tracer.words.get(number, ""), "places": tracer.places.get(number, []),
                "vertices": [[*json.loads(f"[{place[1:-1]}]"), above == "above"] for place, above in vertices],
            }
        )
    return out


if __name__ == "__main__":
    print(json.dumps(traced(Path(sys.argv[1]).read_bytes())))
