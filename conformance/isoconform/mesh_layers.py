"""Layers of explicit domains in any order, of any signs and numbers (clause 10.1.3): what no encoder writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec.format.domain import MeshLayerHead, read_domain, write_domain, write_mesh_layer
from isocodec.mesh.complex import Complex, complex_of
from isocodec.mesh.cut import CellHistory, history_of
from isocodec.mesh.hierarchy import Hierarchy, hierarchy_of
from isocodec.mesh.isovalue import MeshIsovalue
from isospec.container import ChunkType, MeshLayer

from .explicit_dump import Mesh
from .streams import Chunk, split

BITS = 8
"""Of numbers, on both sides."""


class Layers:
    """Layers on a known mesh, each isovalue with a state of its own.

    Parameters
    ----------
    mesh : (points, cells)
    isovalue : float
        That of the header.
    exponent : int, optional
        Of the unit of positions, instead of the encoder's.

    Attributes
    ----------
    domain : Complex
    hierarchy : Hierarchy
    history : CellHistory
    """

    def __init__(self, mesh: Mesh, isovalue: float, exponent: int | None = None) -> None:
        n = mesh[1].shape[1] - 1
        begun = mesh if exponent is None else (mesh[0][mesh[1][0]], np.arange(n + 1)[None])
        nothing = isocodec.Mesh(begun[0], begun[1], np.zeros(len(begun[0]), np.int64), progressive=False)
        file = split(isocodec.encode(nothing, isovalue, precision="signs"))
        head, _ = read_domain(file.chunks[0].payload, n, 0)
        self.domain: Complex = complex_of(*mesh, head.exponent if exponent is None else exponent)[0]
        if exponent is not None:
            head = replace(
                head, exponent=exponent, vertices=len(mesh[0]), cells=len(mesh[1]), digest=self.domain.digest
            )
        self._begun = file.with_chunks(Chunk(ChunkType.DOMAIN, write_domain(head, n)))
        self.hierarchy: Hierarchy = hierarchy_of(self.domain)
        self.history: CellHistory = history_of(self.hierarchy)

    def file(self, *chunks: Chunk) -> bytes:
        """A file with its header, its domain and further chunks."""
        return bytes(self._begun.with_chunks(*self._begun.chunks, *chunks))

    def isovalue(
        self, value: float, earlier: Sequence[MeshIsovalue] = (), before: MeshIsovalue | None = None
    ) -> MeshIsovalue:
        """Begin an isovalue that leans on others, the nearest first, or on that of the frame before."""
        return MeshIsovalue(self.domain, value, None, earlier, before)

    def layer(
        self, one: MeshIsovalue, head: MeshLayerHead, above: NDArray[np.bool_], numbers: NDArray[np.int64] | None = None
    ) -> Chunk:
        """Code a layer; ``above`` (V,) are the signs, ``numbers`` (V,) those of vertices, 0 by default."""
        run = one.write()
        if head.kind == MeshLayer.SIGNS:
            one.code_signs(above)
        elif head.kind == MeshLayer.LEVELS:
            one.code_levels(self.hierarchy, head.rounds, above)
        elif head.kind == MeshLayer.CUT:
            one.code_cut(self.history, np.arange(len(self.history.vertex)) % 3 == 0, above)
        elif head.kind == MeshLayer.OFFSETS:
            if one.edges is None:
                one.edges = np.zeros((0, 3), np.int64)
            one.code_offsets(head.step)
        else:
            if one.edges is None:
                one.edges = np.zeros((0, 3), np.int64)
            ends = one.edges[:, :2].ravel()
            first = np.sort(np.unique(ends, return_index=True)[1])
            one.code_values(head.bits, None if numbers is None else numbers[ends[first]])
        return Chunk(ChunkType.LAYERS, write_mesh_layer(head) + run.end())
