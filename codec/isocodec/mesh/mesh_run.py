"""Meshes to bytes and back (spec clause 10.10)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, LimitError
from ..kernel import CUT
from .coded_mesh import code_mesh, coder_of_meshes, grown, growth_of, original_of
from .complex import Complex
from .isovalue import Run

BYTES_PER_CELL = 160
"""Memory that decoding a mesh takes for a cell or vertex, about."""


def encoded_mesh(domain: Complex, extent: Sequence[int], unit: float) -> tuple[bytes, Complex, NDArray[np.int64]]:
    """Code a complex whose positions are from 0 to below ``extent``.

    Returns
    -------
    bytes
        The run.
    Complex
        As a decoder has it, with vertices and cells in the order of decoding.
    (V,) int64
        For each of its vertices the original one.
    """
    vertices, d = domain.mesh.position.shape
    cells, corners = domain.mesh.cell.shape
    run = Run(coder=coder_of_meshes())
    run.begin(None)
    run.room(cells * (corners + 3) + vertices * 25 * d)
    g, origin = growth_of(vertices, cells, corners, np.array(extent, np.int64)), original_of(domain, d, corners)
    run.check(code_mesh(g, origin, run.coder), g.reg.error)
    order = np.empty(vertices, np.int64)
    order[origin.vertex] = np.arange(vertices)
    return run.end(), grown(g, unit), order


def decoded_mesh(
    data: bytes, offset: int, vertices: int, cells: int, corners: int, extent: Sequence[int], unit: float
) -> Complex:
    """Inverse of ``encoded_mesh``.

    Raises
    ------
    FormatError
        If the run violates the specification.
    LimitError
        If the mesh takes much more time than meshes do.
    """
    run = Run(coder=coder_of_meshes())
    run.begin(data, offset)
    g = growth_of(vertices, cells, corners, np.array(extent, np.int64))
    status = code_mesh(g, original_of(None, len(extent), corners), run.coder)
    if status == CUT:
        raise LimitError("a mesh of vertices with too many cells", code="limit-work", clause="11.2")
    run.check(status, g.reg.error)
    run.end()
    if g.reg.vertices < vertices:
        raise FormatError("fewer vertices than stated", code="domain", offset=offset, clause="10.10.1")
    return grown(g, unit)
