"""Operations on files: which kind of file has which, and requests of what to draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any, TypedDict

from ..deferred import dataclass
from ..errors import OptionError

Progress = Callable[[int, int], object]
NO_SURFACE = "this file has no triangulated surface: it stores only the samples or vertices next to its curves"
IMPOSSIBLE: dict[tuple[str, str], str] = {
    ("surface", "grid"): NO_SURFACE,
    ("surface", "series"): NO_SURFACE,
    ("surface", "mesh"): NO_SURFACE,
    ("surface", "tiles"): NO_SURFACE,
    ("window", "mesh"): "a window cannot be cut out of a file on a mesh: its cells and signs depend on the whole mesh",
    ("window", "surface"): "a window cannot be cut out of a triangulated surface: its triangles depend on all of its "
                           "points",
    ("decoder", "tiles"): "a tiled file cannot be decoded as a stream: its parts are read when they are needed, not "
                          "in order",
    ("labels", "mesh"): "only files of grids have labels; this file holds curves on a mesh",
    ("labels", "surface"): "only files of grids have labels; this file holds a triangulated surface",
    ("labels", "tiles"): "only files of grids have labels; this file holds curves in tiles",
    ("isovalues", "surface"): "a triangulated surface has no stored isovalues to choose from; a contour can be drawn "
                              "at any value",
    ("merge", "surface"): "triangulated surfaces cannot be merged: a file holds only one",
}
"""Operations that a kind of file cannot have, each with its error message; `OPERATIONS` lists all operations."""
OPERATIONS = (
    "encode", "save", "open", "info", "contour", "contours", "frames", "above", "valid", "labels", "surface", "mesh",
    "statistics", "verify", "notebook", "layers", "size", "window", "isovalues", "profile", "merge", "decoder",
)
"""Operations on files."""

ONE_FRAME = "it holds only one frame; to make a series, encode isocodec.Frames, or use --frames"
"""Remedy if a file does not have the frame asked for."""


def impossible(operation: str, kind: str) -> OptionError:
    """Make the error for an operation that a kind of file cannot have."""
    return OptionError(IMPOSSIBLE[operation, kind], code="kind")


_NAMES = {
    "grid": "curves of a grid", "series": "a series of frames", "mesh": "curves on a mesh",
    "surface": "a triangulated surface", "tiles": "curves in tiles",
}


class ViewOptions(TypedDict, total=False):
    """The parameters of `IsoFile.contour`, by name."""

    frame: int | None
    layers: int | None
    max_bytes: int | None
    window: Sequence[Sequence[float]] | None
    within: float | Callable[..., float] | None
    smooth: bool | None
    through_holes: bool
    partial: bool
    progress: Progress | None


@dataclass(frozen=True, kw_only=True)
class Viewed:
    """Request of what to draw from a file: `ViewOptions`, checked."""

    frame: int | None = None
    layers: int | None = None
    max_bytes: int | None = None
    window: Sequence[Sequence[float]] | None = None
    within: Any = None
    smooth: bool | None = None
    through_holes: bool = False
    partial: bool = False
    progress: Progress | None = None

    def __post_init__(self) -> None:
        check_count(self.layers, "layers")
        check_count(self.max_bytes, "max_bytes")
        if self.frame is not None and (
            isinstance(self.frame, bool) or not isinstance(self.frame, Integral) or self.frame < 0
        ):
            raise OptionError(f"frame is {self.frame}; it must be an integer, 0 or greater", code="frame")

    def refuse(self, kind: str, *names: str) -> None:
        """Raise `OptionError` if one of these parameters, which do not apply to a kind of file, is given."""
        for name in names:
            if getattr(self, name) not in (None, False):
                raise OptionError(f"{name} does not apply to {_NAMES[kind]}", code=name.replace("_", "-"))


def check_count(count: int | None, name: str) -> None:
    """Refuse a count that is not an integer of at least 1."""
    if count is not None and not (isinstance(count, Integral) and not isinstance(count, bool) and count >= 1):
        raise OptionError(f"{name} is {count}; it must be an integer of at least 1", code=name.replace("_", "-"))
