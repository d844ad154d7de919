"""Fields in: arrays of numbers out of NumPy files, pictures and NIfTI volumes.

The samples come as they are stored: no rescaling, no conversion to grey, no rotation. Where a file leaves a
choice (which array, which colour channel), the caller makes it; nothing is guessed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, IsoError, LimitError, MissingExtraError, OptionError
from .extras import optional

Field = NDArray[Any]

# The array of an .npz that is taken if there are several and none is named.
DEFAULT_KEY = "values"


def read_field(path: str | os.PathLike[str], *, key: str | None = None, channel: int | None = None) -> Field:
    """Read a sampled scalar field.

    Parameters
    ----------
    path : path
        ``.npy``, ``.npz``, ``.png``, ``.jpg``, ``.jpeg``, ``.tif``, ``.tiff``, ``.nii`` or ``.nii.gz``.
    key : str, optional
        Name of the array in an ``.npz``. Without it the only array is taken, or the one named ``values``.
    channel : int, optional
        Which channel of a colour picture to take, counted from 0.

    Returns
    -------
    ndarray
        The samples, C-contiguous, in native byte order, with the dtype of the file (truth values as uint8).
        Pictures are (rows, columns), TIFF stacks (pages, rows, columns), NIfTI volumes (i, j, k) as stored:
        with their integer dtype if they state no scaling, otherwise scaled to float64.

    Raises
    ------
    OSError
        If the file cannot be opened.
    InputError
        If it is not what its name says, holds no numbers, or leaves a choice open.
    OptionError
        If ``key`` or ``channel`` does not apply to this kind of file.
    MissingExtraError
        If a library is needed that is not installed.
    """
    path = Path(path)
    # Missing files, directories and permissions are reported alike for all formats, before any library looks.
    with path.open("rb"):
        pass
    suffix = next((s for s in FIELD_SUFFIXES if path.name.lower().endswith(s)), None)
    if suffix is None:
        raise InputError(
            f"{path.suffix or 'a name without a suffix'} is not a kind of field that can be read",
            code="suffix",
            remedy="one of " + ", ".join(FIELD_SUFFIXES),
        )
    if key is not None and suffix != ".npz":
        raise OptionError(f"a key names an array of an .npz file, not of {suffix}", code="key")
    if channel is not None and suffix not in _PICTURES:
        raise OptionError(f"a channel is part of a picture, not of {suffix}", code="channel")
    if suffix in (".npy", ".npz"):
        return _numbers(_read_numpy(path, key))
    if suffix in _PICTURES:
        return _numbers(_pick_channel(*_PICTURES[suffix](path), channel))
    return _numbers(_read_nifti(path))


@contextmanager
def _reading(what: str) -> Iterator[None]:
    """Turn what a library raises on a bad file into one error of ours.

    Parsers raise whatever they stumble over (KeyError, SyntaxError, struct.error, zlib.error, OSError without
    a number ...), so everything is caught here but our own errors and those of the operating system.
    """
    try:
        yield
    except IsoError:
        raise
    except MemoryError as exc:
        raise LimitError(f"not enough memory to read this {what}", code="memory") from exc
    except Exception as exc:
        if isinstance(exc, OSError) and exc.errno is not None:
            raise
        if "DecompressionBombError" in (type(exc).__name__, type(exc.__cause__).__name__):
            raise LimitError(
                f"the picture is larger than the picture library accepts ({_one_line(exc)})",
                code="picture-size",
                remedy="save it as TIFF or .npy",
            ) from exc
        raise InputError(f"cannot be read as {what} ({_one_line(exc)})", code="unreadable") from exc


def _one_line(exc: Exception) -> str:
    text = " ".join(str(exc).split())
    return text[:200] or type(exc).__name__


def _numbers(array: Field) -> Field:
    """Check that ``array`` holds real numbers; native byte order and C order."""
    if array.dtype.names is not None:
        raise InputError(f"holds records ({', '.join(array.dtype.names)}), not numbers", code="dtype")
    if array.dtype.kind == "b":
        array = array.astype(np.uint8)
    if array.dtype.kind not in "iuf":
        kinds = {"O": "Python objects", "S": "strings", "U": "strings", "c": "complex numbers", "M": "dates"}
        held = kinds.get(array.dtype.kind, "values that are not real numbers")
        raise InputError(f"holds {held} (dtype {array.dtype}), not real numbers", code="dtype")
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


# ---- NumPy ----------------------------------------------------------------------------------------------------------


def _read_numpy(path: Path, key: str | None) -> Field:
    with path.open("rb") as file:
        magic = file.read(6)
    # numpy takes anything else for a pickle and says so, which would lead the user astray.
    if magic != b"\x93NUMPY" and magic[:4] not in (b"PK\x03\x04", b"PK\x05\x06"):
        raise InputError("is not a NumPy file", code="unreadable")
    with _reading("NumPy file"):
        loaded = _array(lambda: np.load(path, allow_pickle=False))
        if isinstance(loaded, np.ndarray):
            if key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            return loaded
        with loaded:
            return _member(loaded, key)


def _member(archive: Any, key: str | None) -> Field:
    names = list(archive.files)
    if key is None:
        if len(names) == 1:
            key = names[0]
        elif DEFAULT_KEY in names:
            key = DEFAULT_KEY
        elif not names:
            raise InputError("holds no arrays", code="key")
        else:
            raise InputError(
                f"holds {len(names)} arrays: {_listing(archive)}", code="key", remedy="name one with --key"
            )
    elif key not in names:
        raise InputError(f"holds no array {key!r}, but: {_listing(archive) or 'nothing'}", code="key")
    field = _array(lambda: archive[key])
    if not isinstance(field, np.ndarray):  # numpy returns the bytes of a member that is no .npy
        raise InputError(f"{key!r} is not an array", code="key")
    return field


def _listing(archive: Any, limit: int = 20) -> str:
    parts = []
    for name in archive.files[:limit]:
        try:
            shape = str(archive[name].shape)
        except Exception:  # an unreadable neighbour must not hide the names of the others
            shape = "unreadable"
        parts.append(f"{name} {shape}")
    if len(archive.files) > limit:
        parts.append("...")
    return ", ".join(parts)


def _array(load: Callable[[], Any]) -> Any:
    try:
        return load()
    except ValueError as exc:
        if "Object arrays" in str(exc):
            raise InputError("holds Python objects, not real numbers", code="dtype") from exc
        raise


# ---- Pictures -------------------------------------------------------------------------------------------------------


def _read_picture(path: Path) -> tuple[Field, int | None]:
    """PNG or JPEG: the samples, and which axis is that of the colour channels."""
    imageio = optional("imageio.v3", extra="image", purpose=f"reading {path.suffix}")
    with _reading("picture"):
        # The first picture: the rest of an animated PNG or of a camera's JPEG are previews and further frames.
        picture = np.asarray(imageio.imread(path, plugin="pillow", index=0))
        if picture.ndim == 2:
            return picture, None
        with path.open("rb") as file:
            head = file.read(26)
        # Signature, then IHDR with width, height, bit depth: pillow silently halves 16-bit colour to 8 bits.
        if head.startswith(b"\x89PNG") and head[24] == 16 and picture.dtype.itemsize == 1:
            raise InputError(
                "is a colour picture of 16 bits per channel, which the PNG reader cannot keep",
                code="depth",
                remedy="save it as 16-bit grey PNG, or as TIFF",
            )
        return picture, picture.ndim - 1


def _read_tiff(path: Path) -> tuple[Field, int | None]:
    """TIFF: the samples, and which axis is that of the colour channels."""
    tifffile = optional("tifffile", extra="image", purpose=f"reading {path.suffix}")
    with _reading("TIFF"), tifffile.TiffFile(path) as tiff:
        if not tiff.series:
            raise InputError("holds no picture", code="unreadable")
        if len(tiff.series) != 1:
            shapes = ", ".join(str(series.shape) for series in tiff.series[:20])
            raise InputError(
                f"holds {len(tiff.series)} pictures of different kinds: {shapes}",
                code="series",
                remedy="save the one you mean as a file of its own",
            )
        series = tiff.series[0]
        if series.keyframe.photometric == tifffile.PHOTOMETRIC.PALETTE:
            raise InputError("holds indices of a palette, not samples", code="palette", remedy="save it as grey")
        axes = str(series.axes)
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        try:
            picture = series.asarray()
        except (ValueError, ImportError) as exc:
            # without the library some compressions are said to need it, and of others a module is not found
            if isinstance(exc, ValueError) and "imagecodecs" not in str(exc):
                raise
            picture = _read_compressed(path, series.shape, series.dtype, exc)
        return np.asarray(picture), colour


def _read_compressed(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any], reason: Exception) -> Field:
    """Pictures packed in a way that tifffile leaves to a large extra library; pillow often knows it, too."""
    imageio = optional("imageio.v3", extra="image", purpose="reading a compressed TIFF")
    missing = MissingExtraError(
        f"reading this TIFF needs another library ({_one_line(reason)})", code="missing-extra",
        remedy="pip install imagecodecs, or save it without compression",
    )  # fmt: skip
    try:
        picture = np.asarray(imageio.imread(path, plugin="pillow", index=0))
    except Exception:
        raise missing from None
    # Pillow has fewer sample types than TIFF; what it would have converted is not what is stored.
    if picture.shape != tuple(shape) or picture.dtype != dtype.newbyteorder("="):
        raise missing
    return picture


def _pick_channel(picture: Field, colour: int | None, channel: int | None) -> Field:
    count = 1 if colour is None else picture.shape[colour]
    if channel is not None and not 0 <= channel < count:
        raise OptionError(f"there is no channel {channel}: the picture has {count}, counted from 0", code="channel")
    if colour is None:
        return picture
    if channel is None:
        if count > 1:
            raise InputError(
                f"is a picture of {count} channels, colours or bands",
                code="colour",
                remedy=f"take one with --channel 0 to {count - 1}, or convert it to one",
            )
        channel = 0
    return np.take(picture, channel, axis=colour)


_PICTURES: dict[str, Callable[[Path], tuple[Field, int | None]]] = {
    ".png": _read_picture,
    ".jpg": _read_picture,
    ".jpeg": _read_picture,
    ".tif": _read_tiff,
    ".tiff": _read_tiff,
}

FIELD_SUFFIXES: tuple[str, ...] = (".npy", ".npz", *_PICTURES, ".nii", ".nii.gz")


# ---- NIfTI ----------------------------------------------------------------------------------------------------------


def _scaled(raw: Field, slope: float, inter: float) -> Field | None:
    """Samples that need no floats: those of a volume without scaling, or integers by whole numbers; else None."""
    if (slope, inter) == (1.0, 0.0):
        return raw
    if raw.dtype.kind not in "iu" or not (slope.is_integer() and inter.is_integer()):
        return None
    info = np.iinfo(raw.dtype)
    ends = [int(end) * int(slope) + int(inter) for end in (info.min, info.max)]
    for kind in ("int32", "int64"):
        if np.iinfo(kind).min <= min(*ends, int(slope)) and max(*ends, int(slope)) <= np.iinfo(kind).max:
            scaled: Field = raw.astype(kind)
            scaled *= int(slope)
            scaled += int(inter)
            return scaled
    return None


def _read_nifti(path: Path) -> Field:
    nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
    with _reading("NIfTI volume"):
        stored = nibabel.load(path).dataobj
        volume = _scaled(np.asarray(stored.get_unscaled()), float(stored.slope), float(stored.inter))
        if volume is None:
            volume = np.asarray(stored)
    # Headers have at least three axes; a picture, or one volume of a series, ends in axes of length 1.
    while volume.ndim > 2 and volume.shape[-1] == 1:
        volume = volume[..., 0]
    if volume.ndim > 3:
        raise InputError(f"holds a series of volumes, of shape {volume.shape}", code="shape", remedy="save one alone")
    return volume
