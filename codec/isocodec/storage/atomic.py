"""Write files completely or not at all: first next to the target, then renamed over it; unfinished work is undone.

Objects in stores, by URL, are written to a temporary file first, and sent when they are complete.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from shutil import copyfile, rmtree
from tempfile import mkdtemp
from typing import BinaryIO

from .content import by_fsspec, is_url, is_web

_begun: list[Callable[[], object]] = []


@contextmanager
def undoing(undo: Callable[[], object]) -> Iterator[None]:
    """Undo unfinished work of the block on errors and interrupts, and when `undo_all` is called."""
    _begun.append(undo)
    try:
        yield
    except BaseException:
        undo()
        raise
    finally:
        _begun.remove(undo)


def undo_all() -> None:
    """Undo all unfinished work, the latest first; for code that ends the process without unwinding the stack."""
    for undo in reversed(_begun):
        with suppress(Exception):  # what is left of one must not keep the others
            undo()


def check_target(path: str | os.PathLike[str]) -> None:
    """Check, before the work begins, that ``path`` can be written.

    Raises `OSError` if ``path`` is a directory or write-protected, its directory is missing or not writable, or it is
    the URL of a web server; `MissingExtraError` if what writes to a store is not installed.
    """
    if is_url(path):
        if is_web(path):
            raise OSError(errno.EROFS, "web servers are only read: name a store, as s3://bucket/name", path)
        with by_fsspec(str(path)):
            return
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if _is_special(target):
        return
    # a link is followed, even to a file that does not exist yet
    directory = Path(os.path.realpath(target)).parent
    if not directory.exists():
        raise FileNotFoundError(errno.ENOENT, f"the directory {str(directory)!r} does not exist", str(target))
    if not directory.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(target))
    # Renaming would ignore the write protection of the file itself.
    protected = target.exists() and not os.access(target, os.W_OK)
    if protected or not os.access(directory, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Yield a file for the new contents of ``path``, which on an error keeps its old contents.

    A symbolic link is followed, the permissions of an existing file are kept, and anything but a regular file
    (``/dev/null``, a pipe) is written to directly, because it must not be replaced. Raises `OSError` as the operating
    system reports it.
    """
    if is_url(path):
        with beside(path, "") as target, target.open("wb") as file:
            yield file
        return
    if _is_special(Path(path)):
        # checked before links are followed: /dev/stdout may not link to a path
        with open(path, "wb") as file:
            yield file
        return
    try:
        with beside(path, "") as target, target.open("wb") as file:
            yield file
    except OSError as exc:
        # the name that the caller knows, not that of the temporary file
        raise OSError(exc.errno, exc.strerror or str(exc), str(path)) from exc


@contextmanager
def beside(target: str | os.PathLike[str] | BinaryIO, suffix: str, keep: bool = False) -> Iterator[Path]:
    """Yield a path for a library to write to; the file, and all that the library puts beside it, then take their place.

    The path has ``suffix``. A target that is an open file, a pipe or a device receives the bytes of the file. With
    ``keep``, the library begins with a copy of the file that exists. Raises `OSError` as the system reports it, or if
    there are several files for an open one; all files are then unchanged.
    """
    special = not isinstance(target, str | os.PathLike) or is_url(target) or _is_special(Path(target))
    real = None if special else Path(os.path.realpath(target))  # type: ignore[arg-type]
    if real is not None:
        check_target(target)  # type: ignore[arg-type]
    folder = Path(mkdtemp(".part", ".isocodec-", None if real is None else real.parent))
    with undoing(partial(rmtree, folder, ignore_errors=True)):
        name = "isocodec" if real is None else real.name
        path = folder / (name if name.lower().endswith(suffix) else name + suffix)
        if keep and real is not None and real.exists():
            if any(real.with_name(real.name + log).exists() for log in ("-wal", "-journal")):
                raise OSError(errno.EBUSY, "another program has the file open: close it there", str(target))
            copyfile(real, path)
        yield path
        _check_space(folder)
        made = sorted(folder.iterdir(), key=lambda one: one == path)  # the named file is the last to be replaced
        if real is None:
            if len(made) > 1:
                raise OSError(f"{suffix} has several files: write to a name")
            if is_url(target):
                with by_fsspec(str(target)) as fsspec:
                    system, name = fsspec.core.url_to_fs(target)
                    system.put_file(str(path), name)
            elif isinstance(target, str | os.PathLike):
                Path(target).write_bytes(path.read_bytes())
            else:
                target.write(path.read_bytes())
        else:
            mask = os.umask(0o077)  # it can be read only by setting it
            os.umask(mask)
            places = [real if one == path else real.with_name(one.name) for one in made]
            for one, place in zip(made, places, strict=True):
                check_target(place)
                one.chmod(place.stat().st_mode & 0o7777 if place.exists() else 0o666 & ~mask)
            for one, place in zip(made, places, strict=True):
                os.replace(one, place)
    rmtree(folder, ignore_errors=True)


def _check_space(folder: Path) -> None:
    """Flush all files of a folder to disk; not all libraries notice that it is full, so more must fit."""
    for one in folder.iterdir():
        with one.open("rb+") as file:
            os.fsync(file.fileno())
    (rest := folder / "rest").write_bytes(bytes(1 << 16))
    rest.unlink()


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write ``data`` to ``path``, as `writing` does."""
    with writing(path) as file:
        file.write(data)


def _is_special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()
