"""Curves and surfaces out, in the formats of other tools.

Coordinates are those of the file's placement (`Contour.placed`), of GeoJSON in longitude and latitude where the
reference system is known. Without a placement, and always in an SVG, the unit is the cell: in the plane x runs along
axis 1 of the array and y along axis 0, sample (i, j) at x = j, y = i; in space x, y, z are the axes 0, 1, 2.
"""

from __future__ import annotations

import io
import os
from collections.abc import Collection, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...drawing.areas import polygons
from ...drawing.pictures.picture import contour_picture, matplotlib_figure
from ...errors import OptionError
from ...field.placement import CRS
from ...storage.atomic import write_bytes
from .dxf import ezdxf, render_dxf
from .geojson import render_areas, render_lines
from .output_formats import Cost, Format, find_suffix
from .pmtiles import libraries as pmtiles_libraries
from .pmtiles import render_pmtiles
from .simplices import MESHES
from .surfaces import render_groups, render_single, trimesh_for
from .vector import VECTOR_SUFFIXES, libraries, render_table, unpacked
from .vtp import render_vtp

if TYPE_CHECKING:
    from ...drawing.contour import Contour
    from ...drawing.tessellation import Tessellation


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
    """That areas can be written to ``path``, and the libraries for them are there.

    Raises
    ------
    OptionError, MissingExtraError
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _OF_AREAS:
        raise OptionError(f"areas can be written as {', '.join(_OF_AREAS)} only", code="suffix")
    polygons()
    check_libraries(suffix)


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
"""Memory that `render_sides` takes."""
_OF_AREAS = (".geojson", *VECTOR_SUFFIXES)


def render_sides(
    contours: Iterable[Contour], suffix: str, side: str, valid: NDArray[np.bool_] | None = None, keep: bool = False
) -> bytes:
    """The file of the areas ``above`` or ``below`` a contour, or of each of several, or of the ``bands`` between them;
    ``valid`` as in `areas`.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `areas`.
    """
    if suffix == ".geojson":
        return render_areas(contours, side, valid, keep)
    return render_table(contours, suffix, side, valid)


def render_contour(
    contour: Contour | Collection[Contour], suffix: str, dimension: int | None = None, keep: bool = False
) -> bytes:
    """The whole file of a contour, or of those of several isovalues, in the format that ``suffix`` (``".ply"``) names.

    Several are gone through once, so that each may be drawn when it is asked for and dropped after that; ``dimension``
    says then of how many axes the field is. With ``keep`` GeoJSON has the coordinates of the file's reference system;
    without, they become longitude and latitude where that system is known. Of a Shapefile the result is an archive of
    its files, as `put` takes it.

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
    if suffix == ".geojson":
        return render_lines(contours, keep)
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
    suffix = check_suffix(path)
    put(Path(path), suffix, render_contour(contour, suffix))


def put(path: Path, suffix: str, data: bytes) -> None:
    """Write a file that was rendered: each of its files, if these are several (.shp), whole or not at all.

    Raises
    ------
    OSError
    """
    for part, content in unpacked(path, data) if suffix == ".shp" else [(path, data)]:
        write_bytes(part, content)


# ---- Both dimensions ------------------------------------------------------------------------------------------------


def _npz(contour: Contour) -> bytes:
    """Points in samples; the placement, if there is one, beside them."""
    arrays: dict[str, Any] = {
        "points": contour.points,
        "cells": contour.cells,
        "isovalue": np.float64(contour.isovalue),
        "shape": np.asarray(contour.shape, dtype=np.int64),
    }
    if contour.placement is not None and contour.placement.matrix is not None:
        arrays["placement"] = contour.placement.matrix
        arrays["crs"] = np.asarray(contour.metadata.get(CRS, ""))
    if contour.bent:
        arrays["placed"] = contour.placed
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


# ---- 2-D ------------------------------------------------------------------------------------------------------------


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


# ---- All formats ----------------------------------------------------------------------------------------------------


def _single(suffix: str, cost: Cost) -> Format:
    return Format((3,), partial(render_single, suffix=suffix), partial(trimesh_for, suffix), cost={3: cost})


def _groups(suffix: str, cost: Cost) -> Format:
    return Format((3,), partial(render_groups, suffix=suffix), partial(trimesh_for, suffix), (3,), {3: cost})


def _map(suffix: str) -> Format:
    return Format((2,), partial(render_table, suffix=suffix), libraries, (2,), {2: Cost(160, 100)})


PICTURE = {2: Cost(200, 160, fixed=1 << 25), 3: Cost(80, 260, fixed=1 << 27, kept=0)}
"""Memory that pictures take, by axes of the field."""
_FORMATS: dict[str, Format] = {
    ".npz": Format((2, 3), _npz, cost={2: Cost(40, 48), 3: Cost(40, 48)}),
    ".png": Format((2, 3), contour_picture, matplotlib_figure, several=(2, 3), cost=PICTURE),
    ".geojson": Format((2,), render_lines, several=(2,), cost={2: Cost(300, 240, kept=100)}),
    ".svg": Format((2,), _svg, several=(2,), cost={2: Cost(120, 100, kept=50)}),
    **{suffix: _map(suffix) for suffix in VECTOR_SUFFIXES},
    ".pmtiles": Format((2,), render_pmtiles, pmtiles_libraries, (2,), {2: Cost(480, 150, 1 << 20, kept=300)}),
    ".dxf": Format((2, 3), render_dxf, ezdxf, (2, 3), {2: Cost(500, 200, 1 << 23), 3: Cost(600, 900, 1 << 24)}),
    ".vtp": Format((2, 3), render_vtp, several=(2, 3), cost={2: Cost(120, 100), 3: Cost(200, 160)}),
    ".ply": _single(".ply", Cost(70, 52)),
    ".stl": _single(".stl", Cost(120, 280)),
    ".off": _single(".off", Cost(170, 220)),
    ".obj": _groups(".obj", Cost(140, 200)),
    ".glb": _groups(".glb", Cost(90, 90)),
    ".3mf": _groups(".3mf", Cost(600, 900)),
}

CURVE_SUFFIXES: tuple[str, ...] = tuple(_FORMATS)
