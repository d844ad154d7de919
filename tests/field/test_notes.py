"""The notes of a file that place its samples, there and back."""

import numpy as np
import pytest

from isocodec.field.placement import Placement, read_placement


@pytest.mark.parametrize(("crs", "unit"), [(None, None), ("EPSG:32631", None), (None, "mm"), ("EPSG:4326", "degree")])
def test_there_and_back(crs, unit):
    matrix = [[0, 0.5, 10], [-0.25, 0, 20]]
    placed = Placement(matrix, crs=crs, unit=unit)
    found = read_placement(placed.notes(), 2)
    assert np.array_equal(found.matrix, matrix) and (found.crs, found.unit) == (crs, unit)
