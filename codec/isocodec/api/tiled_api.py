"""Fields in tiles: encoded tile by tile into one file, and read window by window."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..field.placement import Noted
from ..limits import Limits
from ..storage.ranges import Fetch
from ..stream.names import Isovalues, ProfileName
from ..stream.options import Options, isovalues_of
from ..tiles.encoding import Tiling
from ..tiles.layout import Index
from ..tiles.merging import grid_of, merged
from ..tiles.structure import EXPONENTS, HEAD_BYTES, is_tiled
from ..tiles.tiled import Box, TiledFile

if TYPE_CHECKING:
    from ..tiles.running import Engine
    from ..tiles.structure import Head, Root

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


class TiledIsoFile(Noted):
    """A tiled ``.iso`` file: windows of its curves, read as they are asked for.

    Attributes
    ----------
    requests, received : int
        How many pieces of the file have been read, and how many bytes.
    """

    def __init__(self, fetch: Fetch, limits: Limits | None = None, first: bytes | None = None) -> None:
        self.requests = self.received = 0
        self._read = fetch
        if first is not None:
            self.requests, self.received = 1, len(first)
        self._file = TiledFile(self._fetch, limits, first)

    def _fetch(self, start: int, end: int) -> bytes:
        data = self._read(start, end)
        self.requests += 1
        self.received += len(data)
        return data

    def __repr__(self) -> str:
        values = ", ".join(f"{value:g}" for value in self.isovalues[:5]) + ", .." * (len(self.isovalues) > 5)
        return f"TiledIsoFile({self.size:,} bytes, shape={self.shape}, isovalues {values})"

    @property
    def head(self) -> Head:
        """What the file says of its tiles."""
        return self._file.head

    @property
    def root(self) -> Root:
        """Where its directories and segments are."""
        return self._file.root

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self._file.root.total

    @property
    def cut(self) -> bool:
        """Whether the file ends before its tiles do; this asks for its last byte."""
        return not self._fetch(self.size - 1, self.size)

    @property
    def shape(self) -> Index:
        """Samples along each axis of the field."""
        return self._file.shape

    @property
    def isovalues(self) -> tuple[float, ...]:
        """Isovalues, in the order of the file."""
        return self._file.isovalues

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file."""
        return self._file.metadata

    def window(
        self, box: Sequence[Sequence[float]] | None = None, *, isovalue: float | None = None,
        within: float | Callable[[Box], float] | None = None, layer: int | None = None, partial: bool = False,
    ) -> Contour:
        """The curve or surface in a box.

        Parameters
        ----------
        box : n pairs of numbers, optional
            From where to where along each axis, in samples. Everything if not given.
        isovalue : float, optional
            One of the file; the first if not given.
        within : float or callable, optional
            Cubes of the mesh no wider than so many samples are enough; or a function that says so of the box of a tile,
            n pairs of samples. Gaps between tiles of different layers are closed in the faces that they share.
        layer : int, optional
            Up to which layer of the file, from 0; the last if neither is given.
        partial : bool
            Of a file that ends too early, draw each tile up to the last layer that is there.

        Raises
        ------
        OptionError, FormatError, TruncatedError, LimitError
        """
        return self._file.window(box, isovalue=isovalue, within=within, layer=layer, partial=partial)

    def layer_within(self, samples: float) -> int:
        """The first layer whose cubes are no wider than so many samples, the last one if none is."""
        return self._file.stage_of(samples)

    def contour(self, isovalue: float | None = None, *, layers: int | None = None) -> Contour:
        """The curve or surface of an isovalue, of the first ``layers`` layers if that is given."""
        return self.window(isovalue=isovalue, layer=None if layers is None else layers - 1)

    def contours(self) -> list[Contour]:
        """The curves or surfaces of all isovalues."""
        return [self.contour(isovalue) for isovalue in self.isovalues]

    def extract(
        self, box: Sequence[Sequence[float]] | None = None, *, isovalue: float | None = None
    ) -> bytes:
        """A box of samples as an ``.iso`` file in one piece, in which no point moves.

        Parameters
        ----------
        box : n pairs of numbers, optional
            From where to where along each axis, in samples; grown to whole samples, and to even ones where it begins.
            Everything if not given.
        isovalue : float, optional
            One of the file; all of them if not given.

        Returns
        -------
        bytes
            With the notes of this file and a placement that leaves the curve where it was. If the box is that of one
            tile the bytes of its layers are those of this file; else they are coded anew from what the tiles tell:
            what this file promises of its curve holds for that file's.

        Raises
        ------
        OptionError
            If the box lies outside; or if meshes are coarser than the samples, chosen for a tolerance or since layers
            are missing, and the box is not that of one tile.
        FormatError, LimitError
        """
        from ..tiles.extraction import Extract
        from .recoding import kept

        part = Extract(self._file, box)
        count = len(self.isovalues)
        numbers = list(range(count)) if isovalue is None else [self._file.number_of(isovalue)]
        taken = part.strands(numbers)
        if taken is not None:
            return taken
        return kept(part.sources(numbers), profile=self.head.profile.name.lower(), metadata=part.notes)

    def truncate(self, path: str | os.PathLike[str], layers: int) -> None:
        """Write a tiled file with the first layers of this one, whole or not at all; see `truncated`."""
        from ..storage.atomic import check_target, writing

        check_target(path)
        with writing(path) as file:
            for piece in self.truncated(layers):
                file.write(piece)

    def truncated(self, layers: int) -> Iterator[bytes]:
        """The bytes of a tiled file with the first layers of this one, piece by piece; they are copied, not decoded.

        Raises
        ------
        OptionError
            If there are to be no layers.
        FormatError
            If directories are damaged. What is damaged in segments is found by whoever reads the result.
        """
        from ..tiles.truncation import first_stages

        return first_stages(self._file, layers)

    def tile(self, index: Index, isovalue: float | None = None) -> bytes:
        """A tile as an ``.iso`` file of its own; where the curve does not come, one without layers."""
        return self._file.plain(index, isovalue)


def tiled_at(source: str | os.PathLike[str], limits: Limits | None = None) -> TiledIsoFile | None:
    """The tiled file at a path or URL, of which what is needed is read later.

    None if it is something else, comes through a pipe, or if its server does not give parts.

    Raises
    ------
    OSError, InputError
        If it cannot be opened.
    """
    from ..storage.content import is_url
    from ..storage.ranges import NoRangesError, ranges_of

    if not is_url(source) and os.path.exists(source) and not os.path.isfile(source):
        return None
    fetch = ranges_of(source)
    try:
        first = fetch(0, HEAD_BYTES)
    except NoRangesError:
        return None
    return TiledIsoFile(fetch, limits, first) if is_tiled(first) else None


def tiled_contours(
    data: bytes, isovalue: float | None, layers: int | None, limits: Limits | None, **others: object
) -> list[Contour]:
    """Contours of a tiled file whose bytes are all there: of one isovalue, or of all.

    Raises
    ------
    OptionError
        If other options of `decode` are given: they mean nothing there.
    """
    given = [name for name, value in others.items() if value is not None and value is not False]
    if given:
        raise OptionError(f"{' and '.join(given)}: the file is in tiles", code="tiles",
                          remedy="leave that out; isocodec.open(..).window takes a part")
    file = tiled_of(data, limits)
    return [file.contour(value, layers=layers) for value in (file.isovalues if isovalue is None else (isovalue,))]


def tiled_of(data: bytes | bytearray | memoryview, limits: Limits | None = None) -> TiledIsoFile:
    """A tiled file whose bytes are all there."""
    view = memoryview(data)
    return TiledIsoFile(lambda start, end: bytes(view[start:end]), limits)
