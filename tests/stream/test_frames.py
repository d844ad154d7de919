"""Series of frames: each decodes to its own curve, alone or in turn, from any part of a file (spec 3.5.7, 5.11)."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import isocodec
from commands import ok
from files import fed
from isocodec import Contour, Decoder, Encoder, Frames, encode
from isocodec.errors import FormatError, InputError, OptionError, TruncatedError
from isocodec.format.chunks import write_chunk
from isocodec.format.events import FrameRead, IsovalueRead, PromisesRead
from isospec.container import ChunkType
from libraries import Late
from tables import looped

cKDTree = Late("scipy.spatial.cKDTree")

ISOVALUE = 40


def moving(count: int = 6, size: int = 40) -> NDArray[np.int16]:
    """A disc with a bump that moves and grows."""
    y, x = np.mgrid[:size, : size + 4]
    frames = []
    for t in range(count):
        field = np.hypot(y - 17.3 - 0.6 * t, x - 18.1 - 0.4 * t) * 4 - 3 * np.cos(0.7 * x + 0.2 * t)
        frames.append(np.round(field - t).astype(np.int16))
    return np.array(frames)


def solid(count: int = 4, size: int = 14) -> NDArray[np.int16]:
    """A ball that moves."""
    z, y, x = np.mgrid[:size, :size, :size]
    return np.array([
        np.round(10 * np.sqrt((z - 6.2) ** 2 + (y - 6.1 - 0.3 * t) ** 2 + (x - 5.5 - 0.5 * t) ** 2)).astype(np.int16)
        for t in range(count)
    ])


def points(contour: Contour) -> list[tuple[float, ...]]:
    return sorted(map(tuple, contour.points.tolist()))


def with_checksum(data: bytes) -> bytes:
    return data[:-4] + zlib.crc32(data[:-4]).to_bytes(4, "big")


def assert_same(frames: Sequence[NDArray[Any]], data: bytes, isovalues: Sequence[float], **options: Any) -> None:
    """Each frame, taken alone and in turn, is what it is in a file of its own."""
    turn = list(isocodec.open(data).each_frame())
    assert len(turn) == len(frames)
    for number, frame in enumerate(frames):
        for i, isovalue in enumerate(isovalues):
            alone = isocodec.decode(isocodec.encode(frame, isovalue, **options))
            single = isocodec.decode(data, frame=number, isovalue=isovalue)
            assert points(single) == points(turn[number][i])
            assert single.complete and turn[number][i].complete
            assert len(single.cells) == len(alone.cells)
            if options.get("precision") in ("signs", "exact"):
                assert points(single) == points(alone)
            else:
                # crossings are told to within 0.05 cells, in either file to another part of them
                apart = cKDTree(alone.points).query(single.points)[0]
                assert apart.max() < 0.1 + 1e-9


@pytest.mark.cover(2)
@pytest.mark.parametrize("profile", ["main", "baseline"])
@pytest.mark.parametrize("interval", [0, 1, 4])
@pytest.mark.parametrize(
    "options", [{"precision": "signs"}, {"precision": "exact"}, {}], ids=["signs", "exact", "default"],
)
def test_each_frame_is_its_own_curve(options: dict[str, Any], interval: int, profile: str):
    frames = moving()
    data = encode(Frames(frames), ISOVALUE, interval=interval, profile=profile, **options)
    assert_same(frames, data, [ISOVALUE], profile=profile, **options)


@pytest.mark.parametrize("options", [{"precision": "signs"}, {"precision": "exact"}], ids=["signs", "exact"])
def test_surfaces(options: dict[str, Any]):
    frames = solid()
    assert_same(frames, encode(Frames(frames), 45, **options), [45], **options)


@pytest.mark.parametrize("interval", [0, 3])
def test_several_isovalues(interval: int):
    frames = moving()
    data = encode(Frames(frames), [40, 25, 55], interval=interval, precision="exact")
    assert_same(frames, data, [40, 25, 55], precision="exact")
    info = isocodec.open(data).info
    assert [frame.key for frame in info.frames] == [t % interval == 0 if interval else t == 0 for t in range(6)]
    # in key frames isovalues lean on one another, in others on the frame before
    assert all(any(lean is not None for lean in frame.leans) == frame.key for frame in info.frames)


@looped(
    "options", [{"precision": 0.5}, {"precision": [1, 0.2]}, {"layers": "topology"}, {"keep_topology": True},
                {"layers": 4}, {"order": "independent"}, {"layers": [("base", 3), ("refine", 2), ("offsets", 5, 1)]}],
    ids=lambda options: next(iter(options)),
)
def test_any_layers(options: dict[str, Any]):
    frames = moving(3, 24)
    data = encode(Frames(frames), ISOVALUE, **options)
    for number, curves in enumerate(isocodec.open(data).each_frame()):
        assert curves[0].complete and len(curves[0].points)
        assert points(isocodec.decode(data, frame=number)) == points(curves[0])


def test_a_frame_needs_none_before_its_interval():
    frames = moving(7)
    data = encode(Frames(frames), ISOVALUE, interval=3, precision="signs")
    info = isocodec.open(data).info
    damaged = bytearray(data)
    for chunk in info.chunks:
        # all layers but those of frames 3 to 5
        inside = info.frames[3].offset <= chunk.offset < info.frames[6].offset
        if chunk.type == "layers" and not inside:
            damaged[chunk.offset + 2 : chunk.offset + chunk.bytes] = b"\xff" * (chunk.bytes - 2)
    damaged[-4:] = data[-4:]
    whole = with_checksum(bytes(damaged))
    for number in (3, 4, 5):
        assert points(isocodec.decode(whole, frame=number)) == points(isocodec.decode(data, frame=number))
    with pytest.raises(FormatError):
        isocodec.decode(whole, frame=0)


def test_every_16th_frame_is_a_key_frame(tmp_path: Path):
    """Whoever encodes the series; the last frames do not need those before the last key frame."""
    frames = moving(18, 12)
    encoder, path = Encoder(ISOVALUE, precision="signs"), tmp_path / "run.iso"
    grown = b"".join(map(encoder.add, frames)) + encoder.finish()
    isocodec.save(path, Frames(frames), ISOVALUE, precision="signs")
    points = np.argwhere(np.ones(frames[0].shape))
    mesh = isocodec.Mesh(points, None, frames.reshape(18, -1))
    np.save(tmp_path / "frames.npy", frames)
    ok("encode", tmp_path / "frames.npy", "-o", tmp_path / "told.iso", "--isovalue", ISOVALUE, "--frames")
    for data in (grown, path, encode(Frames(frames), ISOVALUE), encode(mesh, ISOVALUE), tmp_path / "told.iso"):
        assert [number for number, frame in enumerate(isocodec.open(data).info.frames) if frame.key] == [0, 16]
    work = []
    for number in (15, 16, 17):
        decoder = Decoder(frame=number)
        decoder.feed(grown)
        work.append(sum(decoder.take().symbols.values()))
    assert work[0] > 5 * work[2] > 5 * work[1] > 0


def test_memory_is_that_of_two_frames():
    few, many = moving(3), np.concatenate([moving(3)] * 8)
    most = []
    for frames in (few, many):
        decoder = fed(encode(Frames(frames), ISOVALUE, precision="signs"))
        most.append(decoder.memory)
        assert len(decoder.grid.layers) < 20 and len(decoder.grid.runs) == 1
    assert most[1] < 1.2 * most[0]


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_truncated_files_are_files(share: float):
    frames = moving(5)
    data = encode(Frames(frames), ISOVALUE)
    short = isocodec.open(data).edited(size=int(share * len(data)))
    assert len(short) <= share * len(data)
    count = len(isocodec.open(short).info.frames)
    assert 1 <= count <= 5
    for number in range(count - 1):
        assert points(isocodec.decode(short, frame=number)) == points(isocodec.decode(data, frame=number))
    layers = sum(layer.frame < 2 for layer in isocodec.open(data).info.layers)
    first = isocodec.open(data).edited(layers=layers)
    assert len(isocodec.open(first).info.frames) == 2
    assert points(isocodec.decode(first, frame=1)) == points(isocodec.decode(data, frame=1))


def test_holes_are_those_of_all_frames():
    frames = moving().astype(np.float32)
    frames[:, 5:9, 12:20] = np.nan
    data = encode(Frames(frames), ISOVALUE, precision="signs")
    for number, frame in enumerate(frames):
        alone = isocodec.decode(isocodec.encode(frame, ISOVALUE, precision="signs"))
        assert points(isocodec.decode(data, frame=number)) == points(alone)
    frames[3, 20, 20] = np.nan
    with pytest.raises(InputError, match="missing"):
        encode(Frames(frames), ISOVALUE, precision="signs")


def test_piece_by_piece_and_at_once():
    frames = moving()
    series = Encoder(ISOVALUE, interval=2)
    pieces = [series.add(frame) for frame in frames]
    assert series.frames == 6
    together = encode(Frames(frames), ISOVALUE, interval=2)
    end = write_chunk(ChunkType.FRAME_END, b"", ancillary=True)
    assert all(piece.endswith(end) for piece in pieces)
    # but for the bit that marks the last chunk, and the checksum
    places = [(frame.offset, frame.offset + frame.bytes) for frame in isocodec.open(together).info.frames]
    assert [piece[: -len(end)] for piece in pieces[:-1]] == [together[start:stop] for start, stop in places[:-1]]
    assert len(b"".join(pieces) + series.finish()) == len(together) + len(end) * 7
    with pytest.raises(OptionError, match="finished"):
        series.add(frames[0])
    with pytest.raises(OptionError, match="finished"):
        series.finish()


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([], "without frames"),
        ([np.zeros((4, 5)), np.zeros((5, 4))], "frame 1 has the shape 5 x 4, but earlier frames have 4 x 5"),
        ([np.zeros((4, 5), np.int16), np.zeros((4, 5), np.int32)], "int32"),
        ([np.zeros((4, 5)), np.zeros((4, 5, 6))], "shape"),
    ],
)
def test_frames_that_are_not_alike(frames: list[NDArray[Any]], message: str):
    with pytest.raises(InputError, match=message):
        encode(Frames(frames), 0.5)


@pytest.mark.parametrize("interval", [-1, 1.5, 1 << 40])
def test_intervals_out_of_range(interval: Any):
    with pytest.raises(OptionError, match="interval"):
        encode(Frames(moving(2)), ISOVALUE, interval=interval)


@pytest.mark.parametrize("frame", [-1, 1.5, True])
def test_frames_that_are_no_number(frame: Any):
    with pytest.raises(OptionError, match="frame"):
        isocodec.decode(encode(Frames(moving(2)), ISOVALUE), frame=frame)


def test_frames_that_are_not_there():
    data = encode(Frames(moving(3)), ISOVALUE)
    with pytest.raises(OptionError, match="no frame 3"):
        isocodec.decode(data, frame=3)
    with pytest.raises(TruncatedError, match="before frame 2"):
        isocodec.decode(data, frame=2, max_bytes=len(data) // 2)
    single = isocodec.encode(moving(1)[0], ISOVALUE)
    assert points(isocodec.decode(single, frame=0)) == points(isocodec.decode(single))
    with pytest.raises(OptionError, match="no frame 1"):
        isocodec.decode(single, frame=1)


@cache
def promised(t: int, isovalue: float, precision: float | tuple[float, ...]) -> list[float]:
    """What a file of a frame alone promises."""
    info = isocodec.open(encode(moving(3, 16)[t], isovalue, precision=precision)).info
    return [layer.within for layer in info.layers if layer.within]


@pytest.mark.cover(1)
@pytest.mark.parametrize("interval", [0, 1, 2])
@pytest.mark.parametrize("isovalues", [[ISOVALUE], [ISOVALUE, 25]], ids=["one", "two"])
@pytest.mark.parametrize("precision", [0.05, 0.5, (1, 0.2)], ids=["grid", "searched", "steps"])
def test_promises_of_each_frame_are_kept(precision: Any, isovalues: list[float], interval: int):
    data = encode(Frames(moving(3, 16)), isovalues, precision=precision, interval=interval)
    wanted = {(t, i): promised(t, isovalue, precision) for t in range(3) for i, isovalue in enumerate(isovalues)}
    found: dict[tuple[int, int], list[float]] = {place: [] for place in wanted}
    for layer in isocodec.open(data).info.layers:
        if layer.within:
            found[layer.frame, layer.isovalue].append(layer.within)
    assert found == wanted and all(found.values())
    place, events = (0, 0), []
    decoder = Decoder()
    for at in range(len(data)):
        decoder.feed(data[at : at + 1])
        for event in decoder:
            if isinstance(event, IsovalueRead):
                place = 0, event.number
            elif isinstance(event, FrameRead):
                place = event.frame, event.number
            elif isinstance(event, PromisesRead):
                events.append((place, list(event.promises.within.values())))
    assert dict(events) == wanted and len(events) == len(wanted)
