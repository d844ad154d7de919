"""Squares beside edges: what the curve goes on to, on the full grid as on leaves that happen to be as fine."""

from __future__ import annotations

import numpy as np

from isocodec import Decoder, encode
from isocodec.grid.models.crossing_candidates import _SECOND, NEXT, TURNS, UNIT
from isocodec.grid.models.crossings_nearby import _join_leaves
from isocodec.grid.models.magnitude import FEW_TIMES, bits, by_few
from tables import looped


@looped("shape", [(9, 14), (2, 2), (6, 7, 5), (2, 3, 2)])
@looped("seed", range(3))
@looped("holes", [False, True])
def test_edges_of_the_full_grid_are_joined_like_those_of_leaves(shape, seed, holes):
    noise = np.random.default_rng(seed).normal(size=shape)
    field = np.ma.masked_where(noise > 1.2, noise[::-1]) if holes else noise
    data = encode(field, 0.1, precision=0.05)
    decoder = Decoder()
    # a complete file keeps no tables
    decoder.feed(data[:-1])
    tube = decoder.take().grid.tubes[-1]
    found, n = tube.estimates, len(shape)
    edges, around = found.edges, found._beside.around
    assert len(edges) and (around[:, TURNS] < 1 << 8).all()
    same = np.full_like(around, -1)
    leaving = np.full((tube.vertices, n), -1, np.int32)
    _join_leaves(tube.state, tube.numbers, edges, np.ones(len(edges), np.int64), leaving, same)
    np.testing.assert_array_equal(around[:, NEXT:], same[:, NEXT:])
    for side in range(2 * n - 2):
        turns = [table[:, TURNS] >> 2 * side & 3 for table in (around, same)]
        there = around[:, NEXT + side] >= 0
        np.testing.assert_array_equal(*(turn[there] for turn in turns))
        # each edge that the curve goes on to leads back
        for e in np.flatnonzero(there):
            assert e in around[around[e, NEXT + side], NEXT:]


def test_the_second_crossing_of_a_straight_curve_lies_two_squares_away():
    for down in (0, 1):
        assert _SECOND[9 * down].tolist() == [2 * UNIT, 0, 0, -1]


def test_numbers_are_divided_by_few_as_by_any():
    for count in (1, 2, 3, 7, 27, 62, 63, 64, 1 << 20):
        for x in [*range(300), *range(FEW_TIMES - 300, FEW_TIMES), *range(count * 4000 - 3, count * 4000 + 3)]:
            if 0 <= x < FEW_TIMES:
                assert by_few(np.int64(x), count) == x // count
    assert [bits(np.int64(x)) for x in (0, 1, 2, 4095, 4096, 1 << 40)] == [0, 1, 2, 12, 13, 41]
