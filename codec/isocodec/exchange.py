"""Contours for other libraries and notebooks: what users ask of a contour beside its points and cells."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import MissingExtraError, OptionError

if TYPE_CHECKING:
    from .drawing.contour import Contour



class Exchange:
    """The part of `Contour` that makes objects of other libraries.

    Coordinates are those of `Contour.placed`: of the placement, or in samples without one.
    """

    @cached_property
    def mirrored(self: Any) -> bool:
        """Whether the way from index coordinates to those of the placement turns left into right."""
        frame = self.frame
        return bool(self.n == 2 and self.shape) if frame is None else bool(np.linalg.det(frame) < 0)

    @property
    def placed_cells(self: Any) -> NDArray[np.int64]:
        """Segments or triangles (M, n) between the points of `placed`, of which triangles are turned where those are
        mirrored: counter-clockwise seen from lower values."""
        turned: NDArray[np.int64] = self.cells[:, ::-1] if self.n == 3 and self.mirrored else self.cells
        return turned

    @cached_property
    def normals(self: Any) -> NDArray[np.float64]:
        """Unit vectors (P, n) at the points of `placed`, towards lower values: means over the cells around each,
        weighted by their size; 0 where there is none."""
        placed = self.placed
        cells = self.placed_cells
        out = np.zeros_like(placed)
        if self.n == 3:
            a, b, c = (placed[cells[:, k]] for k in range(3))
            across = np.cross(b - a, c - a)
        else:
            along = placed[cells[:, 1]] - placed[cells[:, 0]]
            # in index coordinates higher values are on the left
            across = np.stack([along[:, 1], -along[:, 0]], axis=1) * (-1 if self.mirrored else 1)
        for k in range(cells.shape[1]):
            np.add.at(out, cells[:, k], across)
        length = np.linalg.norm(out, axis=1, keepdims=True)
        return np.asarray(np.divide(out, length, out=np.zeros_like(out), where=length > 0))

    def flip(self: Any) -> Contour:
        """The same curve or surface with above and below exchanged: cells run the other way, normals point to higher
        values. For distance fields and densities whose inside is what lies below."""
        above = None if self.origin_above is None else not self.origin_above
        flipped: Contour = replace(self, cells=self.cells[:, ::-1].copy(), origin_above=above)
        return flipped

    def to_shapely(self: Any) -> Any:
        """A ``shapely.MultiLineString`` of an isocontour.

        Raises
        ------
        OptionError
            For an isosurface.
        MissingExtraError
            If shapely is not installed.
        """
        if self.n != 2:
            raise OptionError("a surface is no geometry of shapely", code="dimension", remedy="use to_trimesh")
        whole = self.joined
        return _io("areas").polygons().MultiLineString([whole.along(walk) for walk in whole.walks])

    def to_geodataframe(self: Any) -> Any:
        """A ``geopandas.GeoDataFrame`` of an isocontour: a row for each line, with ``isovalue``, ``closed`` and
        ``complete``, in the reference system of the file.

        Raises
        ------
        OptionError
            For an isosurface.
        MissingExtraError
            If geopandas is not installed.
        """
        return _io("vector").table_of([self])

    def to_trimesh(self: Any) -> Any:
        """A ``trimesh.Trimesh`` of an isosurface: its points as vertices, in their order.

        Raises
        ------
        OptionError
            For an isocontour of the plane.
        MissingExtraError
            If trimesh is not installed.
        """
        if self.n != 3:
            raise OptionError("a curve is no mesh of trimesh", code="dimension", remedy="use to_shapely")
        return _io("surfaces").mesh_of(self).copy()  # what is done to it does not move the contour

    def to_pyvista(self: Any) -> Any:
        """A ``pyvista.PolyData``: lines, or triangles with normals; cells have the value ``isovalue``.

        Raises
        ------
        MissingExtraError
            If pyvista is not installed.
        """
        pyvista = _io("extras").optional("pyvista", extra="vtk", purpose="making a mesh of pyvista")
        whole = self.joined
        placed = whole.placed
        points = np.pad(placed, ((0, 0), (0, 3 - placed.shape[1])))
        if self.n == 2:
            rows: list[int] = [n for walk in whole.walks for n in (len(walk), *walk)]
            mesh = pyvista.PolyData(points, lines=np.array(rows, np.int64))
        else:
            mesh = pyvista.PolyData(points, faces=np.insert(whole.placed_cells, 0, 3, axis=1).ravel())
            mesh.point_data["Normals"] = whole.normals
        mesh.cell_data["isovalue"] = np.full(mesh.n_cells, float(self.isovalue))
        return mesh

    def to_xarray(self: Any) -> Any:
        """An ``xarray.Dataset``: variables ``x``, ``y`` (, ``z``) along ``point``, ``index`` with the index
        coordinates, ``cells`` with numbers of points; the isovalue, shape and notes as attributes.

        Raises
        ------
        MissingExtraError
            If xarray is not installed.
        """
        xarray = _io("extras").optional("xarray", extra="xarray", purpose="making a Dataset")
        columns = {name: ("point", column) for name, column in zip("xyz", self.placed.T, strict=False)}
        about = {"isovalue": float(self.isovalue), "shape": list(self.shape), "complete": int(self.complete)}
        return xarray.Dataset(
            {"index": (("point", "axis"), self.points), "cells": (("cell", "corner"), self.placed_cells)},
            coords=columns, attrs={**self.metadata, **about},
        )

    def _repr_html_(self: Any) -> str:
        """A drawing for notebooks, in the page itself, with what is known of the contour."""
        pieces = "segments" if self.n == 2 else "triangles"
        facts = {"isovalue": f"{self.isovalue:g}", "points": f"{len(self.points):,}", pieces: f"{len(self.cells):,}"}
        if self.shape:
            facts["samples"] = " x ".join(map(str, self.shape))
        if not self.complete:
            facts["complete"] = "no"
        html: str = _io("inline").page_of([self], facts)
        return html

    def _repr_png_(self: Any) -> bytes | None:
        """A picture for notebooks; none without matplotlib."""
        try:
            picture: bytes = _io("picture").contour_picture([self])
        except MissingExtraError:
            return None
        return picture


def _io(name: str) -> Any:
    """A module of the readers and writers, loaded when needed: what kernels know of a contour does not hang on it."""
    return import_module(f".io.{name}", __package__)
