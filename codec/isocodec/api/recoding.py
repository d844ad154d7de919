"""Files made of files, without the field: the same curves in another profile or precision, or several in one file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..field.placement import CRS, PLACEMENT
from ..field.told import LABELS
from ..limits import Limits
from ..storage.content import Readable, content
from ..stream.decoder import Decoder
from ..stream.names import ProfileName
from ..stream.recoder import Recoder, Source, sources_of
from .mesh_api import on_mesh
from .whole import decode_all, received


def transcode(
    data: Readable,
    *,
    profile: ProfileName | None = None,
    tolerance: float | None = None,
    signs_only: bool = False,
    preserve_topology: bool = False,
    limits: Limits | None = None,
) -> bytes:
    """Encode the curves or surfaces of a file again, in another profile or less precisely, without their field.

    Without ``tolerance`` and ``signs_only`` all points stay where they are. What is promised is about the curves that
    the file decodes to: how far these are from those of the field comes on top, and promises of steps are left out.

    Parameters
    ----------
    data : bytes, path, URL or file object
        A file on the full grid: one made without a criterion, and with no tolerance, or last step, from 0.1 on.
    profile : str, optional
        ``main`` or ``baseline``; that of the file if not given.
    tolerance : float, optional
        Largest distance, in cells, between the curve that the file decodes to and that of the result, both ways.
    signs_only : bool
        Keep no geometry: which samples lie above is exact, crossings are drawn half-way.
    preserve_topology : bool
        Every layer has the components of the curve, nested alike.
    limits : Limits, optional
        What the file may need at most.

    Returns
    -------
    bytes
        An ``.iso`` file with the isovalues, missing samples and notes of the other.

    Raises
    ------
    OptionError
        If the file is not on the full grid, is a series, lies on a mesh, has coordinates of its own or tells values in
        part; or if options contradict one another.
    FormatError, LimitError
        As `decode`.
    """
    decoder = _decoder(data, limits, "the file")
    assert decoder.header is not None
    sources = sources_of(decoder)
    options: dict[str, Any] = {
        "profile": profile or decoder.header.profile.name.lower(), "metadata": decoder.metadata,
        "preserve_topology": preserve_topology, "leaning": LABELS not in decoder.metadata,
    }
    if tolerance is not None or signs_only:
        return b"".join(Recoder(sources, False, tolerance=tolerance, signs_only=signs_only, **options))
    return kept(sources, _all(decoder), **options)


def merge(files: Sequence[Readable], *, profile: ProfileName = "main", limits: Limits | None = None) -> bytes:
    """Put the isovalues of several files of one field into one file, point by point as they are.

    Parameters
    ----------
    files : sequence of bytes, paths, URLs or file objects
        Files of fields of the same shape, place and missing samples, each with isovalues of its own, as `transcode`
        takes them.
    profile : str
        Of the result.
    limits : Limits, optional
        What each of the files may need at most.

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
        As `transcode`, or if an isovalue is in two of them.
    FormatError, LimitError
        As `decode`.
    """
    if isinstance(files, str | bytes) or not len(files):
        raise OptionError("no files to merge", code="files", remedy="give a sequence of them")
    decoders = [_decoder(file, limits, f"file {number}") for number, file in enumerate(files, start=1)]
    sources = [one for i, decoder in enumerate(decoders, start=1) for one in sources_of(decoder, f"file {i}")]
    _check_one_field(decoders, sources)
    metadata: dict[str, str] = {}
    for decoder in reversed(decoders):
        metadata.update(decoder.metadata)
    expected = [contour for decoder in decoders for contour in _all(decoder)]
    return kept(sources, expected, profile=profile, metadata=metadata)


def _decoder(data: Readable, limits: Limits | None, what: str) -> Decoder:
    """A decoder that has taken a whole file."""
    whole = content(data, limits)
    if on_mesh(whole):
        raise OptionError(f"{what} lies on a mesh", code="recode", remedy="encode the values on it again")
    return received(whole, None, limits=limits)


def _all(decoder: Decoder) -> list[Contour]:
    return [decoder.drawn(number) for number in range(len(decoder.isovalues))]


def kept(sources: Sequence[Source], expected: Sequence[Contour] | None = None, **options: Any) -> bytes:
    """The same curves again. They are decoded to see that they are: crossings of curves that touch may stand in an
    order that isovalues which lean on one another cannot have, and then none of them does. Without ``expected`` they
    have to be those of a file in which none does."""
    steps = {source.field.scale for source in sources if source.field.number is not None}
    options["step"] = next(iter(steps), None)
    may = options.pop("leaning", True)
    alone = b""
    if expected is None:
        alone = b"".join(Recoder(sources, True, leaning=False, **options))
        if len(sources) == 1:
            return alone
        expected = decode_all(alone)
    for leaning in (True, False) if may else (False,):
        data = alone if alone and not leaning else b"".join(Recoder(sources, True, leaning=leaning, **options))
        if all(_same(a, b) for a, b in zip(decode_all(data), expected, strict=True)):
            return data
    raise InputError("the curves cannot be told again as they are", code="recode")


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
        if not np.array_equal(first.valid(), other.valid()):
            raise InputError(f"in file {number} other samples are missing than in the first", code="merge")
        for note in (PLACEMENT, CRS):
            if first.metadata.get(note) != other.metadata.get(note):
                raise InputError(f"file {number} lies elsewhere than the first: its {note} is another", code="merge")
    if len({source.field.scale for source in sources if source.field.number is not None}) > 1:
        raise InputError("the files have values in different steps", code="merge")
    rising = sorted((source.field for source in sources), key=lambda field: field.isovalue)
    valid = first.valid()
    for lower, higher in pairwise(rising):
        if (higher.signs & ~lower.signs & valid).any():
            raise InputError(
                f"samples lie above {higher.isovalue:g} that do not lie above {lower.isovalue:g}: the files are not of "
                "one field", code="merge",
            )
