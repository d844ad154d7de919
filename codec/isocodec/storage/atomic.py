"""Writing files whole or not at all: beside the target first, then renamed over it; what is begun can be undone."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

_begun: list[Callable[[], object]] = []


@contextmanager
def undoing(undo: Callable[[], object]) -> Iterator[None]:
    """Undo on errors and interrupts, and by `undo_all`, what is begun within and does not get done."""
    _begun.append(undo)
    try:
        yield
    except BaseException:
        undo()
        raise
    finally:
        _begun.remove(undo)


def undo_all() -> None:
    """Undo all that is begun, the last first: for whoever ends the process without unwinding it."""
    for undo in reversed(_begun):
        with suppress(Exception):  # what is left of one must not keep the others
            undo()


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
        mode = _new_file_mode()
    try:
        with _replacing(target, mode) as file:
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


@contextmanager
def _replacing(target: Path, mode: int) -> Iterator[BinaryIO]:
    """A file beside ``target`` to write to, which is then flushed to the disk and renamed over ``target``.

    Raises
    ------
    OSError
        As the operating system reports it; ``target`` is as it was then.
    """
    # In the same directory, since a rename is only atomic within one file system.
    # Names have a limit in bytes.
    start = os.fsdecode(os.fsencode(target.name)[:100])
    beside = target.with_name(f".{start}.{secrets.token_hex(8)}.part")
    with undoing(partial(beside.unlink, missing_ok=True)):
        with open(beside, "xb", opener=lambda path, flags: os.open(path, flags, 0o600)) as file:
            yield file
            file.flush()
            # Some file systems report a full disk only here, and then the old file must still be there.
            os.fsync(file.fileno())
        beside.chmod(mode)
        os.replace(beside, target)


def _new_file_mode() -> int:
    """Permissions that the process gives to new files."""
    # The mask can only be read by setting it.
    mask = os.umask(0o077)
    os.umask(mask)
    return 0o666 & ~mask
