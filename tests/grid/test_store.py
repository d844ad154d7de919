"""The paged store against a dictionary, and where its cells lie."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brute import examples
from isocodec.grid.lattice.store import full, get, grown, new_store, page_of, put
from isocodec.grid.lattice.tables import PAGE_SHIFT


@examples(100)
@given(st.data(), st.sampled_from([2, 3]))
def test_store_is_a_dictionary(data, n):
    """Any sequence of puts and gets; far apart, and side by side within a page."""
    side = data.draw(st.sampled_from([20, 1 << 10, 1 << 20 if n == 3 else 1 << 24]))
    key = st.tuples(*[st.integers(0, side - 1)] * n, *[st.just(0)] * (3 - n))
    keys = data.draw(st.lists(key, min_size=1, max_size=60))
    store, model = new_store(n), {}
    for place in keys:
        assert get(store, *place) == model.get(place, 0)
        if full(store, 1):
            store = grown(store, 1)
            assert not full(store, 1)
        value = data.draw(st.integers(-(1 << 31), (1 << 31) - 1))
        put(store, *place, value)
        model[place] = value
    for place in data.draw(st.lists(key, max_size=20)) + list(model):
        assert get(store, *place) == model.get(place, 0)


@pytest.mark.parametrize(("n", "k"), [(2, 24), (3, 20)])
def test_cells_of_the_largest_crowd_lie_apart(n, k):
    """Four times as far along the first axis as the largest domain: no two places share a page."""
    store, page = new_store(n), 1 << PAGE_SHIFT[n]
    places = {}
    for x in (4, (4 << k - 1) + 4, (4 << k) + 4, 5 << k):
        for y in range(0, 6 * page, page):
            places[x, y, 0] = len(places) + 1
    for place, number in places.items():
        if full(store, 1):
            store = grown(store, 1)
        put(store, *map(np.int64, place), number)
    assert all(get(store, *map(np.int64, place)) == number for place, number in places.items())
    pages = {tuple(int(c) for c in page_of(key)) for key in store.table[store.table[:, 0] >= 0, 0]}
    assert pages == {(x // page, y // page, z) for x, y, z in places}
