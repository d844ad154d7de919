"""What a drawing gives back."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..exchange import Exchange
from ..field.mapped import Mapped
from .seam import joined


@dataclass(frozen=True, eq=False)
class Contour(Exchange):
    """An isocontour (n = 2) or isosurface (n = 3): points, and the segments or triangles between them.

    Orientation, n = 2: on the way from ``points[cells[i, 0]]`` to ``points[cells[i, 1]]``, in the plane with axis 0 as
    x and axis 1 as y (right-handed), the higher values lie on the left. ``skimage.measure.find_contours`` walks in the
    same direction with ``positive_orientation="high"``, and in the opposite one with its default ``"low"``, since it
    counts left and right with rows as y and columns as x.

    Orientation, n = 3: by the right-hand rule in index coordinates (axes 0, 1, 2 right-handed) the normals of the
    triangles point towards lower values.

    Attributes
    ----------
    points : (P, n) float64
        Index coordinates in samples, axes in the order of the sampled array.
    cells : (M, n) int64
        Indices into ``points``: directed segments (n = 2) or triangles (n = 3). In a contour each point is the start
        of at most one segment and the end of at most one.
    isovalue : float
    shape : tuple of int
        Samples along each axis of the sampled box; empty if the domain is a mesh, whose coordinates points then have.
    complete : bool
        False if the contour was drawn before all of its data had come, or from a file cut within a layer.
    placement : (n, n + 1) float64, or None
        Where samples lie in the world: ``placement[:, :n] @ index + placement[:, n]``; None if the file does not say.
    mapped : Mapped, or None
        Where samples lie that have coordinates of their own: ``mapped.place``.
    metadata : dict of str to str
        Notes of the file, as far as they had come.
    masked : bool
        Whether samples are missing: lines may end, and surfaces have edges, at unit cells with a missing corner.
    origin_above : bool or None
        Whether the first sample lies above the isovalue; None if that had not come.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    isovalue: float
    shape: tuple[int, ...]
    complete: bool = True
    placement: NDArray[np.float64] | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    origin_above: bool | None = None
    masked: bool = False
    mapped: Mapped | None = None

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
        """The points in the coordinates x, y (, z) of the mapped grid or the placement, (P, n) float64.

        Without either the unit is the cell: in the plane x runs along axis 1 and y along axis 0, in space x, y, z are
        the axes 0, 1, 2.
        """
        return self.place(self.points)

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates of the placement, as of `placed`, of points in index coordinates, (P, n) float64 both."""
        n = len(self.shape)
        if self.mapped is not None:
            return self.mapped.place(points)
        if not self.shape:
            return points
        if self.placement is None:
            return points[:, ::-1] if n == 2 else points
        # axis by axis: how a product of matrices is rounded depends on the library
        placed = sum(points[:, a, None] * self.placement[:, a] for a in range(n)) + self.placement[:, n]
        return np.asarray(placed)

    @property
    def joined(self) -> Contour:
        """The contour with one point where it had two, at either end of a periodic axis that closes in the world.

        Its index coordinates jump there, its places do not. The contour itself if no axis closes so.
        """
        if self.mapped is None or not self.mapped.closes:
            return self
        points, cells = joined(self.points, self.cells, self.shape, self.mapped.periodic)
        return replace(self, points=points, cells=cells)

    @property
    def frame(self) -> NDArray[np.float64] | None:
        """What a step along each axis adds to x, y (, z), (n, n) float64: on a mapped grid in a cell of the contour.

        None where neither a placement nor coordinates are there.
        """
        n = len(self.shape)
        if self.mapped is not None:
            corner = np.floor(self.points[len(self.points) // 2 :][:1]) if len(self.points) else np.zeros((1, n))
            corner = np.minimum(corner, np.array(self.shape) - 2)
            steps = self.mapped.place(np.concatenate([corner, corner + np.eye(n)]))
            return (steps[1:] - steps[0]).T
        return None if self.placement is None else self.placement[:, :n]

    def along(self, walk: list[int]) -> NDArray[np.float64]:
        """Places of points one after the other, (K, n) float64: coordinates with a period go on across its end."""
        places = self.placed[walk]
        for c, period in enumerate(self.mapped.periods if self.mapped is not None else ()):
            if period:
                places[:, c] = np.unwrap(places[:, c], period=period)
        return places

    @cached_property
    def lines(self) -> list[NDArray[np.float64]]:
        """Polylines of an isocontour, (K, 2) float64 each, their points in walking order (see Orientation).

        First those that are open, which start and end at the border of the box (or at missing samples, or where a part
        has not been received yet), then the closed ones, which repeat their first point at the end as ``find_contours``
        does.

        Raises
        ------
        OptionError
            For an isosurface.
        """
        return [self.points[walk] for walk in self.walks]

    @cached_property
    def walks(self) -> list[list[int]]:
        """Numbers of the points of each polyline, as `lines`."""
        if self.n != 2:
            raise OptionError("only an isocontour (n = 2) has lines; a surface has points and cells", code="dimension")
        following = np.full(len(self.points), -1, dtype=np.int64)
        following[self.cells[:, 0]] = self.cells[:, 1]
        starts_line = following >= 0
        starts_line[self.cells[:, 1]] = False

        # Plain lists: one step of the walk on numpy scalars would take several times as long.
        step = following.tolist()
        walks = []
        for first in [*np.flatnonzero(starts_line).tolist(), *range(len(step))]:
            walk = [first]
            point = step[first]
            while point >= 0:
                walk.append(point)
                step[walk[-2]] = -1
                point = step[point]
            if len(walk) > 1:
                walks.append(walk)
        return walks

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """GeoJSON-like ``MultiLineString`` of an isocontour, for shapely, geopandas and others.

        Coordinates are tuples ``(x, y)`` of `placed`. Without a placement, swapping the axes mirrors the plane, so that
        with x to the right and y upwards the higher values are on the right; where rows run southwards, on the left.

        Raises
        ------
        AttributeError
            For an isosurface, so that ``hasattr`` tells that there is no such interface.
        """
        if self.n != 2:
            raise AttributeError("__geo_interface__: a surface has no GeoJSON geometry")
        whole = self.joined
        coordinates = tuple(tuple(map(tuple, whole.along(walk).tolist())) for walk in whole.walks)
        return {"type": "MultiLineString", "coordinates": coordinates}
