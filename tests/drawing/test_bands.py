"""Areas between isovalues: they make up the box, and samples lie in the band of their value; shapely says where."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import isocodec
from commands import HILLS
from files import picture
from libraries import Late

shapely = Late("shapely")

VALUES = [60.5, 100.5, 20.5, 140.5]


def shapes(found: list[isocodec.Band]) -> list[shapely.Geometry]:
    return [shapely.geometry.shape(band.geometry) for band in found]


@pytest.mark.parametrize("options", [{"precision": "exact"}, {}, {"precision": "signs"}])
def test_bands(options: dict[str, bool]) -> None:
    for field, values in ((HILLS, VALUES), (picture((25, 31), 5, noise=0.4), [-20.5, 0.5, 10.5])):
        found = isocodec.bands(isocodec.open(isocodec.encode(field, values, **options)).contours())
        rising = sorted(values)
        assert [(band.lower, band.upper) for band in found] == list(zip([None, *rising], [*rising, None], strict=True))
        parts = shapes(found)
        assert all(part.is_valid for part in parts)
        rows, columns = field.shape
        assert sum(part.area for part in parts) == pytest.approx((rows - 1) * (columns - 1), rel=1e-12)
        for one, other in pairwise(parts):
            assert one.intersection(other).area < 1e-9
        y, x = np.mgrid[1 : rows - 1, 1 : columns - 1].reshape(2, -1)
        of = np.searchsorted(rising, field[y, x])
        for number, part in enumerate(parts):
            inside = shapely.intersects_xy(part, x[of == number], y[of == number])
            assert inside.all()


def test_of_one_and_with_holes() -> None:
    field = HILLS.astype(float)
    field[10:13, 8:15] = np.nan
    data = isocodec.encode(field, [60.25, 100.25])
    contours = [isocodec.decode(data, isovalue=value, through_holes=True) for value in (60.25, 100.25)]
    parts = shapes(isocodec.bands(contours, valid=isocodec.open(data).valid()))
    assert sum(part.area for part in parts) == pytest.approx(32 * 40 - 4 * 8)
    assert len(isocodec.bands([isocodec.decode(isocodec.encode(HILLS, 80.5))])) == 2
    assert isocodec.bands([]) == []
