"""The order of lattice points (clause 4.8), and rounds of refinement that follow it (clause 5.4)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from isocodec.errors import FormatError
from isocodec.format.header import Header, write_header
from isocodec.grid.lattice.order import in_order
from isoconform.fields import random_numbers
from isoconform.streams import File, layers, steps_of
from isospec.container import ALL, Operation

BLOCKS = {2: (64, 64), 3: (8, 8, 64)}


def key(point):
    """Block and place in it, as the clause says it."""
    return [p // b for p, b in zip(point, BLOCKS[len(point)], strict=True)], list(point)


def points(n, most):
    return st.lists(st.tuples(*[st.integers(0, most)] * n), max_size=40)


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("most", [9, 200, 1 << 21, (1 << 31) - 1])
@examples(40)
@given(data=st.data())
def test_order_by_blocks(n, most, data):
    """Few points and many, sides whose numbers take more than 63 bits together."""
    given_points = data.draw(points(n, most))
    array = np.array(given_points, np.int64).reshape(-1, n)
    assert array[in_order(array)].tolist() == sorted(map(list, given_points), key=key)


@pytest.mark.parametrize("most", [70, (1 << 31) - 1])
@examples(40)
@given(data=st.data())
def test_further_points_decide_among_equals(most, data):
    low = data.draw(st.lists(st.tuples(st.integers(0, 3), st.integers(60, 70)), min_size=1, max_size=30))
    high = data.draw(st.lists(st.tuples(*[st.integers(0, most)] * 2), min_size=len(low), max_size=len(low)))
    both = sorted(zip(low, high, strict=True), key=lambda pair: (key(pair[0]), pair[1]))
    a, b = np.array(low, np.int64), np.array(high, np.int64)
    order = in_order(a, b)
    assert list(zip(map(tuple, a[order].tolist()), map(tuple, b[order].tolist()), strict=True)) == both


def test_corners_that_contradict_are_malformed():
    """Random bits: two components of a base disagree on what lies between them, and diamonds on a corner's sign."""
    program, clauses = steps_of((Operation.BASE, 3), (Operation.REFINE, ALL)), set()
    for seed in range(300):
        run = layers(program, bytes(random_numbers(seed, 400, 8)))
        decoder = isocodec.Decoder()
        try:
            decoder.feed(bytes(File(write_header(Header((9, 9, 9), 0.5)), (run,))))
            list(decoder)
        except FormatError as error:
            clauses.add(error.clause)
    assert "5.4.3" in clauses
