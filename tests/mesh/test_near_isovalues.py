"""Isovalues on meshes that lean on others: what their numbers and crossings take, and that they are right."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from brute import HEAVY, INTERPRETED
from explicit_meshes import crossings, plane, space, torus
from isocodec import Mesh, decode, encode
from isocodec.stream.inspect import inspect

MESHES = {"plane": lambda seed: plane(seed, 60), "space": lambda seed: space(seed, 40), "torus": lambda _: torus()}
SEEDS = 1 if INTERPRETED else 12 if HEAVY else 3


def hills(points, seed, noise=2.0):
    """Smooth values with some noise."""
    rng = np.random.default_rng(seed)
    x = (points - points.min(axis=0)) / np.ptp(points, axis=0)
    slopes = np.sin(5 * x[:, 0] + 1) * np.cos(4 * x[:, 1]) + 0.7 * x[:, -1]
    return 100 * slopes + rng.normal(0, noise, len(points))


@pytest.mark.parametrize("kind", MESHES)
def test_crossings_at_many_steps_are_those_of_files_alone(kind):
    """Points are where numbers of steps, counted exactly, put them, whatever the isovalues lean on."""
    for seed in range(SEEDS):
        mesh = MESHES[kind](seed)
        values = hills(mesh[0], seed)
        middle = float(np.median(values))
        for step in (0.3, 1.0, 7.25):
            isovalues = [middle, middle + 1.1, middle - 4 * step, middle + 0.4, middle + 30]
            data = encode(Mesh(*mesh, values), isovalues, precision=f"step={step}")
            for isovalue in isovalues:
                found = decode(data, mesh=mesh, isovalue=isovalue)
                wanted = by_steps(mesh, values, isovalue, step)
                assert np.allclose(in_order(found.points), in_order(wanted), atol=1e-6)


def by_steps(mesh, values, isovalue, step):
    """Crossings by brute force, of the values that numbers of steps stand for."""
    exact = [(Fraction(v) - Fraction(isovalue)) / Fraction(step) for v in values.tolist()]
    rounded = np.array([float(-(-x // 1) - 1) + 0.5 if x > 0 else -float(-x // 1) - 0.5 for x in exact])
    return np.array(list(crossings(mesh, rounded, 0.0).values())).reshape(-1, mesh[0].shape[1])


def in_order(points):
    rounded = np.round(points, 5) + 0.0
    return points[np.lexsort(rounded.T)]


@pytest.mark.parametrize("kind", MESHES)
def test_offsets_are_those_of_files_alone(kind):
    """Crossings lie in the same parts of edges, whatever the isovalues lean on, on the whole mesh and on cuts."""
    for seed in range(SEEDS):
        mesh = MESHES[kind](seed)
        values = hills(mesh[0], seed)
        middle = float(np.median(values))
        isovalues = [middle, middle + 1.5, middle - 2, middle + 0.5, middle + 40]
        for progressive in (False, True):
            given = Mesh(*mesh, values, progressive=progressive)
            data = encode(given, isovalues, precision=0.02)
            for isovalue in isovalues:
                found = decode(data, mesh=mesh, isovalue=isovalue)
                alone = decode(encode(given, isovalue, precision=0.02), mesh=mesh)
                assert np.allclose(in_order(found.points), in_order(alone.points), atol=1e-9)
                wanted = np.array(list(crossings(mesh, values, isovalue).values())).reshape(len(found.points), -1)
                assert len(found.points) == len(wanted)


def bytes_beside(mesh, values, isovalues, **options):
    """Bytes that a second isovalue adds, as a share of those that it takes alone but for what any file takes."""
    def size(*chosen):
        data = encode(Mesh(*mesh, values, progressive=False), list(chosen), **options)
        return len(data) - sum(chunk.bytes for chunk in inspect(data).chunks if chunk.type == "promises")

    nothing = size(float(values.max()) + 1)
    first, second = isovalues
    return (size(first, second) - size(first)) / (size(second) - nothing)


@pytest.mark.skipif(INTERPRETED, reason="takes long")
@pytest.mark.parametrize(("make", "steps", "places"), [(plane, 0.4, 0.6), (space, 0.25, 0.7)])
def test_a_second_isovalue_takes_less(make, steps, places):
    """Isovalues that are 0.3 % of the range apart have most vertices and edges next to their curves in common."""
    mesh = make(1, 8000 if make is plane else 1500, 1.0)
    values = hills(mesh[0], 1, 0.2)
    isovalues = 20.0, 20.0 + 0.003 * np.ptp(values)
    step = np.ptp(values) / 1700
    found = [bytes_beside(mesh, values, isovalues, precision=each) for each in (f"step={step}", 0.01)]
    assert found[0] < steps
    assert found[1] < places
