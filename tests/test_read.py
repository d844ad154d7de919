"""Readers: each against what another library writes."""

from __future__ import annotations

import gzip
import io
import struct
import sys
import zipfile
import zlib
from pathlib import Path

import h5py
import imageio.v3 as imageio
import nibabel
import numpy as np
import pytest
import SimpleITK
import tifffile
from PIL import Image

from files import same
from inputs import read_field
from isocodec.errors import InputError, LimitError, MissingExtraError, OptionError

GREY8 = np.arange(12, dtype=np.uint8).reshape(3, 4)
GREY16 = (np.arange(12, dtype=np.uint16) * 5000).reshape(3, 4)
COLOUR = np.dstack([GREY8, GREY8 + 100, GREY8 + 200])


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


@pytest.mark.parametrize(
    "name", ["a.npy", "a.npz", "a.png", "a.jpg", "a.tif", "a.nii", "a.nii.gz", "a.h5", "a.mha", "a.nrrd"]
)
@pytest.mark.parametrize("content", [b"", b"this is a text, not a field\n" * 40], ids=["empty", "text"])
def test_no_file_of_its_kind(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_field(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.png", "a.tif", "a.nii", "a.nii.gz", "a.h5", "a.mha", "a.nrrd"])
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
    elif name == "a.h5":
        with h5py.File(path, "w") as file:
            file["noise"] = noise
    elif name in ("a.mha", "a.nrrd"):
        SimpleITK.WriteImage(SimpleITK.GetImageFromArray(noise), path)
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
    with pytest.raises(LimitError) as caught:
        read_field(tmp_path / "a.npy")
    assert caught.value.code == "limit-samples"


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
        with pytest.raises(InputError, match=r"picture of 3 channels.*--channel|holds 3 bands.*--band"):
            read_field(tmp_path / name)
        assert same(read_field(tmp_path / name, channel=2), COLOUR[..., 2])
        with pytest.raises(OptionError, match=r"no channel 3|no band 4"):
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


def test_compressed_tiff_of_signed_numbers(tmp_path: Path) -> None:
    """Of 16 bits: pillow would make 32 bits of them, which is not what is stored."""
    Image.fromarray(GREY16).save(tmp_path / "a.tif", compression="tiff_lzw", tiffinfo={339: 2})
    assert np.asarray(Image.open(tmp_path / "a.tif")).dtype == np.int32
    assert same(read_field(tmp_path / "a.tif"), GREY16.astype(np.int16))


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
    for slope, inter, dtype in ((1, -1024, np.int32), (-3, 5, np.int32), (1 << 30, 0, np.int64)):
        scaled.header.set_slope_inter(slope, inter)
        scaled.to_filename(tmp_path / "w.nii")
        # Whole numbers stay what they are, and can be kept exactly.
        assert same(read_field(tmp_path / "w.nii"), volume.astype(dtype) * slope + inter)
    header = nibabel.Nifti1Header(endianness=">")
    header.set_data_dtype(np.int16)
    nibabel.Nifti1Image(volume[..., None], np.eye(4), header).to_filename(tmp_path / "b.nii.gz")
    assert gzip.decompress((tmp_path / "b.nii.gz").read_bytes())[:4] == b"\0\0\1\x5c"  # 348, big-endian
    assert same(read_field(tmp_path / "b.nii.gz"), volume)
    nibabel.Nifti1Image(volume[:, :, :1], np.eye(4)).to_filename(tmp_path / "slice.nii")
    assert same(read_field(tmp_path / "slice.nii"), volume[:, :, 0])
    nibabel.Nifti1Image(np.stack([volume, volume], axis=-1), np.eye(4)).to_filename(tmp_path / "series.nii")
    with pytest.raises(InputError, match=r"series of volumes, of shape \(2, 3, 4, 2\).*--frame 0 to 1"):
        read_field(tmp_path / "series.nii")


def test_nifti_of_extreme_samples(tmp_path: Path) -> None:
    """What is added may lead out of the type of the samples, downwards as well as upwards."""
    for dtype, inter, wanted in (("i4", -1024, "i8"), ("i4", 1024, "i8"), ("i2", -1024, "i4"), ("i4", -1, "i8")):
        info = np.iinfo(dtype)
        volume = np.array([info.min, -1, 0, info.max], dtype).reshape(2, 2, 1).repeat(2, axis=2)
        image = nibabel.Nifti1Image(volume, np.eye(4))
        image.header.set_slope_inter(1, inter)
        image.to_filename(tmp_path / "a.nii")
        expected = np.array([int(value) + inter for value in volume.ravel()], wanted).reshape(volume.shape)
        assert same(read_field(tmp_path / "a.nii"), expected)
    least = np.full((2, 2, 2), np.iinfo(np.int64).min)
    image = nibabel.Nifti1Image(least, np.eye(4), dtype=np.int64)
    image.to_filename(tmp_path / "a.nii")
    assert same(read_field(tmp_path / "a.nii"), least)
    image.header.set_slope_inter(-1, 0)
    image.to_filename(tmp_path / "a.nii")
    # 2^63 is no int64, and a power of two is a float64
    assert same(read_field(tmp_path / "a.nii"), np.full((2, 2, 2), 2.0**63))


@pytest.mark.parametrize("suffix", [".h5", ".hdf5", ".nc"])
def test_hdf5_takes_the_array_of_several_axes_or_asks(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(3.0)
        file["run/density"] = GREY16[None].astype(">u2")
    # One array has a plane; its first axis holds nothing but one time.
    assert same(read_field(path), GREY16)
    assert same(read_field(path, key="/run/density"), GREY16)
    assert same(read_field(path, key="time"), np.arange(3.0))
    for key in ("run", "speed"):
        with pytest.raises(InputError, match=rf"no array '{key}', but: run/density \(1, 3, 4\), time \(3,\)"):
            read_field(path, key=key)
    with h5py.File(path, "a") as file:
        file["speed"] = GREY8
    with pytest.raises(InputError, match=r"2 arrays: run/density \(1, 3, 4\), speed \(3, 4\): .*--key"):
        read_field(path)
    with h5py.File(path, "a") as file:
        file["values"] = COLOUR
        file["names"] = [["a", "b"]]
    assert same(read_field(path), COLOUR)
    with pytest.raises(InputError, match="not real numbers"):
        read_field(path, key="names")


def test_hdf5_without_a_plane(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = np.arange(3.0)
        file["count"] = 7
    with pytest.raises(InputError, match=r"no array of two or more axes, but: time \(3,\)"):
        read_field(tmp_path / "a.h5")
    with h5py.File(tmp_path / "e.h5", "w"):
        pass
    with pytest.raises(InputError, match="but: nothing"):
        read_field(tmp_path / "e.h5")
    (tmp_path / "old.nc").write_bytes(b"CDF\1" + bytes(100))
    with pytest.raises(InputError, match="holds no array of two or more axes, but: nothing"):
        read_field(tmp_path / "old.nc")


def test_packed_netcdf(tmp_path: Path) -> None:
    """What multiplies, what is added and what is missing, as the NetCDF user's guide has it: of the packed number."""
    with h5py.File(tmp_path / "a.nc", "w") as file:
        stored = file.create_dataset("z", data=np.array([[1, 2, -9], [4, -9, 6]], np.int16))
        stored.attrs["scale_factor"] = np.float64([0.5])
        stored.attrs["_FillValue"] = np.int16([-9])
    expected = np.array([[0.5, 1, np.nan], [2, np.nan, 3]])
    assert np.array_equal(read_field(tmp_path / "a.nc"), expected, equal_nan=True)
    with h5py.File(tmp_path / "a.nc", "a") as file:
        file["z"].attrs["add_offset"] = 10
    assert np.array_equal(read_field(tmp_path / "a.nc"), expected + 10, equal_nan=True)


@pytest.mark.parametrize("name", ["v.nrrd", "v.nhdr", "v.mha", "v.mhd"])
def test_volumes_of_itk(tmp_path: Path, name: str) -> None:
    """Axes are those of NIfTI, whatever the file: i runs fastest in the others' memory."""
    volume = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(volume.T.copy()), tmp_path / name, useCompression=True)
    field = read_field(tmp_path / name)
    assert same(field, volume) and field.flags.c_contiguous
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(volume[:, :, :1].T.copy()), tmp_path / name)
    assert same(read_field(tmp_path / name), volume[:, :, 0])
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(volume, isVector=True), tmp_path / name)
    with pytest.raises(InputError, match="4 channels"):
        read_field(tmp_path / name)


def test_one_of_a_series(tmp_path: Path) -> None:
    """Along the first axis of arrays and stacks, the last of volumes; what is packed or one-valued is left alone."""
    series = np.arange(120, dtype=np.int16).reshape(2, 3, 4, 5)
    np.save(tmp_path / "a.npy", series)
    np.savez(tmp_path / "a.npz", a=series, b=series)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"] = series[:, None]
        file["b"] = series[1, 2]
    tifffile.imwrite(tmp_path / "a.tif", series[0], photometric="minisblack")
    nibabel.Nifti1Image(series[..., None], np.eye(4)).to_filename(tmp_path / "a.nii")
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(series.T.copy(), isVector=False), tmp_path / "a.nrrd")
    for name, key, whole in (
        ("a.npy", None, series), ("a.npz", "b", series), ("a.h5", "a", series), ("a.tif", None, series[0]),
        ("a.nii", None, series.T.swapaxes(1, 3)), ("a.nrrd", None, series.T.swapaxes(1, 3)),
    ):
        for frame in range(len(whole)):
            assert same(read_field(tmp_path / name, key=key, frame=frame), np.ascontiguousarray(whole[frame])), name
        for frame in (-1, len(whole)):
            with pytest.raises(OptionError, match=f"no frame {frame}: the series has {len(whole)}"):
                read_field(tmp_path / name, key=key, frame=frame)
    imageio.imwrite(tmp_path / "a.png", GREY8)
    nibabel.Nifti1Image(series[0], np.eye(4)).to_filename(tmp_path / "one.nii")
    for name, key in (("a.png", None), ("a.h5", "b"), ("one.nii", None)):
        with pytest.raises(OptionError, match="not a series"):
            read_field(tmp_path / name, key=key, frame=0)


def test_options_for_another_kind_of_file(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", GREY8)
    with pytest.raises(OptionError, match="key"):
        read_field(tmp_path / "a.npy", key="x")
    with pytest.raises(OptionError, match="channel"):
        read_field(tmp_path / "a.npy", channel=0)


def test_names_that_tell_nothing(tmp_path: Path) -> None:
    for name, shown in (("a.xlsx", ".xlsx"), ("plain", "a name without a suffix")):
        (tmp_path / name).write_text("1 2 3")
        with pytest.raises(InputError, match=rf"{name}: {shown} .*\.npy.*\.nii\.gz"):
            read_field(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_field(tmp_path / "missing.csv")
    with pytest.raises(IsADirectoryError):
        read_field(tmp_path)


@pytest.mark.parametrize(
    ("module", "name", "extra"),
    [
        ("PIL", "a.png", "image"),
        ("tifffile", "a.tif", "raster"),
        ("nibabel", "a.nii", "nifti"),
        ("h5py", "a.h5", "hdf5"),
        ("SimpleITK", "a.mha", "itk"),
    ],
)
def test_reading_names_the_missing_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str, extra: str
) -> None:
    (tmp_path / name).write_bytes(b"whatever")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as caught:
        read_field(tmp_path / name)
    assert caught.value.remedy == f"pip install '.[{extra}]' in a checkout of isocodec"
