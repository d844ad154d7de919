"""Position of the viewer of a surface, and the upward direction.

A picture has world coordinates x, y and z, with z upwards; the front is at +y, as for a patient in a volume whose
coordinates are right, front and up. With a placement, these are the coordinates of the file. Without one, axes 0, 1, 2
of the array run down, back and left, since volumes are usually stored slice by slice from the top, and rows of a slice
from the front.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import OptionError
from ..curve import Curve

_STRETCH = 100.0
_UNPLACED = np.array([(0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)])


@dataclass(frozen=True)
class View:
    """A direction of view, in degrees.

    Attributes
    ----------
    azimuth : float
        Position of the viewer around the vertical: 0 at the front (+y), 90 on the side of +x, -180 to 360.
    elevation : float
        Angle above the horizon, -90 to 90.
    """

    azimuth: float
    elevation: float

    def __post_init__(self) -> None:
        if not -180 <= self.azimuth <= 360:
            raise OptionError(f"azimuth {self.azimuth:g}; it must lie between -180 and 360", code="view")
        if not -90 <= self.elevation <= 90:
            raise OptionError(f"elevation {self.elevation:g}; it must lie between -90 and 90", code="view")

    @property
    def towards(self) -> NDArray[np.float64]:
        """Unit vector (3,) from the surface to the viewer."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        return np.array([math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)])

    @property
    def right(self) -> NDArray[np.float64]:
        """Unit vector (3,) that points to the right in the picture."""
        a = math.radians(self.azimuth)
        return np.array([-math.cos(a), math.sin(a), 0.0])

    @property
    def up(self) -> NDArray[np.float64]:
        """Unit vector (3,) that points upwards in the picture."""
        return np.cross(self.towards, self.right)

    @property
    def screen(self) -> NDArray[np.float64]:
        """Matrix (3, 2) that maps world coordinates to right and up in the picture."""
        return np.stack([self.right, self.up], axis=1)

    @property
    def light(self) -> NDArray[np.float64]:
        """Unit vector (3,) to the light, over the viewer's left shoulder."""
        light = self.towards + 0.5 * self.up - 0.4 * self.right
        return np.asarray(light / np.linalg.norm(light))


USUAL = View(36.25, 24.3)
"""Default view: from one side, in front and above."""
NAMED = {
    "front": View(0, 0), "back": View(180, 0), "right": View(90, 0), "left": View(-90, 0), "top": View(0, 90),
    "bottom": View(0, -90),
}
"""Views by name; right and left are those of the object: +x and -x."""


def read_view(text: str) -> View:
    """Parse a view: a name, or azimuth and elevation separated by a comma.

    Raises
    ------
    OptionError
    """
    if text in NAMED:
        return NAMED[text]
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise OptionError(
            f"{text!r} is not a view", code="view", remedy=f"give AZIMUTH,ELEVATION, or one of {', '.join(NAMED)}"
        ) from None
    return View(azimuth, elevation)


def proportions(contour: Curve) -> NDArray[np.float64]:
    """Sample spacing along each axis, scaled so that the shortest is 1, and the longest at most ``_STRETCH``."""
    n = len(contour.shape)
    matrix = None if contour.placement is None else contour.placement.matrix
    if matrix is None:
        return np.ones(n)
    steps = np.linalg.norm(matrix[:, :n], axis=0)
    return np.minimum(steps / steps.min(), _STRETCH)


def upright(contour: Curve) -> NDArray[np.float64]:
    """Matrix (3, 3) from samples of a volume to the world of its picture, where the shortest step has length 1."""
    matrix = None if contour.placement is None else contour.placement.matrix
    if matrix is None:
        return _UNPLACED
    return matrix[:, :3] / np.linalg.norm(matrix[:, :3], axis=0) * proportions(contour)
