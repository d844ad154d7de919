"""Tables within kernels: arrays that are computed when a module is imported, or only when Python uses them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .execution import EXECUTION, Execution


class _Constant:
    """An array that is computed when it is first used."""

    def __init__(self, make: Callable[[], NDArray[Any]]) -> None:
        self._make = make

    @cached_property
    def _array(self) -> NDArray[Any]:
        return self._make()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self._array, dtype, copy=copy)

    def __getitem__(self, key: Any) -> Any:
        return self._array[key]

    def __len__(self) -> int:
        return len(self._array)


def constant(make: Callable[[], NDArray[Any]]) -> Any:
    """An array that kernels use as a constant of their module.

    The kernels of a library have it within them, so that it is not computed at all unless Python uses it.
    """
    if EXECUTION in (Execution.LIBRARY, Execution.CHECKED):
        return _Constant(make)
    return make()
