"""The source files that kernels are compiled from."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path

PACKAGES = ("isocodec", "isospec")


def digest_of(files: Iterable[str], homes: dict[str, Path]) -> str:
    """SHA-256 of source files, named from the package on (``isocodec/grid/tube/holes.py``); ``homes`` are the packages.

    A missing file gives a digest like no other.
    """
    import hashlib

    out = hashlib.sha256()
    for name in files:
        package, _, rest = name.partition("/")
        try:
            # not by way of Path, which would take as long again
            with open(f"{homes[package]}/{rest}", "rb", buffering=0) as file:
                text = file.read()
        except OSError:
            text = b"?"
        out.update(f"{name}\0{len(text)}\0".encode() + text)
    return out.hexdigest()


def needed(homes: dict[str, Path]) -> list[str]:
    """List all files with kernels, and all files of these packages that they import, directly or not."""
    found = reached((path for path in homes["isocodec"].rglob("*.py") if "\n@kernel\n" in path.read_text()), homes)
    return sorted(f"{name}/{path.relative_to(home).as_posix()}" for name, home in homes.items()
                  for path in found if path.is_relative_to(home))


def reached(files: Iterable[Path], homes: dict[str, Path]) -> set[Path]:
    """Collect these files, and all files of the packages that they import, directly or not."""
    found: set[Path] = set()
    left = list(files)
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            left += _imported(path, homes)
    return found


def _imported(path: Path, homes: dict[str, Path]) -> Iterator[Path]:
    """Files of these packages that a file imports from."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom):
            continue
        parts = node.module.split(".") if node.module else []
        if node.level:
            folder = path.parents[node.level - 1]
        elif parts and parts[0] in homes:
            folder = homes[parts.pop(0)]
        else:
            continue
        place = folder.joinpath(*parts)
        for each in [place, *(place / name.name for name in node.names)]:
            for file in (each.with_suffix(".py"), each / "__init__.py"):
                if file.is_file():
                    yield file
