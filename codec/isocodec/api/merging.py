"""Merge several files of the same field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..drawing.smoothing import SMOOTHING
from ..errors import InputError, OptionError
from ..field.labelling import is_of_labels
from ..field.placement import CRS, PLACEMENT
from ..limits import Limits
from ..storage.content import Readable
from ..stream.options import Options
from ..stream.promises import PROMISE, last_promise
from ..stream.splicing import spliced
from .files import TileFile
from .opening import open
from .operations import impossible
from .recoding import Held, held_by, same_again

if TYPE_CHECKING:
    from ..stream.options import ProfileName
    from .isofile import IsoFile


def merge(files: Sequence[Readable], *, profile: ProfileName | None = None, limits: Limits | None = None) -> bytes:
    """Put the isovalues of several files of one field, or of one mesh, into one file; no point moves.

    Parameters
    ----------
    files : sequence of bytes, paths, URLs or file objects
        Files of the same field (with the same shape, placement and missing samples) with different isovalues, or of
        labels that no sample has two of; series with the same frames; or files of values on the same mesh.
    profile : str, optional
        Profile of the result; ``main`` by default for files of grids, which are re-encoded. Series, meshes and labels,
        which are not, keep theirs.
    limits : Limits, optional
        Limits for decoding each file.

    Returns
    -------
    bytes
        An ``.iso`` file with the isovalues in the order of the files. If several files have the same note, the first
        one's is kept.

    Raises
    ------
    InputError
        If the files are not of the same field: they differ in shape, placement, missing samples or step of values, or a
        sample lies above one isovalue but not above a lower one, or has two labels.
    OptionError
        If two files have the same isovalue, or a file cannot be re-encoded (see `IsoFile.edited`); or if series or
        meshes, which are not, do not have the profile.
    FormatError, LimitError
    """
    if isinstance(files, str | bytes) or not len(files):
        raise OptionError("no files to merge", code="files", remedy="give a sequence of files")
    opened = [open(file, limits=limits) for file in files]
    kinds = [file.kind for file in opened]
    if "surface" in kinds:
        raise impossible("merge", "surface")
    of_labels = [is_of_labels(file.info.metadata) for file in opened]
    if any(of_labels) and not all(of_labels):
        raise InputError("labels and isovalues cannot be in one file", code="merge",
                         remedy="merge files of labels alone")
    whole = [file.whole() if isinstance(file, TileFile) else file for file in opened]
    _check_one_place([each.info.metadata for each in whole])
    if all(of_labels):
        _check_apart(whole)
    if all(of_labels) or {"mesh", "series"} & set(kinds):
        others = {file.info.profile for file in whole} - {profile}
        if profile is not None and others:
            raise OptionError(
                f"profile {profile!r} does not apply where series, meshes or labels are merged: they keep theirs, "
                f"{' and '.join(sorted(others))}", code="profile", remedy="leave it out, or re-encode each file first",
            )
        return spliced([file.data for file in whole])
    all_held = [held_by(each.data, limits, f"file {i}") for i, each in enumerate(whole, start=1)]
    _check_one_field(all_held)
    metadata: dict[str, str] = {}
    for held in reversed(all_held):
        metadata.update(held.metadata)
    # moved points of several curves could cross; promises hold without, too
    metadata.pop(SMOOTHING, None)
    sources = [source for held in all_held for source in held.frames[0]]
    if len({source.field.isovalue for source in sources}) < len(sources):
        raise OptionError("an isovalue is in two of the files", code="isovalue", remedy="leave it out of one of them")
    contours = [contour for held in all_held for contour in held.contours[0]]
    promised = [one for held in all_held for one in held.promised]
    if len({held.metadata.get(PROMISE) for held in all_held}) > 1:
        metadata = last_promise(metadata)
    merged = replace(all_held[0], frames=[sources], contours=[contours], promised=promised)
    metadata = last_promise(metadata, all(promised))
    return same_again(merged, Options.of(profile=profile or "main", metadata=metadata))


def _check_one_place(metadata: Sequence[Mapping[str, str]]) -> None:
    first, *others = metadata
    for number, other in enumerate(others, start=2):
        for note in (PLACEMENT, CRS):
            if first.get(note) != other.get(note):
                raise InputError(f"file {number} differs from the first in {note}", code="merge")


def _check_apart(files: Sequence[IsoFile]) -> None:
    """Refuse files of labels in which a sample has several."""
    first, *others = [(file.shape, file.frames) for file in files]
    for number, other in enumerate(others, start=2):
        if other != first:
            raise InputError(f"file {number} differs from the first in its shape or frames", code="merge")
    for frame in range(files[0].frames):
        taken = np.zeros(files[0].shape, np.bool_)
        for number, file in enumerate(files, start=1):
            mine = np.zeros_like(taken)
            for label in file.isovalues:
                mine |= file.above(label, frame=frame)
            if (mine & taken & file.valid()).any():
                raise InputError(f"samples with a label in file {number} have another one in a file before it",
                                 code="merge", remedy="encode the labels together")
            taken |= mine


def _check_one_field(all_held: Sequence[Held]) -> None:
    first, *others = all_held
    sources = [source for held in all_held for source in held.frames[0]]
    for number, other in enumerate(others, start=2):
        if first.header.shape != other.header.shape:
            raise InputError(f"file {number} has shape {other.header.shape}, but the first has {first.header.shape}",
                             code="merge")
        if not np.array_equal(first.valid, other.valid):
            raise InputError(f"the missing samples of file {number} differ from those of the first", code="merge")
    if len({source.field.scale for source in sources if source.field.number is not None}) > 1:
        raise InputError("the values in the files are rounded to different steps", code="merge")
    rising = sorted((source.field for source in sources), key=lambda field: field.isovalue)
    for lower, higher in pairwise(rising):
        if (higher.signs & ~lower.signs & first.valid).any():
            raise InputError(
                f"some samples lie above {higher.isovalue:g} but not above {lower.isovalue:g}: the files are not of "
                "the "
                "same field", code="merge",
            )
