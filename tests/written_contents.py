"""Curves, areas, surfaces, meshes and masks in several places, made once, for tests of writers."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import isocodec
from isocodec.field.placement import LPS, RAS, Placement
from isocodec.io.formats import Areas, OutputOptions, SampleMask, Written, write

CELL = 30.0


def on_map(x: float, dx: float, y: float, dy: float) -> np.ndarray:
    """A matrix with x along axis 1 and y along axis 0."""
    return np.array([[0, dx, x], [dy, 0, y]])


PLACES: dict[str, tuple[Any, str | None]] = {
    "samples": (None, None),
    "unnamed": (on_map(5e5, CELL, 5e6, -CELL), None),
    "utm": (on_map(5e5, CELL, 5e6, -CELL), "EPSG:32631"),
    "mirrored": (on_map(5e5, CELL, 5e6, CELL), "EPSG:32631"),
    "turned": (np.array([[12, 25, 4e5], [-20, 9, 6e6]]), "EPSG:25832"),
    "across 180": (on_map(58e4, 4e3, 74e5, -4e3), "EPSG:32660"),
    "to 360": (on_map(165, 1, 20, -1), "EPSG:4326"),
    "beyond 180": (on_map(200, 1, 20, -1), "EPSG:4326"),
    "north pole": (on_map(-6e5, 4e4, 48e4, -4e4), "EPSG:3413"),
    "south pole": (on_map(-6e5, 4e4, 48e4, -4e4), "EPSG:3031"),
    "plane": (np.array([[0.5, 0, 3], [0, 0.7, -2], [0.1, 0.2, 9]]), RAS),
}
SPACES: dict[str, tuple[Any, str | None]] = {
    "samples": (None, None),
    "ras": (np.array([[-0.7, 0, 0, 30], [0, 0.8, 0.1, -20], [0, 0, 1.5, 7]]), RAS),
    "lps": (np.array([[0.7, 0, 0, 30], [0, 0.8, 0, -20], [0, 0, 1.5, 7]]), LPS),
}


def bumps() -> np.ndarray:
    """Integers with a hill, a hollow in it and a slope that leaves the field."""
    i, j = np.indices((25, 31))
    far = np.hypot(i - 12, 0.8 * (j - 15))
    return np.rint(100 - 8 * np.abs(far - 5) + 3 * (j > 24) * (j - 24) ** 2).astype(np.int32)


def ball() -> np.ndarray:
    """Integers that are largest in the middle, with a slope."""
    i, j, k = np.indices((11, 12, 13))
    return np.rint(90 - 13 * np.sqrt((i - 5) ** 2 + 0.8 * (j - 5.5) ** 2 + (k - 6) ** 2) - i).astype(np.int32)


def _placed(place: tuple[Any, str | None]) -> Placement | None:
    return None if place[0] is None else Placement(place[0], crs=place[1])


@cache
def plane(place: str = "samples") -> isocodec.IsoFile:
    """A file of three isovalues, the last beyond the data."""
    field = isocodec.Field(bumps(), placement=_placed(PLACES[place]))
    return isocodec.open(isocodec.encode(field, [60.5, 80.5, 900.5], precision="exact"))


@cache
def volume(place: str = "samples") -> isocodec.IsoFile:
    """A file of three isovalues in space, the last beyond the data."""
    field = isocodec.Field(ball(), placement=_placed(SPACES[place]))
    return isocodec.open(isocodec.encode(field, [30.5, 50.5, 900.5], precision="exact"))


@cache
def content(name: str, place: str = "samples") -> Any:
    """A content of tests, by name."""
    if name in ("surface", "surfaces", "no surface", "solid", "mask of space", "labels of space"):
        file = volume(place)
        found = file.contours()
        return {
            "surface": lambda: found[1], "surfaces": lambda: found[:2], "no surface": lambda: found[2],
            "solid": lambda: file.mesh(50.5), "mask of space": lambda: SampleMask(ball() > 50.5, file.placement),
            "labels of space": lambda: SampleMask(np.digitize(ball(), [30, 50]).astype(np.int16), file.placement),
        }[name]()
    file = plane(place)
    found = file.contours()
    return {
        "curve": lambda: found[1], "curves": lambda: found[:2], "no curve": lambda: found[2],
        "above": lambda: Areas([found[1]], "above"), "below": lambda: Areas([found[1]], "below"),
        "no areas": lambda: Areas([found[2]], "above"), "bands": lambda: Areas(found, "bands"),
        "mesh": lambda: file.mesh(80.5), "mask": lambda: SampleMask(bumps() > 80.5, file.placement),
        "labels": lambda: SampleMask(np.digitize(bumps(), [30, 60]).astype(np.int16), file.placement),
        "tin": lambda: isocodec.thin(isocodec.Field(bumps().astype(float), placement=_placed(PLACES[place])), to=150),
    }[name]()


def written(folder: Path, suffix: str, what: Any, **options: Any) -> tuple[Path, Written]:
    """Write a content, by itself or by name."""
    path = folder / f"a{suffix}"
    return path, write(path, content(*what) if isinstance(what, tuple) else what, OutputOptions(**options))
