"""Mapped grids: points lie where the coordinates say, periodic axes have no seam (spec clauses 3.7.4, 9.9)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import grids
import isocodec
from isocodec import Decoder, Limits
from isocodec.entropy.run import Account
from isocodec.errors import InputError, LimitError, OptionError
from isocodec.field.coordinates import MOST_PERIOD
from isocodec.field.mapped import Coordinate
from isocodec.field.placement import Placement
from isocodec.format.coordinate_record import CoordinatesRecord, read_coordinates, write_coordinates
from isocodec.format.events import CoordinatesRead
from isocodec.grid.passes.node_run import NodeGrid, decode_run, encode_run
from libraries import Late
from places import on_nodes
from tables import looped

trimesh = Late("trimesh")

Array = grids.Array
UNWRAP = 360.0


def unwrapped(arrays: list[Array]) -> list[Array]:
    """Longitudes without jumps."""
    return [np.unwrap(np.unwrap(arrays[0], axis=0, period=UNWRAP), axis=1, period=UNWRAP), arrays[1]]


@looped("error", [0.005, 0.1])
@looped("grid", [grids.rotated_pole, grids.polar, grids.elliptic])
def test_points_lie_where_coordinates_say(grid: Callable[[], tuple[Array, list[Array]]], error: float) -> None:
    """Against scipy's interpolation of the coordinates that were given."""
    field, arrays = grid()
    turns = grid is grids.rotated_pole
    data = isocodec.encode(grids.placed(field, arrays, periods=UNWRAP if turns else None, error=error), 0.1)
    contour = isocodec.decode(data)
    places = contour.placed
    if turns:
        arrays = unwrapped(arrays)
        straight = grids.interpolated(arrays[0], contour.points)
        places = places + np.stack([np.rint((straight - places[:, 0]) / UNWRAP) * UNWRAP, 0 * straight], axis=1)
    assert 0 < grids.off(contour.points, places, arrays) <= error


def test_axes_of_uneven_steps() -> None:
    """One array for each axis, in the field's order."""
    field = grids.rotated_pole()[0]
    south, east = -np.geomspace(1, 30, 40), np.linspace(5, 80, 50) ** 2
    contour = isocodec.decode(isocodec.encode(grids.placed(field, [south, east]), 0.1))
    expected = [np.interp(contour.points[:, 1], range(50), east), np.interp(contour.points[:, 0], range(40), south)]
    cells = [np.diff(east).min(), np.abs(np.diff(south)).min()]
    assert (np.abs(contour.placed - np.stack(expected, axis=1)) <= 0.005 * np.array(cells)).all()
    # a mesh grid of them is the same to the last byte
    both = np.meshgrid(east, south)
    assert isocodec.encode(grids.placed(field, both), 0.1) == isocodec.encode(grids.placed(field, [south, east]), 0.1)


def test_pieces_and_truncation() -> None:
    field, arrays = grids.rotated_pole()
    data = isocodec.encode(grids.placed(field, arrays, periods=360), 0.1)
    decoder = Decoder()
    events = []
    for byte in data:
        decoder.feed(bytes([byte]))
        events += list(decoder)
    decoder.close()
    (event,) = [event for event in events if isinstance(event, CoordinatesRead)]
    whole = Decoder()
    whole.feed(data)
    assert [type(e) for e in events] == [type(e) for e in whole]
    assert np.array_equal(decoder.contour().placed, isocodec.decode(data).placed)
    early = Decoder()
    early.feed(data[: event.offset - 1])
    assert not on_nodes(early.take().contour())
    early.feed(data[event.offset - 1 : event.offset + 40])
    assert on_nodes(early.take().contour())
    short = isocodec.open(data).edited(size=event.offset + 60)
    assert on_nodes(isocodec.decode(short))


def test_holes_may_have_any_coordinates() -> None:
    """Where no whole cell is, coordinates are free: they may be missing, and cost next to nothing."""
    field, arrays = grids.rotated_pole(80, 100)
    plain = [a.copy() for a in arrays]
    rng = np.random.default_rng(5)
    field[20:60, 30:80] = np.nan
    sizes = []
    for kind in ("smooth", "noise", "nan"):
        here = [a.copy() for a in plain]
        for a in here:
            if kind != "smooth":
                a[21:59, 31:79] = np.nan if kind == "nan" else rng.uniform(-90, 90, (38, 48))
        data = isocodec.encode(grids.placed(field, here, periods=360), 0.1)
        contour = isocodec.decode(data)
        straight = unwrapped(plain)
        places = contour.placed
        around = np.rint((grids.interpolated(straight[0], contour.points) - places[:, 0]) / 360) * 360
        assert grids.off(contour.points, places + np.stack([around, 0 * around], axis=1), straight) <= 0.005
        sizes.append(next(each.bytes for each in isocodec.open(data).info.chunks if each.type == "coordinates"))
    assert max(sizes) < 4 * sizes[0]


@looped(("right", "up"), [(0.3, 0.1), (0.0, 0.2), (0.5, 0.5), (0.1, -0.5)])
@looped("missing", [False, True])
def test_cells_that_fold_are_left_out(right: float, up: float, missing: bool) -> None:
    """Ocean grids with the pole in a cell, on an edge, at a node: the rest is encoded and placed."""
    y, x = np.mgrid[:24, :24] - 11.5 - np.array([up, right])[:, None, None]
    field = np.sin(x / 3) * np.cos(y / 4) + 0.1 * x
    arrays = [np.degrees(np.arctan2(x, -y)), 90 - 3 * np.hypot(x, y)]
    if missing:
        field[:5, :5] = arrays[0][:4, :4] = np.nan
    placed = grids.placed(field, arrays, periods=360)
    with pytest.warns(UserWarning, match=r"cells that fold .*: [12]; they are left out, with [12] of their samples"):
        data = isocodec.encode(placed, 0.3)
    file = isocodec.open(data)
    gone = ~file.valid()
    assert 1 <= gone.sum() - np.isnan(field).sum() <= 2 and (np.hypot(x, y)[gone & ~np.isnan(field)] < 2).all()
    contour = isocodec.decode(data)
    close = np.hypot(*(contour.points.T - np.array([11.5 + up, 11.5 + right])[:, None])) < 3
    places, found = contour.placed[~close], contour.points[~close]
    back = np.stack([-np.cos(np.radians(places[:, 0])), np.sin(np.radians(places[:, 0]))], 1) * (90 - places[:, 1:]) / 3
    assert len(found) > 30 and np.abs(back + 11.5 + np.array([up, right]) - found).max() < 0.2
    with warnings.catch_warnings(action="ignore"):
        assert all(one.kept for one in file.verify(placed, within=0.05))


def folded() -> list[Array]:
    rng = np.random.default_rng(0)
    return [a + rng.uniform(-1, 1, a.shape) for a in grids.polar()[1]]


@pytest.mark.cover(1)
@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (lambda c: folded(), {}, "fold: the cell at sample"),
        (lambda c: c[:1], {}, "2 arrays"),
        (lambda c: [c[0].T, c[1]], {}, "shape (60, 24)"),
        (lambda c: [c[0].astype(str), c[1]], {}, "arrays of numbers"),
        (lambda c: [np.where(np.arange(24)[:, None] == 3, np.nan, c[0]), c[1]], {}, "x of sample (3, 0) is nan"),
        (lambda c: [np.arange(24.0), np.arange(59.0)], {}, "59 coordinates for axis 1"),
        (lambda c: [np.arange(24.0), np.arange(60.0) % 50], {}, "axis 1 neither increase nor decrease throughout: 49 "
                                                                "is"),
        (lambda c: [np.arange(24.0), np.where(np.arange(60) == 9, np.nan, np.arange(60.0))], {}, "(0, 9) is nan"),
        (lambda c: [np.arange(24.0), np.arange(60.0)], {"periodic": 1}, "give the period"),
        (lambda c: [np.zeros(24), np.arange(60.0)], {}, "axis 0 neither increase"),
        (lambda c: c, {"periodic": 2}, "axis 2 is periodic"),
        (lambda c: c, {"error": 1e-17}, "too many units"),
    ],
)
def test_coordinates_of_no_use(change: Any, options: dict[str, Any], words: str) -> None:
    field, arrays = grids.polar()
    with pytest.raises(InputError) as caught:
        isocodec.encode(grids.placed(field, change(arrays), **options), 0.05)
    assert words in str(caught.value)


@looped(
    "where",
    [
        {"matrix": np.eye(2, 3)}, {"error": 0}, {"error": 0.7}, {"error": "small"}, {"periodic": "x"},
        {"periodic": -1}, {"periodic": [1, 1]}, {"periodic": True}, {"periods": -360}, {"periods": [1, 2, 3]},
        {"periods": np.nan},
    ],
)
def test_placements_of_no_use(where: dict[str, Any]) -> None:
    field, arrays = grids.polar()
    with pytest.raises(OptionError):
        isocodec.encode(isocodec.Field(field, placement=Placement(coordinates=arrays, **where)), 0.05)


def test_options_without_coordinates() -> None:
    field = grids.polar()[0]
    for where in ({"periods": 360}, {"error": 0.01}):
        with pytest.raises(OptionError):
            Placement(**where)
    contour = isocodec.decode(isocodec.encode(grids.placed(field, periodic=1), 0.05))
    assert contour.placement is not None and contour.placement.periods == pytest.approx((60, 0))
    assert np.abs(contour.placed - contour.points[:, ::-1]).max() < 0.005


@pytest.mark.parametrize("options", [{}, {"precision": 0.5}, {"precision": "1,0.3", "keep_topology": True}])
def test_surfaces_close_across_the_seam(options: dict[str, Any]) -> None:
    """A pipe is one surface with the two ends of its axis."""
    field, arrays = grids.cylinder()
    contour = isocodec.decode(isocodec.encode(grids.placed(field, arrays, periodic=1), 0.0, **options))
    mesh = trimesh.Trimesh(contour.joined.placed, contour.joined.cells, process=False)
    assert mesh.body_count == 1 and mesh.euler_number == 0 and mesh.is_winding_consistent
    loops = mesh.outline().discrete
    assert len(loops) == 2


def test_tolerances_by_a_matrix() -> None:
    """Cells of a volume whose steps differ: the longest counts."""
    field = grids.polar()[0]
    turn = np.array([[0.6, 0.8, 1], [-0.8, 0.6, 2]]) * 2
    spacing = [[0, 1.5, 0], [3, 0, 0]]
    asked = ((spacing, "mm", "0.75mm", 0.25), (turn, "m", "1m", 0.5), (turn, "m", "100cm", 0.5))
    for matrix, unit, text, cells in asked:
        placed = isocodec.Field(field, placement=Placement(matrix, unit=unit))
        in_world, in_cells = (isocodec.open(isocodec.encode(placed, 0.05, precision=each)) for each in (text, cells))
        assert np.array_equal(in_world.contour().points, in_cells.contour().points)
        assert in_world.promise == f"within {text} ({cells:g} cells)"
    assert isocodec.encode(field, 0.05, precision="0.5") == isocodec.encode(field, 0.05, precision=0.5)
    for wrong in ("1m", "much", "1 2m", "m", ""):
        with pytest.raises(OptionError):
            isocodec.encode(field, 0.05, precision=wrong)


# -- the chunk ---------------------------------------------------------------------------------------------------------

RECORD = CoordinatesRecord((1,), (Coordinate((0, 1), 1.5, 0.25), Coordinate((1,), -3.0, 2.0, 180)), b"abcde")


def test_bytes() -> None:
    payload = write_coordinates(RECORD)
    assert payload.hex() == (
        "02" "03" "3ff8000000000000" "3fd0000000000000" "0a" "c008000000000000" "4000000000000000" "8134" "6162636465"
    )
    assert read_coordinates(payload, (5, 6)) == RECORD


@looped(
    ("at", "byte"), [(0, 4), (0, 128), (1, 0), (1, 4), (1, 16), (2, 0x7F), (10, 0xBF), (18, 0x0C), (35, 0x80)]
)
def test_a_chunk_that_is_none(at: int, byte: int) -> None:
    payload = bytearray(write_coordinates(RECORD))
    payload[at] = byte
    if at == 2:
        payload[3] = 0xF0
    assert read_coordinates(bytes(payload), (5, 6)) is None


def test_sizes_are_bounded_by_bytes() -> None:
    """A few bytes do not make a grid of the largest size; what may be made counts to the limit of memory."""
    payload = write_coordinates(RECORD)
    assert read_coordinates(payload, (1 << 24, 1 << 24)) is None
    assert read_coordinates(payload, (240, 300)) is not None and read_coordinates(payload, (400, 300)) is None
    field, arrays = grids.rotated_pole(150, 200)
    data = isocodec.encode(grids.placed(field, arrays, periods=360), 0.1)
    with pytest.raises(LimitError):
        isocodec.decode(data, limits=Limits(memory=400_000))
    assert all(read_coordinates(payload[:end], (5, 6)) is None for end in range(37))


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_values_come_back(data: st.DataObject) -> None:
    """Within half a quantum of those wanted, whatever they are; both ways give the same."""
    shape = tuple(data.draw(st.lists(st.integers(1, 9), min_size=1, max_size=3)))
    period = data.draw(st.sampled_from([0, 1, 7, 100, 4097, MOST_PERIOD - 1]))
    seed = data.draw(st.integers(0, 1000))
    reach = data.draw(st.sampled_from([1, 30, 10**6, 1 << 49]))
    rng = np.random.default_rng(seed)
    goal = rng.integers(-reach, reach, shape, endpoint=True)
    goal.flat[0] = 0
    free = rng.random(shape) < data.draw(st.sampled_from([0.0, 0.3]))
    grid = NodeGrid(shape, period)
    run, (values,) = encode_run([grid], [goal], [free])
    back = decode_run(run, [grid], Account())
    assert back is not None and np.array_equal(values, back[0])
    missed = values - goal
    if period:
        missed = (missed + period // 2) % period - period // 2
    assert np.abs(missed[~free]).max(initial=0) <= 8
    # bytes behind the end are refused; half of a run may by chance be that of other values, as any bytes may
    assert decode_run(run + bytes(5), [grid], Account()) is None
    half = decode_run(run[: len(run) // 2], [grid], Account())
    assert len(run) < 20 or half is None or not np.array_equal(half[0], values)


@settings(deadline=None, max_examples=60)
@given(st.binary(max_size=60), st.sampled_from([0, 5, 1000]))
def test_any_bytes(run: bytes, period: int) -> None:
    """Any bytes are values or none; never an error."""
    both = Coordinate((0, 1), 0.0, 1.0, period), Coordinate((1,), 0.0, 1.0)
    payload = write_coordinates(CoordinatesRecord((), both, run))
    record = read_coordinates(payload, (13, 11))
    assert record is not None
    decode_run(record.run, [NodeGrid(one.counts((13, 11)), one.period) for one in record.coordinates], Account())


@pytest.mark.parametrize("grid", [grids.rotated_pole, grids.polar, grids.cylinder])
def test_placements_before_and_behind_a_file(grid: Callable[[], tuple[Array, list[Array]]]) -> None:
    """What is given places points as what is decoded, the cell that closes an axis included."""
    field, arrays = grid()
    where = {"periods": 360} if grid is grids.rotated_pole else {"periodic": 1}
    given_ = Placement(coordinates=arrays, error=1e-5, **where)  # type: ignore[arg-type]
    contour = isocodec.decode(isocodec.encode(isocodec.Field(field, placement=given_), 0.05))
    assert contour.placement is not None
    missed = contour.placed - given_.place(contour.points)
    missed -= np.rint(missed / 360) * 360 if grid is grids.rotated_pole else 0
    assert np.abs(missed).max() < 1e-3
    assert given_.closes == contour.placement.closes and given_.mirrored() == contour.placement.mirrored()
    assert given_.grid == field.shape and contour.placement.grid == contour.shape
