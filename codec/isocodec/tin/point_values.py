"""Coding of values at points, predicted from the triangulation of the known ones (spec clause 10.9.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..entropy.guesses import clear_opinions, decided, hear
from ..entropy.range_coder import Coder, code
from ..kernel import BAD, DONE, GROW, inlined, inner, kernel, record
from ..kernel.types import Int32Vector, IntVector
from .delaunay import insert_inside, locate
from .models import CONTEXT, EXPONENTS, MISSES, MIX_SIGN, MIX_SIZE, MIX_ZERO, PARTS, REACHES, SPREADS
from .triangulation import Triangulation, orientation

(
    _RAW, _ZERO_SPREAD, _ZERO_REACH, _ZERO_PART, _ZERO_NEXT, _SIGN_PART, _SIGN_NEXT, _SIGN_PAST, _SIZE_MISS,
    _SIZE_SPREAD, _SIZE_REACH, _DIGIT,
) = CONTEXT.firsts(
    "RAW", "ZERO_SPREAD", "ZERO_REACH", "ZERO_PART", "ZERO_NEXT", "SIGN_PART", "SIGN_NEXT", "SIGN_PAST", "SIZE_MISS",
    "SIZE_SPREAD", "SIZE_REACH", "DIGIT",
)
_FINE = 8
_MOST_WEIGHT = 24
"""Bits of the weights of a prediction."""


@record
class Values(NamedTuple):
    """Numbers of vertices (``number``), and the errors of their predictions in eighths (``miss``), where known.

    ``seen`` describes a point: the prediction times ``2**8``, the classes of the spread of values, of misses and of the
    triangle's size, the number of vertices used, the value of the nearest one, the sum of signs of their misses.
    ``most`` is the largest number.
    """

    number: IntVector
    miss: IntVector
    seen: IntVector
    most: IntVector


_GUESS, _SPREAD, _MISS, _REACH, _COUNT, _NEXT, _LEANING, SEEN = range(8)


@inlined
def _bits(x):
    count = np.int64(0)
    while x > 0:
        x >>= 1
        count += 1
    return count


@inner
def _see(v, a, b, c, wa, wb, wc, reach):
    """Describe a point by the surrounding vertices and their weights; vertices below 0 are absent."""
    while wa + wb + wc >= 1 << _MOST_WEIGHT:
        wa, wb, wc = wa >> 1, wb >> 1, wc >> 1
    n = v.number
    low = high = nearest = n[a]
    best = wa
    miss = abs(v.miss[a])
    leaning = np.sign(v.miss[a])
    count = 1
    for turn in range(2):
        w, p = (wb, b) if turn == 0 else (wc, c)
        if p < 0:
            continue
        low, high = min(low, n[p]), max(high, n[p])
        miss += abs(v.miss[p])
        leaning += np.sign(v.miss[p])
        count += 1
        if w > best or (w == best and n[p] < nearest):
            best, nearest = w, n[p]
    total = wa * n[a] + (wb * n[b] if b >= 0 else 0) + (wc * n[c] if c >= 0 else 0)
    weights = max(wa + wb + wc, 1)
    v.seen[_GUESS] = (total << _FINE) // weights
    v.seen[_SPREAD] = min(_bits(high - low), SPREADS - 1)
    v.seen[_MISS] = min(_bits(miss // count), MISSES - 1)
    v.seen[_REACH] = min(reach, REACHES - 1)
    v.seen[_COUNT] = count
    v.seen[_NEXT] = nearest
    v.seen[_LEANING] = leaning


@inner
def _see_in(tri, v, p):
    """Describe a point by the triangle that contains it; on a side, by the two ends of that side."""
    o = 3 * locate(tri, p)
    a, b, c = np.int64(tri.origin[o]), np.int64(tri.origin[o + 1]), np.int64(tri.origin[o + 2])
    wa, wb, wc = orientation(tri, b, c, p), orientation(tri, c, a, p), orientation(tri, a, b, p)
    if wa == 0:
        a, wa, c, wc = c, wc, np.int64(-1), np.int64(0)
    elif wb == 0:
        b, wb, c, wc = c, wc, np.int64(-1), np.int64(0)
    elif wc == 0:
        c = np.int64(-1)
    if c >= 0:
        _see(v, a, b, c, wa, wb, wc, _bits(wa + wb + wc) >> 1)
        return
    if b < a:
        a, b = b, a
    dx, dy = abs(tri.x[a] - tri.x[b]), abs(tri.y[a] - tri.y[b])
    if dx >= dy:
        _see(v, a, b, c, abs(tri.x[b] - tri.x[p]), abs(tri.x[a] - tri.x[p]), np.int64(0), _bits(dx))
    else:
        _see(v, a, b, c, abs(tri.y[b] - tri.y[p]), abs(tri.y[a] - tri.y[p]), np.int64(0), _bits(dy))


@inner
def _relation(number, guess):
    """Whether a value lies below, at or above a prediction, when both are whole."""
    return np.int64(number > guess) - np.int64(number < guess) + 1


@inner
def _code_size(cd, v, size):
    """Code the size of a miss, 1 or more: the number of its bits, then the bits."""
    s = v.seen
    digits = np.int64(0)
    told = _bits(size)
    while digits < EXPONENTS - 1:
        clear_opinions(cd)
        hear(cd, _SIZE_MISS + digits * MISSES + s[_MISS])
        hear(cd, _SIZE_SPREAD + digits * SPREADS + s[_SPREAD])
        hear(cd, _SIZE_REACH + digits * REACHES + s[_REACH])
        bit = decided(cd, MIX_SIZE + digits, np.int64(told > digits + 1))
        if bit < 0:
            return bit
        if bit == 0:
            break
        digits += 1
    found = np.int64(1)
    for place in range(digits):
        bit = code(cd, _DIGIT + digits * 4 + min(place, 3), size >> (digits - 1 - place) & 1)
        if bit < 0:
            return bit
        found = found << 1 | bit
    return found


@inner
def _code_number(cd, v, p):
    """Code the number of a point in the context of ``seen``; negative if the coder stops, or BAD."""
    s = v.seen
    most = v.most[0]
    guess = (s[_GUESS] + (1 << _FINE >> 1)) >> _FINE
    part = (s[_GUESS] >> (_FINE - 2)) & (PARTS - 1)
    miss = v.number[p] - guess
    next_to = _relation(s[_NEXT], guess)
    alike = np.int64(min(s[_SPREAD], 2))
    clear_opinions(cd)
    hear(cd, _ZERO_SPREAD + s[_SPREAD] * MISSES + s[_MISS])
    hear(cd, _ZERO_REACH + s[_REACH] * MISSES + s[_MISS])
    hear(cd, _ZERO_PART + (s[_SPREAD] * PARTS + part) * 3 + s[_COUNT] - 1)
    hear(cd, _ZERO_NEXT + (next_to * SPREADS + s[_SPREAD]) * 3 + s[_COUNT] - 1)
    bit = decided(cd, MIX_ZERO + alike, np.int64(miss == 0))
    if bit < 0:
        return bit
    found = np.int64(0)
    if bit == 0:
        above = np.int64(miss > 0)
        if 0 < guess < most:
            clear_opinions(cd)
            hear(cd, _SIGN_PART + part * SPREADS + s[_SPREAD])
            hear(cd, _SIGN_NEXT + next_to * MISSES + s[_MISS])
            hear(cd, _SIGN_PAST + (s[_LEANING] + 3) * 3 + next_to)
            above = decided(cd, MIX_SIGN, above)
            if above < 0:
                return above
        else:
            above = np.int64(guess <= 0)
        found = np.int64(1)
        if most - guess > 1 if above else guess > 1:
            found = _code_size(cd, v, abs(miss))
            if found < 0:
                return found
        if not above:
            found = -found
    number = guess + found
    if number < 0 or number > most:
        return np.int64(BAD)
    v.number[p] = number
    v.miss[p] = (number << 3) - (s[_GUESS] >> (_FINE - 3))
    return number


@kernel
def code_corners(cd: Coder, v: Values, hull: Int32Vector) -> int:
    """Code the numbers of the corners of the hull, each predicted by the one before; the first one by digits."""
    for i in range(len(hull)):
        p = np.int64(hull[i])
        if i == 0:
            found = np.int64(0)
            width = _bits(v.most[0])
            for place in range(width):
                bit = code(cd, _RAW + place, v.number[p] >> (width - 1 - place) & 1)
                if bit < 0:
                    return bit
                found = found << 1 | bit
            if found > v.most[0]:
                return BAD
            v.number[p] = found
            v.miss[p] = 0
        else:
            a = np.int64(hull[i - 1])
            _see(v, a, np.int64(-1), np.int64(-1), np.int64(1), np.int64(0), np.int64(0), np.int64(REACHES))
            found = _code_number(cd, v, p)
            if found < 0:
                return found
    return DONE


@kernel
def code_inner(cd: Coder, tri: Triangulation, v: Values, order: Int32Vector, most: int) -> tuple[int, int]:
    """Code the numbers of points in order, and insert each into the triangulation; returns a status and their count.

    Stops as if bytes were missing once ``most`` triangles have been visited.
    """
    for i in range(len(order)):
        p = np.int64(order[i])
        if tri.reg.work > most:
            return GROW, i
        _see_in(tri, v, p)
        found = _code_number(cd, v, p)
        if found < 0:
            return found, i
        insert_inside(tri, p)
    return DONE, len(order)
