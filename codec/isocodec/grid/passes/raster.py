"""Raster layer: the signs of all samples of a plane that are not known yet, row by row (spec clause 5.12).

For curves without a shape to follow, as those of text and plots. Nothing is trained: each sign is coded by how often
the signs nearest before it have led to either.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from isospec.tables import MOST_LOGIT

from ...entropy.context_layout import Layout, opinion_coder, shipped_logistic
from ...entropy.lanes import LANES, LOGIT, MODEL, PLACE, ROOM, SEEN, adapt_together, hear_at, learn_together
from ...entropy.mixer import BUCKET, MIX_SHIFT
from ...entropy.range_coder import ENCODE, ONE, Coder, adapted, code, emit
from ...kernel import DONE, GROW, inlined, kernel, record
from ...kernel.prefetch import prefetch
from ...kernel.types import Int32Matrix, Int32Vector, IntMatrix, IntVector, Registers, UInt8Vector
from ..lattice.access import vertex
from ..lattice.store import get
from ..tube.leaf_list import push
from ..tube.state import SAMPLE, State, crowded, crowded_by, learn

BLOCK_SHIFT = 5
BLOCK = 1 << BLOCK_SHIFT
"""Samples along an edge of a block."""
NEAR = (6, 10, 16, 24, 34, 50)
"""Number of the nearest samples before a sample, for each of its contexts, that this looks at."""
HASH_BITS = 16
_WORD = 25
"""Samples in a word of what is hashed; there are two words."""
_FACTORS = 0x9E3779B1, 0x85EBCA77
_SURE_NEAR, _SURE_SEEN = 12, 6
_FAR = range(-8, 9)
_BEFORE = sorted((i * i + j * j, i, j) for i in _FAR for j in _FAR if (i, j) < (0, 0))[: NEAR[-1]]
"""The samples nearest before a sample: their distances squared, and those along both axes."""
REACH = max(max(-i, abs(j)) for _, i, j in _BEFORE)
"""Rows above a sample and columns beside it that those lie in; so many columns beside the box are kept, too."""
_ROWS = REACH + 1
_COLUMNS = 2 * REACH + 1
_PLACES = 2 * MOST_LOGIT + 2 >> BUCKET
"""Classes of probabilities that are mapped to others."""
CONTEXT = Layout({
    "block": (8, 0.5, 0),
    "near": (len(NEAR) << HASH_BITS, 0.5, 0),
    "sure": (_PLACES << _SURE_NEAR, 0.5, _SURE_SEEN),
})
_FIRST_NEAR, _FIRST_SURE = CONTEXT.firsts("near", "sure")
_LINE = 16
"""Models in a line of a processor's cache."""
_WEIGHT = 22000
_CLASSES = 8
"""Classes of the full grid's simplices."""
WORK = 64
"""Samples of the box that count as a unit of work."""
MOST_SAMPLES = 1 << 28
"""Samples of the box of a raster layer at most (spec clause 11.1)."""


class RasterWalk(Registers):
    """The next sample, whether the flag of the block that it begins has been coded, and whether samples were known.

    ``near`` are the signs nearest before the sample ``ahead`` of the row; -1 if they are those of none.
    """

    row: int
    column: int
    asked: int
    known: int
    near: int
    ahead: int


@record
class SampleRows(NamedTuple):
    """Progress of a raster layer.

    Attributes
    ----------
    pattern : (2 * REACH + 1, 2**(REACH + 1)) int64
        For each column around a sample and the signs of its last rows: those among the nearest, the nearest highest.
    columns : (REACH + s1 + REACH,) uint8
        Signs of the last rows in each column, the last one lowest; 0 beside the box.
    blocks : uint8
        By column of blocks two bits: whether the block has one sign, and that sign.
    model : (C,) int32
        Probability of a 1, and above its bits the symbols seen, of each of the contexts behind those of blocks.
    square : (16,) int64
        Class of the simplex of a unit square by the parities of its least corner and the corner off its diagonal.
    mix : (contexts + 1, 8) int32
        Weights of opinions, by how many contexts have been seen before; 0 beyond the contexts.
    lane : (32,) int32
        Models of the contexts of a sample: see `entropy.lanes`; 0 beyond the contexts.
    """

    walk: RasterWalk
    pattern: IntMatrix
    columns: UInt8Vector
    blocks: UInt8Vector
    model: Int32Vector
    square: IntVector
    mix: Int32Matrix
    lane: Int32Vector


def refusal(shape: tuple[int, ...], leans: bool) -> str:
    """Reason why an isovalue of a field may have no raster layer, or the empty string."""
    if len(shape) != 2:
        return "a raster layer of a volume; only planes have such layers"
    if leans:
        return "a raster layer of an isovalue that is predicted from another one"
    if shape[0] * shape[1] > MOST_SAMPLES:
        return f"a raster layer of more than {MOST_SAMPLES} samples"
    return ""


@cache
def _pattern() -> NDArray[np.int64]:
    """See `SampleRows`."""
    bits = np.zeros((_ROWS, _COLUMNS), np.int64)
    for k, (_, i, j) in enumerate(_BEFORE):
        # the last row known is that of the sample itself in the columns before it
        bits[-i - (j >= 0), REACH + j] = 1 << NEAR[-1] - 1 - k
    return (np.arange(1 << _ROWS)[:, None] >> np.arange(_ROWS) & 1).dot(bits).T.copy()


def _models() -> NDArray[np.int32]:
    """See `SampleRows`."""
    model = np.full(CONTEXT.count - _FIRST_NEAR, ONE >> 1, np.int32)
    sure = shipped_logistic().squash[(np.arange(_PLACES) << BUCKET) + (1 << BUCKET >> 1)]
    model[_FIRST_SURE - _FIRST_NEAR :].reshape(-1, _PLACES)[:] = sure | _SURE_SEEN << SEEN
    return model


def new_raster(shape: tuple[int, ...], known: bool) -> SampleRows:
    """Begin a raster layer; ``known``: whether there are known vertices already."""
    walk = RasterWalk()
    walk.known, walk.ahead = known, -1
    columns = np.zeros(shape[1] + 2 * REACH, np.uint8)
    blocks = np.zeros((shape[1] - 1 >> BLOCK_SHIFT) + 1, np.uint8)
    mix = np.zeros((len(NEAR) + 1, LANES), np.int32)
    mix[:, : len(NEAR)] = _WEIGHT
    return SampleRows(
        walk, _pattern(), columns, blocks, _models(), np.zeros(16, np.int64), mix, np.zeros(ROOM, np.int32)
    )


def raster_bytes(shape: tuple[int, ...]) -> int:
    """Bytes of the arrays of a raster layer and its models."""
    return shape[1] + 2 * REACH + (shape[1] >> BLOCK_SHIFT) + 4 * CONTEXT.count


def raster_coder(coder: Coder) -> Coder:
    """Models of blocks, apart from those of other layers; the run is that of ``coder``."""
    own = opinion_coder(Layout({"block": (_FIRST_NEAR, 0.5, 0)}), 0, 0)
    return own._replace(reg=coder.reg, buf=coder.buf)


@inlined
def _even(rs, j, end, sign):
    """Whether the last samples of all columns from j to before ``end`` have a sign."""
    other = np.uint8(0)
    for c in range(REACH + j, REACH + end):
        other |= rs.columns[np.uint64(c)] ^ np.uint8(sign)
    return np.int64(1 - (other & 1))


@inlined
def _uniform(st, i, j, sign):
    """Encoder: whether all samples of a block that are not known have a sign."""
    for y in range(i, min(i + BLOCK, st.grid.last0 + 1)):
        for x in range(j, min(j + BLOCK, st.grid.last1 + 1)):
            if st.truth[y, x, 0] != sign and get(st.known, y, x, 0) == 0:
                return np.int64(0)
    return np.int64(1)


@inlined
def _ask(st, cd, rs, i, j):
    """Code whether all samples of a block that are not known have the sign of the sample before it; as ``code``."""
    sign = np.int64(0)
    if j > 0 or i > 0:
        sign = np.int64(rs.columns[REACH + max(j - 1, 0)]) & 1
    b = j >> BLOCK_SHIFT
    left = np.int64(1) if j == 0 else np.int64(rs.blocks[b - 1] & 1)
    even = np.int64(1) if i == 0 else _even(rs, j, min(j + BLOCK, st.grid.last1 + 1), sign)
    ctx = left + 2 * np.int64(rs.blocks[b] & 1) + 4 * even
    bit = np.int64(0)
    if cd.reg.mode == ENCODE:
        bit = _uniform(st, i, j, sign)
    bit = code(cd, ctx, bit)
    if bit >= 0:
        rs.blocks[b] = 2 * sign + bit
    return bit


@inlined
def _read(model, at):
    """Probability of a 1 by a model, and how many symbols it has seen."""
    e = np.int64(model[np.uint64(at)])
    return e & ONE - 1, e >> SEEN


@inlined
def _adapt(cd, model, at, bit):
    """Adapt a model, as ``range_coder.adapt``."""
    p, seen = _read(model, at)
    p, seen = adapted(cd, p, seen, bit)
    model[np.uint64(at)] = p | seen << SEEN


@inlined
def _near(rs, j):
    """Signs nearest before sample j of the row, that of the nearest sample highest."""
    pattern = np.int64(0)
    for c in range(_COLUMNS):
        column = np.int64(rs.columns[np.uint64(j + c)])
        pattern |= rs.pattern[np.uint64(c), np.uint64(column & (1 << _ROWS) - 1)]
    return pattern


@inlined
def _context(pattern, i):
    """Context of the nearest signs, by how many of them it looks at."""
    low, high = pattern >> NEAR[-1] - min(NEAR[i], _WORD), np.int64(0)
    if NEAR[i] > _WORD:
        high = (pattern & (1 << NEAR[-1] - _WORD) - 1) >> NEAR[-1] - NEAR[i]
    spread = (low * _FACTORS[0] + high * _FACTORS[1]) & 0xFFFFFFFF
    return i << HASH_BITS | spread >> 32 - HASH_BITS


@inlined
def _first_sure(pattern):
    """Context of the least of all probabilities with the nearest signs."""
    return _FIRST_SURE - _FIRST_NEAR + (pattern >> NEAR[-1] - _SURE_NEAR) * _PLACES


@inlined
def _note(rs, j, sign):
    """Note the sign of sample j of the row."""
    at = np.uint64(REACH + j)
    rs.columns[at] = (np.int64(rs.columns[at]) << 1 | sign) & 255


@inlined
def _look_ahead(rs, j):
    """Fetch the models of sample j of the row, if there is one: it is likely the next one that is coded."""
    if j + _COLUMNS > len(rs.columns):
        return
    pattern = _near(rs, j)
    rs.walk.near, rs.walk.ahead = pattern, j
    for i in range(len(NEAR)):
        prefetch(rs.model, _context(pattern, i))
    first = _first_sure(pattern)
    for i in range(0, _PLACES, _LINE):
        prefetch(rs.model, first + i)


@inlined
def code_sign(cd, rs, j, bit):
    """Code the sign of sample j of a row by those nearest before it, and note it; as ``code``."""
    pattern = rs.walk.near if rs.walk.ahead == j else _near(rs, j)
    lane, used, total = rs.lane, np.int64(0), 0
    for i in range(len(NEAR)):
        used += np.int64(hear_at(cd, lane, i, rs.model, _context(pattern, i)) > 0)
    mix = rs.mix[np.uint64(used)]
    for i in range(len(NEAR)):
        total += lane[LOGIT + i] * np.int64(mix[i])
    place = MOST_LOGIT + min(max(total >> MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT)
    p = np.int64(cd.blend.squash[np.uint64(place)])
    sure = _first_sure(pattern) + (place >> BUCKET)
    settled, _ = _read(rs.model, sure)
    bit = emit(cd, (p + settled) >> 1, bit)
    if bit < 0:
        return bit
    _note(rs, j, bit)
    # what was learnt here is entered meanwhile
    _look_ahead(rs, j + 1)
    learn_together(lane, mix, (bit << 16) - p)
    adapt_together(lane, bit, len(cd.rate) - 1)
    for i in range(len(NEAR)):
        rs.model[np.uint64(lane[PLACE + i])] = lane[MODEL + i]
    _adapt(cd, rs.model, sure, bit)
    return bit


@inlined
def _vertex_at(st, cls, b0, b1, j):
    """Position of a vertex of a simplex of the full grid."""
    d0, d1, _ = vertex(st.grid.tables, 0, cls, j)
    return 2 * b0 + (d0 >> 1), 2 * b1 + (d1 >> 1)


@inlined
def _list_squares(st, rs):
    """Find the classes of the simplices of unit squares; the ends of the diagonal are their vertices 0 and 2."""
    zero = np.int64(0)
    for cls in range(_CLASSES):
        y0, x0 = _vertex_at(st, cls, zero, zero, 0)
        y1, x1 = _vertex_at(st, cls, zero, zero, 1)
        y2, x2 = _vertex_at(st, cls, zero, zero, 2)
        least0, least1 = min(y0, y2), min(x0, x2)
        rs.square[8 * (least0 & 1) + 4 * (least1 & 1) + 2 * (y1 - least0) + x1 - least1] = cls


@inlined
def _append(st, rs, i, j, signs):
    """Append the mixed simplices of the unit square with the last corner (i, j).

    ``signs`` are bits, of its corners in lexicographic order.
    """
    y, x = i - 1, j - 1
    b0, b1 = y >> 1, x >> 1
    for corner in range(4):
        # both ends of the square's diagonal have indices that are all even, or all odd
        if (y + x + (corner >> 1) + corner) & 1 == 0:
            continue
        sign = signs >> corner & 1
        # the diagonal's ends are the corners beside this one
        if signs >> (corner ^ 1) & 1 == sign and signs >> (corner ^ 2) & 1 == sign:
            continue
        cls = rs.square[np.uint64(8 * (y & 1) + 4 * (x & 1) + corner)]
        for v in range(3):
            v0, v1 = _vertex_at(st, cls, b0, b1, v)
            if get(st.known, v0, v1, 0) == 0:
                learn(st, v0, v1, 0, signs >> (2 * (v0 - y) + v1 - x) & 1)
        push(st, cls, b0, b1, np.int64(0), 2 * st.grid.exponent)


@inlined
def _put(st, rs, i, j, sign):
    """Learn the vertices and append the mixed simplices that a sample, whose sign is noted, is the last corner of."""
    if i == 0 and j == 0 and get(st.known, i, j, 0) == 0:
        learn(st, i, j, np.int64(0), sign)
    if i == 0 or j == 0:
        return
    before, column = np.int64(rs.columns[np.uint64(REACH + j - 1)]), np.int64(rs.columns[np.uint64(REACH + j)])
    signs = before >> 1 & 1 | column & 2 | (before & 1) << 2 | sign << 3
    if signs != 0 and signs != 15:
        _append(st, rs, i, j, signs)


@inlined
def _sign(st, cd, rs, i, j):
    """The sign of a sample, which is noted: known, that of its block, or coded; as ``code``."""
    if rs.walk.known:
        entry = np.int64(get(st.known, i, j, 0))
        if entry:
            _note(rs, j, entry & 1)
            return entry & 1
    block = np.int64(rs.blocks[np.uint64(j >> BLOCK_SHIFT)])
    if block & 1:
        _note(rs, j, block >> 1)
        return block >> 1
    bit = np.int64(0)
    if cd.reg.mode == ENCODE:
        bit = np.int64(st.truth[i, j, 0])
    bit = code_sign(cd, rs, j, bit)
    st.tally[SAMPLE] += bit >= 0
    return bit


@inlined
def _repeats(rs, i, j, end):
    """Whether samples j to before ``end`` lie in a block of one sign, and are the last corners of no mixed simplex."""
    block = np.int64(rs.blocks[np.uint64(j >> BLOCK_SHIFT)])
    if rs.walk.known or i == 0 or block & 1 == 0:
        return False
    sign = block >> 1
    before = np.int64(rs.columns[np.uint64(REACH + max(j - 1, 0))])
    return (j == 0 or before & 3 == 3 * sign) and _even(rs, j, end, sign) == 1


@inlined
def _go_on(st, cd, rs):
    """Code the next samples of a row: those of one block, or only one of them if arrays are nearly full."""
    walk = rs.walk
    i, j = walk.row, walk.column
    end = min(j | BLOCK - 1, st.grid.last1) + 1
    if crowded_by(st, 2 * BLOCK + 2, 2 * BLOCK):
        if crowded(st):
            return np.int64(GROW)
        end = j + 1
    if (i | j) & (BLOCK - 1) == 0 and walk.asked == 0:
        bit = _ask(st, cd, rs, i, j)
        if bit < 0:
            return bit
        st.tally[SAMPLE] += 1
        walk.asked = 1
    if _repeats(rs, i, j, end):
        for c in range(REACH + j, REACH + end):
            rs.columns[np.uint64(c)] = (rs.columns[np.uint64(c)] << 1) | (rs.columns[np.uint64(c)] & 1)
        walk.asked, walk.column = 0, end
        return np.int64(DONE)
    while j < end:
        sign = _sign(st, cd, rs, i, j)
        if sign < 0:
            return sign
        _put(st, rs, i, j, sign)
        walk.asked = 0
        j += 1
        walk.column = j
    return np.int64(DONE)


@kernel
def raster(st: State, cd: Coder, rs: SampleRows) -> int:
    """Code the signs of all samples from the next one on."""
    walk = rs.walk
    _list_squares(st, rs)
    while walk.row <= st.grid.last0:
        while walk.column <= st.grid.last1:
            status = _go_on(st, cd, rs)
            if status != DONE:
                return status
        walk.column, walk.ahead = 0, -1
        walk.row += 1
        st.counters.row = walk.row
    return DONE
