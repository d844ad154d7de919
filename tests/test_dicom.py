"""DICOM: kinds of files by attributes, against pydicom, SimpleITK (GDCM) and highdicom."""

from __future__ import annotations

import shutil
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import highdicom
import numpy as np
import pydicom
import pytest
import SimpleITK
from isocodec.io.readers.input_formats import open_file
from pydicom.pixels import apply_modality_lut
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ImplicitVRLittleEndian,
    JPEG2000Lossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    PositronEmissionTomographyImageStorage,
    RLELossless,
)

import isocodec
from commands import ok
from dicom_files import AXIAL, BETWEEN, SHAPE, STEP, corner, enhanced, header, pixels, segmentation, slices, stored
from isocodec.errors import InputError, LimitError, OptionError

RAW = stored()
SIGNED = stored(dtype="i2") - 2000
RAS = np.diag([-1.0, -1, 1])
TILT = (1.0, 0, 0, 0, np.cos(0.3), np.sin(0.3))
OBLIQUE = tuple(np.round(np.linalg.qr(np.array([[1, 0.3, 0.2], [-0.2, 1, 0.4], [0.1, 0.2, 1]]))[0][:2].ravel(), 12))
NORMAL = np.cross(OBLIQUE[:3], OBLIQUE[3:])


def setter(**attributes: Any) -> Callable[[Any, int], None]:
    """Give all slices attributes; a function makes that of a number."""

    def change(made: Any, number: int) -> None:
        for name, value in attributes.items():
            setattr(made, name, value(number) if callable(value) else value)

    return change


VALUES: dict[str, tuple[Any, Callable[[Any, int], None]]] = {
    "as stored": (RAW, setter()),
    "signed": (SIGNED, setter()),
    "bytes": (RAW.astype("u1"), setter()),
    "whole intercept": (RAW, setter(RescaleIntercept=-1024)),
    "whole slope": (SIGNED, setter(RescaleSlope=3, RescaleIntercept=-7)),
    "fraction": (RAW, setter(RescaleSlope="0.0015", RescaleIntercept="0.25")),
    "fraction of one": (SIGNED, setter(RescaleSlope="1", RescaleIntercept="0.5")),
    "slopes of slices": (RAW, setter(RescaleSlope=lambda n: f"{0.5 + n / 10:g}")),
    "one other slope": (RAW, setter(RescaleSlope=lambda n: 2 if n == 3 else 1)),
    "intercepts of slices": (RAW, setter(RescaleIntercept=lambda n: 0 if n == 0 else -1024)),
    "inverted": (RAW, setter(PhotometricInterpretation="MONOCHROME1")),
}
PLACES: dict[str, dict[str, Any]] = {
    "axial": {}, "reversed": {"order": (4, 3, 2, 1, 0)}, "shuffled": {"order": (2, 0, 4, 1, 3)},
    "downwards": {"step": (0, 0, -2.5)}, "coronal": {"turned": (1, 0, 0, 0, 0, -1), "step": (0, 2, 0)},
    "sagittal": {"turned": (0, 1, 0, 0, 0, -1), "step": (-3, 0, 0)},
    "mirrored": {"turned": (-1, 0, 0, 0, 1, 0)}, "oblique": {"turned": OBLIQUE, "step": tuple(2 * NORMAL)},
    "tilted": {"turned": TILT},
}


def truth(samples: Any, change: Callable[[Any, int], None]) -> Any:
    """Values by pydicom, slice by slice, (i, j, k)."""
    out = []
    for number, one in enumerate(samples):
        made = pydicom.Dataset()
        made.RescaleSlope, made.RescaleIntercept = 1, 0
        change(made, number)
        out.append(apply_modality_lut(one, made))
    return np.array(out).T


def in_order(turned: Any = AXIAL, step: Any = STEP, **_: Any) -> bool:
    """Whether the slices follow one another along their normal."""
    return float(np.dot(np.cross(turned[:3], turned[3:]), step)) > 0


def matrix(turned: Any = AXIAL, step: Any = STEP, **_: Any) -> Any:
    """Placement by the tags, for slices in their order."""
    first = corner(0, step) if in_order(turned, step) else corner(SHAPE[0] - 1, step)
    step = np.array(step) * (1 if in_order(turned, step) else -1)
    return RAS @ np.column_stack([np.array(turned[:3]) * BETWEEN[1], np.array(turned[3:]) * BETWEEN[0], step, first])


@pytest.mark.parametrize("kind", ["folder", "PET", "enhanced", "one slice"])
@pytest.mark.parametrize("name", VALUES)
def test_values(tmp_path: Path, name: str, kind: str) -> None:
    samples, change = VALUES[name]
    storage = {"storage": PositronEmissionTomographyImageStorage} if kind == "PET" else {}
    if kind == "enhanced":
        path = enhanced(tmp_path / "a.dcm", samples, change)
    else:
        path = slices(tmp_path / "a", samples[:1] if kind == "one slice" else samples, change, **storage)
    found = isocodec.read(path)
    right = truth(samples[:1] if kind == "one slice" else samples, change)
    right = right[..., 0] if kind == "one slice" else right
    assert np.array_equal(found.values, right)
    floats = name in ("fraction", "fraction of one", "slopes of slices")
    assert found.values.dtype == np.float64 if floats else found.values.dtype.kind in "iu"
    assert found.mask is None


@pytest.mark.parametrize("kind", ["folder", "enhanced", "enhanced in a folder"])
@pytest.mark.parametrize("name", PLACES)
def test_places(tmp_path: Path, name: str, kind: str) -> None:
    """Against the tags, GDCM of folders, and highdicom of volumes that it takes."""
    where = PLACES[name]
    if kind == "folder":
        path = slices(tmp_path / "a", RAW, **where)
    else:
        path = enhanced(tmp_path / "a.dcm", RAW, **where)
        path = path if kind == "enhanced" else tmp_path
    found = isocodec.read(path)
    assert np.array_equal(found.values, RAW.T if in_order(**where) else RAW.T[..., ::-1])
    assert np.allclose(found.placement.matrix, matrix(**where), atol=1e-9)
    if kind == "folder" and name != "tilted":  # GDCM has no shear
        reader = SimpleITK.ImageSeriesReader()
        reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path)))
        image = reader.Execute()
        ends = [image.TransformIndexToPhysicalPoint(index) for index in ((0, 0, 0), (6, 5, 4))]
        assert np.allclose(found.placement.place(np.array([[0, 0, 0], [6, 5, 4.0]])), ends @ RAS, atol=1e-6)
    if kind != "folder" and name not in ("tilted",):
        volume = highdicom.imread(next(tmp_path.glob("*.dcm"))).get_volume()
        corners = np.array([[0, 0, 0, 1], [4, 0, 0, 1], [4, 5, 6, 1.0]])
        theirs = (volume.affine @ corners.T)[:3].T @ RAS
        mine = found.placement.place(corners[:, [2, 1, 0]])
        back = found.placement.place((corners[:, [2, 1, 0]] * [1, 1, -1]) + [0, 0, 4])
        assert np.allclose(mine, theirs, atol=1e-6) or np.allclose(back, theirs, atol=1e-6)


@pytest.mark.parametrize("syntax", [
    ImplicitVRLittleEndian, ExplicitVRBigEndian, DeflatedExplicitVRLittleEndian, RLELossless, JPEGLSLossless,
    JPEG2000Lossless,
], ids=lambda each: str(each.name))
@pytest.mark.parametrize("kind", ["folder", "enhanced"])
def test_syntaxes(tmp_path: Path, kind: str, syntax: Any) -> None:
    path = (slices if kind == "folder" else enhanced)(tmp_path / "a.dcm", SIGNED, setter(RescaleIntercept=-24))
    for each in [path] if kind == "enhanced" else sorted(path.iterdir()):
        made = pydicom.dcmread(each)
        made.ImageType = ["ORIGINAL", "PRIMARY"]
        if syntax.is_encapsulated:
            try:
                made.compress(syntax, generate_instance_uid=False)
            except (RuntimeError, ValueError) as error:
                pytest.skip(str(error)[:80])
            made.save_as(each)
        else:
            made.file_meta.TransferSyntaxUID = syntax
            del made.ImageType, made.PixelData
            made.PixelData = SIGNED[int(each.stem)].tobytes() if kind == "folder" else SIGNED.tobytes()
            made["PixelData"].VR = "OW"
            if syntax == ExplicitVRBigEndian:
                made.PixelData = np.frombuffer(made.PixelData, "i2").byteswap().tobytes()
            made.preamble = bytes(128)
            pydicom.dcmwrite(each, made, implicit_vr=syntax.is_implicit_VR, little_endian=syntax.is_little_endian,
                             force_encoding=True)
    assert np.array_equal(isocodec.read(path).values, SIGNED.T.astype(int) - 24)


def test_a_decoder_that_is_missing_is_named(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW[:1])
    made = pydicom.dcmread(path / "000.dcm")
    made.compress(RLELossless)
    made.file_meta.TransferSyntaxUID = JPEGLosslessSV1
    made.save_as(tmp_path / "b.dcm")
    if pydicom.pixels.get_decoder(JPEGLosslessSV1).is_available:
        pytest.skip("a decoder is installed")
    with pytest.raises(InputError, match="JPEG Lossless") as caught:
        isocodec.read(tmp_path / "b.dcm")
    assert "pylibjpeg" in caught.value.remedy


@pytest.mark.parametrize("kind", ["folder", "enhanced"])
@pytest.mark.parametrize("scale", [1, "0.5"])
@pytest.mark.parametrize("dtype", ["u2", "i2"])
def test_padding_is_missing(tmp_path: Path, kind: str, scale: Any, dtype: str) -> None:
    """A value, and a range of them whichever end comes first; 63536 is how some write -2000."""
    samples = stored(dtype=dtype) - (2000 if dtype == "i2" else 0)
    low, high = int(samples.min()), int(np.sort(samples.ravel())[20])
    make = slices if kind == "folder" else enhanced
    for name, ends in {"a.dcm": (low, None), "b.dcm": (low, high), "c.dcm": (high, low)}.items():
        given = {"PixelPaddingValue": ends[0], "PixelPaddingRangeLimit": ends[1], "RescaleSlope": scale}

        def change(made: Any, number: int, given: dict[str, Any] = given, dtype: str = dtype) -> None:
            for each, value in given.items():
                if value is not None and each != "RescaleSlope":
                    made.add_new(each, "SS" if dtype == "i2" else "US", value)
            made.RescaleSlope = given["RescaleSlope"]

        found = isocodec.read(make(tmp_path / name, samples, change))
        right = (samples >= low) & (samples <= (low if ends[1] is None else high))
        assert np.array_equal(found.mask, right.T)
        assert np.array_equal(found.values, samples.T * float(scale))
        assert isocodec.read(tmp_path / name, nodata=float("nan")).mask is None


def test_padding_with_the_other_sign(tmp_path: Path) -> None:
    samples = SIGNED.copy()
    samples[:, 0] = -2000
    path = slices(tmp_path / "a", samples, lambda made, number: made.add_new("PixelPaddingValue", "US", 63536))
    assert np.array_equal(isocodec.read(path).mask, (samples == -2000).T)


def test_bits_that_are_not_used(tmp_path: Path) -> None:
    """Overlays in the high bits, and signs in the last bit that is used, as GDCM reads them."""
    for dtype, low in (("u2", 0), ("i2", -2048)):
        samples = (stored(dtype=dtype) % 4096 + low).astype(dtype)
        words = (samples.view("u2") & 0x0FFF) | np.where(np.arange(samples.size).reshape(SHAPE) % 3 == 0, 0xF000, 0)
        change = setter(BitsStored=12, HighBit=11, PixelRepresentation=int(low < 0))
        path = slices(tmp_path / dtype, words.astype("u2"), change)
        found = isocodec.read(path).values
        assert np.array_equal(found, samples.T)
        reader = SimpleITK.ImageSeriesReader()
        reader.SetFileNames(sorted(map(str, path.iterdir())))
        assert np.array_equal(found, SimpleITK.GetArrayFromImage(reader.Execute()).T)


def test_tables(tmp_path: Path) -> None:
    def change(made: Any, number: int) -> None:
        table = pydicom.Dataset()
        table.LUTDescriptor, table.ModalityLUTType = [256, 0, 16], "US"
        table.add_new("LUTData", "US", [5 * n + number for n in range(256)])
        made.ModalityLUTSequence = [table]
        del made.RescaleSlope, made.RescaleIntercept

    found = isocodec.read(slices(tmp_path / "a", RAW.astype("u1"), change)).values
    assert np.array_equal(found, (5 * RAW.astype("u1").astype(int) + np.arange(5)[:, None, None]).T)


def test_colours_are_chosen_as_of_pictures(tmp_path: Path) -> None:
    samples = stored((*SHAPE, 3), "u1")
    path = slices(tmp_path / "rgb", samples, setter(
        SamplesPerPixel=3, PhotometricInterpretation="RGB", PlanarConfiguration=0))
    with pytest.raises(InputError, match="3 channels"):
        isocodec.read(path)
    for channel in range(3):
        assert np.array_equal(isocodec.read(path, channel=channel).values, samples[..., channel].T)
    with pytest.raises(OptionError):
        isocodec.read(path, channel=3)

    def palette(made: Any, number: int) -> None:
        made.PhotometricInterpretation = "PALETTE COLOR"
        for factor, name in ((1, "Red"), (2, "Green"), (3, "Blue")):
            setattr(made, f"{name}PaletteColorLookupTableDescriptor", [256, 0, 16])
            setattr(made, f"{name}PaletteColorLookupTableData", (np.arange(256) * factor).astype("<u2").tobytes())

    path = slices(tmp_path / "palette", RAW.astype("u1"), palette)
    with pytest.raises(InputError, match="3 channels"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, channel=2).values, 3 * RAW.astype("u1").T.astype(int))


def two(make: Any, path: Path, changes: Any, samples: Any = (RAW, RAW + 1)) -> Path:
    """Two volumes in one place."""
    if make is enhanced:
        def change(flat: Any, number: int) -> None:
            flat.ImagePositionPatient = corner(number % 5)
            setter(**{name: values[number // 5] for name, values in changes.items()})(flat, number)

        return enhanced(path, np.concatenate(samples), change, order=(4, 0, 2, 8, 9, 1, 3, 6, 7, 5))
    for number in (0, 1):
        given = {name: values[number] for name, values in changes.items()}
        slices(path, samples[number], setter(**given), order=[2 * n + number for n in range(5)])
    return path


@pytest.mark.parametrize(("make", "changes"), [
    (slices, {"TemporalPositionIdentifier": (7, 11)}), (slices, {"EchoTime": (10, 4.5)}),
    (slices, {"AcquisitionNumber": (1, 2)}), (slices, {"AcquisitionTime": ("101010", "101011")}),
    (slices, {"ImageType": (["ORIGINAL", "PRIMARY", "M"], ["ORIGINAL", "PRIMARY", "P"])}),
    (slices, {"InstanceNumber": (lambda n: n + 1, lambda n: n + 6)}),
    (slices, {"InstanceNumber": (lambda n: 2 * n + 1, lambda n: 2 * n + 2)}),
    (enhanced, {"TemporalPositionIndex": (1, 2)}),
])
def test_volumes_in_one_place_are_frames(tmp_path: Path, make: Any, changes: Any) -> None:
    path = two(make, tmp_path / "a.dcm", changes)
    with pytest.raises(InputError, match=next(iter(changes))) as caught:
        isocodec.read(path)
    assert "--frame 0 to 1" in caught.value.remedy
    (one, other), swapped = (RAW, RAW + 1), changes.get("EchoTime") == (10, 4.5)
    for frame, right in enumerate((other, one) if swapped else (one, other)):
        found = isocodec.read(path, frame=frame)
        assert np.array_equal(found.values, right.T)
        assert np.allclose(found.placement.matrix, matrix())
    every = [each.values for each in isocodec.read(path, frames=True).fields]
    assert len(every) == 2
    assert np.array_equal(every[0], (other if swapped else one).T)


@pytest.mark.parametrize("order", [range(10), [n // 2 + n % 2 * 5 for n in range(10)]])
def test_frames_that_nothing_tells_apart_follow_one_another(tmp_path: Path, order: Any) -> None:
    """Volume after volume, or slice after slice; in any other order they might be mixed."""
    every = np.concatenate([RAW, RAW + 1])

    def change(flat: Any, number: int) -> None:
        flat.ImagePositionPatient = corner(number % 5)

    path = enhanced(tmp_path / "a.dcm", every, change, order=order)
    for frame in (0, 1):
        assert np.array_equal(isocodec.read(path, frame=frame).values, RAW.T + frame)
    path = enhanced(tmp_path / "b.dcm", every, change, order=(4, 0, 2, 8, 9, 1, 3, 6, 7, 5))
    with pytest.raises(InputError, match="several slices in one place"):
        isocodec.read(path, frame=0)


def test_a_volume_that_lacks_a_slice(tmp_path: Path) -> None:
    path = two(slices, tmp_path / "a", {"TemporalPositionIdentifier": (1, 2)})
    (path / "005.dcm").unlink()
    with pytest.raises(InputError, match="slice 2") as caught:
        isocodec.read(path, frame=0)
    assert "TemporalPositionIdentifier" in caught.value.message


def without(path: Path, *names: str) -> Path:
    for name in names:
        (path / name).unlink()
    return path


@pytest.mark.parametrize("kind", ["folder", "enhanced"])
def test_gaps_copies_and_jitter(tmp_path: Path, kind: str) -> None:
    def at(places: Any, name: str) -> Path:
        make = slices if kind == "folder" else enhanced
        return make(tmp_path / f"{name}.dcm", RAW, setter(ImagePositionPatient=lambda n: corner(places[n])))

    def refused(path: Path, *words: str) -> InputError:
        with pytest.raises(InputError) as caught:
            isocodec.read(path)
        assert caught.value.code == "slices"
        for word in words:
            assert word in f"{caught.value}"
        return caught.value

    files = {n: f"00{n}.dcm" if kind == "folder" else f"frame {n} of " for n in range(5)}
    refused(at((0, 1, 3, 4, 5), "gap"), "5 mm between slices 1 and 2", "2.5 mm", files[1], files[2], "missing 1")
    refused(at((0, 1, 2, 5, 6), "wide"), "7.5 mm between slices 2 and 3", files[2], files[3], "missing 2")
    refused(at((0, 1, 1, 2, 3), "twice"), "in one place", files[1], files[2], "slice 1")
    jitter = at((0, 1.1, 2, 3, 4), "jitter")
    refused(jitter, "2.75 mm between slices 0 and 1", "--slice-tolerance 0.25")
    with pytest.raises(InputError):
        isocodec.read(jitter, slice_tolerance=0.2)
    with pytest.warns(UserWarning, match=r"0\.25 mm from even steps"):
        found = isocodec.read(jitter, slice_tolerance=0.26)
    assert np.allclose(found.placement.matrix, matrix())
    assert np.allclose(isocodec.read(at((0, 1.002, 2, 2.999, 4), "rounded")).placement.matrix, matrix())
    ok("encode", jitter, "-o", tmp_path / "a.iso", "--isovalue", 500, "--slice-tolerance", 0.26)


def test_identical_copies_are_left_out(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW)
    (path / "below").mkdir()
    shutil.copy(path / "002.dcm", path / "below" / "again.dcm")
    with pytest.warns(UserWarning, match="left out: 1"):
        assert np.array_equal(isocodec.read(path).values, RAW.T)


def test_series_are_chosen_by_number_description_and_uid(tmp_path: Path) -> None:
    path = tmp_path / "all"
    path.mkdir()
    for number, (name, count) in enumerate({"thin": 5, "thick": 3, "": 2}.items(), 1):
        slices(path / f"{number}", RAW[:count] + number, setter(
            SeriesInstanceUID=f"1.2.{number}", SeriesNumber=number, SeriesDescription=name))
    (path / "notes.txt").write_text("nothing of DICOM")
    report = header(pydicom.uid.BasicTextSRStorage, 1, 1, np.dtype("u1"))
    for name in ("Rows", "Columns", "BitsAllocated"):
        delattr(report, name)
    report.save_as(path / "report.dcm", enforce_file_format=True)
    with pytest.raises(InputError) as caught:
        isocodec.read(path)
    listed = ("3 series", "1 thin (CT, 5 slices, 1.2.1)", "2 thick (CT, 3 slices, 1.2.2)", "3 (CT, 2 slices, 1.2.3)")
    for words in listed:
        assert words in caught.value.message
    for key in ("2", "thick", "1.2.2"):
        with pytest.warns(UserWarning, match="files without samples are left out: 1"):
            assert np.array_equal(isocodec.read(path, key=key).values, RAW[:3].T + 2)
    with pytest.raises(InputError, match="no series 'none'"):
        isocodec.read(path, key="none")


def test_links_elsewhere_need_to_be_followed(tmp_path: Path) -> None:
    path, away = slices(tmp_path / "a", RAW[:4]), slices(tmp_path / "b", RAW)
    (path / "004.dcm").symlink_to(away / "004.dcm")
    with pytest.raises(InputError, match="links to another folder"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, follow=True).values, RAW.T)
    without(path, "004.dcm")
    (path / "more").symlink_to(away)
    (path / "round").symlink_to(path)
    assert np.array_equal(isocodec.read(path).values, RAW[:4].T)


@pytest.mark.parametrize("marked", [True, False])
def test_localizers_are_left_out(tmp_path: Path, marked: bool) -> None:
    path = slices(tmp_path / "a", RAW)
    slices(path / "scout", RAW[:1], setter(ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER" if marked else "AXIAL"]),
           turned=(0, 1, 0, 0, 0, -1))
    with pytest.warns(UserWarning, match="left out: 1"):
        assert np.array_equal(isocodec.read(path).values, RAW.T)
    assert np.array_equal(isocodec.read(path, key="sagittal").values, RAW[0].T)


def test_stacks_are_chosen(tmp_path: Path) -> None:
    def change(flat: Any, number: int) -> None:
        flat.StackID = "left" if number < 5 else "right"
        flat.ImagePositionPatient = corner(number % 5 * (1 if number < 5 else 2))

    path = enhanced(tmp_path / "a.dcm", np.concatenate([RAW, RAW + 9]), change)
    with pytest.raises(InputError, match="'left' of 5; 'right' of 5"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, key="right").values, RAW.T + 9)
    assert isocodec.read(path, key="right").placement.matrix[2, 2] == 5
    folder = slices(tmp_path / "b", RAW)
    slices(folder / "more", RAW, turned=(1, 0, 0, 0, 0, -1), step=(0, 2, 0))
    with pytest.raises(InputError, match="'axial' of 5; 'coronal' of 5"):
        isocodec.read(folder)
    assert isocodec.read(folder, key="coronal").placement.matrix[2, 1] == -0.75


def test_a_slice_keeps_its_spacing(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW[:1]) / "000.dcm"
    plane = isocodec.read(path).placement
    assert plane.in_space and np.allclose(np.linalg.norm(plane.matrix[:, :2], axis=0), (1.25, 0.75), rtol=1e-12)


def test_frames_without_positions_keep_their_spacing(tmp_path: Path) -> None:
    made = header(pydicom.uid.CTImageStorage, 6, 7, np.dtype("u2"))
    made.NumberOfFrames, made.PixelSpacing, made.Modality = 5, [*BETWEEN], "CT"
    pixels(made, RAW.astype("u2"))
    for between in (None, 2.5):
        if between is not None:
            made.SpacingBetweenSlices = between
        made.save_as(tmp_path / "a.dcm", enforce_file_format=True)
        place = isocodec.read(tmp_path / "a.dcm").placement
        assert (place is None) == (between is None) or not place.placed
    assert np.allclose(place.matrix, np.diag([BETWEEN[1], BETWEEN[0], 2.5]) @ np.eye(3, 4)) and place.unit == "mm"


def test_slices_of_one_uid_are_no_copies(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW, setter(SOPInstanceUID="1.2.3.4"))
    assert np.array_equal(isocodec.read(path).values, RAW.T)


def test_files_without_a_preamble(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW)
    for each in path.iterdir():
        made = pydicom.dcmread(each)
        with each.open("wb") as file:
            pydicom.filewriter.write_dataset(writer := pydicom.filebase.DicomFileLike(file), _plain(made, writer))
    assert np.array_equal(isocodec.read(path).values, RAW.T)
    assert np.array_equal(isocodec.read(path / "002.dcm").values, RAW[2].T)


def _plain(made: Any, writer: Any) -> Any:
    writer.is_implicit_VR, writer.is_little_endian = True, True
    return made


def test_padding_in_tiles_and_slices(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW, lambda made, number: made.add_new("PixelPaddingValue", "US", int(RAW[1, 2, 3])))
    with open_file(path) as opened:
        assert opened.windows() is None and np.array_equal(opened.field().mask, (RAW[1, 2, 3] == RAW).T)
    frames = isocodec.read(path, frames=True, axis=2).fields
    assert [0 if each.mask is None else int(each.mask.sum()) for each in frames] == [0, 1, 0, 0, 0]


def test_parametric_maps(tmp_path: Path) -> None:
    """Floats, and real-world values where nothing else is stated."""
    values = RAW.astype("f4") / 3

    def change(flat: Any, number: int) -> None:
        del flat.RescaleSlope, flat.RescaleIntercept
        flat.RealWorldValueSlope, flat.RealWorldValueIntercept = 2.0, 0.5

    path = enhanced(tmp_path / "a.dcm", values, change)
    made = pydicom.dcmread(path)
    made.FloatPixelData = values.tobytes()
    del made.PixelData
    made.BitsAllocated = 32
    made.save_as(path)
    assert np.allclose(isocodec.read(path).values, values.T * 2.0 + 0.5, rtol=1e-12)


def test_dose_grids(tmp_path: Path) -> None:
    made = header(pydicom.uid.RTDoseStorage, 6, 7, np.dtype("u4"))
    made.NumberOfFrames, made.PixelSpacing, made.DoseGridScaling, made.DoseUnits = 5, [*BETWEEN], "0.001", "GY"
    made.ImageOrientationPatient, made.ImagePositionPatient = [*AXIAL], corner(0)
    made.GridFrameOffsetVector = [30, 32.5, 35, 37.5, 40]
    pixels(made, RAW.astype("u4"))
    made.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    found = isocodec.read(tmp_path / "a.dcm")
    assert np.array_equal(found.values, RAW.T * 0.001)
    assert found.unit == "GY"
    assert np.allclose(found.placement.matrix, matrix())


def test_files_that_pydicom_ships() -> None:
    """Slices, frames, dose grids, colours, and every compression that can be decoded here."""
    home, read = Path(pydicom.__file__).parent / "data" / "test_files", 0
    for path in sorted(home.glob("*.dcm")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                made = pydicom.dcmread(path)
                right = made.pixel_array
            except Exception:
                with pytest.raises(InputError):
                    isocodec.read(path)
                continue
            coloured = made.SamplesPerPixel > 1 or made.PhotometricInterpretation == "PALETTE COLOR"
            try:
                found = isocodec.read(path, channel=0 if coloured else None)
            except InputError as error:
                assert "take one with --frame" in f"{error}" or path.name in (
                    "SC_rgb_jpeg.dcm", "liver_1frame.dcm", "liver_expb_1frame.dcm"), path
                continue
        if made.PhotometricInterpretation == "PALETTE COLOR":
            right = pydicom.pixels.apply_color_lut(right, made)
        right = right[..., 0] if coloured else apply_modality_lut(right, made) * float(made.get("DoseGridScaling", 1))
        if "SegmentationType" not in made:
            assert np.array_equal(found.values, right.T), path
            read += 1
    assert read > 50


LABELS = np.zeros((7, 6, 7), np.uint8)
LABELS[1:5, 1:4, 1:4], LABELS[2:4, 4:, 2:], LABELS[5, 1, 1] = 1, 3, 1


@pytest.mark.parametrize("how", ["BINARY", "LABELMAP"])
@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("step", [STEP, (0, 0, -2.5)])
def test_segmentations(tmp_path: Path, how: str, gap: bool, step: Any) -> None:
    """Slices without a segment are stored nowhere; those between are empty, as are one before and one behind."""
    labels = LABELS.copy()
    labels[3] *= not gap
    path = segmentation(tmp_path / "a.dcm", labels, how, step=step)
    found = isocodec.read(path)
    right = labels[:: 1 if step == STEP else -1]
    inside = np.flatnonzero(right.any(axis=(1, 2)))
    right = right[inside[0] - 1 : inside[-1] + 2]
    assert np.array_equal(found.values, right.T)
    first = corner(0 if step == STEP else 6, step)
    assert np.allclose(found.placement.matrix[:, 3], RAS @ first)
    assert np.allclose(found.placement.matrix[:, :3], matrix()[:, :3])
    for key, number in (("3", 3), ("organ 1", 1)):
        one = isocodec.read(path, key=key).values
        assert set(np.unique(one)) == {0, number}
        assert (one > 0).sum() == (labels == number).sum()
    with pytest.raises(InputError, match="1 'organ 1'; 3 'organ 3'"):
        isocodec.read(path, key="spleen")


def test_segmentations_of_highdicom(tmp_path: Path) -> None:
    from pydicom.sr.codedict import codes

    source = []
    for path in sorted(slices(tmp_path / "ct", stored((7, 6, 7))).iterdir()):
        one = pydicom.dcmread(path)
        for name in ("PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber", "StudyID",
                     "ReferringPhysicianName", "PositionReferenceIndicator", "Manufacturer"):
            setattr(one, name, "")
        source.append(one)
    for how in ("BINARY", "LABELMAP"):
        described = [
            highdicom.seg.SegmentDescription(number, f"s{number}", codes.SCT.Tissue, codes.SCT.Bone, "MANUAL")
            for number in ((1, 3) if how == "LABELMAP" else (1, 2))
        ]
        labels = LABELS if how == "LABELMAP" else np.stack([LABELS == 1, LABELS == 3], -1)
        made = highdicom.seg.Segmentation(source, labels, how, described, "1.2.9", 2, "1.2.10", 1, "m", "n", "1", "1")
        made.save_as(tmp_path / f"{how}.dcm")
        volume = highdicom.seg.segread(tmp_path / f"{how}.dcm").get_volume(combine_segments=True)
        found = isocodec.read(tmp_path / f"{how}.dcm")
        theirs = volume.array.T
        ours = found.values[..., 1:-1] if found.values.shape != theirs.shape else found.values
        assert np.array_equal(ours, theirs) or np.array_equal(ours[..., ::-1], theirs)
        ok("encode", tmp_path / f"{how}.dcm", "--label", 1, "-o", tmp_path / "a.iso")


def test_segmentations_that_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="FRACTIONAL"):
        isocodec.read(segmentation(tmp_path / "a.dcm", LABELS, "FRACTIONAL"))
    path = segmentation(tmp_path / "b.dcm", LABELS)
    made = pydicom.dcmread(path)
    made.PixelData = bytes([255]) * len(made.PixelData)
    made.save_as(path)
    with pytest.raises(InputError, match="segments 1 and 3 overlap") as caught:
        isocodec.read(path)
    assert "--key" in caught.value.remedy
    assert (isocodec.read(path, key="3").values == 3).sum() == 2 * 42


@pytest.mark.parametrize("how", ["cut", "short", "frames", "none", "groups", "encapsulated"])
def test_damaged_pixels_are_errors(tmp_path: Path, how: str) -> None:
    path = enhanced(tmp_path / "a.dcm", RAW)
    data = path.read_bytes()
    made = pydicom.dcmread(path)
    if how == "cut":
        path.write_bytes(data[:-10])
    elif how == "encapsulated":
        made.compress(RLELossless)
        made.save_as(path)
        path.write_bytes(path.read_bytes()[:-60])
    else:
        if how == "short":
            made.PixelData = made.PixelData[:-2]
        elif how == "frames":
            made.NumberOfFrames = 2**31 - 1
        elif how == "none":
            del made.PixelData
        elif how == "groups":
            del made.PerFrameFunctionalGroupsSequence[4]
        made.save_as(path)
    with pytest.raises(InputError) as caught:
        isocodec.read(path)
    assert caught.value.source.endswith("a.dcm")


@pytest.mark.parametrize("kind", ["slice", "enhanced", "BINARY", "LABELMAP", "long"])
def test_each_cut_is_an_error(tmp_path: Path, kind: str) -> None:
    if kind in ("BINARY", "LABELMAP"):
        path = segmentation(tmp_path / "a.dcm", LABELS, kind)
    elif kind == "slice":
        path = slices(tmp_path / "a", RAW[:1]) / "000.dcm"
    else:
        path = enhanced(tmp_path / "a.dcm", stored((5, 100, 110)) if kind == "long" else RAW)
    data = path.read_bytes()
    for size in range(140, len(data) - 1, max(1, len(data) // 60)):
        (tmp_path / "b.dcm").write_bytes(data[:size])
        with pytest.raises(InputError):
            isocodec.read(tmp_path / "b.dcm")
    for size in range(len(data) - 40, len(data) - 2):
        (tmp_path / "b.dcm").write_bytes(data[:size])
        with pytest.raises(InputError):
            isocodec.read(tmp_path / "b.dcm")


def test_headers_are_held_against_limits(tmp_path: Path) -> None:
    path = slices(tmp_path / "a", RAW)
    with pytest.raises(LimitError):
        isocodec.read(path, samples=RAW.size - 1)
    assert isocodec.read(path, samples=RAW.size).values.size == RAW.size
    made = pydicom.dcmread(path / "000.dcm")
    made.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
    made.save_as(tmp_path / "b.dcm", enforce_file_format=True)
    data = (tmp_path / "b.dcm").read_bytes()
    start = 144 + pydicom.dcmread(tmp_path / "b.dcm").file_meta.FileMetaInformationGroupLength
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    (tmp_path / "b.dcm").write_bytes(data[:start] + packer.compress(bytes(1 << 22)) + packer.flush())
    with pytest.raises(LimitError, match="unpacks to more"):
        isocodec.read(tmp_path / "b.dcm", samples=1000)
