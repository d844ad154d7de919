"""DICOM: a test for each kind of file, against its attributes, pydicom, SimpleITK (GDCM) and highdicom."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import dicom_files as make
import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from libraries import Late
from tables import looped

highdicom, pydicom = Late("highdicom"), Late("pydicom")
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
RAS = np.diag([-1.0, -1, 1])
AXIAL, STEP = (1.0, 0, 0, 0, 1, 0), (0.0, 0, 2.5)
OBLIQUE = tuple(np.round(np.linalg.qr(np.array([[1, 0.3, 0.2], [-0.2, 1, 0.4], [0.1, 0.2, 1]]))[0][:2].ravel(), 12))
TILTED = (1.0, 0, 0, 0, np.cos(0.3), np.sin(0.3))
PLACES: dict[str, dict[str, Any]] = {
    "axial": {}, "shuffled": {"order": (2, 0, 4, 1, 3)}, "downwards": {"step": (0, 0, -2.5)},
    "coronal": {"turned": (1, 0, 0, 0, 0, -1), "step": (0, 2, 0)}, "mirrored": {"turned": (-1, 0, 0, 0, 1, 0)},
    "oblique": {"turned": OBLIQUE, "step": tuple(2 * np.cross(OBLIQUE[:3], OBLIQUE[3:]))}, "tilted": {"turned": TILTED},
}
RAW = (np.arange(5 * 6 * 7) * 7 % 4093).reshape(5, 6, 7).astype("u2")
SIGNED = RAW.astype("i2") - 2000
LABELS = np.zeros((7, 6, 7), np.uint8)
LABELS[1:5, 1:4, 1:4], LABELS[2:4, 4:, 2:], LABELS[5, 1, 1] = 1, 3, 1


def setter(**attributes: Any) -> Any:
    """Give all slices attributes; a function makes that of a number."""

    def change(made: Any, number: int) -> None:
        for name, value in attributes.items():
            setattr(made, name, value(number) if callable(value) else value)

    return change


def matrix(turned: Any = AXIAL, step: Any = STEP, **_: Any) -> Any:
    """Placement by the attributes, for slices in their order, and whether that is the order of their numbers."""
    forth = float(np.dot(np.cross(turned[:3], turned[3:]), step)) > 0
    first, sign = (make.corner(0, step), 1) if forth else (make.corner(4, step), -1)
    row, column = np.array(turned[:3]) * 1.25, np.array(turned[3:]) * 0.75
    return RAS @ np.column_stack([row, column, np.array(step) * sign, first]), forth


VALUES: dict[str, tuple[Any, dict[str, Any], Any]] = {
    "as stored": (RAW, {}, lambda raw, k: raw), "signed": (SIGNED, {}, lambda raw, k: raw),
    "bytes": (RAW.astype("u1"), {}, lambda raw, k: raw),
    "whole": (SIGNED, {"RescaleSlope": 3, "RescaleIntercept": -7}, lambda raw, k: raw.astype(int) * 3 - 7),
    "fraction": (RAW, {"RescaleSlope": "0.0015", "RescaleIntercept": "0.25"}, lambda raw, k: raw * 0.0015 + 0.25),
    "by slice": (RAW, {"RescaleSlope": lambda n: f"{0.5 + n / 10:g}"}, lambda raw, k: raw * np.round(0.5 + k / 10, 1)),
    "intercepts": (RAW, {"RescaleIntercept": lambda n: -9 * (n > 0)}, lambda raw, k: raw.astype(int) - 9 * (k > 0)),
    "inverted": (RAW, {"PhotometricInterpretation": "MONOCHROME1"}, lambda raw, k: raw),
}


@looped("name", VALUES)
def test_values(tmp_path: Path, name: str) -> None:
    """Rescaled as each slice states; integers stay integers where whole numbers scale them."""
    raw, attributes, right = VALUES[name]
    for write in (make.slices, make.enhanced):
        found = isocodec.read(write(tmp_path / f"{write.__name__}.dcm", raw, setter(**attributes)))
        assert np.allclose(found.values, right(raw, np.arange(5)[:, None, None]).T, rtol=1e-15, atol=0)
        assert found.values.dtype.kind in ("f" if name in ("fraction", "by slice") else "iu") and found.mask is None


@looped("name", PLACES)
def test_places(tmp_path: Path, name: str) -> None:
    """Each sample lies where its slice's attributes put it: of a tilted gantry sheared, not upright."""
    right, forth = matrix(**PLACES[name])
    for write in (make.slices, make.enhanced):
        found = isocodec.read(write(tmp_path / f"{write.__name__}.dcm", RAW, **PLACES[name]))
        assert np.array_equal(found.values, RAW.T if forth else RAW.T[..., ::-1])
        assert np.allclose(found.placement.matrix, right, atol=1e-9) and found.placement.unit == "mm"
    (path,) = make.slices(tmp_path / "one", RAW[:1], **PLACES[name]).iterdir()
    one = isocodec.read(path)
    assert np.array_equal(one.values, RAW[0].T) and one.placement.in_space


@looped("name", ["axial", "downwards", "oblique"])
def test_places_of_itk_and_highdicom(tmp_path: Path, name: str) -> None:
    import SimpleITK

    path = make.slices(tmp_path / "a", RAW, **PLACES[name])
    reader = SimpleITK.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path)))
    image, found = reader.Execute(), isocodec.read(path)
    ends = [image.TransformIndexToPhysicalPoint(index) for index in ((0, 0, 0), (6, 5, 4))]
    assert np.allclose(found.placement.place(np.array([[0, 0, 0], [6, 5, 4.0]])), ends @ RAS, atol=1e-6)
    volume = highdicom.imread(make.enhanced(tmp_path / "a.dcm", RAW, **PLACES[name])).get_volume()
    found, of_file = isocodec.read(volume), isocodec.read(tmp_path / "a.dcm")
    assert np.array_equal(found.values, volume.array.T)
    back = [0, 0, 0 if np.array_equal(found.values, of_file.values) else 4]
    corners = np.array([[0, 0, 0], [6, 5, 0], [6, 5, 4.0]])
    assert np.allclose(found.placement.place(corners), of_file.placement.place(np.abs(corners - back)), atol=1e-6)
    channels = {"OpticalPathIdentifier": [*"abcde"]}
    with pytest.raises(InputError, match="channels"):
        isocodec.read(highdicom.Volume(np.zeros((2, 3, 4, 5)), np.eye(4), "PATIENT", channels=channels))


@looped("syntax, kind", [
    ("ImplicitVRLittleEndian", "slices"), ("ExplicitVRBigEndian", "enhanced"), ("RLELossless", "slices"),
    ("RLELossless", "enhanced"), ("JPEGLSLossless", "slices"),
])
def test_syntaxes(tmp_path: Path, kind: str, syntax: str) -> None:
    path = getattr(make, kind)(tmp_path / "a.dcm", SIGNED, setter(RescaleIntercept=-24))
    uid = getattr(pydicom.uid, syntax)
    for each in sorted(path.iterdir()) if path.is_dir() else [path]:
        made = pydicom.dcmread(each)
        made.ImageType = ["ORIGINAL", "PRIMARY"]
        if uid.is_encapsulated:
            try:
                made.compress(uid, generate_instance_uid=False)
            except (RuntimeError, ValueError) as error:
                pytest.skip(str(error)[:80])
            made.save_as(each)
            continue
        made.file_meta.TransferSyntaxUID = uid
        del made.ImageType
        raw = SIGNED[int(each.stem)] if path.is_dir() else SIGNED
        made.PixelData = (raw if uid.is_little_endian else raw.byteswap()).tobytes()
        made["PixelData"].VR = "OW"
        pydicom.dcmwrite(each, made, implicit_vr=uid.is_implicit_VR, little_endian=uid.is_little_endian,
                         force_encoding=True)
    assert np.array_equal(isocodec.read(path).values, SIGNED.T.astype(int) - 24)


@looped("kind, ends, scale", [
    ("slices", (0, None), 1), ("enhanced", (0, 40), "0.5"), ("slices", (40, 0), "0.5"), ("enhanced", (0, None), 1),
])
def test_padding_is_missing(tmp_path: Path, kind: str, ends: Any, scale: Any) -> None:
    def change(made: Any, number: int) -> None:
        for name, value in zip(("PixelPaddingValue", "PixelPaddingRangeLimit"), ends, strict=True):
            if value is not None:
                made.add_new(name, "US", value)
        made.RescaleSlope = scale

    path = getattr(make, kind)(tmp_path / "a.dcm", RAW, change)
    found = isocodec.read(path)
    assert np.array_equal(found.mask, (max(ends[0], ends[1] or 0) >= RAW).T)
    assert np.array_equal(found.values, RAW.T * float(scale))
    assert isocodec.read(path, nodata=np.nan).mask is None  # a marker, as it is stored, instead
    assert np.array_equal(isocodec.read(path, nodata=RAW[1, 2, 3]).mask, (RAW[1, 2, 3] == RAW).T)


def test_stored_numbers(tmp_path: Path) -> None:
    """Padding with the other sign; overlays in the high bits, and signs in the last bit that is used; tables."""
    samples = SIGNED.copy()
    samples[:, 0] = -2000
    path = make.slices(tmp_path / "a", samples, lambda made, number: made.add_new("PixelPaddingValue", "US", 63536))
    assert np.array_equal(isocodec.read(path).mask, (samples == -2000).T)
    for low in (0, -2048):
        numbers = (RAW % 4096).astype(int) + low
        words = (numbers & 0x0FFF) | np.where(np.arange(numbers.size).reshape(numbers.shape) % 3 == 0, 0xF000, 0)
        change = setter(BitsStored=12, HighBit=11, PixelRepresentation=int(low < 0))
        assert np.array_equal(isocodec.read(make.slices(tmp_path / "b", words.astype("u2"), change)).values, numbers.T)

    def tabled(made: Any, number: int) -> None:
        table = pydicom.Dataset()
        table.LUTDescriptor, table.ModalityLUTType = [256, 0, 16], "US"
        table.add_new("LUTData", "US", [5 * n + number for n in range(256)])
        made.ModalityLUTSequence = [table]
        del made.RescaleSlope, made.RescaleIntercept

    found = isocodec.read(make.slices(tmp_path / "c", RAW.astype("u1"), tabled)).values
    assert np.array_equal(found, (5 * RAW.astype("u1").astype(int) + np.arange(5)[:, None, None]).T)


def test_colours_are_bands(tmp_path: Path) -> None:
    samples = np.stack([RAW, RAW + 1, RAW + 2], -1).astype("u1")
    path = make.slices(tmp_path / "a", samples, setter(
        SamplesPerPixel=3, PhotometricInterpretation="RGB", PlanarConfiguration=0))
    for band, words in ((None, "3 channels"), (4, "no band 4")):
        with pytest.raises((InputError, OptionError), match=words):
            isocodec.read(path, band=band)
    assert np.array_equal(isocodec.read(path, band=2).values, samples[..., 1].T)


@looped("name, values", [
    ("TemporalPositionIdentifier", (7, 11)), ("AcquisitionTime", ("101010", "101011")),
    ("ImageType", (["ORIGINAL", "PRIMARY", "M"], ["ORIGINAL", "PRIMARY", "P"])),
])
def test_volumes_in_one_place_are_frames(tmp_path: Path, name: str, values: Any) -> None:
    """By the first attribute in which they differ; one that lacks a slice is an error."""
    for number in (0, 1):
        order = [2 * n + number for n in range(5)]
        make.slices(tmp_path / "a", RAW + number, setter(**{name: values[number]}), order=order)
    with pytest.raises(InputError, match=f"differ by {name}.*--frame 0 to 1"):
        isocodec.read(tmp_path / "a")
    fields = isocodec.read(tmp_path / "a", frames=True).fields
    assert [np.array_equal(each.values, RAW.T + at) for at, each in enumerate(fields)] == [True, True]
    found = isocodec.read(tmp_path / "a", frame=1)
    assert np.array_equal(found.values, RAW.T + 1) and np.allclose(found.placement.matrix, matrix()[0])
    (tmp_path / "a" / "005.dcm").unlink()
    with pytest.raises(InputError, match=r"several slices in one place.*or lack others"):
        isocodec.read(tmp_path / "a", frame=0)


def test_times_of_frames(tmp_path: Path) -> None:
    def change(flat: Any, number: int) -> None:
        flat.ImagePositionPatient, flat.TemporalPositionIndex = make.corner(number % 5), number // 5 + 1

    order = 4, 0, 2, 8, 9, 1, 3, 6, 7, 5
    path = make.enhanced(tmp_path / "a.dcm", np.concatenate([RAW, RAW + 1]), change, order=order)
    assert np.array_equal(isocodec.read(path, frame=1).values, RAW.T + 1)


@looped("places, words", [
    ((0, 1, 3, 4, 5), "gap .*: .* lies .* mm off: add the missing slices"), ((0, 1, 2, 5, 6), "gap .* mm off"),
    ((0, 1, 1, 2, 3), "several slices in one place"), ((0, 1.1, 2, 3, 4), "uneven steps: .* mm off"),
    ((0, 1.002, 2, 2.999, 4), ""),
])
def test_slices_that_form_no_volume(tmp_path: Path, places: Any, words: str) -> None:
    """Positions may be rounded, but not uneven."""
    change = setter(ImagePositionPatient=lambda n: make.corner(places[n]))
    for write in (make.slices, make.enhanced):
        path = write(tmp_path / f"{write.__name__}.dcm", RAW, change)
        if not words:
            assert np.allclose(isocodec.read(path).placement.matrix, matrix()[0])
            continue
        with pytest.raises(InputError, match=words):
            isocodec.read(path)


def test_localizers_and_copies_are_left_out(tmp_path: Path) -> None:
    path = make.slices(tmp_path / "a", RAW)
    (path / "below").mkdir()
    shutil.copy(path / "002.dcm", path / "below" / "again.dcm")
    make.slices(path / "scout", RAW[:1], setter(ImageType=["ORIGINAL", "PRIMARY"]), turned=(0, 1, 0, 0, 0, -1))
    found = isocodec.read(path)
    assert np.array_equal(found.values, RAW.T) and found.remarks == (
        "copies of other slices are left out: 1", "localizers, or slices of other sizes or directions, are left out: 1")
    make.slices(path / "scouts", RAW[:2], turned=(0, 1, 0, 0, 0, -1), step=(2, 0, 0))
    with pytest.raises(InputError, match=r"stacks of different sizes or directions, of 3, 5 slices.*dcm2niix"):
        isocodec.read(path)

    def change(flat: Any, number: int) -> None:
        flat.StackID = "left" if number < 5 else "right"

    with pytest.raises(InputError, match="of 5, 5 slices"):
        isocodec.read(make.enhanced(tmp_path / "a.dcm", np.concatenate([RAW, RAW + 9]), change))


def test_series_are_chosen(tmp_path: Path) -> None:
    for number, (name, count) in enumerate({"thin": 5, "thick": 3, "": 2}.items(), 1):
        make.slices(tmp_path / f"{number}", RAW[:count] + number, setter(
            SeriesInstanceUID=f"1.2.{number}", SeriesNumber=number, SeriesDescription=name))
    (tmp_path / "notes.txt").write_text("nothing of DICOM")
    report = make.header(pydicom.uid.BasicTextSRStorage, 1, 1, np.dtype("u1"))
    report.save_as(tmp_path / "report.dcm", enforce_file_format=True)
    for key, words in ((None, r"3 series: 1 thin 1.2.1, 2 thick 1.2.2, 3 1.2.3"), ("none", "no series named 'none'")):
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path, key=key)
    for key in ("2", "thick", "1.2.2"):
        found = isocodec.read(tmp_path, key=key)
        assert np.array_equal(found.values, RAW[:3].T + 2)
        assert "files without samples are left out: 2" in found.remarks[0]
    make.slices(tmp_path / "4", RAW, setter(SeriesInstanceUID="1.2.4", SeriesNumber=4, SeriesDescription="thick"))
    with pytest.raises(InputError, match="4 series"):  # what two have names neither
        isocodec.read(tmp_path, key="thick")


def flat_file(path: Path, storage: str, samples: Any, **attributes: Any) -> Path:
    """A file of frames without positions."""
    made = make.header(storage, 6, 7, samples.dtype)
    for name, value in attributes.items():
        setattr(made, name, value)
    make.pixels(made, samples)
    made.save_as(path, enforce_file_format=True)
    return path


def test_frames_without_positions(tmp_path: Path) -> None:
    """Spacings are kept if all are stated; pictures keep theirs; films are series; doses have offsets."""
    path, ct = tmp_path / "a.dcm", {"NumberOfFrames": 5, "PixelSpacing": [0.75, 1.25]}
    for between in (None, 2.5):
        more = {"SpacingBetweenSlices": between} if between else {}
        found = isocodec.read(flat_file(path, "1.2.840.10008.5.1.4.1.1.2", RAW, **ct, **more))
        assert np.array_equal(found.values, RAW.T) and found.remarks == ("the positions of its slices are unknown",)
        assert found.crs is None and (found.placement is None) == (between is None)
    assert np.allclose(found.placement.matrix, np.diag([1.25, 0.75, 2.5]) @ np.eye(3, 4))
    found = isocodec.read(flat_file(path, "1.2.840.10008.5.1.4.1.1.7", RAW[0], ImagerPixelSpacing=[0.75, 1.25]))
    assert np.allclose(found.placement.matrix, [[1.25, 0, 0], [0, 0.75, 0]]) and found.placement.unit == "mm"
    film = flat_file(tmp_path / "film", "1.2.840.10008.5.1.4.1.1.3.1", RAW.astype("u1"), NumberOfFrames=5, FrameTime=40)
    with pytest.raises(InputError, match="differ by time"):
        isocodec.read(film)
    assert np.array_equal(isocodec.read(film, frame=3).values, RAW[3].astype("u1").T)
    found = isocodec.read(flat_file(
        path, "1.2.840.10008.5.1.4.1.1.481.2", RAW.astype("u4"), **ct, DoseGridScaling="0.001", DoseUnits="GY",
        ImageOrientationPatient=[*AXIAL], ImagePositionPatient=make.corner(0),
        GridFrameOffsetVector=[30, 32.5, 35, 37.5, 40]))
    assert np.array_equal(found.values, RAW.T * 0.001) and found.unit == "GY"
    assert np.allclose(found.placement.matrix, matrix()[0])


@looped("name", ["IM{:04d}", "{}.IMA", "1.2.840.{}"])
def test_folders_as_they_lie_about(tmp_path: Path, name: str) -> None:
    """Files without suffix, of other names, without positions, among others."""
    folder, numbers = tmp_path / "in", [11, 2, 0, 10, 1]
    folder.mkdir()
    for path, number in zip(sorted(make.slices(tmp_path / "out", RAW).iterdir()), numbers, strict=True):
        made = pydicom.dcmread(path)
        del made.ImagePositionPatient, made.ImageOrientationPatient
        made.save_as(folder / name.format(number), enforce_file_format=True)
    for other, content in {"README": b"slices", "a.json": b'{"a": 1}', "empty": b"", "zeros": bytes(400)}.items():
        (folder / other).write_bytes(content)
    found = isocodec.read(folder)
    assert np.array_equal(found.values, RAW.T) and "4 (not DICOM)" in found.remarks[0]


def test_files_that_are_refused(tmp_path: Path) -> None:
    path = make.slices(tmp_path / "a", RAW[:1]) / "000.dcm"
    pydicom.dcmwrite(tmp_path / "b.dcm", pydicom.Dataset(pydicom.dcmread(path)), implicit_vr=True, little_endian=True)
    changes = {
        "c": lambda made: setattr(made.file_meta, "TransferSyntaxUID", pydicom.uid.DeflatedExplicitVRLittleEndian),
        "d": lambda made: [setattr(made, "BitsStored", 12), setattr(made, "HighBit", 15)],
        "p": lambda made: setattr(made, "PhotometricInterpretation", "PALETTE COLOR"),
        "t": lambda made: setattr(made, "TotalPixelMatrixRows", 12),
        "n": lambda made: delattr(made, "PixelData"),
    }
    for name, change in changes.items():
        made = pydicom.dcmread(path)
        change(made)
        made.save_as(tmp_path / f"{name}.dcm")
    made = pydicom.dcmread(path)
    made.compress(pydicom.uid.RLELossless)
    made.file_meta.TransferSyntaxUID = pydicom.uid.MPEG2MPML
    made.save_as(tmp_path / "v.dcm")
    made = pydicom.dcmread(make.enhanced(tmp_path / "m.dcm", RAW))
    made.NumberOfFrames = 1 << 20
    made.save_as(tmp_path / "m.dcm")
    made.NumberOfFrames = 5
    del made.PerFrameFunctionalGroupsSequence[4]
    made.save_as(tmp_path / "g.dcm")
    index = make.header("1.2.840.10008.1.3.10", 1, 1, np.dtype("u1"))
    (tmp_path / "i").mkdir()
    index.save_as(tmp_path / "i" / "DICOMDIR", enforce_file_format=True)
    for number in (0, 1):
        change = setter(InstanceNumber=lambda n, first=5 * number: n + first)
        make.slices(tmp_path / "e", RAW, change, order=[2 * n + number for n in range(5)])
    make.slices(tmp_path / "f", RAW, setter(InstanceNumber=None, ImagePositionPatient=None))
    for name, words in (("b.dcm", "File Meta"), ("c.dcm", "deflated.* dcmconv"), ("d.dcm", "high bits of words"),
                        ("p.dcm", "palette"), ("t.dcm", "tiles"), ("n.dcm", "no samples"), ("m.dcm", r"m\.dcm"),
                        ("v.dcm", "MPEG2"), ("g.dcm", "other frames than its 5"), ("i", "give a file or folder"),
                        ("e", r"several slices in one place.* dcm2niix"), ("f", "without positions or numbers")):
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / name)


def test_units_and_parametric_maps(tmp_path: Path) -> None:
    for unit, kept in (("HU", "HU"), ("US", None)):
        assert isocodec.read(make.slices(tmp_path / "a", RAW, setter(RescaleType=unit))).unit == kept

    def change(flat: Any, number: int) -> None:
        del flat.RescaleSlope, flat.RescaleIntercept
        flat.RealWorldValueSlope, flat.RealWorldValueIntercept = 2.0, 0.5

    values = RAW.astype("f4") / 3
    made = pydicom.dcmread(make.enhanced(tmp_path / "a.dcm", values, change))
    made.FloatPixelData = values.tobytes()
    del made.PixelData
    made.BitsAllocated = 32
    made.save_as(tmp_path / "a.dcm")
    assert np.allclose(isocodec.read(tmp_path / "a.dcm").values, values.T * 2.0 + 0.5, rtol=1e-12)


@looped("how, gap, step", [
    ("BINARY", False, STEP), ("BINARY", True, (0, 0, -2.5)), ("LABELMAP", True, STEP),
    ("LABELMAP", False, (0, 0, -2.5)),
])
def test_segmentations(tmp_path: Path, how: str, gap: bool, step: Any) -> None:
    """Slices without a segment are stored nowhere: those between are empty, as are one before and one behind."""
    labels = LABELS.copy()
    labels[3] *= not gap
    path = make.segmentation(tmp_path / "a.dcm", labels, how, step=step)
    found, right = isocodec.read(path), labels[:: 1 if step == STEP else -1]
    inside = np.flatnonzero(right.any(axis=(1, 2)))
    assert np.array_equal(found.values, right[inside[0] - 1 : inside[-1] + 2].T) and found.mask is None
    assert np.allclose(found.placement.matrix[:, 3], RAS @ make.corner(0 if step == STEP else 6, step))
    relabelled = pydicom.dcmread(path)
    relabelled.SeriesNumber = 3  # a number is that of a segment
    relabelled.save_as(path)
    for key, number in (("3", 3), ("organ 1", 1)):
        one = isocodec.read(path, key=key).values
        assert set(np.unique(one)) == {0, 1} and one.sum() == (labels == number).sum()
    with pytest.raises(InputError, match=r"1 organ 1, .*3 organ 3"):
        isocodec.read(path, key="spleen")


def test_fractions_and_segments_that_overlap(tmp_path: Path) -> None:
    path = make.segmentation(tmp_path / "a.dcm", LABELS, "FRACTIONAL", most=4)
    with pytest.raises(InputError, match="3 segments"):
        isocodec.read(path)
    found = isocodec.read(path, key="3").values
    assert found.dtype == np.float32 and set(np.unique(found)) == {0, 0.25}
    assert (found > 0).sum() == (LABELS == 3).sum()
    made = pydicom.dcmread(make.segmentation(tmp_path / "b.dcm", LABELS))
    made.PixelData = bytes([255]) * len(made.PixelData)
    made.save_as(tmp_path / "b.dcm")
    with pytest.raises(InputError, match="segments overlap"):
        isocodec.read(tmp_path / "b.dcm")
    assert isocodec.read(tmp_path / "b.dcm", key="3").values.sum() == 2 * 42


@looped("kind", ["slice", "enhanced", "BINARY", "LABELMAP", "RLE"])
def test_files_cut_short(tmp_path: Path, kind: str) -> None:
    if kind in ("BINARY", "LABELMAP"):
        path = make.segmentation(tmp_path / "a.dcm", LABELS, kind)
    else:
        path = make.slices(tmp_path / "a", RAW[:1]) / "000.dcm" if kind == "slice" else make.enhanced(
            tmp_path / "a.dcm", RAW)
    if kind == "RLE":
        made = pydicom.dcmread(path)
        made.compress(pydicom.uid.RLELossless)
        made.save_as(path)
    data, cut = path.read_bytes(), tmp_path / "b.dcm"
    last = len(data) - 16 * (kind == "RLE")
    for size in (0, 140, len(data) // 3, len(data) // 2, *range(len(data) - 40, last - 2, 3)):
        cut.write_bytes(data[:size])
        with pytest.raises(InputError):
            isocodec.read(cut)


def test_files_that_pydicom_ships() -> None:
    """Slices, frames, doses, colours, and every compression that can be decoded here."""
    from pydicom.pixels import apply_modality_lut

    read, refused = 0, ("liver_1frame.dcm", "liver_expb_1frame.dcm", "SC_rgb_jpeg.dcm")
    folder = Path(pydicom.data.get_testdata_file("CT_small.dcm")).parent
    for path in sorted(folder.glob("*.dcm"))[::2]:
        try:
            made = pydicom.dcmread(path)
            right = made.pixel_array
        except Exception:
            with pytest.raises(InputError):
                isocodec.read(path)
            continue
        coloured = made.SamplesPerPixel > 1
        try:
            found = isocodec.read(path, band=1 if coloured else None)
        except InputError as error:
            assert "--frame" in f"{error}" or "palette" in f"{error}" or path.name in refused, path
            continue
        right = right[..., 0] if coloured else apply_modality_lut(right, made) * float(made.get("DoseGridScaling", 1))
        if "SegmentationType" not in made:
            assert np.array_equal(found.values, right.T), path
            read += 1
    assert read > 20
