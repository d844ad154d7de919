"""Write fields, files, contours and surfaces in the format that the suffix of a name chooses."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..drawing.contour import Contour
from ..drawing.simplifying import simplified
from ..drawing.tessellation import Tessellation
from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..storage.atomic import check_target, write_bytes
from ..stream.given import field_of, taken
from ..stream.options import EncodeOptions, Isovalues, Options
from ..verbs import Choice, Decode, Progress
from .isofile import IsoFile
from .native import described, native

if TYPE_CHECKING:
    from typing import Unpack

    from ..field.sampled import SpatialImage
    from ..tiles.workers import Engine
    from ..tiles.writing import SampleCounts
    from ..tin.tin import Tin

_OF_CURVES = {"precision", "keep_topology"}
"""Options of encoding that have an effect on curves in other formats."""


def save(
    path: str | os.PathLike[str],
    what: bytes | Contour | Collection[Contour] | Tessellation | IsoFile | ArrayLike | Field | Frames | Mesh | Tin
    | SpatialImage,
    isovalue: Isovalues | None = None,
    *,
    simplify: float | str | None = None,
    tile: int | None = None,
    engine: Engine | None = None,
    threads: int | None = None,
    spool: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    **options: Unpack[EncodeOptions],
) -> None:
    """Write an ``.iso`` file, with or without tiles, or contours or a surface in another format.

    Parameters
    ----------
    path : path
        Written whole, or not at all. The suffix names the format: ``.iso``, or one of ``isocodec decode --help``.
    what : bytes, IsoFile, Contour, several Contours, Tin, Tessellation, or what `encode` takes
        For ``.iso``: bytes and an IsoFile are written as they are, everything else is encoded. For other formats:
        contours, a Tin, the mesh of `IsoFile.mesh`, or bytes and an IsoFile, which are decoded: a surface to its points
        and triangles, other files to their contours; or a field or a mesh, whose contours are drawn one by one.
    isovalue : optional
        Isovalues to encode, as for `encode`, or to draw, as many as wanted; or isovalues of the file whose contours are
        to be written.
    simplify : float or str, optional
        Not for ``.iso``: leave out points of lines, which stay within this distance, in cells or ``"30m"`` on the
        ground; no line crosses another (`isocodec.drawing.simplifying.simplified`).
    tile : int, optional
        Write a tiled file, with tiles of this many samples along each axis: a power of two from 32 to 8192 (1024 in 2-D
        and 128 in 3-D are usual). ``what`` is a Field, or anything that has ``shape``, ``dtype`` and slices: an array
        of numpy (also mapped from a file), Dask, xarray, Zarr or h5py with two or three axes. It need not be in memory,
        since only one tile is read at a time.
    engine : executor of ``concurrent.futures``, or client of ``dask.distributed``, optional
        Encodes the tiles; if not given, threads do, or the cluster that Dask would compute ``what`` on. The bytes of
        the file are the same.
    threads : int, optional
        Number of threads that encode tiles; if not given, that of all cores.
    spool : path, optional
        A folder for tiles that have been encoded; if not given, one next to the file. It is removed when the file is
        complete; if work stops earlier, the same call resumes where it stopped.
    progress : callable, optional
        As for `encode`; with ``tile``, called with the number of tiles done and the total.
    **options
        Options of `encode`. For contours of a field in another format, ``precision`` and ``keep_topology``: they are
        then those of such a file.

    Raises
    ------
    OSError
        If the file cannot be written; tiles that have been encoded are kept in the spool.
    OptionError
        If the format cannot hold ``what``, if options are given although nothing is encoded, or if the spool has tiles
        of a different field.
    InputError, MissingExtraError
        As for `encode` and the writers; for tiles, naming the tile, or if the field changed while it was being read.

    Examples
    --------
    >>> import numpy as np, isocodec
    >>> field = np.load("terrain.npy", mmap_mode="r")             # doctest: +SKIP
    >>> isocodec.save("terrain.iso", field, 500.5, tile=1024)     # doctest: +SKIP
    """
    if tile is None and not (engine is threads is spool is None):
        raise OptionError("engine, threads and spool apply to tiles only", code="tile", remedy="tile=1024")
    suffix = Path(path).suffix.lower()
    if suffix != ".iso":
        if options.keys() - _OF_CURVES or tile is not None:
            raise OptionError(f"options of encoding do not apply to {suffix or 'a name without a suffix'}",
                              code="options", remedy="choose a name that ends in .iso")
        if not _write_other(path, what, isovalue, suffix, bool(options), simplify):
            from .export import drawn

            field = taken(native(what))
            field = field if isinstance(field, Frames | Mesh) else field_of(field)
            wanted = Decode(simplify=None if simplify is None else str(simplify))
            drawn(field, path, wanted, isovalue, **options).write(path, progress)
        return
    if simplify is not None:
        raise OptionError("simplify does not apply to .iso files", code="simplify", remedy="use precision")
    if _contours(what) is not None:
        raise OptionError("contours cannot be written to an .iso file", code="suffix",
                          remedy="encode the field, or choose another suffix")
    if isinstance(what, bytes | IsoFile):
        if isovalue is not None or options or tile is not None:
            raise OptionError("isovalue and options do not apply to files that are already encoded", code="options")
        check_target(path)
        write_bytes(path, what if isinstance(what, bytes) else what.data)
        return
    check_target(path)
    if tile is None:
        from ..stream.encoder import encoder_of

        write_bytes(path, b"".join(encoder_of(native(what), isovalue, progress=progress, **options)))
        return
    save_tiles(path, what, isovalue, tile=tile, engine=engine, threads=threads, spool=spool, progress=progress,
               **options)


def save_tiles(
    path: str | os.PathLike[str], what: Any, isovalue: Isovalues | None, *, tile: int | None,
    resumed: Progress | None = None, progress: Progress | None = None,
    **options: Any,
) -> SampleCounts:
    """Write a tiled file as `save` does, and return facts about the samples.

    ``resumed`` is called with the number of tiles that were already encoded, if any, and the total.
    """
    from ..tiles.writing import encode_tiles, tiling_of

    if described(what):
        from .inputs import windowed

        what = windowed(what, Choice())
        for remark in what.remarks:
            warnings.warn(remark, stacklevel=3)
    work = {name: options.pop(name, None) for name in ("engine", "threads", "spool")}
    tiling = tiling_of(what, isovalue, tile, Options.of(**options), progress)
    return encode_tiles(path, what, tiling, progress=progress, resumed=resumed, **work)


def _write_other(
    path: str | os.PathLike[str], what: Any, isovalue: Any, suffix: str, options: bool, simplify: float | str | None
) -> bool:
    """Write contours or a surface in another format than .iso; returns whether ``what`` is such."""
    from ..io.formats import Thing, check, write
    from ..tin.tin import Tin

    contours = _contours(what)
    made = contours is not None or isinstance(what, bytes | IsoFile | Tin | Tessellation)
    if made and options:
        raise OptionError("options of encoding do not apply to what is encoded or drawn already", code="options")
    if contours is not None and isovalue is not None:
        raise OptionError("isovalue does not apply to contours", code="options")
    if isinstance(what, bytes | IsoFile):
        from .opening import open

        file = open(what) if isinstance(what, bytes) else what
        check(path, Thing("tin" if isovalue is None and file.kind == "surface" else "contour"))
        if isovalue is None and file.kind == "surface":
            what = file.surface()
        else:
            values = isovalue if isinstance(isovalue, list | tuple) else [isovalue]
            contours = file.contours() if isovalue is None else [file.contour(value) for value in values]
    if simplify is not None and made:
        if not contours:
            raise OptionError("simplify applies to lines only", code="simplify", remedy="leave it out")
        contours = simplified(contours, simplify).contours
    if isinstance(what, Tin | Tessellation):
        write(path, what)
    elif contours:
        write(path, contours if len(contours) > 1 else contours[0])
    elif made:
        raise OptionError(f"an .iso file cannot be saved as {suffix or 'a name without a suffix'}", code="suffix",
                          remedy="choose a name that ends in .iso, or decode it first")
    return made


def _contours(what: Any) -> list[Contour] | None:
    """The contours in an object, or None if it is neither a contour nor a list of contours."""
    if isinstance(what, Contour):
        return [what]
    if isinstance(what, list | tuple) and any(isinstance(one, Contour) for one in what):
        if not all(isinstance(one, Contour) for one in what):
            raise InputError("contours and other objects cannot be written to one file", code="contours")
        return list(what)
    return None
