"""Plans from a line of words for each entry, which tests are easier to read with."""

from __future__ import annotations

from typing import Any

from isocodec.grid.layers.plan import Criteria


def _criteria(words: list[str]) -> Criteria:
    named = (word.partition("=") for word in words)
    return Criteria(**{name: True if not number else int(number) if name == "level" else float(number)
                       for name, _, number in named})


def _entry(kind: str, *words: str) -> tuple[Any, ...]:
    first = int(words[0]) if words and words[0].isdecimal() else None
    if kind == "adaptive-base":
        return ("adaptive_base", first or 0, _criteria([*words[first is not None :]]))
    if kind == "adapt":
        return ("adapt", int("same-components" not in words), _criteria([w for w in words if w != "same-components"]))
    if kind == "leaf-base":
        return ("leaf_base",)
    if kind == "values" and words and words[0].startswith("left="):
        return ("values", None, int(words[0][5:]))
    if kind == "offsets":
        return ("offsets", first, int(words[1][5:]) if words[1:] else 0)
    return (kind, first)


def plan(text: str) -> list[tuple[Any, ...]]:
    """The entries of lines such as ``adapt topology distortion=0.5`` or ``offsets 9 unit=2``."""
    return [_entry(*line.split()) for line in text.splitlines() if line.strip()]
