"""Offsets in the baseline profile: digits that count from the middle part (spec clause 5.7.3)."""

from __future__ import annotations

import numpy as np

from ..entropy.range_coder import ENCODE, Coder, code
from ..field.samples import OFFSET_BITS
from ..kernel import DONE, inlined, kernel
from ..kernel.types import IntVector
from ..models import contexts as ctx
from ..models.offsets import Crossings
from ..tube.state import OFFSET_BIT, State
from .offsets import beyond, leans, radix_of


@inlined
def _wanted_part(crossings, i, radix, wanted):
    """Encoder: the part that holds the crossing, of the ``radix`` that the present one is divided into."""
    return ((wanted[i] * crossings.parts[i] * radix) >> OFFSET_BITS) - crossings.number[i] * radix


@inlined
def _enter(walk, crossings, i, radix, part):
    """Enter a part, of the ``radix`` that the present one is divided into; the next digit begins."""
    size = part - radix // 2
    crossings.number[i] = crossings.number[i] * radix + part
    crossings.parts[i] *= radix
    walk.before = 1 if size == 0 else (3 if size > 0 else 2)
    walk.step = 0
    walk.sign = 0


@inlined
def _lean(st, cd, crossings, i, radix, wanted):
    """One symbol of a digit that counts from the earlier isovalue's crossing: whether it is farther (clause 5.9.5)."""
    walk = st.digit
    step = walk.step
    bound, room = beyond(crossings, i, radix, st.counters.side)
    way = np.int64(1 if crossings.rising[i] == (st.counters.side > 0) else -1)
    bit = np.int64(0)
    if step < room:
        if cd.reg.mode == ENCODE:
            bit = np.int64((_wanted_part(crossings, i, radix, wanted) - bound) * way > step)
        bit = code(cd, ctx.OFFSET_LEAN + min(step, 7) * 16 + min(room - step, 15), bit)
        if bit < 0:
            return bit
        st.tally[OFFSET_BIT] += 1
    if bit:
        walk.step = step + 1
    else:
        _enter(walk, crossings, i, radix, bound + way * step)
    return np.int64(DONE)


@inlined
def _count(st, cd, crossings, i, radix, wanted):
    """One symbol of a digit: whether it is 0, its sign, or whether its magnitude goes on."""
    walk = st.digit
    half = radix // 2
    step = walk.step
    digit = np.int64(0)
    if cd.reg.mode == ENCODE:
        digit = _wanted_part(crossings, i, radix, wanted) - half
    again = ctx.OFFSET_SIZES if crossings.parts[i] > 1 else 0
    contexts = ctx.OFFSET + (min(half, ctx.OFFSET_SIZES) - 1 + again) * ctx.OFFSET_STRIDE
    if step == 0:
        bit = code(cd, contexts + walk.before, np.int64(digit != 0))
    elif step == 1:
        bit = code(cd, contexts + 4 + walk.before, np.int64(digit > 0))
    else:
        bit = code(cd, contexts + 8 + step - 2, np.int64(abs(digit) >= step))
    if bit < 0:
        return bit
    st.tally[OFFSET_BIT] += 1
    if step == 0 and bit:
        walk.step = 1
        return np.int64(DONE)
    if step == 1:
        walk.sign = bit
        bit = np.int64(1)
    # a magnitude goes on while its bits are 1 and larger ones exist
    if bit and step < half:
        walk.step = step + 1
        return np.int64(DONE)
    size = step if bit else max(step - 1, 0)
    _enter(walk, crossings, i, radix, half + (size if walk.sign else -size))
    return np.int64(DONE)


@kernel
def digits(st: State, cd: Coder, crossings: Crossings, target: int, unit: int, wanted: IntVector) -> int:
    """Divide the part of every edge that holds its crossing until there are ``target`` in ``2**unit`` samples.

    Radices are odd and a digit counts from the middle part, so that a crossing drawn in the middle of its part is
    never moved away from where it is. Where the edge is also crossed at an earlier isovalue, the digit counts from
    there. ``wanted`` are the encoder's offsets as 30-bit fractions.
    """
    walk = st.digit
    while walk.item < len(crossings.number):
        # only an index: unsigned, no test whether it counts from the end
        i = np.uint64(walk.item)
        radix = radix_of(crossings.length[i], crossings.parts[i], target, unit)
        if radix == 1:
            walk.item += 1
            continue
        if leans(crossings, i):
            status = _lean(st, cd, crossings, i, radix, wanted)
        else:
            status = _count(st, cd, crossings, i, radix, wanted)
        if status < 0:
            return status
    return DONE
