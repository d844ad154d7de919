"""Series that are continued after their writer has been interrupted: the same bytes as if it had not been.

The oracle is the file of an undisturbed run.
"""

from __future__ import annotations

import multiprocessing
import random
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import HEAVY, INTERPRETED
from explicit_meshes import plane
from isocodec import Encoder, Field, Mesh
from isocodec.errors import FormatError, InputError, OptionError
from isocodec.field.placement import Placement
from tables import heavy, looped

MESH = plane(3)
COUNT = 5


def hills(shape: Sequence[int], count: int = COUNT) -> list[np.ndarray]:
    axes = np.indices(shape)
    wave = np.sin(axes[0] / 2) + np.cos(axes[-1] / 3)
    return [np.linalg.norm(axes - np.reshape(shape, (-1, *[1] * len(shape))) / 2 + t / 3, axis=0) + 0.4 * wave
            for t in range(count)]


def whole(shape: Sequence[int]) -> list[np.ndarray]:
    return [np.rint(10 * each).astype(np.int16) for each in hills(shape)]


def rougher() -> list[np.ndarray]:
    """Smooth surfaces, then rough ones: an encoder searches for a mesh of the former only."""
    noise = np.random.default_rng(3).normal(size=(COUNT, 20, 20, 20)) * np.array([0, 3, 3, 0, 3])[:, None, None, None]
    return [*(hills((20, 20, 20)) + noise)]


def gone() -> list[Field]:
    return [Field(each, np.indices(each.shape)[0] == 4) for each in hills((12, 13))]


def labels(every: Any) -> list[Field]:
    return [Field((each // 2).clip(0, 3).astype(np.uint8), labels=every) for each in hills((12, 13))]


def placed() -> list[Field]:
    rings = Placement(coordinates=[np.hypot(*np.indices((12, 13))), np.indices((12, 13))[1]], unit="m")
    return [Field(each, placement=rings, notes={"of": str(t)}) for t, each in enumerate(hills((12, 13)))]


def on_mesh(**how: Any) -> list[Mesh]:
    points, cells = MESH
    return [Mesh(points, None if how.get("scattered") else cells, np.hypot(*points.T) + t,
                 **{name: value for name, value in how.items() if name != "scattered"}) for t in range(COUNT)]


RUNS: dict[str, tuple[Callable[[], list[Any]], Any, dict[str, Any]]] = {
    "default": (lambda: hills((12, 13)), 4.0, {}),
    "keys": (lambda: hills((12, 13)), 4.0, {"interval": 2, "precision": "signs"}),
    "baseline": (lambda: whole((12, 13)), [40.5, 30.5], {"profile": "baseline", "precision": "exact", "interval": 3}),
    "independent": (lambda: whole((12, 13)), [40.5, 30.5], {"order": "independent"}),
    "stepwise": (lambda: hills((12, 13)), 4.0, {"precision": [1, 0.25]}),
    "topology": (lambda: hills((12, 13)), 4.0, {"keep_topology": True, "precision": "step=0.1"}),
    "coarse": (lambda: hills((12, 13)), [4.0, 5.0], {"precision": 1.0}),
    "criterion": (lambda: hills((12, 13)), 4.0, {"layers": "curvature=20"}),
    "smooth": (lambda: hills((9, 9, 9)), 3.0, {"precision": "0.2 smooth"}),
    "searched": (rougher, 6.0, {"precision": 0.3}),
    "gone": (gone, 4.0, {}),
    "filled": (lambda: [Field(each.values, each.mask, missing="below") for each in gone()], 4.0, {}),
    "bool": (lambda: [each > 4 for each in hills((12, 13))], None, {}),
    "labels": (lambda: labels((1, 2, 3)), None, {}),
    "found labels": (lambda: labels("all"), None, {"precision": 0.4}),
    "placed": (placed, 4.0, {"precision": "0.3m", "metadata": {"by": "me"}}),
    "known mesh": (on_mesh, [20.5, 30.5], {"interval": 3}),
    "mesh levels": (lambda: on_mesh(progressive=True), 20.5, {"precision": "step=0.5"}),
    "stored mesh": (lambda: on_mesh(stored="whole"), 20.5, {}),
    "scattered": (lambda: on_mesh(scattered=True), 20.5, {"precision": "signs"}),
}
TIMES = [0.0, 0.5, 2.0, 3.0, 7.25]


@cache
def undisturbed(name: str) -> tuple[list[Any], tuple[bytes, ...], bytes]:
    """The frames, the bytes of each, and those of the end."""
    make, isovalue, options = RUNS[name]
    frames, encoder = make(), Encoder(isovalue, **options)
    return frames, tuple(map(encoder.add, frames, TIMES)), encoder.finish()


@looped("name", RUNS)
def test_the_bytes_are_those_of_an_undisturbed_run(name: str, tmp_path: Path):
    frames, pieces, end = undisturbed(name)
    data, path = b"".join(pieces) + end, tmp_path / "run.iso"
    for count in range(COUNT + 1):
        start = sum(map(len, pieces[:count]))
        size = len((*pieces, end)[count])
        for more in sorted({size - 1, size // 2, 1, *(range(0, size, 11) if HEAVY else ())}):
            path.write_bytes(data[: start + more])
            encoder = Encoder.resume(path, RUNS[name][1], **RUNS[name][2])
            assert encoder.frames == count and path.stat().st_size == start
        if count in (1, 4) or HEAVY:
            with path.open("ab") as file:
                for frame, moment in zip(frames[count:], TIMES[count:], strict=True):
                    file.write(encoder.add(frame, moment))
                file.write(encoder.finish())
            assert path.read_bytes() == data


def test_a_frame_without_its_mesh(tmp_path: Path):
    frames, pieces, _ = undisturbed("known mesh")
    path = tmp_path / "run.iso"
    path.write_bytes(b"".join(pieces[:2]))
    encoder = Encoder.resume(path, RUNS["known mesh"][1], interval=3)
    with pytest.raises(InputError, match="no mesh"):
        encoder.add(frames[2].values, TIMES[2])
    assert (encoder.add(frames[2], TIMES[2]), encoder.add(frames[3].values, TIMES[3])) == pieces[2:4]


def test_a_finished_file_goes_on(tmp_path: Path):
    frames, pieces, end = undisturbed("keys")
    path, (_, isovalue, options) = tmp_path / "run.iso", RUNS["keys"]
    encoder = Encoder(isovalue, **options)
    path.write_bytes(b"".join(map(encoder.add, frames[:3], TIMES)) + encoder.finish())
    encoder = Encoder.resume(path, isovalue, **options)
    assert path.read_bytes() + b"".join(map(encoder.add, frames[3:], TIMES[3:])) + encoder.finish() == (
        b"".join(pieces) + end)


MOVING = hills((40, 44), 40)
LEVEL = 12.0


def write(path: Path, sent: Any) -> None:
    """Write frames as they come, some bytes at a time, and report each that has been written.

    It waits between them, since nearly all of the time would pass within frames that are encoded.
    """
    encoder = Encoder.resume(path, LEVEL) if path.exists() else Encoder(LEVEL)
    with path.open("ab", buffering=0) as file:
        for number in range(encoder.frames, len(MOVING)):
            data = encoder.add(MOVING[number], number / 10)
            for at in range(0, len(data), 16):
                file.write(data[at : at + 16])
                time.sleep(0.004)
            sent.send(encoder.frames)
        file.write(encoder.finish())


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="needs fork")
@pytest.mark.skipif(INTERPRETED, reason="slow in Python, and the same")
@pytest.mark.parametrize("kills", [5, *heavy(200)])
def test_killed_at_random_moments(kills: int, tmp_path: Path):
    encoder = Encoder(LEVEL)
    started = time.monotonic()
    pieces = [encoder.add(frame, number / 10) for number, frame in enumerate(MOVING)]
    wanted = b"".join([*pieces, encoder.finish()])
    lasts = time.monotonic() - started + len(wanted) / 4000
    ends, moments, context = np.cumsum([*map(len, pieces)]), random.Random(), multiprocessing.get_context("fork")
    path, killed, halves = tmp_path / "run.iso", 0, 0
    while killed < kills:
        heard, sent = context.Pipe(duplex=False)
        writer = context.Process(target=write, args=(path, sent))
        writer.start()
        sent.close()
        writer.join(moments.uniform(0, lasts / 3))
        writer.kill()
        writer.join()
        written = 0
        while heard.poll():
            try:
                written = heard.recv()
            except EOFError:
                break
        data = path.read_bytes() if path.exists() else b""
        assert data == wanted[: len(data)] and (ends <= len(data)).sum() >= written
        if len(data) > 100:
            assert isocodec.open(data).frames == (ends <= len(data)).sum()
        killed += writer.exitcode != 0
        halves += len(data) not in (0, *ends)
        if writer.exitcode == 0:
            assert data == wanted
            path.unlink()
    assert 20 * halves >= kills or kills < 100
    if path.exists():
        heard, sent = context.Pipe(duplex=False)
        write(path, sent)
        assert path.read_bytes() == wanted


FIRST = hills((12, 13))


def started(path: Path, **options: Any) -> Encoder:
    encoder = Encoder(4.0, **options)
    path.write_bytes(encoder.add(FIRST[0], 0) + encoder.add(FIRST[1], 1))
    return encoder


@looped("isovalue, options, field, error", [
    (5.0, {}, FIRST[2], "begun with other"),
    ([4.0, 5.0], {}, FIRST[2], "begun with other"),
    (4.0, {"interval": 4}, FIRST[2], "begun with other"),
    (4.0, {"profile": "baseline"}, FIRST[2], "begun with other"),
    (4.0, {"precision": "step=0.5"}, FIRST[2], "begun with other"),
    (4.0, {}, FIRST[2][1:], "begun with other"),
    (4.0, {}, gone()[2], "begun with other"),
    (4.0, {}, placed()[2], "begun with other"),
    (4.0, {}, on_mesh()[0], "begun with other"),
    (4.0, {}, np.zeros(5), "axes"),
])
def test_other_frames_are_refused_and_right_ones_taken(
    isovalue: Any, options: Any, field: Any, error: str, tmp_path: Path
):
    path = tmp_path / "run.iso"
    right = started(path).add(FIRST[2], 2)
    encoder = Encoder.resume(path, isovalue, **options)
    with pytest.raises((InputError, OptionError), match=error):
        encoder.add(field, 2)
    if not options and isovalue == 4.0:
        with pytest.raises(InputError, match="time"):
            encoder.add(FIRST[2])
        assert encoder.add(FIRST[2], 2) == right


@looped("data, error", [
    (isocodec.encode(FIRST[0], 4.0), "frame by frame"), (isocodec.encode(FIRST[0], 4.0)[:-20], "frame by frame"),
    (isocodec.encode(isocodec.Frames(FIRST), 4.0), "frame by frame"),
    (isocodec.encode(isocodec.Frames(FIRST), 4.0)[:-30], "frame by frame"), (b"timestep 0\n", "not a file of iso"),
    (isocodec.encode(Mesh(*MESH, np.hypot(*MESH[0].T), stored="whole"), 20.5), "frame by frame"),
])
def test_other_files_are_left_alone(data: bytes, error: str, tmp_path: Path):
    path = tmp_path / "run.iso"
    path.write_bytes(data)
    with pytest.raises((OptionError, FormatError), match=error):
        Encoder.resume(path, 4.0)
    assert path.read_bytes() == data
    with pytest.raises(OSError):
        Encoder.resume(tmp_path / "none.iso", 4.0)


def test_damage_is_found(tmp_path: Path):
    """Of a file that is finished, by its checksum; nothing is changed then."""
    path = tmp_path / "run.iso"
    encoder = started(path)
    data = bytearray(path.read_bytes() + encoder.finish())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(FormatError):
        Encoder.resume(path, 4.0)
    assert path.read_bytes() == data


def test_frames_of_a_file_that_grows(tmp_path: Path):
    """`refreshed` reads what has been appended; each frame is drawn as in the whole file, from the key frame on."""
    _, pieces, end = undisturbed("keys")
    data, path = b"".join(pieces) + end, tmp_path / "run.iso"
    wanted = list(isocodec.open(data).each_frame())
    ends = np.cumsum([*map(len, pieces)])
    path.write_bytes(data[:60])
    file, seen = isocodec.open(path), 0
    for size in [*range(60, len(data), 37), len(data)]:
        path.write_bytes(data[:size])
        file = file.refreshed()
        assert file.size == size and file.frames == (ends <= size).sum() and file.complete == (size == len(data))
        for contours in file.each_frame(start=seen, partial=True):
            assert np.array_equal(contours[0].points, wanted[seen][0].points) and contours[0].complete
            assert contours[0].metadata["time"] == f"{TIMES[seen]:g}"
            seen += 1
        assert seen == file.frames
    assert file.refreshed() is file and seen == COUNT
    for start in range(COUNT + 2):
        found = [one.points for one, in file.each_frame(start=start)]
        assert len(found) == max(COUNT - start, 0)
        assert all(map(np.array_equal, found, [one.points for one, in wanted[start:]]))


def test_files_that_cannot_be_refreshed(tmp_path: Path):
    path = tmp_path / "run.iso"
    started(path)
    file = isocodec.open(path)
    path.write_bytes(b"\0" * 1000)
    with pytest.raises(InputError, match="not the one"):
        file.refreshed()
    path.write_bytes(b"")
    with pytest.raises(InputError, match="not the one"):
        file.refreshed()
    with pytest.raises(OptionError, match="path"):
        isocodec.open(file.data).refreshed()
    with pytest.raises(OptionError, match="start"):
        file.each_frame(start=-1)
