"""Simplified lines: within the distance both ways, apart from one another, on the same side of each other."""


import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isocodec.api.tracing import Traced
from isocodec.drawing.simplifying import simplified
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.field.sampled import Field

SMOOTH = st.integers(0, 2**32 - 1)


def field(seed: int, shape: tuple[int, int] = (24, 30)) -> Field:
    noise = np.random.default_rng(seed).normal(size=(shape[0] // 3 + 2, shape[1] // 3 + 2))
    rough = np.kron(noise, np.ones((3, 3)))[: shape[0], : shape[1]]
    return Field(rough + 0.2 * np.random.default_rng(seed + 1).normal(size=shape))


def lines(contours):
    shapely = pytest.importorskip("shapely")
    return [shapely.LineString(contour.along(walk)) for contour in contours for walk in contour.walks]


@given(SMOOTH, st.sampled_from([0.1, 0.7, 2.0, 9.0]))
def test_lines_stay_near_apart_and_on_their_side(seed, distance):
    shapely = pytest.importorskip("shapely")
    before = [*Traced(field(seed), [-0.7, 0.0, 0.6])]
    made = simplified(before, distance)
    old, new = lines(before), lines(made.contours)
    assert len(old) == len(new) and made.after == sum(len(line.coords) for line in new)
    apart = [line for line in new if len(line.coords) > 1]
    assert shapely.is_simple(shapely.MultiLineString(apart)) or not shapely.is_simple(shapely.MultiLineString(old))
    for one, other in zip(old, new, strict=True):
        assert one.coords[0] == other.coords[0] and one.coords[-1] == other.coords[-1]
        assert {*other.coords} <= {*one.coords}
        assert shapely.hausdorff_distance(one, other, densify=0.05) <= distance * (1 + 1e-9)
    # each ring has the same lines within it
    rings = [at for at, line in enumerate(old) if line.is_ring]
    for at in rings:
        inner = [[shapely.Polygon(each[at]).contains(shapely.Point(line.coords[0])) for line in each]
                 for each in (old, new)]
        inner = [[found for number, found in enumerate(each) if number != at] for each in inner]
        assert inner[0] == inner[1]


def test_as_few_points_as_each_line_alone():
    shapely = pytest.importorskip("shapely")
    before = [*Traced(field(3, (200, 240)), [-1.0, -0.5, 0.0, 0.5, 1.0])]
    alone = shapely.simplify(lines(before), 0.5)
    assert simplified(before, 0.5).after <= 1.2 * shapely.get_num_coordinates(alone).sum()


def test_a_line_does_not_jump_over_a_peak_in_its_bend():
    values = np.zeros((9, 41))
    values[4:] = 10
    values[3, 15:26] = 10  # the line makes room
    values[3, 20] = 30
    before = [*Traced(Field(values), [5.0, 29.0])]
    (valley, peak) = simplified(before, 3.0).contours
    shapely = pytest.importorskip("shapely")
    side = shapely.geometry.shape(valley.areas())
    assert all(side.contains(shapely.Point(point[::-1])) for point in peak.points)


def test_on_the_ground_a_step_north_is_longer():
    place = Placement([[0, 1 / 1200, 7.0], [-1 / 1200, 0, 60.0]], crs="EPSG:4326")
    made = {}
    for axis in (0, 1):
        wave = 3 * np.sin(np.arange(60) / 3)
        rows = np.arange(60)[:, None] + wave[None] - 30.0
        values = rows if axis == 0 else rows.T
        before = [*Traced(Field(np.ascontiguousarray(values), placement=place), [0.0])]
        made[axis] = simplified(before, "40m")
    assert made[0].unit == "m" and 0 < made[0].farthest <= 40
    # cells are 93 m high and 46 m wide there: waves northwards are twice as large
    assert made[0].after > made[1].after


@pytest.mark.parametrize(("distance", "why"), [("0", "positive"), (-1, "positive"), ("near", "not a distance"),
                                              ("30m", "placement"), ("inf", "positive")])
def test_refused(distance, why):
    with pytest.raises(OptionError, match=why):
        simplified([*Traced(field(1), [0.0])], distance)
    with pytest.raises(OptionError, match="surfaces"):
        simplified([*Traced(Field(np.random.default_rng(0).normal(size=(5, 5, 5))), [0.0])], 1)
