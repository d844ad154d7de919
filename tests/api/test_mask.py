"""Which samples lie above: what comes back is what was encoded, in all formats, or it is said that it cannot."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from commands import HILLS, run
from isocodec import Decoder, Limits
from isocodec.drawing import sample_mask as masks
from isocodec.drawing.sample_mask import MaskRows
from isocodec.errors import LimitError, OptionError, TruncatedError
from libraries import Late

nibabel = Late("nibabel")

SHAPES = st.one_of(st.tuples(*[st.integers(2, 20)] * 2), st.tuples(*[st.integers(2, 7)] * 3))
WAYS = (
    {"precision": "signs"}, {"precision": "exact"}, {}, {"precision": "signs", "profile": "baseline"}, {"layers": 0},
)


@given(SHAPES, st.integers(0, 2**32 - 1), st.sampled_from(WAYS), st.integers(-1, 6))
@examples(60)
def test_any_mask_comes_back(shape, seed, way, isovalue):
    """Noise, and what is all above or all below."""
    field = np.random.default_rng(seed).integers(0, 6, shape)
    data = isocodec.encode(field, isovalue + 0.5, **way)
    mask = isocodec.open(data).above()
    assert mask.dtype == np.bool_ and np.array_equal(mask, field > isovalue + 0.5)


@given(SHAPES, st.integers(0, 2**32 - 1))
@examples(30)
def test_out_of_the_ends_of_crossed_edges_alone(shape, seed):
    """Known are the corner and the samples next to others of another sign; brute force finds these."""
    rng = np.random.default_rng(seed)
    above = rng.random(shape) < rng.random() * 0.3
    known = np.zeros(shape, bool)
    known[(0,) * len(shape)] = True
    for axis in range(above.ndim):
        low, high = (np.moveaxis(known, axis, 0)[part] for part in (slice(None, -1), slice(1, None)))
        differ = np.diff(np.moveaxis(above, axis, 0).astype(np.int8), axis=0) != 0
        low |= differ
        high |= differ
    position = np.argwhere(known)
    for block in (1, 30, masks.BLOCK):
        with mock.patch.object(masks, "BLOCK", block):
            rows = list(MaskRows(shape, position, above[known]))
            turned = list(MaskRows(shape[::-1], position[:, ::-1], above[known]))
        assert len(rows) > 1 or block > 1
        assert np.array_equal(np.concatenate(rows), above)
        assert np.array_equal(np.concatenate(turned), above.T)


def test_prefixes_tell_it_as_soon_as_the_signs_are_there():
    data = isocodec.encode(HILLS, 100.5, precision="exact")
    signs = len(isocodec.encode(HILLS, 100.5, precision="signs"))
    told = []
    for length in range(40, len(data), 7):
        try:
            mask = isocodec.open(data).above(max_bytes=length)
        except TruncatedError as error:
            assert error.code == "truncated" and not told
        else:
            told.append(length)
            assert np.array_equal(mask, HILLS > 100.5)
    assert signs < told[0] + 10 and told[0] < signs + 20


def test_coarse_meshes_do_not_tell():
    for options in ({"precision": 1}, {"layers": "level=6"}):
        with pytest.raises(OptionError, match="coarser") as caught:
            isocodec.open(isocodec.encode(HILLS, 100.5, **options)).above()
        assert caught.value.code == "mask"
    with pytest.raises(TruncatedError):
        Decoder().grid.above()


def test_damage_behind_the_isovalue_changes_nothing(tmp_path: Path) -> None:
    """What another isovalue's layers look like is no matter: placement and warnings come from what was decoded."""
    placement = np.array([[2.0, 0, 5], [0, 3.0, 6]])
    data = bytearray(
        isocodec.encode(
            isocodec.Field(HILLS, placement=placement), [100.5, 60.5], precision="signs", order="independent"
        )
    )
    chunk = isocodec.open(bytes(data)).info.chunks[-1]
    data[chunk.offset + 2] ^= 0xFF  # its layer program
    data[-4:] = zlib.crc32(data[:-4]).to_bytes(4, "big")
    with pytest.raises(isocodec.errors.FormatError):
        assert isocodec.open(bytes(data)).info
    (tmp_path / "in.iso").write_bytes(data)
    result = run("decode", "--what", "above", tmp_path / "in.iso", "-o", tmp_path / "m.npy", "--json")
    assert result.exit_code == 0 and "choose another with --isovalue: 60.5" in result.stderr
    assert json.loads(result.stdout)["isovalue"] == 100.5


def test_samples_are_limited():
    data = isocodec.encode(HILLS, 100.5)
    isocodec.open(data, limits=Limits(samples=HILLS.size)).above()
    with pytest.raises(LimitError) as caught:
        isocodec.open(data, limits=Limits(samples=HILLS.size - 1)).above()
    assert caught.value.code == "limit-samples"
