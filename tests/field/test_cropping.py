"""A box of coordinates keeps the samples in it, those on its border too; by the coordinates of every sample."""

import numpy as np
import pytest

from isocodec.errors import OptionError
from isocodec.field.cropping import cropped
from isocodec.field.placement import Placement
from isocodec.field.sampled import Field

SHAPE = (7, 9)
MATRICES = {
    "upwards": [[0, 2, 10], [2, 0, 20]], "downwards": [[0, 2, 10], [-2, 0, 34]], "turned": [[2, 0, 10], [0, 2, 20]],
}
BOXES = [(12, 22, 18, 30), (12.5, 22.5, 17.5, 29.5), (10, 20, 26, 32), (16, 26, 16, 26), (-99, 24, 99, 25.9)]


@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize("box", BOXES)
def test_samples_within(name, box):
    field = Field(np.arange(63).reshape(SHAPE), placement=Placement(MATRICES[name]))
    rows, columns = np.indices(SHAPE)
    x, y = field.placement.place(np.stack([rows.ravel(), columns.ravel()], axis=1).astype(float)).T
    inside = (x >= box[0]) & (y >= box[1]) & (x <= box[2]) & (y <= box[3])
    if not inside.any():
        with pytest.raises(OptionError, match="no samples"):
            cropped(field, box)
        return
    part = cropped(field, box)
    assert sorted(part.values.ravel()) == sorted(field.values.ravel()[inside])
    places = np.stack([*map(np.ravel, np.indices(part.shape))], axis=1).astype(float)
    kept = {tuple(place) for place in part.placement.place(places).round(9).tolist()}
    assert kept == {(a, b) for a, b in zip(x[inside].round(9).tolist(), y[inside].round(9).tolist(), strict=True)}
