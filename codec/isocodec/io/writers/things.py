"""Contents that can be written, with their placement: contours, areas, masks, meshes, surfaces, pictures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...drawing.contour import Contour
from ...drawing.rows import MaskRows
from ...drawing.tessellation import Tessellation
from ...errors import IsoError, OptionError, one_line
from ...field.placement import CRS, LPS, Placement, read_placement, unplaced
from .output_formats import Kind

if TYPE_CHECKING:
    from ...tin.tin import Tin

Mask = NDArray[np.bool_]
ABOVE, LEVEL = "above", "level"
"""Names of the values at the vertices of a mesh (1 above the isovalue, 0 not) and at its simplices."""


@dataclass(frozen=True, eq=False)
class Areas:
    """Polygons of the areas on one side of curves, or between them.

    Attributes
    ----------
    contours : collection of Contour
        Isocontours of one field with two axes; iterated over once.
    side : {"above", "below", "bands"}
    valid : (s0, s1) bool, optional
        As for `isocodec.drawing.areas.areas`.
    """

    contours: Collection[Contour]
    side: str
    valid: Mask | None = None


@dataclass(eq=False)
class SampleMask:
    """Samples of a field that lie above an isovalue, or are valid; or the label of each.

    Attributes
    ----------
    rows : array, or callable
        All samples, bools or labels; or ``rows(transposed)`` gives them a few rows at a time, as `MaskRows`, of the
        transposed array where the format stores that.
    placement : Placement, optional
        Where the samples lie.
    ones : int
        How many of the samples that have been taken are True, or have a label.
    """

    rows: NDArray[Any] | Callable[[bool], MaskRows]
    placement: Placement | None = None
    ones: int = 0

    @property
    def n(self) -> int:
        """Axes of the field."""
        return self.rows.ndim if isinstance(self.rows, np.ndarray) else len(self.rows(False).shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples."""
        return self.rows.dtype if isinstance(self.rows, np.ndarray) else np.dtype(np.bool_)

    def taken(self, transposed: bool = False) -> tuple[tuple[int, ...], Iterator[NDArray[Any]]]:
        """Shape, and the samples some rows at a time, each contiguous."""
        if not isinstance(self.rows, np.ndarray):
            found = self.rows(transposed)
            return found.shape, self._counted(found)
        whole = np.ascontiguousarray(self.rows.T if transposed else self.rows)
        return whole.shape, self._counted([whole])

    def _counted(self, rows: Iterable[NDArray[Any]]) -> Iterator[NDArray[Any]]:
        for some in rows:
            self.ones += int(np.count_nonzero(some))
            yield some


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Isovalues of a field with two axes, drawn as coarsely as each zoom level of a map allows.

    Attributes
    ----------
    isovalues : iterable of callable
        Each returns the contour to draw where a pixel is this many samples wide; 1.0 is the finest.
    """

    isovalues: Iterable[Callable[[float], Contour]]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of the steps of a file, or a contour map.

    Attributes
    ----------
    draw : callable
        ``draw(suffix)`` returns the file of the picture.
    """

    draw: Callable[[str], bytes]


@dataclass(frozen=True)
class Thing:
    """Properties of a content that decide which formats can hold it.

    Attributes
    ----------
    kind : str
    n : int or None
        Number of axes of the field; None for pictures, which may have any number.
    several : bool
        Whether it has several isovalues.
    sampled : bool
        Whether it lies on a sampled grid.
    """

    kind: Kind
    n: int | None
    several: bool = False
    sampled: bool = True

    @property
    def text(self) -> str:
        """Name in messages: ``"a curve (of a 2-D field)"``."""
        if self.kind == "contour":
            name = {2: "a curve (of a 2-D field)", 3: "a surface (of a 3-D field)"}.get(self.n or 0, "a contour")
            return name if self.sampled else f"{name.partition(' (')[0]} that lies on a mesh"
        names = {
            "areas": "areas of a surface" if self.n == 3 else "areas",
            "mask": f"a mask with {self.n} axes" if self.n else "a mask",
            "labels": f"labels with {self.n} axes" if self.n else "labels",
            "mesh": f"the mesh of a {self.n}-D field" if self.n else "a mesh",
            "tin": "a triangulated surface" + ("" if self.sampled else " of scattered points"),
            "pyramid": "a curve at each zoom of a map", "picture": "a picture",
        }
        return names[self.kind]


def thing_of(what: Any) -> Thing:
    """Find the kind of what is to be written.

    Raises
    ------
    OptionError
        If there is no format for it, or if there are no contours.
    """
    if isinstance(what, Contour):
        return Thing("contour", what.n, False, bool(what.shape))
    if isinstance(what, Tessellation):
        return Thing("mesh", what.cells.shape[1] - 1)
    if isinstance(what, Areas):
        return replace(_of_contours(what.contours), kind="areas", several=False)
    if isinstance(what, SampleMask):
        return Thing("mask" if what.dtype == np.bool_ else "labels", what.n)
    if isinstance(what, np.ndarray) and what.dtype == np.bool_:
        return Thing("mask", what.ndim)
    if isinstance(what, Pyramid):
        return Thing("pyramid", 2)
    if isinstance(what, Picture):
        return Thing("picture", None)
    if isinstance(what, Collection) and not isinstance(what, np.ndarray | str | bytes):
        return _of_contours(what)
    if isinstance(what, PlacedTin):
        return thing_of(what.tin)
    # loads much that curves do without
    from ...tin.tin import Tin

    if isinstance(what, Tin):
        return Thing("tin", 2, False, what.shape is not None)
    raise OptionError(f"a {type(what).__name__} cannot be written", code="what",
                      remedy="give contours, areas, a bool array, a mesh or a triangulated surface")


def _of_contours(contours: Collection[Any]) -> Thing:
    """Several contours; collections that draw them one by one have the attribute ``n``."""
    if not len(contours):
        raise OptionError("no contours to write", code="contours")
    n = getattr(contours, "n", None)
    sampled = True
    if n is None:
        if not all(isinstance(one, Contour) for one in contours):
            raise OptionError("only contours can be written together", code="contours")
        first = next(iter(contours))
        n, sampled = first.n, bool(first.shape)
    return Thing("contour", n, len(contours) > 1, sampled)


def space_of(placement: Placement | None) -> str:
    """The words by which programs for volumes (3D Slicer) know where x, y, z run: ``SPACE=RAS``; empty if unknown."""
    return "" if placement is None or placement.space is None else f"SPACE={placement.space}"


def volume_matrix(placement: Placement | None) -> NDArray[np.float64] | None:
    """Matrix (3, 4) of a volume in coordinates right, front and up, as far as it is known where they run.

    A field of two axes has a third of one sample, a unit long, at right angles to the others.
    """
    if placement is None or placement.matrix is None:
        return None
    matrix = placement.matrix
    if matrix.shape[1] == 3:
        rows = np.pad(matrix, ((0, 3 - len(matrix)), (0, 0)))
        across = np.cross(rows[:, 0], rows[:, 1])
        matrix = np.insert(rows, 2, across / np.linalg.norm(across), axis=1)
    return np.diag([-1.0, -1.0, 1.0]) @ matrix if placement.crs == LPS else matrix


@contextmanager
def library_files(suffix: str) -> Iterator[Path]:
    """Yield a folder for the files of a library that writes to paths only; what it raises becomes an OSError.

    Libraries have errors of their own for a full disk.
    """
    from tempfile import TemporaryDirectory

    try:
        with TemporaryDirectory(prefix="isocodec-") as folder:
            yield Path(folder)
    except (IsoError, OSError, MemoryError):
        raise
    except Exception as exc:
        raise OSError(f"writing {suffix} failed: {one_line(str(exc))}") from exc


class Each(Collection[Contour]):
    """Contours, each changed and examined when it is needed, so that it can be drawn then and released afterwards."""

    def __init__(self, contours: Collection[Contour], change: Callable[[Contour], Contour]) -> None:
        self._contours = contours
        self._change = change

    def __len__(self) -> int:
        return len(self._contours)

    def __contains__(self, contour: object) -> bool:
        return False

    def __iter__(self) -> Iterator[Contour]:
        for contour in self._contours:
            yield self._change(contour)
            del contour


# ---- Meshes and triangulated surfaces in space ----------------------------------------------------------------------


def in_space(mesh: Tessellation) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices with three coordinates, and simplices with a positive volume, or seen counter-clockwise from above;
    triangles in space as they are."""
    none = np.zeros((0, 2)), np.zeros((0, 2), np.int64)
    about = Contour(*none, mesh.isovalue, mesh.shape, placement=mesh.placement)
    points = about.place(mesh.points.astype(np.float64))
    first = mesh.cells[:1]
    corners = about.flat.place(mesh.points[first.ravel()].astype(np.float64))
    corners = corners.reshape(*first.shape, corners.shape[1])
    sides, cells = corners[:, 1:] - corners[:, :1], mesh.cells
    # of triangles in space no order is that of the axes
    if sides.shape[1] == sides.shape[2] and (np.linalg.det(sides) < 0).any():
        # all are oriented alike, and a placement that mirrors turns all over
        cells = np.concatenate([cells[:, :-2], cells[:, :-3:-1]], axis=1)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), cells


@dataclass(frozen=True)
class PlacedTin:
    """A triangulated surface with its placement, and further arrays that a format may hold.

    The third coordinate is the value. For scattered points, x and y are the two columns; for samples of a field, those
    of its placement, or without one, x runs along axis 1 and y along axis 0.

    Attributes
    ----------
    tin : Tin
    placement : Placement
        A placement with a matrix.
    notes : dict
        Arrays for NPZ.
    """

    tin: Tin
    placement: Placement
    notes: dict[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, tin: Tin, in_samples: bool = False) -> PlacedTin:
        """Place a surface according to its notes."""
        found = None if in_samples else read_placement(tin.metadata, 2)
        found = None if found is None else found.flat
        if found is None or found.matrix is None:
            # coordinates in samples have no system
            crs = tin.metadata.get(CRS) if tin.shape is None and not in_samples else None
            found = Placement(np.eye(2, 3) if tin.shape is None else unplaced(2), crs=crs)
        removed = tin.removals
        names = () if removed is None else ("order", "errors", "anticipated", "kept")
        return cls(tin, found, {name: getattr(removed, name) for name in names})

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(V, 3) float64: x, y, value."""
        return np.column_stack([self.placement.place(self.tin.points), self.tin.values])

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(T, 3) int64: counter-clockwise as seen from above."""
        return self.tin.triangles[:, ::-1] if self.placement.mirrored() else self.tin.triangles
