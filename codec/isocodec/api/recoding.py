"""Curves of files coded anew, without their field, point by point as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..limits import Limits
from ..stream.decoder import Decoder
from ..stream.options import Options, Precision
from ..stream.recoder import Source, recoder_of

if TYPE_CHECKING:
    from ..tiles.tiled import TiledFile


def extracted(
    tiled: TiledFile, box: Sequence[Sequence[float]] | None, isovalues: Sequence[float] | None = None
) -> bytes:
    """A box of a file in tiles as a file in one piece, in which no point moves.

    If the box is that of one tile, the bytes of its layers stay as they are; otherwise they are coded anew from what
    the tiles hold: what this file promises of its curve holds for the result.

    Raises
    ------
    OptionError
        If the box lies outside; or if meshes are coarser than the samples and the box is not that of one tile.
    """
    from ..tiles.extraction import Extract

    part = Extract(tiled, box)
    numbers = list(range(len(tiled.isovalues))) if isovalues is None else [tiled.number_of(one) for one in isovalues]
    taken = part.strands(numbers)
    if taken is not None:
        return taken
    options = Options(profile=tiled.head.profile.name.lower(), metadata=part.notes)
    return kept(part.sources(numbers), options)


def whole_decoder(data: bytes, limits: Limits | None, what: str) -> Decoder:
    """A decoder that has taken the whole file of a grid; ``what`` names it in messages."""
    decoder = Decoder(limits)
    decoder.feed(data)
    decoder.close()
    if decoder.contents is None or decoder.contents.kind != "grid":
        raise OptionError(f"{what} is not of a grid", code="recode", remedy="encode the field itself again")
    return decoder


def contours_of(decoder: Decoder) -> list[Contour]:
    """The curves or surfaces of all isovalues that a decoder has taken."""
    return [decoder.contour(number) for number in range(len(decoder.isovalues))]


def kept(sources: Sequence[Source], options: Options, expected: Sequence[Contour] | None = None) -> bytes:
    """The same curves again.

    They are decoded to see that they are: crossings of curves that touch may stand in an order that isovalues which
    lean on one another cannot have, and then none of them does. Without ``expected`` they have to be those of a file
    in which none does.
    """
    steps = {source.field.scale for source in sources if source.field.number is not None}
    options = replace(options, precision=Precision(step=next(iter(steps), None)))
    may = not options.independent

    def data_of(independent: bool) -> bytes:
        return b"".join(recoder_of(sources, replace(options, independent=independent), kept=True))

    alone = b""
    if expected is None:
        alone = data_of(True)
        if len(sources) == 1:
            return alone
        expected = _decoded(alone)
    for leaning in (True, False) if may else (False,):
        data = alone if alone and not leaning else data_of(not leaning)
        if all(_same(a, b) for a, b in zip(_decoded(data), expected, strict=True)):
            return data
    raise InputError("the curves cannot be re-encoded without moving points", code="recode")


def _decoded(data: bytes) -> list[Contour]:
    decoder = Decoder()
    decoder.feed(data)
    decoder.close()
    return contours_of(decoder)


def _same(a: Contour, b: Contour) -> bool:
    """Whether two curves or surfaces have the same cells at the same places, in whatever order."""
    if len(a.cells) != len(b.cells):
        return False
    rows = []
    for contour in (a, b):
        corners = contour.points[contour.cells]
        # each cell from its least corner on
        first = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)[:, :1]
        turned = (first + np.arange(contour.n)) % contour.n if contour.n > 2 else np.arange(2)[None]
        whole = np.take_along_axis(corners, turned[..., None], axis=1).reshape(len(corners), contour.n**2)
        rows.append(whole[np.lexsort(whole.T[::-1])])
    return bool(np.array_equal(rows[0], rows[1]))
