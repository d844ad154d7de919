"""Meshes for a tolerance: even ones, finer where they have to be, the full grid where that is smaller."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np
import pytest

import isocodec
from brute import smooth
from isocodec.errors import OptionError
from isocodec.field.samples import check_field
from isocodec.grid.layers.plan import PROMISE
from isocodec.search.promise import Promise
from isocodec.search.steps import stepwise
from isocodec.search.strategy import EDGE, Plan, even_mesh, exponent_of, grid_plan, mesh_of, slanted, smallest
from isocodec.search.tolerance import grid_offsets, radices
from isocodec.stream.options import EFFORTS, WORTH_SEARCHING, EffortName
from tables import looped


def waves(side: int, n: int = 2) -> np.ndarray:
    """A field whose curves bend everywhere alike."""
    return sum(np.sin(2 * np.pi * axis / 14.3) for axis in np.indices((side,) * n)) * 100


def promise_of(side: int, n: int = 2) -> Promise:
    return Promise(check_field(waves(side, n), 20.0))


def grid_of(promise: Promise) -> Plan:
    return grid_plan(promise.n, promise.full_level, None)


@looped("topology", [False, True])
@looped(("n", "tolerance"), [(2, 0.8), (2, 1.0), (2, 1.7), (2, 3.0), (3, 1.0), (3, 2.0)])
def test_an_even_mesh_keeps_a_promise(n: int, tolerance: float, topology: bool) -> None:
    promise = promise_of(40 if n == 2 else 25, n)
    found = even_mesh(promise, tolerance, topology)
    assert found is not None
    size, contour = promise.trial(found[1])
    assert size == found[0] and not len(promise.excess(contour, tolerance))
    # in one byte less it is given up
    assert even_mesh(promise, tolerance, topology, most=size + 1) is not None
    assert even_mesh(promise, tolerance, topology, most=size) is None
    assert promise.trial(smallest(promise, tolerance, topology))[0] <= size


def test_edges_of_even_meshes() -> None:
    assert [exponent_of(tolerance) for tolerance in (0.1, 0.74, WORTH_SEARCHING, 1.49, 1.5, 3.0)] == [0, 0, 1, 1, 2, 3]
    assert all((1 << exponent_of(tolerance)) <= EDGE * tolerance for tolerance in np.geomspace(0.5, 99, 50))


def test_noise_takes_the_full_grid() -> None:
    promise = Promise(check_field(np.random.default_rng(0).normal(size=(40, 40)), 0.0))
    assert smallest(promise, WORTH_SEARCHING, False) == grid_of(promise)


def test_as_few_parts_as_a_tolerance_needs() -> None:
    some = {0.5: [], 0.49: [2], 0.25: [2], 0.2499: [3], 0.1: [5], 1 / 16: [8], 0.05: [5, 2], 0.03: [17],
            0.01: [5, 5, 2]}
    assert {tolerance: radices(tolerance) for tolerance in some} == some
    where = np.linspace(0, 1, 10007, endpoint=False)
    for tolerance in (*some, *np.geomspace(0.0005, 0.5, 40)):
        parts = math.prod(radices(tolerance))
        middle = (np.floor(where * parts) + 0.5) / parts
        assert np.abs(middle - where).max() <= tolerance * (1 + 1e-6)
        assert parts == 1 or parts < 0.5 / tolerance * 1.1 + 1.1


@pytest.mark.parametrize("n", [2, 3])
def test_slack_at_a_slant(n: int) -> None:
    promise = promise_of(40 if n == 2 else 21, n)
    plain = [*grid_of(promise), *grid_offsets(0.3, True)]
    before = promise.trial(plain)[0]
    size, plan = slanted(promise, 0.3, grid_of(promise), (before, plain))
    assert size < before and promise.trial(plan)[0] == size
    assert not len(promise.excess(promise.trial(plan)[1], 0.3))


@pytest.mark.parametrize("topology", [False, True])
def test_smooth_surfaces_take_cubes_with_crossings(topology: bool) -> None:
    """They take fewer bytes than the full grid; thorough searches take fewer still, and all keep to the tolerance."""
    along = np.indices((53, 53, 53)) - 26.3
    promise = Promise(check_field(np.sqrt(along[0] ** 2 + 1.3 * along[1] ** 2 + along[2] ** 2), 20.2))
    sizes = []
    for thorough in (False, True):
        plan = smallest(promise, 0.25, topology, thorough=thorough)
        assert plan[-1][0] == "offsets" and plan[-1][2] > 0
        size, contour = promise.trial(plan)
        assert not len(promise.excess(contour, 0.25))
        sizes.append(size)
    grid = [*grid_of(promise), *grid_offsets(0.25, True)]
    assert sizes[1] < sizes[0] < 0.9 * promise.trial(slanted(promise, 0.25, grid_of(promise), (math.inf, grid))[1])[0]


def test_curves_keep_to_tolerances_that_parts_just_keep() -> None:
    """Where a crossing lies on the border of two parts, as far as it may be."""
    for tolerance in (0.1, 0.125, 0.25, 0.5):
        promise = promise_of(40)
        plan = smallest(promise, tolerance, False, thorough=True)
        assert not len(promise.excess(promise.trial(plan)[1], tolerance * (1 + 1e-7)))


def test_meshes_of_steps_lie_in_one_another() -> None:
    promise = promise_of(60)
    plan = stepwise(promise, [4.0, 2.0, 1.0, 0.3], False)
    assert [entry[1] for entry in plan if entry[0] == PROMISE] == [4.0, 2.0, 1.0, 0.3]
    meshes = [mesh_of([entry]) for entry in plan if entry[0] == "adapt"]
    assert len(meshes) == 3
    for coarse, fine in pairwise(meshes):
        assert (fine.inside <= coarse.inside).all() and (fine.inside < coarse.inside).any()


@pytest.mark.parametrize("topology", [False, True])
def test_steps_of_rough_fields_are_found(topology: bool) -> None:
    """Where a coarse step is too far away at leaves that the next mesh does not bisect, it gets others of that mesh."""
    for seed, steps in enumerate([[8, 2, 0.5], [16, 4, 1], [20, 8, 4, 2], [8, 3, 1, 0.3], [6, 0.8]] * 2):
        field = smooth((9, 8, 7) if seed > 7 else (60, 44), seed) + 0.7 * np.random.default_rng(seed).normal(
            size=(9, 8, 7) if seed > 7 else (60, 44))
        file = isocodec.open(isocodec.encode(field, 0.1, precision=steps, keep_topology=topology))
        assert [layer.within for layer in file.info.layers if layer.within] == steps
        assert all(one.kept for one in file.verify(field))


@pytest.mark.parametrize("n", [2, 3])
def test_samples_on_the_isovalue(n: int) -> None:
    """Crossings at the very ends of edges, next to implied edges: still a promise kept."""
    field = np.rint(2 * smooth((21,) * n if n == 2 else (11, 12, 9), 4)).astype(np.float64)
    assert (field == 0).any()
    promise = Promise(check_field(field, 0.0))
    for tolerance in (0.25, 0.5, 1.0):
        for effort in ("normal", "best"):
            found = isocodec.decode(isocodec.encode(field, 0.0, precision=tolerance, effort=effort))
            assert not len(promise.excess(found, tolerance))


def test_effort() -> None:
    field = waves(60)
    plain, best = (len(isocodec.encode(field, 20.0, precision=0.3, effort=effort)) for effort in ("normal", "best"))
    assert best < plain
    with pytest.raises(OptionError, match="effort"):
        isocodec.encode(field, 20.0, effort="some")
    with pytest.raises(OptionError, match="effort"):
        isocodec.encode(isocodec.thin(field, to=30), effort="best")


def ball(side: int) -> np.ndarray:
    """Distances from the middle of a cube of so many samples a side: at each isovalue a smooth surface."""
    return np.linalg.norm(np.indices((side,) * 3) - (side - 1) / 2, axis=0)


@pytest.mark.parametrize("tolerance", [0.1, 0.12, 0.2, 0.4, 0.6, 1.0])
@pytest.mark.parametrize("field", [waves(40), ball(33)], ids=["curve", "smooth surface"])
def test_the_best_effort_takes_no_more_bytes(field: np.ndarray, tolerance: float) -> None:
    plain, best = (len(isocodec.encode(field, 10.3, precision=tolerance, effort=one)) for one in EFFORTS)
    assert best <= plain


@pytest.mark.parametrize("effort", ["normal", "best"])
def test_where_the_mesh_is_coarser_than_the_grid_the_remedy_holds(effort: EffortName) -> None:
    field = ball(33)
    with pytest.raises(OptionError) as raised:
        isocodec.open(isocodec.encode(field, 10.3, precision=1.0, effort=effort)).above()
    assert raised.value.remedy
    said = re.search(r"tolerance below ([0-9.]+)$", raised.value.remedy)
    assert said
    below = np.nextafter(float(said[1]), 0)
    assert (isocodec.open(isocodec.encode(field, 10.3, precision=below, effort=effort)).above() == (field > 10.3)).all()


def test_a_mesh_under_distortion_is_taken_where_it_is_smaller_than_the_full_grid() -> None:
    data = isocodec.encode(waves(60), 20.0, layers="distortion=2", precision="signs")
    with pytest.raises(OptionError, match="coarser"):
        isocodec.open(data).above()
