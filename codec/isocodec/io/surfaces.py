"""Curves and surfaces in space, meshes and triangulated surfaces as objects and files of trimesh and PyVista."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.separation import single
from ..drawing.tessellation import Tessellation
from ..errors import OptionError
from ..field.labelling import caption, colour_of
from ..field.placement import CRS, Placement, read_placement, unplaced
from .libraries import library
from .map_tables import table_of

if TYPE_CHECKING:
    from ..tin.tin import Tin

_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
_STL_HEADER = 80
_PLY_COMMENT = b"comment https://github.com/mikedh/trimesh"


@dataclass(frozen=True, eq=False)
class Simplices:
    """Triangles or tetrahedra in space, with values.

    Attributes
    ----------
    points : (V, 3) float64
    cells : (M, 3 or 4) int64
        With positive volume, or counter-clockwise as seen from above.
    placement : Placement or None
    at_points, of_cells : dict of str to (V,) or (M,) array
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    placement: Placement | None
    at_points: dict[str, NDArray[Any]]
    of_cells: dict[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of_mesh(cls, mesh: Tessellation) -> Simplices:
        """Place the cells of a mesh, with their ``level`` and the sign of each point, ``above``."""
        where = _where(mesh.placement, mesh.points.shape[1], bool(mesh.shape))
        points = where.place(mesh.points.astype(np.float64))
        return cls(np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), _turned(mesh.cells, where), mesh.placement,
                   {"above": mesh.above.astype(np.uint8)}, {"level": mesh.levels.astype(np.uint8)})

    @classmethod
    def of_tin(cls, tin: Tin, in_samples: bool = False) -> Simplices:
        """Place a triangulated surface by the matrix of its notes; the third coordinate is the value.

        Without a placement x runs along axis 1 of a field. Coordinates in samples have no reference system.
        """
        found = None if in_samples else read_placement(tin.metadata, 2)
        crs = tin.metadata.get(CRS) if tin.shape is None and not in_samples else None
        where = _where(None if found is None or found.matrix is None else found.flat, 2, tin.shape is not None, crs)
        return cls(np.column_stack([where.place(tin.points), tin.values]), _turned(tin.triangles, where), where,
                   {"value": tin.values.copy()})

    def to_geodataframe(self) -> Any:
        """Convert triangles to a table with a row for each, with its level and values, of signs their sum."""
        shapely = library("shapely", extra="vector", purpose="tables of triangles")
        points = self.points if self.points[:, 2].any() else self.points[:, :2]
        corners = {name: values[self.cells].sum(axis=1) if name == "above" else values[self.cells].mean(axis=1)
                   for name, values in self.at_points.items()}
        return table_of({**self.of_cells, **corners}, shapely.polygons(points[self.cells[:, [0, 1, 2, 0]]]),
                        self.placement)

    def to_pyvista(self) -> Any:
        """Convert to a ``pyvista.PolyData`` of triangles, or a ``pyvista.UnstructuredGrid`` of tetrahedra."""
        pyvista = library("pyvista", extra="vtk", purpose="making a mesh of pyvista")
        if self.cells.shape[1] == 3:
            mesh = pyvista.PolyData.from_regular_faces(self.points, self.cells)
        else:
            mesh = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: self.cells}, self.points)
        mesh.point_data.update(self.at_points)
        mesh.cell_data.update(self.of_cells)
        return mesh

    def to_trimesh(self) -> Any:
        """Convert triangles to a ``trimesh.Trimesh``."""
        trimesh = library("trimesh", extra="mesh", purpose="making a mesh of trimesh")
        return trimesh.Trimesh(self.points, self.cells, process=False, vertex_attributes=self.at_points,
                               face_attributes=self.of_cells)


def _where(placement: Placement | None, n: int, in_field: bool, crs: str | None = None) -> Placement:
    """Placement of coordinates that may have none, in samples of a field or in a mesh."""
    if placement is not None and placement.placed:
        return placement
    return Placement(unplaced(n) if in_field else np.eye(n, n + 1), crs=crs)


def _turned(cells: NDArray[np.int64], placement: Placement) -> NDArray[np.int64]:
    return cells[:, [*range(cells.shape[1] - 2), -1, -2]] if placement.mirrored() else cells


def _check_some(cells: object) -> None:
    if not cells:
        raise OptionError("there are no cells, and the format cannot hold that", code="empty",
                          remedy="choose an isovalue within the data, or write .vtp")


def write_pyvista(what: Iterable[Any], path: Path, job: Any) -> None:
    """Write curves, surfaces or meshes by PyVista, as one mesh; refuses grids without cells, at which VTK crashes."""
    first, *others = (one.to_pyvista() for one in what)
    mesh = first.append_polydata(*others) if others else first
    mesh.field_data.update(first.field_data)
    if job.name == "grid":
        _check_some(mesh.n_cells)
        mesh = mesh.cast_to_unstructured_grid()
    mesh.save(path)


def write_trimesh(what: Iterable[Any], path: Path, job: Any) -> None:
    """Write surfaces by trimesh, each as an object named by its isovalue if the format holds several.

    GLB and glTF have x, z, -y, since their y is up, and single precision relative to the middle of each object, which
    the object's node adds again. PLY, STL, OBJ and glTF state where x, y, z run in a body.
    """
    meshes, colours = dict[str, Any](), dict[str, str | None]()
    for one in what:
        if len(one.cells):
            name = caption(one.isovalue, one.metadata) if isinstance(one, Contour) else "surface"
            meshes[name] = one.to_trimesh()
            colours[name] = colour_of(one.isovalue, one.metadata) if isinstance(one, Contour) else None
    _check_some(meshes)
    kind, space = job.name, job.space
    text = {"SPACE": space} if space else {}
    scene = library("trimesh", extra="mesh", purpose=f"writing {kind}").Scene(metadata={"up": "y"} | text)
    for name, mesh in meshes.items():
        matrix = np.eye(4)
        if kind in ("glb", "gltf"):
            middle = mesh.bounds.mean(axis=0)
            matrix[:3, 3] = _Y_UP @ middle
            for key, values in mesh.vertex_attributes.items():
                if np.isnan(values).any():
                    raise OptionError(f"{key} is missing at {int(np.isnan(values).sum())} points, and glTF has no such "
                                      "values", code="sample", remedy="write .ply or .vtp")
            mesh.vertices = single((mesh.vertices - middle) @ _Y_UP.T)
        elif kind in ("ply", "stl"):
            mesh.vertices = single(mesh.vertices)
        if colour := colours[name]:
            visual = library("trimesh.visual", extra="mesh", purpose=f"writing {kind}")
            shown = visual.material.PBRMaterial(name=name, baseColorFactor=[*bytes.fromhex(colour[1:]), 255])
            mesh.visual = visual.TextureVisuals(material=shown)
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=matrix)
    # decimals that resolve a hundred-millionth of a cell
    digits = 8 + max(0, math.ceil(-math.log10(job.steps.min())))
    header = f"SPACE={space}" if space else ""
    options: dict[str, Any] = {"obj": {"digits": digits, "header": header or None}, "off": {"digits": digits},
               "gltf": {"embed_buffers": True}}
    made = (mesh if kind in ("ply", "stl", "off") else scene).export(file_type=kind, **options.get(kind, {}))
    made = made["model.gltf"] if isinstance(made, dict) else made
    data = made.encode() if isinstance(made, str) else bytes(made)
    if header and kind == "stl":
        data = header.encode().ljust(_STL_HEADER, b"\0") + data[_STL_HEADER:]
    if header and kind == "ply":
        data = data.replace(_PLY_COMMENT, b"comment " + header.encode(), 1)
    path.write_bytes(data)
