"""Curves and surfaces out, in the formats of other tools.

GeoJSON, PLY, STL and OBJ have the coordinates of the file's placement (`Contour.placed`). Without one, and always in an
SVG, the unit is the cell: in the plane x runs along axis 1 of the array and y along axis 0, sample (i, j) at x = j,
y = i; in space x, y, z are the axes 0, 1, 2 of the array.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.placement import CRS
from .areas import areas, polygons
from .atomic import write_bytes
from .extras import optional
from .mesh import MESHES
from .output_formats import Cost, Format, find_suffix
from .picture import PICTURE, contour_picture, matplotlib_figure

if TYPE_CHECKING:
    from ..drawing.contour import Contour
    from ..drawing.tessellation import Tessellation

_EPSG = re.compile("EPSG:([1-9][0-9]{0,5})")
_DEGREES = "4326"


def check_suffix(path: str | os.PathLike[str], dimension: int | None = None) -> str:
    """The suffix of ``path`` if it names a format that can be written (for fields of ``dimension`` axes).

    Raises
    ------
    OptionError
        Naming the formats that work.
    """
    kind = {2: "a curve (of a 2-D field)", 3: "a surface (of a 3-D field)"}.get(dimension or 0, f"{dimension}-D")
    return find_suffix(_FORMATS, path, dimension, kind)


def check_areas(path: str | os.PathLike[str]) -> None:
    """That areas can be written to ``path``, and the library for them is there.

    Raises
    ------
    OptionError, MissingExtraError
    """
    if Path(path).suffix.lower() != ".geojson":
        raise OptionError("areas can be written as .geojson only", code="suffix")
    polygons()


def check_libraries(suffix: str) -> None:
    """Find out before the work that the library which writes ``suffix`` is missing.

    Raises
    ------
    MissingExtraError
    """
    _FORMATS[suffix].check_libraries()


def holds_several(suffix: str, dimension: int) -> bool:
    """Whether a file of this format can hold contours of several isovalues of a field of ``dimension`` axes."""
    return dimension in _FORMATS[suffix].several


def cost_of(suffix: str, dimension: int) -> Cost:
    """Memory that writing a contour of a field of ``dimension`` axes takes."""
    return _FORMATS[suffix].cost[dimension]


def check_mesh(path: str | os.PathLike[str], dimension: int | None = None) -> str:
    """The suffix of ``path``, if a mesh (of a field of ``dimension`` axes) can be written to it.

    Raises
    ------
    OptionError, MissingExtraError
    """
    suffix = find_suffix(MESHES, path, dimension, f"the mesh of a {dimension}-D field")
    MESHES[suffix].check_libraries()
    return suffix


def render_mesh(mesh: Tessellation, suffix: str) -> bytes:
    """The whole file of a mesh in the format that ``suffix`` (``".vtu"``) names.

    Raises
    ------
    OptionError, MissingExtraError
        As `check_mesh`.
    """
    return bytes(MESHES[check_mesh(f"_{suffix}", len(mesh.shape))].render(mesh))


AREAS = Cost(300, 240, kept=100)
"""Memory that `render_areas` takes."""


def render_contour(contour: Contour | Collection[Contour], suffix: str, dimension: int | None = None) -> bytes:
    """The whole file of a contour, or of those of several isovalues, in the format that ``suffix`` (``".ply"``) names.

    Several are gone through once, so that each may be drawn when it is asked for and dropped after that; ``dimension``
    says then of how many axes the field is.

    Raises
    ------
    OptionError
        If there is no such format for the dimension of the contour, or it cannot hold several.
    MissingExtraError
        If a library is needed that is not installed.
    """
    contours: Collection[Contour] = contour if isinstance(contour, Collection) else [contour]
    if dimension is None:
        dimension = len(next(iter(contours)).shape)
    suffix = check_suffix(f"_{suffix}", dimension)
    if holds_several(suffix, dimension):
        return bytes(_FORMATS[suffix].render(contours))
    if len(contours) > 1:
        raise OptionError(f"{suffix} cannot hold several isovalues", code="suffix", remedy="write one after the other")
    return bytes(_FORMATS[suffix].render(next(iter(contours))))


def write_contour(contour: Contour | Collection[Contour], path: str | os.PathLike[str]) -> None:
    """Write a contour, or several, in the format that the suffix of ``path`` names; whole, or not at all.

    Raises
    ------
    OptionError, MissingExtraError
        As :func:`render_contour`.
    OSError
        If the file cannot be written.
    """
    write_bytes(path, render_contour(contour, Path(path).suffix))


# ---- Both dimensions ------------------------------------------------------------------------------------------------


def _npz(contour: Contour) -> bytes:
    """Points in samples; the placement, if there is one, beside them."""
    arrays: dict[str, Any] = {
        "points": contour.points,
        "cells": contour.cells,
        "isovalue": np.float64(contour.isovalue),
        "shape": np.asarray(contour.shape, dtype=np.int64),
    }
    if contour.placement is not None:
        arrays["placement"] = contour.placement
        arrays["crs"] = np.asarray(contour.metadata.get(CRS, ""))
    if contour.mapped is not None:
        arrays["placed"] = contour.placed
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


# ---- 2-D ------------------------------------------------------------------------------------------------------------


def _geojson(contours: Iterable[Contour]) -> bytes:
    return _features(contours, lambda contour: _feature(contour, contour.__geo_interface__))


def render_areas(contours: Iterable[Contour], above: bool, valid: NDArray[np.bool_] | None = None) -> bytes:
    """A GeoJSON file of the areas on one side of a contour, or of each of several; ``valid`` as in `areas`.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `areas`.
    """
    side = "above" if above else "below"
    return _features(contours, lambda contour: _feature(contour, areas(contour, above=above, valid=valid), area=side))


def _feature(contour: Contour, geometry: dict[str, Any], **properties: str) -> bytes:
    """The text of a feature with the properties isovalue, shape and complete; an empty curve is an empty geometry."""
    return _json(
        {
            "type": "Feature",
            "properties": {
                "isovalue": float(contour.isovalue),
                "shape": [int(n) for n in contour.shape],
                "complete": bool(contour.complete),
                **properties,
            },
            "geometry": geometry,
        }
    )


def _features(contours: Iterable[Contour], feature: Callable[[Contour], bytes]) -> bytes:
    """The file of the feature of a contour, or of a collection of several of the same placement.

    A reference system other than that of GeoJSON, degrees of longitude and latitude, is named as GeoJSON once had it.
    """
    texts, system = [], b""
    for contour in contours:
        texts.append(feature(contour))
        found = _EPSG.fullmatch(contour.metadata.get(CRS, ""))
        if contour.frame is not None and found and found[1] != _DEGREES:
            name = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{found[1]}"}}
            system = b',"crs":' + _json(name)
        # of a contour no more is kept than its text
        del contour
    if len(texts) == 1:
        return b"".join([texts[0][:-1], system, b"}\n"])
    return b"".join([b'{"type":"FeatureCollection","features":[', b",".join(texts), b"]", system, b"}\n"])


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def _svg(contours: Iterable[Contour]) -> bytes:
    """A group for each isovalue, in it a path for each polyline.

    The view box is that of the picture's pixels, so that the two can be overlaid.
    """
    strokes = {"fill": "none", "stroke": "black", "stroke-width": "1", "stroke-linejoin": "round"}
    size: dict[str, str] = {}
    groups = []
    for contour in contours:
        rows, columns = contour.shape
        # samples are the centres of pixels
        size = {"width": str(columns), "height": str(rows), "viewBox": f"-0.5 -0.5 {columns} {rows}"}
        group = ElementTree.Element("g", strokes)
        ElementTree.SubElement(group, "title").text = f"isovalue {contour.isovalue:g}"
        for line in contour.lines:
            # The width is then one of the screen: a contour has none of its own.
            ElementTree.SubElement(group, "path", {"d": _path(np.asarray(line)), "vector-effect": "non-scaling-stroke"})
        groups.append(ElementTree.tostring(group))
        del contour, group
    root = ElementTree.tostring(ElementTree.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size}))
    head = b'<?xml version="1.0" encoding="UTF-8"?>\n' + root.replace(b" />", b">")
    return b"".join([head, *groups, b"</svg>\n"])


def _path(line: np.ndarray) -> str:
    closed = len(line) > 2 and bool(np.array_equal(line[0], line[-1]))
    corners = [f"{_decimal(x)},{_decimal(y)}" for y, x in line[: -1 if closed else None].tolist()]
    return "M" + " ".join(corners) + ("Z" if closed else "")


def _decimal(number: float) -> str:
    # Six places are a millionth of a cell: finer than any stroke, and half the size of all digits.
    text = f"{number:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


# ---- 3-D ------------------------------------------------------------------------------------------------------------


def _trimesh(suffix: str) -> Any:
    return optional("trimesh", extra="mesh", purpose=f"writing {suffix}")


def _mesh(contour: Contour, suffix: str) -> bytes:
    """PLY (binary) and STL (binary) hold single precision by custom; OBJ has eight decimal places of a cell."""
    trimesh = _trimesh(suffix)
    if suffix == ".obj" and len(contour.cells) == 0:
        # The library would write keywords without numbers, which no reader takes.
        return b"# empty isosurface\n"
    contour = contour.joined
    # What mirrors space turns triangles over.
    frame = contour.frame
    mirrored = frame is not None and np.linalg.det(frame) < 0
    cells = contour.cells[:, ::-1] if mirrored else contour.cells
    # Without processing: the vertices and their order are ours.
    mesh = trimesh.Trimesh(vertices=contour.placed, faces=cells, process=False)
    steps = [1.0] if frame is None else np.linalg.norm(frame, axis=0)
    places = {"digits": 8 + max(0, math.ceil(-math.log10(min(steps))))} if suffix == ".obj" else {}
    data = mesh.export(file_type=suffix[1:], **places)
    return data.encode() if isinstance(data, str) else bytes(data)


def _surface_format(suffix: str, cost: Cost) -> Format:
    return Format((3,), lambda contour: _mesh(contour, suffix), lambda: _trimesh(suffix), cost={3: cost})


_FORMATS: dict[str, Format] = {
    ".npz": Format((2, 3), _npz, cost={2: Cost(40, 48), 3: Cost(40, 48)}),
    ".png": Format((2, 3), contour_picture, matplotlib_figure, several=(2, 3), cost=PICTURE),
    ".geojson": Format((2,), _geojson, several=(2,), cost={2: Cost(300, 240, kept=100)}),
    ".svg": Format((2,), _svg, several=(2,), cost={2: Cost(120, 100, kept=50)}),
    ".ply": _surface_format(".ply", Cost(70, 52)),
    ".stl": _surface_format(".stl", Cost(120, 280)),
    ".obj": _surface_format(".obj", Cost(140, 200)),
}

CURVE_SUFFIXES: tuple[str, ...] = tuple(_FORMATS)
