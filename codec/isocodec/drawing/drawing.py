"""The entry to the drawing: chooses between the grid's edges and the simplices' edges."""

from __future__ import annotations

from ..errors import OptionError
from .contour import Contour
from .full_grid import draw_grid
from .leaves import Leaves
from .simplices import draw_simplices
from .smoothing import smoothed


def draw(leaves: Leaves, *, complete: bool = True, smooth: bool = False) -> Contour:
    """Draw the isocontour (n = 2) or isosurface (n = 3) that runs through mixed leaf simplices.

    On the full grid (``leaves.full``) the points lie on grid edges: those of marching squares and of marching
    cubes. Elsewhere every leaf gives one segment, one triangle or one quadrangle cut in two (Lewiner et al. 2004),
    with one point on each crossing edge of the mesh.

    Parameters
    ----------
    leaves : Leaves
        Mixed leaves of one isovalue in 2 or 3 dimensions.
    complete : bool
        Whether everything that belongs to these leaves was received; passed on to the result.
    smooth : bool
        Move points that nothing is stated of but their edge (`isocodec.drawing.smoothing`).

    Returns
    -------
    Contour
        Coordinates in samples, axes in the order of the array. Orientation: see `Contour`.

    Raises
    ------
    OptionError
        If the field has neither 2 nor 3 axes.
    """
    n = len(leaves.shape)
    if n not in (2, 3):
        raise OptionError(f"cannot draw a field with {n} axes, only with 2 or 3", code="dimension")
    drawn = draw_grid(leaves) if leaves.full else draw_simplices(leaves)
    points = smoothed(leaves, drawn) if smooth else drawn.points
    return Contour(points, drawn.cells, leaves.isovalue, tuple(leaves.shape), complete)
