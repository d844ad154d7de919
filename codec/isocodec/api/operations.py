"""Operations on files: which kind of file has which, and what to draw by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypedDict

from ..errors import OptionError
from ..verbs import Progress

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
    ("isovalues", "surface"): "a triangulated surface has no stored isovalues to choose from; a contour can be drawn "
                              "at any value",
    ("merge", "surface"): "triangulated surfaces cannot be merged: a file holds only one",
}
"""Operations that a kind of file cannot have, each with its error message."""

ONE_FRAME = "it holds only one frame; to make a series, encode isocodec.Frames, or use --frames"
"""Remedy if a file does not have the frame asked for."""


def impossible(operation: str, kind: str) -> OptionError:
    """Make the error for an operation that a kind of file cannot have."""
    return OptionError(IMPOSSIBLE[operation, kind], code="kind")


class ViewOptions(TypedDict, total=False):
    """The parameters of `IsoFile.contour`, by name."""

    frame: int | None
    layers: int | None
    max_bytes: int | None
    window: Sequence[Sequence[float]] | None
    bbox: Sequence[float] | None
    within: float | Callable[..., float] | None
    smooth: bool | None
    through_holes: bool
    partial: bool
    progress: Progress | None
