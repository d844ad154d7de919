"""Open an ``.iso`` file of any kind, from a path, a URL, a file object or bytes."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from isospec.container import SIGNATURE, TILED_SIGNATURE

from ..errors import OptionError, TruncatedError
from ..format.chunks import whole_bytes
from ..format.header import HEAD_BYTES, is_tiled
from ..limits import Limits
from ..storage.content import Readable, content, is_url
from ..storage.ranges import NoRangesError, ranges_of
from .files import TileFile, whole_file
from .isofile import IsoFile
from .operations import ViewOptions
from .selfcheck import check_kernels

if TYPE_CHECKING:
    from typing import Unpack

    from ..drawing.contour import Contour


def open(
    source: Readable, *, mesh: tuple[ArrayLike, ArrayLike] | None = None, limits: Limits | None = None,
    threads: int | None = None,
) -> IsoFile:
    """Open an ``.iso`` file of any kind.

    Parameters
    ----------
    source : path, URL, file object or bytes
    mesh : (points, cells), optional
        The mesh that was encoded, for files that do not store their mesh.
    limits : Limits, optional
        Limits on memory and work for decoding, for untrusted files.
    threads : int, optional
        Number of threads that decode tiles; if not given, that of all cores for volumes, else 1.

    Returns
    -------
    IsoFile
        An open file, whose header and notes have been read; curves are decoded when they are asked for, and of a
        tiled file, only the necessary parts are read. Nothing stays open: a ``with`` statement is optional.

    Raises
    ------
    OSError
        If it cannot be opened.
    FormatError
        If it is not an ``.iso`` file.
    OptionError
        If a mesh is given for a file of another kind.
    LimitError
        If it has more bytes than the limits allow.

    Examples
    --------
    >>> import isocodec
    >>> file = isocodec.open("terrain.iso")      # doctest: +SKIP
    >>> file.isovalues, file.contour().points    # doctest: +SKIP
    """
    check_kernels()
    file = _opened(source, mesh, limits, threads)
    if file.kind != "mesh" and mesh is not None:
        raise OptionError(f"a file of kind {file.kind} takes no mesh", code="mesh",
                          remedy="leave it out")
    return file


def _opened(
    source: Readable, mesh: tuple[ArrayLike, ArrayLike] | None, limits: Limits | None, threads: int | None
) -> IsoFile:
    """Open a file without checking its kind."""
    if isinstance(source, str | os.PathLike) and (tiled := _tiled_at(source, limits, threads)) is not None:
        return tiled
    data = whole_bytes(content(source, limits, (SIGNATURE, TILED_SIGNATURE)))
    if not data:
        raise TruncatedError("the file is empty", code="truncated", offset=0, clause="3.3")
    if is_tiled(data):
        from ..tiles.tiled import TiledFile

        return TileFile(TiledFile(ranges_of(data), limits, threads=threads), limits)
    return whole_file(data, limits, mesh, source if isinstance(source, str | os.PathLike) else None)


def decode(
    source: Readable, isovalue: float | None = None, *, mesh: tuple[ArrayLike, ArrayLike] | None = None,
    limits: Limits | None = None, threads: int | None = None, **view: Unpack[ViewOptions],
) -> Contour:
    """Decode a file to its curve or surface: ``open(source).contour(isovalue)``.

    Parameters
    ----------
    source : path, URL, file object or bytes
    isovalue : float, optional
    mesh, limits, threads
        As for `open`.
    view
        Parameters of `IsoFile.contour`: ``frame``, ``layers``, ``max_bytes``, ``window``, ``bbox``, ``within``,
        ``smooth``, ``through_holes``, ``partial``, ``progress``.

    Returns
    -------
    Contour
    """
    return open(source, mesh=mesh, limits=limits, threads=threads).contour(isovalue, **view)


def _tiled_at(source: str | os.PathLike[str], limits: Limits | None, threads: int | None) -> IsoFile | None:
    """Open the tiled file at a path or URL; its tiles are read when they are needed.

    Returns None if the file is not tiled, comes through a pipe, or if its server does not support range requests.
    """
    if not is_url(source) and os.path.exists(source) and not os.path.isfile(source):
        return None
    fetch = ranges_of(source)
    try:
        (first,) = fetch([(0, HEAD_BYTES)])
    except NoRangesError as error:
        warnings.warn(f"{error.message}: all of it is read", stacklevel=5)
        return None
    if not is_tiled(first):
        return None
    from ..tiles.tiled import TiledFile

    return TileFile(TiledFile(fetch, limits, first, threads), limits)
