"""Axes of NRRD that are not in space: lists, times, colours, layers of segments."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK

import isocodec
from commands import fails, ok
from isocodec.errors import InputError

VOLUME = (np.arange(3 * 4 * 5) * 7 % 101).reshape(3, 4, 5).astype("<i2")
"""Axes k, j, i, as they are stored."""
PLACED = [[-0.5, 0, 0, -10], [0, -0.75, 0, -20], [0, 0, 2, 30]]


def nrrd(
    path: Path, kind: str | None, count: int, *, first: bool = True, encoding: str = "raw", detached: bool = False,
    placed: bool = True, more: str = "", samples: Any = None,
) -> Path:
    """Write volumes with an axis of a kind, before the others or behind them."""
    every = np.stack([VOLUME + n for n in range(count)], -1 if first else 0) if samples is None else samples
    sizes, directions = ["5", "4", "3"], ["(0.5,0,0)", "(0,0.75,0)", "(0,0,2)"]
    kinds = ["domain"] * 3
    for listed, value in ((sizes, str(count)), (directions, "none"), (kinds, kind)):
        if count:
            listed.insert(0 if first else 3, value)
    type_of = {"int16": "short", "uint8": "unsigned char"}[str(every.dtype)]
    lines = ["NRRD0005", f"type: {type_of}", f"dimension: {len(sizes)}", f"sizes: {' '.join(sizes)}"]
    if placed:
        lines += ["space: left-posterior-superior", f"space directions: {' '.join(directions)}",
                  "space origin: (10,20,30)"]
    if kind is not None:
        lines += [f"kinds: {' '.join(kinds)}"]
    lines += [f"encoding: {encoding}", "endian: little"]
    data = gzip.compress(every.tobytes()) if encoding == "gzip" else every.tobytes()
    if detached:
        (path.parent / "data.bin").write_bytes(data)
        lines += ["data file: data.bin"]
        data = b""
    path.write_bytes("\n".join(lines).encode() + b"\n" + more.encode() + b"\n" + data)
    return path


STORED = [("raw", False), ("gzip", False), ("raw", True), ("gzip", True)]
KINDS = ("list", "time", "domain", "???", "none", None)
AXES = [(kind, first, *STORED[0]) for kind in KINDS for first in (True, False)]
AXES += [(kind, True, *each) for kind in KINDS[:2] for each in STORED[1:]]


@pytest.mark.parametrize(("kind", "first", "encoding", "detached"), AXES)
def test_an_axis_without_a_direction_counts_volumes(
    tmp_path: Path, kind: str | None, first: bool, encoding: str, detached: bool
) -> None:
    path = nrrd(tmp_path / "a.nhdr", kind, 3, first=first, encoding=encoding, detached=detached)
    for frame in (0, 2):
        found = isocodec.read(path, frame=frame)
        assert np.array_equal(found.values, VOLUME.T + frame)
        assert np.allclose(found.placement.matrix, PLACED)
    with pytest.raises(InputError, match="--frame 0 to 2"):
        isocodec.read(path)
    every = isocodec.read(path, frames=True)
    assert [each.values[0, 0, 0] for each in every.fields] == [0, 1, 2]
    assert np.allclose(every.fields[1].placement.matrix, PLACED)


@pytest.mark.parametrize("skip", [
    "byte skip: 4\n", "line skip: 2\n", "line skip: 1\nbyte skip: 2\n", "byte skip: -1\n",
])
@pytest.mark.parametrize("kind", ["list", "time"])
def test_samples_behind_others(tmp_path: Path, kind: str, skip: str) -> None:
    path = nrrd(tmp_path / "a.nrrd", kind, 2, more=skip)
    head, _, data = path.read_bytes().partition(b"\n\n")
    path.write_bytes(head + b"\n\n" + b"a\nb\n" + data)
    assert np.array_equal(isocodec.read(path, frame=1).values, VOLUME.T + 1)
    assert np.allclose(isocodec.read(path, frame=1).placement.matrix, PLACED)


@pytest.mark.parametrize("first", [True, False])
def test_time_without_a_space(tmp_path: Path, first: bool) -> None:
    path = nrrd(tmp_path / "a.nrrd", "time", 3, first=first, placed=False)
    assert np.array_equal(isocodec.read(path, frame=2).values, VOLUME.T + 2)


@pytest.mark.parametrize("kind", ["vector", "3-color", "3-vector", "RGB-color", "covariant-vector"])
@pytest.mark.parametrize("first", [True, False])
def test_components_are_channels(tmp_path: Path, kind: str, first: bool) -> None:
    path = nrrd(tmp_path / "a.nrrd", kind, 3, first=first)
    with pytest.raises(InputError, match="3 channels"):
        isocodec.read(path)
    for channel in range(3):
        found = isocodec.read(path, channel=channel)
        assert np.array_equal(found.values, VOLUME.T + channel)
        assert np.allclose(found.placement.matrix, PLACED)


def test_channels_of_metaimage(tmp_path: Path) -> None:
    image = SimpleITK.GetImageFromArray(np.stack([VOLUME, VOLUME * 2], -1), isVector=True)
    SimpleITK.WriteImage(image, tmp_path / "a.mha")
    assert np.array_equal(isocodec.read(tmp_path / "a.mha", channel=1).values, VOLUME.T * 2)


SEGMENTS = """Segment0_ID:=Segment_1
Segment0_Name:=liver
Segment0_LabelValue:=1
Segment0_Layer:=0
Segment1_ID:=Segment_2
Segment1_Name:=tumor
Segment1_LabelValue:=1
Segment1_Layer:=1
Segment2_ID:=Segment_3
Segment2_Name:=vessels
Segment2_LabelValue:=2
Segment2_Layer:=1
"""


def test_layers_of_segments(tmp_path: Path) -> None:
    layers = np.stack([VOLUME % 2, VOLUME % 3], -1).astype("u1")
    path = nrrd(tmp_path / "a.seg.nrrd", "list", 2, more=SEGMENTS, samples=layers)
    with pytest.raises(InputError, match="liver; tumor; vessels"):
        isocodec.read(path)
    for layer in (0, 1):
        assert np.array_equal(isocodec.read(path, frame=layer).values, layers[..., layer].T)
    for key, layer, label in (("liver", 0, 1), ("tumor", 1, 1), ("Segment_3", 1, 2)):
        found = isocodec.read(path, key=key)
        assert np.array_equal(found.values, np.where(label == layers[..., layer].T, label, 0))
        assert np.allclose(found.placement.matrix, PLACED)
    ok("encode", path, "--key", "vessels", "--label", 2, "-o", tmp_path / "a.iso")
    assert "liver; tumor" in fails(3, "encode", path, "--key", "spleen", "--label", 2, "-o", tmp_path / "a.iso")


def test_one_layer_of_segments(tmp_path: Path) -> None:
    more = "Segment0_ID:=a\nSegment0_Name:=liver\nSegment0_LabelValue:=2\nSegment0_Layer:=0\n"
    path = nrrd(tmp_path / "a.seg.nrrd", None, 0, more=more, samples=(VOLUME % 3).astype("u1"))
    assert np.array_equal(isocodec.read(path).values, VOLUME.T % 3)
    assert set(np.unique(isocodec.read(path, key="liver").values)) == {0, 2}
