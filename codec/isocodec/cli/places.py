"""Where the curves of a written file lie, and a warning where its coordinates lose what is known of that."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .report import warn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..drawing.contour import Contour

LOST = 0.01
"""Share of a cell by which single precision may move points without a word."""


@dataclass
class Places:
    """What coordinates of contours are, as far as these have been seen.

    Attributes
    ----------
    points : int
        How many there are.
    largest : float
        Largest coordinate.
    placed : bool
        Whether they are others than samples.
    named : bool
        Whether their reference system is known.
    matrix : (n, n + 1) NDArray or None
        That of the placement of the last contour.
    """

    points: int = 0
    largest: float = 0.0
    placed: bool = False
    named: bool = False
    matrix: NDArray | None = None

    def see(self, contour: Contour) -> None:
        """Take another contour into account."""
        self.points += len(contour.points)
        # what lies on a mesh has coordinates of its own
        self.placed = contour.frame is not None or not contour.shape
        self.named = contour.placement is not None and contour.placement.epsg is not None
        self.matrix = None if contour.placement is None else contour.placement.matrix
        if len(contour.points):
            self.largest = max(self.largest, float(abs(contour.placed).max()))


def warn_of_places(source: Path, suffix: str, places: Places, keep_crs: bool, in_samples: bool) -> None:
    """Say so where a file does not say where its coordinates lie, or rounds them; not of what was asked for."""
    import numpy as np

    from ..io.writers.vector import VECTOR_SUFFIXES

    if not places.points:
        return
    where = "in a reference system that the file does not name" if places.placed else (
        "in samples: the file does not say where these lie"
    )
    remedy = "say it with encode --spacing and --metadata crs=EPSG:.."
    if suffix == ".geojson" and not (places.named or keep_crs or in_samples):
        warn(
            source,
            f"coordinates are no longitudes and latitudes, as GeoJSON has them (RFC 7946), but {where}; {remedy}, or "
            "use .gpkg",
        )
    if suffix in VECTOR_SUFFIXES and not (places.named or in_samples):
        warn(source, f"{suffix} is written without a reference system, and its coordinates are {where}; {remedy}")
    if suffix in (".ply", ".stl") and places.matrix is not None:
        lost = float(np.spacing(np.float32(places.largest)))
        steps = np.linalg.norm(places.matrix[:, :-1], axis=0)
        if lost > LOST * steps.min():
            warn(
                source,
                f"coordinates in {suffix} are rounded by up to {lost / 2:g}; use .obj or --in-samples to avoid that",
            )
