"""What a mesh in a file costs: ISOCODEC_KERNELS=python python tools/mesh_bits.py merimbula.npz | tetrahedra

Bits of connectivity for each cell and bytes of positions, added up symbol by symbol; beside them Draco's file of the
same mesh at the same largest error of positions, and the part of it that is certainly positions: what it is longer than
with positions of 4 bits.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

import isocodec
from isocodec.entropy import guesses, range_coder
from isocodec.kernel import kernels
from isocodec.mesh import coded_mesh

SHARES = (0.05, 0.01)
"""Largest errors of positions, in median edges."""
SIDE = 9
"""Points along each side of a grid that are moved and joined to tetrahedra."""


class Bits:
    """Ideal lengths of the symbols of a mesh, as they are coded: of positions, and of all else."""

    def __init__(self) -> None:
        self.place = self.rest = 0.0
        self._placing = False
        emit, code_place = range_coder.emit, coded_mesh._code_place

        def counted(cd: Any, p: int, bit: int) -> int:
            coded = emit(cd, p, bit)
            length = -math.log2((p if coded else range_coder.ONE - p) / range_coder.ONE)
            if self._placing:
                self.place += length
            else:
                self.rest += length
            return coded

        def placed(*arguments: Any) -> Any:
            self._placing = True
            found = code_place(*arguments)
            self._placing = False
            return found

        range_coder.emit = guesses.emit = counted
        coded_mesh._code_place = placed


def draco(points: NDArray[np.float64], cells: NDArray[np.int64], bits: int) -> int:
    """Bytes of a file of triangles with so many bits for positions along the longest side."""
    import DracoPy

    flat = np.zeros((len(points), 3))
    flat[:, : points.shape[1]] = points - points.min(axis=0)
    return len(DracoPy.encode(flat, cells, quantization_bits=bits, compression_level=10, create_metadata=False))


def main(name: str) -> None:
    """Print the figures of a mesh."""
    if kernels().execution != "python":
        raise SystemExit("symbols are counted in plain Python: set ISOCODEC_KERNELS=python")
    if name == "tetrahedra":
        rng = np.random.default_rng(0)
        grid = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        points = grid + rng.uniform(-0.3, 0.3, grid.shape)
        cells = Delaunay(points).simplices.astype(np.int64)
        corners = points[cells]
        cells = cells[np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) > 1e-3]
    else:
        arrays = np.load(name)
        points, cells = arrays["points"], arrays["cells"].astype(np.int64)
    edge = float(np.median(np.linalg.norm(points[cells[:, 1]] - points[cells[:, 0]], axis=1)))
    bits = Bits()
    for share in SHARES:
        bits.place = bits.rest = 0.0
        # nothing lies above: but for the mesh there is one symbol
        isocodec.encode(
            isocodec.Mesh(points, cells, np.zeros(len(points)), stored="whole", error=share * edge, progressive=False),
            1, precision="signs",
        )
        text = f"{len(cells)} cells to {share} edges: connectivity {bits.rest / len(cells):.2f} bits a cell, "
        text += f"positions {bits.place / 8:.0f} bytes"
        if cells.shape[1] == 3:
            extent = float(np.ptp(points, axis=0).max())
            wide = math.ceil(math.log2(extent / (2 * share * edge) + 1))
            whole, least = draco(points, cells, wide), draco(points, cells, 4)
            text += f"; Draco with {wide} bits {whole} bytes, at least {whole - least} of them positions"
        print(text)


if __name__ == "__main__":
    main(sys.argv[1])
