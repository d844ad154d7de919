"""Prepare input for an encoder: read it, add what options state, and collect remarks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..deferred import dataclass
from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.labelling import ALL, labels_in
from ..field.meshed import Mesh
from ..field.missing import HOLE
from ..field.placement import Placement
from ..field.sampled import Field
from ..field.samples import missing_of
from ..io.opener import Choice, load
from ..limits import in_units
from .georeference import NOWHERE, Georeference

if TYPE_CHECKING:
    from ..tin.tin import Tin

if TYPE_CHECKING:
    from ..tiles.writing import SampleCounts

MOST = 1 << 20
"""Largest size of a plan file, in bytes."""
_MUCH = 1 << 30
"""Memory, in bytes, from which on a remark is made."""


def read_input(source: Any, choice: Choice) -> Field | Frames | Mesh:
    """Read a field, a series of fields, or values on a mesh or at scattered points; the caller handles remarks.

    Raises
    ------
    OSError, InputError, LimitError, OptionError, MissingExtraError
        As `isocodec.read`.
    """
    return load(source, choice)


def mesh_in(path: str) -> tuple[Any, Any]:
    """Read points and cells from a file with a mesh.

    Raises
    ------
    OSError, InputError, MissingExtraError
    """
    found = load(path, Choice())
    if not isinstance(found, Mesh) or found.cells is None:
        raise InputError("holds no mesh of points and cells", code="mesh", remedy="give the mesh that was encoded")
    return found.points, found.cells


def windowed(source: Any, choice: Choice, missing: str = HOLE) -> Field:
    """Open a field for tiles: its samples are read a window at a time, where the format can, or else at once.

    What tiles cannot hold of its placement is remarked on.

    Raises
    ------
    OSError, InputError, LimitError, OptionError, MissingExtraError
        As `isocodec.read`.
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


@dataclass(frozen=True, kw_only=True)
class Added:
    """Properties of an input, as stated by options.

    Attributes
    ----------
    labels : sequence of float, or "all"
        Encode which samples have these labels; missing ones have none.
    where : Georeference
        Where samples lie, instead of what the input states.
    periodic
        As of `Placement`.
    stored : str, optional
        As of `Mesh`.
    mesh_error : float, optional
        As of `Mesh`.
    missing : str, optional
        As of `Field`.
    interval : int, optional
        Of key frames, for series and meshes.
    frames : bool
        Whether a series of fields was asked for.
    """

    labels: Sequence[float] | str = ()
    where: Georeference = NOWHERE
    periodic: tuple[int, ...] = ()
    stored: str | None = None
    mesh_error: float | None = None
    missing: str | None = None
    interval: int | None = None
    frames: bool = False

    def to(self, what: Any) -> Any:
        """Return a field, a series or a mesh with these properties.

        Raises
        ------
        OptionError
            If there is not one spacing for each axis, or if one of the properties does not apply.
        """
        self._check(what)
        if isinstance(what, Mesh):
            given: dict[str, Any] = {"stored": self.stored, "error": self.mesh_error, "crs": self.where.crs}
            return replace(what, **{name: value for name, value in given.items() if value is not None})
        if isinstance(what, Frames):
            if self.labels == ALL:
                every = {label for field in what.fields for label in labels_in(field.values, field.mask)}
                return replace(self, labels=sorted(every)).to(what)
            fields = _Changed(what.fields, self._to_field)
            fields.remarks = self.remarks(fields.remarks)
            return replace(what, fields=fields)
        return self._to_field(what)

    def _check(self, what: Any) -> None:
        """Refuse properties of another kind of input."""
        mesh, kind = isinstance(what, Mesh), "meshes and points" if isinstance(what, Mesh) else "sampled fields"
        of_grids = {"label": self.labels, "missing": self.missing, "spacing": self.where.places, "periodic":
                    self.periodic, "frames": self.frames}
        of_meshes = {"stored": self.stored, "mesh-error": self.mesh_error}
        wrong = [name for name, value in (of_grids if mesh else of_meshes).items() if value]
        if isinstance(what, Field) and self.interval is not None:
            wrong, kind = ["frame-interval"], "a single field: add --frames"
        if wrong:
            raise OptionError(f"--{', --'.join(wrong)} {'does' if len(wrong) == 1 else 'do'} not apply to {kind}",
                              code="options")

    def remarks(self, remarks: Sequence[str]) -> tuple[str, ...]:
        """Remarks on the input that are still of use: none on a placement that is not kept."""
        return () if self.where.places else tuple(remarks)

    def placement(self, stated: Placement | None, shape: Sequence[int]) -> Placement | None:
        """Place the samples of a field of that shape.

        Raises
        ------
        OptionError
            As `Georeference.placement`.
        """
        return self.where.placement(stated, shape)

    def _to_field(self, field: Field) -> Field:
        placement = self.placement(field.placement, field.shape)
        crs = self.where.crs or field.crs
        field = replace(field, placement=placement, crs=crs, remarks=self.remarks(field.remarks))
        if self.periodic:
            where = field.placement or Placement()
            field = replace(field, placement=replace(where, periodic=self.periodic, inferred=False))
        labels: Any = self.labels
        if labels:
            return replace(field, labels=labels, missing="below")
        return replace(field, missing=self.missing) if self.missing else field


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
        self._fields = [_Seen(found.low, found.high, found.missing, self.what.values.dtype, False)]
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
            domain = file.info.domain
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
        for isovalue in file.isovalues:
            if not low <= isovalue < high:
                data = f"the data ({low:g} to {high:g})" if low < high else f"the data, which are all {low:g}"
                out.append(f"the isovalue {isovalue:g} lies outside {data}: the curve is empty")
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

    @contextmanager
    def blaming(self, plan: Path | None, failure: Callable[[Path, OptionError], Exception]) -> Iterator[None]:
        """Attribute errors in a plan to the plan's file."""
        try:
            yield
        except OptionError as error:
            if plan is None or error.code != "plan":
                raise
            raise failure(plan, error) from error


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


def observed(what: Any, added: Added) -> Observed:
    """Combine an input with what options state about it.

    Raises
    ------
    OptionError
    """
    return Observed(added.to(what))


def layers_of(text: str, plan: Path | None) -> str:
    """Convert ``--layers`` to what the library takes: a level, a criterion, or the text of a plan file.

    Raises
    ------
    OptionError
        If the file holds no plan.
    OSError
    """
    if plan is None:
        return text
    with plan.open("rb") as file:
        data = file.read(MOST + 1)
    try:
        found = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        found = "\0"
    if len(data) > MOST or "\0" in found:
        raise OptionError("the file is not a plan, which is a short text", code="plan",
                          remedy="docs/plans.md explains plans")
    return found


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


def merged_by(tin: Tin) -> list[str]:
    """Remark on points that thinning merged, if any."""
    if tin.removals is None or not tin.merged:
        return []
    return [f"{tin.merged:,} points coincide with others: each group is merged into one point with the mean of its "
            "values"]


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
