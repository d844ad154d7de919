"""Write tiled files of fields that need not be in memory (spec clause 12)."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError
from ..field.isovalues import isovalues_of
from ..field.labelling import noted
from ..field.missing import HOLE, filled
from ..field.sampled import Field
from ..field.samples import isovalue_of, missing_of
from ..storage.atomic import check_target, writing
from ..storage.content import is_url
from ..stream.given import in_cells, levels_of, of_labels
from ..stream.options import Isovalues, Options, Precision
from ..stream.promises import PROMISE
from ..verbs import Progress
from .assembly import Tiles, grid_of, merged
from .layout import Index, TileGrid, in_order
from .spool import Spool, begun
from .structure import EXPONENTS
from .tile_encoder import Tiling
from .workers import run

if TYPE_CHECKING:
    from .workers import Engine

TILE = 1024
"""Default number of samples along each axis of a tile in 2-D; in 3-D, an eighth of it."""


@dataclass(frozen=True)
class SampleCounts:
    """Facts about the samples of a field that was encoded in tiles.

    Attributes
    ----------
    low, high : float or None
        Least and largest sample; None if all are missing.
    missing : int
    ties : dict of float to int
        Samples equal to an isovalue, by isovalue.
    """

    low: float | None
    high: float | None
    missing: int
    ties: dict[float, int]


def encode_tiles(
    path: str | os.PathLike[str], field: Any, tiling: Tiling, *, engine: Engine | None = None,
    threads: int | None = None, spool: str | os.PathLike[str] | None = None,
    progress: Progress | None = None, resumed: Progress | None = None,
) -> SampleCounts:
    """Encode a field tile by tile into one file.

    In 3-D with a tolerance of half a sample or more, meshes of cubes with the same edge in all tiles are tried. If a
    tile is not proven to keep the tolerance, or if samples are missing, all tiles are encoded again with smaller cubes,
    and finally on the full grid. Parameters and errors are as for `isocodec.save`; ``resumed`` is called with the
    number of tiles that a spool has, if any, and the total.
    """
    from ..search.strategy import NotKeptError

    check_target(path)
    field = slices_of(field)
    beside = Path(gettempdir(), quote(str(path), safe="")[-200:]) if is_url(path) else path
    folder = Path(spool) if spool is not None else Path(f"{os.fspath(beside)}.tiles")
    tried = tiling.tried()
    left = tried[begun(folder, tried) :]
    while True:
        with Spool(folder, left[0]) as held:
            total = tiling.grid.total
            if resumed and held.tiles.missing() < total:
                resumed(total - held.tiles.missing(), total)
            try:
                run(field, left[0], held, engine, threads, progress)
            except NotKeptError as error:
                left = left[-1:] if error.code == "missing" else left[1:]
                held.remove()
                continue
            with writing(path) as file:
                for piece in merged(held.tiles, held.read):
                    file.write(piece)
            held.remove()
            return _counts_of(held.tiles)


def _counts_of(tiles: Tiles) -> SampleCounts:
    low, high, gone, *ties = tiles.counts.reshape(len(tiles.counts), -1)
    known = ~np.isnan(low)
    return SampleCounts(
        float(low[known].min()) if known.any() else None, float(high[known].max()) if known.any() else None,
        int(gone.sum()), {v: int(each.sum()) for v, each in zip(tiles.tiling.isovalues, ties, strict=True)},
    )


def tiling_of(
    field: Any, isovalue: Isovalues | None, tile: int | None, options: Options,
    progress: Progress | None = None,
) -> Tiling:
    """Check the input, and make the tiling; no sample is read unless isovalues need the range of the data.

    A tile has 1024 samples along each axis in 2-D, 128 in 3-D, unless ``tile`` is given. ``progress`` is called with
    the number of tiles done and the total while the range is determined. Raises the errors of `encode_tiles`, except
    for those in samples.
    """
    samples = field.values if isinstance(field, Field) else field
    shape, dtype = _shape_of(samples)
    options = _options_of(field, shape, dtype, isovalue, options)
    grid = grid_of(shape, _exponent(tile, len(shape)))
    labels = field.labels if isinstance(field, Field) else None
    if labels is not None:
        isovalue = levels_of(field, isovalue, options)
    if isovalue is None and dtype.kind != "b":
        raise OptionError("no isovalue", code="isovalue",
                          remedy="only a mask (bool) or labels can be encoded without one")

    def ends() -> tuple[float, float]:
        found = sample_range(slices_of(field), grid, progress)
        if found is None:
            raise InputError("all samples are missing", code="missing")
        return found

    tiling = Tiling(grid, (), options, dtype.str, of_labels=labels is not None)
    tiling = replace(tiling, isovalues=tuple(isovalues_of(0.5 if isovalue is None else isovalue, ends)))
    way = field.missing if isinstance(field, Field) else HOLE
    if way == HOLE:
        return tiling
    if labels is not None:
        return replace(tiling, fill=next(value for value in count() if value not in labels))
    # as of a field in one piece: the last of three samples is missing
    fill = filled(np.array([*ends(), 0], dtype), np.array([False, False, True]), way, tiling.isovalues)[2]
    return replace(tiling, fill=fill.item())


def sample_range(
    field: Any, grid: TileGrid, progress: Progress | None = None
) -> tuple[float, float] | None:
    """Find the least and the largest valid sample, reading one tile at a time; None if all are missing."""
    found: list[tuple[Any, Any]] = []
    for done, index in enumerate(map(tuple, in_order(grid.counts).tolist()), 1):
        window = field[grid.window(index)]
        values = np.asarray(window)[~missing_of(window)]
        if values.size:
            found = [*found, (values.min(), values.max())]
            found = [(min(low for low, _ in found), max(high for _, high in found))]
        if progress:
            progress(done, grid.total)
    return (float(found[0][0]), float(found[0][1])) if found else None


def _options_of(
    field: Any, shape: Index, dtype: np.dtype[Any], isovalue: Isovalues | None, options: Options
) -> Options:
    """Complete the options with the notes of a field and defaults for its type; distances are converted to cells."""
    precision = options.precision
    if precision.default and isovalue is None and dtype.kind == "b":
        precision = Precision(signs=True)
    if not isinstance(field, Field):
        field = Field(np.broadcast_to(np.zeros((), dtype), shape))
    if field.missing == "nearest":
        raise OptionError("samples filled by the nearest ones do not apply to tiles", code="tiles",
                          remedy="let missing samples be holes, below or above")
    notes = {**field.metadata, **options.metadata}
    placement = field.placement
    if placement is not None:
        if placement.periodic or placement.coordinates is not None:
            raise OptionError("coordinates and periodic axes do not apply to tiles", code="tiles",
                              remedy="use a matrix")
        notes = {**notes, **{key: text for key, text in placement.notes().items() if key not in notes}}
    if field.labels is not None:
        precision = Precision(signs=True) if precision.default else precision
        options = of_labels(field, replace(options, precision=precision))
        notes |= noted([*map(isovalue_of, field.labels)], dtype)
    if not options.precision.default:
        notes[PROMISE] = precision.text
        precision = in_cells(precision, placement, notes, options.metadata, shape)
    return replace(options, precision=precision, metadata=notes)


def slices_of(field: Any) -> Any:
    """An array-like object whose slices have missing samples masked."""
    if not isinstance(field, Field):
        return field
    return field.values if field.mask is None else _Masked(field.values, field.mask)


class _Masked:
    """Samples and their mask of missing ones, slice by slice."""

    def __init__(self, values: NDArray[Any], mask: NDArray[np.bool_]) -> None:
        self._values, self._mask = values, mask
        self.shape, self.dtype = values.shape, values.dtype

    def __getitem__(self, window: Any) -> np.ma.MaskedArray[Any, Any]:
        return np.ma.array(self._values[window], mask=self._mask[window])


def _shape_of(field: Any) -> tuple[Index, np.dtype[Any]]:
    """Shape and type of an array-like object."""
    shape, dtype = getattr(field, "shape", None), getattr(field, "dtype", None)
    if shape is None or dtype is None:
        raise InputError(
            f"{type(field).__name__} has no shape or no dtype", code="field", remedy="numpy.asarray, or open it first"
        )
    if len(shape) not in (2, 3) or min(shape) < 2:
        raise InputError(
            f"a field of shape {tuple(shape)} cannot be encoded in tiles", code="shape",
            remedy="a field must have 2 or 3 axes with at least 2 samples along each",
        )
    found = np.dtype(dtype)
    if found.kind not in "biuf":
        raise InputError(f"the samples have type {found}; they must be real numbers", code="dtype")
    return tuple(int(s) for s in shape), found


def _exponent(tile: int | None, n: int) -> int:
    if tile is None:
        tile = TILE if n == 2 else TILE >> 3
    exponent = int(tile).bit_length() - 1
    if tile != 1 << exponent or exponent not in EXPONENTS:
        raise OptionError(
            f"tile size {tile} is not a power of two between {1 << EXPONENTS[0]} and {1 << EXPONENTS[-1]}",
            code="tile",
        )
    return exponent
