"""Read fields, series and meshes of whatever holds them: files, URLs, open files, objects of other libraries."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import InputError, OptionError, plain
from ...field.cropping import Box, cropped
from ...field.framed import Frames
from ...field.meshed import Mesh
from ...field.missing import HOLE
from ...field.sampled import Field, check_missing
from ...storage.content import is_file, is_url, local
from .from_nibabel import OpenedNibabel, is_nibabel
from .from_simpleitk import OpenedItk, is_itk
from .from_vtk import OpenedVtk, blocks_of, holds_grid, is_vtk, mesh_of
from .from_xarray import OpenedLabels, is_labelled, variable
from .input_formats import holds_mesh, open_file, read_mesh, recognised
from .mesh_formats import HEIGHT
from .opened import IN_MEMORY, Choice, Opened
from .reading import about, check_frame
from .slices import FieldsInTurn

_OF_MESHES = ("key", "samples", "frame", "follow", "average_cells", "classes", "labels")
"""Options that apply to meshes and points."""


@dataclass(frozen=True)
class ReadOptions:
    """Options of `load`, as those of `read`."""

    key: str | None = None
    channel: int | None = None
    frame: int | None = None
    frames: bool = False
    axis: int | None = None
    missing: str = HOLE
    nodata: float | None = None
    kind: str | None = None
    samples: int | None = None
    follow: bool = False
    slice_tolerance: float | None = None
    band: int | None = None
    bbox: Box | None = None
    average_cells: bool = False
    classes: tuple[int, ...] = ()
    labels: bool = False

    @property
    def choice(self) -> Choice:
        """Choice from a source that holds several things; raises `OptionError` for a band below 1."""
        channel = self.channel
        if self.band is not None:
            if self.band < 1 or channel is not None:
                raise OptionError("a band is counted from 1, and the same as a channel", code="channel",
                                  remedy="give one of them")
            channel = self.band - 1
        return Choice(self.key, channel, self.slice_tolerance, self.bbox, self.frame, self.average_cells, self.classes,
                      self.labels)


def read(
    source: Any, *, key: str | None = None, channel: int | None = None, frame: int | None = None,
    frames: bool = False, axis: int | None = None, missing: str = HOLE, nodata: float | None = None,
    kind: str | None = None, samples: int | None = None, follow: bool = False, slice_tolerance: float | None = None,
    band: int | None = None, bbox: Box | None = None, average_cells: bool = False, classes: Sequence[int] = (),
    labels: bool = False,
) -> Field | Frames | Mesh:
    """Read a sampled field, a series of them, or values on a mesh, with all that its source states.

    Parameters
    ----------
    source : str, path, file object, or what another library holds
        A file of one of the formats of the command line; a URL (``https://``, ``s3://``, .. as fsspec knows them); a
        file opened in binary mode; an ``xarray.DataArray``, or a ``Dataset`` with ``key``; an image of nibabel or of
        SimpleITK; a grid, a mesh or blocks of VTK or PyVista; an array. A `Field` stays as it is.
    key : str, optional
        Name of the array in a file or a ``Dataset`` that holds several. Without it the only array is taken (of HDF5,
        NetCDF and Zarr the only one of two or more axes), or the one named ``values``. Of a folder of DICOM the series;
        of a mesh or of scattered points the values, without it the only ones, those named ``z``, or else none. Of VTK
        ``velocity:x``, ``velocity:magnitude`` and ``block/velocity:x`` name components of vectors, and blocks.
    channel : int, optional
        Channel of a colour picture, counted from 0.
    frame : int, optional
        Which of a series, counted from 0: along the first axis of an array or of a TIFF stack, the last axis of
        volumes that have more than three.
    frames : bool
        Give a series: each field is read when it is asked for. With ``frame``, the slices of that volume.
    axis : int, optional
        The axis that counts the frames, instead of the first one (the last one of volumes with four).
    missing : {"hole", "below", "above", "nearest"}
        What an encoder does with missing samples.
    nodata : float, optional
        Value of missing samples besides NaN, instead of the one that the source states. NaN: none.
    kind : str, optional
        Format of a URL or a file object, as a suffix: ``".tif"``. Without it the name or the first bytes decide.
    samples : int, optional
        How many samples there may be at most, those of all channels and frames that are read on the way included;
        `isocodec.limits.FIELD_SAMPLES` if not given. Checked before anything is allocated.
    follow : bool
        Read other files that a file names by a path.
    slice_tolerance : float, optional
        Distance in mm that slices of DICOM may lie from even steps; a hundredth of a step if not given.
    band : int, optional
        Band of a raster, counted from 1; channel ``band - 1`` of a picture.
    bbox : sequence of float, optional
        Read only samples within these coordinates of the placement: least x, y (, z), then largest x, y (, z). Rasters
        are read as far as that goes.
    average_cells : bool
        Of VTK, average values of cells at their points. Without, those of grids are samples at the centres of cells.
    classes : sequence of int
        Of LAS and LAZ, the classes of points that are taken; without them all but noise (7, 18).
    labels : bool
        Of a picture or raster with a palette, read its indices, as labels, instead of its colours.

    Returns
    -------
    Field, Frames or Mesh
        A Mesh of the files of meshes, point clouds, tables of points and vector files. Otherwise values with the axes
        and the type that they have in the source (truth values of files are uint8), placed in the coordinates that it
        states: x, y (, z), of medical volumes to the right, the front and upwards. Pictures are (rows, columns), TIFF
        stacks (pages, rows, columns), volumes (i, j, k) as stored: with their integer type if they state no scaling or
        one by whole numbers, otherwise scaled to float64, as packed arrays of NetCDF are.

    Raises
    ------
    OSError
        If a file cannot be opened.
    InputError
        If it cannot be read, or leaves a choice open; the message begins with its name.
    LimitError
        If there are more samples than may be read.
    OptionError
        If an option does not apply to this source.
    MissingExtraError
        If a library is needed that is not installed.

    Warns
    -----
    UserWarning
        Of what the source states and a field cannot keep; also in ``Field.remarks``.
    """
    found = load(
        source, ReadOptions(
            key, channel, frame, frames, axis, missing, nodata, kind, samples, follow, slice_tolerance, band, bbox,
            average_cells, tuple(classes), labels,
        )
    )
    for remark in getattr(found.fields if isinstance(found, Frames) else found, "remarks", ()):
        warnings.warn(remark, stacklevel=2)
    return found


def read_field(source: Any) -> Field:
    """Read as `read` does, but raise `InputError` if the source holds a series or a mesh."""
    found = read(source)
    if not isinstance(found, Field):
        raise InputError("holds no field but " + ("a series" if isinstance(found, Frames) else "a mesh"), code="field")
    return found


def load(source: Any, options: ReadOptions) -> Field | Frames | Mesh:
    """Read as `read` does, but leave remarks to the caller; those of a series are an attribute of its ``fields``."""
    check_missing(options.missing)
    if options.axis is not None and not options.frames:
        raise OptionError("axis is for series", code="frame", remedy="add frames=True")
    if isinstance(source, Field | Frames | Mesh):
        return source
    of_mesh = isinstance(source, str | os.PathLike) and not is_url(source) and holds_mesh(
        source, options.key, options.follow)
    if of_mesh or (is_vtk(source) and not holds_grid(source, options.key)):
        return _mesh(source, options)
    with open_source(source, options) as opened:
        if not options.frames:
            field = replace(opened.field(options.frame, nodata=options.nodata), missing=options.missing)
            return field if options.bbox is None else cropped(field, options.bbox)
        slices = opened.frames(options.axis, options.frame)
        slices = slices if options.bbox is None else slices.within(options.bbox)
        # the samples may be read later
        make, left_out = opened.fields(slices, options.nodata), opened.remarks
        return Frames(FieldsInTurn(slices, make, options.missing, opened.hand_over(), left_out))


def _mesh(source: Any, options: ReadOptions) -> Mesh:
    """Read a mesh, or scattered points, with the values that a key names, or the only ones, or those named ``z``."""
    for option in fields(ReadOptions):
        if option.name not in _OF_MESHES and getattr(options, option.name) != option.default:
            raise OptionError(f"{option.name} does not apply to meshes and points", code=option.name)
    if is_vtk(source):
        found = mesh_of(blocks_of(source), options.choice)
    else:
        found = read_mesh(source, options.samples, options.choice, follow=options.follow)
    name = options.key
    if name is None and (len(found.values) == 1 or HEIGHT in found.values):
        name = HEIGHT if HEIGHT in found.values else next(iter(found.values))
    return found.mesh(name)


def open_source(source: Any, options: ReadOptions) -> Opened:
    """Open what `read` reads, without reading samples; raises as `read`."""
    key = options.key
    if hasattr(source, "data_vars"):
        source, key = variable(source, key), None
    choice = replace(options.choice, key=key)
    if options.classes:
        raise OptionError("classes are of point clouds (LAS, LAZ)", code="classes")
    if is_vtk(source):
        return OpenedVtk(source, choice)
    make = next((make for is_one, make in _OBJECTS if is_one(source)), None)
    if make:
        asked = {"key": key, "channel": choice.channel, "kind": options.kind,
                 "average_cells": options.average_cells or None}
        for name, value in asked.items():
            if value is not None:
                raise OptionError(f"{name} is for files, not for a {type(source).__name__}", code=name)
        return make(source)
    if is_url(source) or is_file(source):
        return _elsewhere(source, choice, options)
    if isinstance(source, str | os.PathLike):
        if options.kind is not None:
            raise OptionError("kind is for URLs and open files; the suffix of a path names its format", code="kind")
        return open_file(source, choice, samples=options.samples, follow=options.follow)
    return OpenedArray(source)


def _elsewhere(source: Any, choice: Choice, options: ReadOptions) -> Opened:
    """Open what a URL or a file object holds, by a file here that is kept as long as it is open."""
    name = source if is_url(source) else getattr(source, "name", None)
    label = plain(name) if isinstance(name, str) else ""
    kind = options.kind and f".{options.kind.lstrip('.')}"
    with ExitStack() as held, about(label):
        path = held.enter_context(local(source, recognised if kind is None else lambda *_: kind, options.samples))
        opened = open_file(path, choice, samples=options.samples, follow=options.follow, label=label)
        # closed last, after what reads it
        return opened.holding(held.pop_all())


def is_described(thing: Any) -> bool:
    """Whether something holds more than an array does, which would be lost if it were taken for one."""
    return isinstance(thing, Field) or is_vtk(thing) or any(is_one(thing) for is_one, _ in _OBJECTS[:-1])


class OpenedArray(Opened):
    """An array in memory; what a masked array of NumPy masks is missing."""

    def __init__(self, array: Any) -> None:
        # whoever has a masked array has loaded numpy.ma, which takes longer than a small field
        masked = "numpy.ma" in sys.modules and isinstance(array, np.ma.MaskedArray)
        self._array = array if masked else np.asarray(array)
        if self._array.dtype.kind in "OUSV":
            raise InputError(
                f"is a {type(array).__name__}, not numbers", code="dtype",
                remedy="give a path, a URL, an open file, an array, or an object of a library that reads fields",
            )
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        self.shape, self.dtype = self._array.shape, self._array.dtype

    def _known(self, frame: int | None) -> Any:
        if frame is None:
            return self._array
        check_frame(frame, len(self._array) if self._array.ndim > 2 else 0)
        return self._array[frame]

    def _slices(self, frame: int | None) -> Any:
        return self._known(frame)

    def _values(self, frame: int | None) -> NDArray[Any]:
        return np.asarray(self._known(frame))


_OBJECTS: tuple[tuple[Callable[[Any], bool], Callable[[Any], Opened]], ...] = (
    (is_labelled, OpenedLabels), (is_nibabel, OpenedNibabel), (is_itk, OpenedItk),
    (lambda thing: isinstance(thing, np.ndarray), OpenedArray),
)
"""Objects in memory, by a test of their type; arrays come last."""
