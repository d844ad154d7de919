"""Faults while fields are encoded in tiles, and while windows are read from servers: gone on with, or refused."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from tiled import encoded, hilly

pytestmark = pytest.mark.skipif(INTERPRETED, reason="processes of their own would be slow")


def command_of(path: Path, out: Path, threads: int) -> list[str]:
    return [
        sys.executable, "-m", "isocodec", "encode", str(path), "-o", str(out), "--isovalue", "30.5", "--tile", "64",
        "--threads", str(threads),
    ]


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
