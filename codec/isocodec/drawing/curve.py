"""Contours as polylines and surfaces: the basis of areas, bands, caps, tables and pictures."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..field.placement import Placement


class Curve(Protocol):
    """A curve or surface, as `Contour` describes it."""

    @property
    def points(self) -> NDArray[np.float64]: ...

    @property
    def cells(self) -> NDArray[np.int64]: ...

    @property
    def isovalue(self) -> float: ...

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def complete(self) -> bool: ...

    @property
    def placement(self) -> Placement | None: ...

    @property
    def metadata(self) -> dict[str, str]: ...

    @property
    def origin_above(self) -> bool | None: ...

    @property
    def masked(self) -> bool: ...

    @property
    def n(self) -> int: ...

    @property
    def bent(self) -> bool: ...

    @property
    def placed(self) -> NDArray[np.float64]: ...

    @property
    def joined(self) -> Curve: ...

    @property
    def flat(self) -> Curve: ...

    @property
    def lines(self) -> list[NDArray[np.float64]]: ...

    @property
    def walks(self) -> list[list[int]]: ...

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]: ...

    def along(self, walk: list[int]) -> NDArray[np.float64]: ...
