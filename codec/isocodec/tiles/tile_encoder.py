"""Encode one tile: samples in, segments out; a pure function of the samples, the index and the options."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, Profile

from ..entropy.range_coder import Coder
from ..errors import InputError, OptionError
from ..field.samples import Samples, check_field, mask_field, missing_of, without_holes
from ..format.chunks import write_chunk
from ..format.header import Header
from ..format.kinds import LayerKind
from ..format.program import Progress
from ..grid.layers.layer_writer import LayerWriter, encoded_mask, field_tube
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..search.ground_truth import GroundTruth, truth_of
from ..search.promise import Promise
from ..search.shared_sides import SharedSides
from ..search.strategy import NotKeptError, Plan, base_of, exponent_of, smallest
from ..search.tile_faces import Faces, volume_plan
from ..search.tolerance import grid_offsets, radices
from ..stream.options import BEST, DEFAULT_TOLERANCE, Options
from .layout import COARSEST, Index, TileGrid
from .structure import Head, Kind, Stage

EDGES = (COARSEST, 2, 0)
"""Exponents of the edges of the cubes that stages lead to."""
TOGETHER = 8
"""Isovalues in a group, which is read as a whole."""


@dataclass(frozen=True)
class Tiling:
    """Properties shared by all tiles of a file.

    Attributes
    ----------
    grid : TileGrid
    isovalues : tuple of float
    options : Options
    dtype : str
        Type of the samples.
    cubes : int
        In 3-D, exponent of the edge of the cubes that meshes for a tolerance begin with; 0 for the full grid.
    fill : int or float, optional
        Value that takes the place of missing samples.
    of_labels : bool
        Whether the isovalues are labels.
    """

    grid: TileGrid
    isovalues: tuple[float, ...]
    options: Options
    dtype: str
    cubes: int = 0
    fill: float | None = None
    of_labels: bool = False

    def __post_init__(self) -> None:
        o = self.options
        o.check_data(np.dtype(self.dtype).kind in "biu")
        o.check_unused("tiles", {"effort": o.effort == BEST})
        unused = {
            "layers": not o.layers.default,
            f"precision {o.precision.text!r}": o.precision.steps is not None or o.precision.smooth,
            "keep_topology": o.keep_topology,
        }
        if chosen := next((name for name, given in unused.items() if given), ""):
            raise OptionError(
                f"{chosen} and tiles cannot be combined: the meshes of tiles must be the same where they meet",
                code="tiles", remedy="use exact, step=.., signs or one distance",
            )
        o.check_placement_note(self.grid.n)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Stages of each isovalue."""
        if self.searched is not None:
            return Stage(COARSEST), Stage(0, adaptive=True)
        signs = tuple(Stage(edge) for edge in EDGES)
        return signs if self.options.precision.signs else (*signs, Stage(0, True))

    @property
    def searched(self) -> float | None:
        """The tolerance that meshes are searched for; None if there is no search."""
        if self.grid.n == 3 and not self.cubes:
            return None
        return self.options.searched

    def tried(self) -> list[Tiling]:
        """Tilings to try one after the other, with smaller and smaller cubes, and finally the full grid."""
        tolerance = self.options.searched if self.grid.n == 3 else None
        largest = 0 if tolerance is None else min(exponent_of(tolerance), COARSEST)
        return [replace(self, cubes=exponent) for exponent in range(largest, -1, -1)]

    @property
    def profile(self) -> Profile:
        """The entropy profile."""
        return self.options.entropy

    def head(self, masked: bool) -> Head:
        """The head of the file."""
        o = self.options
        step, notes = o.precision.step, dict(o.metadata)
        return Head(self.grid, self.isovalues, self.stages, step, self.profile, masked, notes, self.together)

    @property
    def slack(self) -> bool:
        """Whether crossings have slack: not where several digits of them could pass those of the isovalue leaned on."""
        fine = self.options.precision.tolerance or DEFAULT_TOLERANCE
        return self.profile == Profile.MAIN and (len(self.isovalues) == 1 or len(radices(fine)) == 1)

    @property
    def together(self) -> int:
        """Isovalues that lean on one another in a tile; 1 if none does."""
        count, precision = len(self.isovalues), self.options.precision
        if count == 1 or self.options.independent or self.searched is not None:
            return 1
        values = precision.exact or precision.step is not None
        if not (precision.signs or values):
            # slack must not move a crossing past that of the isovalue leaned on
            rising = [a < b for a, b in pairwise(self.isovalues)]
            if self.slack and len({*rising}) > 1:
                return 1
        return min(TOGETHER, count)


@dataclass(frozen=True)
class TileSegments:
    """An encoded tile.

    Attributes
    ----------
    index : tuple of int
    mask : Kind
        ``BELOW`` if no sample is missing, ``ABOVE`` if all are.
    mask_segment : bytes
    kinds : tuple of Kind
        By isovalue.
    segments : tuple of tuple of bytes
        By isovalue and stage; empty for tiles that are not coded.
    faces : tuple of tuple of int
        Checksums of the samples in the low and the high face across each axis.
    counts : tuple of float
        Least and largest sample (NaN if all are missing), missing samples, samples equal to each isovalue. Samples that
        the next tile has, too, are left to it.
    """

    index: Index
    mask: Kind
    mask_segment: bytes
    kinds: tuple[Kind, ...]
    segments: tuple[tuple[bytes, ...], ...]
    faces: tuple[tuple[int, int], ...]
    counts: tuple[float, ...]


def encode_tile(window: ArrayLike, index: Index, tiling: Tiling) -> TileSegments:
    """Encode a tile from its samples, ``field[tiling.grid.window(index)]``; NaN and masked samples are missing.

    The segments depend only on the samples, not on where or in which order tiles are encoded. Raises `InputError` if
    the samples cannot be encoded, or do not have the tile's shape.
    """
    size = tiling.grid.size(index)
    if np.shape(window) != size:
        raise InputError(f"has {size} samples, not {np.shape(window)}", code="shape")
    counts = _counts(window, index, tiling)
    if tiling.fill is not None:
        window = np.where(missing_of(window), np.asarray(tiling.fill, np.asarray(window).dtype), np.asarray(window))
    if missing_of(window).all():
        return _missing(index, tiling, counts)
    values, gone = without_holes(window)
    faces = tuple(
        (_checksum(values.take(0, axis), gone, 0, axis), _checksum(values.take(-1, axis), gone, -1, axis))
        for axis in range(values.ndim)
    )
    stages = len(tiling.stages)
    fields = [check_field(values == isovalue, 0.5, None, gone) if tiling.of_labels
              else check_field(values, isovalue, tiling.options.precision.step, gone) for isovalue in tiling.isovalues]
    header = Header(size, tiling.isovalues[0], tiling.options.precision.step, tiling.profile)
    there = slice(None) if gone is None else ~gone
    kinds = tuple(_kind(field.signs[there]) for field in fields)
    run, holes = b"", None
    if gone is not None and Kind.CODED in kinds:
        mask = mask_field(gone)
        run, holes = encoded_mask(header, mask, truth_of(mask))
        run = write_chunk(ChunkType.MASK, run)
    meshes = [
        _faces(field, index, tiling) if kind == Kind.CODED else None for field, kind in zip(fields, kinds, strict=True)
    ]
    segments = [(b"",) * stages for _ in fields]
    for first in range(0, len(fields), tiling.together):
        coded = [i for i in range(first, min(first + tiling.together, len(fields))) if kinds[i] == Kind.CODED]
        if coded:
            group = [fields[i] for i in coded]
            found = _segments(header, group, holes, index, tiling, meshes[coded[0]])
            for i, *own in zip(coded, *found, strict=True):
                segments[i] = tuple(own)
    faces = tuple((_sealed(low, meshes, axis, 0), _sealed(high, meshes, axis, size[axis] - 1))
                  for axis, (low, high) in enumerate(faces))
    return TileSegments(index, Kind.CODED if run else Kind.BELOW, run, kinds, tuple(segments), faces, counts)


def _faces(field: Samples, index: Index, tiling: Tiling) -> Faces | None:
    """Find the vertices and edges that belong to the mesh in shared faces, in 3-D.

    Raises `NotKeptError` if samples are missing, since the values that fill them would have to be the same on both
    sides.
    """
    tolerance = tiling.searched
    if tolerance is None or field.signs.ndim == 2:
        return None
    if field.gone is not None:
        raise NotKeptError("samples are missing", code="missing")
    faces = Faces(field.signs, tiling.grid.shared(index), tiling.cubes)
    for axis, place in faces.planes:
        values, signs = np.take(field.values, place, axis), np.take(field.signs, place, axis)
        samples = Samples(values, field.isovalue, np.asarray(signs))
        faces.search((axis, place), samples, tolerance)
    return faces


def _sealed(checksum: int, meshes: Sequence[Faces | None], axis: int, place: int) -> int:
    """Checksum of a face's samples, combined with that of its mesh, so that neighbours must agree on both."""
    for faces in filter(None, meshes):
        for vertex in faces.wanted.get((axis, place), ()):
            checksum = zlib.crc32(repr(vertex[:axis] + vertex[axis + 1 :]).encode(), checksum)
    return checksum


def _counts(window: ArrayLike, index: Index, tiling: Tiling) -> tuple[float, ...]:
    """See `TileSegments.counts`."""
    own = tuple(slice(None, -1 if shared else None) for _, shared in tiling.grid.shared(index))
    gone = missing_of(window)[own]
    there = np.asarray(window)[own][~gone]
    low, high = (there.min(), there.max()) if there.size else (math.nan, math.nan)
    return float(low), float(high), float(gone.sum()), *(
        0.0 if tiling.of_labels else float((there == v).sum()) for v in tiling.isovalues)


def _missing(index: Index, tiling: Tiling, counts: tuple[float, ...]) -> TileSegments:
    """Make a tile whose samples are all missing."""
    grid, count = tiling.grid, len(tiling.isovalues)
    faces = []
    for axis in range(grid.n):
        beside = grid.size(index)[:axis] + grid.size(index)[axis + 1 :]
        face = np.zeros(beside, tiling.dtype)
        faces.append(2 * (_checksum(face, np.ones((1, *beside), np.bool_), 0, 0),))
    segments = ((b"",) * len(tiling.stages),) * count
    return TileSegments(index, Kind.ABOVE, b"", (Kind.BELOW,) * count, segments, tuple(faces), counts)


def _kind(signs: NDArray[np.bool_]) -> Kind:
    return Kind.ABOVE if signs.all() else Kind.CODED if signs.any() else Kind.BELOW


def _checksum(face: NDArray[np.generic], gone: NDArray[np.bool_] | None, at: int, axis: int) -> int:
    """Compute a checksum of the samples of a face and their mask."""
    known = 0
    if gone is not None and (missing := gone.take(at, axis)).any():
        face = np.where(missing, face.dtype.type(0), face)
        known = zlib.crc32(np.packbits(missing).tobytes())
    return zlib.crc32(np.ascontiguousarray(face).tobytes(), known)


def _segments(
    header: Header, fields: Sequence[Samples], holes: Holes | None, index: Index, tiling: Tiling, faces: Faces | None
) -> Iterator[list[bytes]]:
    """Make the segments of a group of isovalues, stage by stage; each leans on the one before it."""
    truths = [truth_of(field) for field in fields]
    if tiling.searched is None:
        plan, ends = _plan(index, tiling)
    else:
        own = replace(header, isovalue=fields[0].isovalue)
        plan, ends = _searched(own, fields[0], truths[0], holes, index, tiling, faces)
    writers: list[LayerWriter] = []

    def fresh(place: int, coder: Coder | None = None) -> Tube:
        field, truth = fields[place], truths[place]
        if not place:
            return field_tube(header, field, truth, holes=holes)
        before = writers[place - 1]
        return field_tube(header, field, truth, before.tube, before.field.isovalue, holes, coder=coder)

    for place, field in enumerate(fields):
        tube = fresh(place)
        progress = Progress(tube.full_level).begin(writers[-1].progress if writers else None)
        writers.append(LayerWriter(field, tube, plan, progress))
    for stage, (first, end) in enumerate(pairwise([0, *ends])):
        made = []
        for place, writer in enumerate(writers):
            if not stage and place:
                # the one before has a base by now; the models are shared
                writer.tube = fresh(place, writer.tube.coder)
            # layers of values are known only when earlier layers are done
            last = len(writer.layers) if end is None else end
            if first is not None and first == last:
                made.append(b"")
                continue
            done, run = writer.encode_run(first or 0, lambda: None, math.inf, None if end is None else last - 1)
            made.append(write_chunk(ChunkType.LAYERS, writer.program(first or 0, done) + run))
        yield made


def _plan(index: Index, tiling: Tiling) -> tuple[Plan, list[int | None]]:
    """Make the layers of a tile's isovalue, and the number of layers after each stage; None for all."""
    grid, precision = tiling.grid, tiling.options.precision
    levels = [grid.level(index, stage.edge) for stage in tiling.stages if not stage.geometry]
    base = base_of(grid.n, levels[0])
    plan: Plan = [(LayerKind.BASE, base)]
    if base < levels[-1]:
        plan.append((LayerKind.REFINE, None))
    ends: list[int | None] = [1 + level - base for level in levels]
    if not precision.signs:
        ends.append(None)
        if precision.exact or precision.step is not None:
            plan.append((LayerKind.VALUES, None))
        else:
            fine = precision.tolerance or DEFAULT_TOLERANCE
            sides = SharedSides(grid.size(index), grid.shared(index))
            plan += grid_offsets(fine, tiling.slack, sides.holds)
    return plan, ends


def _searched(
    header: Header, field: Samples, truth: GroundTruth, holes: Holes | None, index: Index, tiling: Tiling,
    faces: Faces | None,
) -> tuple[Plan, list[int | None]]:
    """Search for a mesh that keeps a tolerance."""
    grid, tolerance = tiling.grid, tiling.searched
    assert tolerance is not None
    coarse = grid.level(index, COARSEST)
    sides = None if faces else SharedSides(grid.size(index), grid.shared(index))
    promise = Promise(field, lambda: field_tube(header, field, truth, holes=holes), truth=truth, holes=holes,
                      sides=sides)
    plan = volume_plan(promise, tolerance, coarse, faces) if faces else smallest(promise, tolerance, False, coarse)
    return plan, [1 + coarse - base_of(grid.n, coarse), None]
