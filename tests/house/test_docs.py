"""README and the pages, carried out: their commands and their Python; their links; the names on the API page.

Numbers that commands print may differ by a tenth, since sizes move when tables are trained anew; seconds are not
compared, and of a command without output on the page only the exit code is. What Python prints has to match exactly.
"""

from __future__ import annotations

import doctest
import importlib
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

import isocodec
from brute import INTERPRETED
from commands import run
from home import ROOT
from tables import looped

DOCS = ROOT / "docs"
JAVASCRIPT = ROOT / "codec" / "js"
README = ROOT / "README.md"
PAGES = [README, *sorted(DOCS.rglob("*.md"))]
NOT_RUN = ("tiles", "commands")
"""Pages whose blocks are about files of others, or are made from the command line itself."""
BLOCK = re.compile(r"^```(pycon|python|console|js)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[0-9][0-9,]*(?:\.[0-9]+)?")
SECONDS = re.compile(r"[0-9.]+ s\b")
LINK = re.compile(r"\]\(([^)#]*)(?:#([^)]*))?\)")
README_LINES = 150
FLAGS = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL

pytestmark = [pytest.mark.heavy, pytest.mark.skipif(INTERPRETED, reason="takes minutes as plain Python")]


def blocks(page: Path) -> Iterator[tuple[int, str, str]]:
    """Line, language and text of each block of code."""
    whole = page.read_text(encoding="utf-8")
    for found in BLOCK.finditer(whole):
        yield whole.count("\n", 0, found.start(2)), found[1], found[2]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the demo data, and nothing else."""
    (tmp_path / "demo").symlink_to(ROOT / "demo")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runnable(page: Path) -> bool:
    """Whether a page has commands or Python to carry out."""
    return page.stem not in NOT_RUN and any(kind != "js" for _, kind, _ in blocks(page))


@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)], ids=lambda page: page.stem)
def test_pages_do_what_they_say(page: Path, checkout: Path) -> None:
    done = 0
    names: dict[str, object] = {}
    for line, kind, text in blocks(page):
        if kind == "console":
            for command, said in re.findall(r"^\$ ((?:.*\\\n)*.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
                words = shlex.split(command.replace("\\\n", ""))
                assert words[0] == "isocodec"
                result = run(*words[1:])
                assert result.exit_code == 0, result.output
                if said:
                    agree(said, result.output)
                done += 1
        elif kind in ("pycon", "python"):
            test = doctest.DocTestParser().get_doctest(text, names, page.name, str(page), line)
            report: list[str] = []
            doctest.DocTestRunner(optionflags=FLAGS).run(test, out=report.append, clear_globs=False)
            assert not report, "".join(report)
            names = test.globs
            done += len(test.examples)
    assert done


def agree(said: str, printed: str) -> None:
    """Check that a command prints what the page shows, up to seconds and a tenth of each number."""
    said, printed = (SECONDS.sub("some s", text).rstrip() for text in (said, printed))
    assert NUMBER.sub("#", said) == NUMBER.sub("#", printed)
    numbers = [[float(one.replace(",", "")) for one in NUMBER.findall(text)] for text in (said, printed)]
    for stated, found in zip(*numbers, strict=True):
        assert found == pytest.approx(stated, rel=0.1), printed


def test_agree_sees_what_differs() -> None:
    agree("a: 1,000 bytes, 0.20 s\n", "a: 1,040 bytes, 3.1 s\n")
    for printed in ("a: 1,300 bytes, 0.20 s\n", "b: 1,000 bytes, 0.20 s\n", "a: 1,000 bytes, 0.20 s\nmore\n"):
        with pytest.raises(AssertionError):
            agree("a: 1,000 bytes, 0.20 s\n", printed)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.skipif(not (JAVASCRIPT / "dist" / "index.js").exists(), reason="make test-web builds the package first")
def test_javascript_of_the_web_page(checkout: Path) -> None:
    """The module and the program of the page, on its file: as many lines as Python finds, more than once."""
    text = (DOCS / "tutorials" / "web.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^\$ isocodec (.*)$", text, re.MULTILINE)
    assert run(*shlex.split(command)).exit_code == 0
    module, program = (text for _, kind, text in blocks(DOCS / "tutorials" / "web.md") if kind == "js")
    Path("contours.js").write_text(module, encoding="utf-8")
    Path("main.js").write_text(program, encoding="utf-8")
    Path("package.json").write_text('{"type": "module"}', encoding="utf-8")
    Path("node_modules").mkdir()
    os.symlink(JAVASCRIPT, "node_modules/isocodec", target_is_directory=True)
    done = subprocess.run(["node", "main.js"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    shown, lines = map(int, done.stdout.split())
    assert shown > 3
    assert lines == len(isocodec.decode("coins.iso").lines)


def test_the_api_page_names_everything() -> None:
    named = re.findall(r"^::: isocodec\.([\w.]+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(name for name in named if "." not in name) == sorted(isocodec.__all__)
    assert len(set(named)) == len(named)
    for name in named:
        home, _, last = f"isocodec.{name}".rpartition(".")
        assert hasattr(importlib.import_module(home), last), name


@looped("page", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        there = page.parent / target if target else page
        assert there.exists(), target
        if anchor and there.suffix == ".md":
            headings = re.findall(r"^#+ (.*)$", there.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w -]", "", one).lower().replace(" ", "-") for one in headings}, anchor


def test_the_readme_is_short() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= README_LINES


def test_pages_stand_alone() -> None:
    """A page takes no piece of another one: its source is what readers of the repository see."""
    assert [page.name for page in PAGES if "--8<--" in page.read_text(encoding="utf-8")] == []
