"""Keep encoded tiles in a folder, so that nothing is lost when a run ends early: their bytes, and a journal."""

from __future__ import annotations

import json
import os
import shutil
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..errors import InputError, OptionError
from .assembly import Tiles
from .layout import Index
from .tile_encoder import TileSegments, Tiling

if TYPE_CHECKING:
    from typing import Self

_PIECE = 1 << 22
_BYTES, _JOURNAL = "segments", "journal"


class Spool:
    """A folder, made if need be, with those tiles of a file that have been encoded.

    ``segments`` has the bytes of tiles one after the other. ``journal`` has a line of JSON that describes the field and
    the options, and a record of fixed size for each tile, written after the tile's bytes. Bytes after the last complete
    record are overwritten. Raises `OptionError` if the folder has tiles of a different field or with different options,
    or another process uses it.
    """

    def __init__(self, folder: str | os.PathLike[str], tiling: Tiling) -> None:
        self.folder = Path(folder)
        self.tiles = Tiles(tiling)
        self._record = _record_of(self.tiles)
        self._about = about(tiling)
        self.folder.mkdir(exist_ok=True)
        self._journal = _open(self.folder / _JOURNAL)
        self._bytes = _open(self.folder / _BYTES)
        # a separate handle, so that writing always happens at the end
        self._reader = (self.folder / _BYTES).open("rb", buffering=0)
        try:
            _lock(self._journal, self.folder)
            self._resume()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the files, keeping the folder."""
        with self._named():
            self._journal.close()
            self._bytes.close()
            self._reader.close()

    def remove(self) -> None:
        """Remove the folder, whose contents are no longer needed."""
        self.close()
        shutil.rmtree(self.folder)

    def _resume(self) -> None:
        """Load the tiles that have been encoded before."""
        first = self._journal.readline()
        if first and first.endswith(b"\n") and first != self._about:
            raise OptionError(
                f"{self.folder} has tiles of a different field, or tiles encoded with different options", code="spool",
                remedy="remove it, or choose another folder",
            )
        end = 0
        if first != self._about:
            self._journal.seek(0)
            self._journal.truncate()
            self._journal.write(self._about)
        else:
            end = self._take(self._journal.read())
        self._bytes.seek(end)
        self._bytes.truncate()

    def _take(self, data: bytes) -> int:
        """Load complete records whose tiles are undamaged; returns where the last one ends."""
        size = self._record.itemsize
        records = np.frombuffer(data[: len(data) // size * size], self._record)
        good, end = 0, 0
        held = os.fstat(self._bytes.fileno()).st_size
        for record in records:
            own = record.tobytes()
            length = int(record["lengths"].sum())
            if zlib.crc32(own[:-4]) != int(record["check"]) or int(record["place"]) + length > held:
                break
            if zlib.crc32(b"".join(self._pieces(int(record["place"]), length))) == int(record["sum"]):
                self._note(record)
            good, end = good + 1, max(end, int(record["place"]) + length)
        self._journal.seek(len(self._about) + good * size)
        self._journal.truncate()
        return end

    def _note(self, record: Any) -> None:
        at = tuple(record["index"].tolist())
        for name in ("kinds", "lengths", "faces", "counts", "place"):
            getattr(self.tiles, name)[(..., *at)] = record[name]

    def add(self, tile: TileSegments) -> None:
        """Store a tile; raises `OSError` if the disk is full, and tiles stored before are kept."""
        segments = [tile.mask_segment, *(segment for stages in tile.segments for segment in stages)]
        data = b"".join(segments)
        place = self._bytes.tell()
        record = np.zeros((), self._record)
        record["index"], record["place"], record["sum"] = tile.index, place, zlib.crc32(data)
        record["kinds"] = [tile.mask, *tile.kinds]
        record["lengths"] = [len(segment) for segment in segments]
        record["faces"], record["counts"] = tile.faces, tile.counts
        record["check"] = zlib.crc32(record.tobytes()[:-4])
        before = self._journal.tell()
        with self._named():
            try:
                self._bytes.write(data)
                self._bytes.flush()
                self._journal.write(record.tobytes())
                self._journal.flush()
            except OSError:
                # an incomplete part of either is overwritten when the run is resumed
                for file, end in ((self._bytes, place), (self._journal, before)):
                    file.seek(end)
                    file.truncate()
                raise
        self._note(record)

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Name the folder in errors of writing, which know of no file."""
        try:
            yield
        except OSError as exc:
            raise OSError(exc.errno, exc.strerror or str(exc), str(self.folder)) from exc

    def read(self, place: int, length: int) -> bytes:
        """Read the bytes of tiles."""
        data = b"".join(self._pieces(place, length))
        if len(data) != length:
            raise InputError(f"{self.folder / _BYTES} has become shorter", code="spool", remedy="encode again")
        return data

    def _pieces(self, place: int, length: int) -> Iterator[bytes]:
        self._reader.seek(place)
        while length > 0 and (piece := self._reader.read(min(length, _PIECE))):
            length -= len(piece)
            yield piece

    def done(self, index: Index) -> bool:
        """Whether a tile is stored."""
        return bool(self.tiles.place[index] >= 0)


def _record_of(tiles: Tiles) -> np.dtype[Any]:
    n = tiles.tiling.grid.n
    return np.dtype(
        [
            ("index", "<i8", (n,)), ("place", "<i8"), ("sum", "<u4"), ("kinds", "u1", (len(tiles.kinds),)),
            ("lengths", "<u4", (len(tiles.lengths),)), ("faces", "<u4", (n, 2)),
            ("counts", "<f8", (len(tiles.counts),)), ("check", "<u4"),
        ]
    )


def about(tiling: Tiling) -> bytes:
    """The first line of a journal: the shape and type of the field, and all options."""
    return json.dumps({
        "shape": tiling.grid.shape, "tile": 1 << tiling.grid.exponent, "isovalues": tiling.isovalues,
        **asdict(tiling.options), "dtype": tiling.dtype, "cubes": tiling.cubes, "fill": tiling.fill, "version": 2,
        **({"of_labels": True} if tiling.of_labels else {}),
    }, sort_keys=True).encode() + b"\n"


def begun(folder: str | os.PathLike[str], tried: Sequence[Tiling]) -> int:
    """Number of the tiling, of several, that a folder has tiles for; 0 for none."""
    journal = Path(folder) / _JOURNAL
    if not journal.is_file():
        return 0
    with journal.open("rb") as file:
        first = file.readline()
    lines = [about(each) for each in tried]
    return lines.index(first) if first in lines else 0


def _open(path: Path) -> BinaryIO:
    """Open a file for reading and writing, creating it if it is missing."""
    return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666), "r+b")


def _lock(file: BinaryIO, folder: Path) -> None:
    """Lock the folder against other processes, if the system can."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise OptionError(
            f"another process is working in {folder}", code="spool", remedy="wait until it ends, or stop it"
        ) from None
