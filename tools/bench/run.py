"""Which codecs run on an item: the classes that are chosen, one kind of data after the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

import isocodec

from . import peers2d, peers3d
from .classes import BY_KEY, LARGEST, PICTURE_MEAN, SURFACE_MEAN
from .errors import Shape, apart
from .items import Item
from .lines import isolines
from .ours import Ours
from .record import Recorder, half_way, on_grid
from .rows import Row

PROGRESSIVE = 10
"""Parts of an edge whose files progressive and single-rate ones are compared on: within 0.05 cells."""
RATES = (1, 3, 7, 15, 31)
"""Parts of an edge whose files make up our curve of rate over distortion."""


def run_item(item: Item, keys: list[str], ours: Ours, record: Recorder) -> None:
    """All classes of ``keys`` that fit an item's axes."""
    keys = [key for key in keys if BY_KEY[key].n in (0, item.n)]
    _signs(item, keys, ours, record)
    if item.n == 2:
        _curves(item, keys, ours, record)
        _pictures(item, keys, ours, record)
    else:
        _surfaces(item, keys, ours, record)
    if "progressive" in keys:
        _progressive(ours, record)
    for file in ours.tried.values():
        record.add("ours", f"ours-curve: {file.how}", bytes=len(file.data), search=True, err_mean=file.err_mean,
                   err_max=file.err_max)


def _signs(item: Item, keys: list[str], ours: Ours, record: Recorder) -> None:
    """Inside/outside, exact: the decoded points tell the mask up to which side is which."""
    group, peers = ("mask2d", peers2d.mask_peers) if item.n == 2 else ("mask3d", peers3d.mask_peers)
    crossings = half_way(item.mask)
    for codec in peers(item.mask) if any(BY_KEY[key].group == group for key in keys) else ():
        record.peer(group, codec, lambda read: {"exact": bool(np.array_equal(read, item.mask))})
    if {"signs2", "signs2-progressive", "signs3"} & set(keys):
        record.ours("ours-signs", lambda: ours.encode(precision="signs"), crossings)
    if "signs2-single" in keys:
        single = {"precision": "signs", "layers": ours.full_level}
        record.ours("ours-signs-single", lambda: ours.encode(**single), crossings)
    if "connectivity" in keys:
        vertices = len(marching_cubes(item.numbers, item.isovalue, method="lorensen")[0])
        record.ours("ours-connectivity", lambda: ours.encode(precision="signs"), crossings, vertices=vertices)


def _curves(item: Item, keys: list[str], ours: Ours, record: Recorder) -> None:
    if not {"curve2-mean", "curve2-largest"} & set(keys):
        return
    lines = isolines(item.numbers, item.isovalue)
    check = _against(Shape.of_lines(lines), Shape.of_lines)
    _same_points(ours, np.concatenate(lines), record)
    for codec in peers2d.curve_peers(lines):
        record.peer("contour2d", codec, check)
    _rates(ours)
    if "curve2-mean" in keys:
        _at_named("curve2-mean", ours, record)
    if "curve2-largest" in keys:
        record.file("ours-largest", ours.tolerance(LARGEST))


def _pictures(item: Item, keys: list[str], ours: Ours, record: Recorder) -> None:
    """The whole picture, of which the curve is extracted again."""
    if "picture2" not in keys:
        return
    truth = Shape.of_lines(isolines(item.numbers, item.isovalue))
    check = _against(truth, lambda read: Shape.of_lines(isolines(read, item.isovalue)))
    for codec in peers2d.picture_peers(item.values):
        record.peer("image2d", codec, check)
    for make in peers2d.lossy_pictures(item.values):
        record.lossy("image2d", make, check, PICTURE_MEAN)
    record.file("ours-half", ours.smallest("err_mean", PICTURE_MEAN))


def _surfaces(item: Item, keys: list[str], ours: Ours, record: Recorder) -> None:
    meshes = [key for key in keys if BY_KEY[key].group == "mesh3d"]
    volume = "surface-0.1" in keys
    if not meshes and not volume:
        return
    points, cells, _, _ = marching_cubes(item.numbers, item.isovalue, method="lorensen")
    truth = Shape.of_mesh(points, cells)
    _same_points(ours, points, record)
    _rates(ours)
    if meshes:
        check = _against(truth, lambda read: Shape.of_mesh(*read))
        for codec in peers3d.mesh_peers((points.astype(np.float32), cells.astype(np.uint32))):
            record.peer("mesh3d", codec, check)
        for key in meshes:
            _at_named(key, ours, record)
    if volume:
        check = _against(truth, lambda read: _surface_of(read, item.isovalue))
        for make in peers3d.lossy_volumes(item.values):
            record.lossy("volume3d", make, check, SURFACE_MEAN)
        record.file("ours-0.1", ours.smallest("err_mean", SURFACE_MEAN))


def _surface_of(volume: Any, isovalue: float) -> Shape:
    """The surface of a decoded volume, empty if there is none."""
    if not volume.min() < isovalue < volume.max():
        return Shape.of_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    points, cells, _, _ = marching_cubes(volume.astype(np.float64), isovalue, method="lorensen")
    return Shape.of_mesh(points, cells)


def _progressive(ours: Ours, record: Recorder) -> None:
    """The same curve in layers and at once."""
    layers = ours.offsets(PROGRESSIVE)
    record.ours("ours-progressive", layers.make)
    crossings = on_grid(isocodec.decode(layers.data).points)
    plan = [("base", ours.full_level), ("offsets", PROGRESSIVE)]
    record.ours("ours-single", lambda: ours.encode(layers=plan), crossings)


def _at_named(key: str, ours: Ours, record: Recorder) -> None:
    """Ours with the error of the peer that the class names."""
    cls = BY_KEY[key]
    row = record.get(cls.group, cls.named)
    if row is None or cls.bound not in row:
        record.say(f"{cls.named}, which sets the error of {key}, is missing: left out")
        return
    record.file(cls.ours, ours.smallest(cls.bound, row[cls.bound]))


def _rates(ours: Ours) -> None:
    for parts in RATES:
        ours.offsets(parts)


def _same_points(ours: Ours, points: Any, record: Recorder) -> None:
    """Our extracted points against theirs: the largest distance from one of theirs to ours."""
    gap = float(cKDTree(ours.extracted.points).query(points)[0].max())
    record.add("ours", "ours-extracted", gap=gap, points=len(ours.extracted.points))


def _against(truth: Shape, shape: Callable[[Any], Shape]) -> Callable[[Any], Row]:
    """Errors of what a peer decoded."""

    def check(read: Any) -> Row:
        mean, largest = apart(truth, shape(read))
        return {"err_mean": mean, "err_max": largest}

    return check
