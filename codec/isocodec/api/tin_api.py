"""Triangulated surfaces in files: points, terrains or pictures in, bytes out, and back (spec clause 10.9)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, DomainKind, Profile

from ..drawing.contour import Contour
from ..drawing.explicit import surface_contour
from ..entropy.run import Account
from ..errors import FormatError, LimitError, OptionError, TruncatedError
from ..field.placement import read_placement
from ..format.chunks import Envelope, octets, read_envelope, read_metadata, verify, write_chunk
from ..format.header import Header, read_header
from ..format.surface import MOST_LAYERS, TinHead, read_tin, values_of, write_tin
from ..limits import Limits
from ..search.contour_tin import near_contours
from ..search.tin_fit import Chosen, best, in_layers, smallest, within
from ..stream.mesh_decoder import REFUSED
from ..stream.session import beginning, with_checksum
from ..tin.coded_tin import Layers, decoded, encoded
from ..tin.delaunay import delaunay, triangles
from ..tin.points import Points, points_of
from ..tin.rank import by_rank
from ..tin.tin import Tin

PER_POINT = 400
"""Bytes that decoding takes for each point at most."""


def encode_tin(
    points: ArrayLike,
    values: ArrayLike | None = None,
    *,
    error: float | None = None,
    to: int | None = None,
    size: int | None = None,
    contours: Sequence[float] | None = None,
    tolerance: float | None = None,
    step: float | None = None,
    layers: int = 1,
    metadata: Mapping[str, str] | None = None,
) -> bytes:
    """Encode a terrain, a picture or scattered points as a triangulated surface.

    The file holds positions and values of the points that matter; triangles follow from them. Choose one of ``error``,
    ``to``, ``size`` and ``contours``.

    Parameters
    ----------
    points : (N, 2) array_like, or (s0, s1) array_like without ``values``
        As of `thin`.
    values : (N,) array_like, optional
    error : float, optional
        Largest distance of the surface from any value.
    to : int, optional
        Number of points; these and their values are chosen so that the sum of squared errors is small.
    size : int, optional
        Bytes of the file at most; likewise.
    contours : sequence of float, optional
        Isovalues: the surface keeps their contours, which `decode` draws of the file, and little else of a field.
    tolerance : float, optional
        With ``contours``: largest distance, in samples, between their contours and those of the field, both ways.
    step : float, optional
        Step of values, with ``to`` and ``size``; one that fits the error, if not given.
    layers : int
        Layers that points come in, each with four times as many as the one before: the beginning of a file is a coarse
        surface, for some more bytes in all.
    metadata : mapping of str to str, optional
        Notes to go into the file.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        As `thin`.
    OptionError
        If not exactly one of ``error``, ``to`` and ``size`` is given, or a number is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:32, :32]
    >>> data = encode_tin(np.hypot(x - 9.5, y - 20), error=0.5)
    >>> bool(np.abs(decode_tin(data).raster() - np.hypot(x - 9.5, y - 20)).max() <= 0.5)
    True
    """
    _check(error, to, size, step, layers, contours, tolerance)
    given = points_of(points, values)
    shape = np.shape(points) if values is None else None

    def file(chosen: Chosen) -> bytes:
        return _file(given, chosen, shape, layers, metadata)

    if error is not None:
        return file(within(given, float(error)))
    if contours is not None:
        assert tolerance is not None
        field = _field_of(points, shape)
        return file(near_contours(given, field, contours, float(tolerance), lambda each: len(file(each))))
    if to is not None:
        return file(best(given, int(to), step))
    assert size is not None
    out = file(smallest(given, int(size), file, step))
    if len(out) > size:
        raise OptionError(f"no surface fits into {size} bytes", code="size", remedy=f"allow {len(out)}")
    return out


def _field_of(points: ArrayLike, shape: tuple[int, ...] | None) -> NDArray[np.float64]:
    """The field that has contours."""
    if shape is None:
        raise OptionError(
            "contours are kept of a field, not of scattered points", code="contours",
            remedy="encode_mesh(points, None, values, isovalue) has those of scattered points",
        )
    return np.asarray(points, np.float64)


def _check(
    error: float | None, to: int | None, size: int | None, step: float | None, layers: int,
    contours: Sequence[float] | None, tolerance: float | None,
) -> None:
    if sum(each is not None for each in (error, to, size, contours)) != 1:
        raise OptionError(
            "give exactly one of error, to, size and contours", code="tin", remedy="error=5.0, or size=2000"
        )
    if (contours is None) != (tolerance is None) or (tolerance is not None and not 0 < tolerance < math.inf):
        raise OptionError(
            "contours go with a tolerance greater than 0", code="tolerance", remedy="contours=[500], tolerance=0.5"
        )
    if contours is not None and not (len(contours) and np.isfinite(contours).all()):
        raise OptionError("the isovalues of contours have to be numbers", code="isovalue", remedy="contours=[500]")
    if error is not None and not 0 <= error < math.inf:
        raise OptionError(f"the error is {error}; it must be 0 or more", code="error")
    for what, number, least in (("points", to, 3), ("bytes", size, 1), ("layers", layers, 1)):
        if number is not None and not (isinstance(number, Integral) and number >= least):
            raise OptionError(f"{number} {what}; it must be a whole number from {least} on", code=what)
    if layers > MOST_LAYERS:
        raise OptionError(f"{layers} layers; a surface has at most {MOST_LAYERS}", code="layers")
    if step is not None and (error is not None or contours is not None or not 0 < step < math.inf):
        raise OptionError(
            "a step goes with a number of points or a size, and is greater than 0", code="step",
            remedy="with an error, values are rounded as it allows",
        )


def _file(
    given: Points, chosen: Chosen, shape: tuple[int, int] | None, layers: int, metadata: Mapping[str, str] | None
) -> bytes:
    """The file of chosen points."""
    parts = in_layers(given, chosen, layers)
    extent = (int(given.x.max()) + 1, int(given.y.max()) + 1) if shape is None else shape
    exponent = math.frexp(given.unit)[1] - 1
    first, second = (int(each / given.unit) for each in given.origin)
    counts = np.diff([0, *parts.ends]).tolist()
    head = TinHead(
        extent, shape is not None, exponent, (first, second), chosen.offset, chosen.step, chosen.palette,
        chosen.largest, tuple(counts),
    )
    payload = write_tin(head) + encoded(parts, extent, chosen.largest)
    begun = beginning(Header((), 0.0, None, Profile.MAIN, cells=2), metadata)
    return b"".join(with_checksum([*begun, write_chunk(ChunkType.DOMAIN, payload, last=True)]))


def decode_tin(data: bytes, *, max_bytes: int | None = None, limits: Limits | None = None) -> Tin:
    """Decode a file to its triangulated surface.

    Parameters
    ----------
    data : bytes
        As `encode_tin` makes them.
    max_bytes : int, optional
        Decode the first bytes only, whatever surface they give.
    limits : Limits, optional

    Returns
    -------
    Tin

    Raises
    ------
    FormatError
        If the bytes are not such a file; ``TruncatedError`` if they end too early, with ``max_bytes`` only if they end
        before three points have come.
    LimitError
        If the file needs more than the limits allow.
    """
    head, parts, complete, metadata = read_surface(bytes(octets(data)[:max_bytes]), max_bytes is not None, limits)
    order = by_rank(parts.points[:, 0], parts.points[:, 1])
    x, y = np.ascontiguousarray(parts.points[order].T)
    tri, _ = delaunay(x, y)
    positions = np.stack([x, y], axis=1).astype(np.float64)
    if not head.grid:
        with np.errstate(over="ignore"):
            positions = np.ldexp(positions + np.array(head.origin, np.float64), head.exponent)
    values = np.array(values_of(head, parts.numbers[order].tolist()))
    return Tin(
        positions, values, triangles(tri).astype(np.int64), head.extent if head.grid else None, complete, metadata
    )


def contour_of(tin: Tin, isovalue: float) -> Contour:
    """The isocontour of a triangulated surface, on which the surface is linear.

    Parameters
    ----------
    tin : Tin
    isovalue : float

    Returns
    -------
    Contour
        Points in the coordinates of the surface: of a field, in its samples, with the placement that the file notes.

    Raises
    ------
    OptionError
        If the isovalue is not finite.
    """
    if not math.isfinite(isovalue):
        raise OptionError(f"the isovalue is {isovalue}; it must be finite", code="isovalue")
    points, pieces = surface_contour(tin.points, tin.values, tin.triangles, isovalue)
    notes = dict(tin.metadata)
    placement = None if tin.shape is None else read_placement(notes, 2)
    return Contour(points, pieces, float(isovalue), tin.shape or (), tin.complete, placement, metadata=notes)


def read_surface(
    whole: bytes, partial: bool = False, limits: Limits | None = None
) -> tuple[TinHead, Layers, bool, dict[str, str]]:
    """What a file of a surface says: its head, points and numbers, whether that is all, and notes.

    ``partial``: of a file that ends early, what has come. Raises as `decode_tin`.
    """
    limits = limits or Limits()
    if len(whole) > limits.bytes:
        raise LimitError(f"more than {limits.bytes} bytes", code="limit-bytes", clause="11.2")
    found = read_header(whole)
    early = TruncatedError("the file ends before its surface begins", code="truncated", offset=len(whole), clause="8.3")
    if found is None:
        raise early
    header, at = found
    if header.cells != 2:
        raise OptionError("the file holds no surface", code="domain", remedy="take decode")
    metadata: dict[str, str] = {}
    surface: tuple[TinHead, Layers] | None = None
    ended = False
    while not ended and (chunk := read_envelope(whole, at)) is not None:
        _belongs(chunk, surface is not None, at)
        behind = verify(whole, chunk, at)
        payload = whole[chunk.start : chunk.end]
        if chunk.type == ChunkType.DOMAIN and (behind is not None or payload):
            if behind is None and not partial:
                break
            surface = _parts(payload, chunk.start, chunk.end <= len(whole), behind is not None, limits)
        if behind is None:
            break
        if chunk.type == ChunkType.METADATA:
            metadata |= read_metadata(payload)
        at, ended = behind, chunk.last
    if ended and at < len(whole):
        raise FormatError("bytes after the end of the file", code="trailing", offset=at, clause="3.4.4")
    if ended and surface is None:
        raise FormatError("a file without a domain", code="domain", offset=at, clause="3.5.8")
    if not ended and not partial:
        raise TruncatedError(
            f"the file ends after {len(whole)} bytes, before it is complete", code="truncated", offset=len(whole),
            clause="8.3", remedy="give max_bytes to decode what there is",
        )
    if surface is None:
        raise early
    return *surface, ended and surface[1].complete, metadata


def _belongs(chunk: Envelope, begun: bool, at: int) -> None:
    """Check that a critical chunk does belong here; ``begun`` if the domain has come."""
    if chunk.ancillary:
        return
    if chunk.type in REFUSED:
        raise FormatError("not in an explicit domain", code="chunk", offset=at, clause="10.1.1")
    if begun == (chunk.type == ChunkType.DOMAIN):
        what = "a second domain" if begun else "the domain has to come first"
        raise FormatError(what, code="domain", offset=at, clause="3.5.8")
    if begun:
        raise FormatError("not in a file of a surface", code="chunk", offset=at, clause="10.9.1")


def _parts(payload: bytes, start: int, arrived: bool, verified: bool, limits: Limits) -> tuple[TinHead, Layers]:
    """What a payload holds, or its beginning.

    ``arrived``: it is all there; ``verified``: so are its checksums, before which its head is not refused.
    """
    early = TruncatedError("the file ends before its surface begins", code="truncated", clause="8.3")
    if not payload:
        raise FormatError("an empty domain chunk", code="domain", offset=start, clause="3.5.8")
    if payload[0] >> 4 != DomainKind.POINTS:
        raise OptionError("the file holds a mesh, no surface", code="domain", remedy="take decode")
    try:
        head, at = read_tin(payload, start)
    except FormatError:
        if verified:
            raise
        raise early from None
    most = min(limits.vertices, limits.memory // PER_POINT)
    account = Account(limits.symbols, limits.work)
    parts = decoded(payload[at:], head.counts, head.extent, head.largest, most, account, start + at, arrived)
    if len(parts.points) < 3:
        raise early
    return head, parts
