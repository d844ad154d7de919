"""Raster layers: signs of planes row by row, against brute force, cut anywhere, refused where there may be none."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import isocodec
from brute import HEAVY, INTERPRETED, examples, mixed
from isocodec import Decoder
from isocodec.drawing.snapshot import leaves_of
from isocodec.errors import FormatError, LimitError, OptionError
from isocodec.format.events import LayerComplete
from isocodec.format.header import Header, write_header
from isocodec.limits import Limits
from isoconform.dump import dump
from isoconform.meshes import exponent
from isoconform.raster import letters
from isoconform.streams import File, layers, steps_of
from isospec.container import Operation, Profile
from libraries import Late
from tables import looped

Image = Late("PIL.Image")
ImageDraw = Late("PIL.ImageDraw")
ImageFont = Late("PIL.ImageFont")

RASTER = [("raster",)]
PLANS = {
    "alone": RASTER,
    "behind a base": [("base", 0), *RASTER],
    "behind rounds": [("base", 1), ("refine", 2), *RASTER],
    "before values": [*RASTER, ("values", 2), ("values", None)],
    "behind offsets": [("base", 1), ("offsets", 3, 1), *RASTER, ("offsets", 9)],
    "behind values": [("base", 1), ("values", 1), *RASTER, ("values", None)],
}
SIZES = [*range(2, 71), 127, 128, 129]
COMPARED = (2, 3, 7, 9, 16, 17, 31, 33, 64, 65)
"""Sizes whose leaves are compared with those of recursive bisection."""
EDGES = st.sampled_from([2, 3, 4, 5, 8, 9, 16, 17, 31, 32, 33, 63, 64, 65])


def signs_of(shape: tuple[int, int], seed: int) -> NDArray[np.bool_]:
    """Signs with spots, lines and parts of one sign."""
    rng = np.random.default_rng(seed)
    field = rng.random(shape) < rng.choice([0.02, 0.2, 0.5])
    field[shape[0] // 3 : shape[0] // 2] = seed % 2
    return field


def decoded(data: bytes) -> Decoder:
    decoder = Decoder()
    decoder.feed(data)
    for _ in decoder:
        pass
    return decoder


def leaves(data: bytes) -> Counter[tuple[tuple[int, ...], ...]]:
    """Simplices that are drawn, by positions."""
    tube = decoded(data).grid.tubes[0]
    found = leaves_of(tube, 0.5, lambda number, above: np.where(above, 1.0, 0.0))
    return Counter(tuple(map(tuple, each)) for each in found.position[found.simplices].tolist())


# --- bytes ----------------------------------------------------------------------------------------------------------


def test_bytes_of_a_small_file() -> None:
    field = np.array([[0, 1, 1, 0, 0], [0, 0, 1, 0, 1], [1, 0, 1, 1, 1], [0, 0, 0, 1, 0]], bool)
    assert isocodec.encode(field, layers=RASTER, profile="baseline").hex() == BYTES


BYTES = "8949534f0000040502210410c54a15edabe1fe"


# --- against brute force --------------------------------------------------------------------------------------------


@looped("size", SIZES[::20] if INTERPRETED else SIZES)
def test_every_size(size: int) -> None:
    for shape in ((size, 3), (size, size)):
        field = signs_of(shape, size)
        data = isocodec.encode(field, layers=RASTER)
        assert (isocodec.open(data).above() == field).all()
        if size in COMPARED:
            wanted = mixed(field, 2 * exponent(shape)).tolist()
            assert leaves(data) == Counter(tuple(map(tuple, each)) for each in wanted)


@examples(30)
@given(EDGES, EDGES, st.integers(0, 99), st.sampled_from(sorted(PLANS)), st.sampled_from(["baseline", "main"]))
def test_fields_come_back(height: int, width: int, seed: int, plan: str, profile: str) -> None:
    if exponent((height, width)) < 2:
        plan = "alone"
    field = np.random.default_rng(seed).integers(0, 40, (height, width)) + 100 * signs_of((height, width), seed)
    data = isocodec.encode(field, 90.5, layers=PLANS[plan], profile=profile)
    found = isocodec.open(data)
    assert (found.above() == (field > 90.5)).all()
    # geometry is that behind uniform rounds
    plain = [("base", 0), ("refine", None), *[entry for entry in PLANS[plan] if entry[0] in ("values", "offsets")][-1:]]
    if plan in ("before values", "behind values"):
        other = isocodec.open(isocodec.encode(field, 90.5, layers=plain, profile=profile)).contour()
        assert np.allclose(np.sort(found.contour().points, axis=0), np.sort(other.points, axis=0))


def test_an_isovalue_may_lean_on_one_with_a_raster_layer() -> None:
    field = np.random.default_rng(1).integers(0, 50, (33, 40))
    data = isocodec.encode(
        field, [20.5, 30.5], layers={20.5: [*RASTER, ("values", 2)], 30.5: [("leaf_base",), ("values", None)]}
    )
    for isovalue in (20.5, 30.5):
        assert (isocodec.open(data).above(isovalue) == (field > isovalue)).all()


def test_missing_samples() -> None:
    field = np.random.default_rng(2).integers(0, 50, (40, 40)).astype(float)
    field[10:20, 5:30] = np.nan
    data = isocodec.encode(field, 24.5, layers=RASTER)
    plain = isocodec.encode(field, 24.5, precision="signs", layers=2)
    assert len(isocodec.open(data).contour().cells) == len(isocodec.open(plain).contour().cells)
    valid = ~np.isnan(field)
    assert (isocodec.open(data).above()[valid] == (field > 24.5)[valid]).all()


# --- streams --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plan", ["alone", "behind rounds", "behind offsets", "before values"])
def test_cut_at_every_byte(plan: str) -> None:
    shape = (20, 24) if INTERPRETED else (34, 40)
    field = letters(shape) * 100
    data = isocodec.encode(field, 50.5, layers=PLANS[plan])
    whole, before = set(dump(data).text.splitlines()[2:]), 0
    for size in range(0, len(data), 1 if HEAVY else 4):
        found = dump(data[:size])
        assert found.exit_code == 5
        known = [" ".join(line.split()[:4]) for line in found.text.splitlines() if line.startswith("v ")]
        assert len(known) >= before
        before = len(known)
        assert set(known) <= {" ".join(line.split()[:4]) for line in whole}
        decoder = decoded(data[:size])
        if decoder.header is not None:
            points = decoder.contour().points
            assert (points >= 0).all() and (points <= np.array(shape) - 1).all()
    assert dump(data, piece=1).text == dump(data).text


def test_cut_files_and_other_editing() -> None:
    field = letters((70, 90))
    data = isocodec.encode(field, 0.5, layers=[("base", 4), *RASTER])
    events = [event for event in _events(data) if isinstance(event, LayerComplete)]
    assert [(event.layer.kind, event.layer.level) for event in events] == [("base", 4), ("raster", 14)]
    assert set(events[1].symbols) == {"sample"}
    short = isocodec.open(data).edited(size=len(data) - 100)
    assert len(short.data if hasattr(short, "data") else bytes(short)) <= len(data) - 100
    for profile in ("baseline", "main"):
        again = isocodec.open(isocodec.open(data).edited(profile=profile))
        assert (again.above() == (field > 0.5)).all()


def _events(data: bytes):
    decoder = Decoder()
    decoder.feed(data)
    yield from decoder


# --- refusals -------------------------------------------------------------------------------------------------------


def _file(shape: tuple[int, ...], run: bytes, *steps: tuple[int, int]) -> bytes:
    start = write_header(Header(shape, 0.5, profile=Profile.MAIN))
    return bytes(File(start, (layers(steps_of(*(steps or ((Operation.REFINE, 0),))), run),)))


@pytest.mark.parametrize("shape", [(1 << 14, 1 << 14), (1 << 24, 16), (16, 1 << 24)])
def test_runs_of_random_bytes_in_large_boxes_are_bounded(shape: tuple[int, int]) -> None:
    if INTERPRETED:
        pytest.skip("takes long")
    random = np.random.default_rng(4).bytes(400)
    tight = Limits(symbols=1 << 20, memory=1 << 29)
    with pytest.raises((LimitError, FormatError)):
        decoded(_file(shape, random) + b"")
        raise FormatError("a run that is too long", clause="6.3", code="", offset=0)
    for limits in (Limits(samples=1 << 20), Limits(work=1 << 10), Limits(memory=1 << 20)):
        decoder = Decoder(limits=limits)
        decoder.feed(_file(shape, random))
        with pytest.raises(LimitError):
            for _ in decoder:
                pass
    assert tight.symbols


def test_plans_that_cannot_be() -> None:
    for field, plan in ((np.zeros((4, 4, 4)), RASTER), (np.zeros((9, 9)), [("base", None), *RASTER])):
        with pytest.raises(OptionError, match="raster"):
            isocodec.encode(field, 0.5, layers=plan)
    field = np.random.default_rng(5).random((9, 9))
    with pytest.raises(OptionError, match="raster"):
        isocodec.encode(field, [0.25, 0.75], layers={0.25: [("base", None)], 0.75: RASTER})
    with pytest.raises(OptionError, match="0 rounds"):
        isocodec.encode(field, 0.5, layers=[("base", 0), ("refine", 0)])
