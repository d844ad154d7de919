"""Several isovalues in one file: each decodes as by itself, what is known costs nothing, and curves never cross."""

from __future__ import annotations

import math
from contextlib import suppress
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import isocodec
from brute import blobs, examples, meshes, mixed, smooth
from files import fed
from isocodec import Decoder
from isocodec.drawing.snapshot import leaves_of, state_of
from isocodec.errors import FormatError, OptionError
from isocodec.field.samples import Samples
from isocodec.format.events import IsovalueRead
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.passes.runner import Tube
from isocodec.search import strategy
from isocodec.search.strategy import grid_plan
from isocodec.stream.encoder import encoder_of
from isocodec.stream.options import DEFAULT_TOLERANCE
from isoconform.meshes import chosen, uniform
from isoconform.streams import layers, split
from libraries import Late
from tables import looped

KDTree = Late("scipy.spatial.KDTree")


@st.composite
def cases(draw, n):
    """An integer field and two or three isovalues, some of them next to each other, some outside the data."""
    shape = tuple(draw(st.lists(st.integers(2, 14 if n == 2 else 7), min_size=n, max_size=n)))
    seed = draw(st.integers(0, 1 << 32))
    rng = np.random.default_rng(seed)
    field = smooth(shape, seed) * draw(st.sampled_from([3, 40])) + rng.normal(
        0, draw(st.sampled_from([0, 1, 5])), shape
    )
    field = np.rint(field + 5 * blobs(shape, seed)).astype(np.int64)
    values = draw(st.lists(st.integers(-30, 30), min_size=2, max_size=3, unique=True))
    return field, [v + draw(st.sampled_from([0, 0.5])) for v in sorted(values, key=lambda v: hash((v, seed)))]


def same(a, b, within=0.0):
    """The same points within a distance, and, where that is 0, the same cells, in any order: bases differ."""
    assert (len(a.points), len(a.cells)) == (len(b.points), len(b.cells))
    if within and len(a.points):
        for one, other in ((a, b), (b, a)):
            assert KDTree(one.points).query(other.points)[0].max() <= within
    elif len(a.points):
        cells = [np.sort(np.unique(c.points, axis=0, return_inverse=True)[1].ravel()[c.cells], axis=1) for c in (a, b)]
        assert np.array_equal(*(np.unique(c.points, axis=0) for c in (a, b)))
        assert np.array_equal(*(np.unique(c, axis=0) for c in cells))


@looped("n", [2, 3])
@looped(
    "wanted",
    [{"parts": 11}, {}, {"precision": "exact"}, {"precision": "signs"}, {"layers": 1}, {"order": "independent"}],
)
def test_each_decodes_as_by_itself(n, wanted):
    """To the last bit, or, where the encoder is free to tell crossings within a tolerance, within twice that."""
    within = 0 if "parts" in wanted or wanted.get("precision") in ("exact", "signs") else 2 * DEFAULT_TOLERANCE

    @examples(12)
    @given(cases(n))
    def run(case):
        field, isovalues = case
        full = n * cube_exponent(field.shape)
        if "layers" in wanted and full == 0:
            return
        options = dict(wanted)
        if "parts" in options:
            options["layers"] = [*grid_plan(n, full, None), ("offsets", options.pop("parts"))]
        encoder = encoder_of(field, isovalues, **options)
        data = b"".join(encoder)
        alone = {k: v for k, v in options.items() if k != "order"}
        for isovalue in isovalues:
            by_itself = isocodec.decode(isocodec.encode(field, isovalue, **alone))
            same(isocodec.decode(data, isovalue=isovalue), by_itself, within)
        decoder = fed(data)
        assert decoder.isovalues == isovalues
        for number, strand in enumerate(encoder.frame.strands):
            assert state_of(strand.tube).lines() == decoder.grid.state(number).lines()
            same(decoder.contour(number), isocodec.decode(data, isovalue=isovalues[number]))

    run()


@pytest.mark.parametrize("n", [2, 3])
def test_bases_from_the_leaves_of_another(n):
    """S3-close-by: on its mesh, uniform or adaptive, from its leaves; all mixed simplices of the mesh are found."""

    @examples(60)
    @given(cases(n), st.data())
    def run(case, data):
        field, isovalues = case
        isovalues = isovalues[:2]
        full = n * max(max(field.shape) - 2, 0).bit_length()
        level = data.draw(st.integers(0, full))
        plans = {v: [("leaf_base",), ("refine", None)] if i else [("base", level)] for i, v in enumerate(isovalues)}
        if level == full:
            plans = {v: plan[:1] for v, plan in plans.items()}
        decoder = fed(b"".join(encoder_of(field, isovalues, layers=plans)))
        for number, isovalue in enumerate(isovalues[1:], 1):
            leaves = leaves_of(decoder.grid.tubes[number], isovalue, lambda steps, above: steps)
            expected = mixed(field > isovalue, full)
            found = leaves.position[leaves.simplices]
            assert len(found) == len(expected)
            assert {x.tobytes() for x in found.astype(np.int64)} == {x.tobytes() for x in expected.astype(np.int64)}

    run()


@pytest.mark.parametrize("n", [2, 3])
def test_bijection(n):
    """Any bases and refinements, uniform and adaptive by turns, on any meshes, each isovalue with its own."""

    @settings(examples(150), deadline=None)
    @given(cases(n), st.data())
    def run(case, data):
        field, isovalues = case
        full = n * max(max(field.shape) - 2, 0).bit_length()
        plans = {}
        for v in isovalues:
            level = data.draw(st.integers(0, full))
            mesh = uniform(field.shape, level)
            plans[v] = [("base", level)]
            if level < full and data.draw(st.booleans()):
                mesh |= data.draw(meshes(field.shape, mesh))
                plans[v] = [("adaptive_base", level, chosen(field.shape, mesh))]
            for kind in data.draw(st.lists(st.sampled_from(["refine", "adapt"]), max_size=4)):
                if kind == "refine" and level < full:
                    rounds = data.draw(st.integers(1, full - level))
                    level += rounds
                    mesh |= uniform(field.shape, level)
                    plans[v].append((kind, rounds))
                elif kind == "adapt" and level < full:
                    mesh |= data.draw(meshes(field.shape, mesh))
                    plans[v].append((kind, 1, chosen(field.shape, mesh)))
        encoder = encoder_of(field, isovalues, layers=plans)
        decoder = fed(b"".join(encoder))
        for number, strand in enumerate(encoder.frame.strands):
            assert state_of(strand.tube).lines() == decoder.grid.state(number).lines()

    run()


def promise(field, isovalue):
    from isocodec.field.samples import check_field
    from isocodec.search.promise import Promise

    return Promise(check_field(field, isovalue))


def crossings(contour, n):
    """Places of a contour's points on the grid's edges, by lower end and axis."""
    out = {}
    for p in contour.points:
        low = np.floor(p)
        axis = int(np.argmax(p != low))
        if (p != low).sum() == 1:
            out[(*low.astype(int).tolist(), axis)] = p[axis]
    return out


@pytest.mark.parametrize("n", [2, 3])
def test_curves_never_cross(n):
    """On equal meshes, however few offsets are told: along each edge crossings come in the order of the isovalues."""

    @examples(60)
    @given(cases(n), st.sampled_from([3, 5, 11, None]))
    def run(case, radix):
        field, isovalues = case
        plan = None
        if radix is not None:
            plan = [*grid_plan(n, n * cube_exponent(field.shape), None), ("offsets", radix)]
        data = b"".join(encoder_of(field, isovalues, layers=plan))
        found = {v: crossings(isocodec.decode(data, isovalue=v), n) for v in isovalues}
        for low, high in zip(sorted(isovalues), sorted(isovalues)[1:], strict=False):
            for edge in found[low].keys() & found[high].keys():
                *start, axis = edge
                end = list(start)
                end[axis] += 1
                rising = field[tuple(end)] > field[tuple(start)]
                ahead = found[high][edge] - found[low][edge]
                assert ahead >= 0 if rising else ahead <= 0

    run()


@pytest.mark.parametrize(
    ("profile", "options"),
    [
        ("main", {"precision": 0.25}), ("baseline", {"precision": 1.0}), ("main", {"precision": [4, 1, 0.25]}),
        pytest.param("baseline", {"precision": 0.25}, marks=pytest.mark.heavy),
        pytest.param("main", {"precision": 1.0}, marks=pytest.mark.heavy),
        pytest.param("baseline", {"precision": [4, 1, 0.25]}, marks=pytest.mark.heavy),
    ],
)
def test_each_keeps_to_the_tolerance(options, profile):
    """Proven for what the file says, which for later isovalues is not what a file of their own would say."""
    tolerance = options["precision"] if isinstance(options["precision"], float) else options["precision"][-1]
    for shape, seed in (((18, 16), 1), ((7, 8, 7), 6)):
        field = np.rint(smooth(shape, seed) * 300).astype(np.int64)
        isovalues = [20.5, 25.5, 21.5]
        data = isocodec.encode(field, isovalues, profile=profile, **options)
        for isovalue in isovalues:
            contour = isocodec.decode(data, isovalue=isovalue)
            assert not len(promise(field, isovalue).excess(contour, tolerance))


def test_no_leaning_where_no_plan_would_keep_to_the_tolerance(monkeypatch):
    """Then the isovalue stands alone, and so does its promise."""
    found = strategy.smallest

    def never_leaning(promise, tolerance, topology, **options):
        if promise.fresh().lean is not None:
            raise strategy.NotKeptError("not kept")
        return found(promise, tolerance, topology, **options)

    monkeypatch.setattr(strategy, "smallest", never_leaning)
    # so far apart that neither is in the way of the other
    field = np.rint(smooth((30, 30), 1) * 100).astype(np.int64)
    data = isocodec.encode(field, [10.5, 42.5], precision=1.0)
    assert isocodec.open(data).info.leans == [None, None]
    assert not len(promise(field, 42.5).excess(isocodec.decode(data, isovalue=42.5), 1.0))


def test_events_and_skipping():
    field = np.rint(smooth((30, 30), 1) * 100).astype(np.int64)
    data = isocodec.encode(field, [0.5, 20.5, -20.5], order="isovalues")
    decoder = Decoder()
    decoder.feed(data)
    events = [e for e in decoder if isinstance(e, IsovalueRead)]
    assert [(e.number, e.isovalue, e.lean) for e in events] == [(1, 20.5, 0), (2, -20.5, 0)]
    info = isocodec.open(data).info
    assert info.isovalues == [0.5, 20.5, -20.5] and info.leans == [None, 0, 0] and info.chain(2) == {0, 2}
    some = fed(data, only={0, 2})
    same(some.contour(2), decoder.contour(2))
    assert some.grid.state(1) is None
    with pytest.raises(OptionError, match="predicted from isovalue 0"):
        other = fed(data, only={1})
    # those of a turn are decoded together
    assert isocodec.open(isocodec.encode(field, [0.5, 20.5, -20.5])).info.chain(2) == {0, 1, 2}
    free = isocodec.encode(field, [0.5, 20.5], order="independent")
    assert isocodec.open(free).info.leans == [None, None]
    other = fed(free, only={1})
    same(other.contour(1), decoder.contour(1), 2 * DEFAULT_TOLERANCE)


def test_numbers_that_many_isovalues_could_make_grow_no_further():
    """Isovalues far apart, each leaning on the one before: no number of a vertex gets beyond 2**53."""
    apart = (1 << 52) - 64
    isovalues = [-float(k * apart) for k in range(64)]
    field = np.full((5, 5), -(1 << 62), np.int64)
    field[2, 2] = 1 << 52

    def numbers(self, positions, above):
        """Like those of a field whose values are never far from an isovalue."""
        found = np.abs(self.values[tuple(positions.T)] - int(self.isovalue)) - above
        return np.where(above, np.clip(found, 0, (1 << 52) - 1), 0)

    plan = {v: [("base", None), ("values", None)] for v in isovalues}
    plan[isovalues[-1]] = [("base", None)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Samples, "numbers", numbers)
        patch.setattr(Tube, "value_bits", lambda self: (self.estimates.value_bits(self.state, self.full), (52, 0))[1])
        file = split(b"".join(encoder_of(field, isovalues, layers=plan)))
    # what is told of the last one takes 52 bits on both sides
    data = bytes(file.with_chunks(*file.chunks, layers(bytes([0x20 | 15, 0xFF, 52, 52]), bytes(4))))
    decoder = Decoder()
    decoder.feed(data)
    with suppress(FormatError):
        decoder.close()
    largest = [int(np.abs(decoder.grid.state(number).number).max()) for number in range(64)]
    assert max(largest) < 1 << 53 and sum(number > 1 << 51 for number in largest) > 3


def steps_of(field, isovalue, step):
    """Numbers of steps of all samples, by fractions (spec clause 2.3(3)), on the side that each is on."""
    exact = [(Fraction(float(v)) - Fraction(isovalue)) / Fraction(step) for v in field.ravel()]
    numbers = [math.ceil(x) - 1 if x > 0 else math.floor(-x) for x in exact]
    return np.array(numbers, np.int64).reshape(field.shape)


@pytest.mark.parametrize("n", [2, 3])
def test_values_of_floats_follow_exactly(n):
    """In every order, whole steps apart or not, near ties: signs and numbers are those of the samples."""

    @examples(60)
    @given(st.integers(0, 1 << 32), st.sampled_from([1.0, 0.1, 0.3, 0.07]), st.booleans(), st.booleans())
    def run(seed, step, single, whole):
        rng = np.random.default_rng(seed)
        shape = tuple(rng.integers(2, 16 if n == 2 else 8, n))
        isovalues = [10.1, *(10.1 + (rng.permutation(9)[:2] - 4) * (step if whole else 0.13)).tolist()]
        isovalues = list(dict.fromkeys(isovalues))
        field = 10.1 + 6 * smooth(shape, seed) * step + rng.normal(0, 2 * step, shape)
        some = rng.random(shape) < 0.4
        field[some] = 10.1 + rng.integers(-9, 9, shape)[some] * step
        field = field.astype(np.float32) if single else field
        for order in ("levels", "isovalues", "independent"):
            decoder = fed(isocodec.encode(field, isovalues, precision=f"step={step!r}", order=order))
            for number, isovalue in enumerate(isovalues):
                state = decoder.grid.state(number)
                at = tuple(state.position.T)
                assert np.array_equal(state.above, field[at] > np.float64(isovalue))
                known = state.missing == 0
                # of a curve that is nowhere no bits are sent
                if len(decoder.contour(number).points):
                    assert np.array_equal(state.number[known], steps_of(field, isovalue, step)[at][known])
                    assert np.count_nonzero(known)

    run()
