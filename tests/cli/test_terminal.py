"""What reaches the terminal of texts in files and of what libraries say: one clean line."""

from __future__ import annotations

import importlib
import logging
import os
import struct
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, fails, ok, process, run
from inputs import META, virtual
from isocodec.cli.report import one_warning
from isocodec.errors import InputError, one_line, plain
from libraries import Late

h5py = Late("h5py")
nibabel = Late("nibabel")
tifffile = Late("tifffile")

ODD = "a\x1b[31mred\x07\u202egnp\x9b2J\x7f"
"""Colours, a bell, text that runs backwards, and a cleared screen."""


def harmless(text: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in text)


def test_plain_text() -> None:
    assert plain("Zürich ▲ 100 %") == "Zürich ▲ 100 %"
    assert plain(ODD) == "a\\x1b[31mred\\x07\\u202egnp\\x9b2J\\x7f"
    assert plain("a\nb\tc", "\n") == "a\nb\\tc"
    assert one_line(" a \n b\x1b ") == "a b\\x1b" and len(one_line("x" * 999)) == 200


def test_names_of_arrays_are_cleaned(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{ODD: HILLS, "b": HILLS})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file[ODD] = HILLS
        file["b"] = HILLS
        virtual(file, "c" + ODD, "o" + ODD, "x")
    np.save(tmp_path / "r.npy", np.zeros((2, 2), [("a\x1b[31m", "u1")]))
    for name in ("a.npz", "a.h5"):
        for more in ((), ("--key", "none"), ("--key", "\x1b[32mnone")):
            line = fails(3, "encode", tmp_path / name, "-o", tmp_path / "o.iso", "--isovalue", 1, *more)
            assert harmless(line) and "\\x1b[31mred\\x07\\u202egnp" in line
    line = fails(3, "encode", tmp_path / "a.h5", "--key", "c" + ODD, "-o", tmp_path / "o.iso", "--isovalue", 1)
    assert harmless(line) and "oa\\x1b[31m" in line
    line = fails(3, "encode", tmp_path / "r.npy", "-o", tmp_path / "o.iso", "--isovalue", 1)
    assert harmless(line) and "a\\x1b[31m" in line
    (tmp_path / "v.mhd").write_bytes(META + b"ElementDataFile = /\x1b[31m\n")
    assert harmless(fails(3, "encode", tmp_path / "v.mhd", "-o", tmp_path / "o.iso", "--isovalue", 1))
    # without the command line, too
    for name in ("a.npz", "a.h5"):
        for key in (None, "\x1b[32mnone"):
            with pytest.raises(InputError) as caught:
                isocodec.read(tmp_path / name, key=key)
            assert harmless(str(caught.value))


def test_names_of_files_are_cleaned(tmp_path: Path) -> None:
    source, out = tmp_path / f"{ODD}.npy", tmp_path / f"{ODD}.iso"
    np.save(source, HILLS)
    result = run("encode", source, "-o", out, "--isovalue", 80)
    assert result.exit_code == 0 and harmless(result.stdout) and harmless(result.stderr)
    assert "\\x1b[31m" in result.stdout and "\\x1b[31m" in result.stderr
    for command in (("info", out), ("decode", out, "-o", tmp_path / f"{ODD}.npz"), ("info", tmp_path / f"{ODD}2")):
        result = run(*command)
        assert harmless(result.output) and "x1b[31m" in result.output.replace("\n", "")
    assert harmless(fails(2, "encode", source, "-o", out, "--isovalue", 1, "--spacing", ODD))


def test_tracebacks_are_cleaned(curve: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError(ODD)

    monkeypatch.setattr("isocodec.api.opening.open", broken)
    monkeypatch.setenv("ISOCODEC_DEBUG", "1")
    shown = run("info", curve).stderr
    assert "Traceback" in shown and shown.count("\n") > 3 and shown.count("\\x1b[31mred") == 2 and harmless(shown)


def test_notes_are_cleaned(tmp_path: Path) -> None:
    (tmp_path / "a.iso").write_bytes(isocodec.encode(HILLS, 80.5, metadata={ODD: ODD + "\n[bold]"}))
    shown = ok("info", tmp_path / "a.iso")
    assert harmless(shown) and "\\x1b[31mred" in shown and "[bold]" in shown
    assert "\\u001b[31mred" in ok("info", tmp_path / "a.iso", "--json")


def test_what_libraries_say_is_one_warning(capfd: pytest.CaptureFixture[str]) -> None:
    """Whichever way they say it: warnings, logs of their own handlers, prints, and prints past Python."""
    logger = logging.getLogger("some.library")
    mine = logging.StreamHandler()
    logger.addHandler(mine)
    before = [*logging.root.handlers]
    with one_warning(Path("a.tif")):
        for _ in range(3):
            os.write(2, b"raw \x1b[31m\n")
            warnings.warn("warned", UserWarning, stacklevel=1)
            logger.warning("logged\n%s", "twice")
            logger.info("not this")
            print("printed")
    out, err = capfd.readouterr()
    assert out == ""
    assert err == "isocodec: a.tif: warning: messages while reading: warned; logged twice; printed, and 1 more\n"
    assert logger.handlers == [mine] and logging.root.handlers == before
    os.write(1, b"back\n")
    with pytest.raises(InputError), one_warning(Path("a.tif")):
        os.write(1, b"raw")
        raise InputError("no")
    os.write(2, b"again\n")
    assert capfd.readouterr() == ("back\n", "again\n")
    logger.removeHandler(mine)


@pytest.mark.heavy  # processes, so that what is printed past Python is heard
def test_libraries_are_heard_in_one_line(tmp_path: Path) -> None:
    """Real ones: a tag that tifffile logs, three times over, an extension that nibabel warns of, ITK's own prints."""
    tifffile.imwrite(tmp_path / "a.tif", HILLS, extratags=[(42113, "s", 0, "none", False)])
    image = nibabel.Nifti1Image(np.stack([HILLS] * 3), np.eye(4))
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension("comment", b"x" * 8))
    data = bytearray(image.to_bytes())
    data[352:356] = struct.pack("<i", 12)
    (tmp_path / "a.nii").write_bytes(data)
    for name in ("a.tif", "a.nii"):
        done = process("encode", tmp_path / name, "-o", tmp_path / "o.iso", "--isovalue", 80.5)
        lines = done.stderr.splitlines()
        assert done.returncode == 0, done
        assert all(line.startswith(f"isocodec: {tmp_path / name}: warning: ") for line in lines), lines
        assert len(lines) <= 1, lines
    (tmp_path / "v.mha").write_bytes(
        META.replace(b"MET_UCHAR", b"MET_NOTHING") + b"ElementDataFile = LOCAL\n" + bytes(24)
    )
    done = process("encode", tmp_path / "v.mha", "-o", tmp_path / "o.iso", "--isovalue", 80.5)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (3, "", 1), done


@pytest.mark.heavy  # a process that loads all writers
def test_writers_are_heard_in_one_line(tmp_path: Path) -> None:
    """Real ones: pyogrio warns of files without a reference system, matplotlib of signs that a font lacks."""
    (tmp_path / "in.iso").write_bytes(isocodec.encode(HILLS, [80.5, 120.5]))
    isocodec.save(tmp_path / "tiled.iso", HILLS, 80.5, tile=32)
    maps = [(".gpkg", "lines"), (".fgb", "lines"), (".shp", "lines"), (".parquet", "lines"), (".gpkg", "bands")]
    commands = [
        ["decode", "in.iso", "-o", f"a{suffix}", *(["--what", "bands"] if side == "bands" else [])]
        for suffix, side in maps
    ] + [["decode", "tiled.iso", "-o", "t.gpkg"], ["plot", "--map", "in.iso", "-o", "m.png", "--title", "\u6f22"]]
    program = f"from isocodec.cli import main\nfor one in {commands!r}: main(one, standalone_mode=False)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, cwd=tmp_path, check=True
    )
    *lines, last = done.stderr.splitlines()
    assert len(lines) == len(maps) + 1, done.stderr
    for line, suffix in zip(lines, [*(suffix for suffix, _ in maps), ".gpkg"], strict=True):
        assert line.startswith("isocodec: ") and f"{suffix} is written without a reference system" in line
    assert last.startswith("isocodec: m.png: warning: messages while writing: Glyph 28450")


WRITERS = {
    "isocodec.io.formats.beside": ("decode", "c.iso", "-o", "o.npz"),
    "isocodec.io.surfaces.single": ("decode", "c.iso", "-o", "o.ply", "--what", "mesh"),
    "isocodec.api.plots.panels_picture": ("plot", "c.iso", "-o", "o.png"),
    "isocodec.api.plots.map_figure": ("plot", "--map", "c.iso", "-o", "o.png"),
    "isocodec.io.masks.volume_matrix": ("decode", "--what", "above", "v.iso", "-o", "o.nii"),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_each_command_hears_its_writers(
    tmp_path: Path, writer: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """What one prints past Python, too."""
    module, _, name = writer.rpartition(".")
    real: Callable[..., Any] = getattr(importlib.import_module(module), name)

    def noisy(*arguments: Any, **options: Any) -> Any:
        os.write(2, b"raw\n")
        return real(*arguments, **options)

    monkeypatch.setattr(writer, noisy)
    monkeypatch.chdir(tmp_path)
    Path("c.iso").write_bytes(isocodec.encode(HILLS, 80.5))
    Path("v.iso").write_bytes(isocodec.encode(BALL, 40.5))
    result = run(*WRITERS[writer])
    assert result.exit_code == 0, result.output
    (line,) = result.stderr.splitlines()
    out = WRITERS[writer][WRITERS[writer].index("-o") + 1]
    assert line == f"isocodec: {out}: warning: messages while writing: raw"
    assert capfd.readouterr() == ("", "")
