"""What stands around the kernels, where a planted fault had gone unnoticed: each test fails for one of them."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from io import BytesIO
from unittest import mock

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from commands import HILLS, fails, ok, run
from files import picture
from isocodec import Decoder, Limits
from isocodec.drawing import sample_mask as masks
from isocodec.errors import FormatError, InputError, LimitError
from isocodec.field.cropping import cropped
from isocodec.field.placement import Placement, matrix_of, write_placement
from isocodec.format.chunks import read_further, write_further
from isocodec.format.events import LayerComplete
from isocodec.grid.tube.capacity import at_rest, wider_state
from isocodec.limits import TIERS, Budget
from isocodec.storage.atomic import undo_all, undoing
from isocodec.storage.content import content
from isocodec.stream.encoder import encoder_of
from isocodec.stream.given import in_cells
from isocodec.stream.options import Precision
from isospec.container import SIGNATURE

TWO = isocodec.encode(picture((40, 40), 3), [0.5, 9.5])


# --- fields -----------------------------------------------------------------------------------------------------------


def test_samples_too_far_from_the_isovalue_are_refused():
    """Of 64 bits, where a difference would overflow."""
    field = np.full((9, 9), 5, np.uint64)
    field[3:6, 3:6] = 2**64 - 1
    with pytest.raises(InputError):
        isocodec.encode(field, 100, precision="exact")


def test_zero_has_no_sign_in_a_placement():
    assert write_placement(matrix_of([[1, -0.0, -0.0], [0, 1, 0]], 2)) == "1 0 0 0 1 0"


def test_hidden_samples_count_for_no_isovalue():
    field = isocodec.Field(HILLS, mask=HILLS > 150)
    for what in (field, isocodec.Frames([field, field])):
        assert isocodec.open(isocodec.encode(what, "every 40")).isovalues == (0, 40, 80, 120)


def test_coordinates_take_a_share_of_the_least_distance():
    placement = Placement(coordinates=[np.arange(33) * 10.0, np.arange(41) * 10.0], unit="m")
    for given, wanted in ((placement, 0.05 * 0.05), (replace(placement, error=0.02), 0.02)):
        precision = in_cells(Precision.of("0.5m"), given, {}, {}, (33, 41))
        assert precision.error == pytest.approx(wanted) and precision.tolerance == pytest.approx(0.05 - wanted)


@pytest.mark.parametrize("more", [0, 1, 3, 4, 5])
def test_the_first_bytes_count_towards_the_limit(more):
    data = SIGNATURE + b"x" * 6
    with pytest.raises(LimitError) if more else nullcontext():
        assert content(BytesIO(data), Limits(bytes=len(data) - more), (SIGNATURE,)) == data


def test_boxes_have_the_samples_on_their_border():
    values = np.arange(12.0).reshape(3, 4)
    nodes = [np.arange(3) * 10.0, np.arange(4) * 10.0]
    for placement in (Placement(coordinates=nodes), Placement([[10, 0, 0], [0, 10, 0]])):
        part = cropped(isocodec.Field(values, placement=placement), (10, 10, 20, 20))
        assert np.array_equal(part.values, values[1:3, 1:3]) and np.allclose(part.placement.place(np.zeros((1, 2))), 10)


def test_a_series_ends_with_a_layer_of_its_last_frame():
    data = isocodec.encode(isocodec.Frames([HILLS, HILLS // 2, HILLS // 3]), 50.5, precision="exact")
    file = isocodec.open(isocodec.open(data).edited(size=len(data) - 10))
    whole = isocodec.open(data)
    assert file.complete and len(file.info.frames) == 3 and 0 < len(whole.info.layers) - len(file.info.layers) < 5
    for frame in (0, 1):
        assert np.array_equal(file.contour(frame=frame).points, whole.contour(frame=frame).points)


# --- masks ------------------------------------------------------------------------------------------------------------


def test_rows_of_a_mask_go_on_where_those_before_ended():
    """Below the contour all samples of later blocks are unknown but for what the last one tells."""
    field = np.zeros((100, 64), np.uint8)
    field[5:] = 1
    data = isocodec.encode(field, 0.5, precision="signs")
    with mock.patch.object(masks, "BLOCK", 256):
        assert np.array_equal(isocodec.open(data).above(), field > 0)


# --- container and stream ---------------------------------------------------------------------------------------------


def test_bytes_behind_an_isovalue_are_an_error():
    with pytest.raises(FormatError) as caught:
        read_further(write_further(1, 7.5, None) + b"\0", 0, [1.0])
    assert caught.value.code == "isovalue"


def test_chunks_of_a_cut_file_end_with_it():
    for size in range(12, len(TWO)):
        info = isocodec.open(TWO[:size]).info
        assert all(chunk.offset + chunk.bytes <= size for chunk in info.chunks)


def test_a_file_as_long_as_is_asked_for_stays_as_it_is():
    assert isocodec.open(TWO).edited(size=len(TWO)) == TWO
    # with a checksum of its own and no need of one: not cut
    long = isocodec.encode(picture((40, 40), 3), 0.5, metadata={"note": "x" * 40})
    assert isocodec.open(long).edited(size=len(long)) == long


def test_the_smallest_step_is_a_tenth():
    data = isocodec.encode(picture((24, 24), 2), 0, precision=[1.0, 0.1])
    assert [layer.within for layer in isocodec.open(data).info.layers if layer.within] == [1.0, 0.1]


def test_progress_knows_the_isovalues_to_come():
    """The total is never less than what comes."""
    calls = []
    list(encoder_of(picture((40, 40), 3), [0.5, 5.5, 9.5], progress=lambda *both: calls.append(both)))
    assert calls[0][1] > calls[-1][1] // 2 and calls[-1][0] == calls[-1][1]


def test_trials_leave_the_isovalue_leaned_on_as_it_was():
    """What is tried for a tolerance uses no steps up."""
    encoder = encoder_of(picture((40, 40), 3), [0.5, 9.5], precision=0.5)
    decoder = Decoder()
    decoder.feed(b"".join(encoder))
    list(decoder)
    assert [strand.tube.steps for strand in encoder.frame.strands] == [tube.steps for tube in decoder.grid.tubes]


# --- meshes and drawings ----------------------------------------------------------------------------------------------


def test_curves_bend_either_way():
    """A field and its negative have the same curve, and so the same places where it bends."""
    field = picture((48, 48), 3).astype(np.float64)
    sizes = [
        len(isocodec.encode(way * field, way * 0.25, layers="curvature=0.15", precision="signs"))
        for way in (1, -1)
    ]
    assert 0.8 < sizes[0] / sizes[1] < 1.25


def test_points_in_the_middles_of_cells_are_smoothed_with_the_others():
    field = np.random.default_rng(3).integers(0, 2, (12, 12, 12))
    data = isocodec.encode(field, 0.5, precision="signs")
    plain, smooth = isocodec.decode(data).points, isocodec.decode(data, smooth=True).points
    middle = np.count_nonzero(plain % 1, axis=1) > 1
    assert middle.sum() > 5 and (np.abs(plain - smooth)[middle].max(axis=1) > 0).mean() > 0.9


# --- limits -----------------------------------------------------------------------------------------------------------


def test_tiers_leave_room_for_the_symbol_and_the_step_that_is_asked_for():
    for number, (_, _, symbols, steps, _) in TIERS.items():
        limits = Limits.tier(number)
        assert limits.symbols > symbols and limits.steps > steps


def test_vertices_of_the_mesh_count_before_they_are_known():
    decoder = Decoder()
    decoder.feed(TWO)
    list(decoder)
    tube = decoder.grid.tubes[0]
    tube.state.counters.room = 5000
    with pytest.raises(LimitError) as caught:
        wider_state(tube.state, tube._mark, False, Limits(vertices=4000), lambda *_: None)
    assert caught.value.code == "limit-vertices"


@pytest.mark.skipif(INTERPRETED, reason="takes long")
def test_what_rests_keeps_no_room_for_layers():
    """Not the board, not the crowd, and the account says so."""
    field = np.random.default_rng(2).integers(0, 9, (300, 300))
    decoder = Decoder()
    data = isocodec.encode(field, 4.5, layers=[("base", 2), ("refine", 12)])
    decoder.feed(data[:-1])  # a complete file rests
    list(decoder)
    tube = decoder.grid.tubes[0]
    rested = at_rest(tube.state)
    assert rested.board.pages.nbytes < tube.state.board.pages.nbytes and len(rested.below) == 0
    before = decoder.memory
    tube.rest()
    lists = [v for v in vars(tube.estimates).values() if isinstance(v, np.ndarray)]
    assert decoder.memory < before
    assert tube.estimates._budget._held[id(tube.estimates)] == sum(v.nbytes for v in lists)


@pytest.mark.skipif(INTERPRETED, reason="takes long")
def test_listing_values_is_counted_before_it_is_done():
    asked = []
    hold = Budget.hold

    def noted(budget, holder, size, passing=0):
        asked.append(passing)
        hold(budget, holder, size, passing)

    field = np.random.default_rng(2).integers(0, 9, (120, 120))
    data = isocodec.encode(field, 4.5, precision="exact", profile="baseline")
    with mock.patch.object(Budget, "hold", noted):
        decoder = Decoder()
        decoder.feed(data)
        list(decoder)
    assert max(asked) >= 64 * decoder.grid.tubes[0].vertices


def test_all_drawings_of_a_file_count_together():
    held = []
    hold = Decoder.hold
    with mock.patch.object(Decoder, "hold", lambda decoder, size: (held.append(size), hold(decoder, size))[0]):
        contours = isocodec.open(TWO).contours()
    assert held == [0, contours[0].points.nbytes + contours[0].cells.nbytes]


# --- inputs and outputs -----------------------------------------------------------------------------------------------


def test_what_cannot_be_undone_keeps_nothing_else_from_it():
    done = []

    def broken() -> None:
        done.append("broken")
        raise OSError("gone")

    with undoing(lambda: done.append("first")), undoing(broken):
        undo_all()
    assert done == ["broken", "first"]


# --- the command line -------------------------------------------------------------------------------------------------


def test_rounding_is_measured_along_the_finest_axis(tmp_path):
    placement = np.column_stack([np.diag([0.001, 0.001, 10]), [5e4, 5e4, 5e4]])
    field = np.indices((9, 9, 9)).sum(axis=0)
    (tmp_path / "in.iso").write_bytes(isocodec.encode(isocodec.Field(field, placement=placement), 12.5))
    result = run("decode", tmp_path / "in.iso", "-o", tmp_path / "a.ply")
    assert result.exit_code == 0 and "are rounded" in result.stderr


def test_memory_that_ends_anywhere_has_its_exit_code(tmp_path, monkeypatch):
    (tmp_path / "in.iso").write_bytes(TWO)

    def ends(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("isocodec.api.opening.open", ends)
    assert "not enough memory" in fails(6, "decode", tmp_path / "in.iso", "-o", tmp_path / "a.npz")


def test_only_whole_layers_count_as_kept(tmp_path):
    data = isocodec.encode(picture((60, 60), 3), 0.5, precision="exact")
    (tmp_path / "in.iso").write_bytes(data)
    for size in (len(data) // 3, len(data) // 2, 2 * len(data) // 3):
        record = json.loads(ok("edit", tmp_path / "in.iso", "-o", tmp_path / "out.iso", "--size", size, "--json"))
        decoder = Decoder()
        decoder.feed((tmp_path / "out.iso").read_bytes())
        whole = sum(isinstance(event, LayerComplete) for event in decoder)
        assert record["layers"] == whole < len(isocodec.open(data).info.layers)
