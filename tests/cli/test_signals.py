"""Signals end the command line at once: one line, an exit code as shells have it, and nothing left behind."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS
from isocodec.kernel.execution import SETTING
from tables import heavy

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")

ENDS = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "terminated"), signal.SIGHUP: (129, "terminated")}

SLOW_DISK = """
import atexit, os, sys, time
import isocodec.__main__ as program
def over():
    print("over", flush=True)
    time.sleep(0.4)
atexit.register(over)
flush = os.fsync
def slow(descriptor):
    print("writing", flush=True)
    time.sleep(0.4)
    flush(descriptor)
os.fsync = slow
print("ready", flush=True)
program.main()
"""


SLOW_READER = """
import pathlib, sys, time
import isocodec.__main__ as program
import isocodec.io.opener as reader
def slow(path, *_, **__):
    pathlib.Path(path).with_name("reading").touch()
    time.sleep(60)
reader._of_path = slow
program.main()
"""


class Command:
    """A command line in a process of its own, which says when it begins, and when it writes, to a disk that is slow."""

    def __init__(self, *arguments: object, **environment: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", SLOW_DISK, *map(str, arguments)], text=True, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                                         **environment},
        )
        self.wait_for("ready")

    def wait_for(self, word: str) -> None:
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == word + "\n"

    def ended_by(self, number: signal.Signals, after: float) -> bool:
        """Whether a signal that comes after so many seconds still ended it; it says so, or nothing."""
        time.sleep(after)
        self.process.send_signal(number)
        # LLVM, where it is at work, is waited for: some kernels take it a minute, and more on a busy machine
        _, said = self.process.communicate(timeout=600)
        code, word = ENDS[number]
        assert (self.process.returncode, said.splitlines()) in [(code, [f"isocodec: {word}"]), (0, [])]
        return self.process.returncode == code


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.save(tmp_path / "hills.npy", HILLS)
    (tmp_path / "out.iso").write_bytes(b"older")
    return tmp_path


def encode(folder: Path, **environment: str) -> Command:
    return Command("encode", folder / "hills.npy", "-o", folder / "out.iso", "--isovalue", 80.5, **environment)


def is_as_before(folder: Path) -> bool:
    found = {path.name: path for path in folder.iterdir()}
    return set(found) == {"hills.npy", "out.iso"} and found["out.iso"].read_bytes() == b"older"


@pytest.mark.parametrize("number", ENDS)
def test_while_a_library_reads(folder: Path, number: signal.Signals) -> None:
    """What libraries print then is kept from the terminal; what a signal says is not."""
    words = ["encode", folder / "hills.npy", "-o", folder / "out.iso", "--isovalue", "80.5"]
    child = subprocess.Popen([sys.executable, "-c", SLOW_READER, *map(str, words)], text=True, stderr=subprocess.PIPE,
                             env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    while not (folder / "reading").exists():
        assert child.poll() is None
        time.sleep(0.01)
    child.send_signal(number)
    code, word = ENDS[number]
    assert (child.communicate(timeout=60)[1], child.returncode) == (f"isocodec: {word}\n", code)


@pytest.mark.parametrize("number", [signal.SIGINT, *heavy(signal.SIGTERM, signal.SIGHUP)])
def test_while_the_output_is_written(folder: Path, number: signal.Signals) -> None:
    command = encode(folder)
    command.wait_for("writing")
    assert command.ended_by(number, random.uniform(0, 0.2))
    assert is_as_before(folder)


@pytest.mark.parametrize("trials", [3, pytest.param(300, marks=pytest.mark.heavy)])
def test_at_any_moment(folder: Path, trials: int) -> None:
    """While kernels are loaded, while it works, while it writes: the output is there, or what was there before."""
    whole = isocodec.encode(HILLS, 80.5)
    for _ in range(trials):
        number, after = random.choice(list(ENDS)), random.uniform(0.03, 2.5)
        ended = encode(folder).ended_by(number, after)
        if not is_as_before(folder):
            # a signal after the rename finds nothing to undo
            assert {path.name for path in folder.iterdir()} == {"hills.npy", "out.iso"}
            assert (folder / "out.iso").read_bytes() == whole
            (folder / "out.iso").write_bytes(b"older")
        else:
            assert ended


@pytest.mark.parametrize("number", [signal.SIGTERM, *heavy(signal.SIGINT, signal.SIGHUP)])
def test_too_late(folder: Path, number: signal.Signals) -> None:
    """What is done is not undone, nor said to have been ended, while Python shuts down."""
    command = encode(folder)
    said: list[str] = []
    assert command.process.stdout is not None
    while not said or said[-1] not in ("over\n", ""):
        said.append(command.process.stdout.readline())
    assert not command.ended_by(number, 0)
    assert (folder / "out.iso").read_bytes() == isocodec.encode(HILLS, 80.5)


@pytest.mark.heavy
@pytest.mark.parametrize("trials", [3, pytest.param(100, marks=pytest.mark.heavy)])
def test_while_kernels_are_compiled(folder: Path, trials: int) -> None:
    """The compiler is left where it is."""
    for number in random.choices(list(ENDS), k=trials):
        assert encode(folder, **{SETTING: "numba"}).ended_by(number, random.uniform(1, 6))
        assert is_as_before(folder)


def test_what_is_ignored_from_the_start_stays_so(folder: Path) -> None:
    """As under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        command = encode(folder)
    finally:
        signal.signal(signal.SIGHUP, before)
    command.wait_for("writing")
    assert not command.ended_by(signal.SIGHUP, 0)
    assert (folder / "out.iso").read_bytes() == isocodec.encode(HILLS, 80.5)


def test_the_library_leaves_signals_alone() -> None:
    numbers = list(ENDS)
    before = [signal.getsignal(number) for number in numbers]
    isocodec.decode(isocodec.encode(HILLS, 80.5))
    assert [signal.getsignal(number) for number in numbers] == before
