"""Placement of samples in the world, one record from reader to writer (spec clauses 3.7.2, 3.7.4)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from numbers import Real
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, OptionError
from .coordinates import arrays_of, whole_cells
from .mapped import Mapped, between
from .stretch import SAMPLED, GroundScale, ground_of, is_geographic, largest_step
from .units import DEGREE, METRES, distance_of, units_of

if TYPE_CHECKING:
    from fractions import Fraction
    from typing import Unpack

PLACEMENT = "placement"
"""Name of the note that holds the numbers."""
CRS = "crs"
"""Name of the note that names their coordinate reference system: ``EPSG:32631``, or a definition in WKT 2."""
RAS, LPS = "right-anterior-superior", "left-posterior-superior"
SPACES = {RAS: "RAS", LPS: "LPS"}
"""Reference systems of bodies, by the sides of these that x, y, z run to, as NRRD names them, and in short; files of
volumes are read in the first."""
COORDINATE_UNIT = "coordinate_unit"
"""Name of the note with the unit of the coordinates: ``mm``, or one for each coordinate: ``degree degree m``."""
LEAST, MOST = 1e-30, 1e30
"""Sizes of numbers, but for 0: coordinates then fit single precision, their squares double precision."""
TURN = 360.0
"""Period of longitudes."""
DEFAULT_ERROR = 0.005
"""Largest distance in cells between coordinates given and kept, if nothing else is asked for."""
MOST_ERROR = 0.5
_AXES = 3
_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?")
"""Numbers as in JSON."""
_EPSG = re.compile("EPSG:([1-9][0-9]{0,5})")

Array = NDArray[np.float64]


class _More(TypedDict, total=False):
    """Attributes of `Placement` that are given by name."""

    inferred: bool
    unit: str | None


@dataclass(frozen=True, eq=False, init=False)
class Placement:
    """Placement of the samples of a field in the world.

    Attributes
    ----------
    matrix : (n, n + 1) float64, or None
        A row for each coordinate x, y (, z): what a step along each axis of the array adds to it, and its value at
        sample 0. Of a field of two axes that is a plane in space (3, 3): with a row for z.
    coordinates : sequence of n arrays, or None
        Instead of a matrix: an array of one axis for each axis of the field, in the field's order (in the plane x runs
        along axis 1, in space x, y, z along the axes 0, 1, 2); or x, y (, z) as arrays of n axes that broadcast to the
        shape of the field. Those of a decoded file include the plane that closes a periodic axis.
    crs : str or None
        Reference system of the coordinates: ``EPSG:32631``, or a definition in WKT 2 or PROJJSON if it has no number;
        in a body ``"right-anterior-superior"`` or ``"left-posterior-superior"``, the sides that x, y, z run to.
    periodic : tuple of int
        Axes along which the first sample follows on the last one. One number may be given.
    periods : tuple of float
        Distances after which x, y (, z) are the same, 0 for never; empty if no coordinate has a period. One number is
        that of x.
    error : float or None
        Largest error of coordinates in a file, in cells, at most `MOST_ERROR`; `DEFAULT_ERROR` if None.
    remark : str
        What the source states and is left out, and why; or nothing.
    inferred : bool
        Whether axes are periodic because their coordinates go round, not because the user asked for it: where a mesh
        is searched for, their ends are then left open.
    unit : str or None
        Unit of the coordinates, ``mm``; or one for each, ``degree degree m``. A reference system that states its units
        comes before it.

    Raises
    ------
    OptionError
        If a number is out of range, or attributes cannot be combined.
    InputError
        If coordinates are not arrays.
    """

    matrix: Array | None
    coordinates: Sequence[NDArray[Any]] | None
    crs: str | None
    periodic: tuple[int, ...]
    periods: tuple[float, ...]
    error: float | None
    remark: str
    inferred: bool
    unit: str | None

    def __init__(
        self, matrix: ArrayLike | None = None, coordinates: Sequence[ArrayLike] | None = None, crs: str | None = None,
        periodic: int | Sequence[int] | None = None, periods: float | Sequence[float] | None = None,
        error: float | None = None, remark: str = "", **more: Unpack[_More],
    ) -> None:
        axes, turns = _axes_of(periodic), _periods_of(periods)
        if error is not None and not (isinstance(error, Real) and 0 < float(error) <= MOST_ERROR):
            raise OptionError(
                f"the error of coordinates is {error!r}; it must be a number of cells, at most {MOST_ERROR}",
                code="coordinates",
            )
        if matrix is not None and coordinates is not None:
            raise OptionError("a matrix and coordinates cannot be combined", code="options", remedy="give one of them")
        name = "an error" if error is not None else "a period" if turns else ""
        if name and coordinates is None and (matrix is None or not axes):
            raise OptionError(f"{name} can be given only together with coordinates", code="coordinates",
                              remedy="give coordinates")
        given: dict[str, Any] = {
            "matrix": None if matrix is None else np.asarray(matrix), "coordinates": _arrays(coordinates), "crs": crs,
            "periodic": axes, "periods": turns, "error": error, "remark": remark, "inferred": False, "unit": None,
        }
        if unknown := more.keys() - given.keys():
            raise TypeError(f"a placement has no {', '.join(unknown)}")
        given.update(more)
        for attribute, value in given.items():
            object.__setattr__(self, attribute, value)

    def __repr__(self) -> str:
        kind = "matrix" if self.matrix is not None else "coordinates" if self.coordinates is not None else ""
        parts = [kind] if kind else []
        names = ("crs", "unit", "periodic", "periods")
        parts += [f"{name}={value!r}" for name in names if (value := getattr(self, name))]
        return f"Placement({', '.join(parts)})"

    @property
    def placed(self) -> bool:
        """Whether the samples have coordinates in the world."""
        return self.matrix is not None or self.coordinates is not None

    @property
    def epsg(self) -> str | None:
        """EPSG number of the reference system; None if the samples have no coordinates, or the system no number."""
        found = _EPSG.fullmatch(self.crs or "")
        return found[1] if found and self.placed else None

    @property
    def space(self) -> str | None:
        """The reference system in short, ``"RAS"`` or ``"LPS"``, if the samples lie in a body; else None."""
        return SPACES.get(self.crs or "") if self.placed else None

    @property
    def grid(self) -> tuple[int, ...]:
        """Samples along each axis, of coordinates; empty of a matrix."""
        if self.coordinates is None:
            return ()
        if isinstance(self.coordinates, Mapped):
            return self.coordinates.shape
        shapes = [np.shape(part) for part in self.coordinates]
        if all(len(shape) == 1 for shape in shapes):
            return tuple(shape[0] for shape in shapes)
        return tuple(np.max(np.array(shapes), axis=0).tolist())

    def nodes(self) -> list[Array]:
        """Coordinates x, y (, z) of the samples: float64 arrays that broadcast to `grid`."""
        if self.coordinates is None:
            return []
        return list(self.coordinates) if isinstance(self.coordinates, Mapped) else arrays_of(
            self.coordinates, self.grid
        )

    @property
    def in_space(self) -> bool:
        """Whether this places a field of two axes on a plane in space, with three coordinates."""
        return self.matrix is not None and self.matrix.shape == (_AXES, _AXES)

    @property
    def flat(self) -> Placement:
        """Coordinates within the plane of a plane in space, all distances kept; of others the placement itself.

        Space is turned by the least angle that brings the plane at right angles to an axis, to that which it leans
        towards least from, and the coordinate along this axis is left out: a plane z = 7 keeps x and y as they are.
        """
        if self.matrix is None or not self.in_space:
            return self
        normal = np.cross(*(column / np.linalg.norm(column) for column in self.matrix[:, :2].T))
        normal /= np.linalg.norm(normal)
        # of several that are equally near the last, but for rounding
        axis = int(np.flatnonzero(abs(normal) > abs(normal).max() - 1e-9)[-1])
        normal *= np.copysign(1.0, normal[axis])
        up = np.eye(_AXES)[axis]
        x, y, z = np.cross(normal, up)
        turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turned = (np.eye(_AXES) + turn + turn @ turn / (1 + normal[axis])) @ self.matrix
        same = axis == _AXES - 1 and not turn.any()
        return replace(self, matrix=np.delete(turned, axis, axis=0), crs=self.crs if same else None)

    def lifted(self, points: Array) -> Array:
        """Places (P, 3) of points of a plane in space whose coordinates are those of `flat`, (P, 2) float64."""
        return self.place(self.flat.index(points))

    def with_nodes(self, shape: Sequence[int]) -> Placement:
        """Replace the matrix by coordinates, for a field of that shape.

        Raises `OptionError` if it is that of a plane in space.
        """
        if self.matrix is None:
            return self
        n = len(shape)
        if self.in_space:
            raise OptionError("a plane in space has no periodic axes", code="periodic")
        matrix = matrix_of(self.matrix, n)
        steps = [np.arange(size).reshape([-1 if a == axis else 1 for a in range(n)]) for axis, size in enumerate(shape)]
        out = []
        for row in matrix:
            parts = [row[axis] * steps[axis] for axis in range(n) if row[axis] != 0]
            out.append(row[n] + sum(parts[1:], start=parts[0]))
        return replace(self, matrix=None, coordinates=tuple(out))

    def place(self, points: Array) -> Array:
        """Coordinates x, y (, z) of points (P, n) in index coordinates within the box, (P, n) float64.

        On a plane in space they are three, (P, 3).
        """
        if isinstance(self.coordinates, Mapped):
            return self.coordinates.place(points)
        if self.coordinates is not None:
            return self._between_nodes(points)
        n = points.shape[1]
        matrix = unplaced(n) if self.matrix is None else self.matrix
        # axis by axis: how a product of matrices is rounded depends on the library
        placed = sum(points[:, a, None] * matrix[:, a] for a in range(n)) + matrix[:, n]
        return np.asarray(placed)

    def index(self, places: Array) -> Array:
        """Index coordinates (P, n) float64 of places (P, m) by the matrix, the reverse of `place`.

        Beside a plane in space, those of the nearest point in the plane.
        """
        assert self.matrix is not None
        steps, away = self.matrix[:, :-1], (places - self.matrix[:, -1]).T
        index = np.linalg.lstsq(steps, away, rcond=None)[0] if self.in_space else np.linalg.solve(steps, away)
        return np.asarray(index.T, np.float64)

    def _between_nodes(self, points: Array) -> Array:
        """Multilinear within each unit cell, the one that closes a periodic axis included."""
        arrays = [closed(array, self.periodic) for array in self.nodes()]
        size = np.max([array.shape for array in arrays], axis=0)
        cell = np.clip(np.floor(points).astype(np.int64), 0, size - 2)
        out = np.empty(points.shape)
        for c, (array, period) in enumerate(zip(arrays, self.periods_of(len(arrays)), strict=True)):
            axes = tuple(axis for axis, count in enumerate(array.shape) if count > 1)
            out[:, c] = between(axes, array, cell, points - cell, period)
        return out

    def frame(self, at: Array | None = None) -> Array | None:
        """Steps along each axis in x, y (, z), (n, n) float64; on a plane in space (3, 2).

        Where samples have coordinates it is that of the unit cell around a point ``at`` (n,) in index coordinates, the
        first one if not given. None if the samples lie nowhere in the world.
        """
        if self.coordinates is None:
            return None if self.matrix is None else self.matrix[:, :-1]
        n = len(self.coordinates)
        corner = np.zeros((1, n)) if at is None else np.floor(at)[None]
        corner = np.minimum(corner, np.array(self.grid) - 2)
        steps = self.place(np.concatenate([corner, corner + np.eye(n)]))
        return (steps[1:] - steps[0]).T

    def mirrored(self, at: Array | None = None) -> bool:
        """Whether the way from index coordinates to the world turns left into right, in the cell of `frame`."""
        frame = self.flat.frame(at)
        return frame is not None and bool(np.linalg.det(frame) < 0)

    @property
    def closes(self) -> bool:
        """Whether places at both ends of a periodic axis are one point, and do not differ by a period."""
        if not self.periodic or self.coordinates is None:
            return False
        arrays = self.coordinates.values if isinstance(self.coordinates, Mapped) else self.nodes()
        shapes = [array.shape for array in arrays]
        periods = self.periods_of(len(shapes))
        return not any(
            period and shape[axis] > 1
            for period, shape in zip(periods, shapes, strict=True) for axis in self.periodic
        )

    def periods_of(self, n: int) -> list[float]:
        """Periods of n coordinates x, y (, z); 0 of those that have none.

        Raises `OptionError` if there are several, and not n.
        """
        periods = [*self.periods, *[0.0] * (n - len(self.periods))] if len(self.periods) < 2 else [*self.periods]
        if len(periods) != n:
            raise OptionError(
                f"periods are {self.periods}; they must be a positive number for x, or one for each of {n} coordinates",
                code="period", remedy="0 for coordinates without a period",
            )
        return periods

    def cells_of(self, distance: str, shape: tuple[int, ...], gone: NDArray[np.bool_] | None = None) -> float:
        """Least number of cells that a distance in the world is, anywhere and in any direction.

        Parameters
        ----------
        distance : str
            A number with a unit of length, ``0.2mm``, or of degrees where coordinates are these; without a unit cells.
            Lengths are those on the ground: on the ellipsoid where coordinates are longitudes and latitudes or those of
            a projection, whose scale counts.
        shape : tuple of int
            The field's.
        gone : (s0, .., sn-1) bool, optional
            Which samples are missing: cells that have one do not count.

        Raises
        ------
        OptionError
            If it is not a distance, if the samples lie nowhere in the world, or the unit of their coordinates is not
            known.
        InputError
            If the coordinates are not those of the field.
        MissingExtraError
            If it takes pyproj to know the reference system.
        """
        number, unit = distance_of(distance)
        if not unit:
            return number
        if self.in_space:
            return self.flat.cells_of(distance, shape, gone)
        ground = self.ground(distance, shape)
        n = len(shape)
        periods = self.periods_of(n)
        if self.matrix is not None and ground.axes is None:
            ends = np.indices((2,) * n).reshape(n, -1)
            arrays = [(sum(row[a] * ends[a] for a in range(n))).reshape((2,) * n) for row in matrix_of(self.matrix, n)]
            step = largest_step(arrays, [0.0] * n, np.ones((1,) * n, np.bool_), ground)
        else:
            # coordinates of a file include the plane that closes a periodic axis
            periodic = () if isinstance(self.coordinates, Mapped) else self.periodic
            arrays = arrays_of(self.with_nodes(shape).coordinates, shape)
            missing = np.zeros(shape, np.bool_) if gone is None else gone
            whole = whole_cells(closed(missing, periodic))
            step = largest_step([closed(array, periodic) for array in arrays], periods, whole, ground)
        if not step > 0:
            raise OptionError(f"a distance of {distance} needs samples that are not missing", code="tolerance",
                              remedy="give a number of cells")
        # 200um and 0.2mm are the same, whatever the last digits are
        return float(f"{number * METRES.get(unit, 1.0) / step:.12g}")

    def ground(self, distance: str, shape: tuple[int, ...]) -> GroundScale:
        """Scale of the coordinates on the ground, or in degrees if the distance is in these.

        Raises `OptionError` or `MissingExtraError` as `cells_of` does.
        """
        _, unit = distance_of(distance)
        if not self.placed:
            raise OptionError(
                f"a distance of {distance} needs a field with a placement in the world", code="tolerance",
                remedy="give a placement, or a number of cells",
            )
        n = len(shape)
        crs = None if self.crs in SPACES else self.crs
        turns = bool(self.periods) and self.periods_of(n)[0] == TURN
        if unit == DEGREE:
            if not (turns or units_of(self.unit, n)[:2] == [DEGREE] * 2 or is_geographic(crs)) or n > 2:
                raise OptionError(f"a distance of {distance} needs a field of longitudes and latitudes", code="unit",
                                  remedy="give a number of cells, or a distance in metres")
            return GroundScale((1.0,) * n)

        def some() -> Array:
            lattice = np.meshgrid(*(np.linspace(0, size - 1, SAMPLED) for size in shape[-2:]), indexing="ij")
            points = np.stack([*[np.zeros(SAMPLED**2)] * (n - 2), *(each.ravel() for each in lattice)], axis=1)
            return self.place(points)

        return ground_of(self.unit, crs, turns, n, some, distance)

    def notes(self) -> dict[str, str]:
        """The notes of a file that hold the matrix and the reference system."""
        out = {} if self.matrix is None or self.periodic else {PLACEMENT: write_placement(self.matrix)}
        more = {CRS: self.crs, COORDINATE_UNIT: self.unit}
        return out | {key: text for key, text in more.items() if text}


def unplaced(n: int) -> Array:
    """The matrix of samples without a placement: in the plane x runs along axis 1, in space x, y, z along 0, 1, 2."""
    return np.column_stack([np.eye(n)[::-1] if n == 2 else np.eye(n), np.zeros(n)])


def closed(array: NDArray[Any], periodic: Sequence[int]) -> NDArray[Any]:
    """An array with its first plane repeated after the last one, along periodic axes that it has samples along."""
    for axis in periodic:
        if array.shape[axis] > 1:
            array = np.concatenate([array, array.take([0], axis=axis)], axis=axis)
    return array


def placement_of(given: Placement | ArrayLike | None, n: int) -> Placement | None:
    """Normalise the placement that a user gives for a field of n axes; None stays None.

    Numbers are taken as by `matrix_of`, which checks the matrix of a `Placement`, too; there, one of shape (3, 3) is
    that of a plane in space, with a row for z.
    """
    if given is None:
        return None
    if not isinstance(given, Placement):
        return Placement(matrix_of(given, n))
    return given if given.matrix is None else replace(given, matrix=matrix_of(given.matrix, n, in_space=True))


def matrix_of(given: ArrayLike, n: int, *, in_space: bool = False) -> Array:
    """The matrix (n, n + 1) of a placement from what a user gives.

    That is the distance of neighbouring samples along each axis of the array; or a row for each coordinate x, y (, z):
    what a step along each axis adds to it, and its value at sample 0. A last row of 0 .. 0 1 may follow; with
    ``in_space``, a matrix (3, 3) for two axes is that of a plane in space instead. Raises `OptionError` for anything
    else, if different samples lie on one point, or for numbers beyond `LEAST` and `MOST`.
    """
    try:
        matrix = np.asarray(given)
    except ValueError:
        matrix = np.array(None)
    if matrix.dtype.kind not in "iuf":
        raise OptionError(f"the placement {given!r} is not made of numbers", code="placement")
    matrix = matrix.astype(np.float64)
    if matrix.shape == (n,):
        distances = matrix
        matrix = unplaced(n)
        coordinate, axis = matrix.nonzero()
        matrix[coordinate, axis] = distances[axis]
    plane = in_space and n == _AXES - 1 and matrix.shape == (_AXES, _AXES)
    if not plane and matrix.shape == (n + 1, n + 1) and (matrix[n] == np.eye(n + 1)[n]).all():
        matrix = matrix[:n]
    if not plane and matrix.shape != (n, n + 1):
        raise OptionError(
            f"a placement of shape {matrix.shape}, but the field has {n} axes", code="placement",
            remedy=f"give an array of shape {(n,)} or {(n, n + 1)}"
            + ", or Placement(matrix) for a plane in space" * (matrix.shape == (_AXES, _AXES)),
        )
    size = np.abs(matrix[matrix != 0])
    if not ((size >= LEAST) & (size <= MOST)).all():
        raise OptionError(
            f"the placement has numbers that are neither 0 nor between {LEAST:g} and {MOST:g}", code="placement",
            remedy="choose another unit",
        )
    from fractions import Fraction

    rows = [[Fraction(number) for number in row[:n]] for row in matrix.tolist()]
    if all(_determinant([*some]) == 0 for some in combinations(rows, n)):
        raise OptionError("the placement lays different samples on one point", code="placement")
    return matrix


def _determinant(rows: list[list[Fraction]]) -> Fraction:
    """Compute a determinant without rounding: readers have to agree on which matrices are singular."""
    if len(rows) == 1:
        return rows[0][0]
    minors = [[row[:i] + row[i + 1 :] for row in rows[1:]] for i in range(len(rows))]
    first, *others = ((-1) ** i * rows[0][i] * _determinant(minors[i]) for i in range(len(rows)))
    return sum(others, first)


def write_placement(matrix: Array) -> str:
    """The text of a note: the numbers row by row, as short as they can be read back."""
    return " ".join(repr(number).removesuffix(".0") for number in (matrix + 0.0).ravel().tolist())


def read_placement(metadata: Mapping[str, str], n: int) -> Placement | None:
    """The placement in the notes of a file; None where a file has no such note, or a malformed one."""
    numbers = metadata.get(PLACEMENT, "").split(" ", _AXES * (n + 1))
    # in the plane x and y, or x, y and z of a plane in space
    if len(numbers) not in (n * (n + 1), _AXES * (n + 1)) or not all(map(_NUMBER.fullmatch, numbers)):
        return None
    try:
        matrix = matrix_of(np.array(numbers, np.float64).reshape(-1, n + 1), n, in_space=True)
    except OptionError:
        return None
    return Placement(matrix, crs=metadata.get(CRS), unit=metadata.get(COORDINATE_UNIT))


def own_placement(metadata: Mapping[str, str], n: int) -> Placement | None:
    """The placement of points whose n coordinates are those of the world, on a mesh; None if no system is named."""
    crs = metadata.get(CRS)
    return None if crs is None else Placement(np.eye(n, n + 1), crs=crs, unit=metadata.get(COORDINATE_UNIT))


def coded_placement(mapped: Mapped, metadata: Mapping[str, str]) -> Placement:
    """The placement of a file that holds coordinates of its samples."""
    return Placement(
        None, mapped, metadata.get(CRS), mapped.periodic, mapped.periods, unit=metadata.get(COORDINATE_UNIT)
    )


def _arrays(coordinates: Any) -> Sequence[NDArray[Any]] | None:
    """Coordinates as arrays, if they are such."""
    if coordinates is None or isinstance(coordinates, Mapped):
        return coordinates
    try:
        return tuple(np.asarray(part) for part in coordinates)
    except (TypeError, ValueError):
        raise InputError(
            "coordinates are not arrays of numbers", code="coordinates",
            remedy="give an array for each axis of the field, or x, y (, z)",
        ) from None


def _axes_of(periodic: Any) -> tuple[int, ...]:
    """Numbers of periodic axes."""
    if periodic is None:
        return ()
    axes = list(periodic) if isinstance(periodic, Sequence) and not isinstance(periodic, str) else [periodic]
    if any(isinstance(axis, bool) or not isinstance(axis, int | np.integer) for axis in axes):
        raise OptionError(f"periodic is {periodic!r}; it must be the number of an axis, or several such numbers",
                          code="periodic")
    if len(set(axes)) < len(axes) or not all(0 <= axis < _AXES for axis in axes):
        raise OptionError(f"periodic is {periodic!r}; axes must be counted from 0, each given once", code="periodic")
    return tuple(sorted(int(axis) for axis in axes))


def _periods_of(periods: Any) -> tuple[float, ...]:
    """Periods of coordinates, from one number or several."""
    given = [periods] if isinstance(periods, Real) or periods is None else list(periods)
    out = tuple(0.0 if one is None else float(one) for one in given)
    if not all(math.isfinite(one) and one >= 0 for one in out):
        raise OptionError(
            f"periods are {periods!r}; they must be positive numbers, in the unit of the coordinates", code="period",
            remedy="0 for coordinates without a period",
        )
    return out if any(out) else ()
