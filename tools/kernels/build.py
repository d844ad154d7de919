"""A build: from the sources to the library of a platform, or what was kept of an earlier one."""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import back
import cache as kept_builds
import front
import tomllib
import webassembly
from targets import WASM, Target, native

BUILT = front.SOURCES[0] / "isocodec" / "kernel" / "built"
"""Where the library of a checkout stands."""
NOTE = "kernels.json"
_CODE = ("front.py",)
"""What makes the kernels' code for any platform, beside the requirements."""
_LIBRARY = (*_CODE, "back.py", "processor.ll", "runtime.ll")
"""What makes a library of it, beside the target."""
_MODULES = (*_CODE, "back.py", "layouts.py", "webassembly.py")
"""What makes modules of WebAssembly of it."""
Progress = Callable[[int, int], object]


@cache
def requirements() -> list[str]:
    """What a build needs: as in ``pyproject.toml``, the extra ``kernels``, and what kernels import.

    numba's names and layouts are its own affair, hence one release; another one is judged by the vectors.
    """
    project = tomllib.loads((front.ROOT / "pyproject.toml").read_text())["project"]
    imported = ("numpy", "construct")
    return project["optional-dependencies"]["kernels"] + [
        each for each in project["dependencies"] if each.startswith(imported)
    ]


def sources() -> dict[str, Any]:
    """The files that kernels are compiled from, and their digest, as the library of a checkout notes them."""
    module = _module("sources")
    homes = _homes(module)
    files = module.needed(homes)
    return {"files": files, "sha256": module.digest_of(files, homes)}


def decoders() -> set[str]:
    """The entries that a decoder needs: kernels of the modules that it imports."""
    module = _module("sources")
    homes = _homes(module)
    files = module.reached([homes["isocodec"] / "stream" / "grid_contents.py"], homes)
    return {found.symbol for found in front.kernels() if found.path in files}


def _homes(module: Any) -> dict[str, Path]:
    """The folders of the packages that kernels are compiled from."""
    return {name: home / name for name, home in zip(module.PACKAGES, front.SOURCES, strict=True)}


def _module(name: str) -> Any:
    """A module of the package's ``kernel``, without what importing the package takes."""
    spec = importlib.util.spec_from_file_location(name, BUILT.parent / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def key(target: Target | None, checked: bool) -> str:
    """Names all that a library depends on; without a target, the kernels' code for any platform."""
    parts = [sources()["sha256"], requirements(), target, checked, sorted(decoders()) if target == WASM else None]
    out = hashlib.sha256(repr(parts).encode())
    for name in _CODE if target is None else _MODULES if target == WASM else _LIBRARY:
        out.update((Path(__file__).parent / name).read_bytes())
    return "-".join([target.name if target else "code", *["checked"] * checked, out.hexdigest()[:24]])


def lacking() -> list[str]:
    """Requirements that are not installed in these versions."""
    out = []
    for requirement in requirements():
        name, _, version = requirement.partition("==")
        try:
            found = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found = ""
        if version and found != version:
            out.append(requirement)
    return out


def is_kept(target: Target, checked: bool = False) -> bool:
    """Whether the library needs no building."""
    return kept_builds.hit(key(target, checked)) is not None


@contextmanager
def library(target: Target, jobs: int, progress: Progress, checked: bool = False) -> Iterator[Path]:
    """A folder with a platform's library and its note.

    Parameters
    ----------
    target : Target
    jobs : int
        Processes for what follows LLVM's code.
    progress : callable
        Called with how many kernels have been compiled, and of how many.
    checked : bool
        Whether indices are checked: for tests.
    """
    with kept_builds.entry(key(target, checked)) as (place, kept):
        if not kept:
            with _code(progress, checked) as code:
                bitcode = (code / "kernels.bc").read_bytes()
                if target == WASM:
                    webassembly.link(bitcode, place, decoders(), jobs)
                else:
                    back.link(bitcode, target, place, jobs)
                signatures = json.loads((code / "signatures.json").read_text())
            note = {
                "file": target.library,
                "sha256": hashlib.sha256((place / target.library).read_bytes()).hexdigest(),
                "platform": target.name + " with checks" * checked,
                "variants": [variant.suffix for variant in target.variants],
                "signatures": signatures,
                "ran": target == native(),
                "sources": None,
            }
            (place / NOTE).write_text(json.dumps(note, indent=1))
        yield place


@contextmanager
def _code(progress: Progress, checked: bool) -> Iterator[Path]:
    """A folder with the kernels' code for any platform, and their signatures."""
    with kept_builds.entry(key(None, checked)) as (place, kept):
        if not kept:
            code, signatures = front.compiled(checked, progress)
            (place / "kernels.bc").write_bytes(code)
            (place / "signatures.json").write_text(json.dumps(signatures))
        yield place


def put_into_checkout(place: Path, checked: bool = False) -> None:
    """Give the checkout a library that has been built; it notes which sources it is of."""
    note = json.loads((place / NOTE).read_text()) | {"sources": sources()}
    built = BUILT / "checked" if checked else BUILT
    built.mkdir(parents=True, exist_ok=True)
    # a process may have the old one loaded: files are replaced, never written into
    contents = {note["file"]: (place / note["file"]).read_bytes(), NOTE: json.dumps(note, indent=1).encode()}
    for name, content in contents.items():
        unfinished = built / f"unfinished-{os.getpid()}"
        unfinished.write_bytes(content)
        unfinished.replace(built / name)
