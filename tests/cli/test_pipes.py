"""Standard input and output of the command line, and URLs: a pipe does what files do."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok
from home import ROOT


def piped(data: bytes, *arguments: str, cwd: Path | None = None) -> tuple[bytes, str]:
    done = subprocess.run([sys.executable, "-m", "isocodec", *arguments], input=data, capture_output=True, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr.decode()


def test_a_field_in_and_a_file_out(tmp_path: Path) -> None:
    """The line for people goes to the error stream, and the first bytes tell the format."""
    np.save(tmp_path / "hills.npy", HILLS)
    stored = (tmp_path / "hills.npy").read_bytes()
    encoded, said = piped(stored, "encode", "-", "-o", "-", "--isovalue", "80.5", "--precision", "exact")
    assert encoded == isocodec.encode(HILLS, 80.5, precision="exact") and "bytes" in said
    raw, _ = piped(encoded, "decode", "-", "-o", "-", "--to", "geojson")
    (tmp_path / "a.iso").write_bytes(encoded)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.geojson")
    assert raw == (tmp_path / "a.geojson").read_bytes()
    told, _ = piped(encoded, "info", "-", "--json")
    assert json.loads(told)["shape"] == list(HILLS.shape)


def test_meshes_and_surfaces(tmp_path: Path) -> None:
    """Told apart by what comes, however long the notes before it are."""
    points, cells = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]), [[0, 1, 2], [1, 3, 2]]
    mesh = isocodec.encode(
        isocodec.Mesh(points, cells, [0, 1, 1, 2], stored="coded"), 0.5, metadata={"note": "x" * 5000},
    )
    surface = isocodec.encode(isocodec.thin(HILLS, error=4, metadata={"note": "x" * 5000}))
    for name, data, kind, word in (("mesh", mesh, "geojson", "LineString"), ("surface", surface, "ply", "ply")):
        raw, _ = piped(data, "decode", "-", "-o", "-", "--to", kind)
        (tmp_path / f"{name}.iso").write_bytes(data)
        ok("decode", tmp_path / f"{name}.iso", "-o", tmp_path / f"{name}.{kind}")
        assert raw == (tmp_path / f"{name}.{kind}").read_bytes() and word.encode() in raw


def test_urls(tmp_path: Path) -> None:
    np.save(tmp_path / "hills.npy", HILLS)
    ok("encode", f"file://{tmp_path}/hills.npy", "-o", tmp_path / "a.iso", "--isovalue", 80.5)
    ok("decode", f"file://{tmp_path}/a.iso", "-o", tmp_path / "a.svg")
    assert "no-such" in fails(3, "encode", f"file://{tmp_path}/no-such.npy", "-o", tmp_path / "b.iso", "--isovalue", 1)


@pytest.mark.skipif(shutil.which("file") is None, reason="file(1) is not installed")
def test_magic(tmp_path: Path) -> None:
    """An .iso file is told from the image of a disc."""
    magic = ROOT / "docs" / "isocodec.magic"
    (tmp_path / "a.iso").write_bytes(isocodec.encode(HILLS, 80.5))
    (tmp_path / "b.iso").write_bytes(bytes(40000))
    told = [
        subprocess.run(["file", "--brief", "--mime-type", "-m", magic, tmp_path / name], capture_output=True, text=True)
        for name in ("a.iso", "b.iso")
    ]
    assert told[0].stdout.strip() == "application/vnd.isocodec" != told[1].stdout.strip()
