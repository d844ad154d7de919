"""What an encoder promises: distances both ways, topology in every layer, step by step."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples, smooth
from isocodec import Decoder, Encoder, LayerComplete
from isocodec.entropy.blend import EITHER
from isocodec.errors import OptionError
from isocodec.grid.field import check_field
from isocodec.jit import kernel
from isocodec.mesh.tables import cube_exponent
from isocodec.passes import births, truth
from isocodec.passes.geometry import _choice
from isocodec.reduce.original import original
from isocodec.stream.crossings import grid_offsets, radices
from isocodec.stream.strategy import grid_plan

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
    assert len(drawn) == 3
    for tolerance, contour in zip(steps[:3], drawn, strict=True):
        assert max(farthest(source, contour), farthest(contour, source)) <= tolerance + 0.03
    exact = decoder.drawn()
    assert sorted(map(tuple, np.round(exact.points, 9))) == sorted(map(tuple, np.round(source.points, 9)))


@kernel
def _choose(wanted, slack, parts, radix, number, rising, low, high, split):
    return _choice(wanted, slack, parts, radix, number, rising, low, high, split)


@examples(300)
@given(data=st.data())
def test_symbols_that_the_slack_leaves_open(data):
    """Against all parts one by one: those whose middle is near enough, and the one that holds the crossing."""
    parts, radix = data.draw(st.sampled_from([1, 3, 15])), data.draw(st.sampled_from([3, 5, 11, 63]))
    wanted, slack = data.draw(st.integers(0, (1 << 30) - 1)), data.draw(st.integers(0, 1 << 30))
    rising = data.draw(st.booleans())
    total, number = parts * radix, wanted * parts >> 30
    good = {wanted * total >> 30}
    good |= {n for n in range(total) if abs((2 * n + 1 << 29) - wanted * total) <= slack * total}
    digits = {n - number * radix for n in good if n // radix == number}
    digits = {d if rising else radix - 1 - d for d in digits}
    low = data.draw(st.integers(0, radix - 2))
    high = data.draw(st.integers(low + 2, radix))
    split = low + high >> 1
    left = {d for d in digits if low <= d < high} or {low if max(digits) < low else high - 1}
    expected = {(True, False): 0, (False, True): 1}.get((min(left) < split, max(left) >= split), EITHER)
    args = (wanted, slack, parts, radix, number, rising, low, high, split)
    assert _choose(*(np.int64(x) for x in args)) == expected


@pytest.mark.parametrize("shape", [(40, 50), (14, 15, 13)])
@pytest.mark.parametrize("tolerance", [0.25, 0.09, 0.05, 0.02, 0.004])
@pytest.mark.parametrize("free", [False, True])
def test_crossings_on_the_grid_are_told_within_the_tolerance(shape, tolerance, free):
    """Edge by edge, and for several isovalues in a file, of which later ones go on from where earlier ones are."""
    field = smooth(shape, 6)
    isovalues = [0.1, 0.13, 0.02, 0.1001]
    plan = grid_plan(len(shape), len(shape) * cube_exponent(shape), None) + grid_offsets(tolerance, free)
    data = isocodec.encode(field, isovalues, plan=plan)
    for isovalue in isovalues:
        contour = isocodec.decode(data, isovalue=isovalue)
        source = original(check_field(field, isovalue))
        found, wanted = (_by_edge(points) for points in (contour.points, source.points))
        assert found.keys() == wanted.keys() and len(found) > 50
        assert max(abs(found[edge] - wanted[edge]).max() for edge in found) <= tolerance


def _by_edge(points):
    """Points on edges of the grid by the edge."""
    points = points[(points != np.floor(points)).sum(axis=1) == 1]
    return {(*np.floor(p), int(np.argmax(p != np.floor(p)))): p for p in points}


def test_slack_makes_files_smaller():
    """Where either of two parts will do, the more probable one is told."""
    field = smooth((60, 70), 8)
    for tolerance in (0.25, 0.1):
        plain = [*grid_plan(2, 2 * cube_exponent(field.shape), None), ("offsets", radices(tolerance)[0])]
        exact = len(isocodec.encode(field, 0.1, plan=plain))
        assert len(isocodec.encode(field, 0.1, tolerance=tolerance)) < 0.95 * exact


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


@pytest.mark.parametrize("shape", [(1500, 1400), (190, 180, 170)])
@pytest.mark.parametrize("options", [
    {}, {"preserve_topology": True}, {"preserve_topology": True, "criterion": "distortion", "parameter": 1.0},
])  # fmt: skip
def test_memory_of_the_encoder(shape, options):
    """At most 12 bytes a sample beyond the input, all temporary arrays counted, where the curve is small."""
    grid = np.ogrid[tuple(map(slice, shape))]
    field = sum((x - s / 2) ** 2 for x, s in zip(grid, shape, strict=True)).astype(np.float32)
    isocodec.encode(field, 400.5, **options)
    tracemalloc.start()
    try:
        isocodec.encode(field, 400.5, **options)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= 12 * field.size


@pytest.mark.parametrize("options", [{"tolerance": 1}, {"steps": [2, 1]}, {"preserve_topology": True}])
def test_the_domain_is_surveyed_once(options, monkeypatch):
    """However many curves a search tries: each trial costs what its curve costs."""
    surveys, trials = [], []
    for module, name in ((truth, "build_pyramid"), (births, "busy_blocks")):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, whole=whole, name=name: surveys.append(name) or whole(*args))
    isocodec.encode(SMOOTH, 20.5, progress=lambda done, total: trials.append(done), **options)
    assert len(trials) > 6
    assert surveys.count("busy_blocks") <= 1 and surveys.count("build_pyramid") <= 3


@pytest.mark.parametrize("shape", [(30, 30), (40, 61), (12, 13, 11)])
def test_files_get_no_larger_with_the_tolerance(shape):
    """Also where it is large against the domain, and where small pieces may go."""
    field = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
    sizes = [len(isocodec.encode(field, 127.5, tolerance=tolerance)) for tolerance in (4, 8, 16, 32, 1000)]
    assert sizes == sorted(sizes, reverse=True) and sizes[-1] < 40
    assert isocodec.encode(field, 127.5, steps=[8]) == isocodec.encode(field, 127.5, tolerance=8)


@pytest.mark.parametrize("options", [
    {"steps": []}, {"steps": [1, 2]}, {"steps": [1, 1]}, {"steps": ["exact", 1]}, {"steps": [0.01]},
    {"steps": [1], "tolerance": 1}, {"steps": [1], "criterion": "crossing"}, {"criterion": "beauty"},
    {"criterion": "distortion"}, {"criterion": "level", "parameter": 1.5}, {"criterion": "crossing", "parameter": 2},
    {"criterion": "topology", "parameter": 0}, {"criterion": "level", "parameter": 99},
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
