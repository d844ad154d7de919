"""Re-encode the curves of files without their field, so that no point moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..field.labelling import is_of_labels, of_some
from ..field.placement import Placement, read_placement
from ..format.events import End, FrameRead
from ..format.header import Header
from ..limits import Limits
from ..stream.decoder import Decoder
from ..stream.inspect import inspect
from ..stream.options import INDEPENDENT, ISOVALUES, Options, Precision
from ..stream.promises import last_promise, noted, promised_at_last
from ..stream.recoder import Source, recoded_frames, sources_of

if TYPE_CHECKING:
    from ..tiles.tiled import TiledFile


def extracted(
    tiled: TiledFile, window: Sequence[Sequence[float]] | None, isovalues: Sequence[float] | None = None
) -> bytes:
    """Extract a window of a tiled file as an ordinary file; no point moves.

    If the window is that of one tile, the bytes of its layers are copied; otherwise layers are encoded anew from what
    the tiles hold. The guarantees of the tiled file hold for the result. Raises `OptionError` if the window lies
    outside the field, or if meshes are coarser than the grid and the window is not that of one tile.
    """
    from ..tiles.extraction import Extract

    part = Extract(tiled, window)
    numbers = [*range(len(tiled.isovalues))] if isovalues is None else sorted({*map(tiled.number_of, isovalues)})
    part.notes = of_some(part.notes, [tiled.isovalues[number] for number in numbers])
    head, promise = tiled.head, _of_note(tiled, window)
    if promise is None or head.stages[-1].adaptive:
        taken = part.strands(numbers)
        if taken is not None:
            return taken
    held = Held(
        Header(part.size, head.isovalues[numbers[0]], head.scale, head.profile), part.notes, None,
        [part.sources(numbers)], [], np.ones(0, np.bool_), [promise] * len(numbers),
    )
    return same_again(held, Options(profile=held.profile, metadata=held.kept_notes), expected=False)


@dataclass(frozen=True)
class Held:
    """Decoded contents of a grid's file, frame by frame.

    Attributes
    ----------
    header : Header
    metadata : dict of str to str
    interval : int or None
        For a series.
    frames : list of lists of Source
        By frame and isovalue.
    contours : list of lists of Contour
        By frame and isovalue.
    valid : (s0, .., sn-1) bool
    promised : list of float or None
        Distance from the curve of the field that the file promises of each isovalue, in all frames.
    turned : bool
        Whether layers of several isovalues come in turn.
    times : list of str or None
        Times of frames.
    """

    header: Header
    metadata: dict[str, str]
    interval: int | None
    frames: list[list[Source]]
    contours: list[list[Contour]]
    valid: NDArray[np.bool_]
    promised: list[float | None]
    turned: bool = False
    times: Sequence[str | None] = ()

    @property
    def kept_notes(self) -> dict[str, str]:
        """The notes of another file of the same curves."""
        return last_promise(self.metadata, all(self.promised))

    @property
    def order(self) -> str | None:
        """Order in which another file has the layers of the same isovalues; None leaves it to the encoder."""
        if is_of_labels(self.metadata):
            return INDEPENDENT
        return None if self.turned else ISOVALUES

    @property
    def profile(self) -> str:
        """Profile of the file by its name."""
        return self.header.profile.name.lower()


def held_by(data: bytes, limits: Limits | None, what: str = "the file") -> Held:
    """Decode everything in a file of a grid; ``what`` names the file in messages.

    Raises `OptionError` if the file is of another kind, its mesh does not reach every sample, it has coordinates, or it
    holds values only in part, and `FormatError` or `LimitError`.
    """
    decoder = Decoder(limits)
    decoder.feed(data)
    frames: list[list[Source]] = []
    contours: list[list[Contour]] = []
    for event in decoder:
        if isinstance(event, End) or (isinstance(event, FrameRead) and event.number == 0):
            if decoder.contents is None or decoder.contents.kind != "grid":
                raise OptionError(f"{what} is not of a grid", code="recode", remedy="encode the field itself again")
            before = isinstance(event, FrameRead)
            frames.append(sources_of(decoder, what, before=before))
            contours.append([decoder.contour(i, smooth=False, before=before) for i in range(len(decoder.isovalues))])
    decoder.close()
    assert decoder.header is not None
    metadata = dict(decoder.metadata)
    info = inspect(data)
    promised = [promised_at_last(info, number) for number in range(len(info.isovalues))]
    return Held(decoder.header, metadata, decoder.interval, frames, contours, decoder.grid.valid(), promised,
                info.turned, [frame.time for frame in info.frames])


def _of_note(tiled: TiledFile, window: object) -> float | None:
    """Distance in cells that a file in tiles promises; a part of it has other ends, and promises nothing."""
    parts, _ = noted(tiled.metadata)
    if window is not None or not parts:
        return None
    return (read_placement(tiled.metadata, len(tiled.shape)) or Placement()).cells_of(parts[-1], tiled.shape)


def same_again(held: Held, options: Options, *, expected: bool = True) -> bytes:
    """Encode a file of the same curves.

    The result is decoded to check that the curves are the same: where curves touch, their crossings may lie in an order
    that prediction of one isovalue from another does not allow, and then the isovalues are coded independently. Without
    ``expected``, the result is compared with a file of independent isovalues instead of ``held.contours``.
    """
    steps = {source.field.scale for sources in held.frames for source in sources if source.field.number is not None}
    options = replace(options, precision=Precision(step=next(iter(steps), None)), order=held.order)

    def data_of(independent: bool) -> bytes:
        alike = replace(options, order=INDEPENDENT) if independent else options
        return recoded_frames(held.frames, held.interval, alike, kept=True, promised=held.promised, times=held.times)

    alone, wanted = b"", held.contours
    if not expected:
        alone = data_of(True)
        if len(held.frames[0]) == 1:
            return alone
        wanted = list(_drawn(alone))
    for independent in (True,) if options.independent else (False, True):
        data = alone if alone and independent else data_of(independent)
        pairs = zip(chain.from_iterable(_drawn(data)), chain.from_iterable(wanted), strict=True)
        if all(_same(a, b) for a, b in pairs):
            return data
    raise InputError("the curves cannot be re-encoded without moving points", code="recode")


def _drawn(data: bytes) -> Iterator[list[Contour]]:
    """Decode the contours of all isovalues, frame by frame."""
    decoder = Decoder()
    decoder.feed(data)
    for event in decoder:
        if isinstance(event, End) or (isinstance(event, FrameRead) and event.number == 0):
            before = isinstance(event, FrameRead)
            yield [decoder.contour(i, smooth=False, before=before) for i in range(len(decoder.isovalues))]


def _same(a: Contour, b: Contour) -> bool:
    """Whether two curves or surfaces have the same cells at the same places, in any order."""
    if len(a.cells) != len(b.cells):
        return False
    rows = []
    for contour in (a, b):
        corners = contour.points[contour.cells]
        # rotate each cell to begin with its least corner
        first = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)[:, :1]
        turned = (first + np.arange(contour.n)) % contour.n if contour.n > 2 else np.arange(2)[None]
        whole = np.take_along_axis(corners, turned[..., None], axis=1).reshape(len(corners), contour.n**2)
        rows.append(whole[np.lexsort(whole.T[::-1])])
    return bool(np.array_equal(rows[0], rows[1]))
