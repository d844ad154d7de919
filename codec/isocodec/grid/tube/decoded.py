"""The decoded state in integers: what every decoder must agree on (spec annex B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Decoded:
    """All that has been decoded, before any drawing.

    Attributes
    ----------
    shape : tuple of int
    level : int
        Uniform level reached by complete layers, -1 before the base.
    mesh : (W, n) int64
        Unclamped positions of the mesh's vertices beyond the uniform level, in lexicographic order.
    position : (V, n) int64
        Known vertices, as sample indices, in lexicographic order.
    above : (V,) bool
        Their signs.
    missing : (V,) int64
        Bits of the value that have not been sent; -1 where values are not sent.
    number : (V,) int64
        Bits of the value that have been sent, as a number.
    edge_low, edge_high : (E, n) int64
        Ends of the edges that carry offsets, in lexicographic order.
    edge_parts, edge_number : (E,) int64
        Equal parts that the edge is divided into so far, and the number of the one with the crossing.
    """

    shape: tuple[int, ...]
    level: int
    mesh: NDArray[np.int64]
    position: NDArray[np.int64]
    above: NDArray[np.bool_]
    missing: NDArray[np.int64]
    number: NDArray[np.int64]
    edge_low: NDArray[np.int64]
    edge_high: NDArray[np.int64]
    edge_parts: NDArray[np.int64]
    edge_number: NDArray[np.int64]

    def lines(self) -> list[str]:
        """Canonical text, a line a fact (spec annex B.1)."""
        out = [f"shape {' '.join(map(str, self.shape))}", f"level {self.level}"]
        out += [f"m {' '.join(map(str, p))}" for p in self.mesh]
        for p, a, m, q in zip(self.position, self.above, self.missing, self.number, strict=True):
            out.append(f"v {' '.join(map(str, p))} {int(a)}" + (f" {m} {q}" if m >= 0 else ""))
        for p, x, b, q in zip(self.edge_low, self.edge_high, self.edge_parts, self.edge_number, strict=True):
            out.append(f"e {' '.join(map(str, p))} {' '.join(map(str, x))} {b} {q}")
        return out
