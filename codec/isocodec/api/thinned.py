"""Make triangulated surfaces of few points: by the published thinning, or with the points that give the best file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any, Literal, TypeAlias

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
from .native import native

ThinningName: TypeAlias = Literal["AT1", "AT2", "AT3", "inf", "l2", "NAT"]
"""Name of a criterion for which point of a triangulation is least significant."""
MEMORY = 320
"""Most memory, in bytes, that thinning takes for each point, in addition to the input."""
_PIECE = 1 << 14
"""Removals between two reports of progress."""
Progress = Callable[[int, int], object]


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
        Step to which values are rounded, with ``to`` or ``size``; if not given, one that suits the error. With a
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
    what = native(what)
    what = what if isinstance(what, Mesh) else field_of(what)
    given, field, notes = _points_of(what, criterion is not None)
    notes = {**notes, **(metadata or {})}
    if contours is not None and field is None:
        raise OptionError(
            "a surface can be thinned for contours of a field only, not of scattered points", code="contours",
            remedy="encode the contours: encode(Mesh(points, None, values), isovalue, precision=..), or encode "
            "--key NAME --isovalue V --precision D",
        )
    if criterion is None and (error is not None or (contours is not None and tolerance is not None)):
        notes[PROMISE] = _promise(error, tolerance, contours)
    error, tolerance = _numbers(error, tolerance, what, notes)
    shape = None if field is None else (field.shape[0], field.shape[1])
    if criterion is not None:
        unused = {"size": size, "contours": contours, "tolerance": tolerance}
        if name := next((name for name, value in unused.items() if value is not None), ""):
            raise OptionError(f"a criterion and {name} cannot be combined", code="criterion",
                              remedy="leave the criterion out")
        _check_layers(layers)
        tin = _removed(given, criterion, to, error, shape, notes, progress)
        return tin if step is None and layers == 1 else _rounded(given, tin, step, layers)
    _check(error, to, size, step, layers, contours, tolerance)

    made: dict[int, tuple[ChosenPoints, Tin]] = {}

    def found(chosen: ChosenPoints) -> Tin:
        # a search asks for some of them again; while they are held here, no others have their identity
        if id(chosen) not in made:
            made[id(chosen)] = chosen, _surface(given, chosen, shape, layers, notes)
        return made[id(chosen)][1]

    def file(chosen: ChosenPoints) -> bytes:
        return b"".join(SurfaceEncoder(found(chosen), Options()))

    if error is not None:
        return found(within(given, float(error)))
    if contours is not None:
        assert tolerance is not None
        assert field is not None
        return found(near_contours(given, field, contours, float(tolerance)))
    if to is not None:
        return found(best(given, int(to), step))
    assert size is not None
    chosen = smallest(given, int(size), file, step)
    if (needed := len(file(chosen))) > size:
        raise OptionError(f"no surface fits into {size} bytes", code="size", remedy=f"allow {needed}")
    return found(chosen)


def _promise(error: float | str | None, tolerance: float | str | None, contours: Sequence[float] | None) -> str:
    """The note of a promise, with the distance as it was asked for."""
    given = error if error is not None else tolerance
    text = given.replace(" ", "") if isinstance(given, str) else f"{given:.12g}"
    values = [repr(float(value)).removesuffix(".0") for value in contours or ()]
    return text + (AT + " ".join(values) if contours is not None else "")


def _numbers(
    error: float | str | None, tolerance: float | str | None, what: Field | Mesh, notes: Mapping[str, str]
) -> tuple[float | None, float | None]:
    """The error in the unit of the values, the tolerance in samples."""
    if isinstance(error, str):
        error = converted(error, unit_of(notes.get(UNIT)), "the values")
    if isinstance(tolerance, str) and isinstance(what, Field):
        tolerance = in_cells(Precision(world=tolerance), what.placement, notes, {}, what.shape).tolerance
    return error, None if tolerance is None else float(tolerance)


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
    given: Points, criterion: str, to: int | None, error: float | None, shape: tuple[int, int] | None,
    metadata: Mapping[str, str], progress: Progress | None,
) -> Tin:
    """Thin by a criterion, as published."""
    if criterion not in NAMES:
        raise OptionError(f"unknown criterion {criterion!r}", code="criterion", remedy=f"one of {', '.join(NAMES)}")
    if (to is None) == (error is None):
        raise OptionError("give either to or error", code="thin", remedy="to=1000 or error=5.0")
    if to is not None and not (isinstance(to, Integral) and to >= 3):
        raise OptionError(f"{to} points cannot make a surface", code="points", remedy="give 3 or more")
    if error is not None and not (error >= 0):
        raise OptionError(f"the error is {error}; it must be 0 or greater", code="error")
    state = thinning(given.x, given.y, given.value, NAMES[criterion])
    least, most = (0, float(error)) if error is not None else (int(to or 0), math.inf)
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


def _check_layers(layers: int) -> None:
    if not (isinstance(layers, Integral) and layers >= 1):
        raise OptionError(f"{layers} layers; it must be an integer of at least 1", code="layers")
    if layers > MOST_LAYERS:
        raise OptionError(f"{layers} layers; a surface has at most {MOST_LAYERS}", code="layers")


def _check(
    error: float | None, to: int | None, size: int | None, step: float | None, layers: int,
    contours: Sequence[float] | None, tolerance: float | None,
) -> None:
    """Refuse invalid parameters of a surface for a file."""
    if sum(each is not None for each in (error, to, size, contours)) != 1:
        raise OptionError(
            "give exactly one of error, to, size or contours", code="tin", remedy="error=5.0, or size=2000"
        )
    if (contours is None) != (tolerance is None) or (tolerance is not None and not 0 < tolerance < math.inf):
        raise OptionError(
            "contours= needs a tolerance greater than 0, and tolerance= needs contours",
            code="tolerance", remedy="contours=[500], tolerance=0.5"
        )
    if contours is not None and not (len(contours) and np.isfinite(contours).all()):
        raise OptionError("contours= must be a sequence of finite numbers", code="isovalue", remedy="contours=[500]")
    if error is not None and not 0 <= error < math.inf:
        raise OptionError(f"the error is {error}; it must be 0 or greater", code="error")
    for what, number, least in (("points", to, 3), ("bytes", size, 1)):
        if number is not None and not (isinstance(number, Integral) and number >= least):
            raise OptionError(f"{number} {what}; it must be an integer of at least {least}", code=what)
    _check_layers(layers)
    if step is not None and (error is not None or contours is not None or not 0 < step < math.inf):
        raise OptionError(
            "step needs a number of points or a size, and must be greater than 0", code="step",
            remedy="with error=, the rounding step follows from the error",
        )
