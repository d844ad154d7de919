"""Contents that `to_pictures` takes, until pictures have a module of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from numpy.typing import NDArray


class Picture(NamedTuple):
    """A picture that draws itself."""

    draw: Callable[[str], bytes]


class SampleMask(NamedTuple):
    """Samples that lie above an isovalue."""

    values: NDArray[Any]

    def taken(self) -> tuple[tuple[int, ...], Iterator[NDArray[Any]]]:
        """Shape, and all rows."""
        return self.values.shape, iter([self.values])
