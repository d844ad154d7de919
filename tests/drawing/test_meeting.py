"""Labels as a partition: areas by the coverage checks of shapely, surfaces by the volumes of trimesh."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import isocodec
from isocodec.drawing.meeting import Partition
from isocodec.drawing.simplifying import simplified
from libraries import Late

shapely, trimesh = Late("shapely"), Late("trimesh")


def random_labels(seed: int, n: int) -> NDArray[np.int64]:
    """Samples of a few labels, single ones or blocks, as noise or as regions around seeds."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(2, 14 if n == 2 else 7, n)
    count = int(rng.integers(2, 7))
    if seed % 3:
        values = rng.integers(0, count, shape)
        return np.kron(values, np.ones((2,) * n, np.int64)) if seed % 3 == 1 else values
    away = np.indices(shape)[:, None] - rng.uniform(0, 1, (n, 3 * count, *(1,) * n)) * shape.reshape(n, *(1,) * (n + 1))
    return np.asarray((away**2).sum(axis=0).argmin(axis=0) % count)


def covers(areas: list[Any], domain: Any, whole: bool) -> None:
    assert all(area.is_valid for area in areas) and shapely.coverage_is_valid(np.array(areas, object))
    union = shapely.union_all(areas)
    assert sum(area.area for area in areas) == pytest.approx(union.area, rel=1e-12)
    pairs = shapely.STRtree(areas).query(areas).T
    assert not any(areas[i].intersection(areas[j]).area for i, j in pairs if i != j)
    assert not whole or union.symmetric_difference(domain).area < 1e-9 * domain.area


@pytest.mark.parametrize("first", range(0, 50, 10))
def test_areas_have_no_gaps_and_no_overlaps(first: int) -> None:
    """Of 50 fields: all labels or some, samples missing or not, placed askew or not, smooth or not, in series or not.
    """
    for seed in range(first, first + 10):
        rng = np.random.default_rng(seed)
        values = random_labels(seed, 2)
        gone = rng.random(values.shape) < (seed % 4) / 10 if seed % 4 else None
        gone = None if gone is None or gone.all() else gone
        there = np.unique(values if gone is None else values[~gone])
        labels = [int(label) for label in rng.permutation(there)][seed % 5 == 0 and len(there) > 2 :]
        place = [[0.5, 30, 500015], [-20, 3, 4e6]] if seed % 2 else None
        field = isocodec.Field(values, gone, place, labels=labels)
        what = isocodec.Frames([field, field]) if seed % 7 == 0 else field
        file = isocodec.open(isocodec.encode(what))
        contours = file.contours(smooth=seed % 4 > 1, through_holes=True, frame=file.frames - 1)
        valid = file.valid()
        areas = [shapely.geometry.shape(one.areas(valid=valid)) for one in contours]
        rows, columns = np.nonzero(valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:])
        corners = np.stack([np.stack([rows + i, columns + j], axis=1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], 1)
        domain = shapely.union_all(shapely.polygons(contours[0].place(corners.reshape(-1, 2)).reshape(-1, 4, 2)))
        if domain.area:
            covers(areas, domain, whole=len(labels) == len(there))
        if gone is None:
            fewer = simplified(contours, 1).contours
            covers([shapely.geometry.shape(one.areas()) for one in fewer], domain, whole=len(labels) == len(there))
            assert sum(len(one.points) for one in fewer) <= sum(len(one.points) for one in contours)


@pytest.mark.parametrize("seed", range(6))
def test_surfaces_meet(seed: int) -> None:
    """All are closed, each triangle belongs to two of them, and their volumes add up to that of the grid."""
    values = np.pad(random_labels(seed, 3), 1, constant_values=9)
    labels = [int(label) for label in np.unique(values)]
    file = isocodec.open(isocodec.encode(isocodec.Field(values, labels=labels)))
    for smooth in (False, True):
        *contours, around = file.contours(smooth=smooth)
        meshes = [trimesh.Trimesh(one.points, one.cells, process=False) for one in contours]
        assert all(mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0 for mesh in meshes)
        times = Counter(tuple(sorted(map(tuple, each))) for one in (*contours, around)
                        for each in one.points[one.cells].tolist())
        assert set(times.values()) == {2}
        outside = around.capped()
        rest = trimesh.Trimesh(outside.points, outside.cells, process=False)
        assert sum(mesh.volume for mesh in meshes) + rest.volume == pytest.approx(np.prod(np.array(values.shape) - 1))


def test_masks_that_overlap_are_no_partition() -> None:
    one, other = np.eye(3, dtype=bool), np.ones((3, 3), bool)
    assert Partition.of([one, other]) is None
    assert Partition.of([one, other], valid=~one) is not None
    assert Partition.of([]) is None
    assert Partition.of([one]) is not None
