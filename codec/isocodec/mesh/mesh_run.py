"""Meshes to bytes and back (spec clause 10.10)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..entropy.run import Account, WritingRun, whole_run
from ..errors import FormatError, LimitError
from ..kernel import GROW
from .coded_mesh import REASONS, code_mesh, grown, growth_of, original_of
from .complex import Complex
from .models import coder_of_meshes

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
    run = WritingRun(coder_of_meshes())
    run.room(cells * (corners + 3) + vertices * 25 * d)
    g, origin = growth_of(vertices, cells, corners, np.array(extent, np.int64)), original_of(domain, d, corners)
    run.check(code_mesh(g, origin, run.coder))
    order = np.empty(vertices, np.int64)
    order[origin.vertex] = np.arange(vertices)
    return run.end(), grown(g, unit), order


def decoded_mesh(
    data: bytes, at: int, size: tuple[int, int], corners: int, extent: Sequence[int], unit: float, account: Account
) -> Complex:
    """Inverse of ``encoded_mesh``.

    Parameters
    ----------
    data : bytes
        The run.
    at : int
        Where it lies in the file.
    size : (int, int)
        Numbers of vertices and cells that the file states.
    corners : int
        Vertices of a cell.
    extent : sequence of int
        Positions are below these.
    unit : float
        Of positions.
    account : Account
        The file's.

    Raises
    ------
    FormatError
        If the run violates the specification.
    LimitError
        If it takes more than the account allows, or much more time than meshes do.
    """
    vertices, cells = size
    run = whole_run(coder_of_meshes(), data, account, at)
    g = growth_of(vertices, cells, corners, np.array(extent, np.int64))
    status = code_mesh(g, original_of(None, len(extent), corners), run.coder)
    if status == GROW:
        raise LimitError("a mesh with too many cells at its vertices", code="limit-work", offset=at, clause="11.2")
    run.check(status, REASONS, g.reg.error)
    run.end()
    if g.reg.vertices < vertices:
        raise FormatError("fewer vertices than stated", code="domain", offset=at, clause="10.10.1")
    return grown(g, unit)
