"""Snapshots of a tube (decoded state): the state in canonical order, the leaves for drawing, and the mask."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.depth import levels_of
from ..grid.lattice.store import SHIFT as PAGE_SHIFT
from ..grid.lattice.store import page_of
from ..grid.lattice.tables import AXES
from ..grid.lattice.vertex_set import IN
from ..grid.passes.runner import Tube
from ..grid.tube.decoded import Decoded
from ..grid.tube.holes import Holes
from ..grid.tube.leaf_vertices import drawn, drawn_leaves
from ..grid.tube.state import numbers_bytes
from .leaves import Leaves
from .sample_mask import MaskRows


def state_of(tube: Tube) -> Decoded:
    """List the decoded state in canonical order (spec annex B)."""
    st, est = tube.state, tube.estimates
    count = int(st.counters.vertices)
    position = st.vertex[:count, : tube.n].astype(np.int64)
    order = np.lexsort(position.T[::-1])
    missing = np.full(count, -1, np.int64)
    number = np.zeros(count, np.int64)
    missing[: len(est.left)] = est.left
    number[: len(est.number)] = est.number
    low, high = position[est.edges[:, 0]], position[est.edges[:, 1]]
    edge_order = np.lexsort((*high.T[::-1], *low.T[::-1]))
    sent = edge_order[est.parts[edge_order] > 1]
    return Decoded(
        tube.shape, -1 if tube.running == "base" else tube.level, _explicit(tube), position[order],
        st.vertex[order, 3] != 0, missing[order], number[order], low[sent], high[sent], est.parts[sent],
        est.offset[sent],
    )


def _explicit(tube: Tube) -> NDArray[np.int64]:
    """Unclamped positions of the vertices of the mesh beyond its uniform level, in lexicographic order."""
    store = tube.state.mesh
    used = store.table[store.table[:, 0] >= 0]
    shifts = store.head[PAGE_SHIFT : PAGE_SHIFT + AXES]
    page, cell = np.nonzero(store.pages[used[:, 1]] & IN)
    corner = np.stack(page_of(used[page, 0]), axis=1) << shifts
    inner = np.stack([cell >> (shifts[1] + shifts[2]), cell >> shifts[2] & ((1 << shifts[1]) - 1),
                      cell & ((1 << shifts[2]) - 1)], axis=1)
    position = (corner + inner)[:, : tube.n]
    position = position[levels_of(position, tube.k) >= max(tube.level, 0)]
    return position[np.lexsort(position.T[::-1])]


_DRAWN = {(2, True): (60, 170, 24), (2, False): (40, 270, 40), (3, True): (40, 160, 24), (3, False): (60, 360, 40)}
"""Most bytes of a drawing for each vertex, leaf and stated edge, by dimension and whether on the full grid."""
_PLACED = {2: 120, 3: 135}
"""Most such bytes for each leaf of the full grid if the file states every crossing."""
_UNLISTED = {2: (70, 44, 24), 3: (8, 82, 24)}
"""Most such bytes for each where leaves are not listed."""
_CORNERS, _CHILDREN = 8, 16
"""Most corners that a diamond adds, and most children of a diamond."""


def _complete(tube: Tube) -> bool:
    """Whether the drawing follows from the known vertices: on the full grid, between layers."""
    return tube.full and tube.settled


def drawing_bytes(tube: Tube, listed: bool = False) -> int:
    """Most memory of `leaves_of` and the drawing, including the result, in bytes."""
    est = tube.estimates
    numbers = numbers_bytes(tube.state)
    if not listed and _complete(tube):
        vertex, leaf, edge = _UNLISTED[tube.n]
        return numbers + vertex * tube.vertices + leaf * tube.simplices + edge * len(est.edges)
    vertex, leaf, edge = _DRAWN[tube.n, tube.full]
    if tube.full and (est.has_values or (len(est.parts) > 0 and bool((est.parts > 1).all()))):
        leaf = _PLACED[tube.n]
    vertices, leaves = tube.vertices, tube.simplices if tube.settled else drawn_leaves(tube.state)
    coded = int(tube.state.counters.coded)
    if coded:
        # diamonds of an unfinished round are bisected in a copy
        vertices, leaves = vertices + _CORNERS * coded, leaves + _CHILDREN * coded
    rows = est.bytes_to_list(tube.state) if tube.settled else 0
    return numbers + rows + vertex * vertices + leaf * leaves + edge * len(est.edges)


def leaves_of(
    tube: Tube, isovalue: float, value_of: Callable[..., NDArray[np.float64]], holes: Holes | None = None,
    listed: bool = True,
) -> Leaves:
    """Collect what drawing needs; ``value_of(number, above)`` converts numbers of steps to field values.

    ``holes`` come from a mask that was not used in coding the tube. Unless ``listed``, simplices of the complete full
    grid are left out, since the drawing follows from the known vertices.
    """
    holes = holes or tube.holes
    st, est = tube.drawn_state(), tube.estimates
    count = int(st.counters.vertices)
    complete = _complete(tube)
    if complete and not listed:
        rows, levels = np.zeros((0, tube.n + 1), np.int64), np.zeros(0, np.int64)
    else:
        rows, levels = est.leaves(st) if tube.settled else drawn(st)
    value = None
    if est.has_values:
        above = st.vertex[:count, 3] != 0
        value = np.full(count, np.nan)
        known = len(est.number)
        some = est.left < np.where(above[:known], *est.bits)
        some |= est.left == 0
        middle = np.ldexp(est.number + 0.5, est.left) - 0.5
        value[:known] = np.where(some, value_of(middle, above[:known]), np.nan)
    sent = est.parts > 1
    edges, offset, parts = est.edges, est.offset, est.parts
    if not sent.all():
        edges, offset, parts = edges[sent], offset[sent], parts[sent]
    return Leaves(
        shape=tube.shape,
        isovalue=isovalue,
        vertex=st.vertex[:count],
        value=value,
        simplices=rows,
        levels=levels,
        full=tube.full,
        edges=edges,
        edge_offset=(offset + 0.5) / parts,
        edge_parts=parts,
        whole=holes.whole_cells if holes else None,
        known=est.numbers(st) if complete else None,
    )


def known_rows(tube: Tube, last_first: bool = False) -> MaskRows:
    """Find which samples lie above, some rows at a time; the mesh must be the full grid.

    With ``last_first``, rows of the transposed array, which is Fortran's order.
    """
    known = tube.state.vertex[: tube.vertices]
    position = known[:, : tube.n]
    if last_first:
        return MaskRows(tube.shape[::-1], position[:, ::-1], known[:, 3] != 0)
    return MaskRows(tube.shape, position, known[:, 3] != 0)
