"""Prepare input for an encoder: read it, add what options state, and collect remarks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.labelling import ALL, labels_in
from ..field.meshed import Mesh
from ..field.missing import HOLE
from ..field.placement import Placement, matrix_of, unplaced
from ..field.reference_system import named_system
from ..field.sampled import Field
from ..field.samples import missing_of
from ..io.opener import load
from ..limits import in_units
from ..stream.options import EncodeOptions
from ..verbs import Choice, Encode

if TYPE_CHECKING:
    from ..tiles.writing import SampleCounts
    from ..tin.tin import Tin

_MUCH = 1 << 30
"""Least memory, in bytes, that is worth a remark."""


def windowed(source: Any, choice: Choice, missing: str = HOLE) -> Field:
    """Open a field for tiles: its samples are read a window at a time, where the format can, or else at once.

    What tiles cannot hold of its placement is remarked on. Raises `OSError`, `InputError`, `LimitError`, `OptionError`
    or `MissingExtraError` as `isocodec.read` does.
    """
    field = load(source, choice, lazy=True)
    if not isinstance(field, Field):
        raise InputError("holds meshes, points or a series, which have no tiles", code="field",
                         remedy="encode it without --tile")
    place, remarks = field.placement, list(field.remarks)
    if place is not None and place.coordinates is not None:
        place = Placement(crs=place.crs, unit=place.unit)
        remarks.append("its coordinates are left out, as tiles are placed by even steps alone")
    if place is not None and place.periodic:
        remarks.append(f"its ends along axis {place.periodic[0]} are not joined, as tiles are not")
        place = replace(place, periodic=(), periods=())
    return replace(field, placement=place, missing=missing, remarks=tuple(remarks))


def stated(what: Any, options: Encode) -> Any:
    """Add to a field, a series or a mesh what options state about it.

    Raises `OptionError` if there is not one spacing for each axis, or if one of the options does not apply.
    """
    kinds = {Mesh: "mesh", Frames: "series", Field: "field"}
    options.check_input(next(kind for each, kind in kinds.items() if isinstance(what, each)))
    crs = None if options.crs is None else named_system(options.crs)
    if isinstance(what, Mesh):
        given: dict[str, Any] = {"stored": options.stored, "error": options.mesh_error, "crs": crs}
        return replace(what, **{name: value for name, value in given.items() if value is not None})
    labels: Any = ALL if ALL in options.labels else options.labels
    if labels == ALL and isinstance(what, Frames):
        labels = sorted({label for field in what.fields for label in labels_in(field.values, field.mask)})
    moved = not options.spacing is options.origin is None

    def kept(remarks: Sequence[str]) -> tuple[str, ...]:
        """Remarks that are still of use: none on a placement that is not kept."""
        return () if moved else tuple(remarks)

    def of_field(field: Field) -> Field:
        place = field.placement
        if moved:
            matrix = _matrix(options, place, field.values.ndim)
            unit = place.unit if place is not None and crs is None else None
            place = Placement(matrix, crs=crs or (place.crs if place is not None else None), unit=unit)
        elif place is not None and crs is not None:
            place = replace(place, crs=crs)
        field = replace(field, placement=place, crs=crs or field.crs, remarks=kept(field.remarks))
        if options.periodic:
            field = replace(field, placement=replace(place or Placement(), periodic=options.periodic, inferred=False))
        if labels:
            return replace(field, labels=labels, missing="below")
        return replace(field, missing=options.missing) if options.missing else field

    if isinstance(what, Field):
        return of_field(what)
    fields = _Changed(what.fields, of_field)
    fields.remarks = kept(fields.remarks)
    return replace(what, fields=fields)


def _matrix(options: Encode, stated: Placement | None, n: int) -> Any:
    """Place samples of ``n`` axes by the steps and the origin that are given, else as the input states."""
    for name in ("spacing", "origin"):
        if (given := getattr(options, name)) is not None and len(given) != n:
            raise OptionError(f"the {name} has {len(given)} numbers; give {n}", code=name)
    if options.spacing is not None:
        matrix = matrix_of(np.array(options.spacing, np.float64), n)
    elif stated is not None and stated.coordinates is not None:
        raise OptionError("an origin moves a field with even steps", code="origin", remedy="give a spacing, too")
    else:
        matrix = unplaced(n) if stated is None or stated.matrix is None else matrix_of(stated.matrix, n).copy()
    if options.origin is not None:
        matrix[:, n] = options.origin
    return matrix_of(matrix, n)


class _Changed(Iterable[Any]):
    """Fields of a series, each changed when it is read; remarks and shape are those of the input."""

    def __init__(self, fields: Any, change: Callable[[Any], Any], begin: Callable[[], object] = bool) -> None:
        self._fields, self._change, self._begin = fields, change, begin
        self.remarks, self.whole = getattr(fields, "remarks", ()), getattr(fields, "whole", None)

    def __len__(self) -> int:
        return len(self._fields)

    def __iter__(self) -> Iterator[Any]:
        self._begin()
        return map(self._change, self._fields)


class Observed:
    """An input, and what is observed of its samples while they are encoded.

    Attributes
    ----------
    what : Field, Frames or Mesh
        To be encoded.
    before : list of str
        Remarks of the source.
    """

    def __init__(self, what: Any) -> None:
        self.before = [*getattr(what.fields if isinstance(what, Frames) else what, "remarks", ())]
        self._given = what
        self._fields: list[_Seen] = []
        self._tied: dict[float, int] | None = None
        self.what = what
        if isinstance(what, Frames):
            self.what = replace(what, fields=_Changed(what.fields, self._see, self._fields.clear))
        if isinstance(what, Field) and isinstance(what.values, np.ndarray):
            self._see(what)
        if isinstance(what, Mesh) and what.values is not None:
            self._see(Field(what.values))

    def in_tiles(self, found: SampleCounts) -> None:
        """Take over what was counted while the tiles were encoded."""
        self._fields = [_Seen(found.low, found.high, found.missing, self.what.values.dtype,
                              self.what.labels is not None)]
        self._tied = found.ties

    def _see(self, field: Field) -> Field:
        self._fields.append(_Seen.of(field))
        return field

    def facts(self, file: Any) -> dict[str, Any]:
        """Facts for programs: shape (for a series, that of the input), type, isovalues, number of missing samples."""
        shape = file.shape
        if isinstance(self._given, Frames):
            shape = getattr(self._given.fields, "whole", None) or shape
        out: dict[str, Any] = {"shape": list(shape), "isovalues": [float(value) for value in file.isovalues]}
        if isinstance(self.what, Frames):
            out["frames"] = file.frames
        if self._fields and not isinstance(self.what, Mesh):
            out["dtype"] = str(self._fields[0].dtype)
            out["missing"] = sum(one.missing for one in self._fields)
        if isinstance(self.what, Mesh):
            out["points"] = len(np.asarray(self.what.points))
            info = getattr(file, "info", None)  # drawings without a file have none
            domain = info.domain if info else None
            known = None if self.what.cells is None else len(np.asarray(self.what.cells))
            out["cells"] = known if known is not None else domain.cells if domain else 0
        return out

    def after(self, file: Any, keywords: Mapping[str, Any], marked: bool) -> list[str]:
        """Remarks on isovalues outside the data, samples equal to an isovalue, and markers that mark no sample."""
        if not self._fields or self._fields[0].labels:
            return []
        out = []
        if marked and not any(one.missing for one in self._fields):
            out.append("no samples are missing; --nodata sets the value that marks them")
        there = [one for one in self._fields if one.low is not None]
        if not there:
            return out
        low, high = min(one.low for one in there), max(one.high for one in there)
        data = f"the data ({low:g} to {high:g})" if low < high else f"the data, which are all {low:g}"
        outside = [f"{isovalue:g}" for isovalue in file.isovalues if not low <= isovalue < high]
        if len(outside) > 2:
            out.append(f"{len(outside):,} isovalues ({outside[0]}, ..) lie outside {data}: their curves are empty")
        else:
            out += [f"the isovalue {each} lies outside {data}: the curve is empty" for each in outside]
        return out if isinstance(self.what, Mesh) else [*out, *self._ties(file.isovalues, keywords)]

    def _ties(self, isovalues: Sequence[float], keywords: Mapping[str, Any]) -> list[str]:
        precision = str(keywords.get("precision", ""))
        valued = precision == "exact" or precision.startswith("step=")
        topology = bool(keywords.get("keep_topology"))
        kinds = "" if precision.startswith("signs") else "biuf" if topology or valued else "biu"
        kind = self._fields[0].dtype.kind
        if kind not in kinds:
            return []
        counts = self._tied or dict.fromkeys(isovalues, 0)
        fields = self._given if isinstance(self._given, Frames) else [self._given]
        for field in fields if self._tied is None else ():
            values = field.values if field.mask is None else field.values[~field.mask]
            for isovalue in isovalues:
                if kind == "f" or isovalue.is_integer():
                    # comparing integers with a float takes ten times as long
                    counts[isovalue] += int(np.count_nonzero(values == (isovalue if kind == "f" else int(isovalue))))
        tied = [isovalue for isovalue, count in counts.items() if count]
        if not tied:
            return []
        text = "they count as below for the topology" if topology else "they count as below"
        if not topology and kind in "biu" and len(tied) == 1:
            text += f", which {tied[0] + 0.5:g} avoids"
        of = f"the isovalue {tied[0]:g}" if len(tied) == 1 else f"one of {len(tied)} isovalues ({tied[0]:g}, ..)"
        return [f"{sum(counts.values()):,} samples equal {of}: {text}"]


@dataclass(frozen=True)
class _Seen:
    """Observe the samples of one field."""

    low: Any
    high: Any
    missing: int
    dtype: Any
    labels: bool

    @classmethod
    def of(cls, field: Field) -> _Seen:
        values = field.values
        gone = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, np.bool_)
        gone = gone if field.mask is None else gone | field.mask
        valid = values[~gone] if gone.any() else values
        low, high = (valid.min(), valid.max()) if valid.size else (None, None)
        return cls(low, high, int(gone.sum()), values.dtype, bool(field.labels))


def keywords_of(options: Encode) -> dict[str, Any]:
    """Collect the parameters of `isocodec.encode` that are given."""
    names = [each for each in EncodeOptions.__annotations__ if options.given(each)]
    given = {name: getattr(options, name) for name in names}
    if "metadata" in given:
        given["metadata"] = dict(given["metadata"])
    return given


def to_thin(what: Field | Mesh, coded: bool) -> tuple[Any, list[str]]:
    """Prepare input for thinning, with remarks; for a file, a field with holes becomes scattered points."""
    from .thinned import MEMORY

    if isinstance(what, Mesh) and (what.cells is not None or what.values is None):
        raise InputError(
            "a terrain surface needs z = f(x, y): a field, or points with one value each", code="surface",
            remedy="encode contours of values on a mesh instead: --key NAME; x, y and z are its coordinates",
        )
    remarks = []
    count = len(np.asarray(what.points)) if isinstance(what, Mesh) else what.values.size
    if isinstance(what, Field) and what.values.ndim == 2 and (gone := missing_of(what.values, what.mask)).any():
        remarks.append(f"{int(gone.sum()):,} missing samples: the triangulation covers them")
        if coded:
            placed = what.placement.notes() if what.placement is not None else {}
            what = Mesh(np.argwhere(~gone), None, np.asarray(what.values)[~gone], notes={**placed, **what.metadata})
    if MEMORY * count > _MUCH:
        remarks.append(f"thinning may take {in_units(MEMORY * count)} of memory")
    return what, remarks


def facts_of(tin: Tin, what: Any) -> dict[str, Any]:
    """Counts and errors of a thinned surface, for programs."""
    out: dict[str, Any] = {"points": len(tin.points), "triangles": len(tin.triangles)}
    if tin.removals is not None:
        errors = tin.removals.errors
        largest = float(errors[-1]) if len(errors) else 0.0
        out |= {"removed": len(tin.removals.order), "merged": tin.merged, "error": largest}
    elif tin.shape is not None:
        missed = tin.raster() - what.values
        out |= {"error": float(np.abs(missed).max()), "rms": float(np.sqrt((missed**2).mean()))}
    return out
