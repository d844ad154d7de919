"""What has been built is kept for the next build: in a folder that nobody else can write."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

KEPT = 24
"""Builds that are kept: those used last."""


class Unsafe(Exception):
    """The folder belongs to somebody else, or others can write it."""


def folder() -> Path:
    """Where builds are kept: ``XDG_CACHE_HOME``, else what the system has for it."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(named):
        home = Path(named)
    elif sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        home = Path.home() / "Library" / "Caches"
    else:
        home = Path.home() / ".cache"
    return home / "isocodec" / "kernels"


def checked(place: Path) -> Path:
    """The folder, made if need be; `Unsafe` if what lies there may be somebody else's."""
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        status = place.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
            raise Unsafe(f"{place}: not a folder of your own")
        if status.st_mode & 0o077:
            raise Unsafe(f"{place}: others may read or write it; chmod 700 it, or name another with XDG_CACHE_HOME")
    return place


def hit(key: str) -> Path | None:
    """A build that is kept."""
    try:
        place = checked(folder()) / key
    except (OSError, Unsafe):
        return None
    if not place.is_dir():
        return None
    with contextlib.suppress(OSError):
        os.utime(place)
    return place


@contextlib.contextmanager
def entry(key: str) -> Iterator[tuple[Path, bool]]:
    """The folder of a build, and whether it is there already.

    If not, one to build in, which is kept if all goes well; a passing one if nothing can be kept. Where two build at
    once, the second one waits, and finds what the first one built.
    """
    kept = hit(key)
    if kept:
        yield kept, True
        return
    try:
        home = checked(folder())
        lock = (home / f"{key}.lock").open("w")
    except (OSError, Unsafe) as error:
        print(f"kernels: this build cannot be kept: {error}", file=sys.stderr)
        with tempfile.TemporaryDirectory() as passing:
            yield Path(passing), False
        return
    with lock, _alone(lock):
        kept = hit(key)
        if kept:
            yield kept, True
            return
        with tempfile.TemporaryDirectory(prefix="unfinished-", dir=home) as unfinished:
            place = Path(unfinished) / key
            place.mkdir(mode=0o700)
            yield place, False
            with contextlib.suppress(OSError):  # there already, where locks do not work
                place.rename(home / key)
    _forget_old(home)


@contextlib.contextmanager
def _alone(file: IO[str]) -> Iterator[None]:
    """Nobody else has this file meanwhile; given up if the process ends."""
    try:
        import fcntl
    except ImportError:  # two at once do the work twice
        yield
        return
    fcntl.flock(file, fcntl.LOCK_EX)
    yield


def _forget_old(home: Path) -> None:
    """Delete builds that have not been used for longest."""
    kept = [each for each in home.iterdir() if each.is_dir() and not each.name.startswith("unfinished-")]
    for each in sorted(kept, key=lambda each: -each.stat().st_mtime)[KEPT:]:
        shutil.rmtree(each, ignore_errors=True)
        each.with_name(f"{each.name}.lock").unlink(missing_ok=True)
