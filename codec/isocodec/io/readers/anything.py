"""Whatever holds a field, as a `Field`: files, URLs, open files, and what other libraries have in memory."""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import InputError, OptionError, plain
from ...field.sampled import Field
from ...storage.content import is_file, is_url, local
from .engines import is_labelled_file, read_labelled
from .hdf5 import HDF5_SUFFIXES, attribute_text, dataset
from .images import is_itk, is_nibabel, itk_field, nibabel_field
from .labelled import is_labelled, labelled_field
from .missing import missing_samples, read_nodata
from .place import read_place
from .read import read_field
from .recognition import of_kind
from .source import source_of


def read(
    source: Any,
    *,
    key: str | None = None,
    channel: int | None = None,
    frame: int | None = None,
    kind: str | None = None,
    samples: int | None = None,
    follow: bool = False,
) -> Field:
    """Read a sampled field with all that its source says of it.

    Parameters
    ----------
    source : str, path, file object, or what another library holds
        A file of one of the formats of the command line; a URL (``https://``, ``s3://``, .. as fsspec knows them); a
        file opened in binary mode; an ``xarray.DataArray``, or a ``Dataset`` with ``key``; an image of nibabel or of
        SimpleITK; an array. A `Field` stays as it is.
    key : str, optional
        Name of the array in a file or a ``Dataset`` that holds several.
    channel : int, optional
        Channel of a colour picture, counted from 0.
    frame : int, optional
        Which of a series, counted from 0.
    kind : str, optional
        Format of a URL or a file object, as a suffix: ``".tif"``. Without it the name or the first bytes tell.
    samples : int, optional
        How many samples there may be at most; `isocodec.limits.FIELD_SAMPLES` if not given.
    follow : bool
        Read other files that a file names by a path.

    Returns
    -------
    Field
        Values with the axes and the type that they have in the source, placed in the coordinates that it states:
        x, y (, z), of medical volumes to the right, the front and upwards.

    Raises
    ------
    OSError
        If a file cannot be opened.
    InputError
        If it cannot be read, or leaves a choice open.
    LimitError
        If there are more samples than may be read.
    OptionError
        If an option does not apply to this source.
    MissingExtraError
        If a library is needed that is not installed.

    Warns
    -----
    UserWarning
        Of what the source says and a field cannot keep; also in ``Field.remarks``.
    """
    field = _read(source, key, channel, frame, kind, samples, follow)
    for remark in field.remarks:
        warnings.warn(remark, stacklevel=2)
    return field


def is_described(thing: Any) -> bool:
    """Whether something holds more than an array does, which would be lost if it were taken for one."""
    return isinstance(thing, Field) or is_labelled(thing) or is_nibabel(thing) or is_itk(thing)


def _read(
    source: Any, key: str | None, channel: int | None, frame: int | None, kind: str | None, samples: int | None,
    follow: bool,
) -> Field:
    if isinstance(source, Field):
        return source
    if hasattr(source, "data_vars"):
        source = _variable(source, key)
        key = None
    described = is_labelled(source) or is_nibabel(source) or is_itk(source)
    if (described or isinstance(source, np.ndarray)) and (key, channel, kind) != (None, None, None):
        name = next(n for n, v in (("key", key), ("channel", channel), ("kind", kind)) if v is not None)
        raise OptionError(f"{name} is for files, not for a {type(source).__name__}", code=name)
    if is_labelled(source):
        return labelled_field(source if frame is None else source.isel({source.dims[0]: frame}))
    if is_nibabel(source):
        return nibabel_field(source, frame)
    if is_itk(source):
        return itk_field(source, frame)
    if is_url(source) or is_file(source):
        with local(source, of_kind(kind), samples) as path:
            return _of_file(path, key, channel, frame, samples, follow)
    if isinstance(source, str | os.PathLike):
        if kind is not None:
            raise OptionError("kind is for URLs and open files; the suffix of a path tells its format", code="kind")
        return _of_file(source, key, channel, frame, samples, follow)
    values = np.ma.asanyarray(source) if isinstance(source, np.ma.MaskedArray) else np.asarray(source)
    if frame is not None:
        values = values[frame]
    mask = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    return Field(np.asarray(values), mask)


def _variable(dataset: Any, key: str | None) -> Any:
    """The array of a Dataset that a key names, or the only one with two axes or more."""
    fields = [name for name, one in dataset.data_vars.items() if one.ndim > 1]
    if key is None and len(fields) == 1:
        key = fields[0]
    if key not in dataset.data_vars:
        names = ", ".join(plain(str(name)) for name in fields[:20]) or "none"
        raise InputError(f"a Dataset with the arrays {names}", code="key", remedy="choose one with key=")
    return dataset[key]


def _of_file(
    path: str | os.PathLike[str], key: str | None, channel: int | None, frame: int | None, samples: int | None,
    follow: bool,
) -> Field:
    source = source_of(path, samples, follow)
    if is_labelled_file(source):
        return read_labelled(source, key, frame)
    values = read_field(path, key=key, channel=channel, frame=frame, samples=samples, follow=follow)
    gone = missing_samples(values, read_nodata(path, key, follow=follow))
    if values.dtype.kind == "f":
        gone &= ~np.isnan(values)
    place = read_place(path, values.ndim, key, samples=samples, follow=follow).record
    remarks = (place.remark,) if place.remark else ()
    field = Field(values, gone if gone.any() else None, place if place.placed else None, remarks=remarks)
    if source.named(*HDF5_SUFFIXES):
        with dataset(source, key) as stored:
            name = attribute_text(stored, "long_name") or str(stored.name).strip("/")
            return replace(field, name=plain(name), unit=attribute_text(stored, "units"))
    return field
