"""Smoothing (clause 9.10): points stay in their parts, what is smooth comes nearer, each round follows its rule."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import grids
import isocodec
from brute import ball, noise, smooth
from isocodec.drawing import smoothing
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.stream.inspect import inspect
from tables import looped


def both(field, isovalue, **options):
    data = isocodec.encode(field, isovalue, **options)
    plain, moved = isocodec.decode(data), isocodec.decode(data, smooth=True)
    assert np.array_equal(plain.cells, moved.cells)
    return plain, moved


@pytest.mark.parametrize("shape", [(23, 30), (9, 11, 10)])
def test_points_stay_on_their_edges(shape):
    """In noise: every sign stays right, and no two points fall together."""
    field = noise(shape) + smooth(shape, 5)
    plain, moved = both(field, 0.1, precision="signs")
    on_edge = (plain.points % 1 != 0).sum(axis=1) == 1
    assert on_edge.mean() > 0.9 and (plain.points != moved.points).any(axis=1).mean() > 0.5
    along = plain.points % 1 == 0.5
    difference = moved.points - plain.points
    assert (difference[on_edge[:, None] & ~along] == 0).all()
    assert np.abs(difference[on_edge]).max() < 0.5
    low, high = np.floor(moved.points[on_edge]).astype(int), np.ceil(moved.points[on_edge]).astype(int)
    assert ((field[tuple(low.T)] > 0.1) != (field[tuple(high.T)] > 0.1)).all()
    assert len(np.unique(moved.points[on_edge], axis=0)) == on_edge.sum()


@pytest.mark.parametrize("shape", [(40, 41), (20, 21, 19)])
@pytest.mark.parametrize("plan", [[("base", 4), ("offsets", 15, 0)], [("base", 4), ("refine", 1), ("offsets", 3, 1)]])
def test_what_follows_from_what_is_told_stays(shape, plan):
    """On coarse meshes points on some edges are implied by those around; others stay in their parts."""
    data = isocodec.encode(smooth(shape, 7), 0.1, layers=plan)
    decoder = isocodec.Decoder()
    decoder.feed(data)
    moved = decoder.take().contour(smooth=True)
    plain, ends = decoder.grid.ends()
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    way = np.linalg.norm(moved.points - plain.points, axis=1)[: len(ends)] / length
    assert 0 < way.max() < 0.5 / plan[-1][1]
    # only on the mesh of a single level are there edges of rings without any parts
    assert (way == 0).mean() > 0.1 or len(plan) > 2
    signs = len(isocodec.open(data).info.layers) - 1
    assert not np.array_equal(
        isocodec.decode(data, layers=signs).points, isocodec.decode(data, layers=signs, smooth=True).points
    )


def test_layers_half_told():
    """A prefix within the offsets: those that have come stay, the others move."""
    data = isocodec.encode(ball((40, 41), (19.3, 20.1), 14.2), 0, precision=0.1)
    layer = inspect(data, symbols=True).layers[-1]
    cut = layer.offset + layer.bytes // 2
    plain = isocodec.decode(data, max_bytes=cut)
    moved = isocodec.decode(data, max_bytes=cut, smooth=True)
    half_way = (plain.points % 1 == 0.5).any(axis=1)
    way = np.abs(plain.points - moved.points).max(axis=1)
    assert way[~half_way].max() <= 0.5 / 5 and 0.3 < (~half_way).mean() < 0.8
    assert (way[half_way] > 0.5 / 5).mean() > 0.3


@pytest.mark.parametrize("parts", [1, 7])
@pytest.mark.parametrize("shape", [(17, 19), (8, 9, 7)])
def test_one_round(shape, parts):
    """By its rule, point by point."""
    n = len(shape)
    field = noise(shape) + 2 * smooth(shape, 5)
    plan = [("base", n * (max(shape) - 2).bit_length()), *([("offsets", parts)] if parts > 1 else [])]
    data = isocodec.encode(field, 0.2, layers=plan, metadata={"smoothing": "1"})
    plain, moved = isocodec.decode(data, smooth=False), isocodec.decode(data)
    points = plain.points
    count = len(points)
    neighbours = [[] for _ in range(count)]
    normal = np.zeros((count, n))
    for cell in plain.cells:
        corners = points[cell]
        if n == 2:
            across = np.array([corners[0, 1] - corners[1, 1], corners[1, 0] - corners[0, 0]])
        else:
            across = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        for v in cell:
            normal[v] += across
            neighbours[v] += [int(u) for u in cell if u != v]
    length = np.linalg.norm(normal, axis=1)
    unit = normal / np.where(length > 0, length, 1)[:, None]
    middle = np.array([points[near].mean(axis=0) for near in neighbours])
    bend = np.where(length > 0, ((middle - points) * unit).sum(axis=1), 0)
    for v in range(count):
        expected = points[v].copy()
        (axes,) = np.nonzero(points[v] % 1)
        if len(axes) != 1:
            expected = middle[v]
        elif len(neighbours[v]) > 1 and abs(unit[v, axes[0]]) > 1e-3:
            step = (bend[v] - bend[neighbours[v]].mean()) / unit[v, axes[0]] / 2
            room = (0.5 - smoothing.NEAR) / parts
            expected[axes[0]] += min(max(step, -room), room)
        # parts at the ends of edges are limited by 9.5(6)
        assert np.allclose(moved.points[v], expected, atol=1e-6), v


# --- files that ask for it -------------------------------------------------------------------------------------------

TURN = np.broadcast_to(np.linspace(0, 6.2, 40)[:, None], (40, 41))
ROUND = {2: (ball((40, 41), (19.3, 20.1), 14.2), 14.2, (19.3, 20.1)),
         3: (ball((28, 27, 29), (13.3, 12.9, 14.1), 11.3), 11.3, (13.3, 12.9, 14.1))}


@looped("n", [2, 3])
@looped("distance", [0.5, 0.2, 0.11, None])
def test_the_promise_holds_with_and_without(n, distance):
    field, radius, centre = ROUND[n]
    data = isocodec.encode(field, 0, precision="signs smooth" if distance is None else f"{distance} smooth")
    file = isocodec.open(data)
    assert int(file.metadata["smoothing"]) in (2, 4, 8, 16)
    plain, asked = file.contour(smooth=False), file.contour()
    assert (plain.points != asked.points).any(axis=1).mean() > 0.5
    (there,) = file.verify(field)
    assert there.kept and there.promised == distance
    errors = [np.abs(np.linalg.norm(c.points - centre, axis=1) - radius) for c in (plain, asked)]
    assert errors[1].mean() < 0.95 * errors[0].mean()
    # between samples the distance is not linear
    for error, share in zip(errors, (0.5, 1), strict=True):
        assert error.max() <= share * (1 if distance is None else distance) + 1 / (4 * radius)


@looped("text", ["", "0", "65", "07", "x", "-1", "1.0", "\u0664", " 4", "100"])
def test_notes_of_other_forms_are_ignored(text):
    field = ROUND[2][0]
    data = isocodec.encode(field, 0, precision="signs", metadata={"smoothing": text})
    assert np.array_equal(isocodec.decode(data).points, isocodec.decode(data, smooth=False).points)


REFUSED = {
    "exact": lambda: isocodec.encode(np.eye(9, dtype=int), 0, precision="exact smooth"),
    "step": lambda: isocodec.encode(np.eye(9), 0.5, precision="step=0.5 smooth"),
    "steps": lambda: isocodec.encode(np.eye(9), 0.5, precision="4,1 smooth"),
    "steps in the world": lambda: isocodec.encode(np.eye(9), 0.5, precision="4m,1m smooth"),
    "layers": lambda: isocodec.encode(np.eye(9), 0.5, precision="0.2 smooth", layers=2),
    "topology": lambda: isocodec.encode(np.eye(9), 0.5, precision="0.2 smooth", keep_topology=True),
    "isovalues": lambda: isocodec.encode(ROUND[2][0], [0, 1], precision="0.2 smooth"),
    "labels": lambda: isocodec.encode(
        isocodec.Field(np.eye(9, dtype=int), labels=[0, 1]), precision="signs smooth"
    ),
    "mesh": lambda: isocodec.encode(
        isocodec.Mesh(np.array([[0, 0], [1, 0], [0, 1.0]]), np.array([[0, 1, 2]]), np.array([0, 1, 2.0])), 0.5,
        precision="0.2 smooth",
    ),
    "surface": lambda: isocodec.encode(isocodec.thin(ROUND[2][0], to=20), precision="0.2 smooth"),
    "periodic": lambda: isocodec.encode(
        grids.placed(ROUND[2][0], [np.cos(TURN), np.sin(TURN)], periodic=0), 0, precision="0.2 smooth"
    ),
    "note": lambda: isocodec.encode(ROUND[2][0], 0, precision=0.2, metadata={"smoothing": "4"}),
    "edit": lambda: isocodec.open(isocodec.encode(ROUND[2][0], 0, precision=0.05)).edited(precision="0.2 smooth"),
}


@looped("name", REFUSED)
def test_what_it_does_not_go_with(name):
    with pytest.raises(OptionError, match="smooth"):
        REFUSED[name]()


def test_tiles_do_not_have_it(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="smooth"):
        isocodec.save(tmp_path / "x.iso", ROUND[2][0], 0, precision="0.2 smooth", tile=32)


def test_other_files_made_of_it(tmp_path: Path) -> None:
    """In another profile it is kept, less precise or together with others it is not."""
    field = ROUND[2][0]
    file = isocodec.open(isocodec.encode(field, 0, precision="0.04 smooth"))
    assert "smoothing" in file.metadata
    assert isocodec.open(file.edited(profile="baseline")).metadata["smoothing"] == file.metadata["smoothing"]
    coarse = isocodec.open(file.edited(precision="signs"))
    assert "smoothing" not in coarse.metadata
    other = isocodec.encode(field, 3, precision="0.04 smooth")
    merged = isocodec.open(isocodec.merge([file.data, other]))
    assert "smoothing" not in merged.metadata and all(one.kept for one in merged.verify(field))


def test_in_the_world_and_in_series():
    field, _, _ = ROUND[3]
    twice = Placement(np.hstack([2 * np.eye(3), np.zeros((3, 1))]), unit="mm")
    placed = isocodec.Field(field, placement=twice)
    file = isocodec.open(isocodec.encode(placed, 0, precision="0.4mm smooth"))
    assert file.metadata["promise"] == "0.4mm" and "smoothing" in file.metadata and file.verify(placed)[0].kept
    frames = [field, field + 0.3, field + 0.6]
    series = isocodec.open(isocodec.encode(isocodec.Frames(frames), 0, precision="0.2 smooth"))
    for asked, plain in zip(series.each_frame(), series.each_frame(smooth=False), strict=True):
        way = np.abs(asked[0].points - plain[0].points).max(axis=1)
        assert (way > 0).mean() > 0.5 and way.max() <= 0.1
