"""What code, tests and texts call a clause is one of the specification's."""

import re

import pytest

from home import ROOT

NUMBER = r"(?:\d{1,2}|[A-C])(?:\.\d{1,2}){0,2}"
ITEM = re.compile(r"(?<![\w.\-/])((?:\d{1,2}|[A-C])(?:\.\d{1,2}){1,2})\((\d{1,2})\)")  # 5.7.3(2)
CLAUSE = re.compile(rf"\b[Cc]lauses? ({NUMBER})\b()")
TEXTS = (
    "codec/isocodec/**/*.py",
    "codec/js/src/*.ts",
    "spec/**/*.py",
    "spec/*.md",
    "conformance/**/*.py",
    "conformance/zoo/*.toml",
    "conformance/*.md",
    "tests/**/*.py",
    "tools/*.py",
    "docs/**/*.md",
    "*.md",
)


def _clauses() -> dict[str, set[str]]:
    """The numbers of the specification's clauses, each with those of its items, and an empty one for itself."""
    clauses: dict[str, set[str]] = {}
    items: set[str] = set()
    for path in sorted((ROOT / "spec").glob("*.md")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if heading := re.match(rf"#+ (?:Annex )?({NUMBER})\b", line):
                items = clauses.setdefault(heading[1], {""})
            elif item := re.match(r" {0,3}(\d+)\. ", line):
                items.add(item[1])
    return clauses


@pytest.mark.parametrize("pattern", TEXTS)
def test_clauses_that_are_named_exist(pattern):
    clauses, wrong = _clauses(), []
    for path in sorted(ROOT.glob(pattern)):
        text = path.read_text(encoding="utf-8")
        named = [*ITEM.findall(text), *CLAUSE.findall(text)]
        wrong += [(path.name, *one) for one in named if one[1] not in clauses.get(one[0], ())]
    assert not wrong
