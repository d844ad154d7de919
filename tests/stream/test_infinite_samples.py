"""Infinite samples: the crossing beside one is at the finite sample, as beside an ever larger one (spec 5.7.3(5))."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from drawings import as_set
from isocodec.errors import InputError
from isocodec.field.samples import check_field
from isocodec.search.original import original
from tables import looped

SQUARE = np.zeros((7, 7))
SQUARE[2:5, 2:5] = 1
CUBE = np.zeros((5, 5, 5))
CUBE[1:4, 1:4, 1:4] = 1


@looped("precision", [0.05, 1.0])
@looped("sign", [1.0, -1.0])
@looped("base", [SQUARE, CUBE], ids=["plane", "space"])
def test_as_beside_a_large_sample(base: np.ndarray, sign: float, precision: float) -> None:
    """The same bytes, whichever axis and direction leads to the infinite sample."""
    middle = tuple(size // 2 for size in base.shape)
    infinite, large = base.copy(), base.copy()
    infinite[middle], large[middle] = np.inf, 1e300
    files = [isocodec.encode(sign * each, sign * 1.5, precision=precision) for each in (infinite, large)]
    assert files[0] == files[1]
    points = isocodec.decode(files[0]).points
    assert np.allclose(sorted(points.tolist()), sorted((np.array(base.shape) - 1 - points).tolist()))


def test_beside_a_finite_sample_along_each_axis() -> None:
    field = SQUARE.copy()
    field[3, 3] = np.inf
    points = isocodec.decode(isocodec.encode(field, 1.5)).points
    assert as_set(points, 3) == as_set([[2.05, 3], [3, 2.05], [3, 3.95], [3.95, 3]], 3)


def test_between_two_infinite_samples_it_is_in_the_middle() -> None:
    field = np.full((4, 4), -np.inf)
    field[:, 2:] = np.inf
    points = isocodec.decode(isocodec.encode(field, 0.5)).points
    # the middle of the upper one of two parts
    assert np.allclose(points[:, 1], 1.55)


@looped("axis", range(3))
@looped("turned", [False, True], ids=["rising", "falling"])
@looped("above", [1.0, 1e300, np.inf])
@looped("below", [-1.0, -1e300, -np.inf])
def test_promises_are_measured_from_where_files_put_the_crossing(
    below: float, above: float, turned: bool, axis: int
) -> None:
    """The original curve runs where an exact file has it, whichever end of an edge is infinite."""
    values = np.array([below, below, above, above][:: -1 if turned else 1])
    field = np.moveaxis(np.broadcast_to(values, (3, 4, 4)), 2, axis).copy()
    samples = check_field(field, 0.0)
    low = np.full((1, 3), 1)
    high = low + np.eye(3, dtype=int)[axis]
    place = samples.between(low, high)
    expected = 1 + np.where(np.isnan(place), 0.5, place)
    assert np.allclose(original(samples).points[:, axis], expected)


def test_no_value_states_an_infinite_sample() -> None:
    field = SQUARE.copy()
    field[3, 3] = np.inf
    with pytest.raises(InputError, match="infinite"):
        isocodec.encode(field, 1.5, precision="step=0.5")
