"""Smoothing: what is stated stays, what is smooth comes nearer, and each round is what its rule says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
from brute import ball, noise, smooth
from commands import ok
from isocodec.drawing import smoothing
from isocodec.stream.inspect import inspect


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


@pytest.mark.parametrize("shape", [(23, 30), (17, 16, 15)])
def test_points_stay_on_edges_of_coarse_meshes(shape):
    """Between the vertices of some crossed leaf."""
    n = len(shape)
    data = isocodec.encode(noise(shape) + 2 * smooth(shape, 5), 0.1, layers=[("base", n), ("refine", 1)])
    decoder = isocodec.Decoder()
    decoder.feed(data)
    decoder.close()
    position, simplices = decoder.grid.crossed()
    ends = {tuple(sorted((int(a), int(b)))) for leaf in simplices for a in leaf for b in leaf if a < b}
    low, high = (position[[end[i] for end in ends]].astype(float) for i in (0, 1))
    way = high - low
    moved = decoder.contour(smooth=True).points
    assert (moved != decoder.contour().points).any(axis=1).mean() > 0.5
    for point in moved:
        ratio = ((point - low) * way).sum(axis=1) / (way**2).sum(axis=1)
        off = np.abs(low + ratio[:, None] * way - point).max(axis=1)
        assert ((off < 1e-9) & (ratio > 0) & (ratio < 1)).any()


@pytest.mark.parametrize("shape", [(40, 41), (20, 21, 19)])
@pytest.mark.parametrize("plan", [[("base", 4), ("offsets", 15, 0)], [("base", 4), ("refine", 1), ("offsets", 3, 2)]])
def test_what_follows_from_what_is_told_stays(shape, plan):
    """On coarse meshes points on some edges are implied by those around."""
    data = isocodec.encode(smooth(shape, 7), 0.1, layers=plan)
    plain, moved = isocodec.decode(data), isocodec.decode(data, smooth=True)
    assert len(plain.points) and np.array_equal(plain.points, moved.points)
    signs = len(isocodec.open(data).info.layers) - 1
    assert not np.array_equal(
        isocodec.decode(data, layers=signs).points, isocodec.decode(data, layers=signs, smooth=True).points
    )


@pytest.mark.parametrize("options", [{"precision": "exact"}, {"precision": 0.05}, {}])
@pytest.mark.parametrize("shape", [(23, 30), (9, 11, 10)])
def test_what_is_told_stays(shape, options):
    """But for points in the middles of cells, which are between their neighbours anyway."""
    plain, moved = both(np.rint(100 * (noise(shape) + smooth(shape, 5))).astype(int), 10.5, **options)
    told = (plain.points % 1 != 0).sum(axis=1) <= 1
    assert told.mean() > 0.9
    assert np.array_equal(plain.points[told], moved.points[told])


def test_layers_half_told():
    """A prefix within the offsets: those that have come stay, the others move."""
    data = isocodec.encode(ball((40, 41), (19.3, 20.1), 14.2), 0)
    layer = inspect(data, symbols=True).layers[-1]
    cut = layer.offset + layer.bytes // 2
    plain = isocodec.decode(data, max_bytes=cut)
    moved = isocodec.decode(data, max_bytes=cut, smooth=True)
    half_way = (plain.points % 1 == 0.5).any(axis=1)
    same = (plain.points == moved.points).all(axis=1)
    assert same[~half_way].all() and 0.3 < (~half_way).mean() < 0.8
    # parts are odd in number: some are told to be half-way
    assert same[half_way].mean() < 0.2


@pytest.mark.parametrize(
    ("field", "radius", "centre", "gain"),
    [
        (ball((40, 41), (19.3, 20.1), 14.2), 14.2, (19.3, 20.1), 0.7),
        (ball((28, 27, 29), (13.3, 12.9, 14.1), 11.3), 11.3, (13.3, 12.9, 14.1), 0.6),
    ],
)
def test_round_things_come_nearer(field, radius, centre, gain):
    plain, moved = both(field, 0, precision="signs")
    errors = [np.abs(np.linalg.norm(c.points - centre, axis=1) - radius) for c in (plain, moved)]
    assert errors[1].mean() < gain * errors[0].mean()


def test_flat_things_come_nearer():
    z, y, x = np.mgrid[:20, :21, :22]
    plain, moved = both(0.31 * z + 0.47 * y + 0.82 * x - 16.1, 0, precision="signs")
    errors = [np.abs(c.points @ (0.31, 0.47, 0.82) - 16.1) for c in (plain, moved)]
    assert errors[1].mean() < 0.5 * errors[0].mean()


@pytest.mark.parametrize("shape", [(17, 19), (8, 9, 7)])
def test_one_round(shape, monkeypatch):
    """By its rule, point by point."""
    monkeypatch.setattr(smoothing, "ROUNDS", 1)
    n = len(shape)
    plain, moved = both(noise(shape) + 2 * smooth(shape, 5), 0.2, precision="signs")
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
            expected[axes[0]] += min(max(step, smoothing.NEAR - 0.5), 0.5 - smoothing.NEAR)
        assert np.allclose(moved.points[v], expected, atol=1e-9), v


def test_command_line(tmp_path: Path) -> None:
    np.save(tmp_path / "b.npy", ball((20, 21, 22), (9.3, 10.2, 10.9), 7.4))
    ok("encode", tmp_path / "b.npy", "-o", tmp_path / "b.iso", "--isovalue", 0, "--precision", "signs")
    ok("decode", tmp_path / "b.iso", "-o", tmp_path / "b.npz", "--smooth")
    with np.load(tmp_path / "b.npz") as arrays:
        expected = isocodec.decode((tmp_path / "b.iso").read_bytes(), smooth=True)
        assert np.array_equal(arrays["points"], expected.points)
    ok("plot", tmp_path / "b.iso", "-o", tmp_path / "b.png", "--smooth")
    plain = (tmp_path / "b.png").read_bytes()
    ok("plot", tmp_path / "b.iso", "-o", tmp_path / "b.png")
    assert plain != (tmp_path / "b.png").read_bytes()


def test_nothing_to_smooth():
    for shape in ((5, 5), (5, 5, 5)):
        plain, moved = both(np.zeros(shape), 1, precision="signs")
        assert len(plain.points) == len(moved.points) == 0
