"""Faults while fields are encoded in tiles, and while windows are read from servers: gone on with, or refused."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from tiled import encoded, hilly

pytestmark = pytest.mark.skipif(INTERPRETED, reason="processes of their own would be slow")


def children_of(process: int) -> list[int]:
    """Processes that one has begun."""
    try:
        text = Path(f"/proc/{process}/task/{process}/children").read_text()
    except OSError:
        return []
    return [int(number) for number in text.split()]


def command_of(path: Path, out: Path, workers: int) -> list[str]:
    return [
        sys.executable, "-m", "isocodec", "encode", str(path), "-o", str(out), "--isovalue", "30.5", "--tile", "64",
        "--workers", str(workers),
    ]


FOLLOWED = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs to know who has begun whom")


def gone(processes: list[int], patience: float = 30) -> bool:
    """Whether processes end within so many seconds."""
    deadline = time.monotonic() + patience
    while any(Path(f"/proc/{each}").exists() for each in processes) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not any(Path(f"/proc/{each}").exists() for each in processes)


@FOLLOWED
def test_workers_end_with_who_began_them(tmp_path: Path) -> None:
    np.save(tmp_path / "f.npy", np.tile(hilly((512, 512)), (3, 3)))
    child = subprocess.Popen(command_of(tmp_path / "f.npy", tmp_path / "a.iso", 2), stderr=subprocess.DEVNULL)
    while len(workers := children_of(child.pid)) < 3 and child.poll() is None:
        time.sleep(0.01)
    time.sleep(0.5)
    child.kill()
    child.wait()
    assert len(workers) == 3 and gone(workers)


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No process may write files larger than so much: what was encoded is kept, the command says so and goes on."""
    field = np.tile(hilly((256, 256)), (1, 2))
    np.save(tmp_path / "f.npy", field)
    wanted = encoded(tmp_path, field, 30.5, tile=64)
    out = tmp_path / "full.iso"
    command = command_of(tmp_path / "f.npy", out, 1)

    def small(size: int) -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    # room for half of the tiles; for all of them, but not for the directories beside
    for size in (len(wanted) // 2, len(wanted) - 200):
        ended = subprocess.run(command, preexec_fn=lambda size=size: small(size), capture_output=True, text=True)
        assert ended.returncode == 3, ended.stderr
        assert "too large" in ended.stderr and "Traceback" not in ended.stderr
        # not the input
        assert ended.stderr.startswith(f"isocodec: {out}") and "f.npy" not in ended.stderr
        assert not out.exists() and (tmp_path / "full.iso.tiles").is_dir()
        assert not list(tmp_path.glob(".*.part"))
    subprocess.run(command, check=True)
    assert out.read_bytes() == wanted and not (tmp_path / "full.iso.tiles").exists()


def test_no_room_at_any_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in: the disk is full at the k-th write of the spool, having taken half of it; then it goes on."""
    field = hilly()
    wanted = encoded(tmp_path, field, 30.5)
    out = tmp_path / "again.iso"
    from isocodec.tiles import spool

    class Full:
        def __init__(self, file: Any, left: list[int]) -> None:
            self._file, self._left = file, left

        def write(self, data: bytes) -> int:
            self._left[0] -= 1
            if self._left[0] == 0:
                self._file.write(data[: len(data) // 2])
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return int(self._file.write(data))

        def __getattr__(self, name: str) -> Any:
            return getattr(self._file, name)

    whole = spool._open
    for k in (1, 2, 3, 4, 9, 14):
        left = [k]
        monkeypatch.setattr(spool, "_open", lambda path, left=left: Full(whole(path), left))
        with pytest.raises(OSError, match="No space left"):
            isocodec.save(out, field, 30.5, tile=32)
        assert not out.exists()
    monkeypatch.setattr(spool, "_open", whole)
    isocodec.save(out, field, 30.5, tile=32)
    assert out.read_bytes() == wanted
