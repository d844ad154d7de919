"""A file's samples, read a window at a time."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np


class Windows:
    """A file's samples, by slices; opened where it is read, so that other processes receive no more than its name.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __init__(self, path: Path) -> None:
        self._path = path.resolve()
        self._describe()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_file"}

    @cached_property
    def _file(self) -> Any:
        raise NotImplementedError

    def _describe(self) -> None:
        self.shape, self.dtype = self._file.shape, self._file.dtype
