"""Curves and surfaces in space, meshes and triangulated surfaces as objects and files of trimesh and PyVista."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..drawing.separation import single
from ..drawing.tessellation import Tessellation
from ..errors import OptionError
from ..field.labelling import caption
from ..field.placement import CRS, Placement, read_placement, unplaced
from .libraries import library

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
    at_points: dict[str, NDArray[Any]] = field(default_factory=dict)
    of_cells: dict[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of_mesh(cls, mesh: Tessellation) -> Simplices:
        """Place the cells of a mesh, with their ``level`` and the sign of each point, ``above``."""
        n, cells = mesh.cells.shape[1] - 1, mesh.cells
        about = Contour(np.zeros((0, n)), np.zeros((0, n), np.int64), mesh.isovalue, mesh.shape,
                        placement=mesh.placement)
        if about.mirrored:
            cells = np.concatenate([cells[:, :-2], cells[:, :-3:-1]], axis=1)
        return cls(in_three(about.place(mesh.points.astype(np.float64))), cells, mesh.placement,
                   {"above": mesh.above.astype(np.uint8)}, {"level": mesh.levels.astype(np.uint8)})

    @classmethod
    def of_tin(cls, tin: Tin, in_samples: bool = False) -> Simplices:
        """Place a triangulated surface according to its notes; the third coordinate is the value."""
        where = placement_of_tin(tin, in_samples)
        return cls(np.column_stack([where.place(tin.points), tin.values]),
                   tin.triangles[:, ::-1] if where.mirrored() else tin.triangles, where, {"value": tin.values.copy()})

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


def placement_of_tin(tin: Tin, in_samples: bool = False) -> Placement:
    """Find where a surface lies, by a matrix; without a placement x runs along axis 1 of a field."""
    found = None if in_samples else read_placement(tin.metadata, 2)
    found = None if found is None else found.flat
    if found is not None and found.matrix is not None:
        return found
    # coordinates in samples have no system
    crs = tin.metadata.get(CRS) if tin.shape is None and not in_samples else None
    return Placement(np.eye(2, 3) if tin.shape is None else unplaced(2), crs=crs)


def in_three(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points with a third coordinate, 0 in the plane."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def to_pyvista(contours: Iterable[Contour]) -> Any:
    """Convert contours to one ``pyvista.PolyData``, whose cells have the value ``isovalue`` (``label`` of labels)."""
    first, *others = (contour.to_pyvista() for contour in contours)
    if not others:
        return first
    space = dict(first.field_data)
    mesh = first.append_polydata(*others)
    mesh.field_data.update(space)
    return mesh


def write_pyvista(mesh: Any, path: Path, as_grid: bool) -> None:
    """Write a mesh by PyVista, in a format of unstructured grids or as it is.

    Raises
    ------
    OptionError
        For an empty grid, at which VTK crashes.
    """
    if as_grid and not mesh.n_cells:
        raise _empty()
    (mesh.cast_to_unstructured_grid() if as_grid else mesh).save(path)


def _empty() -> OptionError:
    return OptionError("there are no cells, and the format cannot hold that", code="empty",
                       remedy="choose an isovalue within the data, or write .vtp")


def write_trimesh(contours: Iterable[Contour], path: Path, kind: str) -> None:
    """Write surfaces by trimesh, in formats of several an object for each isovalue that is named after it.

    GLB and glTF have x, z, -y, since their y is up, and single precision relative to the middle of each object, which
    the object's node adds again. PLY, STL, OBJ and glTF state where x, y, z run in a body.

    Parameters
    ----------
    kind : str
        Name of the format in trimesh: ``"glb"``.

    Raises
    ------
    OptionError
        If all surfaces are empty.
    """
    meshes, steps, space = {}, [1.0], None
    for contour in contours:
        space = None if contour.placement is None else contour.placement.space
        if len(contour.cells):
            meshes[caption(contour.isovalue, contour.metadata)] = contour.to_trimesh()
            steps += [] if contour.frame is None else np.linalg.norm(contour.frame, axis=0).tolist()
        del contour
    write_meshes(meshes, path, kind, space, min(steps))


def write_meshes(
    meshes: Mapping[str, Any], path: Path, kind: str, space: str | None = None, step: float = 1.0
) -> None:
    """Write meshes of trimesh by name; parameters as of `write_trimesh`, and the size of a cell."""
    trimesh = library("trimesh", extra="mesh", purpose=f"writing {kind}")
    if not meshes:
        raise _empty()
    scene = trimesh.Scene()
    for name, mesh in meshes.items():
        matrix = np.eye(4)
        if kind in ("glb", "gltf"):
            middle = mesh.bounds.mean(axis=0)
            matrix[:3, 3] = _Y_UP @ middle
            mesh.vertices = single((mesh.vertices - middle) @ _Y_UP.T)
        elif kind in ("ply", "stl"):
            mesh.vertices = single(mesh.vertices)
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=matrix)
    text = f"SPACE={space}" if space else ""
    scene.metadata.update({"up": "y"} | ({"SPACE": space} if space else {}))
    # decimals that resolve a hundred-millionth of a cell
    digits = 8 + max(0, math.ceil(-math.log10(step)))
    choices: dict[str, dict[str, Any]] = {"obj": {"digits": digits, "header": text or None}, "off": {"digits": digits},
                                          "gltf": {"embed_buffers": True}}
    options = choices.get(kind, {})
    made = (mesh if kind in ("ply", "stl", "off") else scene).export(file_type=kind, **options)
    made = made["model.gltf"] if isinstance(made, dict) else made
    data = made.encode() if isinstance(made, str) else bytes(made)
    if kind == "stl":
        data = text.encode().ljust(_STL_HEADER, b"\0") + data[_STL_HEADER:]
    path.write_bytes(data.replace(_PLY_COMMENT, b"comment " + text.encode(), 1) if kind == "ply" and text else data)
