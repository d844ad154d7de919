"""Segmentations and encapsulated STL of DICOM, read back by highdicom, pydicom, trimesh and `isocodec.read`."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dicom_files import AXIAL, enhanced, slices

import isocodec
from commands import fails, ok
from isocodec.errors import InputError, OptionError
from isocodec.field.placement import LPS, RAS, Placement
from isocodec.io.formats import OutputOptions, SampleMask, write
from libraries import Late
from tables import looped

highdicom, pydicom, trimesh = map(Late, ("highdicom", "pydicom", "trimesh"))
OBLIQUE = (0.8, 0.6, 0, -0.48, 0.64, 0.6)
NORMAL = np.cross(OBLIQUE[:3], OBLIQUE[3:])
TO_LPS = np.diag([-1, -1, 1.0])


def ball() -> np.ndarray:
    """Slices, rows, columns."""
    k, j, i = np.indices((9, 14, 12))
    far = np.sqrt(2 * (k - 4) ** 2 + (j - 6) ** 2 + (i - 5.5) ** 2)
    return (1000 - 90 * far).clip(0).astype("u2")


def series(folder: Path, **how: Any) -> Path:
    def named(made: Any, number: int) -> None:
        made.PatientID, made.PatientName, made.PatientBirthDate, made.StudyDate = "p1", "A^B", "19700102", "20200304"

    return slices(folder, ball(), named, **how)


def marked(path: Path, numbers: Any) -> dict[int, np.ndarray]:
    """Places in mm, left, back and top, of the samples of each segment, by highdicom."""
    volume = highdicom.seg.segread(path).get_volume(combine_segments=True, segment_numbers=numbers)
    array = np.asarray(volume.array).reshape(volume.spatial_shape)
    out = {}
    for number in numbers:
        where = np.argwhere(array == number)
        out[number] = where @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    return out


def ordered(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(points.round(4).T)]


@looped("turned, step, labels, kind", [
    (AXIAL, (0, 0, 2.5), (1,), "BINARY"), (OBLIQUE, tuple(3 * NORMAL), (1, 2), "BINARY"),
    (OBLIQUE, tuple(-3 * NORMAL), (3, 7, 300), "LABELMAP"), (AXIAL, (0, 0, -2.5), (2,), "LABELMAP"),
])
def test_segmentations_lie_where_their_samples_do(
    tmp_path: Path, turned: Any, step: Any, labels: tuple[int, ...], kind: str
) -> None:
    like = series(tmp_path / "series", turned=turned, step=step)
    field, path = isocodec.read(like), tmp_path / "out.dcm"
    ranks = np.digitize(field.values, np.linspace(300, 700, len(labels)))
    values = np.array([0, *labels])[ranks]
    mask = values > 0 if labels == (1,) else values.astype(np.uint16)
    write(path, SampleMask(mask, field.placement), OutputOptions(like=str(like)))
    made, source = pydicom.dcmread(path), pydicom.dcmread(next(like.iterdir()))
    # a LABELMAP has its background, 0, as well
    assert made.SegmentationType == kind and {each.SegmentNumber for each in made.SegmentSequence} - {0} == {*labels}
    for name in ("PatientID", "PatientName", "PatientBirthDate", "StudyDate", "StudyInstanceUID",
                 "FrameOfReferenceUID"):
        assert made[name].value == source[name].value
    assert made.SeriesInstanceUID != source.SeriesInstanceUID
    found = marked(path, labels)
    for label in labels:
        wanted = field.placement.place(np.argwhere(values == label).astype(float)) @ TO_LPS
        assert len(wanted) and np.allclose(ordered(found[label]), ordered(wanted), rtol=0, atol=1e-4)
    again = isocodec.read(path)
    for label in labels:
        places = again.placement.place(np.argwhere(again.values == label).astype(float)) @ TO_LPS
        assert np.allclose(ordered(places), ordered(found[label]), rtol=0, atol=1e-4)


@looped("crs", [RAS, LPS])
@looped("many", [False, True])
def test_surfaces_are_encapsulated_in_mm(tmp_path: Path, crs: str, many: bool) -> None:
    like = enhanced(tmp_path / "like.dcm", ball()) if many else series(tmp_path / "series", turned=OBLIQUE)
    matrix = np.column_stack([np.array([OBLIQUE[:3], OBLIQUE[3:], NORMAL]).T * [0.7, 1.2, 2.5], [9, -30, 800]])
    field = isocodec.Field(ball().T, placement=Placement(matrix, crs=crs))
    contour = isocodec.decode(isocodec.encode(field, 600.5))
    path = tmp_path / "out.dcm"
    write(path, contour, OutputOptions(like=str(like)))
    made, source = pydicom.dcmread(path), pydicom.dcmread(like if many else next(like.iterdir()))
    assert made.SOPClassUID.name == "Encapsulated STL Storage"
    assert made.FrameOfReferenceUID == source.FrameOfReferenceUID
    assert (made.Modality, made.MIMETypeOfEncapsulatedDocument) == ("M3D", "model/stl")
    data = made.EncapsulatedDocument
    assert len(data) % 2 == 0 and len(data) - made.EncapsulatedDocumentLength in (0, 1)
    mesh = trimesh.load(io.BytesIO(data[: made.EncapsulatedDocumentLength]), file_type="stl")
    wanted = contour.placed if crs == LPS else contour.placed @ TO_LPS
    assert mesh.is_watertight and mesh.volume == pytest.approx(contour.to_trimesh().volume, rel=1e-5)
    assert mesh.volume > 0
    assert np.allclose(ordered(mesh.vertices), ordered(np.unique(wanted.astype("f4"), axis=0)), rtol=0, atol=1e-3)


def test_from_the_patients_series_and_back(tmp_path: Path) -> None:
    like = series(tmp_path / "series", turned=OBLIQUE, step=tuple(3 * NORMAL))
    ok("encode", like, "-o", tmp_path / "a.iso", "--isovalue", 600.5, "--precision", "exact")
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.dcm", "--what", "above", "--like", like)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "b.dcm", "--like", next(like.iterdir()))
    ok("encode", like, "-o", tmp_path / "c.dcm", "--isovalue", 600.5, "--like", like)
    again, field = isocodec.read(tmp_path / "a.dcm"), isocodec.read(like)
    inside = isocodec.decode(isocodec.encode(again, 0.5)).sample(field)
    assert again.values.sum() == (field.values > 600.5).sum() and np.ptp(inside) > 0
    stl = [pydicom.dcmread(tmp_path / name).EncapsulatedDocumentLength for name in ("b.dcm", "c.dcm")]
    assert stl[0] == stl[1]
    with pytest.raises(InputError, match="Encapsulated STL"):
        isocodec.read(tmp_path / "b.dcm")


def test_what_is_refused(tmp_path: Path) -> None:
    like = series(tmp_path / "series")
    slices(tmp_path / "two", ball(), lambda made, number: setattr(made, "SeriesInstanceUID", f"1.2.{number}"))
    slices(tmp_path / "nowhere", ball(), lambda made, number: delattr(made, "FrameOfReferenceUID"))
    place = Placement(np.eye(3, 4), crs=RAS)
    mask = SampleMask(ball().T > 600, place)
    labels = SampleMask(np.full((3, 4, 5), 70000), place)
    for what, options, error, words in (
        (mask, {}, OptionError, "--like SERIES"), (SampleMask(mask.values), {"like": like}, OptionError, "in a body"),
        (SampleMask(ball() > 9000, place), {"like": like}, OptionError, "no sample is marked"),
        (labels, {"like": like}, OptionError, "from 1 to 65535"),
        (mask, {"like": tmp_path / "none"}, InputError, "no file or folder"),
        (mask, {"like": tmp_path / "two"}, InputError, "several series"),
        (mask, {"like": tmp_path / "nowhere"}, InputError, "frame of reference"),
    ):
        with pytest.raises(error, match=words):
            write(tmp_path / "no.dcm", what, OutputOptions(**{name: str(each) for name, each in options.items()}))
    assert not (tmp_path / "no.dcm").exists()
    isocodec.save(tmp_path / "a.iso", isocodec.Field(ball().T, placement=place), 600.5)
    assert "--like does not apply" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.stl", "--like", like)
    assert "give --like" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.dcm")


@looped("name", ["Liver", "Läsion 腫瘍", "a\\b", "x" * 70])
def test_segments_have_names_and_colours_of_labels(tmp_path: Path, name: str) -> None:
    like = series(tmp_path / "series")
    for one in like.iterdir():
        header = pydicom.dcmread(one)
        header.SpecificCharacterSet, header.PatientName = "ISO_IR 100", "Müller^Eva"
        header.save_as(one)
    field = isocodec.read(like)
    labels = 4 * (field.values > 500).astype(np.uint8)
    notes = {"label 4": name, "colour 4": "#dd8265"}
    isocodec.save(tmp_path / "a.iso", isocodec.Field(labels, placement=field.placement, labels=[4], notes=notes))
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.dcm", "--what", "labels", "--like", like)
    assert pydicom.dcmread(tmp_path / "a.dcm").PatientName == "Müller^Eva"
    made = highdicom.seg.segread(tmp_path / "a.dcm").get_segment_description(4)
    assert made.segment_label == name.replace("\\", "/")[:64]
    rgb = highdicom.color.CIELabColor.from_dicom_value(made.RecommendedDisplayCIELabValue).to_rgb()
    assert np.abs(np.subtract(rgb, (0xDD, 0x82, 0x65))).max() <= 1


def test_errors_name_the_series(tmp_path: Path) -> None:
    like, other = series(tmp_path / "series"), tmp_path / "empty"
    other.mkdir()
    ok("encode", like, "-o", tmp_path / "a.iso", "--isovalue", 600.5)
    message = fails(3, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.dcm", "--like", other)
    assert str(other) in message and "holds no samples: give" in message
