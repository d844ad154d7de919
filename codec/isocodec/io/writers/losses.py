"""Losses of placement and precision in the coordinates of a written file."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...drawing.contour import Contour
from ...field.placement import Placement
from ...field.reference_system import is_named, short_name
from .output_formats import Output, OutputOptions
from .things import PlacedTin

LOST = 0.01
"""Fraction of a cell by which single precision may move points without a remark."""


class Losses:
    """Coordinates of what has been written so far, and what a format keeps of them.

    Parameters
    ----------
    output : Output
    suffix : str
    options : OutputOptions
        Losses that the user asked for are not reported.
    """

    def __init__(self, output: Output, suffix: str, options: OutputOptions) -> None:
        self._output = output
        self._suffix = suffix
        self._options = options
        self._seen = False
        self._largest = self._step = 0.0
        self._placement: Placement | None = None
        self._placed = False

    def see(self, what: Any) -> None:
        """Take a contour, a mesh, a surface or a mask into account."""
        self._placement = placement = what.placement
        # what lies on a mesh or at scattered points has their coordinates
        free = isinstance(what, Contour | PlacedTin) and not (what.tin if isinstance(what, PlacedTin) else what).shape
        self._placed = free or (placement is not None and placement.placed)
        if isinstance(what, Contour):
            self._seen |= bool(len(what.points))
            self._step = 0.0 if what.frame is None else float(np.linalg.norm(what.frame, axis=0).min())
            if self._output.single and len(what.points):
                self._largest = max(self._largest, float(abs(what.placed).max()))
        else:
            self._seen = True

    @property
    def remarks(self) -> tuple[str, ...]:
        """One line for each loss."""
        output, options, placement, suffix = self._output, self._options, self._placement, self._suffix
        if not self._seen or output.coordinates == "samples":
            return ()
        found = []
        named, space = is_named(placement), None if placement is None else placement.space
        where = "in a reference system that the file does not name" if self._placed else (
            "in samples, since the file does not state where these lie"
        )
        remedy = "encode with --spacing and --crs EPSG:.."
        if named or space or options.in_samples:
            crs = short_name((placement.crs if placement else None) or "")
            if not options.in_samples and not (output.names_space if space else output.names_crs):
                found.append(f"{suffix} does not state the reference system of its coordinates: {crs}")
        elif output.coordinates == "degrees" and not options.keep_crs:
            found.append(
                f"the coordinates are {where}, not the longitudes and latitudes that GeoJSON requires (RFC 7946); "
                f"{remedy}, or write a GeoPackage"
            )
        elif output.names_crs and output.coordinates != "degrees":
            found.append(f"{suffix} is written without a reference system, and its coordinates are {where}; {remedy}")
        if output.kind in ("mask", "labels") and placement is not None and placement.coordinates is not None:
            found.append(f"{suffix} does not keep the coordinates of its samples, which no matrix describes")
        if output.single and self._step:
            lost = float(np.spacing(np.float32(self._largest)))
            if lost > LOST * self._step:
                found.append(
                    f"coordinates in {suffix} are rounded by up to {lost / 2:g}; write OBJ or use --in-samples "
                    "to avoid that"
                )
        return tuple(found)
