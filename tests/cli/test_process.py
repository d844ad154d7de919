"""The command as a process: standard streams that are closed, threads, archives; and what `open` returns in ``with``.

The table of closed streams is over the command line's own verbs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS
from isocodec import __main__ as program
from isocodec.cli import main

ARGUMENTS = {
    "encode": ["h.npy", "-o", "out.iso", "--isovalue", "80.5"], "decode": ["h.iso", "-o", "out.npz"],
    "edit": ["h.iso", "-o", "out.iso", "--layers", "1"], "info": ["h.iso"], "verify": ["h.iso", "h.npy"],
    "plot": ["h.iso", "-o", "out.svg", "--steps", "1"], "thin": ["h.npy", "-o", "out.npz", "--points", "20"],
    "plugins": [],
}
STREAMS = {"stdin": 0, "stdout": 1, "stderr": 2}
FORKS = """
import importlib, json, os, pkgutil, sys
import isocodec, isocodec.api, isocodec.__main__ as program
from isocodec.cli import main
for module in pkgutil.iter_modules(isocodec.api.__path__, "isocodec.api."):
    importlib.import_module(module.name)
[*main.commands.values()]
isocodec.decode(isocodec.encode([[0, 1, 0], [1, 2, 1], [0, 1, 0]], 0.5))
runs, ends = json.loads(sys.argv[1]), {}
for name, number, words in runs:
    heard, said = os.pipe()
    child = os.fork()
    if not child:
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, 1)
        os.dup2(said, 1 if number == 2 else 2)
        # as Python begins where the descriptor is closed
        os.close(number)
        setattr(sys, ("stdin", "stdout", "stderr")[number], None)
        sys.argv[:] = ["isocodec", *words]
        code = 0
        try:
            program.main()
        except SystemExit as end:
            code = end.code or 0
        os._exit(code)
    os.close(said)
    with open(heard, errors="replace") as lines:
        text = lines.read()
    ends[name] = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), text]
print(json.dumps(ends))
"""
"""One process, which forks one for each run: what they import is there already."""


def test_every_verb_is_in_the_table() -> None:
    """But serve, which runs until it is interrupted."""
    assert {*ARGUMENTS, "serve"} == set(main.commands)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_each_verb_with_each_stream_closed(tmp_path: Path) -> None:
    """Results are written without one that is not needed; one that is needed is named, with exit code 3."""
    runs = []
    for verb, words in ARGUMENTS.items():
        for stream, number in STREAMS.items():
            folder = tmp_path / f"{verb}-{stream}"
            folder.mkdir()
            np.save(folder / "h.npy", HILLS)
            isocodec.save(folder / "h.iso", HILLS, 80.5)
            given = [str(folder / word) if "." in word and word != "80.5" else word for word in words]
            runs.append([folder.name, number, [verb, *given]])
            if stream == "stdin" and given:
                runs.append([f"{folder.name} needed", number, [verb, "-", *given[1:]]])
            if stream == "stdout" and "-o" in given and verb != "thin":
                to = ["--to", "npz"] if verb == "decode" else []
                piped = ["-" if word.startswith(f"{folder / 'out.'}") else word for word in given]
                runs.append([f"{folder.name} needed", number, [verb, *piped, *to]])
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKS, json.dumps(runs)], capture_output=True,
                          text=True, timeout=300)
    ends = json.loads(done.stdout)
    assert set(ends) == {name for name, _, _ in runs}
    for name, (code, said) in ends.items():
        verb, stream = name.split()[0].split("-")
        if name.endswith("needed") and (verb, stream) != ("plot", "stdout"):
            wanted = "input" if stream == "stdin" else "output"
            assert (code, f"standard {wanted} is closed" in said, said.count("\n")) == (3, True, 1), (name, said)
        elif not name.endswith("needed"):
            assert code == 0 and "internal" not in said, (name, said)
            written = [path for path in (tmp_path / name).glob("out.*") if path.stat().st_size]
            assert len(written) == ("-o" in ARGUMENTS[verb]), name


def test_in_a_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Handlers of signals are those of the main thread, and stay as they are."""
    np.save(tmp_path / "h.npy", HILLS)
    ends: list[object] = []

    def run() -> None:
        try:
            program.main()
        except SystemExit as end:
            ends.append(end.code)

    monkeypatch.setattr(sys, "argv", ["isocodec", "encode", str(tmp_path / "h.npy"), "-o", str(tmp_path / "h.iso"),
                                      "--isovalue", "80.5"])
    thread = threading.Thread(target=run)
    thread.start()
    thread.join(120)
    assert ends == [0] and isocodec.open(tmp_path / "h.iso").isovalues == (80.5,)


@pytest.mark.parametrize("tile", [None, 32])
def test_with(tmp_path: Path, tile: int | None) -> None:
    """An open file in a ``with`` statement is the file, and can be used behind it: nothing is held open."""
    isocodec.save(tmp_path / "h.iso", HILLS, 80.5, tile=tile)
    with isocodec.open(tmp_path / "h.iso") as file:
        within = file.contour()
    assert np.array_equal(file.contour().points, within.points) and len(within.points)
