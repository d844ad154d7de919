"""What the pages say, done: commands and Python of the tutorials, and that the API page names all there is.

Numbers in what commands print may differ by a tenth, since sizes move when tables are trained anew; seconds are not
compared. What Python prints has to be as it stands.
"""

from __future__ import annotations

import doctest
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

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
JAVASCRIPT = ROOT / "codec" / "js"
PAGES = [DOCS / "index.md", *sorted((DOCS / "tutorials").glob("*.md")), ROOT / "README.md"]
BLOCK = re.compile(r"^```(pycon|python|console|js)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[0-9][0-9,]*(?:\.[0-9]+)?")
SECONDS = re.compile(r"[0-9.]+ s\b")
FLAGS = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL

pytestmark = pytest.mark.skipif(INTERPRETED, reason="takes minutes as plain Python")


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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
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
    """That a page and a command say the same, but for seconds and a tenth of each number."""
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
    named = re.findall(r"^::: isocodec\.(\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(named) == sorted(isocodec.__all__)
    assert len(set(named)) == len(named)


def test_snippets_are_in_the_readme() -> None:
    """Marks that pages take parts of the README by; mkdocs takes nothing where one is misspelt."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    taken = [name for page in DOCS.rglob("*.md") for name in re.findall(r'--8<-- "README.md:(\w+)"', page.read_text())]
    assert taken
    for name in taken:
        assert readme.count(f"[start:{name}]") == readme.count(f"[end:{name}]") == 1
