"""Inputs that name other files: those beside a detached header are read, others only if they are asked for."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
import SimpleITK
import tifffile

import isocodec
from commands import fails, ok
from files import same
from inputs import CELLS, META, NRRD, read_field, read_nodata, read_place, virtual
from isocodec.errors import InputError, LimitError


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """Bytes of nobody's business, in a directory beside that of the input; in four files of a slice, too."""
    (tmp_path / "home").mkdir()
    (tmp_path / "in").mkdir()
    (tmp_path / "home" / "secret").write_bytes(CELLS.tobytes("F"))
    for number in range(4):
        (tmp_path / "home" / f"s{number}").write_bytes(CELLS[:, :, number].tobytes("F"))
    return tmp_path / "home" / "secret"


def refused(path: Path, name: str, n: int = 3) -> None:
    """No reader takes a file that names this one, and all say how it is allowed."""
    for read in (read_field, lambda p: read_place(p, n), read_nodata):
        if read is read_nodata and not path.name.endswith((".tif", ".h5", ".nc")):
            continue
        with pytest.raises(InputError) as caught:
            read(path)
        assert caught.value.code == "other-file" and name in caught.value.message
        assert "--follow-paths" in str(caught.value)
    line = fails(3, "encode", path, "-o", path.with_suffix(".iso"), "--isovalue", 5)
    assert name in line and "--follow-paths" in line
    assert not path.with_suffix(".iso").exists()


# ---- Files that others name -----------------------------------------------------------------------------------------

ELSEWHERE = [
    ("v.mhd", META + b"ElementDataFile = %s\n", "secret"),
    ("v.mha", META + b"ElementDataFile : %s\n", "secret"),
    ("V.MHD", META + b"ElementDataFile = ../home/secret\n", "../home/secret"),
    ("v.mhd", META + b"ElementDataFile = LIST 2\n%s\n", "s0"),
    ("v.mhd", META + b"ElementDataFile = %s 0 3 1\n", "s%d"),
    ("v.nhdr", NRRD + b"data file: %s\n", "secret"),
    ("v.nrrd", NRRD + b"DATAFILE: %s\n\n", "secret"),
    ("v.nhdr", NRRD + b"data file: ../home/secret\n", "../home/secret"),
    ("v.nhdr", NRRD + b"data file: LIST 2\n%s\n", "s0"),
    ("v.nhdr", NRRD + b"data file: %s 0 3 1 2\n", "s%d"),
]


@pytest.mark.parametrize(("name", "header", "target"), ELSEWHERE)
def test_detached_headers_reach_no_other_directory(secret: Path, name: str, header: bytes, target: str) -> None:
    path = secret.parent.parent / "in" / name
    home = os.fsencode(secret.parent)
    if target == "s0":
        named = b"\n".join(home + b"/s%d" % number for number in range(4))
    else:
        named = home + b"/" + target.encode()
    path.write_bytes(header.replace(b"%s", named))
    shown = target if target.startswith("..") else str(secret.parent / target.replace("%d", "0"))
    refused(path, shown)
    assert same(read_field(path, follow=True), CELLS)
    ok("encode", path, "-o", path.with_suffix(".iso"), "--isovalue", 5.5, "--follow-paths")
    assert np.array_equal(isocodec.open(path.with_suffix(".iso").read_bytes()).above(), CELLS > 5.5)


@pytest.mark.parametrize(
    ("name", "header", "target"),
    [
        ("v.mhd", META + b"ElementDataFile = data.raw\n", "data.raw"),
        ("v.mhd", META + b"ElementDataFile = with blanks.raw\n", "with blanks.raw"),
        ("v.mhd", META.replace(b"\n", b"\r\n") + b"ElementDataFile = LIST\r\ns0\r\ns1\r\ns2\r\ns3\r\n", "s%d"),
        ("v.mhd", META + b"ElementDataFile = s%d 0 3 1\n", "s%d"),
        ("v.nhdr", NRRD + b"data file: data.raw\n", "data.raw"),
        ("v.nhdr", NRRD + b"datafile: LIST 2\ns0\ns1\ns2\ns3\n", "s%d"),
        ("v.nhdr", NRRD + b"data file: s%d 0 3 1 2\n", "s%d"),
    ],
)
def test_files_beside_a_detached_header_are_read(tmp_path: Path, name: str, header: bytes, target: str) -> None:
    (tmp_path / name).write_bytes(header)
    if "%d" in target:
        for number in range(4):
            (tmp_path / (target % number)).write_bytes(CELLS[:, :, number].tobytes("F"))
    else:
        (tmp_path / target).write_bytes(CELLS.tobytes("F"))
    assert same(read_field(tmp_path / name), CELLS)
    some = tmp_path / (target.replace("%d", "2"))
    some.write_bytes(some.read_bytes()[:-1])
    with pytest.raises(InputError, match="states 24 bytes, but there are 23"):
        read_field(tmp_path / name)
    some.unlink()
    with pytest.raises(InputError, match=rf"names '{some.name}', but there is no such file beside it") as caught:
        read_field(tmp_path / name)
    assert caught.value.code == "other-file"


@pytest.mark.parametrize("numbers", ["3 0 -1", "1 7 2", "9 3 -2", "7 10 1"])
def test_files_are_read_in_the_order_of_their_numbers(tmp_path: Path, numbers: str) -> None:
    first, last, step = map(int, numbers.split())
    for number, cells in zip(range(first, last + step // abs(step), step), np.moveaxis(CELLS, 2, 0), strict=True):
        (tmp_path / f"s{number:03d}").write_bytes(cells.tobytes("F"))
    (tmp_path / "v.mhd").write_bytes(META + b"ElementDataFile = s%%03d %s\n" % numbers.encode())
    (tmp_path / "v.nhdr").write_bytes(NRRD + b"data file: s%%03d %s 2\n" % numbers.encode())
    assert same(read_field(tmp_path / "v.nhdr"), CELLS)
    if step > 0:
        assert same(read_field(tmp_path / "v.mhd"), CELLS)
    else:
        with pytest.raises(InputError, match="by a pattern that cannot be followed"):  # ITK would not read a sample
            read_field(tmp_path / "v.mhd")


@pytest.mark.parametrize("header", ["v.nhdr", "...nhdr", "a.b.nhdr"])
@pytest.mark.parametrize("folder", ["", "own", "other", "..", ".", "own/deeper", "link", "absolute"])
def test_folders_that_a_header_may_name(tmp_path: Path, header: str, folder: str) -> None:
    """Its own directory and the one that has its name, itself and no link; whatever its name looks like."""
    home = tmp_path / "home"
    home.mkdir()
    own = Path(header).stem
    name = {"own": own, "own/deeper": f"{own}/deeper", "link": own, "absolute": str(tmp_path)}.get(folder, folder)
    right = folder == "" or (folder == "own" and own != "..")
    there = home / name
    if folder == "link" and own != "..":
        (tmp_path / "elsewhere").mkdir()
        there.symlink_to(tmp_path / "elsewhere")
    there.mkdir(parents=True, exist_ok=True)
    (there / "data.raw").write_bytes(CELLS.tobytes("F"))
    (home / header).write_bytes(NRRD + f"data file: {name}{'/' if name else ''}data.raw\n".encode())
    if right:
        assert same(read_field(home / header), CELLS)
    else:
        with pytest.raises(InputError, match="names another file"):
            read_field(home / header)


@pytest.mark.parametrize("name", ["./data.raw", "in/../data.raw", "C:data.raw", "..\\data.raw", "."])
def test_paths_are_no_names(tmp_path: Path, name: str) -> None:
    """Even those that lead back to the same directory, and those of other systems."""
    (tmp_path / "data.raw").write_bytes(CELLS.tobytes("F"))
    (tmp_path / "v.mhd").write_bytes(META + b"ElementDataFile = " + name.encode() + b"\n")
    refused(tmp_path / "v.mhd", name)


def test_links_lead_out_of_the_directory_only_if_followed(secret: Path) -> None:
    folder = secret.parent.parent / "in"
    (folder / "v.mhd").write_bytes(META + b"ElementDataFile = data.raw\n")
    (folder / "data.raw").symlink_to(secret)
    refused(folder / "v.mhd", "data.raw")
    assert same(read_field(folder / "v.mhd", follow=True), CELLS)
    (folder / "data.raw").unlink()
    (folder / "inner.raw").write_bytes(CELLS.tobytes("F"))
    (folder / "data.raw").symlink_to("inner.raw")
    assert same(read_field(folder / "v.mhd"), CELLS)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        # what one parser takes for the value of another field, and the next for the name of the file
        ("v.mha", META + b"Comment =\nElementDataFile = LOCAL\nElementDataFile = %s\n"),
        ("v.mha", META + b"Comment = ElementDataFile = LOCAL\nElementDataFile = %s\n"),
        ("v.mha", META + b"x" * 500 + b"ElementDataFile = %s\n"),
        ("v.mha", META + b"Comment = x\rElementDataFile = %s\rElementDataFile = LOCAL\n"),
        ("v.mha", META + b"Comment = \0\nElementDataFile = LOCAL\n"),
        ("v.mha", META + b"Comment = " + b"x" * (1 << 20) + b"\nElementDataFile = %s\n"),
        ("v.mhd", META + b"ElementDataFile = LIST\n" + b"v.mhd\n" * (1 << 18)),
        ("v.mhd", META + b"ElementDataFile = %%s%%s%%n 1 2 1\n"),
        ("v.mhd", META + b"ElementDataFile = s%%d 1 2 0\n"),
        ("v.nhdr", NRRD.replace(b"\n", b"\r") + b"data file: %s\r"),
        ("v.nrrd", NRRD + b"#\r\rdata file: %s\n\n"),
        ("v.nrrd", NRRD + b"#" + b"x" * (1 << 20) + b"\ndata file: %s\n\n"),
        ("v.nrrd", NRRD + b"#\0\ndata file: %s\n\n"),
    ],
)
def test_headers_that_can_be_read_in_two_ways_are_not_read(secret: Path, name: str, content: bytes) -> None:
    path = secret.parent.parent / "in" / name
    path.write_bytes(content.replace(b"%s", os.fsencode(secret)).replace(b"%%", b"%") + bytes(24))
    for follow in (False, True):
        with pytest.raises(InputError) as caught:
            read_field(path, follow=follow)
        assert caught.value.code == "unreadable" and "cannot be read as" not in caught.value.message


def test_names_of_files_without_end(tmp_path: Path) -> None:
    (tmp_path / "v.mhd").write_bytes(META + b"ElementDataFile = s%d 1 999999999 1\n")
    with pytest.raises(LimitError, match="999,999,999 files"):
        read_field(tmp_path / "v.mhd")


def test_a_dash_is_not_standard_input(tmp_path: Path) -> None:
    (tmp_path / "v.nhdr").write_bytes(NRRD + b"data file: -\n")
    (tmp_path / "-").write_bytes(CELLS.tobytes())
    refused(tmp_path / "v.nhdr", "'-'")


def test_other_formats_of_the_library_are_not_tried(tmp_path: Path) -> None:
    """Under names of MetaImage and NRRD ITK would read whatever it knows."""
    image = SimpleITK.GetImageFromArray(CELLS)
    for suffix, name in ((".vtk", "v.mha"), (".nii", "v.nrrd"), (".mha", "w.nrrd"), (".nrrd", "w.mha")):
        SimpleITK.WriteImage(image, tmp_path / f"a{suffix}")
        (tmp_path / f"a{suffix}").rename(tmp_path / name)
        with pytest.raises(InputError, match=r"has no .* header"):
            read_field(tmp_path / name)
    (tmp_path / "a.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n")
    with pytest.raises(InputError, match="neither PNG nor JPEG"):
        read_field(tmp_path / "a.png")


def test_hdf5_keeps_to_its_own_file(secret: Path) -> None:
    folder = secret.parent.parent / "in"
    with h5py.File(folder / "other.h5", "w") as other:
        other["x"] = CELLS[0]
    for name in ("external", "virtual", "nested", "linked"):
        with h5py.File(folder / f"{name}.h5", "w") as file:
            if name == "external":
                file.create_dataset("x", (3, 4), "u1", external=[(bytes(secret), 0, 12)])
            elif name == "linked":
                file["away"] = h5py.ExternalLink("other.h5", "/x")
                virtual(file, "x", ".", "away")
            else:
                virtual(file, "x", "other.h5", "x")
            if name == "nested":
                virtual(file, "values", ".", "/x")
        shown = {"external": str(secret), "linked": "away"}.get(name, "other.h5")
        refused(folder / f"{name}.h5", shown, 2)
        if name != "external":
            assert same(read_field(folder / f"{name}.h5", key="x", follow=True), CELLS[0])
    assert read_field(folder / "external.h5", follow=True).tobytes() == CELLS.tobytes("F")[:12]
    with h5py.File(folder / "away.h5", "w") as file:
        file["x"] = h5py.ExternalLink("other.h5", "/x")
        file["soft"] = h5py.SoftLink("/x")
    for key in (None, "x"):
        with pytest.raises(InputError, match=r"names another file, 'other\.h5'.*--follow-paths"):
            read_field(folder / "away.h5", key=key)
    with pytest.raises(InputError, match="holds no array 'soft', but: x in another file"):
        read_field(folder / "away.h5", key="soft")
    assert same(read_field(folder / "away.h5", follow=True), CELLS[0])


def test_hdf5_next_to_what_lies_elsewhere(tmp_path: Path) -> None:
    """Arrays of the file itself are read, whatever others there are, and put together from one another."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["own"] = CELLS[1]
        virtual(file, "away", "nowhere.h5", "x")
        virtual(file, "mine", ".", "own")
        virtual(file, "mirror", ".", "mirror")
        unlimited = h5py.VirtualLayout((3, 4), "u1", maxshape=(None, 4))
        source = h5py.VirtualSource("nowhere.h5", "x", (3, 4), maxshape=(None, 4))
        unlimited[: h5py.h5s.UNLIMITED, :] = source[: h5py.h5s.UNLIMITED, :]
        file.create_virtual_dataset("endless", unlimited)
    for key in ("own", "mine"):
        assert same(read_field(tmp_path / "a.h5", key=key), CELLS[1])
    with pytest.raises(InputError, match=r"own \(3, 4\), away in another file, endless in another file.*--key"):
        read_field(tmp_path / "a.h5")


def test_coordinates_of_hdf5_in_other_files(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["y"] = np.arange(3.0)
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["z"] = CELLS[1]
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "y", (3,))
        file.create_virtual_dataset("y", layout)
        file["x"] = np.arange(4.0)
        for axis, name in enumerate("yx"):
            file[name].make_scale(name)
            file["z"].dims[axis].attach_scale(file[name])
    assert "counted, as it has no coordinates" in read_place(tmp_path / "a.nc", 2, "z").remark
    assert not read_place(tmp_path / "a.nc", 2, "z", follow=True).remark


def ome(names: list[str], uuids: str = "ab") -> str:
    """Notes of a series of pages in several files."""
    pages = "".join(
        f'<TiffData FirstZ="{z}" PlaneCount="1"><UUID FileName="{name}">urn:uuid:{uuids[z]}</UUID></TiffData>'
        for z, name in enumerate(names)
    )
    return (
        '<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" UUID="urn:uuid:a">'
        '<Image ID="Image:0"><Pixels DimensionOrder="XYZCT" ID="Pixels:0" SizeC="1" SizeT="1" SizeX="4" SizeY="3" '
        f'SizeZ="{len(names)}" Type="uint8"><Channel ID="Channel:0:0" SamplesPerPixel="1"/>{pages}'
        "</Pixels></Image></OME>"
    )


def test_companions_of_a_microscope(secret: Path) -> None:
    folder = secret.parent.parent / "in"
    tifffile.imwrite(folder / "b.ome.tif", CELLS[1], description=ome(["b.ome.tif"]), metadata=None)
    tifffile.imwrite(folder / "a.ome.tif", CELLS[0], description=ome(["a.ome.tif", "b.ome.tif"]), metadata=None)
    assert same(read_field(folder / "a.ome.tif"), CELLS)
    tifffile.imwrite(secret.parent / "b.ome.tif", CELLS[1], metadata=None)
    for name in (f"{secret.parent}/b.ome.tif", "../home/b.ome.tif", "&#46;./home/b.ome.tif"):
        tifffile.imwrite(folder / "c.ome.tif", CELLS[0], description=ome(["c.ome.tif", name]), metadata=None)
        refused(folder / "c.ome.tif", "home/b.ome.tif")
        assert same(read_field(folder / "c.ome.tif", follow=True), CELLS)
