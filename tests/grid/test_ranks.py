"""Numbers of known vertices by position, links between them, and unit cells: beside plain dictionaries and leaves."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as some

from isocodec import Decoder, encode
from isocodec.drawing.crossing import edge_points
from isocodec.drawing.full_grid import draw_grid
from isocodec.drawing.snapshot import leaves_of
from isocodec.grid.passes.carriers import linked
from isocodec.grid.tube.ranks import enter_numbers_at
from isocodec.grid.tube.state import numbers_bytes, numbers_of

SHAPES = some.one_of(some.tuples(*[some.integers(2, 70)] * 2), some.tuples(*[some.integers(2, 19)] * 3))


def decoded_tube(shape, seed, calm, precision="signs"):
    """The decoded tube of noise, of which a part ``calm`` is constant."""
    random = np.random.default_rng(seed)
    field = np.where(random.random(shape) < calm, 0, random.integers(-9, 10, shape))
    decoder = Decoder()
    decoder.feed(encode(field, 0.5, precision=precision, profile=("main", "baseline")[seed % 2]))
    return decoder.take().grid._tube


@given(SHAPES, some.integers(0, 9), some.sampled_from([0, 0.9, 0.99]))
def test_numbers_and_links_are_those_of_the_list_of_vertices(shape, seed, calm):
    tube = decoded_tube(shape, seed, calm)
    st, n = tube.state, len(shape)
    vertices = st.vertex[: st.counters.vertices].tolist()
    place = {(x, y, z): v for v, (x, y, z, _) in enumerate(vertices)}
    numbers = numbers_of(st)
    assert numbers_bytes(st) == numbers.first.nbytes + numbers.vertex.nbytes
    everywhere = np.array(list(itertools.product(*(range(size) for size in (*shape, 1)[:3]))), np.int64)
    found = np.empty(len(everywhere), np.int64)
    enter_numbers_at(numbers, everywhere, found)
    assert found.tolist() == [place.get(tuple(p), -1) for p in everywhere.tolist()]

    wanted = np.zeros((len(vertices), 2 * n), np.int64)
    for v, (*at, _) in enumerate(vertices):
        for axis, way in itertools.product(range(n), (0, 1)):
            beside = list(at)
            beside[axis] += 1 - 2 * way
            u = place.get(tuple(beside), -1)
            wanted[v, 2 * axis + way] = 2 * (u + 1) + vertices[u][3] if u >= 0 else 0
    assert np.array_equal(linked(st, numbers), wanted)


@given(SHAPES, some.integers(0, 9), some.sampled_from([0, 0.9, 0.99]))
def test_cells_follow_from_known_vertices_as_from_leaves(shape, seed, calm):
    tube = decoded_tube(shape, seed, calm, "exact")
    leaves = leaves_of(tube, 0.5, lambda number, above: np.where(above, number, -number))
    assert leaves.known is not None and leaves.full
    known, listed = (draw_grid(one)[0] for one in (leaves, replace(leaves, known=None)))
    assert len(known.edges) == len(listed.edges) and len(known.centres) == len(listed.centres)
    assert len(known.cells) == len(listed.cells)

    def turned(drawn):
        """Cells as corners, of which a triangle begins with the least; as a sorted list."""
        points = np.concatenate([edge_points(leaves, drawn.edges, drawn.ratio), drawn.centres])
        rows = [tuple(map(tuple, row)) for row in points[drawn.cells].round(9).tolist()]
        if len(shape) == 3:
            rows = [min(row[i:] + row[:i] for i in range(3)) for row in rows]
        return sorted(rows)

    assert turned(known) == turned(listed)
