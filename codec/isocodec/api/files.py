"""Files whose bytes are all in memory, and tiled files: what each does where `IsoFile` is asked."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..drawing.meeting import meeting
from ..drawing.window import clipped, reaching
from ..errors import FormatError, InputError, IsoError, OptionError, TruncatedError
from ..field.labelling import is_of_labels, type_of
from ..format.events import FrameRead, LayerComplete, MeshLayerComplete
from ..format.kinds import LayerKind
from ..limits import Limits
from ..storage.ranges import content_from
from ..stream.cropped_source import box_of
from ..stream.decoder import Decoder
from ..stream.file_info import FileInfo, LayerInfo
from ..stream.inspect import inspect, kind_of
from ..verbs import Edit, Viewed
from .editing import edited, edited_tiles
from .isofile import IsoFile
from .operations import ONE_FRAME, ViewOptions

if TYPE_CHECKING:
    from typing import Unpack

    from ..drawing.contour import Contour
    from ..drawing.tessellation import Tessellation
    from ..field.placement import Placement
    from ..stream.statistics import FileStatistics
    from ..tiles.tiled import TiledFile
    from ..tin.tin import Tin

_NOT_BESIDE_GRIDS = ("smooth", "through_holes", "within")
"""Parameters of a view that apply to grids alone."""
_AGAIN = 64
"""Bytes that are read again of a file that has grown, to find out whether it is the same file."""


class WholeFile(IsoFile):
    """A file whose bytes are all in memory, of any kind: see `whole_file`."""

    source: str | os.PathLike[str] | None = None
    """Path or URL that the file was read from."""

    def __init__(
        self, kind: str, data: bytes, limits: Limits | None, mesh: tuple[ArrayLike, ArrayLike] | None = None
    ) -> None:
        self.kind, self._data, self.limits, self.mesh_given = kind, data, limits, mesh

    def refreshed(self) -> IsoFile:
        """See `IsoFile.refreshed`."""
        if self.source is None:
            raise OptionError("the file was not opened from a path or a URL", code="refreshed",
                              remedy="open what has come of it again")
        if self.complete:
            return self
        whole = max((one.offset + one.bytes for one in self.info.frames if one.complete), default=0)
        start = max(whole - _AGAIN, 0)
        rest = content_from(self.source, start, self.limits)
        if rest[: whole - start] != self.data[start:whole]:
            raise InputError("the file is not the one that was read before", code="changed", remedy="open it again")
        return whole_file(self.data[:start] + rest, self.limits, self.mesh_given, self.source)

    @property
    def data(self) -> bytes:
        """The bytes of the file."""
        return self._data

    @cached_property
    def info(self) -> FileInfo:
        """Information that can be read without decoding."""
        return inspect(self.data, limits=self.limits)

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return len(self.data)

    @property
    def frames(self) -> int:
        """Number of complete frames of a series; 1 for other files."""
        info = self.info
        return 1 if info.interval is None else sum(frame.complete for frame in info.frames)

    @property
    def complete(self) -> bool:
        """Whether the file is complete and its checksum is correct."""
        return self.info.complete

    def _each_frame(self, start: int, smooth: bool | None, partial: bool) -> Iterator[list[Contour]]:
        yield from frames_of([self.data], start=start, smooth=smooth, partial=partial, mesh=self.mesh_given,
                             limits=self.limits)

    def _edited(self, edit: Edit) -> bytes:
        return edited(self.data, self.kind, self.limits, edit)

    def statistics(self) -> FileStatistics:
        from ..stream.statistics import statistics

        return statistics(self.data, self.limits, mesh=self.mesh_given)


class IsovalueFile(WholeFile):
    """A file with isovalues, each of which can be decoded by itself: of a grid, a series or a mesh."""

    def _contour(self, isovalue: float | None, view: Viewed) -> Contour:
        decoder, number = self.decoded(isovalue, view)
        return clipped(_drawn(decoder, [number], view)[0], view.window)

    def _contours(self, view: Viewed) -> list[Contour]:
        if view.layers is not None or view.within is not None:
            return [self._contour(isovalue, view) for isovalue in self.info.isovalues]
        decoder = self.received(None, view)
        labels = decoder.grid.partition() if self.kind in ("grid", "series") else None
        drawn = _drawn(decoder, range(len(decoder.isovalues)), view)
        return [clipped(one, view.window) for one in (meeting(drawn, labels) if labels else drawn)]

    def _above(self, isovalue: float | None, view: Viewed) -> NDArray[np.bool_]:
        decoder, number = self.decoded(isovalue, view)
        contents: Any = decoder.contents
        return np.asarray(contents.above(number))

    def _mesh(self, isovalue: float | None, view: Viewed, whole: bool) -> Tessellation:
        decoder, number = self.decoded(isovalue, view)
        contents: Any = decoder.contents
        return _cut(contents.mesh(number, whole), view.window)

    def decoded(self, isovalue: float | None, view: Viewed) -> tuple[Decoder, int]:
        """Decode what a drawing of an isovalue needs; returns the decoder and the number of that isovalue."""
        number = 0 if isovalue is None else self.info.number_of(isovalue)
        try:
            # the first isovalue of a frame leans on none of that frame: a long series is not read twice
            chain = frozenset([0]) if isovalue is None and self.kind == "series" else self.info.chain(number)
        except FormatError:
            # bytes after those that are needed may be damaged
            if isovalue is not None:
                raise
            chain = frozenset([0])
        layers = self._layers_within(number, view) if view.within is not None else view.layers
        decoder = self.received(chain, view, number, layers)
        if number >= len(decoder.isovalues):
            raise TruncatedError("the file ends before its curve begins", code="truncated")
        return decoder, number

    def _layers_within(self, number: int, view: Viewed) -> int | None:
        """Number of layers that lead to cubes no wider than ``view.within`` samples."""
        n = len(self.info.shape)
        exponent = max(int(size - 2).bit_length() for size in self.info.shape) if self.info.shape else 0
        own = [one for one in self.info.layers if (one.frame, one.isovalue) == (view.frame or 0, number)]
        for count, layer in enumerate(own, start=1):
            if layer.level >= 0 and 2.0 ** (exponent - layer.level // n) <= view.within:
                return count
        return None

    def received(
        self, only: frozenset[int] | None, view: Viewed, number: int = 0, layers: int | None = None
    ) -> Decoder:
        """Decode a frame, the first ``layers`` layers of isovalue ``number``, or the first bytes."""
        wanted = view.frame or 0
        decoder = Decoder(self.limits, mesh=self.mesh_given, only=only, frame=wanted)
        done = 0
        try:
            decoder.feed(memoryview(self.data)[: view.max_bytes])
            for event in decoder:
                if isinstance(event, LayerComplete | MeshLayerComplete):
                    if view.progress is not None:
                        view.progress(event.number, max(decoder.announced, event.number))
                    done += decoder.present == (wanted, number)
                    if done == layers:
                        return decoder
            if view.max_bytes is None and not view.partial and decoder.frames <= wanted:
                decoder.close()
            if not decoder.isovalues:
                raise TruncatedError("the file ends before its curve begins", code="truncated")
            _check_frame(decoder, wanted)
        except IsoError:
            # an error that is kept would otherwise keep all of this alive through its traceback
            if decoder.contents is not None:
                decoder.contents.drop()
            raise
        return decoder


class SampledFile(IsovalueFile):
    """A file of a grid, or of a series of grids."""

    @property
    def _place(self) -> Placement | None:
        decoder = Decoder(self.limits, only=())
        decoder.feed(self.data)
        return decoder.take().grid.placement

    def _valid(self, max_bytes: int | None = None) -> NDArray[np.bool_]:
        decoder = Decoder(self.limits, only=())
        decoder.feed(memoryview(self.data)[:max_bytes])
        if max_bytes is None and not decoder.take().frames:
            decoder.close()
        return decoder.take().grid.valid()

    def _labels(self, view: Viewed) -> NDArray[Any]:
        if not is_of_labels(self.info.metadata):
            raise OptionError("the isovalues of the file are not labels", code="labels", remedy="use above")
        decoder = self.received(None, view)
        out: NDArray[Any] | None = None
        for number, label in enumerate(decoder.isovalues):
            inside = decoder.grid.above(number)
            if out is None:
                out = np.zeros(inside.shape, type_of(decoder.isovalues, self.info.metadata))
            out[inside] = label
        assert out is not None
        return out


class MeshFile(IsovalueFile):
    """A file of values on a mesh."""

    _refused = _NOT_BESIDE_GRIDS

    def _valid(self, max_bytes: int | None = None) -> NDArray[np.bool_]:
        return np.ones(self._vertices(), np.bool_)

    def _surface(self, view: Viewed) -> Tin:
        self._vertices()  # a file that ends before its mesh may have been one of a surface
        return super()._surface(view)

    def _vertices(self) -> int:
        if self.info.domain is None:
            raise TruncatedError("the file ends before its mesh begins", code="truncated", offset=self.size)
        return self.info.domain.vertices


class SurfaceFile(WholeFile):
    """A file of a triangulated surface."""

    _refused = _NOT_BESIDE_GRIDS

    def _contour(self, isovalue: float | None, view: Viewed) -> Contour:
        from ..stream.surface_contents import contour_of_tin

        return clipped(contour_of_tin(self._surface(view), isovalue), view.window)

    def _contours(self, view: Viewed) -> list[Contour]:
        return []

    def _surface(self, view: Viewed) -> Tin:
        """Decode the surface, its first layers, or its beginning."""
        if view.frame:
            raise OptionError(f"the file has no frame {view.frame}", code="frame", remedy="it holds a single surface")
        decoder = Decoder(self.limits)
        decoder.feed(memoryview(self.data)[: view.max_bytes])
        surface = decoder.take().surface
        there = view.layers is not None and len(surface.received()[1].places) >= view.layers
        if view.max_bytes is None and not view.partial and not there:
            decoder.close()
        return surface.tin(view.layers)

    def _above(self, isovalue: float | None, view: Viewed) -> NDArray[np.bool_]:
        if isovalue is None:
            raise OptionError("the file holds a surface: give the isovalue that its samples are to be compared with",
                              code="isovalue")
        tin = self._surface(view)
        return np.asarray((tin.values if tin.shape is None else tin.raster()) > isovalue)

    def _valid(self, max_bytes: int | None = None) -> NDArray[np.bool_]:
        tin = self._surface(Viewed(max_bytes=max_bytes))
        return np.ones(len(tin.values), np.bool_) if tin.shape is None else ~np.isnan(tin.raster())

    def _mesh(self, isovalue: float | None, view: Viewed, whole: bool) -> Tessellation:
        from ..drawing.explicit import crossed_cells
        from ..drawing.tessellation import Tessellation

        tin = self._surface(view)
        above = tin.values > (np.median(tin.values) if isovalue is None else isovalue)
        crossed = np.ones(len(tin.triangles), np.bool_) if whole else crossed_cells(tin.triangles, above)
        return _cut(Tessellation(
            tin.points, tin.triangles[crossed], np.zeros(int(crossed.sum()), np.int64), above,
            float("nan") if isovalue is None else isovalue, tin.shape or (), tin.complete, metadata=dict(tin.metadata),
        ), view.window)


def whole_file(
    data: bytes, limits: Limits | None, mesh: tuple[ArrayLike, ArrayLike] | None = None,
    source: str | os.PathLike[str] | None = None,
) -> WholeFile:
    """Open a file of any kind but tiles whose bytes are all in memory, perhaps with the mesh that it was made on.

    ``source`` is where they were read. Raises `FormatError` if the bytes are not an ``.iso`` file.
    """
    kind = kind_of(data, limits)
    made: type[WholeFile] = {"mesh": MeshFile, "surface": SurfaceFile}.get(kind, SampledFile)
    file = made(kind, data, limits, mesh)
    file.source = source
    return file


class TileFile(IsoFile):
    """A tiled file, whose tiles are read when they are needed."""

    kind = "tiles"
    _refused = ("smooth", "through_holes")

    def __init__(self, tiled: TiledFile, limits: Limits | None) -> None:
        self.tiled, self.limits = tiled, limits

    @property
    def data(self) -> bytes:
        """All bytes of the file."""
        return self.tiled.fetch(0, self.size)

    def _read(self, start: int, end: int) -> bytes:
        return self.tiled.fetch(start, min(end, self.size))

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.tiled.root.total

    @cached_property
    def complete(self) -> bool:
        """Whether the file holds all its tiles; reads the last byte to find out."""
        return bool(self.tiled.fetch(self.size - 1, self.size))

    @cached_property
    def info(self) -> FileInfo:
        """Information from head and root directory."""
        head, root = self.tiled.head, self.tiled.root
        layers = []
        for number in range(len(head.isovalues)):
            for stage, each in enumerate(head.stages):
                kind = LayerKind.ADAPT if each.adaptive else LayerKind.REFINE
                size = int(root.sizes[:, head.area(number, stage)].sum())
                layers.append(LayerInfo(kind, each.edge, 0, 0, None, size, isovalue=number))
        coded = int(root.sizes.sum())
        return FileInfo(
            1, 1, head.profile.name.lower(), self.tiled.shape, head.isovalues[0], head.scale, self.size,
            self.size - coded, True, layers, [], self.tiled.metadata, list(head.isovalues),
            [None] * len(head.isovalues), [False] * len(head.isovalues),
            int(root.sizes[:, 0].sum()) if head.masked else None, kind="tiles", tile=1 << head.grid.exponent,
            tiles=head.grid.counts,
        )

    def _contour(self, isovalue: float | None, view: Viewed) -> Contour:
        number = self.tiled.number_of(isovalue)
        return next(self._windows([number], view))

    def _windows(self, numbers: Sequence[int], view: Viewed) -> Iterator[Contour]:
        """Decode the curves or surfaces of isovalues, by number, in a window; all is fetched before the first."""
        tiled, options = self._asked(view)
        drawings = tiled.windows(view.window, numbers, **options)
        for done, drawn in enumerate(drawings, start=1):
            if view.progress is not None:
                view.progress(done, len(numbers))
            yield drawn

    def _asked(self, view: Viewed) -> tuple[TiledFile, dict[str, Any]]:
        """Open what a view may read of the file, with its options for `TiledFile.windows`."""
        self._check_frame(view.frame)
        tiled = self.tiled if view.max_bytes is None else self._beginning(view.max_bytes)
        layer = None if view.layers is None else min(view.layers, len(tiled.head.stages)) - 1
        partial = view.partial or view.max_bytes is not None
        return tiled, {"within": view.within, "layer": layer, "partial": partial}

    def each_tile(self, **view: Unpack[ViewOptions]) -> Iterator[list[Contour]]:
        """Decode the curves or surfaces of all isovalues tile by tile, with ends at the borders of tiles.

        ``view`` has parameters of `contours`. All is fetched before the first tile; a tile at a time is in memory.
        """
        wanted = self._viewed(**view)
        tiled, options = self._asked(wanted)
        for window in tiled.fetched(wanted.window, **options):
            yield [*tiled.windows(window, **options)]

    def _beginning(self, size: int) -> TiledFile:
        """Open the same file, cut after its first bytes."""
        from ..tiles.tiled import TiledFile

        def fetch(ranges: Sequence[tuple[int, int]]) -> list[bytes]:
            return [self.tiled.fetch(start, min(end, size)) if start < size else b"" for start, end in ranges]

        return TiledFile(fetch, self.limits)

    @staticmethod
    def _check_frame(frame: int | None) -> None:
        if frame:
            raise OptionError(f"the file has no frame {frame}", code="frame", remedy=ONE_FRAME)

    def _contours(self, view: Viewed) -> list[Contour]:
        if is_of_labels(self.metadata) and not {"layers", "within", "max_bytes", "partial"} & {*view.view}:
            # in one piece, where all labels of a cell are known
            low = np.array(box_of(self.shape, view.window, self.tiled.limits)[0])
            return [
                clipped(replace(one, points=one.points + low, shape=self.shape, placement=self.placement,
                                metadata=dict(self.metadata), origin_above=None if low.any() else one.origin_above),
                        view.window)
                for one in self._in_one_piece(view)._contours(Viewed())
            ]
        return [*self._windows(range(len(self.tiled.isovalues)), view)]

    def _labels(self, view: Viewed) -> NDArray[Any]:
        return self._in_one_piece(view)._labels(Viewed())

    def _each_frame(self, start: int, smooth: bool | None, partial: bool) -> Iterator[list[Contour]]:
        if not start:
            yield self._contours(self._viewed(smooth=smooth, partial=partial))

    def whole(self, window: Sequence[Sequence[float]] | None = None) -> SampledFile:
        """Extract a window, or everything, as an ordinary file without tiles."""
        from .recoding import extracted

        return SampledFile("grid", extracted(self.tiled, window), self.limits)

    def _above(self, isovalue: float | None, view: Viewed) -> NDArray[np.bool_]:
        return self._in_one_piece(view)._above(isovalue, self._at_stage(view.layers))

    def _in_one_piece(self, view: Viewed) -> SampledFile:
        """Extract the samples and simplices of a view as an ordinary file."""
        view.refuse_for("tiles", "within", "max_bytes")
        self._check_frame(view.frame)
        return self.whole(view.window)

    def _at_stage(self, layers: int | None) -> Viewed:
        """The view of an extracted file whose mesh is as fine as that of the first stages."""
        stages = self.tiled.head.stages
        return Viewed() if layers is None or layers >= len(stages) else Viewed(within=2.0 ** stages[layers - 1].edge)

    def _valid(self, max_bytes: int | None = None) -> NDArray[np.bool_]:
        return self.whole().valid()

    def _mesh(self, isovalue: float | None, view: Viewed, whole: bool) -> Tessellation:
        return self._in_one_piece(view)._mesh(isovalue, self._at_stage(view.layers), whole)

    def _edited(self, edit: Edit) -> bytes:
        return edited_tiles(self.tiled, self.limits, edit)

    def statistics(self) -> FileStatistics:
        return self.whole().statistics()


def _cut(mesh: Tessellation, window: Sequence[Sequence[float]] | None) -> Tessellation:
    """Keep the cells of a mesh that reach into a window, as `clipped` does."""
    if window is None:
        return mesh
    inside = reaching(mesh, window)
    used, number = np.unique(mesh.cells[inside], return_inverse=True)
    return replace(mesh, points=mesh.points[used], above=mesh.above[used], levels=mesh.levels[inside],
                   cells=number.reshape(-1, mesh.cells.shape[1]))


def frames_of(
    pieces: Any, *, start: int = 0, smooth: bool | None = None, partial: bool = False,
    mesh: tuple[ArrayLike, ArrayLike] | None = None, limits: Limits | None = None,
) -> Iterator[list[Contour]]:
    """Decode contours frame by frame from a file that arrives in pieces; at most two frames are in memory.

    The first one is frame ``start``.

    Yields
    ------
    list of Contour
        Curves or surfaces of all isovalues in the file's order, frame by frame.

    Raises
    ------
    FormatError, LimitError
        As `Decoder`; ``TruncatedError`` after the frames that are complete, unless ``partial``.
    """
    decoder = Decoder(limits, mesh=mesh, frame=start or None)
    drawn = start
    for piece in pieces:
        decoder.feed(piece)
        for event in decoder:
            if decoder.outline.frame == start:
                decoder.outline.wanted = None
            if decoder.frames > drawn:
                drawn += 1
                before = isinstance(event, FrameRead)
                kind = "surface" if decoder.contents is None else decoder.contents.kind
                count = 0 if kind == "surface" else len(decoder.isovalues)
                found = [decoder.contour(i, smooth=smooth, before=before) for i in range(count)]
                labels = decoder.grid.partition(before=before) if kind == "grid" else None
                yield meeting(found, labels) if labels else found
    if not partial:
        decoder.close()


def _drawn(decoder: Decoder, numbers: Sequence[int], view: Viewed) -> list[Contour]:
    """Draw the contours of isovalues one by one, releasing the data of each after it is drawn."""
    out: list[Contour] = []
    contents = decoder.contents
    assert contents is not None
    held = 0
    try:
        for number in numbers:
            decoder.hold(held)
            out.append(decoder.contour(number, smooth=view.smooth, through_holes=view.through_holes))
            held += out[-1].points.nbytes + out[-1].cells.nbytes
            decoder.discard(number)
    except IsoError:
        contents.drop()
        raise
    return out


def _check_frame(decoder: Decoder, frame: int) -> None:
    """Refuse a frame that a decoder did not meet in the whole file."""
    last = decoder.frame
    if last >= frame:
        return
    if not decoder.complete:
        raise TruncatedError(f"the file ends before frame {frame} begins", code="truncated")
    remedy = f"its frames are 0 to {last}" if last else ONE_FRAME
    raise OptionError(f"the file has no frame {frame}", code="frame", remedy=remedy)
