"""Volumes: a test for each kind of image of SimpleITK and nibabel, against these, or the numbers in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from libraries import Late
from tables import looped

SimpleITK, nibabel = Late("SimpleITK"), Late("nibabel")

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
VALUES = (np.arange(5 * 4 * 3) * 7 % 101).reshape(5, 4, 3).astype("<i2")
"""Axes i, j, k."""
AFFINE = np.array([[0.0, -3, 0.5, 10], [2, 0, 0, 20], [0, 0.25, 4, -30], [0, 0, 0, 1]])
CORNERS = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0], [0, 0, 2], [4, 3, 2.0]])
RAS = np.array([-1.0, -1, 1])


def image(values: Any = VALUES, **more: Any) -> Any:
    """An image of SimpleITK, turned in space."""
    made = SimpleITK.GetImageFromArray(np.ascontiguousarray(np.asarray(values).T), **more)
    if made.GetDimension() == 3:
        turn = np.linalg.qr(np.array([[1, 0.3, 0.2], [-0.2, 1, 0.4], [0.1, 0.2, 1]]))[0]
        made.SetDirection(turn.ravel())
        made.SetSpacing([0.5, 0.75, 2])
        made.SetOrigin([10, 20, 30])
    return made


def itk_file(path: Path, values: Any = VALUES, packed: bool = False, **more: Any) -> Path:
    SimpleITK.WriteImage(image(values, **more), path, packed)
    return path


def nifti(path: Path, values: Any = VALUES, unit: str = "mm", time: str = "sec", slope: Any = None) -> Path:
    made = nibabel.Nifti1Image(values, AFFINE)
    made.header.set_zooms((2, 3, 4, 1.5, 1)[: values.ndim])
    made.header.set_xyzt_units(unit, time)
    if slope:
        made.header.set_slope_inter(*slope)
    nibabel.save(made, path)
    return path


def nrrd(path: Path, *lines: str, values: Any = VALUES, sizes: str = "5 4 3") -> Path:
    """An NRRD with these lines in its header; values with the first axis fastest."""
    kind = {"int16": "short", "uint8": "unsigned char"}[str(values.dtype)]
    head = ["NRRD0005", f"type: {kind}", f"dimension: {len(sizes.split())}", f"sizes: {sizes}", *lines, "encoding: raw",
            "endian: little", "", ""]
    path.write_bytes("\n".join(head).encode() + values.tobytes(order="F"))
    return path


SPACE = ("space: left-posterior-superior", "space directions: (0.5,0,0) (0,0.75,0) (0,0,2)", "space origin: (10,20,30)")
PLACED = [[-0.5, 0, 0, -10], [0, -0.75, 0, -20], [0, 0, 2, 30]]


def test_the_fourth_axis_of_itk(tmp_path: Path) -> None:
    made = image(np.stack([VALUES, VALUES + 1], -1), isVector=False)
    made.SetSpacing([0.5, 0.75, 2, 40])
    for source in (made, tmp_path / "a.nrrd", tmp_path / "a.mha"):
        if isinstance(source, Path):
                    SimpleITK.WriteImage(made, source)
        field = isocodec.read(source, frame=1)
        assert np.array_equal(field.values, VALUES + 1) and "fourth axis" in field.remarks[0]
        bare = source == tmp_path / "a.nrrd"  # ITK states no space there
        assert np.allclose(field.placement.matrix, np.diag([0.5, 0.75, 2] * np.where(bare, 1, RAS)) @ np.eye(3, 4))
        assert (field.crs is None) == bare and any("of no body" in remark for remark in field.remarks) == bare


@looped("name", ["a.mha", "a.mhd", "a.nrrd", "a.nhdr", "A.MHA"])
def test_files_of_itk(tmp_path: Path, name: str) -> None:
    made = image()
    right = [made.TransformIndexToPhysicalPoint([*map(int, corner)]) * RAS for corner in CORNERS]
    for packed in (False, True):
        source = itk_file(tmp_path / name.lower(), packed=packed).rename(tmp_path / name)
        for field in (isocodec.read(source), isocodec.read(made), isocodec.read(source, band=1)):
            assert field.values.dtype == np.int16 and np.array_equal(field.values, VALUES) and not field.remarks
            assert np.allclose(field.placement.place(CORNERS), right)
            assert field.placement.unit == "mm" and field.crs.startswith("right")
    for choice, words in (({"key": "x"}, "'x'"), ({"band": 2}, "no band 2")):
        with pytest.raises((InputError, OptionError), match=words):
            isocodec.read(source, **choice)


@looped("name, slope, dtype", [
    ("a.nii", None, np.int16), ("a.nii.gz", (1, 0), np.int16), ("a.nii", (2, -3), np.int32),
    ("a.nii.gz", (1, 2**31), np.int64), ("a.nii", (0.5, 1), np.float64), ("a.nii", (1, 0.5), np.float64),
])
def test_files_of_nibabel(tmp_path: Path, name: str, slope: Any, dtype: type) -> None:
    """Integers stay integers where whole numbers scale them; objects are as files."""
    path = nifti(tmp_path / name, VALUES.astype(">i2"), slope=slope)
    scale, start = slope or (1, 0)
    for source in (path, nibabel.load(path)):
        field = isocodec.read(source)
        assert field.values.dtype == dtype and field.values.flags.c_contiguous
        assert np.array_equal(field.values, VALUES * np.float64(scale) + start)
        right = nibabel.affines.apply_affine(AFFINE, CORNERS)
        assert np.allclose(field.placement.place(CORNERS), right, atol=1e-5)
    with pytest.raises(InputError, match="'x'"):
        isocodec.read(path, key="x")
    field = isocodec.read(nibabel.Nifti1Image(VALUES.astype(np.float32), AFFINE))
    assert field.values.dtype == np.float32 and np.allclose(field.placement.matrix, AFFINE[:3])


@looped("unit, kept", [("mm", "mm"), ("meter", "meter"), ("micron", "micron"), ("unknown", "mm"), (7, "mm")])
def test_units_of_nifti(tmp_path: Path, unit: Any, kept: str) -> None:
    """Odd ones are taken for mm, with a word."""
    path = nifti(tmp_path / "a.nii", unit="mm" if unit == 7 else unit)
    if unit == 7:
        data = bytearray(path.read_bytes())
        data[123] = 7
        path.write_bytes(data)
    field = isocodec.read(path)
    assert field.placement.unit == kept and any("units, 7" in each for each in field.remarks) == (unit == 7)


@looped("name, time, unit", [
    ("a.nii", "sec", "s"), ("a.nii.gz", "msec", "ms"), ("a.nii", "usec", "µs"), ("a.nii", "unknown", None),
    ("a.nii", "hz", None),
])
def test_a_series_of_nifti(tmp_path: Path, name: str, time: str, unit: str | None) -> None:
    """All volumes, one of them, or the slices of one."""
    every = np.stack([VALUES, VALUES + 1, VALUES * 2], -1)
    path = nifti(tmp_path / name, every, time=time)
    with pytest.raises(InputError, match="--frame 0 to 2"):
        isocodec.read(path)
    with pytest.raises(OptionError, match="no frame 3"):
        isocodec.read(path, frame=3)
    one = isocodec.read(path, frame=1)
    assert np.array_equal(one.values, VALUES + 1) and not one.notes
    series = isocodec.read(path, frames=True)
    fields = series.fields
    assert series.times == (unit and [f"0 {unit}", f"1.5 {unit}", f"3 {unit}"])
    assert len(fields) == 3 and fields.whole == (5, 4, 3, 3)
    assert all(np.array_equal(each.values, every[..., at]) for at, each in enumerate(fields))
    assert np.allclose(fields[2].placement.matrix, AFFINE[:3])
    for source, choice in ((path, {"frame": 0}), (nifti(tmp_path / "b.nii"), {})):
        slices = isocodec.read(source, frames=True, **choice).fields
        assert len(slices) == 5 and np.array_equal(slices[2].values, VALUES[2])
        assert slices[2].placement is None and "position of a slice" in slices.remarks[0]


@looped("shape", [(5, 12), (5, 12, 1), (5, 1, 12), (1, 5, 12), (5, 12, 1, 1)])
def test_planes(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """A single slice lies in space, whichever axis has one sample; a picture of ITK in the plane."""
    field = isocodec.read(nifti(tmp_path / "a.nii", VALUES.reshape(shape)))
    kept = [axis for axis, size in enumerate((*shape, 1)[:3]) if size > 1]
    assert field.values.shape == (5, 12) and np.array_equal(field.values.ravel(), VALUES.ravel())
    assert np.allclose(field.placement.matrix, AFFINE[:3, [*kept, 3]])
    made = image(VALUES[..., 0])
    made.SetSpacing([0.5, 2])
    made.SetOrigin([3, 4])
    field = isocodec.read(made)
    assert np.array_equal(field.values, VALUES[..., 0]) and field.crs is None
    assert np.allclose(field.placement.matrix, [[0.5, 0, 3], [0, 2, 4]])


STEPS = SPACE[1].partition(": ")[2]
SEGMENTS = ("Segment0_ID:=Segment_1", "Segment0_Name:=liver", "Segment0_LabelValue:=1", "Segment0_Layer:=0")


@looped("first, kind, lines", [
    (True, "list", (SPACE[0], SPACE[2], f"space directions: none {STEPS}")),
    (False, "list", (SPACE[0], SPACE[2], f"space directions: {STEPS} none")),
    (True, "list", (SPACE[0], SPACE[2], f"space directions: none {STEPS}", *SEGMENTS)), (True, "time", ()),
    (False, "time", ()), (False, "time", (SPACE[0], SPACE[2], f"space directions: {STEPS} none")),
])
def test_series_of_nrrd(tmp_path: Path, first: bool, kind: str, lines: tuple[str, ...]) -> None:
    """Lists of volumes and layers of segments, as 3D Slicer writes them, and times; ITK refuses these in a space."""
    every = np.stack([VALUES, VALUES + 1], 0 if first else -1)
    kinds = f"kinds: {kind} domain domain domain" if first else f"kinds: domain domain domain {kind}"
    path = nrrd(tmp_path / "a.nrrd", *lines, kinds, values=every, sizes="2 5 4 3" if first else "5 4 3 2")
    if kind == "time" and lines:
        with pytest.raises(InputError, match="kind 'list'"):
            isocodec.read(path, frame=0)
        return
    field, fields = isocodec.read(path, frame=1), isocodec.read(path, frames=True).fields
    assert np.array_equal(field.values, VALUES + 1) and len(fields) == 2
    assert (field.crs is None) == (kind == "time") and (not lines or np.allclose(fields[1].placement.matrix, PLACED))
    for choice, words in (({}, "series of 2"), ({"key": "liver"}, "'liver'.* choose a layer by --frame")):
        with pytest.raises(InputError, match=words):
            isocodec.read(path, **choice)


@looped("kind", ["vector", "3-color", "RGB-color"])
def test_components_are_bands(tmp_path: Path, kind: str) -> None:
    path = nrrd(tmp_path / "a.nrrd", SPACE[0], f"space directions: none {STEPS}", SPACE[2],
                f"kinds: {kind} domain domain domain", values=np.stack([VALUES, VALUES + 1, VALUES + 2], 0),
                sizes="3 5 4 3")
    for band, words in ((None, "3 channels"), (4, "no band 4")):
        with pytest.raises((InputError, OptionError), match=words):
            isocodec.read(path, band=band)
    found = isocodec.read(path, band=2)
    assert np.array_equal(found.values, VALUES + 1) and np.allclose(found.placement.matrix, PLACED)


@looped("space, signs", [
    ("left-posterior-superior", (-1, -1)), ("right-anterior-superior", (1, 1)), ("left-anterior-superior", (-1, 1)),
    ("RAS", (1, 1)), ("3D-right-handed", None), ("scanner-xyz", None),
])
def test_spaces_of_nrrd(tmp_path: Path, space: str, signs: tuple[int, int] | None) -> None:
    field = isocodec.read(nrrd(tmp_path / "a.nrrd", f"space: {space}", *SPACE[1:]))
    assert field.crs == ("right-anterior-superior" if signs else None)
    assert bool(field.remarks) == (signs is None) and all(space in each for each in field.remarks)
    assert np.allclose(field.placement.matrix, np.diag([*(signs or (1, 1)), 1]) @ np.abs(PLACED))


@looped("lines, unit", [
    ((*SPACE, 'space units: "um" "um" "um"'), "um"), ((*SPACE, 'space units: "mm" "mm" "m"'), "mm m"), (SPACE, "mm"),
    (("spacings: 1 2 3", 'units: "cm" "cm" "cm"'), "cm"), ((), None),
])
def test_units_of_nrrd(tmp_path: Path, lines: tuple[str, ...], unit: str | None) -> None:
    field = isocodec.read(nrrd(tmp_path / "a.nrrd", *lines))
    assert field.placement.unit == unit and any("of no body" in each for each in field.remarks) == (len(lines) < 3)
    assert lines or np.array_equal(field.placement.matrix, np.eye(3, 4))


@looped("name", ["a.mha", "a.mhd", "a.nrrd"])
def test_damaged_samples(tmp_path: Path, name: str) -> None:
    """ITK takes packed samples as far as they go, and zeros beyond."""
    path = itk_file(tmp_path / name, np.arange(30 * 40 * 20).reshape(30, 40, 20).astype("i2"), packed=True)
    victim = max(tmp_path.iterdir(), key=lambda each: each.stat().st_size)
    data = bytearray(victim.read_bytes())
    for at in range(len(data) // 2, len(data) // 2 + 40):
        data[at] ^= 255
    victim.write_bytes(data)
    with pytest.raises(InputError):
        isocodec.read(path)


@looped("name", ["a.mha", "a.nrrd", "a.nii", "a.nii.gz"])
def test_files_cut_short(tmp_path: Path, name: str) -> None:
    noise = np.random.default_rng(1).integers(0, 1000, (12, 13, 14)).astype(np.int16)
    path = (nifti if "nii" in name else itk_file)(tmp_path / name, noise)
    data = path.read_bytes()
    for part in (0, 0.3, 0.9):
        path.write_bytes(data[: int(len(data) * part)])
        with pytest.raises(InputError) as caught:
            isocodec.read(path)
        assert str(path) in str(caught.value)


def test_lists_of_files(tmp_path: Path) -> None:
    head = ("ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize = 5 4 3\n"
            "ElementType = MET_SHORT\nElementDataFile = ")
    for number in range(3):
        (tmp_path / f"s{number}").write_bytes(VALUES[..., number].tobytes(order="F"))
    for listed in ("LIST\ns0\ns1\ns2\n", "s%d 0 2 1\n"):
        (tmp_path / "a.mhd").write_text(head + listed)
        assert np.array_equal(isocodec.read(tmp_path / "a.mhd").values, VALUES)
    # ITK would leave the samples as memory was, or crash
    for text in (head + "s%d 2 0 -1\n", head.replace("NDims = 3", "NDims = 2147483648") + "s0\n"):
        (tmp_path / "a.mhd").write_text(text)
        with pytest.raises(InputError, match="falling numbers, or has other than two to five axes"):
            isocodec.read(tmp_path / "a.mhd")


def test_other_formats_are_not_tried(tmp_path: Path) -> None:
    itk_file(tmp_path / "a.mha").rename(tmp_path / "a.nrrd")
    with pytest.raises(InputError):
        isocodec.read(tmp_path / "a.nrrd")


def test_a_singular_place_is_left_out(tmp_path: Path) -> None:
    field = isocodec.read(nibabel.spatialimages.SpatialImage(VALUES, np.diag([1.0, 2, 0, 1])))
    assert field.placement is None and "coordinates are ignored" in field.remarks[0]


def test_one_volume_at_a_time(tmp_path: Path) -> None:
    import tracemalloc

    path = nifti(tmp_path / "a.nii.gz", np.zeros((48, 48, 48, 10), np.int16))
    tracemalloc.start()
    fields = isocodec.read(path, frames=True).fields
    assert sum(not each.values.any() for each in fields) == 10
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * 2 * 48**3 + (1 << 18)


def test_a_series_by_the_command(tmp_path: Path) -> None:
    """Frames of a file of four axes, with the time between them, and missing samples."""
    from commands import fails, ok

    every = np.stack([VALUES, VALUES + 1, VALUES * 2], -1).astype(np.float32)
    every[2, 3, 1] = np.nan
    path, out = nifti(tmp_path / "a.nii.gz", every), tmp_path / "a.iso"
    ok("encode", path, "-o", out, "--isovalue", 50.5, "--frames", "--frame-interval", 2)
    file = isocodec.open(out)
    assert file.shape == (5, 4, 3) and list(file.times) == [0, 1.5, 3] and file.info.interval == 2
    assert np.array_equal(file.valid(), ~np.isnan(every[..., 0]))
    for frame in range(3):
        assert np.array_equal(file.above(frame=frame) & file.valid(), every[..., frame] > 50.5)
    ok("encode", path, "-o", out, "--isovalue", 50.5, "--frame", 1)
    contour = isocodec.decode(out)
    assert np.allclose(contour.placed, contour.points @ AFFINE[:3, :3].T + AFFINE[:3, 3])
    assert "--frame 0 to 2" in fails(3, "encode", path, "-o", out, "--isovalue", 50.5)
