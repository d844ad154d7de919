"""Whole files on meshes at once: points, cells and values in, bytes out, and back (spec clause 10)."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ..stream.mesh_encoder import MeshEncoder
from ..stream.names import Isovalues, MeshName

HEADER_BYTES = 64
"""Longer than any header."""


def encode_mesh(
    points: ArrayLike,
    cells: ArrayLike | None,
    values: ArrayLike,
    isovalue: Isovalues,
    *,
    mesh: MeshName | None = None,
    mesh_error: float | None = None,
    exact: bool = False,
    step: float | None = None,
    tolerance: float | None = None,
    signs_only: bool = False,
    leaning: bool = True,
    progressive: bool | None = None,
    interval: int = 0,
    metadata: Mapping[str, str] | None = None,
) -> bytes:
    """Encode one or more isocontours or isosurfaces of values at the vertices of a mesh.

    Choose the precision with one of ``exact``, ``tolerance``, ``signs_only`` and ``step``. Without any, points are kept
    to within 0.05 of the median edge.

    Parameters
    ----------
    points : (V, 2) or (V, 3) array_like of numbers
        Coordinates x, y (, z) of the vertices.
    cells : (T, 3) or (T, 4) array_like of int, or None
        Vertices of triangles, in the plane or of a surface in space, or of tetrahedra. None: the points are scattered
        over the plane, and are joined to their Delaunay triangulation; those that coincide become one, with the mean of
        their values.
    values : (V,) or (F, V) array_like of bool, integers or floats
        With two axes, those of F frames: a series, each frame leaning on the one before.
    isovalue : number or sequence of numbers
        As in `encode`.
    mesh : str
        ``known``: whoever decodes has the mesh, points and cells in the same order; the file holds its hash. ``coded``:
        the file holds the cells that the contours cross, ``whole``: all cells. ``delaunay``, without cells: the file
        holds the points, from which the triangles follow, rounded as they are. By default ``known`` with cells,
        ``delaunay`` without.
    mesh_error : float, optional
        Of a mesh in the file, the largest distance between vertices and their points; less where cells would fold. By
        default 0.05 of the median edge. Points of contours are told on the edges of that mesh, where these meet the
        contour of the given one, so that they may lie much nearer to it.
    exact, step, signs_only, leaning, metadata
        As in `encode`.
    progressive : bool, optional
        Tell the signs level by level, from a coarse mesh to the whole one, so that the first bytes show all of the
        curve: for triangles in the plane, the default if both sides have the mesh. Else they come along the curve.
    interval : int
        As in `encode_frames`.
    tolerance : float, optional
        Largest distance, in the unit of the points, between the decoded and the extracted curve, both ways.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        If the mesh is no complex (faces of more than two cells, cells that are degenerate or given twice, points that
        coincide), or the values or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.

    Examples
    --------
    >>> from isocodec import decode
    >>> data = encode_mesh([[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2], [1, 3, 2]], [0, 1, 1, 2], 0.5)
    >>> decode(data, mesh=([[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2], [1, 3, 2]])).points.shape
    (2, 2)
    """
    return b"".join(
        MeshEncoder(
            points, cells, values, isovalue, mesh=mesh, mesh_error=mesh_error, exact=exact, step=step,
            tolerance=tolerance, signs_only=signs_only, leaning=leaning, progressive=progressive, interval=interval,
            metadata=metadata,
        )
    )
