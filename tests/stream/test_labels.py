"""Several labels in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from commands import BALL, HILLS, fails, ok, run
from isocodec.errors import InputError, OptionError
from libraries import Late
from places import matrix
from tables import looped

nibabel = Late("nibabel")

ZONES = np.digitize(HILLS, [20, 80, 140])
SHELLS = np.digitize(BALL, [40, 70])


@pytest.mark.parametrize("profile", ["main", "baseline"])
@examples(30)
@given(seed=st.integers(0, 1000), axes=st.integers(2, 3))
def test_labels_come_back(profile: str, seed: int, axes: int) -> None:
    """Whatever touches what; the border of each is that of its mask, encoded alone."""
    rng = np.random.default_rng(seed)
    field = rng.choice([0, 1, 2, 7, 300], (7, 6, 5)[:axes])
    labels = [int(label) for label in rng.permutation(np.unique(field))]
    data = isocodec.encode(isocodec.Field(field, labels=labels), profile=profile)
    file = isocodec.open(data)
    assert np.array_equal(file.labels(), field)
    assert file.info.metadata["labels"] == " ".join(map(str, labels))
    for contour, label in zip(file.contours(), labels, strict=True):
        alone = isocodec.decode(isocodec.encode(field == label, 0.5, precision="signs"))
        assert contour.isovalue == label
        assert np.array_equal(np.sort(file.contour(label).points, axis=0), np.sort(alone.points, axis=0))
        assert np.array_equal(file.above(label), field == label)


def test_types_and_what_is_left_out() -> None:
    assert isocodec.open(isocodec.encode(isocodec.Field(ZONES, labels=[1, 3]))).labels().dtype == ZONES.dtype
    assert np.array_equal(
        isocodec.open(isocodec.encode(isocodec.Field(ZONES, labels=[3, 1]))).labels(), np.where(ZONES == 2, 0, ZONES),
    )
    below = np.where(ZONES == 1, -300, ZONES)
    back = isocodec.open(isocodec.encode(isocodec.Field(below, labels=[-300, 2]))).labels()
    assert np.array_equal(back, np.where(ZONES == 3, 0, below))
    halves = ZONES / 2
    assert np.array_equal(
        isocodec.open(isocodec.encode(isocodec.Field(halves, labels=[0.5, 1.0, 1.5]))).labels(), halves,
    )


def test_holes_and_places() -> None:
    field = ZONES.astype(float)
    field[3:6, 4:9] = np.nan
    place = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])
    data = isocodec.encode(isocodec.Field(field, placement=place, crs="EPSG:32631", labels=[1, 2]))
    assert np.array_equal(isocodec.open(data).valid(), ~np.isnan(field))
    first = isocodec.decode(data)
    assert first.metadata["crs"] == "EPSG:32631" and np.array_equal(matrix(first), place)
    known = ~np.isnan(field)
    assert np.array_equal(isocodec.open(data).labels()[known], np.where(ZONES == 3, 0, ZONES)[known])


def test_refused() -> None:
    for labels, error, says in (
        ([1, 9], InputError, "the labels are 0, 1, 2, 3"), ([1, 1], OptionError, "twice"),
        ([], OptionError, "no labels"),
    ):
        with pytest.raises(error, match=says):
            isocodec.encode(isocodec.Field(ZONES, labels=labels))
    with pytest.raises(InputError):
        isocodec.encode(isocodec.Field(ZONES[0], labels=[1]))
    with pytest.raises(OptionError, match="not labels"):
        isocodec.open(isocodec.encode(HILLS, 80.5)).labels()
    data = isocodec.encode(isocodec.Field(ZONES, labels=[1, 2]))
    for other, error, says in (
        (isocodec.Field(ZONES[::-1], labels=[3]), InputError, "file 2 have another one"),
        (isocodec.Field(ZONES[1:], labels=[3]), InputError, "file 2 differs from the first in its shape"),
        (ZONES == 3, InputError, "labels and isovalues cannot be in one file"),
    ):
        with pytest.raises(error, match=says):
            isocodec.merge([data, isocodec.encode(other)])


@pytest.mark.parametrize(("labels", "more", "options"), [
    ([2, 1], [], {}), ([1, 2, 3], ["--profile", "baseline"], {"profile": "baseline"}),
    ([1, 2], ["--spacing", "2,3", "--metadata", "a=b"], {"metadata": {"a": "b"}}),
    ([1, 2], ["--precision", "0.5", "--keep-topology"], {"precision": 0.5, "keep_topology": True}),
])
def test_command(tmp_path: Path, labels: list[int], more: list[str], options: dict[str, Any]) -> None:
    source, out = tmp_path / "z.npy", tmp_path / "z.iso"
    np.save(source, ZONES)
    given = [word for label in labels for word in ("--label", label)]
    assert f"{len(labels)} labels" in ok("encode", source, "-o", out, *given, *more)
    placement = [2, 3] if "--spacing" in more else None
    assert out.read_bytes() == isocodec.encode(isocodec.Field(ZONES, placement=placement, labels=labels), **options)
    if "precision" in options:
        assert ok("verify", out, source)
    else:
        assert "0 wrong signs" in ok("verify", out, source)
        ok("decode", "--what", "above", out, "-o", tmp_path / "m.npy", "--isovalue", labels[-1])
        assert np.array_equal(np.load(tmp_path / "m.npy"), labels[-1] == ZONES)
        np.save(source, ZONES[::-1])
        assert run("verify", out, source).exit_code == 9


def test_command_refuses(tmp_path: Path) -> None:
    source, out = tmp_path / "z.npy", tmp_path / "z.iso"
    np.save(source, ZONES)
    encode = ("encode", source, "-o", out, "--label", 1, "--label", 2)
    for more in (
        ["--precision", "exact"], ["--missing", "below"], ["--interval", 1], ["--periodic", 0], ["--precision", "2,1"],
    ):
        assert "label" in fails(2, *encode, *more)
    assert "the labels are 0, 1, 2, 3" in fails(3, *encode, "--label", 9)
    assert not out.exists()


AFFINE = np.array([[-2.0, 0, 0, 10], [0, 1.5, 0.25, -4], [0, -0.1, 3, 7], [0, 0, 0, 1]])


@looped("suffix", [".nii", ".nii.gz", ".npy"])
@looped("labels", [(1, 2), (1, 300), (7, -3), (1, 70000), (0.5, 2)])
def test_all_labels_and_back(tmp_path: Path, labels: tuple[float, float], suffix: str) -> None:
    """Into one file, and out into one volume with its affine."""
    values = np.select([SHELLS == 1, SHELLS == 2], labels)
    dtype = np.result_type(*map(np.min_scalar_type, labels), np.uint8)
    source, made, out = tmp_path / "a.nii.gz", tmp_path / "a.iso", tmp_path / f"b{suffix}"
    nibabel.save(nibabel.Nifti1Image(values.astype("f4" if dtype.kind == "f" else dtype), AFFINE), source)
    assert "2 labels" in ok("encode", source, "--label", "all", "-o", made)
    found = isocodec.read(source)
    again = isocodec.Field(found.values, placement=found.placement, labels="all", missing="below")
    assert made.read_bytes() == isocodec.encode(again)
    ok("decode", made, "--what", "labels", "-o", out)
    if suffix == ".npy":
        assert np.array_equal(np.load(out), values)
        return
    image = nibabel.load(out)
    assert np.array_equal(np.asanyarray(image.dataobj), values)
    assert np.allclose(image.affine, AFFINE, atol=1e-5)
    assert image.header.get_slope_inter() in ((1, 0), (None, None))


def test_all_labels_of_a_series(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.stack([np.where(ZONES == 1, 0, ZONES), np.where(ZONES == 3, 1, ZONES)]))
    ok("encode", tmp_path / "a.npy", "--frames", "--label", "all", "-o", tmp_path / "a.iso")
    file = isocodec.open(tmp_path / "a.iso")
    assert file.isovalues == (1, 2, 3)
    assert np.array_equal(file.above(3, frame=0), ZONES == 3)
    assert not file.above(3, frame=1).any()


def test_values_that_only_come_close_are_no_label() -> None:
    for values in (ZONES + 0.2, ZONES + np.where(HILLS % 2, 0.01, 0.02)):
        with pytest.raises(InputError, match="no sample has the label 1"):
            isocodec.encode(isocodec.Field(values, labels=[1]))
