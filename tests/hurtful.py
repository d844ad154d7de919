"""Files that ask for much time or memory, mutants of others, and what a decoder takes for them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np

import isocodec
from isocodec.format.header import Header, write_header
from isoconform.damage import damaged, torn
from isoconform.streams import Chunk, File
from isospec.container import ChunkType, DomainKind, Profile, write_varint, zigzag

SECONDS, BYTES = 10.0, 128 << 20
"""What a small file may take at most, with the limits by default."""
GRID = write_header(Header((17, 17), 5.5))


def stated_mesh(kind: DomainKind, n: int, run: bytes, extent: int = 4096) -> bytes:
    """A mesh in the file of as many vertices and cells as the bytes of its run allow, nearly."""
    size = len(run)
    numbers = write_varint(100 * size) + write_varint(400 * size) + write_varint(1)
    payload = bytes([kind << 4]) + b"\0" + numbers + b"\0" * n + write_varint(extent) * n + run
    head = write_header(Header((), 5.5, None, Profile.MAIN, cells=n))
    return bytes(File(head, (Chunk(ChunkType.DOMAIN, payload),)))


def isovalues(count: int, first: int = 10) -> list[Chunk]:
    """Chunks of further isovalues, each of which leans on the one before."""
    return [Chunk(ChunkType.ISOVALUE, b"\1" + write_varint(zigzag(2 * v + 1))) for v in range(first, first + count)]


def empty_series(count: int, frames: int, profile: Profile) -> bytes:
    """A series of many isovalues without layers."""
    head = write_header(Header((17, 17), 5.5, None, profile))
    further = [Chunk(ChunkType.FRAME, b"")] * (count * (frames - 1))
    return bytes(File(head, (*isovalues(count - 1), Chunk(ChunkType.SERIES, b"\0"), *further)))


def decoded(data: bytes) -> None:
    """Decode a file and draw all of its isovalues; errors of the codec are no fault."""
    decoder = isocodec.Decoder()
    try:
        decoder.feed(data)
        for _ in decoder:
            pass
        for number in range(len(decoder.isovalues)):
            decoder.contour(number, isovalue=0.5)
    except isocodec.IsoError:
        pass


def status(name: str) -> int:
    """Bytes of this process, from what Linux knows of it."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(name)).split()[1]) << 10


def measured(what: Callable[[], object]) -> tuple[float, int]:
    """Seconds of CPU that a call takes, and how many bytes of memory more than there were before, at most."""
    Path("/proc/self/clear_refs").write_text("5")
    before, began = status("VmRSS"), time.process_time()
    what()
    return time.process_time() - began, status("VmHWM") - before


# --- mutants ----------------------------------------------------------------------------------------------------------


def mutant(data: bytes, random: Random) -> bytes:
    """A file with bytes of a chunk changed, put in or taken out, or damaged otherwise; checksums are right."""
    file = torn(data)
    if file is None or random.randrange(4) == 0:
        return damaged(data, random)
    place = random.randrange(len(file.chunks))
    payload = bytearray(file.chunks[place].payload)
    for _ in range(random.randint(1, 3)):
        at = random.randint(0, min(len(payload), random.choice((8, len(payload)))))
        match random.randrange(3):
            case 0:
                payload[at : at + 1] = random.randbytes(1)
            case 1:
                payload[at:at] = random.choice((random.randbytes(random.randint(1, 40)), b"\xff" * 40, bytes(40)))
            case _:
                del payload[at : at + random.randint(1, 4)]
    chunk = replace(file.chunks[place], payload=bytes(payload))
    return bytes(replace(file, chunks=(*file.chunks[:place], chunk, *file.chunks[place + 1 :])))


def _points(count: int, d: int) -> np.ndarray:
    return np.random.default_rng(count).integers(0, 300, (count, d)).astype(float)


def _coded() -> list[bytes]:
    from scipy.spatial import Delaunay

    out = []
    for d, count in ((2, 200), (3, 80)):
        points = np.unique(_points(count, d), axis=0)
        values = np.rint(points.sum(axis=1)).astype(int)
        mesh = isocodec.Mesh(points, Delaunay(points).simplices, values, stored="whole")
        out += [isocodec.encode(mesh, [200, 280], precision=precision) for precision in ("signs", "exact")]
    flat = np.unique(_points(200, 2), axis=0)
    scattered = isocodec.Mesh(flat, None, np.rint(flat.sum(axis=1)).astype(int), stored="whole")
    return [*out, isocodec.encode(scattered, [200, 280], precision="exact")]


def _field(shape: tuple[int, ...], turn: float = 0.0) -> np.ndarray:
    axes = np.indices(shape)
    return np.rint(60 * np.sin(axes[0] / 5 + turn) * np.cos(axes[-1] / 4) + 4 * axes[-1]).astype(int)


def _series() -> list[bytes]:
    frames = isocodec.Frames([_field((33, 40), turn) for turn in (0.0, 0.3, 0.6)])
    return [
        isocodec.encode(frames, levels, precision=precision, profile=profile)
        for profile in ("baseline", "main") for levels, precision in (([5], "exact"), ([5, 40], "signs"))
    ]


def _isovalues() -> list[bytes]:
    levels = [-20, 5, 30, 55, 80]
    return [
        isocodec.encode(_field(shape), levels, precision=precision, order=order, profile=profile)
        for shape, order, profile in (
            ((33, 40), "isovalues", "main"), ((33, 40), "levels", "main"), ((9, 10, 11), "independent", "baseline"),
        )
        for precision in ("signs", "exact")
    ]


BASES: dict[str, Callable[[], list[bytes]]] = {"coded": _coded, "series": _series, "isovalues": _isovalues}
"""Files that mutants are made of, by what they have."""


def mutants(name: str, count: int, seed: int = 0) -> Iterator[bytes]:
    """Mutants of files of a kind."""
    files = BASES[name]()
    for number in range(count):
        yield mutant(files[number % len(files)], Random(f"{name} {seed} {number}"))
