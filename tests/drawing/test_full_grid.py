"""Drawings of the full grid: against scikit-image, a marching squares written here, and by winding numbers."""

from __future__ import annotations

import itertools
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import isocodec
from brute import ball, noise
from drawings import as_set, check_manifold, euler, leaves_of, torus
from isocodec.drawing.drawing import draw
from libraries import Late
from tables import heavy

measure = Late("skimage.measure")
DATA = Path(__file__).parents[2] / "demo" / "data"


# --- n = 2, full grid ------------------------------------------------------------------------------------------------


def marching_squares(field):
    """Segments as pairs of points in the middle of grid edges; in a saddle the diagonal's corners are connected."""
    segments = set()
    for r, c in itertools.product(range(field.shape[0] - 1), range(field.shape[1] - 1)):
        ring = [(r, c), (r, c + 1), (r + 1, c + 1), (r + 1, c)]
        up = [bool(field[p] > 0) for p in ring]
        middles = [tuple((np.array(ring[i]) + ring[(i + 1) % 4]) / 2) for i in range(4)]
        crossing = [i for i in range(4) if up[i] != up[(i + 1) % 4]]
        if len(crossing) == 2:
            segments.add(frozenset(middles[i] for i in crossing))
        elif crossing:
            # Cut off the two corners of unequal parity: the other two are the ends of the diagonal.
            for i in range(4):
                if sum(ring[i]) % 2:
                    segments.add(frozenset((middles[i - 1], middles[i])))
    return segments


@pytest.mark.parametrize("seed", range(4))
def test_segments_are_those_of_marching_squares_with_saddles_joined_along_the_diagonal(seed):
    field = noise((13, 16), seed)
    contour = draw(leaves_of(field, values=False))
    drawn = [frozenset(map(tuple, contour.points[cell].tolist())) for cell in contour.cells]
    assert len(set(drawn)) == len(drawn)
    assert set(drawn) == marching_squares(field)


@pytest.mark.parametrize("full", [True, False])
def test_lines_cover_every_segment_once_and_are_closed_unless_they_end_at_the_border(full):
    field = noise((24, 19), 7)
    contour = draw(leaves_of(field) if full else leaves_of(field, size=2, bisections=1))
    check_manifold(contour)
    assert sum(len(line) - 1 for line in contour.lines) == len(contour.cells)
    last = np.array(contour.shape) - 1
    kinds = [bool((line[0] == line[-1]).all()) for line in contour.lines]
    assert True in kinds and False in kinds and kinds == sorted(kinds)
    for line, closed in zip(contour.lines, kinds, strict=True):
        if not closed:
            for end in (line[0], line[-1]):
                assert ((end == 0) | (end == last)).any()
        assert len(as_set(line, 12)) == len(line) - closed


# --- n = 3, full grid ------------------------------------------------------------------------------------------------


def all_patterns():
    """Each sign pattern of a cube once in each of the eight mirror images of a cell, and nothing else."""
    signs = np.zeros((49, 49, 25), dtype=bool)
    used: Counter[tuple[int, ...]] = Counter()
    for at in itertools.product(range(16), range(16), range(8)):
        corner = tuple(1 + 3 * i for i in at)
        parity = tuple(c & 1 for c in corner)
        pattern = np.array([used[parity] >> bit & 1 for bit in range(8)], dtype=bool)
        signs[tuple(slice(c, c + 2) for c in corner)] = pattern.reshape(2, 2, 2)
        used[parity] += 1
    assert len(used) == 8 and set(used.values()) == {256}
    return signs


def test_all_patterns_in_all_mirror_images_are_watertight():
    signs = all_patterns()
    contour = draw(leaves_of(np.zeros(signs.shape), values=False, above=signs))
    check_manifold(contour)
    sides = {(t[i], t[i - 2]) for t in contour.cells.tolist() for i in range(3)}
    assert all((b, a) in sides for a, b in sides)
    # 14 of the 256 patterns need a centre, which is the only kind of point that is not on a grid edge; further cells
    # of these patterns can arise around the cubes, so look only at the cubes themselves.
    halves = contour.points * 2
    centres = contour.points[(halves % 2 == 1).sum(1) != 1]
    in_cubes = ((centres % 3 > 1) & (centres % 3 < 2)).all(1)
    assert in_cubes.sum() == 14 * 8


def test_tunnel_is_drawn_as_a_tube():
    """Only x0 and xn of a cell above, each continued outwards: the mesh's diagonal connects them."""
    signs = np.zeros((4, 4, 4), dtype=bool)
    signs[2, 2, 2] = signs[1, 1, 1] = True
    leaves = leaves_of(np.zeros(signs.shape), values=False, above=signs)
    contour = draw(leaves)
    check_manifold(contour)
    assert euler(contour.cells) == 2
    assert len(contour.points) == 12
    # The other diagonals separate their ends.
    signs = np.zeros((4, 4, 4), dtype=bool)
    signs[2, 2, 1] = signs[1, 1, 2] = True
    assert euler(draw(leaves_of(np.zeros(signs.shape), values=False, above=signs)).cells) == 4


@pytest.mark.parametrize(
    ("field", "characteristic"),
    [(ball((17, 18, 19), (8.1, 8.3, 9.2), 6.7), 2), (torus(), 0)],
    ids=["sphere", "torus"],
)
def test_euler_characteristic_and_normals_of_smooth_fields(field, characteristic):
    leaves = leaves_of(field)
    contour = draw(leaves)
    check_manifold(contour)
    theirs = measure.marching_cubes(field, 0.0, method="lorensen")
    assert euler(contour.cells) == euler(theirs[1]) == characteristic
    assert len(contour.points) == len(theirs[0])
    a, b, c = np.moveaxis(contour.points[contour.cells], 1, 0)
    normal = np.cross(b - a, c - a)
    nearest = tuple(np.round((a + b + c) / 3).astype(int).T)
    gradient = np.stack(np.gradient(field), axis=-1)[nearest]
    assert ((normal * gradient).sum(-1) < 0).all()


SADDLES = {"jacksboro_fault_dem": (500.5, 0.003), "coins": (107.5, 0.027), "camera": (128.5, 0.027)}
"""Isovalues, and the share of crossed cells that pages state."""


@pytest.mark.parametrize("name", ["jacksboro_fault_dem", "coins", *heavy("camera")])
def test_lines_of_contourpy_are_farther_in_saddles_alone(name):
    """By shapely: within the promise of 0.05 cells away from saddles, within 0.71 cells and that in them."""
    contourpy, shapely = pytest.importorskip("contourpy"), pytest.importorskip("shapely")
    isovalue, share = SADDLES[name]
    field = np.load(DATA / f"{name}.npz")["values"].astype(np.int64)
    above = field > isovalue
    corners = [above[:-1, :-1], above[:-1, 1:], above[1:, 1:], above[1:, :-1]]
    count = np.sum(corners, axis=0)
    saddle = (count == 2) & (corners[0] == corners[2])
    assert saddle.sum() / ((count > 0) & (count < 4)).sum() == pytest.approx(share, abs=0.0005)
    contour = isocodec.decode(isocodec.encode(field, isovalue, precision=0.05))
    lines = contourpy.contour_generator(z=field.astype(float)).lines(isovalue)
    tree = shapely.STRtree(shapely.linestrings([piece for line in lines for piece in itertools.pairwise(line)]))
    ends = contour.points[contour.cells]
    for part in (0.0, 0.25, 0.5, 0.75):
        at = ends[:, 0] + part * (ends[:, 1] - ends[:, 0])
        _, far = tree.query_nearest(shapely.points(at[:, ::-1]), return_distance=True, all_matches=False)
        near = np.zeros(len(at), np.bool_)
        for move in np.ndindex(3, 3):
            cell = np.clip(np.floor(at).astype(np.int64) + move - 1, 0, np.array(saddle.shape) - 1)
            near |= saddle[tuple(cell.T)]
        assert far[~near].max() <= 0.05 + 1e-9 and far.max() <= 0.5**0.5 + 0.05
