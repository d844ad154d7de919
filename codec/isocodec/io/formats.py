"""Formats that are written: by suffix, what each can hold and which library writes it; whole or not at all.

Coordinates are those of the file's placement (`Contour.placed`); in GeoJSON, KML and vector tiles longitude and
latitude, if the reference system is known. Without a placement the unit is the cell: in the plane x runs along axis 1
of the array and y along axis 0, sample (i, j) at x = j, y = i; in space x, y, z are the axes 0, 1, 2.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..drawing.tessellation import Tessellation
from ..errors import IsoError, OptionError, one_line
from ..extras import check_installed
from ..field.placement import Placement
from ..field.reference_system import is_named, short_name
from ..storage.atomic import beside
from . import map_tables as tables
from . import masks, surfaces
from .libraries import library

Kind = Literal["contour", "areas", "mask", "labels", "mesh", "tin"]
"""Curves or surfaces; polygons beside curves or between them; bools of samples, or labels; the simplices under a
contour; a triangulated surface."""
LOST = 0.01
"""Part of a cell by which single precision may move points without a remark."""


@dataclass(frozen=True)
class OutputOptions:
    """Options of writing.

    Attributes
    ----------
    keep_crs : bool
        Write GeoJSON in the reference system of the file instead of longitude and latitude.
    in_samples : bool
        Write coordinates in samples, even if there is a placement.
    to : str or None
        Suffix of the format, if the name has none: ``".geojson"``.
    layer : str or None
        Name of the layer; if not given, ``isolines``, ``areas``, ``bands`` or ``triangles``.
    attribute : str or None
        Name of the column of isovalues, or of the two of bands: ``"low,high"``.
    """

    keep_crs: bool = False
    in_samples: bool = False
    to: str | None = None
    layer: str | None = None
    attribute: str | None = None


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
    """Samples of a field that lie above an isovalue, or are valid (bool); or the label of each."""

    values: NDArray[Any]
    placement: Placement | None = None


class Thing(NamedTuple):
    """Properties of a content that decide which formats can hold it.

    Attributes
    ----------
    kind : str
    n : int or None
        Axes of the field, as far as they are known.
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
        axes = f" with {self.n} axes" if self.n else ""
        return {"areas": "areas", "mask": f"a mask{axes}", "labels": f"labels{axes}",
                "mesh": f"the mesh of a {self.n}-D field" if self.n else "a mesh",
                "tin": "a triangulated surface"}[self.kind]


Write = Callable[[Any, Path, OutputOptions, str], None]


class Format(NamedTuple):
    """A writer.

    Attributes
    ----------
    suffixes : mapping of str to str
        To the name that the library has for the format.
    holds : mapping of str to tuple of int
        To each kind of content the numbers of axes of its fields.
    write : callable
        ``write(what, path, options, name)``.
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
    """

    suffixes: Mapping[str, str]
    holds: Mapping[Kind, tuple[int, ...]]
    write: Write
    libraries: tuple[str, ...] = ()
    extra: str = ""
    several: bool = False
    states: str = ""
    single: bool = False

    def fits(self, thing: Thing) -> bool:
        """Whether files can hold a content, as far as it is known."""
        axes = self.holds.get(thing.kind, ())
        return bool(axes) and thing.n in (None, *axes) and (self.several or not thing.several)


# ---- Writers --------------------------------------------------------------------------------------------------------


def _as_table(what: Any, path: Path, options: OutputOptions, driver: str) -> None:
    cell: list[float] = []
    where: list[Placement | None] = []

    def seen(contours: Iterable[Contour]) -> Iterable[Contour]:
        for contour in contours:
            where[:] = [contour.placement]
            cell[:] = [] if contour.frame is None else [float(np.linalg.norm(contour.frame, axis=0).max())]
            yield contour
            del contour

    usual = "isolines"
    if isinstance(what, Areas):
        usual, found = ("bands" if what.side == "bands" else "areas"), seen(what.contours)
        if what.side == "bands":
            table = tables.bands(found, what.valid, *(options.attribute or "lower,upper").split(",", 1))
        else:
            table = tables.areas(found, what.side, what.valid, options.attribute)
    elif isinstance(what, surfaces.Simplices):
        usual, where = "triangles", [what.placement]
        corners = {name: values[what.cells].sum(axis=1) if name == "above" else values[what.cells].mean(axis=1)
                   for name, values in what.at_points.items()}
        points = what.points if what.points[:, 2].any() else what.points[:, :2]
        table = tables.triangles(points, what.cells, {**what.of_cells, **corners}, what.placement)
    else:
        table = tables.lines(seen(what), options.attribute)
    place = where[0] if where else None
    members = {"space": str(place.crs)} if place is not None and place.space else {}
    tables.write_table(table, path, driver, layer=options.layer or usual, keep_crs=options.keep_crs,
                       cell=cell[0] if cell else None, members=members)


def _by_pyvista(what: Any, path: Path, options: OutputOptions, cells: str) -> None:
    mesh = what.to_pyvista() if isinstance(what, surfaces.Simplices) else surfaces.to_pyvista(what)
    surfaces.write_pyvista(mesh, path, cells == "grid")


def _by_trimesh(what: Any, path: Path, options: OutputOptions, kind: str) -> None:
    if isinstance(what, surfaces.Simplices):
        surfaces.write_meshes({"surface": what.to_trimesh()} if len(what.cells) else {}, path, kind,
                              None if what.placement is None else what.placement.space)
    else:
        surfaces.write_trimesh(what, path, kind)


def _samples(write: Callable[..., None], mask: SampleMask, path: Path, *_: Any) -> None:
    # libraries have neither truth values nor floats of two bytes
    kind = {"?": np.uint8, "e": np.float32}.get(mask.values.dtype.char)
    write(mask.values if kind is None else mask.values.astype(kind), mask.placement, path)


def _as_array(what: Any, path: Path, *_: Any) -> None:
    np.save(path, what.values if isinstance(what, SampleMask) else what.raster())


def _as_arrays(what: Any, path: Path, options: OutputOptions, _: str) -> None:
    """Write points in samples, in the order of the array's axes, and the placement, if there is one."""
    if isinstance(what, Iterable):
        contour = next(iter(what))
        placement, arrays = contour.placement, {
            "points": contour.points, "cells": contour.cells, "isovalue": np.float64(contour.isovalue),
            "shape": np.asarray(contour.shape, np.int64),
        }
        if placement is not None and placement.coordinates is not None:
            arrays["placed"] = contour.placed
    else:
        placement = surfaces.placement_of_tin(what, options.in_samples)
        arrays = {"points": what.points, "values": what.values, "cells": what.triangles}
        if what.removals is not None:
            arrays |= {name: getattr(what.removals, name) for name in ("order", "errors", "anticipated", "kept")}
    if placement is not None and placement.matrix is not None:
        arrays |= {"placement": placement.matrix, "crs": np.asarray(placement.crs or "")}
    np.savez(path, **arrays)


def write_picture(what: Any, path: Path, _: OutputOptions, suffix: str) -> None:
    """Draw contours as a picture."""
    from ..plotting.panels import contour_picture

    path.write_bytes(contour_picture(what if suffix == ".svg" else list(what), suffix))


def _as_picture(mask: SampleMask, path: Path, *_: Any) -> None:
    """Write a picture that is white where samples lie above."""
    pillow = library("PIL.Image", extra="pictures", purpose="writing .png")
    pillow.fromarray(mask.values.view(np.uint8) * np.uint8(255)).save(path)


_MAPS: Mapping[Kind, tuple[int, ...]] = {"contour": (2,), "areas": (2,), "mesh": (2,), "tin": (2,)}
_TRIANGLES: Mapping[Kind, tuple[int, ...]] = {"contour": (3,), "mesh": (2,), "tin": (2,)}
_GRIDS: Mapping[Kind, tuple[int, ...]] = {"mask": (2, 3), "labels": (2, 3)}
_PYOGRIO: Any = {"write": _as_table, "libraries": ("pyogrio", "geopandas"), "extra": "vector", "several": True}
_TRIMESH: Any = {"write": _by_trimesh, "holds": _TRIANGLES, "extra": "mesh"}
_PYVISTA: Any = {"write": _by_pyvista, "libraries": ("pyvista",), "extra": "vtk", "several": True}
FORMATS: tuple[Format, ...] = (
    Format({".geojson": "GeoJSON", ".geojsonl": "GeoJSONSeq", ".geojsonseq": "GeoJSONSeq"}, _MAPS, states="degrees",
           **_PYOGRIO),
    Format({".gpkg": "GPKG", ".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile", ".gml": "GML", ".sqlite": "SQLite",
            ".gmt": "OGR_GMT"}, _MAPS, states="crs", **_PYOGRIO),
    Format({".parquet": "Parquet"}, _MAPS, states="crs", **_PYOGRIO | {"libraries": ("geopandas", "pyarrow")}),
    Format({".csv": "CSV"}, _MAPS, **_PYOGRIO),
    Format({".kml": "LIBKML"}, _MAPS, states="crs", **_PYOGRIO),
    Format({".pmtiles": "PMTiles", ".mbtiles": "MBTiles"}, {"contour": (2,), "areas": (2,)}, states="crs", **_PYOGRIO),
    Format({".dxf": "DXF"}, {"contour": (2,), "areas": (2,)}, **_PYOGRIO),
    Format({".vtp": ""}, {"contour": (2, 3), "mesh": (2,), "tin": (2,)}, states="space", **_PYVISTA),
    Format({".vtu": "grid", ".vtk": ""}, {"contour": (2, 3), "mesh": (2, 3), "tin": (2,)}, states="space",
           **_PYVISTA),
    Format({".obj": "obj", ".glb": "glb", ".gltf": "gltf"}, libraries=("trimesh",), several=True, states="space",
           **_TRIMESH),
    Format({".3mf": "3mf"}, libraries=("trimesh", "networkx", "lxml"), several=True, **_TRIMESH),
    Format({".off": "off"}, libraries=("trimesh",), **_TRIMESH),
    Format({".ply": "ply", ".stl": "stl"}, libraries=("trimesh",), states="space", single=True, **_TRIMESH),
    Format({".tif": ""}, {"mask": (2,), "labels": (2,)}, partial(_samples, masks.write_raster), ("rasterio",),
           "raster", states="crs"),
    Format({".nii": "", ".nii.gz": ""}, _GRIDS, partial(_samples, masks.write_nifti), ("nibabel",), "volumes",
           states="space"),
    Format({".nrrd": "", ".mha": ""}, _GRIDS, partial(_samples, masks.write_itk), ("SimpleITK",), "volumes",
           states="space"),
    Format({".npy": ""}, {**_GRIDS, "mask": (1, 2, 3), "tin": (2,)}, _as_array, states="samples"),
    Format({".npz": ""}, {"contour": (2, 3), "tin": (2,)}, _as_arrays, states="samples"),
    Format({".png": ".png"}, {"contour": (2, 3)}, write_picture, ("matplotlib",), "plot", True, "samples"),
    Format({".svg": ".svg"}, {"contour": (2,)}, write_picture, ("matplotlib",), "plot", True, "samples"),
    Format({".png": ".png"}, {"mask": (2,)}, _as_picture, ("PIL",), "pictures", states="samples"),
)
SUFFIXES: tuple[str, ...] = tuple(dict.fromkeys(suffix for one in FORMATS for suffix in one.suffixes))
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

    Parameters
    ----------
    path : path
        Only the suffix is used, and ``options.to`` rather than that.
    thing : Thing
    options : OutputOptions

    Returns
    -------
    str
        The suffix, in lower case.
    Format

    Raises
    ------
    OptionError
        If the format cannot hold the content; names the formats that can.
    MissingExtraError
        If a library is missing.
    """
    path = path if options.to is None else f"_.{options.to.lstrip('.')}"
    suffix, listed = suffix_of(path), suffixes_of(thing)
    chosen = next((one for one in FORMATS if suffix in one.suffixes and one.fits(thing)), None)
    if suffix is None or chosen is None:
        if suffix is None:
            message = f"{Path(path).suffix.lower() or 'a name without a suffix'} is not a supported output format"
        elif thing.several and suffix in suffixes_of(thing._replace(several=False)):
            message = f"{suffix} cannot hold several contours"
        else:
            message = f"{suffix} cannot hold {thing.text}"
        raise OptionError(message, code="suffix", remedy=f"one of {', '.join(listed)}" if listed else "no format can")
    name = chosen.suffixes[suffix]
    refused = {
        "layer": options.layer is not None and name not in tables.LAYERED,
        "attribute": options.attribute is not None and (chosen.write is not _as_table or name in tables.UNNAMED),
    }
    for name in (name for name, wrong in refused.items() if wrong):
        raise OptionError(f"--{name} does not apply to {thing.text} in {suffix}", code=name, remedy="leave it out")
    if options.attribute is not None:
        tables.check_names(*options.attribute.split(",", 1))
    for module in chosen.libraries:
        check_installed(module, extra=chosen.extra, purpose=f"writing {suffix}")
    return suffix, chosen


def thing_of(what: Any) -> Thing:
    """Find the kind of what is to be written.

    Raises
    ------
    OptionError
        If there is no format for it, or if there are no contours.
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
    if isinstance(what, Collection) and not isinstance(what, np.ndarray | str | bytes) and len(what):
        # collections that draw contours one by one know their number of axes
        n = getattr(what, "n", None) or getattr(next(iter(what)), "n", None)
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

    Parameters
    ----------
    target : path or binary file
        An open file (standard output) needs ``options.to``. An existing GeoPackage keeps its other layers.
    what : Contour, collection of Contour, Areas, SampleMask, Tessellation or Tin
        Several contours are iterated over once, so that each can be drawn when it is needed and released afterwards;
        such a collection has an attribute ``n``, the number of axes of the field.
    options : OutputOptions

    Raises
    ------
    OptionError
        If the format cannot hold the content.
    TruncatedError
        If areas are asked for, but the curve ends inside the field.
    MissingExtraError
        If a library is missing.
    OSError
        If the file cannot be written; an existing file is kept.
    """
    suffix, form = check("" if hasattr(target, "write") else target, thing_of(what), options)
    losses = Losses(form, suffix, options)
    with beside(target, suffix, keep=form.suffixes[suffix] == "GPKG") as path:
        try:
            form.write(_prepared(what, form, options, losses), path, options, form.suffixes[suffix])
        except (IsoError, MemoryError):
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            words = one_line(str(error).replace(str(path), path.name))
            raise OSError(f"cannot be written as {suffix} ({words})") from error
        size = path.stat().st_size
    return Written(size, losses.remarks())


def _prepared(what: Any, form: Format, options: OutputOptions, losses: Losses) -> Any:
    """Convert content to what writers take, in samples if that is asked for."""

    def moved(one: Any) -> Any:
        one = replace(one, placement=None) if options.in_samples else one
        losses.see(one)
        return one

    def turned(contour: Contour) -> Contour:
        if form.write is write_picture and not contour.shape:
            raise OptionError("a picture cannot hold a curve that lies on a mesh", code="suffix", remedy="write .vtp")
        contour = moved(contour)
        # higher values lie on the left of lines
        mirrored = contour.n == 2 and contour.mirrored and form.states != "samples"
        return replace(contour, cells=contour.cells[:, ::-1].copy()) if mirrored else contour

    if isinstance(what, Areas):
        return replace(what, contours=map(moved, what.contours))
    if isinstance(what, SampleMask):
        return moved(what)
    if isinstance(what, Tessellation):
        losses.see(cells := surfaces.Simplices.of_mesh(moved(what)))
        return cells
    if isinstance(what, Collection | Contour):
        return map(turned, [what] if isinstance(what, Contour) else what)
    losses.see(placed := surfaces.Simplices.of_tin(what, options.in_samples), free=what.shape is None)
    return what if form.states == "samples" else placed


class Losses:
    """Losses of a format in the coordinates that have been written so far, but for those that were asked for."""

    def __init__(self, form: Format, suffix: str, options: OutputOptions) -> None:
        self._form, self._suffix, self._options = form, suffix, options
        self._seen = self._placed = False
        self._largest = self._step = 0.0
        self._placement: Placement | None = None

    def see(self, what: Any, free: bool = False) -> None:
        """Take a contour, a mesh, a surface or a mask into account; ``free``: it has coordinates, no samples."""
        self._placement = placement = what.placement
        points, frame = getattr(what, "points", None), None if placement is None else placement.frame()
        if isinstance(what, Contour):
            free, points, frame = not what.shape, what.placed, what.frame
        self._seen |= points is None or bool(len(points))
        if self._form.single and points is not None and len(points):
            self._largest = max(self._largest, float(abs(points).max()))
            self._step = 0.0 if frame is None else float(np.linalg.norm(frame, axis=0).min())
        self._placed = free or (placement is not None and placement.placed)

    def remarks(self) -> tuple[str, ...]:
        """One line for each loss."""
        states, placement, suffix, options = self._form.states, self._placement, self._suffix, self._options
        if not self._seen or states == "samples":
            return ()
        found = []
        space = placement is not None and bool(placement.space)
        where = "in a reference system that the file does not name" if self._placed else (
            "in samples, since the file does not state where these lie")
        remedy = "encode with --spacing and --crs EPSG:.."
        if space or is_named(placement) or options.in_samples:
            kept = ("space", "degrees") if space else ("crs", "degrees")
            if placement is not None and states not in kept:
                found.append(f"{suffix} does not state the reference system of its coordinates: "
                             f"{short_name(placement.crs or '')}")
        elif states == "degrees" and not options.keep_crs:
            found.append(f"the coordinates are {where}, not the longitudes and latitudes that GeoJSON requires "
                         f"(RFC 7946); {remedy}, or write a GeoPackage")
        elif states == "crs":
            found.append(f"{suffix} is written without a reference system, and its coordinates are {where}; {remedy}")
        if not self._placed and self._form.libraries == ("SimpleITK",):
            found.append(f"{suffix} states that samples lie in steps of 1 from 0, which the file does not state")
        if placement is not None and placement.coordinates is not None and {"mask", "labels"} & self._form.holds.keys():
            found.append(f"{suffix} does not keep the coordinates of its samples, which no matrix describes")
        lost = float(np.spacing(np.float32(self._largest)))
        if self._step and lost > LOST * self._step:
            found.append(f"coordinates in {suffix} are rounded by up to {lost / 2:g}; write OBJ or use --in-samples to "
                         "avoid that")
        return tuple(found)
