"""Whole files on meshes at once: points, cells and values in, bytes out, and back (spec clause 10)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from numbers import Integral

from numpy.typing import ArrayLike

from isospec.container import DomainKind

from ..drawing.contour import Contour
from ..errors import OptionError, TruncatedError
from ..format.chunks import octets
from ..format.domain import kind_of_domain
from ..format.header import read_header
from ..limits import Limits
from ..stream.inspect import inspect
from ..stream.mesh_decoder import MeshDecoder
from ..stream.mesh_encoder import MeshEncoder
from ..stream.names import Isovalues, MeshName
from .frames import check_frame, frame_of
from .tin_api import contour_of, decode_tin

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


def on_mesh(data: bytes) -> bool:
    """Whether a file's domain is explicit: a mesh."""
    found = read_header(bytes(octets(data)[:HEADER_BYTES]))
    return found is not None and found[0].cells is not None


def mesh_decoded(
    data: bytes,
    mesh: tuple[ArrayLike, ArrayLike] | None = None,
    only: Collection[int] | None = None,
    max_bytes: int | None = None,
    limits: Limits | None = None,
    frame: int | None = None,
) -> MeshDecoder:
    """A decoder that has taken a frame of a file on a mesh, or its first bytes; ``only`` those isovalues."""
    if max_bytes is not None:
        check_count(max_bytes, "max_bytes", "max-bytes")
    wanted = frame_of(frame)
    decoder = MeshDecoder(mesh, limits, only=only, frame=wanted)
    decoder.feed(octets(data)[:max_bytes])
    for _ in decoder:
        pass
    if max_bytes is None:
        decoder.close()
    if not decoder.isovalues:
        raise TruncatedError("the file ends before its curve begins", code="truncated")
    check_frame(decoder, wanted)
    return decoder


def check_count(asked: int, what: str, code: str) -> None:
    if not (isinstance(asked, Integral) and asked >= 1):
        raise OptionError(f"{what} is {asked}; it must be a whole number from 1 on", code=code)


def explicit_contour(
    data: bytes, isovalue: float | None, frame: int | None, mesh: tuple[ArrayLike, ArrayLike] | None,
    max_bytes: int | None, limits: Limits | None,
) -> Contour:
    """The contour of a file of an explicit domain; parameters as of `decode`."""
    if kind_of_domain(data) == DomainKind.POINTS:
        if isovalue is None:
            raise OptionError(
                "the file holds a surface: which isovalue?", code="isovalue",
                remedy="decode_tin gives the surface itself",
            )
        return contour_of(decode_tin(data, max_bytes=max_bytes, limits=limits), isovalue)
    number, chain = chain_of(data, isovalue)
    return mesh_decoded(data, mesh, chain, max_bytes, limits, frame).drawn(number)


def chain_of(data: bytes, isovalue: float | None) -> tuple[int, frozenset[int]]:
    """Number of an isovalue of a file, and those of all that it takes to decode it."""
    if isovalue is None:
        return 0, frozenset([0])
    info = inspect(data)
    number = info.number_of(isovalue)
    return number, info.chain(number)
