"""Words for truncated files."""

from __future__ import annotations

from pathlib import Path

import pytest

import isocodec
from commands import HILLS, fails, run
from tables import looped


@pytest.mark.parametrize(("verb", "out"), [(["decode"], "c.svg"), (["decode", "--what", "above"], "c.npy")])
def test_truncated_files_are_not_called_invalid(tmp_path: Path, verb: list[str], out: str) -> None:
    data = isocodec.encode(HILLS, 80.5)
    part = tmp_path / "part.iso"
    part.write_bytes(data[:-6])
    why = f"isocodec: {part}: the file ends after {len(data) - 6} bytes, before it is complete"
    line = fails(5, *verb, part, "-o", tmp_path / out)
    assert line.startswith(why) and line.endswith(": use --partial to decode as much as there is")
    assert "valid" not in line and not (tmp_path / out).exists()
    result = run(*verb, part, "-o", tmp_path / out, "--partial")
    assert result.exit_code == 0 and (tmp_path / out).exists()
    said = f"{why.replace(': the file', ': warning: the file')}; decoded as far as possible"
    assert result.stderr.splitlines()[-1] == said
    part.write_bytes(data[:-6] + bytes(6))
    assert "not a valid .iso file: " in fails(4, *verb, part, "-o", tmp_path / out)


@looped(("out", "most"), [("c.npz", 1), ("c.geojson", 3), ("c.svg", 8), ("c.png", 3)])
def test_fewer_bytes_than_a_header(curve: Path, tmp_path: Path, out: str, most: int) -> None:
    """Whether a part would do or not: there is no curve to be written."""
    for more in ((), ("--partial",)):
        line = fails(5, "decode", curve, "-o", tmp_path / out, "--max-bytes", most, *more)
        assert line == f"isocodec: {curve}: the file ends before its curve begins"
        assert not (tmp_path / out).exists()
