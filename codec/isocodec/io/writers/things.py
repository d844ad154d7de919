"""Things that can be written, and where they lie: contours, areas, masks, meshes, triangulated surfaces, pictures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.contour import Contour
from ...drawing.rows import MaskRows
from ...drawing.tessellation import Tessellation
from ...errors import OptionError
from ...field.placement import CRS, Placement, read_placement, unplaced
from ...tin.tin import Tin
from .output_formats import Kind

Mask = NDArray[np.bool_]
ABOVE, LEVEL = "above", "level"
"""Names of the values at the vertices of a mesh (1 above the isovalue, 0 not) and of its simplices."""


@dataclass(frozen=True, eq=False)
class Areas:
    """Polygons of the areas beside curves, or between them.

    Attributes
    ----------
    contours : collection of Contour
        Isocontours of one field of two axes; gone through once.
    side : {"above", "below", "bands"}
    valid : (s0, s1) bool, optional
        As of `isocodec.drawing.areas.areas`.
    """

    contours: Collection[Contour]
    side: str
    valid: Mask | None = None


@dataclass(eq=False)
class SampleMask:
    """Samples of a field that lie above an isovalue, or are valid.

    Attributes
    ----------
    rows : bool array, or callable
        All samples; or ``rows(transposed)`` gives them a few rows at a time, as `MaskRows`, of the transposed array
        where the format stores that.
    placement : Placement, optional
        Where they lie.
    ones : int
        How many of the samples that have been taken are True.
    """

    rows: Mask | Callable[[bool], MaskRows]
    placement: Placement | None = None
    ones: int = 0

    @property
    def n(self) -> int:
        """Axes of the field."""
        return self.rows.ndim if isinstance(self.rows, np.ndarray) else len(self.rows(False).shape)

    def taken(self, transposed: bool = False) -> tuple[tuple[int, ...], Iterator[Mask]]:
        """Shape, and the samples some rows at a time, each contiguous."""
        if not isinstance(self.rows, np.ndarray):
            found = self.rows(transposed)
            return found.shape, self._counted(found)
        whole = np.ascontiguousarray(self.rows.T if transposed else self.rows)
        return whole.shape, self._counted([whole])

    def _counted(self, rows: Iterable[Mask]) -> Iterator[Mask]:
        for some in rows:
            self.ones += int(np.count_nonzero(some))
            yield some


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Isovalues of a field of two axes, drawn for each zoom of a map as coarsely as it allows.

    Attributes
    ----------
    isovalues : iterable of callable
        Each gives the contour as it is seen where a pixel is so many samples wide; 1.0 is the finest.
    """

    isovalues: Iterable[Callable[[float], Contour]]


@dataclass(frozen=True, eq=False)
class Picture:
    """Something that draws itself: steps of a file, or a contour map.

    Attributes
    ----------
    draw : callable
        ``draw(suffix)`` gives the file of the picture.
    """

    draw: Callable[[str], bytes]


@dataclass(frozen=True)
class Thing:
    """A thing to write, as far as formats care.

    Attributes
    ----------
    kind : str
    n : int or None
        Axes of the field; None of pictures, which may be of any.
    several : bool
        Whether it is of several isovalues.
    sampled : bool
        Whether it lies on samples.
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
            "mask": f"a mask of {self.n} axes" if self.n else "a mask",
            "mesh": f"the mesh of a {self.n}-D field" if self.n else "a mesh",
            "tin": "a triangulated surface" + ("" if self.sampled else " of scattered points"),
            "pyramid": "a curve at each zoom of a map", "picture": "a picture",
        }
        return names[self.kind]


def thing_of(what: Any) -> Thing:
    """The kind of what is to be written.

    Raises
    ------
    OptionError
        If it is nothing that has a format, or no contour at all.
    """
    if isinstance(what, Contour):
        return Thing("contour", what.n, False, bool(what.shape))
    if isinstance(what, Tessellation):
        return Thing("mesh", what.cells.shape[1] - 1)
    if isinstance(what, Tin | PlacedTin):
        tin = what.tin if isinstance(what, PlacedTin) else what
        return Thing("tin", 2, False, tin.shape is not None)
    if isinstance(what, Areas):
        return replace(_of_contours(what.contours), kind="areas", several=False)
    if isinstance(what, SampleMask):
        return Thing("mask", what.n)
    if isinstance(what, np.ndarray) and what.dtype == np.bool_:
        return Thing("mask", what.ndim)
    if isinstance(what, Pyramid):
        return Thing("pyramid", 2)
    if isinstance(what, Picture):
        return Thing("picture", None)
    if isinstance(what, Collection) and not isinstance(what, np.ndarray | str | bytes):
        return _of_contours(what)
    raise OptionError(f"a {type(what).__name__} cannot be written", code="what",
                      remedy="give contours, areas, a bool array, a mesh or a triangulated surface")


def _of_contours(contours: Collection[Any]) -> Thing:
    """Several contours; those that are drawn one after the other have the attribute ``n``."""
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


class Each(Collection[Contour]):
    """Contours, each changed and looked at when it is its turn, so that it may be drawn then and dropped after that."""

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
    corners = points[mesh.cells[:1]]
    sides, cells = corners[:, 1:] - corners[:, :1], mesh.cells
    # of triangles in space no order is that of the axes
    if sides.shape[1] == sides.shape[2] and (np.linalg.det(sides) < 0).any():
        # all are oriented alike, and a placement that mirrors turns all over
        cells = np.concatenate([cells[:, :-2], cells[:, :-3:-1]], axis=1)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), cells


@dataclass(frozen=True)
class PlacedTin:
    """A triangulated surface, where it lies, and what a format may hold beside.

    The third coordinate is the value. Of points that were scattered, x and y are the two columns; of the samples of a
    field, those of its placement, without one x runs along axis 1 and y along axis 0.

    Attributes
    ----------
    tin : Tin
    placement : Placement
        With a matrix.
    notes : dict
        Arrays for NPZ.
    """

    tin: Tin
    placement: Placement
    notes: dict[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, tin: Tin, in_samples: bool = False) -> PlacedTin:
        """Place a surface by its notes."""
        found = None if in_samples else read_placement(tin.metadata, 2)
        if found is None or found.matrix is None:
            crs = None if in_samples else tin.metadata.get(CRS)
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
        """(T, 3) int64: seen anticlockwise from above."""
        return self.tin.triangles[:, ::-1] if self.placement.mirrored() else self.tin.triangles
