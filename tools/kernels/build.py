"""A build: from the sources to the library of a platform, or what was kept of an earlier one."""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import back
import cache
import front
import wasm
from targets import WASM, Target, native

REQUIREMENTS = ("numba==0.68.1", "llvmlite==0.50.0", "ziglang==0.17.1", "numpy>=2.0", "construct>=2.10.70")
"""What a build needs. How numba names and lays out its code is its own affair, hence one release; another one is judged
by the vectors."""
BUILT = front.SOURCES[0] / "isocodec" / "kernel" / "built"
"""Where the library of a checkout stands."""
NOTE = "kernels.json"
Progress = Callable[[int, int], object]


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
    files = module.reached([homes["isocodec"] / "stream" / "decoder.py"], homes)
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
    out = hashlib.sha256(repr((sources()["sha256"], REQUIREMENTS, target, checked)).encode())
    for path in sorted(Path(__file__).parent.iterdir()):
        if path.suffix in (".py", ".ll") and (target or path.name == "front.py"):
            out.update(path.read_bytes())
    return "-".join([target.name if target else "code", *["checked"] * checked, out.hexdigest()[:24]])


def lacking() -> list[str]:
    """Requirements that are not installed in these versions."""
    out = []
    for requirement in REQUIREMENTS[:3]:
        name, version = requirement.split("==")
        try:
            found = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found = ""
        if found != version:
            out.append(requirement)
    return out


def is_kept(target: Target, checked: bool = False) -> bool:
    """Whether the library needs no building."""
    return cache.hit(key(target, checked)) is not None


@contextmanager
def library(target: Target, jobs: int, progress: Progress, checked: bool = False) -> Iterator[Path]:
    """A folder with a platform's library and its note.

    Parameters
    ----------
    target : Target
    jobs : int
        Processes.
    progress : callable
        Called with how many kernels have been compiled, and of how many.
    checked : bool
        Whether indices are checked: for tests.
    """
    with cache.entry(key(target, checked)) as (place, kept):
        if not kept:
            with _code(jobs, progress, checked) as code:
                bitcode = (code / "kernels.bc").read_bytes()
                if target == WASM:
                    wasm.link(bitcode, place, decoders(), jobs)
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
def _code(jobs: int, progress: Progress, checked: bool) -> Iterator[Path]:
    """A folder with the kernels' code for any platform, and their signatures."""
    with cache.entry(key(None, checked)) as (place, kept):
        if not kept:
            code, signatures = front.compiled(jobs, checked, progress)
            (place / "kernels.bc").write_bytes(code)
            (place / "signatures.json").write_text(json.dumps(signatures))
        yield place


def put_into_checkout(place: Path) -> None:
    """Give the checkout a library that has been built; it notes which sources it is of."""
    note = json.loads((place / NOTE).read_text()) | {"sources": sources()}
    BUILT.mkdir(exist_ok=True)
    (BUILT / NOTE).unlink(missing_ok=True)
    for path in BUILT.glob("kernels.*"):
        path.unlink()  # a process may have it loaded: never written into
    shutil.copy2(place / note["file"], BUILT)
    unfinished = BUILT / "unfinished.json"
    unfinished.write_text(json.dumps(note, indent=1))
    unfinished.replace(BUILT / NOTE)
