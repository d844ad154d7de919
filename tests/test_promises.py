"""What an encoder promises: distances both ways, topology in every layer, step by step."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from brute import smooth
from isocodec import Decoder, Encoder, LayerComplete
from isocodec.errors import OptionError
from isocodec.grid.field import check_field
from isocodec.reduce.original import original

RNG = np.random.default_rng(8)
SMOOTH = np.rint(smooth((70, 90), 4) * 300).astype(np.int32)
NOISY = SMOOTH + np.rint(RNG.normal(0, 40, SMOOTH.shape)).astype(np.int32)
SPACE = np.rint(smooth((20, 24, 18), 6) * 300).astype(np.int32)
FIELDS = {"smooth": SMOOTH, "noisy": NOISY, "space": SPACE}


def samples(contour, count=6):
    """Points spread over all segments or triangles."""
    corners = contour.points[contour.cells]
    if corners.shape[1] == 2:
        t = np.linspace(0, 1, count)[:, None]
        return (corners[:, None, 0] * (1 - t) + corners[:, None, 1] * t).reshape(-1, 2)
    u, v = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count))
    keep = u + v <= 1
    u, v = u[keep][:, None], v[keep][:, None]
    return (corners[:, None, 0] * (1 - u - v) + corners[:, None, 1] * u + corners[:, None, 2] * v).reshape(-1, 3)


def farthest(a, b):
    """One-sided distance of dense samples, a lower bound but for the spacing of b's."""
    from scipy.spatial import cKDTree

    return cKDTree(samples(b, 40)).query(samples(a))[0].max()


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("topology", [False, True])
@pytest.mark.parametrize("tolerance", [0.1, 0.25, 1, 4])
def test_tolerance_holds_both_ways(name, topology, tolerance):
    field = FIELDS[name]
    source = original(check_field(field, 20.5))
    decoded = isocodec.decode(isocodec.encode(field, 20.5, tolerance=tolerance, preserve_topology=topology))
    assert max(farthest(source, decoded), farthest(decoded, source)) <= tolerance + 0.03


@pytest.mark.parametrize("name", FIELDS)
def test_the_original_is_the_exact_curve(name):
    exact = isocodec.decode(isocodec.encode(FIELDS[name], 20.5, exact=True))
    source = original(check_field(FIELDS[name], 20.5))
    assert sorted(map(tuple, np.round(exact.points, 9))) == sorted(map(tuple, np.round(source.points, 9)))
    assert len(exact.cells) == len(source.cells)


def shape_of(contour):
    """Components: (Euler characteristic, number of points of odd or single use) of each, sorted."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n, cells = contour.cells.shape[1], contour.cells
    if not len(cells):
        return []
    rows, columns = cells[:, 0].repeat(n - 1), cells[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(contour.points),) * 2)
    count, label = connected_components(graph, directed=False)
    euler = np.bincount(label, minlength=count)
    if n == 2:
        euler -= np.bincount(label[cells[:, 0]], minlength=count)
        return sorted(euler[np.bincount(label[cells[:, 0]], minlength=count) > 0].tolist())
    sides = np.unique(np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    euler = euler - np.bincount(label[sides[:, 0]], minlength=count) + np.bincount(label[cells[:, 0]], minlength=count)
    return sorted(euler[np.bincount(label[cells[:, 0]], minlength=count) > 0].tolist())


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("options", [
    {}, {"exact": True}, {"signs_only": True}, {"tolerance": 0.5}, {"steps": [4, 1, 0.25]}, {"steps": [2, "exact"]},
    {"criterion": "distortion", "parameter": 2.0},
])  # fmt: skip
def test_topology_in_every_layer(name, options):
    field = FIELDS[name]
    whole = shape_of(original(check_field(field, 20.5)))
    decoder = Decoder()
    decoder.feed(isocodec.encode(field, 20.5, preserve_topology=True, **options))
    layers = [shape_of(decoder.drawn()) for event in decoder if isinstance(event, LayerComplete)]
    assert len(layers) >= 1
    for layer in layers:
        assert layer == whole


@pytest.mark.parametrize("name", FIELDS)
def test_steps_promise_one_after_the_other(name):
    field = FIELDS[name]
    source = original(check_field(field, 20.5))
    steps = [4, 1, 0.25, "exact"]
    decoder = Decoder()
    decoder.feed(isocodec.encode(field, 20.5, steps=steps))
    drawn = []
    for event in decoder:
        if isinstance(event, LayerComplete) and event.layer.kind == "offsets":
            drawn.append(decoder.drawn())
    for tolerance, contour in zip(steps, drawn, strict=False):
        assert max(farthest(source, contour), farthest(contour, source)) <= tolerance + 0.03
    exact = decoder.drawn()
    assert sorted(map(tuple, np.round(exact.points, 9))) == sorted(map(tuple, np.round(source.points, 9)))


def test_a_searched_file_is_smaller():
    """Smooth curves need few crossings."""
    grid = b"".join(Encoder(SMOOTH, 20.5, plan=[("base", 8), ("refine", None), ("offsets", 3)]))
    assert len(isocodec.encode(SMOOTH, 20.5, tolerance=0.25)) < 0.9 * len(grid)
    assert len(isocodec.encode(SMOOTH, 20.5, tolerance=2)) < 0.5 * len(grid)


@pytest.mark.parametrize("criterion, parameter", [("crossing", None), ("topology", None), ("curvature", 0.2),
                                                  ("distortion", 1.0), ("level", 6)])  # fmt: skip
@pytest.mark.parametrize("name", FIELDS)
def test_published_criteria(name, criterion, parameter):
    """C2-crossing, C2-topology, C2-curvature, C2-distortion, C2-uniform: decoded, and coarser for larger parameters."""
    field = FIELDS[name]
    data = isocodec.encode(field, 20.5, criterion=criterion, parameter=parameter)
    contour = isocodec.decode(data)
    assert len(contour.cells)
    if criterion == "crossing":
        full = isocodec.decode(isocodec.encode(field, 20.5, signs_only=True))
        assert len(contour.cells) >= len(full.cells)
    if criterion == "distortion":
        coarser = isocodec.decode(isocodec.encode(field, 20.5, criterion=criterion, parameter=4 * parameter))
        assert len(coarser.cells) < len(contour.cells)


@pytest.mark.parametrize("options", [
    {"steps": []}, {"steps": [1, 2]}, {"steps": [1, 1]}, {"steps": ["exact", 1]}, {"steps": [0.01]},
    {"steps": [1], "tolerance": 1}, {"steps": [1], "criterion": "crossing"}, {"criterion": "beauty"},
    {"criterion": "distortion"},
    {"parameter": 1.0},
    {"criterion": "distortion", "parameter": -1.0}, {"criterion": "distortion", "parameter": float("nan")},
    {"base_level": 2, "preserve_topology": True}, {"base_level": 2, "criterion": "crossing"},
    {"plan": [("base", 2)], "preserve_topology": True}, {"tolerance": -1.0}, {"tolerance": 1e-12},
])  # fmt: skip
def test_refused(options):
    with pytest.raises(OptionError):
        isocodec.encode(SMOOTH, 20.5, **options)


def test_exact_steps_need_integers():
    with pytest.raises(OptionError, match="floats"):
        isocodec.encode(SMOOTH.astype(np.float32), 20.5, steps=[1, "exact"])


@pytest.mark.parametrize("options", [{"tolerance": 1}, {"preserve_topology": True}, {"steps": [2, 1]},
                                     {"criterion": "distortion", "parameter": 1.0}])  # fmt: skip
@pytest.mark.parametrize("shape", [(2, 2), (9, 5), (3, 4, 5)])
def test_no_curve(options, shape):
    for field in (np.zeros(shape, np.int16), np.full(shape, 9, np.int16)):
        contour = isocodec.decode(isocodec.encode(field, 4.5, **options))
        assert not len(contour.cells)
