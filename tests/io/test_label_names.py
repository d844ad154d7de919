"""Names, colours and types of labels: from files of rasterio, SimpleITK and highdicom to all that shows them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import dicom_files as make
import numpy as np
import pytest

import isocodec
from commands import ok
from isocodec.errors import OptionError
from isocodec.field.labelling import about, colour_of, name_of, type_of
from libraries import Late
from tables import looped

geopandas, pydicom, rasterio, sitk, trimesh = map(Late, ("geopandas", "pydicom", "rasterio", "SimpleITK", "trimesh"))

VALUES = np.zeros((7, 6, 8), np.int16)
VALUES[1:4, 1:4, 1:5], VALUES[3:6, 2:5, 5:7] = 1, 3
NAMES, COLOURS = {1: "liver", 3: "left kidney"}, {1: "#dd8265", 3: "#b96651"}


def raster(path: Path) -> Path:
    """A palette, and categories as GDAL keeps them beside the file."""
    path = path / "a.tif"
    values = VALUES[3].astype(np.uint8)
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning), rasterio.open(
            path, "w", driver="GTiff", height=values.shape[0], width=values.shape[1], count=1, dtype="uint8") as file:
        file.write(values, 1)
        file.write_colormap(1, {label: (*bytes.fromhex(colour[1:]), 255) for label, colour in COLOURS.items()})
    names = "".join(f"<Category>{NAMES.get(label, '')}</Category>" for label in range(4))
    path.with_name("a.tif.aux.xml").write_text(
        f'<PAMDataset><PAMRasterBand band="1"><CategoryNames>{names}</CategoryNames></PAMRasterBand></PAMDataset>')
    return path


def slicer(path: Path) -> Path:
    """A segmentation of 3D Slicer."""
    image = sitk.GetImageFromArray(VALUES.T)
    for number, (label, name) in enumerate(NAMES.items()):
        colour = " ".join(f"{part / 255:.6f}" for part in bytes.fromhex(COLOURS[label][1:]))
        for key, text in (("ID", f"Segment_{label}"), ("Name", name), ("LabelValue", label), ("Layer", 0),
                          ("Color", colour)):
            image.SetMetaData(f"Segment{number}_{key}", str(text))
    sitk.WriteImage(image, str(path / "a.seg.nrrd"))
    return path / "a.seg.nrrd"


def segmentation(path: Path) -> Path:
    """A segmentation of DICOM, with colours in the space of Lab."""
    from highdicom.color import CIELabColor

    found = pydicom.dcmread(make.segmentation(path / "a.dcm", VALUES.astype(np.uint8)))
    for each in found.SegmentSequence:
        label = int(each.SegmentNumber)
        each.SegmentLabel = NAMES.get(label, "empty")
        each.RecommendedDisplayCIELabValue = list(CIELabColor.from_rgb(*bytes.fromhex(COLOURS.get(label, "#000000")[1:])
                                                                       ).value)
    found.save_as(path / "b.dcm")
    return path / "b.dcm"


@pytest.mark.parametrize("source", [raster, slicer, segmentation])
def test_names_and_colours_are_kept_and_shown(tmp_path: Path, source: Any) -> None:
    path, out = source(tmp_path), tmp_path / "a.iso"
    more = ["--band", 1] if source is raster else []
    ok("encode", path, "-o", out, "--label", "all", *more)
    file = isocodec.open(out)
    assert {label: name_of(label, file.metadata) for label in NAMES} == NAMES
    for label, colour in COLOURS.items():
        shown = np.array([*bytes.fromhex(str(colour_of(label, file.metadata))[1:])], int)
        assert abs(shown - [*bytes.fromhex(colour[1:])]).max() <= 1  # of Lab, rounded
    assert file.info.caption(3) == "label 3 (left kidney)" and "left kidney" in ok("info", out)
    assert not {"label 0", "colour 0", "label 2", "colour 2"} & {*file.metadata}
    assert file.labels().dtype == isocodec.read(path, **({"band": 1} if more else {})).values.dtype
    one = isocodec.open(file.edited(isovalues=[3]))
    assert name_of(3, one.metadata) == NAMES[3] and "label 1" not in one.metadata
    plain = isocodec.encode(isocodec.read(path, **({"band": 1} if more else {})), 0.5)
    assert not {"label 1", "colour 1", "dtype"} & {*isocodec.open(plain).metadata}
    if source is raster:
        for what in ("curve", "areas"):
            ok("decode", out, "-o", tmp_path / "a.gpkg", "--what", what)
            table = geopandas.read_file(tmp_path / "a.gpkg")
            assert {*zip(table["label"], table["name"], strict=True)} == {*NAMES.items()}
        ok("plot", out, "-o", tmp_path / "a.svg")
        ok("plot", out, "-o", tmp_path / "b.svg", "--map")
        for name in ("a.svg", "b.svg"):
            text = (tmp_path / name).read_text().lower()
            assert all(colour in text for colour in COLOURS.values())
        return
    ok("decode", out, "-o", tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb")
    shown = {name: "#" + bytes(mesh.visual.material.baseColorFactor[:3]).hex() for name, mesh in scene.geometry.items()}
    assert shown == {f"label {label} ({name})": colour_of(label, file.metadata) for label, name in NAMES.items()}


def test_a_probability_is_a_field(tmp_path: Path) -> None:
    path = make.segmentation(tmp_path / "a.dcm", VALUES.astype(np.uint8), "FRACTIONAL", most=4)
    found = isocodec.read(path, key="3")
    assert found.unit == "probability" and found.name and not found.labels
    assert isocodec.open(isocodec.encode(found, 0.1)).metadata["unit"] == "probability"
    with pytest.raises(OptionError, match="a field of probability, not labels"):
        isocodec.encode(isocodec.Field(found.values, unit=found.unit, labels="all"))


@looped("dtype", ["bool", "u1", "i1", "u2", "i2", ">i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"])
def test_the_type_that_went_in_comes_out(dtype: str) -> None:
    values = (np.eye(5) * 1).astype(dtype)
    for what in (isocodec.Field(values, labels=[1]), isocodec.Frames([isocodec.Field(values, labels=[1])] * 2)):
        file = isocodec.open(isocodec.encode(what))
        found = file.labels(frame=file.frames - 1)
        assert found.dtype == values.dtype.newbyteorder("=") and np.array_equal(found, values)
        assert ("dtype" in file.metadata) == (dtype != "u1")


def test_notes_that_are_none() -> None:
    """Types that do not hold the labels or are none, colours that are none, and files of isovalues."""
    assert type_of([300], {"dtype": "uint8"}) == type_of([300], {"dtype": "O"}) == np.uint16
    assert type_of([-1], {"dtype": "uint64"}) == np.int8 and type_of([0.5], {"dtype": "bool"}) == np.float16
    assert about(3, "", [0, 0.5, 2]) == {"colour 3": "#0080ff"} and about(0.5, "a") == {"label 0.5": "a"}
    assert colour_of(1, {"labels": "1", "colour 1": "red"}) is None and not name_of(1, {"label 1": "a"})
    assert json.dumps(about(-2.0, None)) == "{}"
