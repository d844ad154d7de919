"""The mesh as a file: against recursive bisection, and read back with the libraries that its users have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import blobs, examples, meshes, mixed_leaves, volumes
from commands import BALL, HILLS
from files import fed
from isocodec.drawing.tessellation import Tessellation
from isoconform.meshes import chosen


@st.composite
def cases(draw, n: int, most: int):
    shape = tuple(draw(st.lists(st.integers(2, most), min_size=n, max_size=n)))
    return shape, draw(meshes(shape, frozenset())), draw(st.integers(0, 2**16))


def check_mesh(case, n: int) -> None:
    """It fills the box, is conforming, and its crossed leaves are those of recursive bisection."""
    shape, mesh, seed = case
    field = blobs(shape, seed)
    plan = [("adaptive_base", 0, chosen(shape, mesh))]
    decoder = fed(isocodec.encode(field, 0.5, layers=plan))
    whole = decoder.grid.mesh()
    corners = whole.points[whole.cells]
    assert volumes(corners).min() > 0
    assert volumes(corners).sum() == np.prod(np.array(shape) - 1) * (2 if n == 2 else 6)
    sides = np.sort(np.concatenate([np.delete(whole.cells, i, axis=1) for i in range(n + 1)]), axis=1)
    side, count = np.unique(sides, axis=0, return_counts=True)
    assert count.max() <= 2
    at = whole.points[side[count == 1]]
    border = (at == 0).all(axis=1) | (at == np.array(shape) - 1).all(axis=1)
    assert border.any(axis=1).all()  # a side with one simplex lies on the border: no hanging vertices
    signs = whole.above[whole.cells]
    mixed = signs.any(axis=1) & ~signs.all(axis=1)
    crossed = np.unique(whole.cells[mixed])
    assert np.array_equal(whole.above[crossed], field[tuple(whole.points[crossed].T)])
    tube = decoder.grid.mesh(whole=False)

    def named(mesh: Tessellation, cells) -> set[tuple[int, frozenset[tuple[int, ...]]]]:
        levels = mesh.levels[cells]
        return {(int(level), frozenset(map(tuple, places))) for level, places in
                zip(levels.tolist(), mesh.points[mesh.cells[cells]].tolist(), strict=True)}

    expected = {
        (level, frozenset(map(tuple, np.frombuffer(places, np.int64).reshape(n + 1, n).tolist())))
        for level, places in mixed_leaves(field, mesh)
    }
    assert named(whole, mixed) == named(tube, slice(None)) == expected
    assert np.array_equal(tube.above, field[tuple(tube.points.T)])


@given(cases(2, 12))
@examples(40)
def test_meshes_in_the_plane(case) -> None:
    check_mesh(case, 2)


@given(cases(3, 6))
@examples(25)
def test_meshes_in_space(case) -> None:
    check_mesh(case, 3)


@pytest.mark.parametrize("field, isovalue", [(HILLS, 60.5), (BALL, 50.5)])
def test_on_the_full_grid_signs_are_those_of_all_samples(field: np.ndarray, isovalue: float) -> None:
    mesh = fed(isocodec.encode(field, isovalue)).grid.mesh()
    assert len(mesh.points) == field.size
    assert np.array_equal(mesh.above, field[tuple(mesh.points.T)] > isovalue)
    nothing = fed(isocodec.encode(field, -1)).grid.mesh()
    assert nothing.above.all()
