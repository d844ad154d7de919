"""The base of a curve, symbol by symbol, as JSON: run on its own with kernels as plain Python (see `walk`)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from isocodec.grid.models.parabola import MOST
from isoconform.trace import Tracer


class WalkTracer(Tracer):
    """Takes down the last points of the curve, too, before each symbol.

    Attributes
    ----------
    points : list of lists of (x0, x1)
        For each symbol, in samples, as far as the predictor remembers them.
    """

    def __init__(self, data: bytes) -> None:
        self.points: list[list[tuple[float, float]]] = []
        super().__init__(data)

    def _look(self) -> None:
        super()._look()
        tube: Any = self._tube
        trail: list[tuple[float, float]] = []
        if tube is not None:
            state = tube.state
            count = int(state.base.points)
            for i in range(max(count - MOST, 0), count):
                slot = i % MOST
                trail.append((state.trail[2 * slot] / 2, state.trail[2 * slot + 1] / 2))
        del self.points[len(self.symbols) :]
        self.points.append(trail)


def traced(data: bytes) -> list[dict[str, Any]]:
    """Each symbol: its element, context and bit, the points before it, the vertices known after it with their signs."""
    tracer = WalkTracer(data)
    out = []
    for symbol, points in zip(tracer.symbols, tracer.points, strict=False):
        vertices = [said.rsplit(" ", 1) for said in symbol.says]
        out.append(
            {
                "element": symbol.element, "context": symbol.context, "bit": symbol.bit, "points": points,
                "vertices": [[*json.loads(f"[{place[1:-1]}]"), above == "above"] for place, above in vertices],
            }
        )
    return out


if __name__ == "__main__":
    print(json.dumps(traced(Path(sys.argv[1]).read_bytes())))
