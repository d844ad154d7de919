"""Geometry: bits of the values at vertices, or of the crossings' offsets on grid edges (spec clauses 5.6, 5.7).

Rows C2-geometry and the offsets of the full grid. Both code the distance from where the sign already says the
number to be, from the highest bit down.
"""

from __future__ import annotations

import numpy as np

from ..entropy import baseline as ctx
from ..entropy.coder import ENCODE, MODE, code
from ..jit import CUT, DONE, NEED, inner, kernel
from ..mesh.access import dimension
from .state import EDGE, LEAVES, LEVEL, OFFSET_BIT, SCRATCH, TALLY, VALUE_BIT, corner_entry

# Registers in State.walk: next item of the list, the symbol before, the place within a digit, its sign.
ITEM, BEFORE, STEP, SIDE = range(4)
VERTEX_ACTIVE = 8
"""Bit of a vertex's mark that says it is in the list; bits 0 to 2 are the grid edges that leave it upwards."""


@inner
def _entries(st, i):
    """Store entries of the vertices of leaf i, into the scratch registers."""
    n = dimension(st.tables)
    r = st.at[LEVEL] % n
    cls = np.int64(st.leaf[i, 0])
    b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
    for j in range(n + 1):
        st.walk[SCRATCH + j] = corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, j)


@kernel
def active_vertices(st, mark, full, out):
    """Vertices that geometry by values refines, in the order of the leaves (spec clause 5.6.2).

    On the full grid these are the ends of the grid edges that are crossed, else all vertices of the leaves.
    """
    n = dimension(st.tables)
    e = st.walk[SCRATCH : SCRATCH + 4]
    count = 0
    for i in range(st.at[LEAVES]):
        _entries(st, i)
        for j in range(n + 1):
            drawn = not full
            if j > 0 and (e[j] ^ e[j - 1]) & 1:
                drawn = True
            if j < n and (e[j] ^ e[j + 1]) & 1:
                drawn = True
            v = (e[j] >> 1) - 1
            if drawn and not mark[v] & VERTEX_ACTIVE:
                mark[v] |= VERTEX_ACTIVE
                out[count] = v
                count += 1
    return count


@kernel
def crossed_edges(st, mark, out):
    """Grid edges of the full grid that are crossed, in the order of the leaves: lower end and axis (clause 5.7.2)."""
    n = dimension(st.tables)
    e = st.walk[SCRATCH : SCRATCH + 4]
    count = 0
    for i in range(st.at[LEAVES]):
        _entries(st, i)
        for j in range(n):
            if not (e[j] ^ e[j + 1]) & 1:
                continue
            a = (e[j] >> 1) - 1
            b = (e[j + 1] >> 1) - 1
            axis = 0
            while st.vertex[a, axis] == st.vertex[b, axis]:
                axis += 1
            low = a if st.vertex[a, axis] < st.vertex[b, axis] else b
            if not mark[low] >> axis & 1:
                mark[low] |= 1 << axis
                out[count, 0] = low
                out[count, 1] = axis
                count += 1
    return count


@kernel
def values(st, cd, active, number, left, plane, wanted):
    """Bring the vertices' numbers down to ``plane`` bits left (spec clause 5.6.3).

    ``number`` is the distance from the isovalue's side of the interval as far as known, ``left`` the bits of it
    that are missing, ``wanted`` the encoder's whole number (empty for the decoder).
    """
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    while w[ITEM] < len(active):
        v = active[w[ITEM]]
        if left[v] <= plane:
            w[ITEM] += 1
            continue
        p = left[v] - 1
        bit = np.int64(0)
        if encoding:
            bit = (wanted[v] >> p) & 1
        bit = code(cd, ctx.VALUE + (p * 2 + np.int64(number[v] != 0)) * 3 + w[BEFORE], bit)
        if bit < 0:
            return CUT if bit == -2 else NEED
        st.at[TALLY + VALUE_BIT] += 1
        w[BEFORE] = 1 + bit
        number[v] = number[v] << 1 | bit
        left[v] = p
    return DONE


@kernel
def offsets(st, cd, number, layer, parts, radix, wanted):
    """Divide the part of every edge that holds its crossing into ``radix`` parts (spec clause 5.7.3).

    The radix is odd and the digit counts from the middle part, so that a crossing drawn in the middle of its part
    is never moved away from where it is. ``layer`` numbers the layers of offsets, ``parts`` is the number of
    parts before this one; ``wanted`` are the encoder's offsets as 30-bit fractions.
    """
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    half = radix // 2
    contexts = ctx.OFFSET + min(layer, ctx.OFFSET_LAYERS - 1) * ctx.OFFSET_STRIDE
    while w[ITEM] < len(number):
        i = w[ITEM]
        step = w[STEP]
        digit = np.int64(0)
        if encoding:
            digit = ((wanted[i] * parts * radix) >> 30) - number[i] * radix - half
        if step == 0:
            bit = code(cd, contexts + w[BEFORE], np.int64(digit != 0))
        elif step == 1:
            bit = code(cd, contexts + 4 + w[BEFORE], np.int64(digit > 0))
        else:
            bit = code(cd, contexts + 8 + step - 2, np.int64(abs(digit) >= step))
        if bit < 0:
            return CUT if bit == -2 else NEED
        st.at[TALLY + OFFSET_BIT] += 1
        if step == 0 and bit:
            w[STEP] = 1
            continue
        if step == 1:
            w[SIDE] = bit
            bit = np.int64(1)
            step = 1
        # a magnitude goes on while its bits are 1 and larger ones exist
        if bit and step < half:
            w[STEP] = step + 1
            continue
        size = step if bit else step - 1
        if step == 0:
            size = np.int64(0)
        number[i] = number[i] * radix + half + (size if w[SIDE] else -size)
        w[BEFORE] = 1 if size == 0 else (3 if w[SIDE] else 2)
        w[STEP] = 0
        w[SIDE] = 0
        w[ITEM] = i + 1
    return DONE
