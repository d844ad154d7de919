"""DICOM: a test for each kind of file, against its attributes, pydicom, SimpleITK (GDCM) and highdicom."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError

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


@pytest.fixture
def make() -> Any:
    """Writers of files: slices, enhanced, segmentation, header, pixels, corner."""
    import dicom_files

    return dicom_files


def setter(**attributes: Any) -> Any:
    """Give all slices attributes; a function makes that of a number."""

    def change(made: Any, number: int) -> None:
        for name, value in attributes.items():
            setattr(made, name, value(number) if callable(value) else value)

    return change


def matrix(make: Any, turned: Any = AXIAL, step: Any = STEP, **_: Any) -> Any:
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


@pytest.mark.parametrize("name", VALUES)
def test_values(tmp_path: Path, make: Any, name: str) -> None:
    """Rescaled as each slice states; integers stay integers where whole numbers scale them."""
    raw, attributes, right = VALUES[name]
    for write in (make.slices, make.enhanced):
        found = isocodec.read(write(tmp_path / f"{write.__name__}.dcm", raw, setter(**attributes)))
        assert np.allclose(found.values, right(raw, np.arange(5)[:, None, None]).T, rtol=1e-15, atol=0)
        assert found.values.dtype.kind in ("f" if name in ("fraction", "by slice") else "iu") and found.mask is None


@pytest.mark.parametrize("name", PLACES)
def test_places(tmp_path: Path, make: Any, name: str) -> None:
    """Each sample lies where its slice's attributes put it: of a tilted gantry sheared, not upright."""
    right, forth = matrix(make, **PLACES[name])
    for write in (make.slices, make.enhanced):
        found = isocodec.read(write(tmp_path / f"{write.__name__}.dcm", RAW, **PLACES[name]))
        assert np.array_equal(found.values, RAW.T if forth else RAW.T[..., ::-1])
        assert np.allclose(found.placement.matrix, right, atol=1e-9) and found.placement.unit == "mm"


def test_places_of_itk(tmp_path: Path, make: Any) -> None:
    import SimpleITK

    path = make.slices(tmp_path / "a", RAW, **PLACES["oblique"])
    reader = SimpleITK.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path)))
    image, found = reader.Execute(), isocodec.read(path)
    ends = [image.TransformIndexToPhysicalPoint(index) for index in ((0, 0, 0), (6, 5, 4))]
    assert np.allclose(found.placement.place(np.array([[0, 0, 0], [6, 5, 4.0]])), ends @ RAS, atol=1e-6)


@pytest.mark.parametrize("name", ["axial", "downwards", "oblique"])
def test_volumes_of_highdicom(tmp_path: Path, make: Any, name: str) -> None:
    import highdicom

    volume = highdicom.imread(make.enhanced(tmp_path / "a.dcm", RAW, **PLACES[name])).get_volume()
    found, of_file = isocodec.read(volume), isocodec.read(tmp_path / "a.dcm")
    assert np.array_equal(found.values, volume.array.T)
    back = [0, 0, 0 if np.array_equal(found.values, of_file.values) else 4]
    corners = np.array([[0, 0, 0], [6, 5, 0], [6, 5, 4.0]])
    assert np.allclose(found.placement.place(corners), of_file.placement.place(np.abs(corners - back)), atol=1e-6)


def test_volumes_with_channels() -> None:
    system = SimpleNamespace(name="PATIENT")
    volume = SimpleNamespace(affine=np.eye(4), coordinate_system=system, array=np.zeros((2, 3, 4, 5)))
    with pytest.raises(InputError, match="channels"):
        isocodec.read(volume)


@pytest.mark.parametrize("syntax", [
    "ImplicitVRLittleEndian", "ExplicitVRBigEndian", "RLELossless", "JPEGLSLossless",
])
@pytest.mark.parametrize("kind", ["slices", "enhanced"])
def test_syntaxes(tmp_path: Path, make: Any, kind: str, syntax: str) -> None:
    import pydicom

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


@pytest.mark.parametrize(("kind", "ends"), [("slices", (0, None)), ("enhanced", (0, 40)), ("slices", (40, 0))])
@pytest.mark.parametrize("scale", [1, "0.5"])
def test_padding_is_missing(tmp_path: Path, make: Any, kind: str, ends: Any, scale: Any) -> None:
    def change(made: Any, number: int) -> None:
        for name, value in zip(("PixelPaddingValue", "PixelPaddingRangeLimit"), ends, strict=True):
            if value is not None:
                made.add_new(name, "US", value)
        made.RescaleSlope = scale

    found = isocodec.read(getattr(make, kind)(tmp_path / "a.dcm", RAW, change))
    assert np.array_equal(found.mask, (max(ends[0], ends[1] or 0) >= RAW).T)
    assert np.array_equal(found.values, RAW.T * float(scale))


def test_padding_with_the_other_sign(tmp_path: Path, make: Any) -> None:
    samples = SIGNED.copy()
    samples[:, 0] = -2000
    path = make.slices(tmp_path / "a", samples, lambda made, number: made.add_new("PixelPaddingValue", "US", 63536))
    assert np.array_equal(isocodec.read(path).mask, (samples == -2000).T)
    assert isocodec.read(path, nodata=np.nan).mask is None
    assert np.array_equal(isocodec.read(path, nodata=samples[1, 2, 3]).mask, (samples == samples[1, 2, 3]).T)


@pytest.mark.parametrize("low", [0, -2048])
def test_bits_that_are_not_used(tmp_path: Path, make: Any, low: int) -> None:
    """Overlays in the high bits, and signs in the last bit that is used."""
    samples = (RAW % 4096).astype(int) + low
    words = (samples & 0x0FFF) | np.where(np.arange(samples.size).reshape(samples.shape) % 3 == 0, 0xF000, 0)
    change = setter(BitsStored=12, HighBit=11, PixelRepresentation=int(low < 0))
    assert np.array_equal(isocodec.read(make.slices(tmp_path / "a", words.astype("u2"), change)).values, samples.T)


def test_tables(tmp_path: Path, make: Any) -> None:
    import pydicom

    def change(made: Any, number: int) -> None:
        table = pydicom.Dataset()
        table.LUTDescriptor, table.ModalityLUTType = [256, 0, 16], "US"
        table.add_new("LUTData", "US", [5 * n + number for n in range(256)])
        made.ModalityLUTSequence = [table]
        del made.RescaleSlope, made.RescaleIntercept

    found = isocodec.read(make.slices(tmp_path / "a", RAW.astype("u1"), change)).values
    assert np.array_equal(found, (5 * RAW.astype("u1").astype(int) + np.arange(5)[:, None, None]).T)


def test_colours_are_bands(tmp_path: Path, make: Any) -> None:
    samples = np.stack([RAW, RAW + 1, RAW + 2], -1).astype("u1")
    path = make.slices(tmp_path / "a", samples, setter(
        SamplesPerPixel=3, PhotometricInterpretation="RGB", PlanarConfiguration=0))
    with pytest.raises(InputError, match="3 channels"):
        isocodec.read(path)
    with pytest.raises(OptionError, match="no band 4"):
        isocodec.read(path, band=4)
    assert np.array_equal(isocodec.read(path, band=2).values, samples[..., 1].T)


def test_palettes(tmp_path: Path, make: Any) -> None:
    def change(made: Any, number: int) -> None:
        made.PhotometricInterpretation = "PALETTE COLOR"
        for factor, name in ((1, "Red"), (2, "Green"), (3, "Blue")):
            setattr(made, f"{name}PaletteColorLookupTableDescriptor", [256, 0, 16])
            setattr(made, f"{name}PaletteColorLookupTableData", (np.arange(256) * factor).astype("<u2").tobytes())

    path = make.slices(tmp_path / "a", RAW.astype("u1"), change)
    assert np.array_equal(isocodec.read(path, band=3).values, 3 * RAW.astype("u1").T.astype(int))


TIMES: list[tuple[str, Any]] = [
    ("TemporalPositionIdentifier", (7, 11)), ("AcquisitionTime", ("101010", "101011")),
    ("ImageType", (["ORIGINAL", "PRIMARY", "M"], ["ORIGINAL", "PRIMARY", "P"])),
]


@pytest.mark.parametrize(("name", "values"), TIMES)
def test_volumes_in_one_place_are_frames(tmp_path: Path, make: Any, name: str, values: Any) -> None:
    for number in (0, 1):
        order = [2 * n + number for n in range(5)]
        make.slices(tmp_path / "a", RAW + number, setter(**{name: values[number]}), order=order)
    with pytest.raises(InputError, match=f"differ by {name}.*--frame 0 to 1"):
        isocodec.read(tmp_path / "a")
    fields = isocodec.read(tmp_path / "a", frames=True).fields
    assert [np.array_equal(each.values, RAW.T + at) for at, each in enumerate(fields)] == [True, True]
    found = isocodec.read(tmp_path / "a", frame=1)
    assert np.array_equal(found.values, RAW.T + 1) and np.allclose(found.placement.matrix, matrix(make)[0])


def test_times_of_frames(tmp_path: Path, make: Any) -> None:
    def change(flat: Any, number: int) -> None:
        flat.ImagePositionPatient, flat.TemporalPositionIndex = make.corner(number % 5), number // 5 + 1

    order = 4, 0, 2, 8, 9, 1, 3, 6, 7, 5
    path = make.enhanced(tmp_path / "a.dcm", np.concatenate([RAW, RAW + 1]), change, order=order)
    assert np.array_equal(isocodec.read(path, frame=1).values, RAW.T + 1)


def test_volumes_of_one_type(tmp_path: Path, make: Any) -> None:
    """Also where only some of them are rescaled."""
    for number in (0, 1):
        change = setter(TemporalPositionIdentifier=number, RescaleSlope=1 - number / 2)
        make.slices(tmp_path / "a", RAW, change, order=[2 * n + number for n in range(5)])
    one, other = isocodec.read(tmp_path / "a", frames=True).fields
    assert one.values.dtype == other.values.dtype == np.float64 and np.array_equal(one.values, 2 * other.values)


def test_a_time_that_lacks_a_slice(tmp_path: Path, make: Any) -> None:
    for number in (0, 1):
        order = [2 * n + number for n in range(5)]
        make.slices(tmp_path / "a", RAW, setter(TemporalPositionIdentifier=number), order=order)
    (tmp_path / "a" / "005.dcm").unlink()
    with pytest.raises(InputError, match=r"TemporalPositionIdentifier.* different slices"):
        isocodec.read(tmp_path / "a", frame=0)


@pytest.mark.parametrize(("places", "words"), [
    ((0, 1, 3, 4, 5), "gap .*: .* lies .* mm off: add the missing slices"),
    ((0, 1, 2, 5, 6), "gap .* mm off"), ((0, 1, 1, 2, 3), "several slices in one place"),
    ((0, 1.1, 2, 3, 4), "uneven steps: .* mm off"),
])
def test_slices_that_form_no_volume(tmp_path: Path, make: Any, places: Any, words: str) -> None:
    change = setter(ImagePositionPatient=lambda n: make.corner(places[n]))
    for write in (make.slices, make.enhanced):
        with pytest.raises(InputError, match=words):
            isocodec.read(write(tmp_path / f"{write.__name__}.dcm", RAW, change))


def test_rounded_positions(tmp_path: Path, make: Any) -> None:
    places = (0, 1.002, 2, 2.999, 4)
    path = make.slices(tmp_path / "a", RAW, setter(ImagePositionPatient=lambda n: make.corner(places[n])))
    assert np.allclose(isocodec.read(path).placement.matrix, matrix(make)[0])


def test_copies_are_left_out(tmp_path: Path, make: Any) -> None:
    path = make.slices(tmp_path / "a", RAW)
    (path / "below").mkdir()
    shutil.copy(path / "002.dcm", path / "below" / "again.dcm")
    found = isocodec.read(path)
    assert np.array_equal(found.values, RAW.T) and found.remarks == ("copies of other slices are left out: 1",)


@pytest.mark.parametrize("kind", ["LOCALIZER", "AXIAL"])
def test_localizers_are_left_out(tmp_path: Path, make: Any, kind: str) -> None:
    path = make.slices(tmp_path / "a", RAW)
    make.slices(path / "scout", RAW[:1], setter(ImageType=["ORIGINAL", "PRIMARY", kind]), turned=(0, 1, 0, 0, 0, -1))
    found = isocodec.read(path)
    assert np.array_equal(found.values, RAW.T) and "left out: 1" in found.remarks[0]
    assert np.array_equal(isocodec.read(path, key="sagittal").values, RAW[0].T)


def test_series_are_chosen(tmp_path: Path, make: Any) -> None:
    import pydicom

    for number, (name, count) in enumerate({"thin": 5, "thick": 3, "": 2}.items(), 1):
        make.slices(tmp_path / f"{number}", RAW[:count] + number, setter(
            SeriesInstanceUID=f"1.2.{number}", SeriesNumber=number, SeriesDescription=name))
    (tmp_path / "notes.txt").write_text("nothing of DICOM")
    report = make.header(pydicom.uid.BasicTextSRStorage, 1, 1, np.dtype("u1"))
    for name in ("Rows", "Columns", "BitsAllocated"):
        delattr(report, name)
    report.save_as(tmp_path / "report.dcm", enforce_file_format=True)
    with pytest.raises(InputError, match=r"3 series: 1 thin \(CT, 5 slices, 1.2.1\), 2 thick"):
        isocodec.read(tmp_path)
    with pytest.raises(InputError, match="no series named 'none'"):
        isocodec.read(tmp_path, key="none")
    for key in ("2", "thick", "1.2.2"):
        found = isocodec.read(tmp_path, key=key)
        assert np.array_equal(found.values, RAW[:3].T + 2) and "files without samples" in found.remarks[0]


def test_series_of_one_description(tmp_path: Path, make: Any) -> None:
    """What two have names neither."""
    for number in (1, 2):
        make.slices(tmp_path / f"{number}", RAW + number, setter(
            SeriesInstanceUID=f"1.2.{number}", SeriesNumber=number, SeriesDescription="same"))
    with pytest.raises(InputError, match="2 series"):
        isocodec.read(tmp_path, key="same")
    assert np.array_equal(isocodec.read(tmp_path, key="2").values, RAW.T + 2)


def test_stacks_are_chosen(tmp_path: Path, make: Any) -> None:
    def change(flat: Any, number: int) -> None:
        flat.StackID = "left" if number < 5 else "right"
        flat.ImagePositionPatient = make.corner(number % 5 * (1 if number < 5 else 2))

    path = make.enhanced(tmp_path / "a.dcm", np.concatenate([RAW, RAW + 9]), change)
    with pytest.raises(InputError, match="'left-0' of 5, 'right-1' of 5"):
        isocodec.read(path)
    found = isocodec.read(path, key="right")
    assert np.array_equal(found.values, RAW.T + 9) and found.placement.matrix[2, 2] == 5


def test_a_slice_in_space(tmp_path: Path, make: Any) -> None:
    found = isocodec.read(make.slices(tmp_path / "a", RAW[:1]) / "000.dcm")
    assert np.array_equal(found.values, RAW[0].T) and found.placement.in_space
    assert np.allclose(found.placement.matrix, matrix(make)[0][:, [0, 1, 3]])


@pytest.mark.parametrize("between", [None, 2.5])
def test_frames_without_positions(tmp_path: Path, make: Any, between: float | None) -> None:
    made = make.header("1.2.840.10008.5.1.4.1.1.2", 6, 7, np.dtype("u2"))
    made.NumberOfFrames, made.PixelSpacing, made.Modality = 5, [0.75, 1.25], "CT"
    if between:
        made.SpacingBetweenSlices = between
    make.pixels(made, RAW)
    made.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    found = isocodec.read(tmp_path / "a.dcm")
    assert np.array_equal(found.values, RAW.T) and found.remarks == ("the positions of its slices are unknown",)
    assert (found.placement is None) == (between is None) and found.crs is None
    if between:
        assert np.allclose(found.placement.matrix, np.diag([1.25, 0.75, 2.5]) @ np.eye(3, 4))


def test_pictures_keep_their_spacing(tmp_path: Path, make: Any) -> None:
    made = make.header("1.2.840.10008.5.1.4.1.1.7", 6, 7, np.dtype("u2"))
    made.ImagerPixelSpacing = [0.75, 1.25]
    make.pixels(made, RAW[0])
    made.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    found = isocodec.read(tmp_path / "a.dcm")
    assert np.allclose(found.placement.matrix, [[1.25, 0, 0], [0, 0.75, 0]]) and found.placement.unit == "mm"


def test_films_are_series(tmp_path: Path, make: Any) -> None:
    made = make.header("1.2.840.10008.5.1.4.1.1.3.1", 6, 7, np.dtype("u1"))
    made.Modality, made.NumberOfFrames, made.FrameTime = "US", 5, 40
    make.pixels(made, RAW.astype("u1"))
    made.save_as(tmp_path / "film", enforce_file_format=True)
    with pytest.raises(InputError, match="differ by time"):
        isocodec.read(tmp_path / "film")
    assert np.array_equal(isocodec.read(tmp_path / "film", frame=3).values, RAW[3].astype("u1").T)


@pytest.mark.parametrize("name", ["IM{:04d}", "IM{}", "{}.IMA", "1.2.840.{}"])
def test_folders_as_they_lie_about(tmp_path: Path, make: Any, name: str) -> None:
    """Files without suffix, of other names, without positions, among others."""
    import pydicom

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


def test_files_that_are_refused(tmp_path: Path, make: Any) -> None:
    """Those without a preamble, deflated ones, samples in high bits of words, and volumes that only numbers order."""
    import pydicom

    path = make.slices(tmp_path / "a", RAW[:1]) / "000.dcm"
    pydicom.dcmwrite(tmp_path / "b.dcm", pydicom.Dataset(pydicom.dcmread(path)), implicit_vr=True, little_endian=True)
    made = pydicom.dcmread(path)
    made.file_meta.TransferSyntaxUID = pydicom.uid.DeflatedExplicitVRLittleEndian
    made.save_as(tmp_path / "c.dcm")
    made = pydicom.dcmread(path)
    made.BitsStored, made.HighBit = 12, 15
    made.save_as(tmp_path / "d.dcm")
    for name, words in (("b", "File Meta"), ("c", "deflated.* dcmconv"), ("d", "high bits of words")):
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / f"{name}.dcm")
    for number in (0, 1):
        change = setter(InstanceNumber=lambda n, first=5 * number: n + first)
        make.slices(tmp_path / "e", RAW, change, order=[2 * n + number for n in range(5)])
    with pytest.raises(InputError, match=r"several slices in one place.* dcm2niix"):
        isocodec.read(tmp_path / "e")
    change = setter(InstanceNumber=None, ImagePositionPatient=None)
    with pytest.raises(InputError, match="without positions or numbers"):
        isocodec.read(make.slices(tmp_path / "f", RAW, change))


def test_a_folder_without_slices(tmp_path: Path, make: Any) -> None:
    index = make.header("1.2.840.10008.1.3.10", 1, 1, np.dtype("u1"))
    del index.Rows, index.Columns
    index.save_as(tmp_path / "DICOMDIR", enforce_file_format=True)
    with pytest.raises(InputError, match="give a file or folder of slices"):
        isocodec.read(tmp_path)


def test_doses(tmp_path: Path, make: Any) -> None:
    made = make.header("1.2.840.10008.5.1.4.1.1.481.2", 6, 7, np.dtype("u4"))
    made.NumberOfFrames, made.PixelSpacing, made.DoseGridScaling, made.DoseUnits = 5, [0.75, 1.25], "0.001", "GY"
    made.ImageOrientationPatient, made.ImagePositionPatient = [*AXIAL], make.corner(0)
    made.GridFrameOffsetVector = [30, 32.5, 35, 37.5, 40]
    make.pixels(made, RAW.astype("u4"))
    made.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    found = isocodec.read(tmp_path / "a.dcm")
    assert np.array_equal(found.values, RAW.T * 0.001) and found.unit == "GY"
    assert np.allclose(found.placement.matrix, matrix(make)[0])


def test_units_of_values(tmp_path: Path, make: Any) -> None:
    assert isocodec.read(make.slices(tmp_path / "a", RAW, setter(RescaleType="HU"))).unit == "HU"
    assert isocodec.read(make.slices(tmp_path / "b", RAW, setter(RescaleType="US"))).unit is None


def test_parametric_maps(tmp_path: Path, make: Any) -> None:
    import pydicom

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


@pytest.mark.parametrize(("how", "gap", "step"), [
    ("BINARY", False, STEP), ("BINARY", True, (0, 0, -2.5)), ("LABELMAP", True, STEP),
    ("LABELMAP", False, (0, 0, -2.5)),
])
def test_segmentations(tmp_path: Path, make: Any, how: str, gap: bool, step: Any) -> None:
    """Slices without a segment are stored nowhere: those between are empty, as are one before and one behind."""
    import pydicom

    labels = LABELS.copy()
    labels[3] *= not gap
    path = make.segmentation(tmp_path / "a.dcm", labels, how, step=step)
    found, right = isocodec.read(path), labels[:: 1 if step == STEP else -1]
    inside = np.flatnonzero(right.any(axis=(1, 2)))
    assert np.array_equal(found.values, right[inside[0] - 1 : inside[-1] + 2].T)
    assert np.allclose(found.placement.matrix[:, 3], RAS @ make.corner(0 if step == STEP else 6, step))
    relabelled = pydicom.dcmread(path)
    relabelled.SeriesNumber = 3  # a number is that of a segment
    relabelled.save_as(path)
    for key, number in (("3", 3), ("organ 1", 1)):
        one = isocodec.read(path, key=key).values
        assert set(np.unique(one)) == {0, 1} and one.sum() == (labels == number).sum()
    with pytest.raises(InputError, match=r"1 'organ 1', .*3 'organ 3'"):
        isocodec.read(path, key="spleen")


def test_fractions_of_segments(tmp_path: Path, make: Any) -> None:
    path = make.segmentation(tmp_path / "a.dcm", LABELS, "FRACTIONAL", most=4)
    with pytest.raises(InputError, match="3 segments"):
        isocodec.read(path)
    found = isocodec.read(path, key="3").values
    assert found.dtype == np.float32 and set(np.unique(found)) == {0, 0.25}
    assert (found > 0).sum() == (LABELS == 3).sum()


def test_segments_that_overlap(tmp_path: Path, make: Any) -> None:
    import pydicom

    path = make.segmentation(tmp_path / "a.dcm", LABELS)
    made = pydicom.dcmread(path)
    made.PixelData = bytes([255]) * len(made.PixelData)
    made.save_as(path)
    with pytest.raises(InputError, match="segments overlap"):
        isocodec.read(path)
    assert isocodec.read(path, key="3").values.sum() == 2 * 42


def test_segmentations_of_highdicom(tmp_path: Path, make: Any) -> None:
    import highdicom
    import pydicom
    from pydicom.sr.codedict import codes

    source = []
    for path in sorted(make.slices(tmp_path / "ct", make.stored((7, 6, 7))).iterdir()):
        one = pydicom.dcmread(path)
        for name in ("PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber", "StudyID",
                     "ReferringPhysicianName", "PositionReferenceIndicator", "Manufacturer"):
            setattr(one, name, "")
        source.append(one)
    described = [highdicom.seg.SegmentDescription(number, f"s{number}", codes.SCT.Tissue, codes.SCT.Bone, "MANUAL")
                 for number in (1, 3)]
    made = highdicom.seg.Segmentation(
        source, LABELS, "LABELMAP", described, "1.2.9", 2, "1.2.10", 1, "m", "n", "1", "1")
    made.save_as(tmp_path / "a.dcm")
    theirs = highdicom.seg.segread(tmp_path / "a.dcm").get_volume(combine_segments=True).array.T
    found = isocodec.read(tmp_path / "a.dcm")
    assert found.mask is None
    ours = found.values[..., 1:-1] if found.values.shape != theirs.shape else found.values
    assert np.array_equal(ours, theirs) or np.array_equal(ours[..., ::-1], theirs)


@pytest.mark.parametrize("kind", ["slice", "enhanced", "BINARY", "LABELMAP", "RLE"])
def test_files_cut_short(tmp_path: Path, make: Any, kind: str) -> None:
    if kind in ("BINARY", "LABELMAP"):
        path = make.segmentation(tmp_path / "a.dcm", LABELS, kind)
    elif kind == "slice":
        path = make.slices(tmp_path / "a", RAW[:1]) / "000.dcm"
    else:
        path = make.enhanced(tmp_path / "a.dcm", RAW)
    if kind == "RLE":
        import pydicom

        made = pydicom.dcmread(path)
        made.compress(pydicom.uid.RLELossless)
        made.save_as(path)
    data, cut = path.read_bytes(), tmp_path / "b.dcm"
    last = len(data) - 16 * (kind == "RLE")
    for size in (0, 140, len(data) // 3, len(data) // 2, *range(len(data) - 40, last - 2, 3)):
        cut.write_bytes(data[:size])
        with pytest.raises(InputError):
            isocodec.read(cut)


@pytest.mark.parametrize("how", ["none", "groups", "frames"])
def test_headers_that_do_not_fit(tmp_path: Path, make: Any, how: str) -> None:
    import pydicom

    made = pydicom.dcmread(make.enhanced(tmp_path / "a.dcm", RAW))
    if how == "none":
        del made.PixelData
    elif how == "groups":
        del made.PerFrameFunctionalGroupsSequence[4]
    else:
        made.NumberOfFrames = 1 << 20
    made.save_as(tmp_path / "a.dcm")
    with pytest.raises(InputError, match=r"a\.dcm"):
        isocodec.read(tmp_path / "a.dcm")


def test_pictures_of_tiles_are_refused(tmp_path: Path, make: Any) -> None:
    path = make.enhanced(tmp_path / "a.dcm", RAW, setter(TotalPixelMatrixRows=12, TotalPixelMatrixColumns=14))
    with pytest.raises(InputError, match="tiles"):
        isocodec.read(path)


def test_a_decoder_that_is_missing_is_named(tmp_path: Path, make: Any) -> None:
    import pydicom

    made = pydicom.dcmread(make.slices(tmp_path / "a", RAW[:1]) / "000.dcm")
    made.compress(pydicom.uid.RLELossless)
    made.file_meta.TransferSyntaxUID = pydicom.uid.MPEG2MPML
    made.save_as(tmp_path / "b.dcm")
    with pytest.raises(InputError, match="MPEG2"):
        isocodec.read(tmp_path / "b.dcm")


def test_files_that_pydicom_ships() -> None:
    """Slices, frames, doses, colours, and every compression that can be decoded here."""
    import pydicom
    from pydicom.pixels import apply_color_lut, apply_modality_lut

    read = 0
    for path in sorted((Path(pydicom.__file__).parent / "data" / "test_files").glob("*.dcm"))[::2]:
        try:
            made = pydicom.dcmread(path)
            right = made.pixel_array
        except Exception:
            with pytest.raises(InputError):
                isocodec.read(path)
            continue
        palette = made.PhotometricInterpretation == "PALETTE COLOR"
        coloured = made.SamplesPerPixel > 1 or palette
        try:
            found = isocodec.read(path, band=1 if coloured else None)
        except InputError as error:
            names = "liver_1frame.dcm", "liver_expb_1frame.dcm", "SC_rgb_jpeg.dcm"
            assert "take one with --frame" in f"{error}" or path.name in names, path
            continue
        right = apply_color_lut(right, made) if palette else right
        right = right[..., 0] if coloured else apply_modality_lut(right, made) * float(made.get("DoseGridScaling", 1))
        if "SegmentationType" not in made:
            assert np.array_equal(found.values, right.T), path
            read += 1
    assert read > 20


def test_what_is_a_volume() -> None:
    from isocodec.io.slices import is_volume

    assert is_volume(SimpleNamespace(affine=0, coordinate_system=0)) and not is_volume(SimpleNamespace(affine=0))
