"""Writing files whole or not at all: beside the target first, then renamed over it."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from .unfinished import new_file_mode, replacing


def check_target(path: str | os.PathLike[str]) -> None:
    """Find out before the work, not after it, that ``path`` cannot be written.

    Raises
    ------
    OSError
        If ``path`` is a directory or write-protected, or its directory is missing or closed to us.
    """
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if _is_special(target):
        return
    # a link is followed, even to a file that is not there yet
    directory = Path(os.path.realpath(target)).parent
    if not directory.exists():
        raise FileNotFoundError(errno.ENOENT, f"there is no directory {str(directory)!r} to write into", str(target))
    if not directory.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(target))
    # A rename would pass over the protection of the file itself.
    protected = target.exists() and not os.access(target, os.W_OK)
    if protected or not os.access(directory, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A file for what goes to ``path``: afterwards there is the whole new file, or on an error what was there before.

    A symbolic link is followed, the permissions of an existing file are kept, and what is not a regular
    file (``/dev/null``, a pipe) is written to directly, because it must not be replaced.

    Raises
    ------
    OSError
        As the operating system reports it.
    """
    if _is_special(Path(path)):
        # before links are followed: that of /dev/stdout may lead to no path
        with open(path, "wb") as file:
            yield file
        return
    target = Path(os.path.realpath(path))
    try:
        mode = target.stat().st_mode & 0o7777
    except FileNotFoundError:
        mode = new_file_mode()
    try:
        with replacing(target, mode) as file:
            yield file
    except OSError as exc:
        # the name that the caller knows, not that of the file beside it
        raise OSError(exc.errno, exc.strerror or str(exc), str(path)) from exc


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Put ``data`` at ``path``, as `writing`."""
    with writing(path) as file:
        file.write(data)


def _is_special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()
