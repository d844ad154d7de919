"""Drawing: against scikit-image, against a marching squares written here, and by winding numbers."""

from __future__ import annotations

import ast
import itertools
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial import cKDTree
from skimage import measure

import isocodec.drawing as drawing_package
from brute import ball, border, noise
from isocodec.drawing.contour import Contour
from isocodec.drawing.drawing import draw
from isocodec.drawing.leaves import Leaves
from isocodec.errors import OptionError

BOXES = [(5, 7), (4, 6, 9), (8, 8), (5, 5, 5), (2, 3), (2, 2, 3)]
NONE = np.empty(0, dtype=np.int64)


# --- set-up and checks ----------------------------------------------------------------------------------------------


def mesh(shape, size=1, bisections=0):
    """Simplices (M, n + 1, n) of reflected Kuhn cubes of edge `size`, bisected by Maubach's rule, clamped onto the box.

    Cubes of odd index along an axis are mirrored, so that x0 has even coordinates and xn odd ones (in units of `size`).
    """
    n = len(shape)
    cubes = np.moveaxis(np.indices([-(-(s - 1) // size) for s in shape]), 0, -1).reshape(-1, n)
    even, step = cubes + (cubes & 1), 1 - 2 * (cubes & 1)
    paths = [np.cumsum(np.eye(n, dtype=np.int64)[list(axes)], axis=0) for axes in itertools.permutations(range(n))]
    # Axes: permutations, cubes, x0 .. xn, coordinates.
    steps = np.pad(np.stack(paths), ((0, 0), (1, 0), (0, 0)))[:, None] * step[None, :, None]
    s = (even[None, :, None] + steps).reshape(-1, n + 1, n) * size
    for level in range(bisections):
        d = n - level % n
        z = (s[:, :1] + s[:, d : d + 1]) // 2
        s = np.concatenate(
            [np.concatenate([s[:, :d], z, s[:, d + 1 :]], 1), np.concatenate([s[:, 1 : d + 1], z, s[:, d + 1 :]], 1)]
        )
    s = np.minimum(s, np.array(shape) - 1)
    return s[np.abs(np.linalg.det((s[:, 1:] - s[:, :1]).astype(float))) > 0.5]


def leaves_of(field, isovalue=0.0, *, size=1, bisections=0, values=True, above=None):
    """Mixed leaves of a uniform mesh over a sampled field."""
    field = np.asarray(field)
    above = field > isovalue if above is None else above
    simplices = mesh(field.shape, size, bisections)
    signs = above[tuple(np.moveaxis(simplices, -1, 0))]
    simplices = simplices[signs.any(1) & ~signs.all(1)]
    flat = np.ravel_multi_index(tuple(np.moveaxis(simplices, -1, 0)), field.shape)
    used, index = np.unique(flat, return_inverse=True)
    return Leaves(
        shape=field.shape,
        isovalue=isovalue,
        position=np.stack(np.unravel_index(used, field.shape), axis=-1).reshape(-1, field.ndim),
        above=above.ravel()[used],
        value=field.ravel()[used].astype(np.float64) if values else None,
        simplices=index.reshape(-1, field.ndim + 1),
        levels=np.full(len(simplices), bisections),
        full=bisections == field.ndim * (size.bit_length() - 1),
        edges=np.zeros((0, 2), np.int64),
        edge_offset=np.empty(0),
    )


def as_set(points, digits):
    return set(map(tuple, (np.round(np.asarray(points), digits) + 0.0).tolist()))


def check_manifold(contour):
    """Every point (n = 2) or side of a triangle (n = 3) has one cell on each hand, or lies on the border of the box."""
    n = len(contour.shape)
    cells = contour.cells
    assert set(cells.ravel().tolist()) == set(range(len(contour.points)))
    if n == 2:
        starts, ends = Counter(cells[:, :1].ravel().tolist()), Counter(cells[:, 1:].ravel().tolist())
        assert max([0, *starts.values(), *ends.values()]) <= 1
        open_sides: list[tuple[int, ...]] = [(p,) for p in starts.keys() ^ ends.keys()]
    else:
        assert (cells[:, [0, 1, 2]] != cells[:, [1, 2, 0]]).all()
        sides = Counter((t[i], t[i - 2]) for t in cells.tolist() for i in range(3))
        assert max([0, *sides.values()]) <= 1, "a side is used twice in one direction"
        open_sides = [(a, b) for a, b in sides if (b, a) not in sides]
    last = np.array(contour.shape) - 1.0
    for side in open_sides:
        ends_at = contour.points[list(side)]
        assert ((ends_at == 0).all(0) | (ends_at == last).all(0)).any(), "a gap that is not on the border"


def winding(contour, at):
    """How often a closed contour winds around each of the points, positive if higher values are inside."""
    corner = contour.points[contour.cells][None] - np.asarray(at, dtype=float)[:, None, None]
    if len(contour.shape) == 2:
        a, b = corner[..., 0, :], corner[..., 1, :]
        turn = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(-1))
        return turn.sum(1) / (2 * np.pi)
    # Solid angle of a triangle: Van Oosterom and Strackee 1983.
    length = np.linalg.norm(corner, axis=-1)
    a, b, c = np.moveaxis(corner, -2, 0)
    below = length.prod(-1)
    for (p, q), r in (((a, b), 2), ((b, c), 0), ((c, a), 1)):
        below = below + (p * q).sum(-1) * length[..., r]
    return np.arctan2(np.linalg.det(corner), below).sum(1) / (2 * np.pi)


def check_winding(contour, leaves):
    assert np.allclose(winding(contour, leaves.position), leaves.above, atol=1e-6)


def euler(cells):
    sides = {frozenset(pair) for t in cells.tolist() for pair in itertools.combinations(t, 2)}
    return len(np.unique(cells)) - len(sides) + len(cells)


def torus():
    x, y, z = np.meshgrid(*(np.arange(s) - (s - 1) / 2 + 0.013 for s in (27, 26, 13)), indexing="ij")
    return 3.7 - np.hypot(np.hypot(x, y) - 7.9, z)


# --- the meshes that these tests draw on -----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", BOXES)
def test_bisection_of_coarse_cubes_ends_at_the_reflected_unit_cubes(shape):
    def canonical(simplices):
        return {tuple(map(tuple, s)) for s in simplices.tolist()}

    assert canonical(mesh(shape, 4, 2 * len(shape))) == canonical(mesh(shape))


# --- n = 2, full grid ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("shape", "seed"), [((20, 31), 1), ((33, 8), 2), ((5, 7), 3), ((2, 2), 4), ((2, 9), 5)])
def test_points_are_those_of_find_contours(shape, seed):
    field = noise(shape, seed)
    contour = draw(leaves_of(field, 0.1))
    # There closed lines repeat their first point.
    expected = np.concatenate([*measure.find_contours(field, 0.1), np.empty((0, 2))])
    expected = expected[np.unique(np.round(expected, 10), axis=0, return_index=True)[1]]
    ours = contour.points[np.lexsort(np.round(contour.points, 10).T[::-1])]
    assert ours.shape == expected.shape
    assert np.allclose(ours, expected, atol=1e-9, rtol=0)


def test_lines_of_a_smooth_field_are_those_of_find_contours_with_high_values_on_the_left():
    field = np.maximum(ball((30, 41), (11.3, 12.1), 8.2), ball((30, 41), (20.7, 36.4), 9.1))
    ours = draw(leaves_of(field)).lines
    theirs = measure.find_contours(field, 0.0, positive_orientation="high")
    assert len(ours) == len(theirs) == 2

    def steps(lines):
        return {
            (tuple(a), tuple(b)) for line in lines for a, b in itertools.pairwise((np.round(line, 9) + 0.0).tolist())
        }

    assert steps(ours) == steps(theirs)


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


def test_a_single_high_sample_is_wound_counter_clockwise_in_the_plane_of_axis_0_and_axis_1():
    field = np.full((3, 3), -1.0)
    field[1, 1] = 3.0
    (line,) = draw(leaves_of(field)).lines
    # Crossings 3/4 of the way from the middle to its four neighbours; shoelace area of that square is +2 * 0.75 ** 2.
    assert as_set(line, 9) == {(0.25, 1.0), (1.0, 0.25), (1.75, 1.0), (1.0, 1.75)}
    (x0, y0), (x1, y1) = line[:-1].T, line[1:].T
    assert (x0 * y1 - x1 * y0).sum() / 2 == pytest.approx(1.125)


# --- n = 3, full grid ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(14, 14, 14), (4, 6, 9), (2, 2, 3)])
def test_vertices_of_noise_are_those_of_marching_cubes(shape):
    field = noise(shape, 3)
    contour = draw(leaves_of(field, 0.05))
    check_manifold(contour)
    vertices = measure.marching_cubes(field, 0.05, method="lorensen")[0]
    on_edge = (contour.points != np.round(contour.points)).sum(axis=1) == 1
    # Of noise, 14 cells in 256 have a point in their middle: 120 of the 2197 cells in the largest of these volumes.
    assert (~on_edge).sum() <= 0.08 * np.prod(np.array(shape) - 1)
    ours = contour.points[on_edge]
    # scikit-image computes in float32, and a few points come twice there.
    assert cKDTree(vertices).query(ours)[0].max() < 1e-4
    assert cKDTree(ours).query(vertices)[0].max() < 1e-4


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


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shape", [(12, 11), (7, 6, 8)])
def test_what_is_above_lies_inside(shape, seed):
    leaves = leaves_of(noise(shape, seed, rim_below=True))
    contour = draw(leaves)
    check_manifold(contour)
    check_winding(contour, leaves)


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


# --- coarser meshes --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bisections", range(4))
@pytest.mark.parametrize("shape", [(17, 17), (14, 19), (9, 9, 9), (7, 8, 10)])
def test_simplex_drawing_is_a_manifold_with_the_high_values_inside(shape, bisections):
    for closed in (False, True):
        field = noise(shape, bisections, closed)
        leaves = leaves_of(field, size=4, bisections=bisections)
        contour = draw(leaves)
        check_manifold(contour)
        if closed:
            check_winding(contour, leaves)


def test_simplex_drawing_interpolates_along_the_edge_as_published():
    # x0 = (0, 0) at 3, the others at -1: crossings at 3/4 of both edges from x0.
    leaves = Leaves(
        (5, 5), 0.0, np.array([[0, 0], [4, 0], [4, 4]]), np.array([True, False, False]), np.array([3.0, -1, -1]),
        np.array([[0, 1, 2]]), np.array([0]), False, np.zeros((0, 2), np.int64), np.empty(0),
    )  # fmt: skip
    contour = draw(leaves)
    assert contour.points[contour.cells].tolist() == [[[3.0, 0.0], [3.0, 3.0]]]


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
    stated = Leaves(**{**vars(plain), "edges": np.array(ends), "edge_offset": offset})
    drawn = draw(stated)
    assert np.allclose(drawn.points, exact.points, atol=1e-12, rtol=0) and (drawn.cells == exact.cells).all()
    some = Leaves(**{**vars(stated), "edges": stated.edges[:5], "edge_offset": offset[:5]})
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
        reach = 0.5 if full else 1.0
        assert np.isfinite(drawn.points).all() and (np.abs(drawn.points - middle.points) <= reach).all()


@pytest.mark.parametrize("shape", [(9, 9), (6, 6, 6)])
def test_ties_do_no_harm(shape):
    field = np.random.default_rng(8).integers(-1, 2, shape).astype(float)
    for leaves in (leaves_of(field), leaves_of(field, size=2, bisections=1)):
        contour = draw(leaves)
        assert np.isfinite(contour.points).all()
        assert (contour.cells == draw(Leaves(**{**vars(leaves), "value": None})).cells).all()
    check_manifold(draw(leaves_of(field, values=False)))


@pytest.mark.parametrize("size", [1, 2])
@pytest.mark.parametrize("shape", [(9, 9), (6, 6, 6)])
def test_numbering_of_vertices_changes_no_coordinate(shape, size):
    leaves = leaves_of(noise(shape, 2), size=size)
    order = np.random.default_rng(0).permutation(len(leaves.position))
    shuffled = Leaves(**{
        **vars(leaves),
        "position": leaves.position[order],
        "above": leaves.above[order],
        "value": leaves.value[order],
        "simplices": np.argsort(order)[leaves.simplices],
    })  # fmt: skip
    one, two = draw(leaves), draw(shuffled)

    def corners(contour):
        cells = contour.points[contour.cells].tolist()
        return sorted(min(c[i:] + c[:i] for i in range(len(c))) if len(c) == 3 else c for c in cells)

    # Centres are means, summed in an order that follows from the numbering.
    assert np.allclose(corners(one), corners(two), atol=1e-12, rtol=0)
    assert as_set(one.points, 15) >= {p for p in as_set(two.points, 15) if sum(x % 1 != 0 for x in p) == 1}


# --- parts, nothing, anything ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(12, 12), (7, 7, 7)])
def test_cells_whose_leaves_are_not_all_there_are_left_out(shape):
    leaves = leaves_of(noise(shape, 4))
    whole = draw(leaves)
    kept = np.random.default_rng(1).random(len(leaves.simplices)) < 0.9
    part = draw(Leaves(**{**vars(leaves), "simplices": leaves.simplices[kept]}), complete=False)
    assert whole.complete and not part.complete

    def corners(contour):
        return {frozenset(map(tuple, cell)) for cell in np.round(contour.points[contour.cells], 9).tolist()}

    assert corners(part) < corners(whole)
    if len(shape) == 2:
        assert sum(len(line) - 1 for line in part.lines) == len(part.cells)


@pytest.mark.parametrize("full", [True, False])
@pytest.mark.parametrize("shape", [(5, 7), (4, 6, 9), (1, 6), (1, 1, 1)])
@pytest.mark.parametrize("values", [True, False])
def test_nothing_to_draw(shape, full, values):
    leaves = leaves_of(np.zeros(shape), values=values, size=1 if full else 2, bisections=0 if full else 1)
    contour = draw(leaves)
    n = len(shape)
    assert contour.points.shape == contour.cells.shape == (0, n)
    assert contour.points.dtype == np.float64 and contour.cells.dtype == np.int64
    if n == 2:
        assert contour.lines == []
        assert contour.__geo_interface__ == {"type": "MultiLineString", "coordinates": ()}


signs_2d = hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=7))
signs_3d = hnp.arrays(bool, hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=5))


@settings(max_examples=150, deadline=None)
@given(st.one_of(signs_2d, signs_3d), st.booleans())
def test_any_signs(signs, pad):
    if pad:
        signs = np.pad(signs, 1)
    n = signs.ndim
    for bisections in (None, *range(n)):
        size, count = (1, 0) if bisections is None else (2, bisections)
        leaves = leaves_of(np.zeros(signs.shape), values=False, above=signs, size=size, bisections=count)
        contour = draw(leaves)
        assert contour.points.dtype == np.float64 and contour.cells.dtype == np.int64
        check_manifold(contour)
        if not signs[border(signs.shape)].any():
            check_winding(contour, leaves)


# --- the result ------------------------------------------------------------------------------------------------------


def test_geo_interface_has_columns_as_x():
    contour = draw(leaves_of(ball((8, 20), (3.5, 14.0), 2.2)))
    geometry = contour.__geo_interface__
    (line,) = geometry["coordinates"]
    assert geometry["type"] == "MultiLineString"
    assert [(y, x) for x, y in line] == [tuple(p) for p in contour.lines[0].tolist()]
    shapely = pytest.importorskip("shapely.geometry")
    assert shapely.shape(contour).bounds == pytest.approx((11.8, 1.3, 16.2, 5.7), abs=0.1)


def test_surfaces_have_no_lines_and_no_geo_interface():
    contour = draw(leaves_of(ball((6, 6, 6), (2.4, 2.6, 2.5), 1.4)))
    with pytest.raises(OptionError, match="isocontour"):
        _ = contour.lines
    assert not hasattr(contour, "__geo_interface__")


@pytest.mark.parametrize("shape", [(5,), (2, 2, 2, 2)])
def test_other_dimensions_are_refused(shape):
    with pytest.raises(OptionError, match="2 or 3"):
        draw(leaves_of(noise(shape)))


def test_contours_are_immutable():
    contour = Contour(np.empty((0, 2)), np.empty((0, 2), dtype=np.int64), 0.0, (3, 3))
    with pytest.raises(AttributeError):
        contour.isovalue = 1.0  # type: ignore[misc]


def test_drawing_imports_nothing_of_the_codec():
    allowed = sys.stdlib_module_names | {"numpy"}
    shared = {
        "..errors", "..exchange", "..field.mapped", "..kernel", "..kernel.types", "..mesh.implied", "..mesh.tables",
    }  # fmt: skip
    for source in Path(drawing_package.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [f"{'.' * node.level}{node.module or ''}"]
            for name in names:
                ours = name in shared or (name.startswith(".") and not name.startswith(".."))
                assert ours or name.split(".")[0] in allowed, f"{source.name} imports {name}"
