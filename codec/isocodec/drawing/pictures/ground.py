"""Coordinates of a contour map: reference system, names of x and y, and lengths of their units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...deferred import dataclass
from ...errors import OptionError
from ...extras import optional
from ...field.reference_system import DEGREES, is_named, short_name, system_of
from ..curve import Curve


@dataclass(frozen=True)
class Ground:
    """Coordinates of a contour as a map shows them.

    Attributes
    ----------
    name : str
        Name of the reference system.
    axes : tuple of str
        Names of x and y.
    placed : bool
        Whether they are world coordinates, with y upwards.
    shrinks : float
        Length of a unit of x in the middle of the map, in units of y; less than 1 for degrees.
    scale : float
        Length of a unit of x, in ``unit``.
    unit : str
    """

    name: str = "coordinates in samples"
    axes: tuple[str, str] = ("column", "row")
    placed: bool = False
    shrinks: float = 1.0
    scale: float = 1.0
    unit: str = "samples"

    def written(self, at: float, axis: int, steps: Sequence[float]) -> str:
        """Format the coordinate of one of a row of evenly spaced ticks."""
        step = abs(steps[1] - steps[0]) if len(steps) > 1 else max(abs(at), 1e-9)
        digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
        if self.axes[axis] not in (_LONGITUDE, _LATITUDE):
            return f"{at + 0.0:,.{digits}f}"
        if self.axes[axis] == _LONGITUDE:
            at = (at + 180) % 360 - 180
        letters = "WE" if self.axes[axis] == _LONGITUDE else "SN"
        neither = abs(at) < step / 2 or abs(at) == 180
        return f"{abs(at):.{digits}f}\u00b0{'' if neither else letters[int(at > 0)]}"

    def steps(self, axis: int, span: float) -> list[float]:
        """First digits of the steps between ticks; for many degrees 15, 30, 45, 60, 90."""
        round_the_globe = self.axes[axis] in (_LONGITUDE, _LATITUDE) and span > 50
        return [1, 1.5, 3, 4.5, 6, 9, 10] if round_the_globe else [1, 2, 5, 10]


_LONGITUDE, _LATITUDE = "longitude", "latitude"


def ground_of(contour: Curve) -> Ground:
    """Find the coordinates of a 2-D contour: the system by its EPSG number, with lengths on the ellipsoid.

    Raises
    ------
    MissingExtraError
        If there is a reference system, but pyproj is not installed.
    """
    placement = contour.placement
    if placement is None or not placement.placed:
        return Ground()
    text = short_name(placement.crs or "")
    unit = (placement.unit or "").split(" ")[0] or "units of x"
    bare = Ground(text or "reference system not stated", ("x", "y"), True, unit=unit)
    if not is_named(placement):
        return bare
    pyproj = optional("pyproj", extra="geo", purpose=f"a map in {text}")
    try:
        system = system_of(placement)
        degrees = pyproj.Transformer.from_crs(system, f"EPSG:{DEGREES}", always_xy=True)
    except (pyproj.exceptions.ProjError, OptionError):
        return bare
    name = system.name if placement.epsg is None else f"{system.name} ({placement.crs})"
    shape = np.array(contour.shape) - 1.0
    (middle,) = contour.place(shape[None] / 2)
    step = float(np.abs(contour.place(np.array([[0.0, 0.0], shape])) - middle).max() / 100)
    ends = middle + np.array([[-step, 0], [step, 0], [0, -step], [0, step]])
    longitude, latitude = degrees.transform(ends[:, 0], ends[:, 1])
    if not (np.isfinite(longitude).all() and np.isfinite(latitude).all()):
        return bare
    _, _, metres = system.get_geod().inv(longitude[::2], latitude[::2], longitude[1::2], latitude[1::2])
    if not (np.isfinite(metres).all() and min(metres) > 0):
        return bare
    unit = system.axis_info[0].unit_name if system.axis_info else ""
    if system.is_geographic:
        return Ground(name, (_LONGITUDE, _LATITUDE), True, metres[0] / metres[1], metres[0] / (2 * step), "m")
    short = "m" if unit == "metre" else unit
    return Ground(name, (f"easting ({short})", f"northing ({short})"), True, 1.0, metres[0] / (2 * step), "m")
