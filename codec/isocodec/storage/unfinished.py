"""What has been begun and would be left behind: files beside those that they are to replace, a bar on the terminal."""

from __future__ import annotations

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
    """What is begun within is undone unless it gets done: on errors and interrupts, and by `undo_all`."""
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


@contextmanager
def replacing(target: Path, mode: int) -> Iterator[BinaryIO]:
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


def replace_file(target: Path, data: bytes, mode: int) -> None:
    """Put ``data`` at ``target``, as `replacing`."""
    with replacing(target, mode) as file:
        file.write(data)


def new_file_mode() -> int:
    """Permissions that the process gives to new files."""
    # The mask can only be read by setting it.
    mask = os.umask(0o077)
    os.umask(mask)
    return 0o666 & ~mask
