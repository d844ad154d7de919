"""Make triangulated surfaces of few points: by the published thinning, or with the points that give the best file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, OptionError
from ..field.meshed import Mesh
from ..field.sampled import UNIT, Field
from ..field.samples import missing_of
from ..field.units import converted, unit_of
from ..format.surface import MOST_LAYERS, values_of
from ..search.contour_tin import near_contours
from ..search.tin_fit import ChosenPoints, best, evenly, smallest, within
from ..stream.given import field_of, in_cells
from ..stream.options import Options, Precision
from ..stream.promises import AT, PROMISE
from ..stream.surface_encoder import SurfaceEncoder, surface_of
from ..tin.criteria import NAMES
from ..tin.delaunay import delaunay, triangles
from ..tin.points import Points, points_of
from ..tin.rank import by_rank
from ..tin.thinning import thin_to, thinning
from ..tin.tin import Removals, Tin, tin_of
from ..verbs import Progress, Thin, ThinningName
from .native import native

MEMORY = 320
"""Most memory, in bytes, that thinning takes for each point, in addition to the input."""
_PIECE = 1 << 14
"""Removals between two reports of progress."""


def thin(
    what: ArrayLike | Field | Mesh,
    *,
    criterion: ThinningName | None = None,
    to: int | None = None,
    error: float | str | None = None,
    size: int | None = None,
    contours: Sequence[float] | None = None,
    tolerance: float | str | None = None,
    step: float | None = None,
    layers: int = 1,
    metadata: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Tin:
    """Keep the most significant points of a terrain, a picture or scattered points, and triangulate them.

    With a ``criterion``, points are removed one by one, always the least significant one, as published; `encode` makes
    a file of those that are left. Without a criterion, the points and the rounding of their values are chosen so that
    the file is small.

    Parameters
    ----------
    what : Field, (s0, s1) array_like, or Mesh without cells
        Samples of a terrain or a picture, which lie at their indices; or scattered points with values. Positions that
        do not fit a grid of ``2**28`` steps are rounded to ``2**24`` steps of the longer side. Points that coincide are
        merged into one with the mean of their values.
    criterion : str, optional
        How points are ranked; the point whose removal does least harm goes first. ``AT1``: largest error in the
        triangles around the point; ``AT2``: error at the point itself; ``AT3``: the same, estimated from triangles in
        each direction, which is fastest; ``inf``: largest error over all points; ``l2``: growth of the sum of squared
        errors; ``NAT``: distance to the nearest point, whatever the values. Needs ``to`` or ``error``.
    to : int, optional
        How many points are left; without a criterion, these and their values are chosen so that the sum of squared
        errors is small. Corners of the convex hull always stay.
    error : float or str, optional
        Largest distance of the surface from any value, in the unit of the values; or with a unit, "2m". With a
        criterion, this is before a file rounds values that are not whole.
    size : int, optional
        Largest size of the file, in bytes; points and values are chosen as for ``to``.
    contours : sequence of float, optional
        Isovalues: the surface keeps their contours and little else of the field.
    tolerance : float or str, optional
        With ``contours``: largest distance, in samples, between their contours and those of the field, both ways; or in
        the world with a unit, "10m".
    step : float, optional
        Step of rounded values, with ``to`` or ``size``; if not given, one that suits the error. With a
        criterion: if not given, whole values are kept, and others rounded to a 65,535th of their range.
    layers : int
        Most layers in the file. Each adds points to those before, chosen so that any beginning of the file gives a good
        surface; eight or more make the steps small. This costs about a sixth more bytes than one layer.
    metadata : mapping of str to str, optional
        Notes for the file, in addition to those of the field.
    progress : callable, optional
        With a criterion: called with the number of points removed and the largest number that can be.

    Returns
    -------
    Tin
        With a criterion, `Tin.order`, `Tin.anticipated` and `Tin.errors` describe the removed points, and `Tin.at`
        gives earlier surfaces.

    Raises
    ------
    InputError
        If there are fewer than three distinct points, all lie on a line, or numbers are not finite.
    OptionError
        If not exactly one of ``to``, ``error``, ``size`` and ``contours`` is given, or if a number is out of range.

    Notes
    -----
    The result does not depend on the order of the points. Memory: up to `MEMORY` bytes a point, 3.2 GB for ten
    million; with ``layers``, up to 2,000 more for each. Time grows with ``N log N``; with ``layers``, a search takes
    some three times as long.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:32, :32]
    >>> len(thin(np.hypot(x - 9.5, y - 20), criterion="AT1", to=50))
    50
    """
    options = Thin(criterion=criterion, to=to, error=error, size=size, tolerance=tolerance, step=step, layers=layers,
                   contours=None if contours is None else tuple(contours))
    return thinned(native(what), options, metadata, progress)


def thinned(
    what: Any, options: Thin, metadata: Mapping[str, str] | None = None, progress: Progress | None = None
) -> Tin:
    """Thin a field or points as `thin` does."""
    options.check()
    if options.layers > MOST_LAYERS:
        raise OptionError(f"{options.layers} layers; a surface has at most {MOST_LAYERS}", code="layers")
    what = what if isinstance(what, Mesh) else field_of(what)
    contours, layers, step = options.contours, options.layers, options.step
    given, field, notes = _points_of(what, options.criterion is not None)
    notes = {**notes, **(metadata or {})}
    if contours is not None and field is None:
        raise OptionError(
            "a surface can be thinned for contours of a field only, not of scattered points", code="contours",
            remedy="encode the contours: encode(Mesh(points, None, values), isovalue, precision=..), or encode "
            "--key NAME --isovalue V --precision D",
        )
    if options.criterion is None and (options.error is not None or contours is not None):
        notes[PROMISE] = _promise(options)
    options = _in_units(options, what, notes)
    options.check()
    shape = None if field is None else (field.shape[0], field.shape[1])
    if options.criterion is not None:
        tin = _removed(given, options, shape, notes, progress)
        return tin if step is None and layers == 1 else _rounded(given, tin, step, layers)
    made: dict[int, tuple[ChosenPoints, Tin]] = {}

    def found(chosen: ChosenPoints) -> Tin:
        # a search asks for some of them again; while they are held here, no others have their identity
        if id(chosen) not in made:
            made[id(chosen)] = chosen, _surface(given, chosen, shape, layers, notes)
        return made[id(chosen)][1]

    def file(chosen: ChosenPoints) -> bytes:
        return b"".join(SurfaceEncoder(found(chosen), Options()))

    if options.error is not None:
        return found(within(given, float(options.error)))
    if contours is not None:
        assert field is not None
        assert options.tolerance is not None
        return found(near_contours(given, field, contours, float(options.tolerance)))
    if options.to is not None:
        return found(best(given, int(options.to), step))
    assert options.size is not None
    chosen = smallest(given, int(options.size), file, step)
    if (needed := len(file(chosen))) > options.size:
        raise OptionError(f"no surface fits into {options.size} bytes", code="size", remedy=f"allow {needed}")
    return found(chosen)


def _promise(options: Thin) -> str:
    """The note of a promise, with the distance as it was asked for."""
    given = options.error if options.error is not None else options.tolerance
    text = given.replace(" ", "") if isinstance(given, str) else f"{given:.12g}"
    values = [repr(float(value)).removesuffix(".0") for value in options.contours or ()]
    return text + (AT + " ".join(values) if values else "")


def _in_units(options: Thin, what: Field | Mesh, notes: Mapping[str, str]) -> Thin:
    """Convert the error to the unit of the values, the tolerance to samples."""
    error, tolerance = options.error, options.tolerance
    if isinstance(error, str):
        error = converted(error, unit_of(notes.get(UNIT)), "the values")
    if isinstance(tolerance, str) and isinstance(what, Field):
        tolerance = in_cells(Precision(world=tolerance), what.placement, notes, {}, what.shape).tolerance
    return replace(options, error=error, tolerance=tolerance)


def _points_of(what: Any, partial: bool) -> tuple[Points, NDArray[np.float64] | None, dict[str, str]]:
    """Points to thin, the field that they sample, and its notes; with ``partial``, samples may be missing."""
    if isinstance(what, Mesh):
        if what.cells is not None or what.values is None:
            raise InputError("thin needs scattered points with values: a Mesh without cells", code="mesh",
                             remedy="give Mesh(points, None, values)")
        return points_of(what.points, what.values), None, what.metadata
    field = field_of(what)
    notes = dict(field.metadata)
    if field.placement is not None:
        notes.update(field.placement.notes())
    gone = missing_of(field.values, field.mask)
    if not gone.any():
        return points_of(field.values), np.asarray(field.values, np.float64), notes
    if not partial:
        raise InputError("samples are missing, but a surface in a file cannot have holes", code="missing",
                         remedy="give the remaining samples as scattered points: Mesh(points, None, values)")
    there = np.flatnonzero(~gone)
    given = points_of(np.argwhere(~gone), np.asarray(field.values)[~gone])
    return replace(given, source=there[given.source]), np.asarray(field.values, np.float64), notes


def _surface(
    given: Points, chosen: ChosenPoints, shape: tuple[int, int] | None, layers: int, metadata: Mapping[str, str]
) -> Tin:
    """Make the surface of chosen points, with values as the file will have them."""
    head, parts = surface_of(given, chosen, shape, layers)
    some = np.sort(chosen.some)
    cells = triangles(delaunay(given.x[some], given.y[some])[0]).astype(np.int64)
    values = np.array(values_of(head, parts.numbers[by_rank(*parts.points.T)].tolist()))
    return Tin(given.positions[some], values, cells, shape, metadata=metadata, coded=(head, parts))


def _removed(
    given: Points, options: Thin, shape: tuple[int, int] | None, metadata: Mapping[str, str], progress: Progress | None
) -> Tin:
    """Thin by a criterion, as published."""
    state = thinning(given.x, given.y, given.value, NAMES[str(options.criterion)])
    least, most = (int(options.to), math.inf) if options.to is not None else (0, float(options.error or 0))
    while not thin_to(state, least, most, _PIECE):
        if progress:
            progress(state.reg.removed, len(given.x) - least)
    count = state.reg.removed
    order = state.order[:count]
    left = np.ones(len(given.x), np.bool_)
    left[order] = False
    removals = Removals(
        given, np.sort(given.source[left]), given.source[order], state.anticipated[:count].copy(),
        state.largest[:count].copy(),
    )
    return tin_of(given, np.flatnonzero(left), shape, metadata, removals)


def _rounded(given: Points, tin: Tin, step: float | None, layers: int) -> Tin:
    """A surface that was thinned by a criterion, with values and layers as the file will have them."""
    some = np.flatnonzero(np.isin(given.source, tin.kept))
    chosen = replace(evenly(replace(given, value=given.value[some]), step, False), some=some)
    return replace(_surface(given, chosen, tin.shape, layers, tin.metadata), removals=tin.removals)
