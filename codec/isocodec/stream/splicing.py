"""Assemble files from unchanged chunks of others: some isovalues of one file, or all isovalues of several."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from isospec.container import ChunkType, DomainKind, MeshLayer

from ..errors import InputError, OptionError, TruncatedError
from ..field.labelling import of_some
from ..field.times import TIME
from ..format.chunks import payload_of, write_chunk
from ..format.frames import FRAME_BEFORE, LAST, is_key
from ..format.header import Header, read_header
from .container import beginning, closed, opening
from .file_info import FileInfo
from .inspect import inspect
from .promises import PROMISE, last_promise

ANCILLARY = 0x80
"""Bit of a chunk's head that marks it as ancillary, so that readers may skip it."""
_SHARED = ("domain", "mask", "coordinates")
"""Chunks that concern the whole file."""
_SIGNS = (MeshLayer.SIGNS, MeshLayer.LEVELS, MeshLayer.CUT)
_PARTS = (
    "if each file stores only the part of the mesh that its own contours need, encode all isovalues together, or each "
    'with stored="whole" (--stored whole)'
)
_OWN = ("layers", "promises")
"""Chunks that belong to the latest isovalue that has begun."""


@dataclass
class Strand:
    """The chunks of an isovalue of a frame.

    Attributes
    ----------
    isovalue : float
    lean : int or None
        Number of the isovalue of the same file that it is predicted from, ``FRAME_BEFORE``, or None.
    chunks : list of bytes
    """

    isovalue: float
    lean: int | None
    chunks: list[bytes] = field(default_factory=list)


@dataclass
class Parts:
    """A complete file, split into its chunks.

    Attributes
    ----------
    header : Header
    info : FileInfo
    shared : list of bytes
        Chunks that concern the whole file, without its notes.
    frames : list of list of Strand
    """

    header: Header
    info: FileInfo
    shared: list[bytes]
    frames: list[list[Strand]]


def parts_of(data: bytes, what: str = "the file") -> Parts:
    """Split a complete file into its chunks; ``what`` names it in messages.

    Raises
    ------
    OptionError
        If the file is truncated, or its kind cannot be split.
    FormatError
    """
    info = inspect(data)
    found = read_header(data)
    assert found is not None
    if not info.complete:
        raise OptionError(f"{what} is not complete", code="splice", remedy="edit the whole file")
    if info.turned:
        raise OptionError(f"{what} has layers of several isovalues in turn", code="lean", remedy="keep all of them")
    if info.kind == "surface":
        raise OptionError(f"{what} holds a surface, which has no isovalues", code="splice")
    strands = [
        [Strand(value, lean) for value, lean in zip(info.isovalues, leans, strict=True)] for leans in _leans(info)
    ]
    parts = Parts(found[0], info, [], strands)
    for chunk in info.chunks:
        raw = data[chunk.offset : chunk.offset + chunk.bytes]
        if chunk.type in (*_SHARED, *_OWN):
            same = write_chunk(ChunkType[chunk.type.upper()], payload_of(raw), ancillary=bool(raw[0] & ANCILLARY))
            if chunk.type in _SHARED:
                parts.shared.append(same)
            else:
                strands[chunk.frame][chunk.isovalue].chunks.append(same)
    return parts


def _leans(info: FileInfo) -> list[list[int | None]]:
    """Find what each isovalue of each frame is predicted from."""
    if not info.frames:
        return [info.leans]
    return [
        [FRAME_BEFORE if before else lean for lean, before in zip(frame.leans, frame.before, strict=True)]
        for frame in info.frames
    ]


def chosen(data: bytes, numbers: Sequence[int]) -> bytes:
    """Assemble a file of some isovalues of another, given by number.

    Raises
    ------
    OptionError
        If one of them is predicted from another that is left out.
    """
    parts = parts_of(data)
    new = {old: i for i, old in enumerate(numbers)}
    frames = []
    for strands in parts.frames:
        kept = [strands[number] for number in numbers]
        for strand in kept:
            if strand.lean is not None and strand.lean not in (FRAME_BEFORE, *new):
                raise OptionError(
                    f"isovalue {strand.isovalue:g} is coded with the help of "
                    f"{parts.info.isovalues[strand.lean]:g}, which would be left out", code="lean",
                    remedy="keep that isovalue, too",
                )
        frames.append([
            replace(one, lean=one.lean if one.lean in (None, FRAME_BEFORE) else new[one.lean]) for one in kept
        ])
    notes = of_some(parts.info.metadata, [parts.info.isovalues[number] for number in numbers])
    return _joined(parts.header, parts.info, parts.shared, frames, notes)


def spliced(files: Iterable[bytes]) -> bytes:
    """Assemble a file with the isovalues of several files, in the order of the files.

    Raises
    ------
    InputError
        If the files differ in kind, shape, profile, mesh, missing samples or frames.
    OptionError
        If two files have the same isovalue.
    """
    all_parts = [parts_of(data, f"file {i}") for i, data in enumerate(files, start=1)]
    first = all_parts[0]
    for i, other in enumerate(all_parts[1:], start=2):
        _check_alike(first, other, f"file {i}")
        if _rhythm(other) != _rhythm(first):
            raise InputError(f"file {i} differs from the first in its frames or their times", code="merge")
    values = [value for parts in all_parts for value in parts.info.isovalues]
    if len(set(values)) < len(values):
        raise OptionError("an isovalue is in two of the files", code="isovalue", remedy="leave it out of one of them")
    frames: list[list[Strand]] = [[] for _ in first.frames]
    begun = 0
    for parts in all_parts:
        for out, strands in zip(frames, parts.frames, strict=True):
            out += [
                replace(one, lean=one.lean if one.lean in (None, FRAME_BEFORE) else one.lean + begun)
                for one in strands
            ]
        begun += len(parts.info.isovalues)
    return _joined(first.header, first.info, first.shared, frames, of_some(_all_notes(all_parts), values))


def _all_notes(all_parts: Sequence[Parts]) -> dict[str, str]:
    """The notes of all files, of those with the same name the first, without promises that differ."""
    metadata: dict[str, str] = {}
    for parts in all_parts:
        metadata = {**parts.info.metadata, **metadata}
    return metadata if len({parts.info.metadata.get(PROMISE) for parts in all_parts}) < 2 else last_promise(metadata)


def can_follow(parts: Parts, done: int, interval: int) -> bool:
    """Whether the frames of a file can follow on ``done`` others as they are: no key frame leans on the one before."""
    return not any(
        strand.lean == FRAME_BEFORE
        for frame, strands in enumerate(parts.frames) if is_key(done + frame, interval) for strand in strands
    )


def appended(files: Iterable[tuple[str, bytes]], interval: int) -> bytes:
    """Assemble a series with the frames of several named files of the same isovalues, one file after the other.

    Raises
    ------
    InputError
        If the files differ in kind, shape, profile, mesh or missing samples.
    OptionError
        If a file is not complete.
    """
    all_parts = []
    for name, data in files:
        all_parts.append(parts_of(data, name))
        _check_alike(all_parts[0], all_parts[-1], name)
    first = all_parts[0]
    frames = [strands for parts in all_parts for strands in parts.frames]
    metadata = _all_notes(all_parts)
    times = [time for parts in all_parts for time in _times(parts.info) or [parts.info.metadata.get(TIME)]]
    metadata.pop(TIME, None)
    return _joined(first.header, replace(first.info, interval=interval), first.shared, frames, metadata, times)


def _rhythm(parts: Parts) -> tuple[int | None, list[str | None]]:
    """Interval of key frames, and times of frames."""
    return parts.info.interval, _times(parts.info)


def _times(info: FileInfo) -> list[str | None]:
    """Times of the frames of a series."""
    return [frame.time for frame in info.frames]


def whole_frames(data: bytes) -> bytes:
    """The beginning of a file that was written frame by frame, up to the last mark of an end of a frame.

    Nothing, if its first frame is not complete. The mark that ends a finished file does not count.

    Raises
    ------
    OptionError
        If the file was not written frame by frame.
    FormatError
    """
    try:
        info = inspect(data)
    except TruncatedError:  # within the header
        return b""
    marks = [one for one in info.chunks if one.type == "frame_end" and one.offset + one.bytes <= len(data)]
    ends = [one.offset + one.bytes for one in marks if not data[one.offset] & LAST]
    if not ends and (info.complete or len(info.frames) > 1 or (info.layers and info.interval is None)):
        raise OptionError("the file was not written frame by frame", code="resume",
                          remedy="files of isocodec.Encoder can be resumed")
    return data[: ends[-1]] if ends else b""


def signs_of(data: bytes) -> bytes:
    """Drop the layers of geometry from a file of values on a mesh."""
    parts = parts_of(data)
    for strands in parts.frames:
        for strand in strands:
            layers = [chunk for chunk in strand.chunks if not chunk[0] & ANCILLARY]  # without promises
            strand.chunks[:] = [chunk for chunk in layers if payload_of(chunk)[0] in _SIGNS]
    return _joined(parts.header, parts.info, parts.shared, parts.frames, last_promise(parts.info.metadata))


def _check_alike(first: Parts, other: Parts, what: str) -> None:
    """Refuse to assemble chunks of files that differ in what concerns the whole file; ``what`` names the second."""
    one, two = ((each.info.domain is None, each.header.shape, each.header.profile, each.header.scale, each.header.cells)
                for each in (first, other))
    if one != two:
        raise InputError(f"{what} differs from the first in kind, shape, profile or step of values", code="merge")
    if other.shared != first.shared:
        domain = other.info.domain
        raise InputError(
            f"{what} differs from the first in its mesh or in its missing samples", code="merge",
            remedy=None if domain is None or domain.kind == DomainKind.KNOWN else _PARTS,
        )


def _joined(
    header: Header, info: FileInfo, shared: Sequence[bytes], frames: Sequence[Sequence[Strand]],
    metadata: dict[str, str], times: Sequence[str | None] = (),
) -> bytes:
    """Assemble the file from these chunks."""
    chunks: list[bytes] = []
    all_times = times or _times(info) or [None] * len(frames)
    for strands, (f, time) in zip(frames, enumerate(all_times), strict=True):
        for i, strand in enumerate(strands):
            chunks += [*opening(f, i, strand.isovalue, strand.lean, info.interval, time), *strand.chunks]
    if not chunks and not shared:
        chunks.append(write_chunk(ChunkType.METADATA, b"", ancillary=True))
    begun = beginning(replace(header, isovalue=frames[0][0].isovalue), metadata, shared, info.interval)
    return b"".join(closed([*begun, *chunks]))
