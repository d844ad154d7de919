"""Fields in tiles: encoded tile by tile into one file, and read window by window."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, OptionError
from ..stream.names import Isovalues, ProfileName
from ..stream.options import Options, isovalues_of
from ..tiles.encoding import Tiling
from ..tiles.layout import Index
from ..tiles.merging import grid_of, merged
from ..tiles.structure import EXPONENTS

if TYPE_CHECKING:
    from ..tiles.running import Engine

TILE = 1024
"""Samples along each axis of a tile in the plane, unless another number is asked for; in space an eighth."""


def encode_tiles(
    field: Any,
    isovalue: Isovalues,
    path: str | os.PathLike[str],
    *,
    tile: int | None = None,
    engine: Engine | None = None,
    workers: int | None = None,
    spool: str | os.PathLike[str] | None = None,
    exact: bool = False,
    tolerance: float | None = None,
    signs_only: bool = False,
    step: float | None = None,
    profile: ProfileName = "main",
    metadata: Mapping[str, str] | None = None,
    placement: ArrayLike | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> None:
    """Encode the isocontours of a field that need not be in memory, tile by tile, into one file (spec clause 12).

    Parameters
    ----------
    field : array
        Anything that has ``shape``, ``dtype`` and slices: an array of numpy (mapped from a file, say), Dask, xarray,
        Zarr or h5py, of two or three axes. Slices of a tile are read at a time. NaN and masked samples are missing.
    isovalue : number or sequence of numbers
    path : path
        The file, written whole or not at all.
    tile : int, optional
        Samples along each axis of a tile, a power of two from 32 on: 1024 in the plane, 128 in space if not given.
    engine : executor of ``concurrent.futures``, or client of ``dask.distributed``, optional
        Who encodes; without one the caller's thread. The file has the same bytes.
    workers : int, optional
        How many the engine has; asked of it if not given.
    spool : path, optional
        A folder for what has been encoded, beside the file if not given. It goes when the file is written; if work
        stops before, the same call goes on where it was.
    exact, tolerance, signs_only, step, profile, metadata, placement
        As in `encode`. With a tolerance in space from half a sample on, meshes of cubes are tried, of the same edge in
        all tiles, smaller ones and at last the full grid where a tile is not proven to keep to it, or samples are
        missing; tiles are encoded again then.
    progress : callable, optional
        Called with the tiles done and their total.

    Raises
    ------
    OptionError
        If options contradict one another, or the spool has tiles of something else.
    InputError
        If the field cannot be encoded, naming the tile, or has changed while it was read.
    OSError
        If something cannot be written; what has been encoded is kept in the spool.

    Examples
    --------
    >>> import numpy as np, isocodec
    >>> field = np.load("terrain.npy", mmap_mode="r")             # doctest: +SKIP
    >>> isocodec.encode_tiles(field, 500.5, "terrain.iso")        # doctest: +SKIP
    >>> isocodec.open("terrain.iso").window([(0, 100), (50, 90)]) # doctest: +SKIP
    """
    from ..search.strategy import NotKeptError
    from ..storage.atomic import check_target, writing
    from ..tiles.running import run
    from ..tiles.spool import Spool, begun

    tiling = tiling_of(
        field, isovalue, tile, exact=exact, tolerance=tolerance, signs_only=signs_only, step=step, profile=profile,
        metadata=metadata, placement=placement,
    )
    check_target(path)
    folder = Path(spool) if spool is not None else Path(f"{os.fspath(path)}.tiles")
    tried = tiling.tried()
    left = tried[begun(folder, tried) :]
    while left:
        with Spool(folder, left[0]) as held:
            try:
                run(field, left[0], held, engine, workers or _workers_of(engine), progress)
            except NotKeptError as error:
                left = left[-1:] if error.code == "missing" else left[1:]
            else:
                left = []
                with writing(path) as file:
                    for piece in merged(held.tiles, held.read):
                        file.write(piece)
            held.remove()


def tiling_of(field: Any, isovalue: Isovalues, tile: int | None, **options: Any) -> Tiling:
    """What `encode_tiles` is asked for, checked before any sample is read.

    Raises
    ------
    OptionError, InputError
        As `encode_tiles`, of all but the samples.
    """
    shape, dtype = _field_of(field)
    grid = grid_of(shape, _exponent(tile, len(shape)))
    return Tiling(grid, tuple(isovalues_of(isovalue)), Options(**options), dtype.str)


def _field_of(field: Any) -> tuple[Index, np.dtype[Any]]:
    """Shape and type of something with slices."""
    shape, dtype = getattr(field, "shape", None), getattr(field, "dtype", None)
    if shape is None or dtype is None:
        raise InputError(
            f"{type(field).__name__} has no shape or no dtype", code="field", remedy="numpy.asarray, or open it first"
        )
    if len(shape) not in (2, 3) or min(shape) < 2:
        raise InputError(
            f"a field of shape {tuple(shape)}; needed are 2 or 3 axes, and 2 samples along each", code="shape"
        )
    found = np.dtype(dtype)
    if found.kind not in "biuf":
        raise InputError(f"samples of type {found}; they must be real numbers", code="dtype")
    return tuple(int(s) for s in shape), found


def _exponent(tile: int | None, n: int) -> int:
    if tile is None:
        tile = TILE if n == 2 else TILE >> 3
    exponent = int(tile).bit_length() - 1
    if tile != 1 << exponent or exponent not in EXPONENTS:
        raise OptionError(
            f"tiles of {tile} samples; needed is a power of two from {1 << EXPONENTS[0]} to {1 << EXPONENTS[-1]}",
            code="tile",
        )
    return exponent


def _workers_of(engine: Any) -> int:
    """How many an engine has, as far as it says."""
    if hasattr(engine, "nthreads"):
        return max(sum(engine.nthreads().values()), 1)
    return int(getattr(engine, "_max_workers", 1))
