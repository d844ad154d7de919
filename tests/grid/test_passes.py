"""The passes against brute force: after every level the leaves are the crossed simplices of the uniform mesh."""

from __future__ import annotations

import math
from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brute import blobs, crossing_edges, crossing_points, examples, lattice, mixed, sign_fields, smooth
from isocodec import Decoder
from isocodec.drawing import snapshot
from isocodec.field.samples import interval_value
from isocodec.format.events import LayerComplete
from isocodec.format.kinds import GEOMETRY
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.search.strategy import grid_plan
from isocodec.stream.encoder import encoder_of
from isoconform.meshes import exponent
from libraries import Late

KDTree = Late("scipy.spatial.KDTree")

# --- set-up and checks ----------------------------------------------------------------------------------------------


def leaves_of(tube, isovalue=0.5, scale=None):
    """All that the drawing is told."""
    return snapshot.leaves_of(tube, isovalue, lambda number, above: interval_value(isovalue, scale, number, above))


def as_counter(simplices):
    """Simplices as tuples of positions, x0 first."""
    return Counter(tuple(map(tuple, s)) for s in simplices.tolist())


def check_level(leaves, above, level):
    """Leaves are those of brute force, once each; signs are the field's; no vertex has two numbers."""
    assert as_counter(leaves.position[leaves.simplices]) == as_counter(mixed(above, level))
    assert np.array_equal(leaves.above, above[tuple(leaves.position.T)])
    assert len(np.unique(leaves.position, axis=0)) == len(leaves.position)
    n = above.ndim
    assert leaves.full == (level == n * exponent(above.shape))
    assert lattice(above.shape, level)[tuple(leaves.position.T)].all()


def crossing_ends(above):
    """Ends of the grid edges that are crossed, as a set of tuples."""
    low, axis = crossing_edges(above)
    high = low.copy()
    high[np.arange(len(low)), axis] += 1
    return set(map(tuple, np.concatenate([low, high]).tolist()))


def check_full_grid(leaves, above):
    """Both ends of every grid edge that is crossed are known, with the right sign."""
    known = dict(zip(map(tuple, leaves.position.tolist()), leaves.above.tolist(), strict=True))
    for p in crossing_ends(above):
        assert known[p] == above[p]


def decode_and_check(field, isovalue=0.5, **options):
    """Encode, and decode with a look at every level; the decoder's tube at the end, and the encoder's."""
    encoder = encoder_of(field, isovalue, **options)
    data = b"".join(encoder)
    above = np.asarray(field) > isovalue
    decoder = Decoder()
    decoder.feed(data)
    levels = []
    for event in decoder:
        if isinstance(event, LayerComplete) and event.layer.kind not in GEOMETRY:
            level = event.layer.level
            levels.append(level)
            check_level(leaves_of(decoder.grid._tube, isovalue), above, level)
    assert decoder.complete
    first = encoder.frame.layers[0].level if options.get("layers") is None else options["layers"]
    assert levels == list(range(first, above.ndim * exponent(above.shape) + 1))
    check_full_grid(leaves_of(decoder.grid._tube, isovalue), above)
    same_state(encoder.frame.strands[-1].tube, decoder.grid._tube)
    return encoder, decoder


def same_state(one, other):
    """Encoder and decoder know the same: vertices in order, leaves in order, symbol counts, geometry."""
    assert np.array_equal(one.tally(), other.tally())
    a, b = leaves_of(one), leaves_of(other)
    for name in ("position", "above", "simplices", "levels", "edges", "edge_offset"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert (a.value is None) == (b.value is None)
    if a.value is not None:
        assert np.array_equal(a.value, b.value, equal_nan=True)
    assert a.full == b.full


# --- signs ----------------------------------------------------------------------------------------------------------


@st.composite
def fields_and_bases(draw, n, most, longest=None):
    """A field of signs and a level for its base, the default among them."""
    above = draw(sign_fields(n, most, longest))
    return above, draw(st.one_of(st.none(), st.integers(0, n * exponent(above.shape))))


@examples(300)
@given(st.one_of(fields_and_bases(2, 20, 50), fields_and_bases(3, 8, 17)))
def test_levels_are_brute_force(case):
    """C2-uniform-base, C2-refine-uniform, S3-dfs: any field of signs, any base."""
    above, base_level = case
    decode_and_check(above, precision="signs", layers=base_level)


@pytest.mark.parametrize("shape", [(2, 2), (2, 3), (3, 2), (2, 2, 2)])
def test_all_fields_of_a_few_samples(shape):
    """Every one of 2**4, 2**6 and 2**8 patterns of signs, from every base."""
    for bits in product((False, True), repeat=math.prod(shape)):
        for base_level in range(len(shape) * exponent(shape) + 1):
            decode_and_check(np.reshape(bits, shape), precision="signs", layers=base_level)


@examples(60)
@given(st.sampled_from([(33, 33), (9, 9, 9), (30, 17), (7, 10, 9)]), st.integers(0, 1 << 32), st.integers(0, 6))
def test_isolated_pixels_around_a_curve(shape, seed, base_level):
    """Sparse specks of both signs on a smooth field: new components near curves and far from them."""
    rng = np.random.default_rng(seed)
    decode_and_check((smooth(shape, seed) > 0) ^ (rng.random(shape) < 0.03), precision="signs", layers=base_level)


# --- geometry -------------------------------------------------------------------------------------------------------


def check_values(leaves, field, full):
    """Values are exact where the drawing needs them: at the ends of crossing grid edges, or at all leaves' vertices."""
    if full:
        wanted = crossing_ends(field > leaves.isovalue)
    else:
        wanted = {tuple(p) for p in leaves.position[np.unique(leaves.simplices)].tolist()}
    value = dict(zip(map(tuple, leaves.position.tolist()), leaves.value.tolist(), strict=True))
    assert {p: value[p] for p in wanted} == {p: float(field[p]) for p in wanted}


@st.composite
def integer_fields(draw, n, most):
    """A field of integers between noise and smooth, and an isovalue on or between its samples."""
    shape = tuple(draw(st.lists(st.integers(2, most), min_size=n, max_size=n)))
    seed = draw(st.integers(0, 1 << 32))
    span = draw(st.sampled_from([1, 3, 200, 1 << 20, 1 << 45]))
    noise = draw(st.sampled_from([0.0, 0.1, 1.0]))
    field = smooth(shape, seed) + noise * np.random.default_rng(seed).normal(size=shape)
    field = np.rint(span * field).astype(np.int64)
    value = int(field.ravel()[draw(st.integers(0, field.size - 1))])
    return field, value + draw(st.sampled_from([0, 0.5, -0.5]))


@examples(100)
@given(st.one_of(integer_fields(2, 18), integer_fields(3, 7)))
def test_values_are_exact(case):
    """C2-geometry: after the last plane every vertex that the drawing uses has its sample's value."""
    field, isovalue = case
    _, decoder = decode_and_check(field, isovalue, precision="exact")
    if decoder.grid._tube.estimates.has_values:
        check_values(leaves_of(decoder.grid._tube, isovalue), field, full=True)
    points = decoder.contour().points
    expected = crossing_points(field, isovalue)
    assert len(points) >= len(expected)  # a surface may have points inside cells too
    # points keep this distance from samples, so that those around a sample that equals the isovalue stay apart
    assert KDTree(points).query(expected)[0].max(initial=0) <= 2**-21 * 1.001


@examples(60)
@given(st.one_of(integer_fields(2, 18), integer_fields(3, 7)))
def test_each_plane_halves_the_interval(case):
    """C2-geometry: with p bits missing, an estimate is within (2**p - 1) / 2 of a vertex's value."""
    field, isovalue = case
    decoder = Decoder()
    decoder.feed(b"".join(encoder_of(field, isovalue, precision="exact")))
    for event in decoder:
        if not isinstance(event, LayerComplete) or event.layer.kind not in GEOMETRY:
            continue
        leaves = leaves_of(decoder.grid._tube, isovalue)
        error = np.abs(leaves.value - field[tuple(leaves.position.T)])
        ends = crossing_ends(field > isovalue)
        for e, p in zip(error, map(tuple, leaves.position.tolist()), strict=True):
            # NaN says that nothing is known yet: the side's bits are fewer than the other's.
            assert p not in ends or np.isnan(e) or e <= (2.0**event.layer.plane - 1) / 2


@examples(80)
@given(st.one_of(integer_fields(2, 18), integer_fields(3, 7)))
def test_offsets_close_in(case):
    """In P parts a crossing is within 1 / (2 P) of a cell of linear interpolation's, and never moves away from it."""
    field, isovalue = case
    decoder = Decoder()
    plan = grid_plan(field.ndim, field.ndim * cube_exponent(field.shape), None)
    decoder.feed(b"".join(encoder_of(field, isovalue, layers=plan + [("offsets", 3), ("offsets", 11)])))
    expected_low, expected_axis = crossing_edges(field > isovalue)
    expected = {(*p, a) for p, a in zip(map(tuple, expected_low.tolist()), expected_axis.tolist(), strict=True)}
    last = np.full(len(expected), 0.5)
    parts = 1
    for event in decoder:
        if not isinstance(event, LayerComplete) or event.layer.kind not in GEOMETRY:
            continue
        assert event.layer.parts > parts
        parts = event.layer.parts
        leaves = leaves_of(decoder.grid._tube, isovalue)
        low, high = leaves.position[leaves.edges[:, 0]], leaves.position[leaves.edges[:, 1]]
        axis = np.argmax(low != high, axis=1)
        named = [(*p, a) for p, a in zip(map(tuple, low.tolist()), axis.tolist(), strict=True)]
        assert len(named) == len(expected) and set(named) == expected
        assert (np.abs(high - low).sum(axis=1) == 1).all()
        f0, f1 = field[tuple(low.T)].astype(float), field[tuple(high.T)].astype(float)
        error = np.abs(leaves.edge_offset - (isovalue - f0) / (f1 - f0))
        # the encoder's crossings are fractions of 30 bits
        assert error.max(initial=0) <= 0.5 / parts + 2.0**-30
        assert (error <= last + 2.0**-30).all()
        last = error
    assert parts == 33


# --- stopping anywhere ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(21, 14), (6, 8, 7)])
def test_mesh_at_any_moment_is_part_of_the_final_one(shape):
    """Whatever symbol a layer stops at: known signs are right, and no leaf is listed twice."""
    above = blobs(shape, 3) ^ (np.random.default_rng(3).random(shape) < 0.02)
    data = b"".join(encoder_of(above, 0.5, precision="signs", layers=2))
    decoder = Decoder()
    for i in range(len(data)):
        decoder.feed(data[i : i + 1])
        layers = sum(isinstance(event, LayerComplete) for event in decoder)
        assert layers >= 0
        if decoder.contents is None or decoder.grid._tube is None:
            continue
        leaves = leaves_of(decoder.grid._tube)
        assert np.array_equal(leaves.above, above[tuple(leaves.position.T)])
        assert max(as_counter(leaves.position[leaves.simplices]).values(), default=1) == 1
        signs = leaves.above[leaves.simplices]
        assert (signs.any(axis=1) & ~signs.all(axis=1)).all()
    assert decoder.complete


@pytest.mark.filterwarnings("error")
def test_values_beyond_floats_are_infinite():
    number, above = np.array([3.0, 3.0]), np.array([True, False])
    assert interval_value(1.0, 1e308, number, above).tolist() == [np.inf, -np.inf]
