"""Formats that are written: by suffix, what each can hold and which library writes it; whole or not at all.

Coordinates are those of the file's placement (`Contour.placed`); in GeoJSON, KML and vector tiles longitude and
latitude, if the reference system is known. Without a placement the unit is the cell: in the plane x runs along axis 1
of the array and y along axis 0, sample (i, j) at x = j, y = i; in space x, y, z are the axes 0, 1, 2.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.tessellation import Tessellation
from ..errors import InputError, IsoError, OptionError, one_line
from ..field.framed import Frames
from ..field.placement import Placement
from ..field.reference_system import is_named, short_name
from ..storage.atomic import beside
from ..verbs import OutputOptions
from . import dicom, masks, surfaces
from . import map_tables as tables
from .libraries import library
from .opener import Choice, about, load

Kind = Literal["contour", "areas", "mask", "labels", "mesh", "tin"]
"""Curves or surfaces; polygons beside curves or between them; bools of samples, or labels; the simplices under a
contour; a triangulated surface."""
LOST = 0.01
"""Largest move of points by single precision, in cells, that takes no remark."""


USUAL = OutputOptions()


@dataclass(frozen=True, eq=False)
class Areas:
    """Polygons beside curves, or between them.

    Attributes
    ----------
    contours : iterable of Contour
        Isocontours of one field with two axes; iterated over once.
    side : {"above", "below", "bands"}
    valid : (s0, s1) bool, optional
        As for `Contour.areas`.
    """

    contours: Iterable[Contour]
    side: str
    valid: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class SampleMask:
    """Samples of a field that lie above an isovalue, or are valid (bool); or the label of each, with names in notes."""

    values: NDArray[Any]
    placement: Placement | None = None
    notes: Mapping[str, str] = field(default_factory=dict)


class Thing(NamedTuple):
    """Properties of a content that decide which formats can hold it.

    Attributes
    ----------
    kind : str
    n : int or None
        Axes of the field; None if unknown.
    several : bool
        Whether it has several isovalues.
    """

    kind: Kind
    n: int | None = None
    several: bool = False

    @property
    def text(self) -> str:
        """Name in messages: ``"a curve (of a 2-D field)"``."""
        if self.kind == "contour":
            return {2: "a curve (of a 2-D field)", 3: "a surface (of a 3-D field)"}.get(self.n or 0, "a contour")
        name = {"mask": "a mask", "mesh": "a mesh", "tin": "a triangulated surface"}.get(self.kind, self.kind)
        return name + f" of a {self.n}-D field" * bool(self.n and self.kind != "tin")


class Format(NamedTuple):
    """A writer.

    Attributes
    ----------
    suffixes : mapping of str to str
        To the name that the library has for the format.
    holds : str
        Kinds of content with the numbers of axes of their fields: ``"contour2 contour3 tin2"``.
    write : callable
        ``write(what, path, job)``.
    libraries : tuple of str
        Modules that are needed.
    extra : str
        Extra of this package that installs them.
    several : bool
        Whether a file can hold several isovalues.
    states : {"", "crs", "space", "degrees", "samples"}
        Whether files name the reference system, or the sides of a body that coordinates run to, or have longitude and
        latitude; or coordinates are in samples.
    single : bool
        Whether coordinates have single precision.
    at_points : bool
        Whether files can hold further values at the points of contours, or in tables their mean along each line.
    """

    suffixes: Mapping[str, str]
    holds: str
    write: Callable[[Any, Path, Job], None]
    libraries: tuple[str, ...] = ()
    extra: str = ""
    several: bool = False
    states: str = ""
    single: bool = False
    at_points: bool = False

    def fits(self, thing: Thing) -> bool:
        """Whether files can hold a content, judged by what is known of it."""
        found = re.search(rf"{thing.kind}{thing.n or ''}", self.holds)
        return found is not None and (self.several or not thing.several)


class Job:
    """Writing of one file: its format and options, and the placement of what the writer has taken so far.

    Attributes
    ----------
    name : str
        Name that the library has for the format.
    placement : Placement or None
        Of what was taken last.
    steps : (n,) float64
        Lengths of its cells.
    """

    def __init__(self, form: Format, suffix: str, options: OutputOptions) -> None:
        self.form, self.suffix, self.options, self.name = form, suffix, options, form.suffixes[suffix]
        self.placement: Placement | None = None
        self.steps = np.ones(1)
        self._placed = self._some = False
        self._farthest = 0.0
        self._sources = dict(options.sample)
        self._samples = {name: _sampled(source) for name, source in options.sample}
        self._unknown = {*self._samples}

    @property
    def space(self) -> str | None:
        """Reference system of the body that the content lies in, in short."""
        return None if self.placement is None else self.placement.space

    def contents(self, what: Any) -> Any:
        """Convert content to what writers take, each in samples if that is asked for."""
        in_samples, free = self.options.in_samples, False

        def noted(one: Any) -> Any:
            one = replace(one, placement=None) if in_samples and isinstance(one, Contour | SampleMask) else one
            points, frame = getattr(one, "points", None), one.placement and one.placement.frame()
            if isinstance(one, Contour):
                points, frame = one.placed, one.frame
            self.placement, self.steps = one.placement, np.ones(1) if frame is None else np.linalg.norm(frame, axis=0)
            self._some |= points is None or len(points) > 0
            if self.form.single and points is not None:
                self._farthest = max(self._farthest, float(abs(points).max(initial=0)))
            on_mesh = getattr(one, "shape", None) == ()
            self._placed = free or on_mesh or (one.placement is not None and one.placement.placed)
            return one

        def turned(contour: Contour) -> Contour:
            contour = noted(self._valued(contour))
            # higher values lie on the left of lines
            mirrored = contour.n == 2 and contour.mirrored and self.form.states != "samples"
            return replace(contour, cells=contour.cells[:, ::-1].copy()) if mirrored else contour

        if isinstance(what, Areas):
            return replace(what, contours=map(noted, what.contours))
        if isinstance(what, SampleMask):
            return noted(what)
        if isinstance(what, Tessellation):
            what = surfaces.Simplices.of_mesh(replace(what, placement=None) if in_samples else what)
            return [noted(what)]
        if isinstance(what, Collection | Contour):
            return map(turned, [what] if isinstance(what, Contour) else what)
        free = what.shape is None
        pieces = [noted(surfaces.Simplices.of_tin(what, in_samples))]
        return what if self.form.states == "samples" else pieces

    def _valued(self, contour: Contour) -> Contour:
        """Add to a contour the values of other files at its points."""
        for name, values in self._samples.items():
            with about(self._sources[name]):
                contour = contour.with_values(**{name: values})
            if not np.isnan(contour.at_points[name]).all():
                self._unknown.discard(name)
        return contour

    def remarks(self) -> tuple[str, ...]:
        """One line for each loss in values or coordinates that was not asked for."""
        left_out = [f"{name}: {each}" for name, field in self._samples.items() for each in field.remarks]
        nowhere = [f"{name}: no point lies next to samples that are not missing" for name in sorted(self._unknown)]
        return (*left_out, *nowhere, *self._losses())

    def _losses(self) -> tuple[str, ...]:
        states, placement, suffix, options = self.form.states, self.placement, self.suffix, self.options
        if not self._some or states == "samples":
            return ()
        lost = float(np.spacing(np.float32(self._farthest)))
        where = "in a reference system that the file does not name" if self._placed else (
            "in samples, since the file does not state where these lie")
        rule = ", not the longitudes and latitudes that GeoJSON requires (RFC 7946)" * (states == "degrees")
        known = bool(self.space) or is_named(placement)
        unknown = not known and not options.in_samples
        name = short_name(placement.crs or "") if placement is not None else ""
        losses = {
            f"{suffix} does not state the reference system of its coordinates: {name}":
                known and states not in ("degrees", "space" if self.space else "crs"),
            f"{suffix} is written without a reference system, and its coordinates are {where}{rule}; "
            "encode with --spacing and --crs EPSG:..":
                unknown and states in ("crs", "degrees"),
            f"{suffix} states that samples lie in steps of 1 from 0, which the file does not state":
                not self._placed and "SimpleITK" in self.form.libraries,
            f"{suffix} does not keep the coordinates of its samples, which no matrix describes":
                placement is not None and placement.coordinates is not None and "mask" in self.form.holds,
            f"coordinates in {suffix} are rounded by up to {lost / 2:g}; write OBJ or use --in-samples to avoid that":
                self._placed and lost > LOST * self.steps.min(),
        }
        return tuple(text for text, given in losses.items() if given)


def _sampled(source: str) -> Any:
    """Read a field, or a mesh with values, whose values are asked for at the points of contours."""
    with about(source):
        try:
            found = load(source, Choice())
        except OSError as error:
            raise InputError(f"cannot be opened ({error.strerror or error})", code="sample") from error
        if isinstance(found, Frames):
            raise InputError("is a series, which cannot be sampled", code="frames", remedy="give a file of one frame")
        return found


# ---- Writers --------------------------------------------------------------------------------------------------------


def _as_table(what: Any, path: Path, job: Job) -> None:
    names, layer = job.options.attribute, "isolines"
    if isinstance(what, Areas):
        layer = "bands" if what.side == "bands" else "areas"
        table = tables.areas(what.contours, what.side, what.valid, names)
    elif isinstance(what, list):
        layer, table = "triangles", what[0].to_geodataframe()
    else:
        table = tables.lines(what, names)
    tables.write_table(table, path, job.name, layer=job.options.layer or layer, cell=float(job.steps.max()),
                       members={"space": job.placement.crs} if job.placement is not None and job.space else {})


def _as_samples(mask: Any, path: Path, job: Job) -> None:
    values = mask.values if isinstance(mask, SampleMask) else mask.raster()
    if job.name != "npy":  # libraries have neither truth values nor floats of two bytes
        values = values.astype({"?": np.uint8, "e": np.float32}.get(values.dtype.char, values.dtype), copy=False)
    _OF_SAMPLES[job.name](values, job.placement, path)


def _as_arrays(what: Any, path: Path, job: Job) -> None:
    """Write points in samples, in the order of the array's axes, and the placement, if there is one."""
    if isinstance(what, Iterable):
        (contour,) = what
        own = {name: np.asarray(getattr(contour, name)) for name in ("points", "cells", "isovalue", "shape")}
        arrays: Any = {**contour.at_points, **own}
        if contour.bent:
            arrays["placed"] = contour.placed
    else:
        arrays = {"points": what.points, "values": what.values, "cells": what.triangles}
        if what.removals is not None:
            arrays |= {name: getattr(what.removals, name) for name in ("order", "errors", "anticipated", "kept")}
    if job.placement is not None and job.placement.matrix is not None:
        arrays |= {"placement": job.placement.matrix, "crs": np.asarray(job.placement.crs or "")}
    np.savez(path, **arrays)


def _as_picture(what: Iterable[Contour], path: Path, job: Job) -> None:
    from ..plotting.panels import contour_picture

    path.write_bytes(contour_picture(what, job.suffix))


def _as_dicom(what: Any, path: Path, job: Job) -> None:
    with about(job.options.like):
        series = dicom.series_of(str(job.options.like))
    if isinstance(what, SampleMask):
        dicom.write_segmentation(what.values, job.placement, path, series, what.notes)
    else:
        dicom.write_stl(what, path, series)


def _in_white(values: NDArray[np.uint8], _: object, path: Path) -> None:
    pillow = library("PIL.Image", extra="pictures", purpose="writing .png")
    pillow.fromarray(values * np.uint8(255)).save(path)


_OF_SAMPLES: Mapping[str, Callable[..., None]] = {
    "tif": masks.write_raster, "nifti": masks.write_nifti, "itk": masks.write_itk, "png": _in_white,
    "npy": lambda values, _, path: np.save(path, values),
}
_SHAPES, _MAPS, _GRIDS = "contour2 areas2", "contour2 areas2 mesh2 tin2", "mask2 mask3 labels2 labels3"
_PYOGRIO: Any = {"write": _as_table, "libraries": ("pyogrio", "geopandas"), "extra": "vector", "several": True,
                 "at_points": True}
_TRIMESH: Any = {"holds": "contour3 mesh2 tin2", "write": surfaces.write_trimesh, "libraries": ("trimesh",),
                 "extra": "mesh"}
_PYVISTA: Any = {"write": surfaces.write_pyvista, "libraries": ("pyvista",), "extra": "vtk", "several": True,
                 "states": "space", "at_points": True}
_VOLUMES: Any = {"holds": _GRIDS, "write": _as_samples, "extra": "volumes", "states": "space"}
_DRAWN: Any = {"write": _as_picture, "libraries": ("matplotlib",), "extra": "plot", "several": True,
               "states": "samples"}
FORMATS: tuple[Format, ...] = (
    Format({".geojson": "GeoJSON", ".geojsonl": "GeoJSONSeq", ".geojsonseq": "GeoJSONSeq"}, _MAPS, states="degrees",
           **_PYOGRIO),
    Format({".gpkg": "GPKG", ".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile", ".gml": "GML", ".sqlite": "SQLite",
            ".gmt": "OGR_GMT", ".kml": "LIBKML"}, _MAPS, states="crs", **_PYOGRIO),
    Format({".parquet": "Parquet"}, _MAPS, states="crs", **_PYOGRIO | {"libraries": ("geopandas", "pyarrow")}),
    Format({".csv": "CSV"}, _MAPS, **_PYOGRIO),
    Format({".pmtiles": "PMTiles", ".mbtiles": "MBTiles"}, _SHAPES, states="crs", **_PYOGRIO),
    Format({".dxf": "DXF"}, _SHAPES, **_PYOGRIO | {"at_points": False}),
    Format({".vtp": ""}, "contour2 contour3 mesh2 tin2", **_PYVISTA),
    Format({".vtu": "grid", ".vtk": ""}, "contour2 contour3 mesh2 mesh3 tin2", **_PYVISTA),
    Format({".glb": "glb", ".gltf": "gltf"}, several=True, states="space", at_points=True, **_TRIMESH),
    Format({".obj": "obj"}, several=True, states="space", **_TRIMESH),
    Format({".3mf": "3mf"}, several=True, **_TRIMESH | {"libraries": ("trimesh", "networkx", "lxml")}),
    Format({".off": "off"}, **_TRIMESH),
    Format({".ply": "ply"}, states="space", single=True, at_points=True, **_TRIMESH),
    Format({".stl": "stl"}, states="space", single=True, **_TRIMESH),
    Format({".tif": "tif"}, "mask2 labels2", _as_samples, ("rasterio",), "raster", states="crs"),
    Format({".nii": "nifti", ".nii.gz": "nifti"}, libraries=("nibabel",), **_VOLUMES),
    Format({".nrrd": "itk", ".mha": "itk"}, libraries=("SimpleITK",), **_VOLUMES),
    Format({".dcm": "dcm"}, "mask3 labels3 contour3", _as_dicom, ("highdicom", "pydicom", "trimesh"), "dicom",
           states="space", single=True),
    Format({".npy": "npy"}, f"mask1 {_GRIDS} tin2", _as_samples, states="samples"),
    Format({".npz": ""}, "contour2 contour3 tin2", _as_arrays, states="samples", at_points=True),
    Format({".png": ""}, "contour2 contour3", **_DRAWN),
    Format({".svg": ""}, "contour2", **_DRAWN),
    Format({".png": "png"}, "mask2", _as_samples, ("PIL",), "pictures", states="samples"),
)
SUFFIXES: tuple[str, ...] = tuple(dict.fromkeys(suffix for one in FORMATS for suffix in one.suffixes))
_TAKEN = ("isovalue", "label", "normals", "points", "cells", "shape", "placed", "placement", "crs", "file",
          *tables.TAKEN)
"""Names, in lower case, that files have for something else than values at points."""
PICTURES = (".png", ".pdf", ".svg")
"""Suffixes of steps and contour maps."""


# ---- Choice of a format ---------------------------------------------------------------------------------------------


def suffix_of(path: str | os.PathLike[str]) -> str | None:
    """Find the longest suffix of a name that belongs to a format; None without one."""
    name = Path(path).name.lower()
    found = [suffix for suffix in SUFFIXES if name.endswith(suffix) and len(name) > len(suffix)]
    return max(found, key=len, default=None)


def suffixes_of(thing: Thing) -> list[str]:
    """Suffixes of the formats that can hold a content, for help and messages."""
    return list(dict.fromkeys(suffix for one in FORMATS if one.fits(thing) for suffix in one.suffixes))


def check(
    path: str | os.PathLike[str], thing: Thing, options: OutputOptions = USUAL
) -> tuple[str, Format]:
    """Choose a format by a file's name and check, before the work begins, that it can hold a content.

    Only the suffix counts, and ``options.to`` before that; the suffix is returned in lower case. Raises `OptionError`
    with the names of formats that can hold the content, and `MissingExtraError` if a library is missing.
    """
    path = path if options.to is None else f"_.{options.to.lstrip('.')}"
    suffix, listed = suffix_of(path), suffixes_of(thing)
    if suffix is None or suffix not in listed:
        too_many = thing.several and suffix in suffixes_of(thing._replace(several=False))
        message = f"{suffix} cannot hold {'several contours' if too_many else thing.text}" if suffix else (
            f"{Path(path).suffix.lower() or 'a name without a suffix'} is not a supported output format")
        raise OptionError(message, code="suffix", remedy=f"one of {', '.join(listed)}" if listed else "no format can")
    chosen = next(one for one in FORMATS if suffix in one.suffixes and one.fits(thing))
    name = chosen.suffixes[suffix]
    refused = {
        "layer": options.layer is not None and name not in tables.LAYERED,
        "attribute": options.attribute is not None and (chosen.write is not _as_table or name in tables.UNNAMED),
        "like": options.like is not None and chosen.write is not _as_dicom,
        "sample": bool(options.sample) and not (chosen.at_points and thing.kind == "contour"),
    }
    if wrong := [name for name, given in refused.items() if given]:
        raise OptionError(f"--{wrong[0]} does not apply to {thing.text} in {suffix}", code=wrong[0],
                          remedy="leave it out" if wrong[0] != "sample" else "one of " + ", ".join(dict.fromkeys(
                              each for one in FORMATS if one.at_points and one.fits(thing) for each in one.suffixes)))
    if options.like is None and chosen.write is _as_dicom:
        raise OptionError("DICOM needs a series of the patient, whose study and frame of reference it takes",
                          code="like", remedy="give --like SERIES")
    if options.attribute is not None:
        tables.check_names(*options.attribute.split(",", 1))
    names = [options.attribute or "isovalue", *(name for name, _ in options.sample)]
    if twice := [name for name in names[1:] if name.lower() in _TAKEN or names.count(name) > 1]:
        raise OptionError(f"values at points cannot have the name {twice[0]!r} (--sample): it is taken", code="sample",
                          remedy="choose another name")
    for module in chosen.libraries:
        if find_spec(module) is None:
            library(module, extra=chosen.extra, purpose=f"writing {suffix}")
    return suffix, chosen


def thing_of(what: Any) -> Thing:
    """Find the kind of what is to be written.

    Raises `OptionError` if there is no format for it, or if there are no contours.
    """
    if isinstance(what, Contour):
        return Thing("contour", what.n)
    if isinstance(what, Tessellation):
        return Thing("mesh", what.cells.shape[1] - 1)
    if isinstance(what, Areas):
        return thing_of(what.contours)._replace(kind="areas", several=False)
    if isinstance(what, SampleMask):
        return Thing("mask" if what.values.dtype == np.bool_ else "labels", what.values.ndim)
    if hasattr(what, "raster") and hasattr(what, "triangles"):
        return Thing("tin", 2)
    if isinstance(what, Collection):
        # collections that draw contours one by one know their number of axes
        n = getattr(what, "n", None) or getattr(next(iter(what), None), "n", None)
        if n is not None:
            return Thing("contour", n, len(what) > 1)
    raise OptionError(f"a {type(what).__name__} cannot be written", code="what",
                      remedy="give contours, areas, a mask, a mesh or a triangulated surface")


# ---- Writing --------------------------------------------------------------------------------------------------------


class Written(NamedTuple):
    """Size of a file, and what its format loses of placement and precision."""

    bytes: int
    remarks: tuple[str, ...] = ()


def write(target: str | os.PathLike[str] | BinaryIO, what: Any, options: OutputOptions = USUAL) -> Written:
    """Write content in the format that the suffix of a name chooses, completely or not at all.

    An open file (standard output) needs ``options.to``. An existing GeoPackage keeps its other layers. Contours are
    iterated over once, so that each can be drawn when it is needed and released afterwards; a collection has an
    attribute ``n``, the number of axes of the field.

    Raises `OptionError` if the format cannot hold the content, `TruncatedError` if areas are asked for but the curve
    ends inside the field, `MissingExtraError` if a library is missing, and `OSError` if the file cannot be written; an
    existing file is then kept.
    """
    suffix, form = check("" if hasattr(target, "write") else target, thing_of(what), options)
    job = Job(form, suffix, options)
    with beside(target, suffix, keep=job.name == "GPKG") as path:
        try:
            form.write(job.contents(what), path, job)
        except (IsoError, MemoryError):
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            words = one_line(str(error).replace(str(path), path.name))
            raise OSError(f"cannot be written as {suffix} ({words})") from error
        size = path.stat().st_size
    return Written(size, job.remarks())
