"""Merge several files: isovalues of one field, windows of one grid, or frames of one series."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..drawing.smoothing import SMOOTHING
from ..errors import InputError, LimitError, OptionError
from ..field.framed import Frames
from ..field.labelling import LABELS, TYPE, is_of_labels, listed
from ..field.placement import CRS, PLACEMENT, Placement, read_placement, unplaced
from ..field.sampled import Field
from ..field.times import TIME
from ..limits import Limits
from ..storage.content import Readable
from ..stream.cropped_source import moved_notes
from ..stream.mosaic import Mosaic, Window
from ..stream.options import Options
from ..stream.promises import PROMISE, last_promise
from ..stream.splicing import appended, can_follow, parts_of, spliced
from .encoding import encode
from .files import TileFile
from .opening import open
from .operations import impossible
from .recoding import Held, held_by, same_again

if TYPE_CHECKING:
    from ..stream.options import ProfileName
    from .isofile import IsoFile

_OFF = 1e-3
"""Samples that coordinates of one grid in two files may be apart, since they are rounded."""
_NAMED = 6
"""Most isovalues that an error names."""


def merge(files: Sequence[Readable], *, profile: ProfileName | None = None, limits: Limits | None = None) -> bytes:
    """Merge several files into one; no point moves.

    Files of the same field, with the same placement and missing samples, or on the same mesh give their isovalues,
    which differ. Series with the same isovalues, or single frames and a series, give their frames. Windows of one grid,
    by their placements, with the same isovalues, or of labels, give the box around them; they share a row of samples
    with their neighbours.

    Parameters
    ----------
    files : sequence of bytes, paths, URLs or file objects
        Files of one field, of labels that no sample has two of, of one series, one mesh or one grid.
    profile : str, optional
        Profile of the result; ``main`` by default for files of grids, which are re-encoded. Series, meshes and labels,
        which are not, keep theirs.
    limits : Limits, optional
        Limits for decoding each file.

    Returns
    -------
    bytes
        An ``.iso`` file with the isovalues or the frames in the order of the files. If several files have the same
        note, the first one's is kept. Between windows, a crossing on a shared edge is that of the first file; what two
        files store of it may differ by their precision, and what the merged file promises takes that into account.
        Where no window lies, samples are missing.

    Raises
    ------
    InputError
        If the files are not of the same field: they differ in shape, placement, missing samples or step of values, or a
        sample lies above one isovalue but not above a lower one, or has two labels. If windows differ in samples that
        they share, or touch without sharing any.
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
    whole = [file.whole() if isinstance(file, TileFile) else file for file in opened]
    notes = [each.info.metadata for each in whole]
    of_labels = [is_of_labels(note) for note in notes]
    if any(of_labels) and not all(of_labels):
        raise InputError("labels and isovalues cannot be in one file", code="merge",
                         remedy="merge files of labels alone")
    windows = "mesh" not in kinds and len({note.get(PLACEMENT) for note in notes}) > 1
    alike = len({each.isovalues for each in whole}) == 1
    frames = alike and not windows and any(each.info.interval is not None for each in whole)
    _check_one(notes, *[CRS] if windows else [PLACEMENT, CRS])
    if frames:
        return _with_frames(whole, profile, limits)
    if windows:
        return _labels_around(whole, profile, limits) if all(of_labels) else _around(whole, profile, limits)
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


def _with_frames(files: Sequence[IsoFile], profile: ProfileName | None, limits: Limits | None) -> bytes:
    """Put the frames of files one after the other; those whose key frames would not fit are re-encoded."""
    first = next(file.info for file in files if file.info.interval is not None)
    interval, wanted = first.interval or 0, profile or first.profile
    pieces: list[tuple[str, bytes]] = []
    done = 0
    for number, file in enumerate(files, start=1):
        name = f"file {number}"
        ready = file.info.profile == wanted and not file.info.turned
        if ready and can_follow(parts_of(file.data, name), done, interval):
            pieces.append((name, file.data))
        elif file.kind == "mesh":
            raise OptionError(f"a key frame is due within {name}, after every {interval} frames, where a frame is "
                              "predicted from the one before", code="merge",
                              remedy="encode series on meshes with interval=0 (--frame-interval 0)")
        else:
            held = held_by(file.data, limits, name)
            key, times = -done % interval if interval else 0, held.times or [held.metadata.get(TIME)]
            for span in (slice(0, key), slice(key, None)):
                if held.frames[span]:
                    piece = replace(held, frames=held.frames[span], contours=held.contours[span], interval=interval,
                                    times=times[span])
                    pieces.append((name, same_again(piece, Options(profile=wanted, metadata=held.kept_notes))))
        done += file.frames
    return appended(pieces, interval)


def _around(files: Sequence[IsoFile], profile: ProfileName | None, limits: Limits | None) -> bytes:
    """Join windows of one grid."""
    all_held = [held_by(each.data, limits, f"file {i}") for i, each in enumerate(files, start=1)]
    first = all_held[0]
    mosaic, low = _mosaic_of([(held.valid, held.metadata) for held in all_held], limits)
    values = [source.field.isovalue for source in first.frames[0]]
    for number, held in enumerate(all_held, start=1):
        own = {source.field.isovalue: i for i, source in enumerate(held.frames[0])}
        if set(own) != set(values):
            raise InputError(f"file {number} and the first differ in isovalues: "
                             f"{listed(sorted(set(own) ^ set(values))[:_NAMED], ', ')}", code="merge",
                             remedy="encode windows at the same isovalues: --isovalue 0:3000:20")
        if (len(held.frames), held.interval, held.header.scale) != (
            len(first.frames), first.interval, first.header.scale
        ):
            raise InputError(f"file {number} differs from the first in its frames or in the step of values",
                             code="merge")
        order = [own[value] for value in values]
        all_held[number - 1] = replace(held, frames=[[one[i] for i in order] for one in held.frames],
                                       promised=[held.promised[i] for i in order])
    first = all_held[0]
    joined = [[mosaic.source(sources) for sources in zip(*frames, strict=True)]
              for frames in zip(*(held.frames for held in all_held), strict=True)]
    off = max(far for frame in joined for _, far in frame)
    promised = [None if None in some else max(some) + off
                for some in zip(*(held.promised for held in all_held), strict=True)]
    notes = {name: text for held in all_held[::-1] for name, text in held.metadata.items()
             if name != SMOOTHING and (name != PLACEMENT or held is first)}
    metadata = moved_notes(notes, low)
    if off or len({held.metadata.get(PROMISE) for held in all_held}) > 1:
        metadata = last_promise(metadata)
    merged = replace(
        first, header=replace(first.header, shape=mosaic.shape), metadata=last_promise(metadata, all(promised)),
        frames=[[source for source, _ in frame] for frame in joined], contours=[], valid=mosaic.valid,
        promised=promised,
    )
    return same_again(merged, Options.of(profile=profile or "main", metadata=merged.metadata), expected=False)


def _labels_around(files: Sequence[IsoFile], profile: ProfileName | None, limits: Limits | None) -> bytes:
    """Join windows of one grid of labels; each has the labels that lie in it."""
    first, labels = files[0], [*dict.fromkeys(label for file in files for label in file.isovalues)]
    if len({(file.frames, file.info.interval) for file in files}) > 1:
        raise InputError("the files differ in their frames", code="merge")
    mosaic, low = _mosaic_of([(file.valid(), file.metadata) for file in files], limits)
    kept = {name: text for file in files[::-1] for name, text in file.metadata.items()
            if name not in (LABELS, TYPE, TIME, PROMISE, SMOOTHING) and (name != PLACEMENT or file is first)}
    notes, gone = moved_notes(kept, low), False if mosaic.valid.all() else ~mosaic.valid
    frames = [Field(np.ma.masked_array(mosaic.labels([file.labels(frame=frame) for file in files]), gone),
                    labels=labels, notes=notes) for frame in range(first.frames)]
    if first.info.interval is None:
        return encode(frames[0], profile=profile or "main")
    times = None if first.times is None else [*first.times]
    return encode(Frames(frames, first.info.interval, times), profile=profile or "main")


def _mosaic_of(
    files: Sequence[tuple[NDArray[np.bool_], Mapping[str, str]]], limits: Limits | None
) -> tuple[Mosaic, list[int]]:
    """Lay windows, by their valid samples and notes, beside one another; with the first sample of the box around them
    in the grid of the first."""
    starts = _starts([(valid.shape, notes) for valid, notes in files])
    low = starts.min(axis=0)
    size = math.prod((np.array([valid.shape for valid, _ in files]) + starts - low).max(axis=0).tolist())
    if size > (most := (limits or Limits()).samples):
        raise LimitError(f"all files together have {size:,} samples, more than the limit of {most:,}",
                         code="limit-samples", clause="11.2", remedy="merge fewer files, or raise Limits.samples")
    windows = [Window(tuple(start), valid) for start, (valid, _) in zip((starts - low).tolist(), files, strict=True)]
    return Mosaic(windows), low.tolist()


def _starts(files: Sequence[tuple[tuple[int, ...], Mapping[str, str]]]) -> NDArray[np.int64]:
    """Find the first sample of each file, by shape and notes, in the grid of the first, (F, n)."""
    n = len(files[0][0])
    places = [read_placement(notes, n) or Placement(unplaced(n)) for _, notes in files]
    first, matrix = places[0], places[0].matrix
    assert matrix is not None
    found = []
    for number, ((shape, _), place) in enumerate(zip(files, places, strict=True), start=1):
        corners = np.indices((2,) * n).reshape(n, -1).T * (np.array(shape, np.float64) - 1)
        there = place.place(corners)
        index = first.index(there)
        off = (first.place(index) - there) / np.linalg.norm(matrix[:, :n], axis=0).min()
        start = np.rint(index[0])
        if max(np.abs(index - corners - start).max(), np.abs(off).max()) > _OFF:
            raise InputError(f"file {number} differs from the first in placement, and in its grid", code="merge",
                             remedy="merge windows of one grid")
        found.append(start.astype(np.int64))
    return np.array(found)


def _check_one(metadata: Sequence[Mapping[str, str]], *names: str) -> None:
    """Refuse files that differ in a note."""
    first, *others = metadata
    for number, other in enumerate(others, start=2):
        for note in names:
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
