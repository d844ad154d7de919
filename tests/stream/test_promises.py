"""Promises in a file: what it says of its layers is so, and what is no promise is passed over (spec clause 3.7.3)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples, smooth
from commands import BALL, HILLS
from isocodec import Decoder
from isocodec.errors import OptionError
from isocodec.field.samples import check_field
from isocodec.format.chunks import Promises, read_promises, write_promises
from isocodec.format.events import PromisesRead
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from tables import looped


@looped(
    ("promises", "payload"),
    [
        (Promises({}, False), "00"),
        (Promises({2: 4.0, 4: 1.0, 7: 0.25}, True), "01 02 9f20 02 8768 03 817a"),
        (Promises({300: 0.1}, False), "00 822c 64"),
        (Promises({1: 0.0001}, False), "00 01 01"),
        (Promises({1: 1 / 3}, False), "00 01 824e"),
    ],
)
def test_bytes(promises: Promises, payload: str) -> None:
    """Distances are rounded up."""
    data = bytes.fromhex(payload)
    assert write_promises(promises) == data
    found = read_promises(data)
    assert found is not None and found.topology == promises.topology and list(found.within) == list(promises.within)
    for layer, distance in promises.within.items():
        assert distance <= found.within[layer] < distance + 0.001


@given(st.dictionaries(st.integers(1, 4096), st.integers(1, 10**7)), st.booleans())
@examples(60)
def test_thousandths_come_back(parts: dict[int, int], topology: bool) -> None:
    promises = Promises({layer: d / 1000 for layer, d in parts.items()}, topology)
    assert read_promises(write_promises(promises)) == promises


@looped(
    "payload", ["", "02", "0001", "000005", "000100", "00018005", "000185", "ffff", "00" + "ff" * 10]
)
def test_what_is_no_promise(payload: str) -> None:
    assert read_promises(bytes.fromhex(payload)) is None


def test_each_isovalue_has_its_own() -> None:
    isovalues = [60.5, 100.5]
    data = isocodec.encode(HILLS, isovalues, precision=[3, 1])
    info = isocodec.open(data).info
    for number in (0, 1):
        kept = [layer.within for layer in info.layers if layer.isovalue == number]
        assert [within for within in kept if within] == [3, 1] and kept[-1] == 1
    decoder = Decoder()
    decoder.feed(data)
    read = [event.promises for event in decoder if isinstance(event, PromisesRead)]
    assert [list(promises.within.values()) for promises in read] == [[3, 1], [3, 1]]
    # an earlier end says the same of the layers that are left
    short = isocodec.open(isocodec.open(data).edited(layers=2)).info
    assert [layer.within for layer in short.layers] == [layer.within for layer in info.layers[:2]]


@pytest.mark.parametrize("options", [{}, {"keep_topology": True}, {"precision": "exact"}, {"precision": "signs"}])
def test_only_distances_are_written_down(options: dict[str, object]) -> None:
    """Layers themselves show that they are exact or all signs; the default is nobody's wish."""
    file = isocodec.open(isocodec.encode(HILLS, 80.5, **options))
    info = file.info
    assert not any(layer.within for layer in info.layers) and info.topology == [False]
    assert "promises" not in [chunk.type for chunk in info.chunks] and "promise" not in file.metadata


def test_one_step_is_a_tolerance() -> None:
    data, other = (isocodec.encode(BALL, 55.5, **options) for options in ({"precision": [1]}, {"precision": 1}))
    assert isocodec.open(data).info.layers[-1].within == 1 and data == other


@looped("promise", [(), (0.0,), (float("nan"),), ("1",), (1.0, 2.0), (1e300,)])
def test_promises_of_a_plan(promise: tuple[object, ...]) -> None:
    plan = [("base", 2), ("refine", None), ("offsets", 3)]
    data = isocodec.encode(HILLS, 80.5, layers=[*plan, ("promise", 0.5)])
    assert isocodec.open(data).info.layers[-1].within == 0.5
    with pytest.raises(OptionError, match="promise"):
        isocodec.encode(HILLS, 80.5, layers=[*plan, ("promise", *promise)])
    with pytest.raises(OptionError, match="promise"):
        isocodec.encode(HILLS, 80.5, layers=[("promise", 1.0), *plan])
    with pytest.raises(OptionError, match="promise"):
        isocodec.encode(HILLS, 80.5, layers=[("base", 2), ("values", None), ("promise", 1.0)])


# -- what is measured on what a decoder draws ------------------------------------------------------------------------


def measured(field: np.ndarray, isovalue: float, contour: isocodec.Contour) -> float:
    whole = original(check_field(field, isovalue))
    return max(hausdorff(whole.points, whole.cells, contour.points, contour.cells, 0.005))


def rough(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """A smooth field with specks."""
    noise = np.random.default_rng(seed).normal(size=shape)
    return smooth(shape, seed) + 0.12 * noise


def test_distortion_finer_than_offsets() -> None:
    field = rough((40, 41), 6)
    data = isocodec.encode(field, 0.0, layers="distortion=0.02")
    assert measured(field, 0.0, isocodec.decode(data)) <= 0.026
    with pytest.raises(OptionError, match="distortion"):
        isocodec.encode(field, 0.0, layers="distortion=0.02", precision="signs")


@pytest.mark.cover(1)
@pytest.mark.parametrize("topology", [False, True])
@pytest.mark.parametrize("shape", [(61, 52), (9, 11, 10)])
def test_each_step_is_kept_when_it_is_complete(shape: tuple[int, ...], topology: bool) -> None:
    field = rough(shape, 2)
    data = isocodec.encode(field, 0.0, precision=[4, 1, 0.3], keep_topology=topology)
    within = [layer.within for layer in isocodec.open(data).info.layers]
    assert [d for d in within if d] == [4, 1, 0.3]
    for number, distance in enumerate(within, 1):
        assert not distance or measured(field, 0.0, isocodec.decode(data, layers=number)) <= distance + 0.006
