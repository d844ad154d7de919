"""Where compiled kernels are kept: numba's cache on disk, in files that are whole or are not read."""

from __future__ import annotations

import hashlib
import io
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from .unfinished import new_file_mode, replace_file

DIGEST_BYTES = 32


class SealedFiles(IndexDataCacheFile):
    """The files of one kernel, each with a digest behind what numba writes.

    numba takes its files for whole, and what they hold for code that may run. A file that was cut off, emptied or
    damaged is deleted here, and the kernel is compiled again.
    """

    def save(self, key: Any, data: Any) -> None:
        """As numba; a kernel that cannot be kept serves this process all the same."""
        with suppress(OSError):
            super().save(key, data)

    def _data_name(self, number: int) -> str:
        # Not by number: two processes at once would give one name to kernels for different arguments.
        return f"{str(self._index_name).removesuffix('.nbi')}.{secrets.token_hex(8)}.nbc"

    def _load_index(self) -> dict[Any, str]:
        return super()._load_index() if is_whole(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not is_whole(path):
            raise FileNotFoundError(path)  # which numba takes for a kernel that is still to be compiled
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[io.BytesIO]:
        file = io.BytesIO()
        yield file
        data = file.getvalue()
        replace_file(Path(path), data + hashlib.sha256(data).digest(), new_file_mode())


class SealedCache(FunctionCache):
    """numba's cache of one kernel, in such files."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = SealedFiles(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )


def is_whole(path: Path) -> bool:
    """Whether a file is there and ends in the digest of what comes before; one that does not is deleted."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    whole = hashlib.sha256(data[:-DIGEST_BYTES]).digest() == data[-DIGEST_BYTES:]
    if not whole:
        with suppress(OSError):
            path.unlink()
    return whole
