"""Points moved along their edges: the fitted curve lies on both sides of the original, and nearer to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import isocodec
from brute import examples, smooth
from isocodec.drawing.drawing import draw
from isocodec.drawing.simplices import crossed, rings
from isocodec.drawing.snapshot import leaves_of
from isocodec.field.samples import check_field
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.search import fit, proof
from isocodec.search.promise import Promise
from isocodec.search.proof import Target, hausdorff
from isoconform.meshes import chosen, uniform
from libraries import Late

KDTree = Late("scipy.spatial.KDTree")


def ball(n, edge=33, radius=11.3):
    centre = edge / 2 - 0.3
    return radius - np.sqrt(sum((x - centre) ** 2 for x in np.indices((edge,) * n)))


def trial(promise, level, parts, unit, place=None):
    mesh = chosen(promise.field.signs.shape, uniform(promise.field.signs.shape, level))
    return promise.trial([("adaptive_base", 0, mesh), ("offsets", parts, unit, place)])[1], mesh


@pytest.mark.parametrize("n", [2, 3])
def test_a_ball_on_both_sides(n):
    """Inscribed pieces of a ball lie inside it, up to the sagitta; fitted ones need less.

    About half of it for curves; surfaces, whose cubes have all but twelve of their edges implied, are less free.
    """
    promise = Promise(check_field(ball(n), 0.0))
    level = n * (cube_exponent((33,) * n) - (3 if n == 2 else 2))
    before, mesh = trial(promise, level, 5, 0)
    worst = max(hausdorff(before.points, before.cells, promise.contour.points, promise.contour.cells))
    place = promise.placed(mesh, 5, 0, 0.6 * worst).place
    after, _ = trial(promise, level, 5, 0, place)
    assert (
        max(hausdorff(after.points, after.cells, promise.contour.points, promise.contour.cells))
        < (0.75 if n == 2 else 0.85) * worst
    )
    # the pieces of the one are inside, those of the other on both sides
    centre = 33 / 2 - 0.3
    inscribed, fitted = (
        np.linalg.norm(c.points[c.cells].mean(axis=1) - centre, axis=1) - 11.3 for c in (before, after)
    )
    assert inscribed.max() < 0.1 * worst and fitted.max() > 0.2 * worst


@pytest.mark.parametrize("n", [2, 3])
def test_numbers_are_parts_of_edges(n):
    @settings(examples(25), deadline=None)
    @given(st.integers(0, 1000), st.sampled_from([(1, 0), (3, 0), (1, 1), (3, 2)]), st.floats(0.2, 4.0))
    def run(seed, pitch, tolerance):
        shape = (14, 11) if n == 2 else (7, 9, 8)
        promise = Promise(check_field(smooth(shape, seed) - 0.01, 0.0))
        mesh = chosen(shape, uniform(shape, n * cube_exponent(shape) - n))
        place = promise.placed(mesh, *pitch, tolerance).place
        tube = promise._encoded([("adaptive_base", 0, mesh), ("offsets", *pitch, place)])[1]
        told = tube.estimates
        position = tube.state.vertex[:, :n].astype(np.int64)
        where = place(position[told.edges[:, 0]], position[told.edges[:, 1]])
        # the middle of a part comes out as that part
        assert np.array_equal(where * told.parts >> 30, told.offset)
        assert np.array_equal(where, ((2 * told.offset + 1) << 29) // told.parts)
        assert ((told.offset >= 0) & (told.offset < told.parts)).all()

    run()


@pytest.mark.parametrize("n", [2, 3])
def test_slopes_of_implied_edges(n):
    """What a fit takes for the movement of implied points is what happens when the others move."""
    shape = (14, 11) if n == 2 else (9, 9, 8)
    promise = Promise(check_field(smooth(shape, 3), 0.1))
    tube = promise._encoded(
        [("adaptive_base", 0, chosen(shape, uniform(shape, n * cube_exponent(shape) - 1))), ("offsets", 9, 0)]
    )[1]
    leaves = leaves_of(tube, 0.1, lambda number, above: number)
    edges, _ = crossed(leaves)
    stated = np.random.default_rng(1).uniform(0.2, 0.8, len(edges))
    found = 0
    for ring in rings(leaves, edges):
        slopes, before = ring.slopes(stated), ring.ratio(stated)
        for i in range(len(ring.edge)):
            for j, beside in enumerate(ring.beside[i]):
                moved = stated.copy()
                moved[beside] += 1e-5
                assert (ring.ratio(moved)[i] - before[i]) / 1e-5 == pytest.approx(slopes[i, j], abs=1e-3)
                found += 1
    assert found


@pytest.mark.parametrize("below", [1, 2, 3])
def test_what_follows_from_what_is_told(below):
    """Implied points that follow from implied ones, too: all of it, against moving each told edge."""
    shape = (9, 9, 9)
    promise = Promise(check_field(smooth(shape, 5), 0.1))
    mesh = chosen(shape, uniform(shape, 3 * cube_exponent(shape) - below))
    tube = promise._encoded([("adaptive_base", 0, mesh), ("offsets", 9, 0)])[1]
    fitted = fit._Fit(leaves_of(tube, 0.1, lambda number, above: number), tube.estimates.edges)
    where = np.random.default_rng(2).uniform(0.2, 0.8, len(fitted.told))
    fitted.points(where)
    before, count = fitted.stated.copy(), len(fitted.edges)
    follows = np.zeros((count, len(where)))
    start, told, share = fitted.follow()
    np.add.at(follows, (np.repeat(np.arange(count), np.diff(start)), told), share)
    for e in range(len(where)):
        moved = where.copy()
        moved[e] += 1e-6
        fitted.points(moved)
        assert (fitted.stated - before) / 1e-6 == pytest.approx(follows[:, e], abs=1e-3)


@pytest.mark.parametrize("n", [2, 3])
def test_samples_of_pieces(n):
    """Of each piece its corners, the middles of what lies opposite, and the centre: as often as pieces have it."""
    points = np.random.default_rng(n).uniform(0, 9, (6, n))
    cells = np.array([[0, 1], [1, 2], [2, 0], [4, 5]] if n == 2 else [[0, 1, 2], [2, 1, 3], [0, 3, 5], [5, 4, 0]])
    samples = fit._samples(cells, len(points))
    places = np.einsum("pk,pkc->pc", samples.weight, points[samples.corner])
    assert len(places) == 6 + {2: 0, 3: 10}[n] + len(cells)
    corners = points[cells]
    opposite = (corners.sum(axis=1, keepdims=True) - corners) / (n - 1)
    wanted = np.concatenate([corners, opposite, corners.mean(axis=1, keepdims=True)], axis=1).reshape(-1, n)
    found = np.repeat(places, samples.times.astype(int), axis=0)
    assert found[np.lexsort(found.round(9).T)] == pytest.approx(wanted[np.lexsort(wanted.round(9).T)])


def test_edges_that_nothing_notices_stay():
    where, gap = np.array([0.5, 0.5]), np.array([1.0])
    pull = fit.Pull(np.array([0, 1, 1]), np.array([0]), np.array([1.0]), gap, np.ones(1))
    fit.relax(pull, where, np.array([0.1, 0.1]), 2, 1.0, 2)
    assert where == pytest.approx([0.9, 0.5]) and gap == pytest.approx([0.6])


def test_points_without_a_step_stay():
    where, gap = np.array([0.5, 0.5]), np.array([1.0, 1.0])
    pull = fit.Pull(np.array([0, 1, 2]), np.array([0, 1]), np.array([1.0, 1.0]), gap, np.ones(2))
    fit.relax(pull, where, np.array([0.1, 0.0]), 2, 1.0, 2)
    assert where == pytest.approx([0.9, 0.5]) and gap == pytest.approx([0.6, 1.0])


@pytest.mark.heavy
@pytest.mark.parametrize("n", [2, 3])
def test_fitted_again_around_a_place(n):
    """Points far from where the curve is too far away stay, and what may have changed is seen to be held against it."""
    side, radius = (65, 27.3) if n == 2 else (41, 17.3)
    promise = Promise(check_field(ball(n, side, radius), 0.0))
    mesh = chosen((side,) * n, uniform((side,) * n, n * cube_exponent((side,) * n) - 2 * n))
    before = promise.placed(mesh, 5, 0, 0.5)
    place = promise.contour.points[:1]
    faults = fit.Faults(before.drawing, place, np.zeros(0, np.int64))
    drawn = promise.placed(mesh, 5, 0, 0.3, before, faults=faults).drawing
    part = drawn.part
    assert part is not None
    moved = (drawn.points != before.drawing.points).any(axis=1)
    assert not (moved & ~part.moving).any()
    assert (np.linalg.norm(drawn.points[moved] - place, axis=1) < 12).all()
    # where nothing is left out the faults found there are those of the whole proof
    whole = promise.faults(replace(drawn, part=None), 0.3)
    some = promise.faults(drawn, 0.3)
    assert set(some.pieces) == set(whole.pieces) & set(part.changed)
    assert {tuple(p) for p in some.places} <= {tuple(p) for p in whole.places}
    assert part.near.holds(whole.places).sum() - 1 <= len(some.places)


def test_faults_are_found_again():
    """Step by step only what may have changed is held against the original, and nothing that is too far is missed."""
    promise = Promise(check_field(smooth((60, 60), 3), 0.1))
    reduction = promise.reduction(chosen((60, 60), uniform((60, 60), 2 * cube_exponent((60, 60)) - 4)))
    fitted, faults, parts = None, None, 0
    for _ in range(8):
        fitted = promise.placed(reduction.chosen, 3, 1, 0.3, fitted, faults=faults)
        faults = promise.faults(fitted.drawing, 0.3)
        whole = promise.faults(replace(fitted.drawing, part=None), 0.3)
        assert sorted(map(tuple, faults.places)) == sorted(map(tuple, whole.places))
        parts += fitted.drawing.part is not None
        if not reduction.restore(faults.places):
            break
    assert parts > 1


def test_parts_of_work_are_all_of_it():
    done = np.zeros(50_001, np.int64)

    def work(some):
        done[some] += 1

    proof.in_parts(len(done), work)
    assert (done == 1).all() and proof.processors() >= 1


@pytest.mark.parametrize("n", [2, 3])
def test_nearest_pieces(n):
    """Against points spread densely over the pieces."""
    rng = np.random.default_rng(n)
    contour = draw(leaves_of(Promise(check_field(smooth((12,) * n, 5), 0.05))._encoded(
        [("base", n * cube_exponent((12,) * n)), ("offsets", 9)])[1], 0.05, lambda number, above: number))
    samples = rng.uniform(0, 11, (400, n))
    target = Target(contour.points, contour.cells, 0.4)
    piece, weight = target.nearest(samples)
    shares = rng.dirichlet(np.ones(n), 400)
    spread = np.einsum("sk,mkc->msc", shares, contour.points[contour.cells]).reshape(-1, n)
    far, _ = KDTree(spread).query(samples)
    near = np.linalg.norm(samples - np.einsum("pk,pkc->pc", weight, contour.points[contour.cells[piece]]), axis=1)
    found = piece >= 0
    assert found.any() and not found.all()
    assert (near[found] <= np.minimum(far[found] + 1e-9, 0.4)).all() and (far[~found] > 0.4 - 1e-9).all()
    assert np.abs(weight[found].sum(axis=1) - 1).max() < 1e-9 and weight[found].min() >= -1e-9
    assert (near[found] > far[found] - 0.15).all()


def test_relax_finds_the_best_places():
    """One edge, two samples that pull in opposite ways: the middle between them."""
    where = np.array([0.1])
    gap = np.array([0.4, -0.2])
    step = np.array([0.05])
    one = np.ones(2)
    fit.relax(fit.Pull(np.array([0, 2]), np.array([0, 1]), one, gap, one), where, step, 2, 1.0, 10)
    assert where[0] == pytest.approx(0.2) and gap == pytest.approx([0.3, -0.3])


@pytest.mark.parametrize("n", [2, 3])
def test_samples_on_the_isovalue(n):
    """Crossings at the very ends of edges, next to implied edges: still a promise kept."""
    field = np.rint(2 * smooth((21,) * n if n == 2 else (11, 12, 9), 4)).astype(np.float64)
    assert (field == 0).any()
    for tolerance in (0.25, 1.0):
        promise = Promise(check_field(field, 0.0))
        found = isocodec.decode(isocodec.encode(field, 0.0, precision=tolerance))
        assert not len(promise.excess(found, tolerance))
