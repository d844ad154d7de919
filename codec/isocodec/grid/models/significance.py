"""Contexts for new components in the main profile: how many vertices are known nearby (spec clause 7.13).

Counts are kept for the cells of every power of two of samples: of vertices known before the round, and of new
components found so far, which cluster.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code
from ...kernel import DONE, GROW, inlined, inner
from ...kernel.types import Integer
from ..lattice.access import dimension
from ..lattice.grid import phase_of
from ..lattice.store import PAGES_AROUND, full, get, get_around, pages_around, spot
from ..tube.state import SIGNIFICANCE
from . import contexts as ctx
from .magnitude import bits
from .network_rows import BIRTH_CLASSES, CELL_CLASSES, CELL_SUM, CELL_SUMS, TREE_KIND, TREE_NET, TREE_ROW

BIRTH = 1 << 20
"""Counts of new components are multiples of this, those of vertices the rest."""
_MOST_BIRTHS, _MOST_VERTICES = 2047, BIRTH - 1
_FIRST_2, _FIRST_3 = TREE_ROW[2], TREE_ROW[3]
_CELLS_2, _CELLS_3 = CELL_SUM[2], CELL_SUM[3]
NODE, CUBE, SLOT = np.arange(3)
ROOT = np.int64(-1)
"""Number of the root, which has no siblings."""


class Node(NamedTuple):
    """A node of the tree.

    Attributes
    ----------
    what : int
        ``NODE``, ``CUBE`` or ``SLOT``.
    shift : int
        The round's cubes are taken ``2**shift`` together.
    x, y, z : int
        Place among these; of a slot, that of its cube.
    hits : int
        Significant siblings before it.
    child : int
        Number among its siblings, or ``ROOT``.
    near : int
        Nearness of a cube or slot.
    """

    what: Integer
    shift: Integer
    x: Integer
    y: Integer
    z: Integer
    hits: Integer
    child: Integer
    near: Integer


@inlined
def code_significance(st, cd, node, want):
    """Code whether a new component lies under a node; as ``code``, or GROW."""
    r = phase_of(dimension(st.grid.tables), st.counters.level)
    if node.what == NODE:
        context = ctx.SIGNIFICANT + node.shift * 3
    else:
        context = ctx.SIGNIFICANT_LEAF + ((1 + r if node.what == SLOT else 0) * ctx.NEARNESS + node.near) * 3
    context += min(node.hits, 2)
    if mixing(cd):
        size = node.shift + bits(st.counters.edge) - 1
        if size <= st.grid.exponent and count_cells(st, size) == GROW:
            return np.int64(GROW)
        see_crowd(st, cd, node, size)
        bit = blended(cd, TREE_NET, False, TREE_KIND + node.what + 3 * (st.counters.side != 0), context, want)
    else:
        bit = code(cd, context, want)
    if bit >= 0:
        st.tally[SIGNIFICANCE] += 1
    return bit


@inlined
def _place(st, size):
    """Places of cells of ``2**size`` samples in the store, with room for neighbours outside the box."""
    return np.int64(4) << (st.grid.exponent - size)


@inlined
def _count(st, size, x, y, z, vertices, births):
    """Count vertices and new components in a cell of ``2**size`` samples."""
    page, cell = spot(st.crowd, x + _place(st, size), y, z)
    cells = st.crowd.pages[np.uint64(page)]
    here = np.int64(cells[np.uint64(cell)])
    here += min(vertices, _MOST_VERTICES - (here & _MOST_VERTICES))
    here += min(births, _MOST_BIRTHS - (here >> 20)) * BIRTH
    cells[np.uint64(cell)] = here


@inlined
def add_birth(st, cd, x, y, z):
    """Main profile: count a new component at (x, y, z) in all cells that hold it."""
    if not mixing(cd):
        return
    st.counters.births += 1
    for size in range(st.grid.exponent + 1):
        _count(st, size, x >> size, y >> size, z >> size, np.int64(0), np.int64(1))


@inlined
def _cell_of(st, i, size):
    """The cell of ``2**size`` samples that holds a vertex."""
    vertex = st.vertex[np.uint64(i)]
    return np.int64(vertex[0]) >> size, np.int64(vertex[1]) >> size, np.int64(vertex[2]) >> size


@inner
def count_cells(st, size):
    """Count the vertices in cells of ``2**size`` samples that were known before the round; GROW if there is no room.

    Most sizes are never looked at in a round that brings no new component.
    """
    counters, told = st.counters, st.censuses
    while told[size] < counters.counted:
        if full(st.crowd, 1):
            return GROW
        # vertices that follow one another are near one another: of large cells, many lie in one
        first = told[size]
        x, y, z = _cell_of(st, first, size)
        i = first + 1
        while i < counters.counted and _cell_of(st, i, size) == (x, y, z):
            i += 1
        _count(st, size, x, y, z, i - first, np.int64(0))
        told[size] = i
    return DONE


@inlined
def begin_round(st):
    """Before the root is coded: the vertices known now are those that count."""
    st.counters.counted = st.counters.vertices


@inlined
def rarity(st):
    """Class, 0 to 12, of how many vertices there are for one new component."""
    vertices, births = st.counters.vertices + 1, st.counters.births + 1
    # the bits of their quotient, less one, without a division
    more = max(bits(vertices) - bits(births), 0)
    return min(max(more - (births << more > vertices), 0), 12)


@inlined
def _class(x):
    """0 to 3 are classes of their own, then one for each power of two, up to 512 and more."""
    return x if x < 4 else min(bits(x), 10) + 1


@inlined
def _see_cells(st, cd, first, n, x, y, z):
    """A row for each cell around one: classes of the vertices and of the new components in it."""
    row = cd.blend.row
    count = row[0]
    far, deep = (2, 0) if n == 2 else (1, 1)
    near = st.scratch[:PAGES_AROUND]
    pages_around(st.crowd, x, y, z, far, deep, near)
    for i in range(x - far, x + far + 1):
        for j in range(y - far, y + far + 1):
            for k in range(z - deep, z + deep + 1):
                if i == x and j == y and k == z:
                    continue
                c = get_around(st.crowd, near, i, j, k)
                count += 1
                vertices, births = min(c & _MOST_VERTICES, CELL_CLASSES - 1), min(c >> 20, BIRTH_CLASSES - 1)
                row[np.uint64(count)] = first + BIRTH_CLASSES * vertices + births
                first += CELL_SUMS
    row[0] = count


@inlined
def see_crowd(st, cd, node, size):
    """List what is known around a node of the tree, which is a cell of ``2**size`` samples."""
    what, shift, x, y, z, hits, child, near = node
    n = dimension(st.grid.tables)
    r = phase_of(n, st.counters.level)
    first = _FIRST_2 if n == 2 else _FIRST_3
    clear(cd)
    see(cd, first + (8 if what == SLOT else min(shift, 7)) * 3 + r)
    if child != ROOT:
        see(cd, first + 27 + min(hits, 2) * 8 + child)
    see(cd, first + 51 + (5 if what == NODE else near))
    see(cd, first + 81 + rarity(st))
    if size > st.grid.exponent:
        return
    x += _place(st, size)
    here = get(st.crowd, x, y, z)
    see(cd, first + 57 + _class(here & _MOST_VERTICES))
    see(cd, first + 69 + _class(here >> 20))
    _see_cells(st, cd, _CELLS_2 if n == 2 else _CELLS_3, n, x, y, z)
