"""Meshes to bytes and back (spec clause 10.10)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..entropy.run import SYMBOLS_PER_UNIT, Account, WritingRun, whole_run
from ..errors import FormatError
from ..kernel import GROW
from .coded_mesh import REASONS, code_mesh, grown, original_of
from .complex import Complex
from .models import coder_of_meshes
from .room import bytes_of, growth_of, longer, more_rows, whole_growth

BYTES_PER_UNIT = 8
"""Bytes of a mesh that count as a unit of work, so that they are bounded by the bytes of the file, too."""


def encoded_mesh(domain: Complex, extent: Sequence[int], unit: float) -> tuple[bytes, Complex, NDArray[np.int64]]:
    """Code a complex whose positions are from 0 to below ``extent``.

    Returns the run, the complex as a decoder has it, with vertices and cells in the order of decoding, and for each of
    its vertices the original one, (V,).
    """
    vertices, d = domain.mesh.position.shape
    cells, corners = domain.mesh.cell.shape
    run = WritingRun(coder_of_meshes())
    run.room(cells * (corners + 3) + vertices * 25 * d)
    g = whole_growth(vertices, cells, corners, np.array(extent, np.int64))
    g.reg.most, origin = run.left(), original_of(domain, d, corners)
    run.check(code_mesh(g, origin, run.coder))
    order = np.empty(vertices, np.int64)
    order[origin.vertex] = np.arange(vertices)
    return run.end(), grown(g, unit), order


def decoded_mesh(
    data: bytes, at: int, size: tuple[int, int], corners: int, extent: Sequence[int], unit: float, account: Account,
    hold: Callable[[int, int], None],
) -> Complex:
    """Decode the run of a mesh, which lies at ``at`` in the file; inverse of ``encoded_mesh``.

    ``size`` is the number of vertices and cells that the file states. ``hold`` is called before every allocation with
    the bytes that will be held, and the additional ones while arrays are copied. Raises `FormatError` if the run
    violates the specification, `LimitError` if it takes more than the account or ``hold`` allows.
    """
    vertices, cells = size
    run = whole_run(coder_of_meshes(), data, account, at)
    g = growth_of(vertices, cells, corners, np.array(extent, np.int64))
    origin, counted = original_of(None, len(extent), corners), 0
    while True:
        g.reg.most, g.reg.granted = run.left() + counted, run.coder.reg.left
        status = code_mesh(g, origin, run.coder)
        run.spend(g.reg.work - counted, SYMBOLS_PER_UNIT)
        counted = int(g.reg.work)
        if status != GROW:
            break
        before, rows = bytes_of(g), more_rows(g)
        after = bytes_of(g, rows)
        run.spend(sum(after) - sum(before), BYTES_PER_UNIT)
        hold(sum(after), max(before))
        # one after the other, so that the old array is freed before the next is made
        for name, count in rows.items():
            g = longer(g, name, count)
    run.check(status, REASONS, g.reg.error)
    run.end()
    if g.reg.vertices < vertices:
        raise FormatError("fewer vertices than stated", code="domain", offset=at, clause="10.10.1")
    return grown(g, unit)
