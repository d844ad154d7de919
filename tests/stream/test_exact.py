"""What comes out against what other extractors find, on generated fields; and what must not go in."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import isocodec
from brute import crossing_points, smooth
from files import fed
from isocodec import Field, Frames
from isocodec.drawing.snapshot import state_of
from isocodec.errors import InputError, OptionError
from libraries import Late
from tables import looped

cKDTree = Late("scipy.spatial.cKDTree")
measure = Late("skimage.measure")


def integers(shape, seed, span=100.0, noise=0.0):
    """A smooth field of integers with noise, in units of ``span``."""
    rng = np.random.default_rng(seed)
    return np.rint(span * (smooth(shape, seed) + noise * rng.normal(size=shape))).astype(np.int64)


def matched(a, b, tolerance):
    """The same set of points: as many, and each within ``tolerance`` of its partner, both ways."""
    assert len(a) == len(b)
    if len(a):
        assert cKDTree(a).query(b)[0].max() <= tolerance
        assert cKDTree(b).query(a)[0].max() <= tolerance


def round_trip(field, isovalue, **options):
    """Encoded and decoded, whole."""
    contour = isocodec.decode(isocodec.encode(field, isovalue, **options))
    assert contour.complete and contour.isovalue == isovalue and contour.shape == np.shape(field)
    return contour


def on_grid_edges(points):
    """Points of which all coordinates but one are whole; in a surface the others are inside cells."""
    return points[np.count_nonzero(points != np.rint(points), axis=1) <= 1]


# --- exact ----------------------------------------------------------------------------------------------------------


@looped("noise", [0.0, 0.05, 0.5])
@looped("shape, seed", [((64, 64), 1), ((33, 90), 2), ((100, 7), 3), ((2, 50), 4)])
def test_points_are_those_of_find_contours(shape, seed, noise):
    """Exact integers between two samples' values: every point of scikit-image's polylines, and no other."""
    field = integers(shape, seed, noise=noise)
    isovalue = int(np.median(field)) + 0.5
    contour = round_trip(field, isovalue, precision="exact")
    lines = measure.find_contours(field, isovalue)
    expected = np.unique(np.round(np.concatenate([np.zeros((0, 2)), *lines]), 9), axis=0)
    assert len(expected) > 0
    matched(contour.points, expected, 1e-9)


def edges_of(cells):
    """How many triangles each edge has."""
    return Counter(tuple(sorted(e)) for t in cells.tolist() for e in itertools.combinations(t, 2))


@looped("noise", [0.0, 0.05, 0.5])
@looped("shape, seed", [((16, 16, 16), 1), ((9, 20, 12), 2), ((3, 30, 5), 3), ((2, 2, 9), 4)])
def test_vertices_are_those_of_marching_cubes(shape, seed, noise):
    """Exact integers in three dimensions: the grid-edge vertices of marching cubes; edges have two triangles."""
    field = integers(shape, seed, noise=noise)
    isovalue = int(np.median(field)) + 0.5
    contour = round_trip(field, isovalue, precision="exact")
    vertices = measure.marching_cubes(field.astype(float), isovalue, method="lorensen")[0]
    expected = np.unique(np.round(vertices.astype(float), 4), axis=0)  # single precision
    grid = on_grid_edges(contour.points)
    matched(grid, crossing_points(field, isovalue), 1e-9)
    assert cKDTree(expected).query(grid)[0].max() <= 1e-4
    assert cKDTree(grid).query(expected)[0].max() <= 1e-4
    # Edge-manifold: two triangles at an edge, one if the edge lies in the border of the box.
    last = np.array(shape) - 1
    for (a, b), count in edges_of(contour.cells).items():
        p, q = contour.points[a], contour.points[b]
        border = np.any((p == q) & ((p == 0) | (p == last)))
        assert count == (1 if border else 2)


# --- tolerance ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.004])
def test_tolerance_in_three_dimensions(tolerance):
    """Points on grid edges move along them only: within the tolerance of linear interpolation's."""
    field = smooth((12, 9, 14), 3)
    contour = round_trip(field, 0.05, precision=tolerance)
    matched(on_grid_edges(contour.points), crossing_points(field, 0.05), tolerance)


def test_default_is_a_tolerance():
    """Without options: within a twentieth of a cell."""
    field = smooth((40, 40), 5)
    default, asked = (isocodec.open(isocodec.encode(field, 0.1, **given)) for given in ({}, {"precision": 0.05}))
    assert np.array_equal(default.contour().points, asked.contour().points)
    assert (default.promise, asked.promise) == (None, "within 0.05 cells")


# --- what must not go in --------------------------------------------------------------------------------------------

GOOD = np.arange(12.0).reshape(3, 4)


@looped(
    "field, code",
    [
        (np.array([["a", "b"], ["c", "d"]]), "dtype"),
        (GOOD.astype(complex), "dtype"),
        (GOOD.astype(object), "dtype"),
        (GOOD.astype("datetime64[s]"), "dtype"),
        (np.zeros((3, 4), [("a", float)]), "dtype"),
        (np.zeros(5), "axes"),
        (3.0, "axes"),
        (np.zeros((3, 3, 3, 3)), "axes"),
        (np.zeros((1, 9)), "shape"),
        (np.zeros((9, 1)), "shape"),
        (np.zeros((4, 4, 1)), "shape"),
        (np.zeros((0, 4)), "shape"),
        (np.zeros((0, 0)), "shape"),
        (np.broadcast_to(np.int8(0), (2, (1 << 24) + 1)), "shape"),
        (np.broadcast_to(np.int8(0), (2, 2, (1 << 20) + 1)), "shape"),
    ],
)
def test_fields_refused(field, code):
    """Types, numbers of axes and lengths that are no sampled field."""
    with pytest.raises(InputError) as caught:
        isocodec.encode(field, 0.5)
    assert caught.value.code == code and caught.value.remedy


def test_numbers_of_numpy_are_numbers():
    field = np.rint(40 * smooth((12, 14), 3)).astype(np.int64)
    for plain, numpys in (
        ({"layers": 2}, {"layers": np.int64(2)}),
        ({"precision": 0.5}, {"precision": np.float32(0.5)}),
        ({"precision": [4, 1]}, {"precision": np.array([4, 1])}),
        ({"precision": [2.0, "exact"]}, {"precision": (np.float64(2), "exact")}),
        ({"layers": "curvature=1"}, {"layers": f"curvature={np.uint8(1)}"}),
    ):
        assert isocodec.encode(field, np.float32(0.5), **numpys) == isocodec.encode(field, 0.5, **plain)


@looped(
    "field, options, code",
    [
        (GOOD, {"precision": "exact"}, "exact"),
        (GOOD.astype(int), {"precision": "step=0.5"}, "step"),
        (GOOD, {"precision": "step=0.0"}, "step"),
        (GOOD, {"precision": f"step={-1.0}"}, "step"),
        (GOOD, {"precision": f"step={math.nan}"}, "step"),
        (GOOD, {"precision": f"step={math.inf}"}, "step"),
        (GOOD, {"precision": 0.0}, "tolerance"),
        (GOOD, {"precision": -0.1}, "tolerance"),
        (GOOD, {"precision": math.nan}, "tolerance"),
        (GOOD, {"precision": 1e-10}, "tolerance"),  # more than 2**24 parts of a cell
        (GOOD, {"precision": [2, "exact"], "layers": 1}, "options"),
        (GOOD, {"layers": [("base", None)], "precision": "signs"}, "options"),
        (GOOD, {"layers": [("base", None)], "keep_topology": True}, "options"),
        (GOOD, {"precision": "step=a"}, "options"),
        (GOOD, {"layers": -1}, "base-level"),
        (GOOD, {"layers": 5}, "base-level"),  # 3 x 4 samples: k = 2, level 4
        (GOOD, {"profile": "best"}, "profile"),
        *((GOOD, options, None) for options in (
            {"layers": 2.5}, {"layers": "two"}, {"layers": []}, {"precision": "one"}, {"precision": {4: 1}},
            {"precision": "4,a"}, {"precision": ["a"]}, {"profile": None},
        )),
    ],
)
def test_options_refused(field, options, code):
    """Options out of range or of another kind, and those that contradict one another or the data."""
    with pytest.raises(OptionError) as caught:
        isocodec.encode(field, 0.5, **options)
    assert code is None or caught.value.code == code


# --- what goes in ---------------------------------------------------------------------------------------------------


@looped("shape", [(2, 2), (9, 14), (5, 3, 4)])
@looped("options", [{}, {"precision": "exact"}, {"precision": "signs"}, {"layers": 0}])
def test_no_contour(shape, options):
    """A constant field, and an isovalue outside the data: a short file with nothing in it."""
    ramp = np.arange(math.prod(shape)).reshape(shape)
    flat = np.full(shape, 7)
    for field, isovalue in ((flat, 7), (flat, 6.5), (ramp, -1), (ramp, 1e9), (ramp, ramp.max())):
        data = isocodec.encode(field, isovalue, **options)
        contour = isocodec.decode(data)
        n = len(shape)
        assert contour.points.shape == (0, n) and contour.cells.shape == (0, n) and contour.complete
        assert len(data) <= 32


@looped(
    "dtype", ["bool", "u1", "i1", "<i2", ">i2", "<u4", ">i4", "<i8", ">u8", "f2", "<f4", ">f4", "<f8", ">f8"]
)
def test_types(dtype):
    """Types and byte orders give the contour of the same numbers in int64 or float64."""
    field = integers((13, 17), 9, span=2.0)
    field -= field.min()
    field = np.minimum(field, 1) if dtype == "bool" else field
    plain = field.astype(float if "f" in dtype else int)
    for options in (
        {"precision": 0.01}, {"precision": "step=0.5"} if "f" in dtype else {"precision": "exact"},
        {"precision": "signs"},
    ):
        assert isocodec.encode(field.astype(dtype), 0.75, **options) == isocodec.encode(plain, 0.75, **options)
    assert len(isocodec.decode(isocodec.encode(field.astype(dtype), 0.75)).points) > 0


LAYOUTS = {
    "Fortran": np.asfortranarray,
    "strides": lambda values: np.repeat(values, 2, axis=-1)[..., ::2],
    "backwards": lambda values: np.ascontiguousarray(values[::-1])[::-1],
    "transposed": lambda values: np.moveaxis(np.ascontiguousarray(np.moveaxis(values, 0, -1)), -1, 0),
    "read-only": lambda values: np.frombuffer(values.tobytes(), values.dtype).reshape(values.shape),
}
MISSING = {
    "none": lambda values, gone, layout: layout(values),
    "NaN": lambda values, gone, layout: layout(np.where(gone, np.nan, values)),
    "masked": lambda values, gone, layout: np.ma.masked_array(layout(values), layout(gone)),
    "mask": lambda values, gone, layout: Field(layout(values), mask=layout(gone)),
    "filled": lambda values, gone, layout: Field(layout(values), mask=layout(gone), missing="nearest"),
}
USES = {
    **{str(each): lambda field, each=each: isocodec.encode(field, 3, precision=each)
       for each in ("signs", None, 0.3, 1.0, "exact", "4,1")},
    "several": lambda field: isocodec.encode(field, [1, 3]),
    "criterion": lambda field: isocodec.encode(field, 3, layers="distortion=1"),
    "labels": lambda field: isocodec.encode(replace(as_field(field), labels=[1, 3])),
    "frames": lambda field: isocodec.encode(Frames([field, field]), 3),
    "tiles": lambda field: in_tiles(field),
    "verify": lambda field: isocodec.open(PLAIN).verify(field) if as_field(field).values.ndim == 2 else None,
    "sample": lambda field: isocodec.decode(PLAIN).sample(field).tolist() if as_field(field).values.ndim == 2 else None,
}
PLAIN = isocodec.encode(integers((12, 10), 4, span=6), 3)


def as_field(field):
    return field if isinstance(field, Field) else Field(field)


def in_tiles(field):
    with TemporaryDirectory() as folder:
        isocodec.save(Path(folder, "a.iso"), field, 3, tile=32)
        return Path(folder, "a.iso").read_bytes()


def outcome(use, field):
    """What comes out, or the error: some uses need all samples."""
    try:
        return str(use(field))
    except (InputError, OptionError) as error:
        return str(error)


@pytest.mark.parametrize("missing", MISSING)
@looped("n, use, layout", [*product((2,), USES, LAYOUTS), *product((3,), USES, ["Fortran"])])
def test_layouts(missing, n, use, layout):
    """The values count, however they lie in memory."""
    field = integers((12, 10, 8)[:n], 4, span=6)
    values, gone = field if missing in ("none", "filled") else field.astype(float), field % 5 == 4
    plain, other = (MISSING[missing](values, gone, each) for each in (np.array, LAYOUTS[layout]))
    assert outcome(USES[use], other) == outcome(USES[use], plain)


def test_values_stay_as_they_were():
    field = integers((12, 10), 4)
    frozen = field.copy()
    frozen.setflags(write=False)
    assert isocodec.encode(frozen, 3) == isocodec.encode(field.tolist(), 3) and np.array_equal(frozen, field)


@pytest.mark.parametrize(
    "dtype, isovalue", [("i8", 1 << 62), ("i8", -(1 << 62)), ("i8", (1 << 63) - 1024), ("u8", (1 << 64) - 2048)]
)
def test_integers_that_no_float_holds(dtype, isovalue):
    """Near 2**62 floats are 512 or more apart: signs and numbers come from the integers all the same."""
    field = np.array([[isovalue + int(v) for v in row] for row in integers((9, 11), 6)], dtype)
    exact = [[int(v) > isovalue for v in row] for row in field.tolist()]
    assert 10 < sum(map(sum, exact)) < 89
    decoder = fed(isocodec.encode(field, float(isovalue), precision="exact", layers=0))
    known = state_of(decoder.grid._tube)
    assert known.above.tolist() == [exact[i][j] for i, j in known.position.tolist()]
    ends = 0
    for p, above, missing, number in zip(known.position, known.above, known.missing, known.number, strict=True):
        if _crossing(exact, p):
            ends += 1
            assert missing == 0
            assert int(field[tuple(p)]) == (isovalue + 1 + int(number) if above else isovalue - int(number))
    assert ends > 10


def _crossing(exact, p):
    """Whether a neighbour of a sample along an axis has the other sign."""
    i, j = map(int, p)
    around = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    return any(
        0 <= a < len(exact) and 0 <= b < len(exact[0]) and exact[a][b] != exact[i][j] for a, b in around
    )


def test_values_too_far_from_the_isovalue():
    """More than 52 bits of steps cannot be sent exactly; a tolerance can."""
    field = np.array([[0, 0], [0, 1 << 60]])
    with pytest.raises(InputError) as caught:
        isocodec.encode(field, 5, precision="exact")
    assert caught.value.code == "range"
    assert len(isocodec.decode(isocodec.encode(field, 5)).points) == 2


def test_float_isovalue_is_not_rounded_to_the_samples_type():
    """float16 and float32 samples are compared with the isovalue as it is: 0.1 is below float32(0.1)."""
    field = np.full((4, 4), np.float32(0.1))
    field[1, 1] = 0
    assert float(np.float32(0.1)) > 0.1
    assert len(isocodec.decode(isocodec.encode(field, 0.1)).points) == 4
    assert len(isocodec.decode(isocodec.encode(field, float(np.float32(0.1)))).points) == 0


@looped("isovalue", [1e39, -3.5e38, 5e-324, 2.0**60, 1e300])
def test_extreme_isovalues(isovalue):
    """Isovalues beyond single precision, or far beyond the halves that are written as numbers."""
    field = np.array([[0.0, 0.0], [0.0, 2 * isovalue]])
    contour = isocodec.decode(isocodec.encode(field, isovalue, precision=0.01))
    assert contour.isovalue == isovalue
    assert len(contour.points) == 2
