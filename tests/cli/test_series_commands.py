"""Series of frames on the command line: which frame a command takes, and that it says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import fails, ok, run
from isocodec.errors import InputError

ROWS, COLUMNS = np.mgrid[:24, :30]
MOVING = np.stack([np.hypot(ROWS - 11.3, COLUMNS - 12.2 - 2 * t) for t in range(4)])
SAID = "isocodec: s.iso: warning: only frame 0 of 4 is {}; choose another with --frame, from 1 to 3"


@pytest.fixture
def series(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """A file s.iso of the field s.npy, in the working directory."""
    monkeypatch.chdir(tmp_path)
    data = isocodec.encode(isocodec.Frames(MOVING), 7.5, precision=0.02)
    Path("s.iso").write_bytes(data)
    np.save("s.npy", MOVING)
    return data


@pytest.mark.parametrize(
    ("command", "verb"),
    [
        (["decode", "s.iso", "-o", "o.npz"], "decoded"),
        (["decode", "s.iso", "-o", "o.svg", "--smooth"], "decoded"),
        (["decode", "s.iso", "-o", "o.vtu", "--what", "mesh"], "decoded"),
        (["decode", "--what", "above", "s.iso", "-o", "o.npy"], "decoded"),
        (["plot", "s.iso", "-o", "o.png"], "drawn"),
        (["plot", "--map", "s.iso", "-o", "o.png"], "drawn"),
    ],
)
def test_the_first_frame_is_said(series: bytes, command: list[str], verb: str) -> None:
    """One line where no frame was asked for, none where one was."""
    result = run(*command)
    assert result.exit_code == 0, result.output
    (line,) = result.stderr.splitlines()
    assert line == SAID.format(verb)
    out = Path(command[command.index("-o") + 1])
    first = out.read_bytes()
    asked = run(*command, "--frame", 0)
    assert asked.exit_code == 0 and not asked.stderr
    if out.suffix != ".npz":  # which holds the time of its making
        assert out.read_bytes() == first
    assert not run(*command, "--frame", 2).stderr


def test_what_is_cut_counts_what_begins(series: bytes) -> None:
    start = isocodec.open(series).info.frames[2].offset
    Path("s.iso").write_bytes(series[: start + 8])
    result = run("decode", "s.iso", "-o", "o.npz", "--partial")
    assert result.exit_code == 0 and "only frame 0 of" in result.stderr
    result = run("decode", "s.iso", "-o", "o.npz", "--partial", "--frame", 1)
    assert result.exit_code == 0 and "only frame" not in result.stderr


def test_each_frame_is_verified_by_its_own(series: bytes) -> None:
    """Frames that are wrong for one another are found to be."""
    for number in range(4):
        (found,) = isocodec.open(series).verify(MOVING[number], frame=number, within=0.02)
        assert found.kept and found.wrong == 0
        assert ": kept;" in ok("verify", "s.iso", "s.npy", "--frame", number)
    (found,) = isocodec.open(series).verify(MOVING[2], frame=1)
    assert not found.kept and found.wrong == ((MOVING[1] > 7.5) != (MOVING[2] > 7.5)).sum()
    with pytest.raises(InputError, match="each frame"):
        isocodec.open(series).verify(MOVING)
    assert "choose a frame" in fails(3, "verify", "s.iso", "s.npy")
    np.save("last.npy", MOVING[0])
    Path("plain.iso").write_bytes(isocodec.encode(MOVING[3], 7.5))
    assert "0 wrong signs" in ok("verify", "plain.iso", "s.npy", "--frame", 3)
