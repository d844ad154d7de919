"""Losses of placement and precision in the coordinates of a written file."""

from __future__ import annotations

import numpy as np

from ...drawing.contour import Contour
from ...field.reference_system import epsg_of, is_named
from .output_formats import Output, OutputOptions

LOST = 0.01
"""Fraction of a cell by which single precision may move points without a remark."""


class Losses:
    """Coordinates of the contours written so far, and what a format keeps of them.

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
        self._points = 0
        self._largest = 0.0
        self._step = 0.0
        self._placed = self._named = self._numbered = False

    def see(self, contour: Contour) -> None:
        """Take another contour into account."""
        self._points += len(contour.points)
        # contours on a mesh have the mesh's coordinates
        self._placed = contour.frame is not None or not contour.shape
        self._named, self._numbered = is_named(contour.placement), epsg_of(contour.placement) is not None
        matrix = None if contour.placement is None else contour.placement.matrix
        self._step = 0.0 if matrix is None else float(np.linalg.norm(matrix[:, :-1], axis=0).min())
        if self._output.single and len(contour.points):
            self._largest = max(self._largest, float(abs(contour.placed).max()))

    @property
    def remarks(self) -> tuple[str, ...]:
        """One line for each loss."""
        output, options = self._output, self._options
        if not self._points:
            return ()
        found = []
        unnamed = not (self._named or options.in_samples)
        where = "in a reference system that the file does not name" if self._placed else (
            "in samples, since the file does not state where these lie"
        )
        remedy = "encode with --spacing and --metadata crs=EPSG:.."
        if output.coordinates == "degrees" and not output.names_crs and unnamed and not options.keep_crs:
            found.append(
                f"the coordinates are {where}, not the longitudes and latitudes that GeoJSON requires (RFC 7946); "
                f"{remedy}, or write a GeoPackage"
            )
        elif output.names_crs and unnamed:
            found.append(
                f"{self._suffix} is written without a reference system, and its coordinates are {where}; {remedy}"
            )
        elif options.keep_crs and self._named and not self._numbered:
            found.append(f"{self._suffix} is written without the reference system, which has no EPSG number")
        if output.single and self._step:
            lost = float(np.spacing(np.float32(self._largest)))
            if lost > LOST * self._step:
                found.append(
                    f"coordinates in {self._suffix} are rounded by up to {lost / 2:g}; write OBJ or use --in-samples "
                    "to avoid that"
                )
        return tuple(found)
