"""Contours: points and cells of a curve or surface, their placement, and conversions for other libraries."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MissingExtraError, OptionError
from ..extras import optional
from ..field.labelling import has_names, name_of, noun_of
from ..field.meshed import Mesh
from ..field.placement import Placement
from ..field.reference_system import system_of
from ..field.sampled import Field
from .areas import areas_of, geometry_of, lifted, polygons
from .capping import capped_mesh
from .sampling import mean_along, sampled
from .seam import joined


@dataclass(frozen=True, eq=False)
class Contour:
    """An isocontour (n = 2) or isosurface (n = 3): points, and segments or triangles between them.

    Orientation, n = 2: going from ``points[cells[i, 0]]`` to ``points[cells[i, 1]]``, in the plane with axis 0 as x and
    axis 1 as y (right-handed), higher values lie on the left. ``skimage.measure.find_contours`` uses the same direction
    with ``positive_orientation="high"``, and the opposite one with its default ``"low"``, since it defines left and
    right with rows as y and columns as x.

    Orientation, n = 3: by the right-hand rule in index coordinates (axes 0, 1, 2 right-handed), the normals of the
    triangles point towards lower values.

    Attributes
    ----------
    points : (P, n) float64
        Index coordinates in samples, with axes in the order of the sampled array.
    cells : (M, n) int64
        Indices into ``points``: directed segments (n = 2) or triangles (n = 3). In a contour each point is the start
        of at most one segment and the end of at most one.
    isovalue : float
    shape : tuple of int
        Samples along each axis of the grid; empty on a mesh, in whose coordinates the points then are.
    complete : bool
        False if the contour was drawn before all of its data had arrived, or from a file that ends within a layer.
    placement : Placement or None
        Where samples lie in the world; None if the file does not state it.
    metadata : dict of str to str
        Notes of the file that had been read.
    masked : bool
        Whether samples are missing, so that lines may end, and surfaces have edges, at unit cells with a missing
        corner.
    origin_above : bool or None
        Whether the first sample lies above the isovalue; None if that is not known yet.
    at_points : dict of str to (P,) or (P, k) float64
        Further values at the points, by name (see `with_values`).
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    isovalue: float
    shape: tuple[int, ...]
    complete: bool = True
    placement: Placement | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    origin_above: bool | None = None
    masked: bool = False
    at_points: dict[str, NDArray[np.float64]] = field(default_factory=dict)

    def __repr__(self) -> str:
        pieces = "segments" if self.n == 2 else "triangles"
        return (
            f"Contour(isovalue={self.isovalue:g}, {len(self.points)} points, {len(self.cells)} {pieces}, "
            f"shape={self.shape}, complete={self.complete})"
        )

    @property
    def n(self) -> int:
        """Dimension of the domain: 2 for curves, 3 for surfaces."""
        return self.cells.shape[1]

    @cached_property
    def placed(self) -> NDArray[np.float64]:
        """The points in the coordinates x, y (, z) of the placement, (P, n) float64; (P, 3) on a plane in space.

        Without a placement, the unit is the cell: in 2-D, x runs along axis 1 and y along axis 0; in 3-D, x, y, z are
        the axes 0, 1, 2.
        """
        return self.place(self.points)

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert points in index coordinates to those of the placement, as `placed` does, (P, n) float64 both."""
        if self.placement is not None and self.placement.placed:
            return self.placement.place(points)
        return points[:, ::-1] if len(self.shape) == 2 else points

    @property
    def flat(self) -> Contour:
        """The contour in coordinates within its plane, if that lies in space (see `Placement.flat`); else itself."""
        placement = self.placement
        return self if placement is None or not placement.in_space else replace(self, placement=placement.flat)

    @property
    def bent(self) -> bool:
        """Whether each sample has its own coordinates, so that straight lines may be curved in the world."""
        return self.placement is not None and self.placement.coordinates is not None

    @property
    def joined(self) -> Contour:
        """The contour with its two ends joined along periodic axes that close in the world.

        At the seam, index coordinates jump, but world coordinates do not. Returns the contour itself if no axis closes.
        """
        if self.placement is None or not self.placement.closes:
            return self
        return self.part(*joined(self.points, self.cells, self.shape, self.placement.periodic))

    def part(self, kept: NDArray[np.int64], cells: NDArray[np.int64]) -> Contour:
        """The contour with some of its points, by their numbers (K,), and cells (M, n) between these."""
        at_points = {name: values[kept] for name, values in self.at_points.items()}
        return replace(self, points=self.points[kept], cells=cells, at_points=at_points)

    def sample(self, values: ArrayLike | Field | Mesh) -> NDArray[np.float64]:
        """Interpolate other values at the points: a dose on an organ, a velocity on a vortex.

        Parameters
        ----------
        values : array_like, Field or Mesh
            Numbers in the shape of the grid that the contour was made from, or, for vectors, with a last axis of k
            components. A Field with a matrix may be of another grid, if the contour has a placement, too: it is sampled
            in the places of the points. On a mesh: the Mesh, whose values (V,), or (F, V) for F fields, are at its
            points; this needs PyVista.

        Returns
        -------
        (P,) or (P, k) float64
            On the grid of the contour, linear along the edge of the grid, or diagonal, on which a point lies, and
            multilinear where it lies on none, as on another grid; on a mesh linear in its cells. NaN where a sample
            next to the point is missing, and outside the field or the mesh.

        Raises
        ------
        InputError
            If the values are not numbers, have another shape and no place, or have another reference system.
        MissingExtraError
            For a mesh, if PyVista is not installed.
        """
        return sampled(self, values)

    def with_values(self, **values: ArrayLike | Field | Mesh) -> Contour:
        """Keep other values at the points, by name, as `sample` takes them; for files and objects made of the contour.

        Tables of lines have their mean along each line, other files and objects the value of each point.
        """
        return replace(self, at_points=self.at_points | {name: self.sample(each) for name, each in values.items()})

    @property
    def frame(self) -> NDArray[np.float64] | None:
        """Steps along each axis in x, y (, z), (n, n) float64; with coordinates, in a cell of the contour; on a plane
        in space (3, 2).

        None without a placement.
        """
        if self.placement is None:
            return None
        return self.placement.frame(self.points[len(self.points) // 2] if len(self.points) else None)

    def along(self, walk: list[int]) -> NDArray[np.float64]:
        """World coordinates of consecutive points, (K, n) float64; periodic ones continue across their ends."""
        places = self.placed[walk]
        for c, period in enumerate(self.placement.periods if self.placement is not None else ()):
            if period:
                places[:, c] = np.unwrap(places[:, c], period=period)
        return places

    @cached_property
    def lines(self) -> list[NDArray[np.float64]]:
        """Polylines of an isocontour, (K, 2) float64 each, with points in order (see Orientation).

        First the open ones, which start and end at the border of the grid (or at missing samples, or where data have
        not arrived yet), then the closed ones, which repeat their first point at the end, as in ``find_contours``.

        Raises
        ------
        OptionError
            For an isosurface.
        """
        return [self.points[walk] for walk in self.walks]

    @cached_property
    def walks(self) -> list[list[int]]:
        """Indices of the points of each polyline, in the order of `lines`."""
        if self.n != 2:
            raise OptionError("only an isocontour (n = 2) has lines; a surface has points and cells", code="dimension")
        following = np.full(len(self.points), -1, dtype=np.int64)
        following[self.cells[:, 0]] = self.cells[:, 1]
        starts_line = following >= 0
        starts_line[self.cells[:, 1]] = False

        # Plain lists, since walking along numpy scalars would take several times as long.
        step = following.tolist()
        walks = []
        for first in [*np.flatnonzero(starts_line).tolist(), *range(len(step))]:
            if step[first] < 0:
                continue
            walk = [first]
            point = first
            while (after := step[point]) >= 0:
                walk.append(after)
                step[point] = -1
                point = after
            walks.append(walk)
        return walks

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """GeoJSON-like ``MultiLineString`` of an isocontour, for shapely, geopandas and others.

        Coordinates are tuples ``(x, y)`` of `placed`. Without a placement, swapping the axes mirrors the plane: with x
        to the right and y upwards, higher values are on the right; if rows run southwards, on the left.

        Raises
        ------
        AttributeError
            For an isosurface, so that ``hasattr`` is False.
        """
        if self.n != 2:
            raise AttributeError("__geo_interface__: a surface has no GeoJSON geometry")
        whole = self.joined
        coordinates = tuple(tuple(map(tuple, whole.along(walk).tolist())) for walk in whole.walks)
        return {"type": "MultiLineString", "coordinates": coordinates}

    @cached_property
    def mirrored(self) -> bool:
        """Whether the way from index coordinates to those of the placement turns left into right."""
        frame = self.flat.frame
        return bool(self.n == 2 and self.shape) if frame is None else bool(np.linalg.det(frame) < 0)

    @property
    def placed_cells(self) -> NDArray[np.int64]:
        """Segments or triangles (M, n) between the points of `placed`.

        Triangles are flipped if the placement mirrors, so that they are counter-clockwise as seen from lower values.
        """
        return self.cells[:, ::-1] if self.n == 3 and self.mirrored else self.cells

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """Unit vectors (P, n) at the points of `placed`, towards lower values: means over the cells around each,
        weighted by their size; 0 where a point has no cell. On a plane in space (P, 3)."""
        if self.placement is not None and self.placement.in_space:
            ends = self.placement.lifted(np.concatenate([np.zeros((1, 2)), self.flat.normals]))
            return ends[1:] - ends[0]
        placed = self.placed
        cells = self.placed_cells
        out = np.zeros_like(placed)
        if self.n == 3:
            a, b, c = (placed[cells[:, k]] for k in range(3))
            across = np.cross(b - a, c - a)
        else:
            along = placed[cells[:, 1]] - placed[cells[:, 0]]
            # in index coordinates, higher values are on the left
            across = np.stack([along[:, 1], -along[:, 0]], axis=1) * (-1 if self.mirrored else 1)
        for k in range(cells.shape[1]):
            np.add.at(out, cells[:, k], across)
        length = np.linalg.norm(out, axis=1, keepdims=True)
        return np.asarray(np.divide(out, length, out=np.zeros_like(out), where=length > 0))

    def flip(self) -> Contour:
        """Exchange the sides of the curve or surface: cells are reversed, and normals point to higher values.

        For fields whose inside is the part below the isovalue, such as distance fields.
        """
        above = None if self.origin_above is None else not self.origin_above
        return replace(self, cells=self.cells[:, ::-1].copy(), origin_above=above)

    def areas(self, *, above: bool = True, valid: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Make polygons of the part of the grid where values lie above the isovalue, or not above it.

        Parameters
        ----------
        above : bool
            Which part.
        valid : (s0, s1) array_like of bool, optional
            For a file with missing samples, its valid samples (`IsoFile.valid`). The contour must have been decoded
            with ``through_holes``; areas are closed along unit cells with a missing corner.

        Returns
        -------
        dict
            GeoJSON ``MultiPolygon`` in the coordinates of `placed`, exterior rings counter-clockwise in these and
            holes clockwise; ``shapely.geometry.shape`` takes it. The two parts share the contour and make up the box,
            from the first sample to the last along each axis, without cells that have a missing corner. On a plane in
            space points have three coordinates, and rings are counter-clockwise in the coordinates of `flat`.

        Raises
        ------
        OptionError
            For an isosurface, if samples are missing and ``valid`` is not given, or if ``valid`` has a different shape.
        TruncatedError
            If the curve ends inside the grid, since only a part of a layer has arrived.
        MissingExtraError
            If shapely is not installed.
        """
        return geometry_of(lifted(areas_of(self, above=above, valid=valid), self.placement))

    def capped(self, *, above: bool = True) -> Contour:
        """Make the closed boundary of the part of the grid where values lie above the isovalue, or not above it.

        Parameters
        ----------
        above : bool
            Which part.

        Returns
        -------
        Contour
            A closed surface: the points of the isosurface, followed by those of the caps; the triangles of the
            isosurface, followed by those of the caps, which lie in the faces of the grid (from the first sample to the
            last along each axis). Normals point out of the part. It has no values of `with_values` yet.

        Raises
        ------
        OptionError
            For an isocontour, or if samples are missing.
        TruncatedError
            If the surface ends inside the grid, since only a part of a layer has arrived.
        MissingExtraError
            If shapely is not installed.
        """
        points, cells = capped_mesh(self, above, Contour)
        return replace(self, points=points, cells=cells, at_points={})

    def to_shapely(self) -> Any:
        """Convert an isocontour to a ``shapely.MultiLineString``.

        Raises
        ------
        OptionError
            For an isosurface.
        MissingExtraError
            If shapely is not installed.
        """
        if self.n != 2:
            raise OptionError("to_shapely needs a curve", code="dimension", remedy="use to_trimesh")
        whole = self.joined
        return polygons().MultiLineString([whole.along(walk) for walk in whole.walks])

    def to_geodataframe(self) -> Any:
        """Convert an isocontour to a ``geopandas.GeoDataFrame`` in the reference system of the file.

        There is a row for each line, with ``isovalue`` (``label`` and, if labels have names, ``name`` of a file of
        labels), ``closed``, ``complete``, and the mean along the line of each of the values of `with_values`.

        Raises
        ------
        OptionError
            For an isosurface, and for values of several components.
        MissingExtraError
            If geopandas is not installed.
        """
        geopandas = optional("geopandas", extra="vector", purpose="making tables of lines")
        shapely = polygons()
        whole = self.joined
        walks = whole.walks
        owner = np.repeat(np.arange(len(walks)), [len(walk) for walk in walks])
        places = np.concatenate([whole.along(walk) for walk in walks]) if walks else np.zeros((0, 2))
        columns = {
            **self.columns(len(walks)),
            "closed": np.array([len(walk) > 2 and walk[0] == walk[-1] for walk in walks], np.bool_),
            "complete": np.full(len(walks), self.complete),
            **{name: [mean_along(whole.along(walk), values[walk]) for walk in walks]
               for name, values in whole.at_points.items()},
        }
        return geopandas.GeoDataFrame(columns, geometry=shapely.linestrings(places, indices=owner),
                                      crs=system_of(self.placement))

    def columns(self, rows: int) -> dict[str, Any]:
        """Columns of a table: the isovalue, or the label and, if the file names any, its name."""
        notes = self.metadata
        out: dict[str, Any] = {noun_of(notes): np.full(rows, float(self.isovalue))}
        if has_names(notes):
            out["name"] = [name_of(self.isovalue, notes)] * rows
        return out

    def to_trimesh(self) -> Any:
        """Convert an isosurface to a ``trimesh.Trimesh``, with its points as vertices, in the same order.

        Raises
        ------
        OptionError
            For an isocontour of the plane.
        MissingExtraError
            If trimesh is not installed.
        """
        if self.n != 3:
            raise OptionError("to_trimesh needs a surface", code="dimension", remedy="use to_shapely")
        trimesh = optional("trimesh", extra="mesh", purpose="making a mesh of trimesh")
        whole = self.joined
        mesh = trimesh.Trimesh(vertices=whole.placed, faces=whole.placed_cells, process=False,
                               vertex_attributes=whole.at_points)
        return mesh.copy()  # what is done to it does not move the contour

    def to_pyvista(self) -> Any:
        """Convert to a ``pyvista.PolyData`` of lines, or of triangles with normals; cells have the value ``isovalue``
        (``label`` of a file of labels).

        Raises
        ------
        MissingExtraError
            If pyvista is not installed.
        """
        pyvista = optional("pyvista", extra="vtk", purpose="making a mesh of pyvista")
        whole = self.joined
        placed = whole.placed
        points = np.pad(placed, ((0, 0), (0, 3 - placed.shape[1])))
        if self.n == 2:
            rows: list[int] = [n for walk in whole.walks for n in (len(walk), *walk)]
            mesh = pyvista.PolyData(points, lines=np.array(rows, np.int64))
        else:
            mesh = pyvista.PolyData(points, faces=np.insert(whole.placed_cells, 0, 3, axis=1).ravel())
            if len(points):
                mesh.point_data.active_normals = whole.normals
        if self.placement is not None and self.placement.space:
            mesh.field_data["SPACE"] = [self.placement.space]
        mesh.point_data.update(whole.at_points)
        mesh.cell_data[noun_of(self.metadata)] = np.full(mesh.n_cells, float(self.isovalue))
        return mesh

    def to_napari(self) -> tuple[Any, dict[str, Any], str]:
        """Convert to a layer of napari, in index coordinates as those of an image of the field.

        Returns
        -------
        tuple
            Data, keywords and type, as ``napari.layers.Layer.create`` takes them: ``"shapes"`` with a path for each
            line, or ``"surface"`` with points, triangles and a value for each point: the first of `with_values` that
            has one component, or else the isovalue.
        """
        named = {"name": f"{noun_of(self.metadata)} {self.isovalue:.12g}", "metadata": dict(self.metadata)}
        if self.n == 2:
            return self.lines, {**named, "shape_type": "path"}, "shapes"
        usual = np.full(len(self.points), float(self.isovalue))
        values = next((values for values in self.at_points.values() if values.ndim == 1), usual)
        return (self.points, self.cells, values), named, "surface"

    def to_xarray(self) -> Any:
        """Convert to an ``xarray.Dataset``.

        Its variables are ``x``, ``y`` (, ``z``) along ``point``, ``index`` with the index coordinates, and ``cells``
        with indices of points, and the values of `with_values`; isovalue, shape and notes are attributes.

        Raises
        ------
        MissingExtraError
            If xarray is not installed.
        """
        xarray = optional("xarray", extra="labelled", purpose="making a Dataset")
        columns = {name: ("point", column) for name, column in zip("xyz", self.placed.T, strict=False)}
        about = {"isovalue": float(self.isovalue), "shape": list(self.shape), "complete": int(self.complete)}
        more = {name: (("point", "component")[: values.ndim], values) for name, values in self.at_points.items()}
        return xarray.Dataset(
            {**more, "index": (("point", "axis"), self.points), "cells": (("cell", "corner"), self.placed_cells)},
            coords=columns, attrs={**self.metadata, **about},
        )

    def _repr_html_(self) -> str:
        """Draw the contour as HTML for notebooks, with facts about it."""
        from ..plotting.panels import html_of

        pieces = "segments" if self.n == 2 else "triangles"
        facts = {
            noun_of(self.metadata): f"{self.isovalue:.12g}", "points": f"{len(self.points):,}",
            pieces: f"{len(self.cells):,}",
        }
        if self.shape:
            facts["samples"] = " x ".join(map(str, self.shape))
        if not self.complete:
            facts["complete"] = "no"
        return html_of([self], facts)

    def _repr_png_(self) -> bytes | None:
        """Draw a picture for notebooks; None without matplotlib."""
        from ..plotting.panels import contour_picture

        try:
            return contour_picture([self])
        except MissingExtraError:
            return None
