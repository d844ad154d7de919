"""Values: bits of the distance from the isovalue, from the highest down (spec clause 5.6)."""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE, Coder
from ...kernel import DONE, kernel
from ...kernel.types import IntVector
from ..models.value_bits import Nearby, code_value_bit, doubled, implied_bit
from ..models.value_rows import go_to_row
from ..tube.state import VALUE_BIT, State


@kernel
def values(
    st: State, cd: Coder, nearby: Nearby, active: IntVector, number: IntVector, left: IntVector, plane: int,
    wanted: IntVector,
) -> int:
    """Bring the vertices' numbers down to ``plane`` bits left (spec clause 5.6.3).

    ``number`` is the distance from the isovalue's side of the interval as far as known, ``left`` the bits of it
    that are missing, ``wanted`` the encoder's whole number (empty for the decoder).
    """
    walk = st.value
    encoding = cd.reg.mode == ENCODE
    while walk.item < len(active):
        v = np.uint64(active[np.uint64(walk.item)])
        if left[v] <= plane:
            walk.item += 1
            continue
        if len(nearby.rows.first) > 0:
            walk.row = go_to_row(nearby.rows, walk.row, walk.item)
        p = left[v] - 1
        bit = implied_bit(nearby, number, v, p)
        if bit < 0:
            bit = np.int64(0)
            if encoding:
                bit = (wanted[v] >> p) & 1
            bit = code_value_bit(st, cd, nearby, number, v, p, bit)
            if bit < 0:
                return bit
            st.tally[VALUE_BIT] += 1
            walk.before = 1 + bit
        number[v] = number[v] << 1 | bit
        left[v] = p
        if len(nearby.told) > 0:
            nearby.told[np.uint64(walk.item)] = doubled(st, number, left, v)
    return DONE


@kernel
def enter_told(st: State, active: IntVector, number: IntVector, left: IntVector, told: IntVector) -> None:
    """Enter what is known of the vertices of a list, and behind them the entry for all others."""
    for i in range(len(active)):
        told[i] = doubled(st, number, left, np.uint64(active[i]))
    told[len(active)] = 0
