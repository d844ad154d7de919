"""Images of other libraries that hold a field."""

from __future__ import annotations

from typing import Any, Protocol


class SpatialImage(Protocol):
    """An image of nibabel."""

    @property
    def affine(self) -> Any:
        """Where the samples lie."""

    @property
    def dataobj(self) -> Any:
        """The samples."""
