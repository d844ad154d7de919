"""The misreadings: data in ``*.toml``, and what plants one in a copy of the sources."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomllib

from isocodec.kernel import Execution
from isocodec.kernel.execution import SETTING

HOME = Path(__file__).resolve().parent
ROOT = HOME.parent.parent
PACKAGES = ("codec/isocodec", "spec/isospec", "conformance/isoconform")
"""What a planted decoder consists of, relative to the repository."""
THEMES = (
    "container", "mesh", "base", "refinement", "geometry", "isovalues", "missing", "frames", "mapped",
    "coder", "main", "explicit", "tiles",
)
"""Files of misreadings, in the order of the specification."""


class RottenError(ValueError):
    """A misreading does not fit the sources, or is not stated as it should be."""


@dataclass(frozen=True)
class Change:
    """A text that stands exactly once in a file, relative to the repository, and what is put in its place."""

    file: str
    old: str
    new: str


@dataclass(frozen=True)
class Misreading:
    """A deliberate misreading of the specification.

    Attributes
    ----------
    name : str
    clause : str
        The paragraph that is misread.
    says : str
        What the decoder does instead.
    vector : str
        A vector that catches it.
    changes : tuple of Change
        What makes our decoder do so.
    compiled : bool
        Whether the vector has so many symbols that the planted decoder has to be compiled.
    """

    name: str
    clause: str
    says: str
    vector: str
    changes: tuple[Change, ...]
    compiled: bool = False


def load() -> list[Misreading]:
    """All misreadings, by themes.

    Raises
    ------
    RottenError
        If one is not stated as it should be, or two have one name.
    """
    found = []
    for theme in THEMES:
        entries = tomllib.loads((HOME / f"{theme}.toml").read_text(encoding="utf-8"))["misreading"]
        found += [_misreading(theme, entry) for entry in entries]
    names = [m.name for m in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise RottenError(f"two misreadings are called {', '.join(sorted(twice))}")
    return found


def _misreading(theme: str, entry: dict[str, Any]) -> Misreading:
    try:
        parts = [entry, *entry.get("also", ())]
        changes = tuple(Change(part["file"], part["old"], part["new"]) for part in parts)
        return Misreading(
            entry["name"], entry["clause"], entry["says"], entry["vector"], changes, entry.get("compiled", False)
        )
    except KeyError as missing:
        raise RottenError(f"{theme}.toml: {entry.get('name', 'a misreading')} has no {missing}") from None


def changed(misreading: Misreading) -> dict[str, str]:
    """The files that a misreading changes, by their paths in the repository, with their new contents.

    Raises
    ------
    RottenError
        If an old text does not stand exactly once in its file, or nothing would change.
    """
    texts: dict[str, str] = {}
    for change in misreading.changes:
        path = ROOT / change.file
        if change.file not in texts:
            if not path.is_file():
                raise RottenError(f"{misreading.name}: there is no {change.file}")
            texts[change.file] = path.read_text(encoding="utf-8")
        count = texts[change.file].count(change.old)
        if count != 1:
            raise RottenError(f"{misreading.name}: its old text stands {count} times in {change.file}")
        if change.old == change.new:
            raise RottenError(f"{misreading.name}: nothing changes in {change.file}")
        texts[change.file] = texts[change.file].replace(change.old, change.new)
    return texts


def plant(misreading: Misreading, directory: Path) -> None:
    """Write a copy of the packages with a misreading into a directory, which may have to be made.

    With ``environment`` of it, ``python -m isoconform dump`` there is the wrong decoder.
    """
    texts = changed(misreading)
    directory.mkdir(parents=True, exist_ok=True)
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, directory / Path(package).name, ignore=shutil.ignore_patterns("__pycache__", "built"),
            dirs_exist_ok=True,
        )
    for file, text in texts.items():
        source = next(package for package in PACKAGES if file.startswith(f"{package}/"))
        (directory / Path(source).name / file[len(source) + 1 :]).write_text(text, encoding="utf-8")


def environment(directory: Path, misreading: Misreading | None = None) -> dict[str, str]:
    """Environment in which Python imports the packages of a directory, not compiled unless a misreading asks for it."""
    execution = Execution.NUMBA if misreading is not None and misreading.compiled else Execution.PYTHON
    return {
        **os.environ, SETTING: execution.value, "PYTHONPATH": str(directory), "PYTHONDONTWRITEBYTECODE": "1",
    }


def by_name(misreadings: Sequence[Misreading], names: Sequence[str]) -> list[Misreading]:
    """Those of some names, all if there are none.

    Raises
    ------
    RottenError
        If there is none of a name.
    """
    if unknown := set(names) - {m.name for m in misreadings}:
        raise RottenError(f"no misreading is called {', '.join(sorted(unknown))}")
    return [m for m in misreadings if not names or m.name in names]
