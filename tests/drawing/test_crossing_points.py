"""Where the points of a drawing lie: on coarser meshes, by values, by stated offsets, and where nothing is known."""

from __future__ import annotations

import numpy as np
import pytest

from brute import noise
from drawings import check_manifold, check_winding, leaves_of
from isocodec.drawing.drawing import draw
from isocodec.drawing.leaves import Leaves
from tables import looped

# --- coarser meshes --------------------------------------------------------------------------------------------------


@looped("bisections", range(4))
@looped("shape", [(17, 17), (14, 19), (9, 9, 9), (7, 8, 10)])
def test_simplex_drawing_is_a_manifold_with_the_high_values_inside(shape, bisections):
    for closed in (False, True):
        field = noise(shape, bisections, closed)
        leaves = leaves_of(field, size=4, bisections=bisections)
        contour = draw(leaves)
        check_manifold(contour)
        if closed:
            check_winding(contour, leaves)


# --- where the points lie --------------------------------------------------------------------------------------------


def test_offsets_place_points_and_take_precedence_over_values():
    field = noise((9, 12), 11)
    exact = draw(leaves_of(field))
    plain = leaves_of(np.sign(field))
    low = np.floor(exact.points).astype(np.int64)
    index = {tuple(p): i for i, p in enumerate(plain.position.tolist())}
    high = np.ceil(exact.points).astype(np.int64)
    ends = [[index[tuple(p)], index[tuple(q)]] for p, q in zip(low.tolist(), high.tolist(), strict=True)]
    offset = (exact.points - low).max(axis=1)
    parts = np.ones(len(offset), np.int64)
    stated = Leaves(**{**vars(plain), "edges": np.array(ends), "edge_offset": offset, "edge_parts": parts})
    drawn = draw(stated)
    assert np.allclose(drawn.points, exact.points, atol=1e-12, rtol=0) and (drawn.cells == exact.cells).all()
    some = Leaves(**{**vars(stated), "edges": stated.edges[:5], "edge_offset": offset[:5], "edge_parts": parts[:5]})
    assert (draw(some).points != draw(plain).points).any(axis=1).sum() == 5


@pytest.mark.parametrize("full", [True, False])
def test_points_are_in_the_middle_where_nothing_is_known_and_never_leave_their_edge(full):
    field = noise((8, 8), 5)
    leaves = leaves_of(field) if full else leaves_of(field, size=2, bisections=1)
    middle = draw(Leaves(**{**vars(leaves), "value": np.full(len(leaves.position), np.nan)}))
    for useless in (np.nan, np.inf, -np.inf, 1.0, 0.0):
        value = np.full(len(leaves.position), useless)
        assert (draw(Leaves(**{**vars(leaves), "value": value})).points == middle.points).all()
    huge = np.where(leaves.above, 1.7e308, -1.7e308)
    wrong = np.where(leaves.above, -1.0, 5.0) - leaves.position[:, 0]
    for value in (huge, wrong):
        drawn = draw(Leaves(**{**vars(leaves), "value": value}))
        reach = 0.5 if full else 1.5
        assert np.isfinite(drawn.points).all() and (np.abs(drawn.points - middle.points) <= reach).all()
