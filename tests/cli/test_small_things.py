"""Small things of the command line and the library: what is dropped is said, and no text comes twice."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, run
from home import ROOT
from isocodec.api.thinned import thin
from isocodec.api.verification import Verified
from isocodec.cli import main
from isocodec.cli.report import own_warnings
from tables import looped


@looped("command", sorted(main.commands))
def test_help_says_nothing_twice(command: str) -> None:
    """No paragraph begins as another one does, and no list of suffixes has one twice."""
    text = run(command, "--help").stdout
    paragraphs = [re.sub(r"\s+", " ", part).strip() for part in text.split("\n\n")]
    openings = [part[:40] for part in paragraphs if len(part) > 40]
    assert len(openings) == len(set(openings))
    for line in re.findall(r"(?:\.[a-z0-9.]+[a-z0-9], )+\.[a-z0-9.]+[a-z0-9]", re.sub(r"\s+", " ", text)):
        assert len(line.split(", ")) == len(set(line.split(", "))), line


def test_an_option_that_is_given_twice_is_said(tmp_path: Path) -> None:
    source = tmp_path / "a.iso"
    isocodec.save(source, np.arange(64).reshape(8, 8), 30.5)
    done = run("edit", source, "-o", tmp_path / "b.iso", "--precision", 1, "--precision", "signs")
    assert done.exit_code == 0 and "--precision is given twice; the last one counts" in done.stderr


def test_isovalues_in_notes_are_short() -> None:
    data = isocodec.encode(thin(np.arange(64).reshape(8, 8) / 10.0, contours=[0.3, 0.7], tolerance=0.2))
    assert isocodec.open(data).metadata["promise"].endswith(" at 0.3 0.7")


def test_every_extra_is_in_the_table() -> None:
    root = ROOT
    table = (root / "docs" / "installation.md").read_text()
    listed = (root / "pyproject.toml").read_text().split("[project.optional-dependencies]")[1].split("\n[")[0]
    extras = re.findall(r"^(\w+) = \[", listed, re.MULTILINE)
    assert len(extras) > 15
    assert [extra for extra in extras if extra != "all" and f"| `{extra}` |" not in table] == []


@pytest.mark.parametrize(("unit", "written"), [(None, "units of x"), ("mm", "mm"), ("mm um", "mm")])
def test_a_scale_bar_has_a_unit(tmp_path: Path, unit: str | None, written: str) -> None:
    y, x = np.mgrid[0:40, 0:50]
    notes = {"placement": "0 3 0 3 0 0", **({"coordinate_unit": unit} if unit else {})}
    data = isocodec.encode((x + 2 * y).astype(np.int16), [30.5, 60.5], metadata=notes)
    (tmp_path / "a.iso").write_bytes(data)
    assert run("plot", tmp_path / "a.iso", "--map", "-o", tmp_path / "a.svg").exit_code == 0
    assert re.search(rf">\d+ {written}<", (tmp_path / "a.svg").read_text())


def test_a_file_is_kept_if_all_of_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One isovalue without a promise: not known; one that is not kept: not."""
    isocodec.save(tmp_path / "a.iso", HILLS, 80.5)
    np.save(tmp_path / "a.npy", HILLS)
    for each, kept, code in (([True, None], None, 0), ([True, None, False], False, 9), ([True, True], True, 0)):
        found = [Verified(80.5, None, 0.0, 0.0, 0, one) for one in each]
        monkeypatch.setattr(isocodec.IsoFile, "verify", lambda *_, found=found, **__: found)
        result = run("verify", tmp_path / "a.iso", tmp_path / "a.npy", "--json")
        assert result.exit_code == code and json.loads(result.stdout)["kept"] is kept


def test_limits_hold_for_files_that_are_merged(tmp_path: Path) -> None:
    for name, isovalue in (("a", 80.5), ("b", 60.5)):
        isocodec.save(tmp_path / f"{name}.iso", HILLS, isovalue, precision="exact")
    words = ["edit", tmp_path / "a.iso", tmp_path / "b.iso", "-o", tmp_path / "c.iso"]
    assert run(*words).exit_code == 0
    assert run(*words, "--limits", "memory=1000").exit_code == 6


def test_each_warning_is_shown_once(capsys: pytest.CaptureFixture[str]) -> None:
    with own_warnings("a.iso"):
        for text in ("one", "two", "one"):
            warnings.warn(text, stacklevel=1)
    assert capsys.readouterr().err.splitlines() == [f"isocodec: a.iso: warning: {text}" for text in ("one", "two")]
