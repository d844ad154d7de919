"""What is kept of builds of the kernels: whose folder it is, what is found again, and what goes."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

from home import ROOT

sys.path.insert(0, str(ROOT / "tools" / "kernels"))

import build
import cache
from targets import TARGETS

pytestmark = pytest.mark.skipif(os.name != "posix", reason="permissions and locks as POSIX has them")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where builds are kept in this test; it is not there yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "isocodec" / "kernels"


def make(key: str, content: str = "built") -> bool:
    """Build something, if it is not there; whether it was."""
    with cache.entry(key) as (place, kept):
        if not kept:
            (place / "kernels").write_text(content)
        assert (place / "kernels").read_text() == content
    return kept


def names(home: Path) -> set[str]:
    return {path.name for path in home.iterdir()}


@pytest.mark.parametrize("mode", [0o770, 0o702, 0o710, 0o704])
def test_a_folder_that_others_may_use_is_none(home: Path, mode: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither is what lies there taken, nor is anything put there; the build goes on, and says so."""
    make("one", "not to be trusted")
    home.chmod(mode)
    assert cache.hit("one") is None
    assert not make("one") and not make("one")
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and f"kernels: this build cannot be kept: {home}: others may read or write it" in said[0]
    assert (home / "one" / "kernels").read_text() == "not to be trusted"
    home.chmod(0o700)
    assert cache.hit("one")


def test_a_build_that_fails_leaves_nothing(home: Path) -> None:
    with pytest.raises(ZeroDivisionError), cache.entry("one") as (place, _):
        (place / "kernels").write_text("half")
        raise ZeroDivisionError
    assert cache.hit("one") is None and names(home) == {"one.lock"}
    assert not make("one")


def test_a_checkout_gets_its_library_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are replaced, not written into: a process may have the old one loaded. The sources are noted."""
    monkeypatch.setattr(build, "BUILT", tmp_path / "built")
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(build, "sources", lambda: {"files": ["a.py"], "sha256": "0"})
    for content in ("old", "new"):
        (place / "kernels.so").write_text(content)
        (place / "kernels.json").write_text(json.dumps({"file": "kernels.so", "sources": None}))
        for checked in (False, True):
            build.put_into_checkout(place, checked)
        if content == "old":
            loaded = (tmp_path / "built" / "kernels.so").open()
    assert loaded.read() == "old"
    loaded.close()
    for folder in (tmp_path / "built", tmp_path / "built" / "checked"):
        assert (folder / "kernels.so").read_text() == "new"
        assert json.loads((folder / "kernels.json").read_text())["sources"] == {"files": ["a.py"], "sha256": "0"}
        assert {path.name for path in folder.iterdir()} - {"checked"} == {"kernels.so", "kernels.json"}


@pytest.mark.heavy  # digests of all sources, six times
def test_keys_name_what_a_build_depends_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sources, platform, checks, and what it is built with."""
    linux, windows = (TARGETS[name] for name in ("linux-x86_64", "windows-x86_64"))
    keys = {build.key(target, checked) for target in (None, linux, windows) for checked in (False, True)}
    assert len(keys) == 6 and build.key(linux, False) in keys
    for change in ("sources", "requirements"):
        with monkeypatch.context() as patch:
            patch.setattr(build, change, lambda: {"sha256": "another"} if change == "sources" else ["numba==0"])  # noqa: B023
            assert build.key(linux, False) not in keys and build.key(None, False) not in keys
