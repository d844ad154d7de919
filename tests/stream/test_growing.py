"""Series that are still being written: what has come of a file gives every frame that is whole (clause 3.7.5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import HEAVY
from explicit_meshes import plane
from isocodec import Decoder, Encoder, Field, Frames, IsoFile, Mesh
from isocodec.api.files import frames_of
from isocodec.errors import FormatError, IsoError, TruncatedError
from isocodec.format.chunks import write_chunk
from isospec.container import ChunkType
from tables import heavy, looped

COUNT = 3
LEVELS = (2.5, 3.5)
MESH = plane(3)


def distances(shape: Sequence[int]) -> list[np.ndarray]:
    """A ball that moves, of which the second frame shows nothing."""
    axes = np.indices(shape)
    middle = np.array(shape).reshape(-1, *[1] * len(shape)) / 2
    frames = [np.linalg.norm(axes - middle + t, axis=0) for t in range(COUNT)]
    frames[1] += 100
    return frames


def segments() -> list[Field]:
    return [Field(np.where(each < 2, 3, np.where(each < 4, 1, 0)).astype(np.uint8), labels=(1.0, 3.0))
            for each in distances((9, 10))]


def with_gaps() -> list[np.ndarray]:
    frames = distances((9, 10))
    for frame in frames:
        frame[3:5, 6] = np.nan
    return frames


def on_mesh() -> list[np.ndarray]:
    x, y = MESH[0].T
    return [np.hypot(x - x.mean() + 2 * t, y - y.mean()) for t in range(COUNT)]


SERIES: dict[str, tuple[Callable[[], Any], Any, dict[str, Any]]] = {
    "plane": (lambda: distances((9, 10)), 3.5, {}),
    "signs": (lambda: distances((9, 10)), 3.5, {"precision": "signs", "interval": 2}),
    "isovalues": (lambda: distances((9, 10)), LEVELS, {"precision": "step=0.1", "interval": 3}),
    "within": (lambda: distances((9, 10)), LEVELS, {"precision": 0.3}),
    "volume": (lambda: distances((5, 6, 7)), 2.5, {}),
    "labels": (segments, None, {}),
    "gaps": (with_gaps, 3.5, {}),
    "mesh": (on_mesh, (20.5, 30.5), {}),
    "mesh levels": (on_mesh, 25.5, {"precision": "step=0.1", "interval": 2}),
}
SOME = ["plane", "isovalues", "mesh", *heavy("signs", "within", "volume", "labels", "gaps", "mesh levels")]


@cache
def grown(name: str) -> tuple[tuple[bytes, ...], bytes]:
    """What an encoder returns for each frame, and for the end."""
    frames, isovalues, options = SERIES[name]
    encoder = Encoder(isovalues, **options)
    given = frames()
    if name.startswith("mesh"):
        given[0] = Mesh(*MESH, given[0], progressive=name == "mesh levels")
    return tuple(encoder.add(frame) for frame in given), encoder.finish()


@cache
def together(name: str) -> bytes:
    frames, isovalues, options = SERIES[name]
    if name.startswith("mesh"):
        return isocodec.encode(Mesh(*MESH, np.array(frames()), progressive=name == "mesh levels"), isovalues, **options)
    return isocodec.encode(Frames(frames()), isovalues, **options)


def opened(data: bytes, name: str) -> IsoFile:
    return isocodec.open(data, mesh=MESH if name.startswith("mesh") else None)


def same(found: isocodec.Contour, wanted: isocodec.Contour) -> bool:
    return np.array_equal(found.points, wanted.points) and np.array_equal(found.cells, wanted.cells)


def check(data: bytes, name: str, wanted: list[list[isocodec.Contour]], whole: int) -> None:
    """The first ``whole`` frames are in the beginning of a file, and no others."""
    try:
        file = opened(data, name)
        info = file.info
    except TruncatedError:  # within the header
        assert not whole
        return
    taken = []
    with pytest.raises(TruncatedError):
        for contours in file.each_frame():
            taken.append(contours)
    assert len(taken) == len(list(file.each_frame(partial=True))) == whole
    assert all(one.complete for contours in taken for one in contours)
    assert all(all(map(same, found, right)) for found, right in zip(taken, wanted, strict=False))
    if info.interval is None:
        assert not whole
        return
    assert file.frames == whole == sum(frame.complete for frame in info.frames)
    assert len(info.frames) - whole in (0, 1) and not file.complete
    for number in range(max(whole - 1, 0), min(whole + 1, COUNT)):
        if number < whole:
            found = file.contours(frame=number)
            assert all(one.complete for one in found) and all(map(same, found, wanted[number]))
            last = file.contour(info.isovalues[-1], frame=number)
            assert last.complete and (info.noun == "label" or same(last, wanted[number][-1]))  # those meet
        else:
            with pytest.raises(TruncatedError):
                file.contour(frame=number)
            if number < len(info.frames):
                assert not file.contour(frame=number, partial=True).complete


@looped("name", SERIES)
def test_what_has_been_added_decodes(name: str):
    pieces, end = grown(name)
    data = b"".join(pieces) + end
    file = opened(data, name)
    wanted = list(file.each_frame())
    assert file.complete and file.frames == COUNT and len(wanted) == COUNT
    for found, right in zip(wanted, opened(together(name), name).each_frame(), strict=True):
        assert all(map(same, found, right))
    for count in range(1, COUNT + 1):
        check(b"".join(pieces[:count]), name, wanted, count)
    for start in range(1, COUNT + 1):
        later = list(file.each_frame(start=start))
        assert len(later) == COUNT - start
        assert all(all(map(same, found, right)) for found, right in zip(later, wanted[start:], strict=True))


@looped("name", SOME)
def test_cut_at_every_byte(name: str):
    """Frames are whole if all of their bytes are there."""
    pieces, end = grown(name)
    data = b"".join(pieces) + end
    wanted = list(opened(data, name).each_frame())
    ends = np.cumsum([len(piece) for piece in pieces])
    near = {int(end) + step for end in ends for step in (-1, 0, 1)}
    for length in sorted({*range(1, len(data), 1 if HEAVY else 41), *near} & {*range(1, len(data))}):
        check(data[:length], name, wanted, int((ends <= length).sum()))


@looped("name", SOME)
def test_cut_without_marks(name: str):
    """A file of frames that were all given says that a frame is whole by beginning the next one, or by its end."""
    data = together(name)
    file = opened(data, name)
    wanted = list(file.each_frame())
    behind = {chunk.offset: chunk.offset + chunk.bytes for chunk in file.info.chunks}
    ends = np.array([behind[frame.offset] for frame in file.info.frames[1:]])
    for length in range(1, len(data), 3 if HEAVY else 31):
        check(data[:length], name, wanted, int((ends <= length).sum()))


@looped("name", SERIES)
def test_frames_come_with_their_bytes(name: str):
    """A reader of a stream has a frame as soon as the writer has sent it."""
    pieces, end = grown(name)
    sent = 0

    def stream():
        nonlocal sent
        for sent, piece in enumerate(pieces, start=1):  # noqa: B007
            yield piece
        yield end

    arrived = [sent for _ in frames_of(stream(), mesh=MESH if name.startswith("mesh") else None)]
    assert arrived == [*range(1, COUNT + 1)]


@pytest.mark.parametrize("name", ["isovalues", "labels", "gaps"])
def test_samples_of_whole_frames(name: str):
    pieces, end = grown(name)
    whole = isocodec.open(b"".join(pieces) + end)
    for count in range(1, COUNT + 1):
        file = isocodec.open(b"".join(pieces[:count]))
        assert (file.valid() == whole.valid()).all()
        for number in range(count):
            for value in file.isovalues:
                assert (file.above(value, frame=number) == whole.above(value, frame=number)).all()
        if name == "labels":
            assert (file.labels() == whole.labels()).all()
    given = SERIES["isovalues"][0]()
    if name == "isovalues":
        assert all(one.kept is not False for one in isocodec.open(pieces[0] + pieces[1]).verify(given[1], frame=1))


def test_an_end_before_further_layers_is_void():
    mark = write_chunk(ChunkType.FRAME_END, b"", ancillary=True)
    data = together("isovalues")
    for frame in isocodec.open(data).info.frames:
        for chunk in isocodec.open(data).info.chunks:
            if not frame.offset < chunk.offset < frame.offset + frame.bytes:
                continue
            begun = data[: chunk.offset] + mark + data[chunk.offset : chunk.offset + chunk.bytes - 1]
            decoder = Decoder()
            decoder.feed(begun)
            assert decoder.take().frames <= decoder.frame + (chunk.type == "frame")


def test_a_mark_in_a_file_that_is_no_series():
    data = isocodec.encode(distances((9, 10))[0], 3.5)
    begun = data[: isocodec.open(data).info.chunks[-1].offset]
    with pytest.raises(TruncatedError):
        isocodec.open(begun + write_chunk(ChunkType.FRAME_END, b"", ancillary=True)).contour()


def test_damage_behind_a_frame_is_reported():
    pieces, end = grown("signs")
    data = bytearray(b"".join(pieces) + end)
    data[-1] ^= 1
    with pytest.raises(FormatError):
        isocodec.open(bytes(data)).contour(frame=1)
    with pytest.raises(IsoError):
        list(isocodec.open(bytes(data)).each_frame(partial=True))
