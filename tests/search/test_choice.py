"""Choice of meshes for a tolerance: squares and cubes with slack, windows that stand for a field."""

import numpy as np

import isocodec
from isocodec.field.samples import check_field
from isocodec.search.cubes import cubed, exponents, parts_of
from isocodec.search.promise import Promise
from isocodec.search.strategy import even_start
from isocodec.search.tolerance import parts_on
from isocodec.search.windows import ENOUGH, windows
from tables import looped


def waves(side, wavelength, n=2):
    """A field whose curves bend everywhere alike."""
    return sum(np.sin(2 * np.pi * axis / wavelength) for axis in np.indices((side,) * n)) * 100


@looped(
    ("n", "tolerance", "exponent"), [(2, 1.0, 1), (2, 0.3, 2), (2, 2.0, 3), (3, 1.0, 1), (3, 0.5, 1)]
)
def test_cubes_keep_a_promise(n, tolerance, exponent):
    promise = Promise(check_field(waves(25, 14.3, n), 20.0))
    start, lead = even_start(promise, exponent)
    kept = cubed(promise, promise.reduction(start), tolerance, exponent, lead)
    assert kept is not None
    size, contour = promise.trial(kept.plan)
    assert size == kept.size
    assert not len(promise.excess(contour, tolerance))
    # the mesh is found within as many bytes, and in one byte less it is given up
    assert cubed(promise, promise.reduction(start), tolerance, exponent, lead, size) is not None
    assert cubed(promise, promise.reduction(start), tolerance, exponent, lead, size - 1) is None


def test_parts_of_cubes_suffice():
    for tolerance in (0.1, 0.25, 1.0, 3.7):
        for exponent in exponents(tolerance, 6):
            assert (1 << exponent) / parts_of(tolerance, exponent) <= 2 * tolerance * (1 + 1e-5)


def test_parts_on_edges():
    assert [parts_on(length, 1, 1) for length in (1, 2, 4, 8)] == [1, 1, 3, 5]
    assert [parts_on(length, 3, 3) for length in (1, 2, 4, 8)] == [1, 1, 3, 3]


def test_windows_are_parts_of_the_field():
    field = waves(700, 40.0)
    promise = Promise(check_field(field, 20.0))
    found = windows(promise, 1.0)
    crossings = sum(len(each.crossing_points) for each in found)
    assert ENOUGH[2][1] <= crossings < len(promise.crossing_points) / 2
    assert all(len(each.crossing_points) for each in found)
    assert windows(Promise(check_field(field[:200, :200], 20.0)), 1.0) == []


def test_windows_of_a_field_with_missing_samples():
    field = waves(700, 40.0)
    field[::50, 100:500] = np.nan
    (verified,) = isocodec.open(isocodec.encode(field, 20.0, precision=1)).verify(field)
    assert verified.kept
    assert verified.there <= 1.01
