"""Files made of other files without the field: shorter ones, parts, other profiles and precisions, several in one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..field.placement import CRS, PLACEMENT
from ..field.told import LABELS
from ..limits import Limits
from ..stream.decoder import Decoder
from ..stream.recoder import Recoder, Source, box_of, cropped, moved_notes, sources_of
from ..stream.splicing import chosen, signs_of, spliced
from ..stream.truncation import truncate
from .content import Readable
from .kinds import IMPOSSIBLE, TileFile, WholeFile, impossible

if TYPE_CHECKING:
    from ..stream.options import ProfileName
    from ..tiles.tiled import TiledFile


@dataclass(frozen=True)
class Edit:
    """What is to be changed of a file: the parameters of `IsoFile.edited`."""

    layers: int | None = None
    size: int | None = None
    box: Sequence[Sequence[float]] | None = None
    isovalues: Sequence[float] | None = None
    profile: ProfileName | None = None
    precision: Any = None
    keep_topology: bool = False

    def __post_init__(self) -> None:
        if all(getattr(self, each.name) in (None, False) for each in fields(self)):
            raise OptionError("nothing to change", code="edit", remedy="give layers, size, box, isovalues or profile")
        if self.layers is not None and self.size is not None:
            raise OptionError("layers and size cannot be combined", code="options", remedy="choose one")


def edited(held: WholeFile | TileFile, edit: Edit) -> bytes:
    """Make the changes one after the other: box, isovalues, profile and precision, layers or size."""
    if isinstance(held, TileFile):
        recoded = edit.profile is not None or edit.precision is not None
        if edit.box is None and not recoded and edit.isovalues is None:
            return _shorter_tiles(held.tiled, edit.layers, edit.size)
        data = extracted(held.tiled, edit.box, edit.isovalues)
        limits = held.limits
        rest = Edit(edit.layers, edit.size, None, None, edit.profile, edit.precision, edit.keep_topology) if (
            recoded or edit.layers or edit.size
        ) else None
        return data if rest is None else edited(WholeFile(data, limits), rest)
    data, limits = held.data, held.limits
    if edit.box is not None and ("box", held.kind) in IMPOSSIBLE:
        raise impossible("box", held.kind)
    if edit.box is not None:
        data = _cropped(WholeFile(data, limits), edit.box)
    if edit.isovalues is not None:
        data = _with_isovalues(WholeFile(data, limits), edit.isovalues)
    if edit.profile is not None or edit.precision is not None:
        data = recoded_as(WholeFile(data, limits), edit.profile, edit.precision, edit.keep_topology)
    if edit.layers is not None or edit.size is not None:
        data = truncated(data, layers=edit.layers, size=edit.size, limits=limits)
    return data


def truncated(
    data: bytes, *, layers: int | None = None, size: int | None = None, limits: Limits | None = None
) -> bytes:
    """A valid file with the first layers of another, or with what fits into so many bytes.

    Raises
    ------
    OptionError
        If that is too little for any curve.
    FormatError
        If the file is damaged; ``TruncatedError`` if it was cut off before a curve begins.
    """
    return truncate(data, layers=layers, max_bytes=size, limits=limits)


def _shorter_tiles(tiled: TiledFile, layers: int | None, size: int | None) -> bytes:
    """The first layers of a file in tiles, as many as asked for or as fit."""
    from ..tiles.truncation import first_stages

    if layers is not None:
        return b"".join(first_stages(tiled, layers))
    assert size is not None
    for count in range(len(tiled.head.stages), 0, -1):
        data = b"".join(first_stages(tiled, count))
        if len(data) <= size:
            return data
    raise OptionError(f"{size} bytes are too few for the first layer of all tiles", code="max-bytes")


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
    return kept(part.sources(numbers), profile=tiled.head.profile.name.lower(), metadata=part.notes)


def _cropped(held: WholeFile, box: Sequence[Sequence[float]]) -> bytes:
    """A box of samples of the file of a grid."""
    decoder = _whole_decoder(held, "the file")
    assert decoder.header is not None
    low, size = box_of(decoder.header.shape, box, decoder.limits)
    sources = [cropped(one, low, size) for one in sources_of(decoder)]
    notes = moved_notes(decoder.metadata, low)
    return kept(sources, profile=decoder.header.profile.name.lower(), metadata=notes)


def _with_isovalues(held: WholeFile, isovalues: Sequence[float]) -> bytes:
    """Some of the isovalues of a file: its chunks as they are, or coded anew where one leans on another left out."""
    if held.kind == "surface":
        raise impossible("isovalues", "surface")
    if not len(isovalues):
        raise OptionError("no isovalue", code="isovalue", remedy="give one")
    numbers = [held.info.number_of(one) for one in isovalues]
    numbers = sorted(set(numbers))
    try:
        return chosen(held.data, numbers)
    except OptionError as error:
        if error.code != "lean" or held.kind != "grid":
            raise
    decoder = _whole_decoder(held, "the file")
    assert decoder.header is not None
    sources = sources_of(decoder)
    return kept(
        [sources[number] for number in numbers], [decoder.contour(number) for number in numbers],
        profile=decoder.header.profile.name.lower(), metadata=decoder.metadata,
    )


def recoded_as(held: WholeFile, profile: ProfileName | None, precision: Any, keep_topology: bool) -> bytes:
    """The curves of a file in another profile or less precisely.

    Raises
    ------
    OptionError
        If the file is not on the full grid, is a series, lies on a mesh, has coordinates or holds values in part.
    """
    if precision not in (None, "signs") and not isinstance(precision, int | float):
        raise OptionError(f"precision {precision!r} of an edit", code="precision",
                          remedy='give "signs", or a tolerance in cells')
    if held.kind in ("mesh", "surface"):
        if profile not in (None, "main"):
            raise OptionError(f"profile {profile!r}: meshes and surfaces have the profile main", code="profile")
        if precision is None:
            return held.data
        if held.kind == "mesh" and precision == "signs":
            return signs_of(held.data)
    decoder = _whole_decoder(held, "the file")
    assert decoder.header is not None
    sources = sources_of(decoder)
    options: dict[str, Any] = {
        "profile": profile or decoder.header.profile.name.lower(), "metadata": decoder.metadata,
        "preserve_topology": keep_topology, "leaning": LABELS not in decoder.metadata,
    }
    if precision is not None:
        chosen_precision = {"signs_only": True} if precision == "signs" else {"tolerance": float(precision)}
        return b"".join(Recoder(sources, False, **chosen_precision, **options))
    return kept(sources, _all(decoder), **options)


def merge(files: Sequence[Readable], *, profile: ProfileName = "main", limits: Limits | None = None) -> bytes:
    """Put the isovalues of several files of one field, or of one mesh, into one file, point by point as they are.

    Parameters
    ----------
    files : sequence of bytes, paths, URLs or file objects
        Files of fields of the same shape, place and missing samples, each with isovalues of its own; series with the
        same frames; or of values on one mesh.
    profile : str
        Of the result, where it is coded anew: of files of grids.
    limits : Limits, optional
        The most that each of the files may need.

    Returns
    -------
    bytes
        An ``.iso`` file with the isovalues in the order of the files. Of notes that several have, those of the first.

    Raises
    ------
    InputError
        If the files are not of one field: they differ in shape, place or missing samples, have different steps of
        values, or a sample lies above one isovalue and not above a lower one.
    OptionError
        If an isovalue is in two of them, or a file cannot be coded anew (see `IsoFile.edited`).
    FormatError, LimitError
    """
    from .isofile import open

    if isinstance(files, str | bytes) or not len(files):
        raise OptionError("no files to merge", code="files", remedy="give a sequence of them")
    opened = [open(file, limits=limits)._held for file in files]
    kinds = [held.kind for held in opened]
    if "surface" in kinds:
        raise impossible("merge", "surface")
    whole = [held.whole() if isinstance(held, TileFile) else held for held in opened]
    if {"mesh", "series"} & set(kinds):
        return spliced([held.data for held in whole])
    decoders = [_whole_decoder(held, f"file {i}") for i, held in enumerate(whole, start=1)]
    sources = [one for i, decoder in enumerate(decoders, start=1) for one in sources_of(decoder, f"file {i}")]
    _check_one_field(decoders, sources)
    metadata: dict[str, str] = {}
    for decoder in reversed(decoders):
        metadata.update(decoder.metadata)
    expected = [contour for decoder in decoders for contour in _all(decoder)]
    return kept(sources, expected, profile=profile, metadata=metadata)


def _whole_decoder(held: WholeFile, what: str) -> Decoder:
    """A decoder that has taken the whole file of a grid; ``what`` names it in messages."""
    if held.kind in ("mesh", "surface"):
        raise OptionError(f"{what} is not of a grid", code="recode", remedy="encode the field itself again")
    decoder = Decoder(held.limits)
    decoder.feed(held.data)
    decoder.close()
    return decoder


def _all(decoder: Decoder) -> list[Contour]:
    return [decoder.contour(number) for number in range(len(decoder.isovalues))]


def kept(sources: Sequence[Source], expected: Sequence[Contour] | None = None, **options: Any) -> bytes:
    """The same curves again.

    They are decoded to see that they are: crossings of curves that touch may stand in an order that isovalues which
    lean on one another cannot have, and then none of them does. Without ``expected`` they have to be those of a file
    in which none does.
    """
    steps = {source.field.scale for source in sources if source.field.number is not None}
    options["step"] = next(iter(steps), None)
    may = options.pop("leaning", True)
    alone = b""
    if expected is None:
        alone = b"".join(Recoder(sources, True, leaning=False, **options))
        if len(sources) == 1:
            return alone
        expected = _decoded(alone)
    for leaning in (True, False) if may else (False,):
        data = alone if alone and not leaning else b"".join(Recoder(sources, True, leaning=leaning, **options))
        if all(_same(a, b) for a, b in zip(_decoded(data), expected, strict=True)):
            return data
    raise InputError("the curves cannot be re-encoded without moving points", code="recode")


def _decoded(data: bytes) -> list[Contour]:
    decoder = Decoder()
    decoder.feed(data)
    decoder.close()
    return _all(decoder)


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


def _check_one_field(decoders: Iterable[Decoder], sources: Sequence[Source]) -> None:
    first, *others = decoders
    for number, other in enumerate(others, start=2):
        if LABELS in {**first.metadata, **other.metadata}:
            raise InputError("files of labels cannot be merged", code="merge", remedy="encode the labels together")
        assert first.header is not None and other.header is not None
        if first.header.shape != other.header.shape:
            raise InputError(f"file {number} is of shape {other.header.shape}, the first of {first.header.shape}",
                             code="merge")
        if not np.array_equal(first.grid.valid(), other.grid.valid()):
            raise InputError(f"other samples are missing in file {number} than in the first", code="merge")
        for note in (PLACEMENT, CRS):
            if first.metadata.get(note) != other.metadata.get(note):
                raise InputError(f"file {number} has another {note} than the first", code="merge")
    if len({source.field.scale for source in sources if source.field.number is not None}) > 1:
        raise InputError("the files have values in different steps", code="merge")
    rising = sorted((source.field for source in sources), key=lambda field: field.isovalue)
    valid = first.grid.valid()
    for lower, higher in pairwise(rising):
        if (higher.signs & ~lower.signs & valid).any():
            raise InputError(
                f"samples lie above {higher.isovalue:g} that do not lie above {lower.isovalue:g}: the files are not of "
                "one field", code="merge",
            )
