"""Readers and writers: each against what another library writes or reads."""

from __future__ import annotations

import gzip
import io
import json
import os
import stat
import struct
import sys
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

import imageio.v3 as imageio
import nibabel
import numpy as np
import pytest
import shapely.geometry
import tifffile
import trimesh
from PIL import Image

from isocodec.contour import Contour
from isocodec.errors import InputError, LimitError, MissingExtraError, OptionError
from isocodec.io import check_suffix, check_target, read_field, render_contour, write_bytes, write_contour
from isocodec.io.picture import Step, contour_picture, shade, steps_picture

GREY8 = np.arange(12, dtype=np.uint8).reshape(3, 4)
GREY16 = (np.arange(12, dtype=np.uint16) * 5000).reshape(3, 4)
COLOUR = np.dstack([GREY8, GREY8 + 100, GREY8 + 200])

# A diamond around sample (2, 3), closed, and one segment that leaves the grid.
SQUARE = [(1.0, 3.0), (2.0, 2.0), (3.0, 3.0), (2.0, 4.25)]
CURVE = Contour(
    points=np.array([*SQUARE, (0.0, 0.5), (0.5, 0.0)]),
    cells=np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5)]),
    isovalue=2.5,
    shape=(5, 7),
)
NO_CURVE = Contour(np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64), 9.0, (5, 7))

# A tetrahedron, its triangles seen counter-clockwise from outside: volume 1 * 2 * 3 / 6 = 1.
SURFACE = Contour(
    points=np.array([(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 3.0, 1.0), (1.0, 1.0, 4.0)]),
    cells=np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
    isovalue=0.25,
    shape=(4, 5, 6),
)
NO_SURFACE = Contour(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), 9.0, (4, 5, 6))


# ---- Fields in ------------------------------------------------------------------------------------------------------


def same(field: np.ndarray, expected: np.ndarray) -> bool:
    return field.dtype == expected.dtype and field.shape == expected.shape and bool((field == expected).all())


@pytest.mark.parametrize("dtype", ["u1", "i2", ">i2", ">u4", "f4", ">f8", "f2"])
def test_npy_keeps_numbers_in_native_order(tmp_path: Path, dtype: str) -> None:
    array = np.arange(24).reshape(2, 3, 4).astype(dtype)
    np.save(tmp_path / "a.npy", array)
    field = read_field(tmp_path / "a.npy")
    assert same(field, array.astype(np.dtype(dtype).newbyteorder("=")))
    assert field.dtype.isnative


def test_npy_in_fortran_order_and_truth_values(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.asfortranarray(GREY8 > 5))
    field = read_field(tmp_path / "a.npy")
    assert same(field, (GREY8 > 5).astype(np.uint8))
    assert field.flags.c_contiguous


def test_npz_one_array_needs_no_key(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", anything=GREY16)
    assert same(read_field(tmp_path / "a.npz"), GREY16)
    assert same(read_field(tmp_path / "a.npz", key="anything"), GREY16)


def test_npz_of_several_takes_values_or_asks(tmp_path: Path) -> None:
    np.savez(tmp_path / "v.npz", values=GREY16, spacing=np.ones(2))
    assert same(read_field(tmp_path / "v.npz"), GREY16)
    assert read_field(tmp_path / "v.npz", key="spacing").tolist() == [1.0, 1.0]
    np.savez(tmp_path / "n.npz", a=GREY16, b=np.ones(2))
    with pytest.raises(InputError, match=r"2 arrays: a \(3, 4\), b \(2,\).*--key"):
        read_field(tmp_path / "n.npz")
    with pytest.raises(InputError, match=r"no array 'c', but: a \(3, 4\)"):
        read_field(tmp_path / "n.npz", key="c")


def test_npz_listing_survives_what_cannot_be_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "n.npz", a=GREY16, b=np.array([None, {}], dtype=object))
    with pytest.raises(InputError, match=r"a \(3, 4\), b unreadable"):
        read_field(tmp_path / "n.npz")
    with pytest.raises(InputError, match="Python objects"):
        read_field(tmp_path / "n.npz", key="b")


def test_npz_without_arrays(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "empty.npz", "w"):
        pass
    with pytest.raises(InputError, match="no arrays"):
        read_field(tmp_path / "empty.npz")
    with zipfile.ZipFile(tmp_path / "text.npz", "w") as archive:
        archive.writestr("readme.txt", "no array")
    with pytest.raises(InputError, match="not an array"):
        read_field(tmp_path / "text.npz")


@pytest.mark.parametrize(
    ("array", "held"),
    [
        (np.array([["a", "b"], ["c", "d"]]), "strings"),
        (np.array([[b"a"]]), "strings"),
        (np.ones((2, 2), dtype=complex), "complex"),
        (np.array([["2020-01-01"]], dtype="M8[D]"), "dates"),
        (np.zeros((2, 2), dtype=[("r", "u1"), ("g", "u1")]), r"records \(r, g\)"),
    ],
)
def test_only_real_numbers(tmp_path: Path, array: np.ndarray, held: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=held):
        read_field(tmp_path / "a.npy")


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([None, {}], dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match="Python objects"):
        read_field(tmp_path / "a.npy")


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.png", "a.jpg", "a.tif", "a.nii", "a.nii.gz"])
@pytest.mark.parametrize("content", [b"", b"this is a text, not a field\n" * 40], ids=["empty", "text"])
def test_no_file_of_its_kind(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_field(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.png", "a.tif", "a.nii", "a.nii.gz"])
def test_files_cut_short(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    noise = np.random.default_rng(1).integers(0, 255, (40, 40, 3), dtype=np.uint8)
    if name == "a.npy":
        np.save(path, noise)
    elif name == "a.npz":
        np.savez(path, noise)
    elif name == "a.png":
        imageio.imwrite(path, noise[..., 0])
    elif name == "a.tif":
        tifffile.imwrite(path, noise[..., 0])
    else:
        nibabel.Nifti1Image(noise, np.eye(4)).to_filename(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError):
        read_field(path)


def test_absurd_size_in_a_header(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": "<f8", "fortran_order": False, "shape": (1 << 24, 1 << 24, 1 << 10)}
    )
    (tmp_path / "a.npy").write_bytes(buffer.getvalue())
    with pytest.raises((InputError, LimitError)):
        read_field(tmp_path / "a.npy")


@pytest.mark.parametrize("suffix", [".png", ".tif", ".tiff", ".PNG"])
@pytest.mark.parametrize("picture", [GREY8, GREY16, GREY8 > 5], ids=["8", "16", "1"])
def test_grey_pictures_keep_their_depth(tmp_path: Path, suffix: str, picture: np.ndarray) -> None:
    path = tmp_path / f"a{suffix}"
    Image.fromarray(picture).save(path)
    assert same(read_field(path), picture.astype(np.uint8) if picture.dtype == bool else picture)


def test_jpeg(tmp_path: Path) -> None:
    Image.fromarray(np.full((8, 16), 77, dtype=np.uint8)).save(tmp_path / "a.jpeg")
    assert same(read_field(tmp_path / "a.jpeg"), np.full((8, 16), 77, dtype=np.uint8))


def test_colour_pictures_need_a_channel(tmp_path: Path) -> None:
    imageio.imwrite(tmp_path / "c.png", COLOUR)
    tifffile.imwrite(tmp_path / "c.tif", COLOUR, photometric="rgb")
    tifffile.imwrite(
        tmp_path / "planes.tif", np.ascontiguousarray(COLOUR.transpose(2, 0, 1)), photometric="rgb", planarconfig=2
    )
    for name in ("c.png", "c.tif", "planes.tif"):
        with pytest.raises(InputError, match=r"colour picture of 3 channels.*--channel"):
            read_field(tmp_path / name)
        assert same(read_field(tmp_path / name, channel=2), COLOUR[..., 2])
        with pytest.raises(OptionError, match="no channel 3"):
            read_field(tmp_path / name, channel=3)


def test_channel_of_a_grey_picture(tmp_path: Path) -> None:
    imageio.imwrite(tmp_path / "g.png", GREY8)
    assert same(read_field(tmp_path / "g.png", channel=0), GREY8)
    with pytest.raises(OptionError, match="the picture has 1"):
        read_field(tmp_path / "g.png", channel=1)


def test_deep_colour_png_is_not_silently_halved(tmp_path: Path) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    # 2 x 1 pixels of 16-bit colour: one row, after its filter byte.
    row = b"\0" + struct.pack(">6H", 1, 2, 3, 400, 500, 600)
    header = struct.pack(">IIBBBBB", 2, 1, 16, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(row)) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(png)
    with pytest.raises(InputError, match="16 bits per channel"):
        read_field(tmp_path / "a.png", channel=0)


def test_tiff_floats_stacks_and_compression(tmp_path: Path) -> None:
    floats = GREY16.astype(np.float32) / 7
    tifffile.imwrite(tmp_path / "f.tif", floats)
    assert same(read_field(tmp_path / "f.tif"), floats)
    stack = np.arange(5 * 6 * 7, dtype=np.int16).reshape(5, 6, 7)
    tifffile.imwrite(tmp_path / "s.tif", stack, compression="zlib", byteorder=">", photometric="minisblack")
    assert same(read_field(tmp_path / "s.tif"), stack)
    # LZW, which tifffile alone does not unpack.
    for name, picture in (("l16.tif", GREY16), ("lf.tif", floats)):
        Image.fromarray(picture).save(tmp_path / name, compression="tiff_lzw")
        assert same(read_field(tmp_path / name), picture)


def test_tiff_that_leaves_a_choice(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "two.tif") as writer:
        writer.write(GREY8, photometric="minisblack")
        writer.write(np.zeros((7, 9), dtype=np.uint16), photometric="minisblack")
    with pytest.raises(InputError, match=r"2 pictures of different kinds: \(3, 4\), \(7, 9\)"):
        read_field(tmp_path / "two.tif")
    Image.fromarray(GREY8).convert("P").save(tmp_path / "palette.tif")
    with pytest.raises(InputError, match="palette"):
        read_field(tmp_path / "palette.tif")


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
def test_nifti_keeps_raw_integers(tmp_path: Path, suffix: str) -> None:
    volume = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    nibabel.Nifti1Image(volume, np.eye(4)).to_filename(tmp_path / f"v{suffix}")
    assert same(read_field(tmp_path / f"v{suffix}"), volume)


def test_nifti_scaled_big_endian_and_squeezed(tmp_path: Path) -> None:
    volume = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    scaled = nibabel.Nifti1Image(volume, np.eye(4))
    scaled.header.set_slope_inter(0.5, 10)
    scaled.to_filename(tmp_path / "s.nii")
    # The samples are stored as they are, and the header says: 0.5 times the sample, plus 10.
    assert same(read_field(tmp_path / "s.nii"), 0.5 * volume + 10)
    header = nibabel.Nifti1Header(endianness=">")
    header.set_data_dtype(np.int16)
    nibabel.Nifti1Image(volume[..., None], np.eye(4), header).to_filename(tmp_path / "b.nii.gz")
    assert gzip.decompress((tmp_path / "b.nii.gz").read_bytes())[:4] == b"\0\0\1\x5c"  # 348, big-endian
    assert same(read_field(tmp_path / "b.nii.gz"), volume)
    nibabel.Nifti1Image(volume[:, :, :1], np.eye(4)).to_filename(tmp_path / "slice.nii")
    assert same(read_field(tmp_path / "slice.nii"), volume[:, :, 0])
    nibabel.Nifti1Image(np.stack([volume, volume], axis=-1), np.eye(4)).to_filename(tmp_path / "series.nii")
    with pytest.raises(InputError, match=r"series of volumes, of shape \(2, 3, 4, 2\)"):
        read_field(tmp_path / "series.nii")


def test_options_for_another_kind_of_file(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", GREY8)
    with pytest.raises(OptionError, match="key"):
        read_field(tmp_path / "a.npy", key="x")
    with pytest.raises(OptionError, match="channel"):
        read_field(tmp_path / "a.npy", channel=0)


def test_names_that_tell_nothing(tmp_path: Path) -> None:
    for name, shown in (("a.csv", ".csv"), ("plain", "a name without a suffix")):
        (tmp_path / name).write_text("1 2 3")
        with pytest.raises(InputError, match=rf"^{shown} .*\.npy.*\.nii\.gz"):
            read_field(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_field(tmp_path / "missing.csv")
    with pytest.raises(IsADirectoryError):
        read_field(tmp_path)


@pytest.mark.parametrize(
    ("module", "name", "extra"),
    [("imageio.v3", "a.png", "image"), ("tifffile", "a.tif", "image"), ("nibabel", "a.nii", "nifti")],
)
def test_reading_names_the_missing_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str, extra: str
) -> None:
    (tmp_path / name).write_bytes(b"whatever")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as caught:
        read_field(tmp_path / name)
    assert caught.value.remedy == f"pip install 'isocodec[{extra}]'"


# ---- Curves out -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("contour", [CURVE, SURFACE, NO_CURVE, NO_SURFACE])
def test_npz_out(tmp_path: Path, contour: Contour) -> None:
    write_contour(contour, tmp_path / "c.npz")
    with np.load(tmp_path / "c.npz") as arrays:
        assert sorted(arrays.files) == ["cells", "isovalue", "points", "shape"]
        assert same(arrays["points"], contour.points)
        assert same(arrays["cells"], contour.cells)
        assert arrays["isovalue"] == contour.isovalue
        assert arrays["shape"].tolist() == list(contour.shape)


def test_geojson_out(tmp_path: Path) -> None:
    write_contour(CURVE, tmp_path / "c.geojson")
    feature = json.loads((tmp_path / "c.geojson").read_text())
    assert feature["properties"] == {"isovalue": 2.5, "shape": [5, 7], "complete": True}
    lines = shapely.geometry.shape(feature["geometry"]).geoms
    assert sorted(line.is_closed for line in lines) == [False, True]
    (ring,) = (line for line in lines if line.is_closed)
    # x is axis 1, y is axis 0; the diamond has half diagonals 1 by 1 and 1 by 1.25: 2 * (1 + 1.25) / 2.
    assert ring.bounds == (2.0, 1.0, 4.25, 3.0)
    assert shapely.geometry.Polygon(ring).area == pytest.approx(2.25)


def test_svg_out(tmp_path: Path) -> None:
    write_contour(CURVE, tmp_path / "c.svg")
    root = ElementTree.parse(tmp_path / "c.svg").getroot()
    assert root.get("viewBox") == "-0.5 -0.5 7 5"
    paths = [path.get("d") for path in root.iter("{http://www.w3.org/2000/svg}path")]
    assert paths == ["M0.5,0 0,0.5", "M3,1 2,2 3,3 4.25,2Z"]


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_surfaces_out(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"s{suffix}"
    write_contour(SURFACE, path)
    mesh = trimesh.load_mesh(path)
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1.0)
    assert mesh.bounds.tolist() == [[1, 1, 1], [2, 3, 4]]
    if suffix == ".stl":
        # Binary: 80 bytes of header, the number of triangles, 50 bytes for each.
        assert path.stat().st_size == 84 + 50 * 4


def test_empty_contours_are_valid_files() -> None:
    assert json.loads(render_contour(NO_CURVE, ".geojson"))["geometry"] == {
        "type": "MultiLineString",
        "coordinates": [],
    }
    assert not list(ElementTree.fromstring(render_contour(NO_CURVE, ".svg")).iter("{*}path"))
    assert render_contour(NO_SURFACE, ".stl") == bytes(84)
    ply = render_contour(NO_SURFACE, ".ply")
    assert b"element vertex 0\n" in ply
    assert b"element face 0\n" in ply
    obj = render_contour(NO_SURFACE, ".obj").decode()
    assert all(line.startswith("#") for line in obj.splitlines())
    for contour in (NO_CURVE, NO_SURFACE):
        assert Image.open(io.BytesIO(render_contour(contour, ".png"))).format == "PNG"


@pytest.mark.parametrize(
    ("contour", "suffix", "fitting"),
    [(CURVE, ".stl", ".npz, .png, .geojson, .svg"), (SURFACE, ".svg", ".npz, .png, .ply, .stl, .obj")],
)
def test_formats_of_the_other_dimension(tmp_path: Path, contour: Contour, suffix: str, fitting: str) -> None:
    with pytest.raises(OptionError, match=f"cannot hold a (curve|surface).*one of {fitting}$"):
        write_contour(contour, tmp_path / f"c{suffix}")
    assert not list(tmp_path.iterdir())


def test_unknown_formats() -> None:
    assert check_suffix("a/b.c/D.PLY") == ".ply"
    for name in ("a.xyz", "a", ".ply"):
        with pytest.raises(OptionError, match=r"one of \.npz, \.png, \.geojson, \.svg, \.ply, \.stl, \.obj"):
            check_suffix(name)


@pytest.mark.parametrize(
    ("module", "contour", "suffix", "extra"),
    [
        ("trimesh", SURFACE, ".ply", "mesh"),
        ("matplotlib.figure", CURVE, ".png", "plot"),
    ],
)
def test_writing_names_the_missing_extra(
    monkeypatch: pytest.MonkeyPatch, module: str, contour: Contour, suffix: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match="needs") as caught:
        render_contour(contour, suffix)
    assert caught.value.remedy == f"pip install 'isocodec[{extra}]'"


def test_plain_formats_need_no_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("shapely", "trimesh", "matplotlib", "imageio"):
        monkeypatch.setitem(sys.modules, module, None)
    for suffix in (".npz", ".geojson", ".svg"):
        assert render_contour(CURVE, suffix)


# ---- Pictures -------------------------------------------------------------------------------------------------------


def ink(picture: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(picture)).convert("L")) < 200


def test_picture_of_a_curve_has_the_grid_upright() -> None:
    # Row 1 of 21 is in the upper tenth of a picture of 6 inches at 150 dots.
    top = Contour(np.array([(1.0, 2.0), (1.0, 8.0)]), np.array([(0, 1)]), 0.0, (21, 21))
    inked = ink(contour_picture(top))
    assert inked.shape == (900, 900)
    rows = np.flatnonzero(inked[50:800, 300:350].any(axis=1)) + 50  # without title, frame and ticks
    assert len(rows)
    assert rows.max() < 130


def test_shading_fills_the_silhouette() -> None:
    # A unit square, facing axis 0, in two triangles; its image is a parallelogram without holes.
    points = np.array([(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (0.0, 0.0, 1.0)])
    # Off the middle, so that no edge lies just between two columns of pixels.
    whole = shade(points, np.array([(0, 1, 2), (0, 2, 3)]), np.array([0.013, 0.007]), 4.0, 100)
    # Viewed along (-0.42, -0.75, -0.55) / 1.0203 it shrinks to 0.412 of its area: 625 pixels of area 1.
    assert whole[..., 3].sum() == pytest.approx(625 * 0.412, rel=0.08)
    opaque = whole[..., 3] > 0
    for line in (*opaque, *opaque.T):
        filled = np.flatnonzero(line)
        assert len(filled) == 0 or len(filled) == filled[-1] - filled[0] + 1


def test_shading_hides_what_lies_behind() -> None:
    front = np.array([(0.5, 0.0, 0.0), (0.5, 1.0, 0.0), (0.5, 0.0, 1.0)])
    behind = front * 1.0 - np.array([-0.42, -0.75, -0.55])
    behind[2, 0] += 0.4  # tilted, so that its shade is another
    both = np.concatenate([front, behind])
    alone = shade(front, np.array([(0, 1, 2)]), np.zeros(2), 4.0, 60)
    for cells in ([(0, 1, 2), (3, 4, 5)], [(3, 4, 5), (0, 1, 2)]):
        seen = shade(both, np.array(cells), np.zeros(2), 4.0, 60)
        inner = alone[..., 3] == 1.0
        assert inner.any()
        assert np.array_equal(seen[inner], alone[inner])


@pytest.mark.parametrize(("contour", "empty"), [(CURVE, NO_CURVE), (SURFACE, NO_SURFACE)])
def test_steps_side_by_side(contour: Contour, empty: Contour) -> None:
    steps = [Step(empty, 10, 100), Step(contour, 50, 100), Step(contour, 100, 100)]
    one = Image.open(io.BytesIO(steps_picture(steps[:1])))
    three = Image.open(io.BytesIO(steps_picture(steps)))
    assert three.width == 3 * one.width
    assert three.height == one.height
    nine = Image.open(io.BytesIO(steps_picture(steps * 3)))
    assert nine.width == 6 * one.width
    assert nine.height == pytest.approx(2 * one.height, abs=1)


@pytest.mark.parametrize(("suffix", "magic"), [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_picture_formats(suffix: str, magic: bytes) -> None:
    assert steps_picture([Step(CURVE, 1, 1)], suffix).startswith(magic)


# ---- Whole or not at all --------------------------------------------------------------------------------------------


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.npz"
    target.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_bytes(target, b"new")
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_interrupted_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "a.npz", b"new")
    assert not list(tmp_path.iterdir())


def test_permissions_and_links_are_kept(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    write_bytes(plain, b"1")
    (tmp_path / "usual").touch()
    assert plain.stat().st_mode == (tmp_path / "usual").stat().st_mode
    plain.chmod(0o640)
    (tmp_path / "link").symlink_to(plain)
    write_bytes(tmp_path / "link", b"2")
    assert (tmp_path / "link").is_symlink()
    assert plain.read_bytes() == b"2"
    assert stat.S_IMODE(plain.stat().st_mode) == 0o640


def test_devices_are_not_replaced() -> None:
    check_target("/dev/null")
    write_bytes("/dev/null", b"gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_targets_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(IsADirectoryError):
        check_target(tmp_path)
    with pytest.raises(FileNotFoundError, match="no directory"):
        check_target(tmp_path / "missing" / "a.npz")
    with pytest.raises(NotADirectoryError):
        check_target(tmp_path / "file" / "a.npz")
    check_target(tmp_path / "new.npz")
    # The superuser may write everywhere, so the answer of the system is put into its mouth.
    for closed in (tmp_path, tmp_path / "file"):
        monkeypatch.setattr(os, "access", lambda path, _, closed=closed: Path(path) != closed)
        with pytest.raises(PermissionError):
            check_target(tmp_path / "file")
