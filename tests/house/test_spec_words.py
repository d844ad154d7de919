"""The table of clauses that decoders of grids need (spec clause 11.3) against the text."""

from __future__ import annotations

import re

from home import ROOT

SPEC = ROOT / "spec" / "iso.md"
HEAD = "| for | clauses | words |\n"
WHOLE = "the whole text"
CLOSE = 0.1
"""Share by which a stated number may be off."""


def sections(text: str) -> dict[str, int]:
    """Words by number of a clause, without those of the clauses in it."""
    parts = re.split(r"^#{2,4} (?:Annex )?([0-9A-G][0-9.]*)", text, flags=re.MULTILINE)
    return {number: len(words.split()) for number, words in zip(parts[1::2], parts[2::2], strict=True)}


def named(clauses: str) -> list[str]:
    """Numbers of clauses out of a list such as `1.2, 3.1 to 3.6`."""
    out = []
    for item in clauses.split(", "):
        first, _, last = item.partition(" to ")
        if last:
            stem, _, begin = first.rpartition(".")
            out += [f"{stem}.{i}" for i in range(int(begin), int(last.rpartition(".")[2]) + 1)]
        else:
            out.append(first)
    return out


def test_words_are_about_as_many_as_stated():
    """Each clause is named once, and is there."""
    text = SPEC.read_text(encoding="utf-8")
    words = sections(text)
    start = text.index(HEAD) + len(HEAD)
    rows = [line.strip("| ").split("|") for line in text[start : text.index("\n\n", start)].splitlines()[1:]]
    seen: list[str] = []
    for what, clauses, stated in ([cell.strip() for cell in row] for row in rows):
        if what == WHOLE:
            count = len(text.split())
        else:
            chosen = named(clauses)
            parts = [[number for number in words if f"{number}.".startswith(f"{one}.")] for one in chosen]
            assert all(parts), f"{what}: {clauses}"
            seen += [number for part in parts for number in part]
            count = sum(words[number] for part in parts for number in part)
        assert abs(int(stated.replace(",", "")) - count) < CLOSE * count, f"{what}: {count} words, {stated} stated"
    assert len(seen) == len(set(seen))
