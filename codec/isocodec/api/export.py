"""Decode ``.iso`` files to the formats of other tools: check the request, decode, then write."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..errors import FormatError, InputError, OptionError
from ..field.labelling import caption
from ..io.writers.output_formats import Cost, Kind, OutputOptions
from ..io.writers.registry import suffix_of
from ..io.writers.things import Areas, Pyramid, SampleMask, Thing
from ..io.writers.write import USUAL, Written, check, write
from ..limits import Budget, Limits
from .drawings import Counts, Drawings, OneByOne

if TYPE_CHECKING:
    from ..stream.inspect import FileInfo
    from ..tin.tin import Tin
    from .isofile import IsoFile

Target = str | os.PathLike[str] | BinaryIO
_KINDS: Mapping[str, Kind] = {
    "curve": "contour", "areas": "areas", "bands": "areas", "above": "mask", "valid": "mask", "mesh": "mesh",
    "surface": "tin", "labels": "labels",
}
"""Contents of a file that can be written, by the writers' names."""
_APART: Mapping[str, tuple[str, ...]] = {
    "above": ("layers", "max_bytes", "window", "within"),
    "valid": ("layers", "max_bytes", "window", "within", "frame"),
    "labels": ("layers", "max_bytes", "window", "within"),
    "surface": ("window", "within", "frame", "smooth"),
}
"""Options that choose a part of a file, by what is decoded, that do not apply to it."""
_ARRAY = ".npy"
"""Suffix of arrays: of the picture that a surface makes."""
_LISTED = 5
"""Largest number of isovalues that a remark lists."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Request of what to decode from a file.

    Attributes
    ----------
    what : str or None
        ``curve``, ``areas``, ``bands``, ``above``, ``valid``, ``labels``, ``mesh`` or ``surface``; None for what the
        file holds: a surface, or curves.
    side : str
        For areas: ``above`` or ``below``.
    isovalue : float, optional
        If not given, all isovalues that the format can hold.
    view : mapping
        Keywords of `IsoFile.contour`.
    along_holes, through_holes : bool
        Close areas along missing samples; draw curves through them.
    whole : bool
        The mesh of the whole domain, not only what the curve crosses.
    capped : bool
        Close surfaces in space where they leave the field, around the side.
    index : int, optional
        Mark every so many isovalues as index contours.
    options : OutputOptions
    """

    what: str | None = None
    side: str = "above"
    isovalue: float | None = None
    view: Mapping[str, Any] = field(default_factory=dict)
    along_holes: bool = False
    through_holes: bool = False
    whole: bool = False
    capped: bool = False
    index: int | None = None
    options: OutputOptions = USUAL

    def options_for(self, isovalues: Sequence[float]) -> OutputOptions:
        """Options of writers, with the index contours among some isovalues."""
        if self.index is None or not isovalues:
            return self.options
        from ..plotting.map import index_lines

        marked = index_lines(isovalues, self.index)
        return replace(self.options, index=frozenset(v for v, one in zip(isovalues, marked, strict=True) if one))


@dataclass
class Exported:
    """Decoded content, ready to be written.

    Attributes
    ----------
    thing : object
        What `isocodec.io.writers.write.write` takes; bytes are written unchanged.
    facts : dict
        Counts, for programs.
    text : str
        The same counts, for people.
    remarks : list of str
        What was not taken from the file.
    options : OutputOptions
    drawings : OneByOne or None
        Contours that are drawn while they are written; if given, facts and text come from them.
    """

    thing: Any
    facts: dict[str, Any]
    text: str
    remarks: list[str] = field(default_factory=list)
    options: OutputOptions = USUAL
    drawings: OneByOne | None = None

    def write(self, target: Target, progress: Any = None) -> int:
        """Write the content, completely or not at all; returns the number of bytes.

        What the format loses is added to the remarks. Contours that are drawn while they are written report progress.

        Raises
        ------
        OptionError, MissingExtraError, OSError
        """
        if isinstance(self.thing, bytes):
            return _put(target, self.thing)
        if self.drawings is not None:
            self.drawings.progress = progress
        written: Written = write(target, self.thing, options=self.options)
        self.remarks += written.remarks
        if self.drawings is not None:
            if progress is not None:
                progress(len(self.drawings) + 1, len(self.drawings) + 1)
            self.count(self.drawings.counts, self.drawings.shape, self.drawings.n)
        if written.above is not None:
            name, samples = self.text, self.facts["samples"]
            self.facts[name] = written.above
            self.text = f"{written.above:,} of {samples:,} samples {name}"
        return written.bytes

    def count(self, counts: Sequence[Counts], shape: Sequence[int], n: int) -> None:
        """Set facts and text from counts of contours."""
        points, cells = sum(one.points for one in counts), sum(one.cells for one in counts)
        complete = all(one.complete for one in counts)
        if not points:
            self.remarks.append("the curve is empty" if complete else
                                "the part that was decoded does not reach the curve")
        values = [None if np.isnan(one.isovalue) else one.isovalue for one in counts]
        self.facts |= {
            "points": points, "cells": cells, "isovalues": values, "shape": list(shape), "complete": complete,
        }
        several = f", {len(counts)} {counts[0].noun}s" if len(counts) > 1 else ""
        self.text = f"{points:,} points, {cells:,} {'segments' if n == 2 else 'triangles'}{several}"


def _put(target: Target, data: bytes) -> int:
    from ..storage.atomic import write_bytes

    if isinstance(target, str | os.PathLike):
        write_bytes(target, data)
    else:
        target.write(data)
    return len(data)


def check_export(path: str | os.PathLike[str], what: str | None, options: OutputOptions) -> str:
    """Check, before decoding, that the suffix of a name fits what is to be written; returns the suffix.

    Raises
    ------
    OptionError
        Naming the formats that can be used.
    MissingExtraError
    """
    name = Path(path if options.to is None else f"_.{options.to.lstrip('.')}")
    if name.suffix.lower() == _ARRAY and what in (None, "surface"):
        return _ARRAY
    if what is None and _is_of_surfaces(name):
        return suffix_of(name) or ""
    return check(name, Thing(_KINDS[what or "curve"], None))[0]


def _is_of_surfaces(name: Path) -> bool:
    """Whether triangulated surfaces can be written to a name, and curves cannot."""
    try:
        check(name, Thing("contour", None))
    except OptionError:
        try:
            check(name, Thing("tin", 2))
        except OptionError:
            return False
        return True
    return False


def decoded(file: IsoFile, path: str | os.PathLike[str], wanted: Wanted, progress: Any = None) -> Exported:
    """Decode what is wanted from a file, in a form that the format of ``path`` can hold.

    Raises
    ------
    FormatError, LimitError, OptionError
        As `IsoFile.contour`.
    """
    what = wanted.what or ("surface" if file.kind == "surface" and wanted.isovalue is None else "curve")
    suffix = check_export(path, what, wanted.options)
    for name in _APART.get(what, ()):
        if name in wanted.view:
            raise OptionError(f"--{name.replace('_', '-')} does not apply to {what}", code=name, remedy="leave it out")
    check_marks(what, wanted)
    made = _MAKERS[what](file, suffix, wanted, progress)
    made.options = wanted.options
    if wanted.index is not None:  # which isovalues there are is known of a whole file only
        made.options = wanted.options_for(file.isovalues or [v for v in [wanted.isovalue] if v is not None])
    # bytes after the part that was decoded may be damaged
    with suppress(FormatError):
        if file.frames > 1 and wanted.view.get("frame") is None and what != "valid":
            made.remarks.append(
                f"only frame 0 of {file.frames} is decoded; choose another with --frame, from 1 to {file.frames - 1}"
            )
        if wanted.view.get("partial") and not file.complete:
            made.remarks.append(
                "the file ends before all its tiles: where a tile is missing, curves are coarser or absent"
                if file.kind == "tiles"
                else f"the file ends after {file.size} bytes, before it is complete; decoded as far as possible"
            )
    return made


def check_marks(what: str, wanted: Wanted) -> None:
    """Refuse options of columns with isovalues where bands have two.

    Raises
    ------
    OptionError
    """
    given = {"attribute": wanted.options.attribute != USUAL.attribute, "index": wanted.index is not None}
    for name in (name for name, wrong in given.items() if wrong and what not in ("curve", "areas")):
        raise OptionError(f"--{name} does not apply to {what}", code=name, remedy="leave it out")


def drawn(what: Any, path: str | os.PathLike[str], wanted: Wanted, isovalue: Any, **options: Any) -> Exported:
    """Prepare the contours of a field in a form that the format of ``path`` can hold, without an ``.iso`` file.

    Parameters
    ----------
    what : Field or Mesh
    path : path
    wanted : Wanted
        ``curve``, ``areas`` or ``bands``.
    isovalue : object
        As for `encode`, but of any number of isovalues.
    **options
        Of `encode`, for curves as a file of these options has them.

    Raises
    ------
    InputError, OptionError, MissingExtraError
    """
    from .tracing import Traced

    shown = wanted.what or "curve"
    check_marks(shown, wanted)
    contours = Traced(what, isovalue, through_holes=wanted.along_holes, **options)
    if shown == "curve" and contours.empty:
        # a layer that is there must not make room for nothing
        one = f"at the isovalue {contours.isovalues[0]:g}" if len(contours) == 1 else "at any of the isovalues"
        raise InputError(f"the data have no contours {one}", code="isovalue",
                         remedy="choose isovalues within the data")
    several = shown == "curve" and len(contours) > 1
    made = Exported(contours, {}, "", options=wanted.options_for(contours.isovalues), drawings=contours)
    check(path, Thing(_KINDS[shown], contours.n, several, bool(contours.shape)), options=made.options)
    if shown != "curve":
        valid = contours.valid if wanted.along_holes else None
        made.thing = Areas(contours, "bands" if shown == "bands" else wanted.side, valid)
    return made


def _curves(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    contours = _contours(file, suffix, wanted, progress)
    if wanted.capped:
        contours = [contour.capped(above=wanted.side == "above") for contour in contours]
    if isinstance(contours, OneByOne):
        return _of_contours(contours, contours, [])
    remarks = [] if wanted.isovalue is not None or len(contours) > 1 else _others_in(file, contours[0].isovalue)
    thing: Any = contours if len(contours) > 1 else contours[0]
    parts = set(wanted.view) - {"window"}
    if suffix == ".pmtiles" and file.kind == "tiles" and not (parts or wanted.options.in_samples):
        thing = Pyramid([_by_width(file, wanted, contour) for contour in contours])
    return _of_contours(thing, contours, remarks)


def _areas(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    contours = _contours(file, suffix, wanted, progress)
    valid = file.valid() if wanted.along_holes and file.shape else None
    side = "bands" if wanted.what == "bands" else wanted.side
    return _of_contours(Areas(contours, side, valid), contours, [])


def _contours(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Drawings | list[Contour]:
    """Decode all isovalues that the format can hold, or the one wanted, within the memory limit."""
    from .files import Viewed, WholeFile

    view = {**wanted.view, "progress": progress}
    if wanted.through_holes or wanted.along_holes:
        view["through_holes"] = True
    kind = _KINDS[wanted.what or "curve"]
    every = wanted.isovalue is None and file.kind != "surface" and ("layers" not in view or file.kind == "tiles")
    if every:
        asked = Thing(kind, len(file.shape) or None, several=kind != "areas", sampled=bool(file.shape))
    if every and _holds(suffix, asked):
        in_turn = "within" not in view and not wanted.capped
        if isinstance(file.held, WholeFile) and file.kind in ("grid", "series") and in_turn:
            chosen, costs = Viewed(**view), check(f"_{suffix}", asked)[1].cost
            drawings = Drawings(file.held.received(None, chosen), chosen, costs.get(len(file.shape), Cost(0, 0)))
            if len(drawings) > 1:
                return drawings
            contours = [*drawings]
        else:
            contours = file.contours(**view)
    else:
        contours = [file.contour(wanted.isovalue, **view)]
    thing = Thing(kind, contours[0].n, kind != "areas" and len(contours) > 1, bool(contours[0].shape))
    output = check(f"_{suffix}", thing)[1]
    held = sum(one.points.nbytes + one.cells.nbytes for one in contours)
    if (cost := output.cost.get(contours[0].n)) is not None:
        sizes = [(len(one.points), len(one.cells)) for one in contours]
        held += max(cost.peak(*size) for size in sizes) + sum(cost.after(*size) for size in sizes[1:])
    Budget((file.limits or Limits()).memory).check(held)
    return contours


def _holds(suffix: str, thing: Thing) -> bool:
    try:
        check(f"_{suffix}", thing)
    except OptionError:
        return False
    return True


def _of_contours(thing: Any, contours: OneByOne | Sequence[Contour], remarks: list[str]) -> Exported:
    made = Exported(thing, {}, "", remarks)
    if isinstance(contours, OneByOne):
        made.drawings = contours
    else:
        made.count([Counts.of(one) for one in contours], contours[0].shape, contours[0].n)
    return made


def _by_width(file: IsoFile, wanted: Wanted, finest: Contour) -> Callable[[float], Contour]:
    """Make a function from the width of a map's pixel, in samples, to a contour of suitable layers."""
    edges = sorted({layer.level for layer in file.info.layers})
    drawn: dict[int, Contour] = {edges[0]: finest}

    def at(width: float) -> Contour:
        edge = max((each for each in edges if 2.0**each <= width), default=edges[0])
        if edge not in drawn:
            drawn[edge] = file.contour(finest.isovalue, window=wanted.view.get("window"), within=float(1 << edge))
        return drawn[edge]

    return at


def _others(isovalues: Sequence[float], isovalue: float, notes: Mapping[str, str]) -> list[str]:
    """Remark that a file has further isovalues, if none was asked for."""
    others = [repr(value).removesuffix(".0") for value in isovalues if value != isovalue]
    listed = " or ".join(others[:_LISTED]) + ", .." * (len(others) > _LISTED)
    written = f"only {caption(isovalue, notes)} is written"
    return [f"{written}; choose another with --isovalue: {listed}"] if others else []


def _others_in(file: IsoFile, isovalue: float) -> list[str]:
    """Remark on further isovalues, unless the file is damaged after this isovalue."""
    with suppress(FormatError):
        return _others(file.isovalues, isovalue, file.metadata)
    return []


def _samples(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    from .files import Viewed, WholeFile

    if wanted.what == "valid":
        rows, isovalue, remarks = file.valid(), None, list[str]()
        placement, complete = file.placement, file.complete
    elif isinstance(file.held, WholeFile) and file.kind in ("grid", "series"):
        # bytes after the layers of the isovalue may be damaged
        view = Viewed(frame=wanted.view.get("frame"), partial=bool(wanted.view.get("partial")))
        decoder, number = file.held.decoded(wanted.isovalue, view)
        rows, isovalue = decoder.grid.above(number), decoder.isovalues[number]
        remarks = _others(decoder.isovalues, isovalue, decoder.metadata) if wanted.isovalue is None else []
        placement, complete = decoder.grid.placement, decoder.frames > decoder.frame
    else:
        rows, isovalue, remarks = file.above(wanted.isovalue, frame=wanted.view.get("frame")), wanted.isovalue, []
        if isovalue is None and file.isovalues:
            isovalue, remarks = file.isovalues[0], _others(file.isovalues, file.isovalues[0], file.metadata)
        placement, complete = file.placement, file.complete
    if rows.ndim == 1 and suffix == _ARRAY:  # of vertices
        counts = {"samples": rows.size, str(wanted.what): int(rows.sum())}
        return Exported(_array(rows), counts, f"{rows.size:,} vertices")
    facts = {"samples": rows.size, "isovalue": isovalue, "shape": list(rows.shape), "complete": complete}
    return Exported(SampleMask(rows, placement), facts, str(wanted.what), remarks)


def _labels(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    labels = file.labels(**wanted.view)
    found = [label.item() for label in np.unique(labels)]
    count = len({*found} & {*file.isovalues})
    text = f"{labels.size:,} samples, {count} label{'s' * (count != 1)}"
    facts = {"samples": labels.size, "labels": found, "shape": list(labels.shape)}
    return Exported(SampleMask(labels, file.placement), facts, text)


def _mesh(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    mesh = file.mesh(wanted.isovalue, whole=wanted.whole, **wanted.view, progress=progress)
    pieces = "triangles" if mesh.cells.shape[1] == 3 else "tetrahedra"
    output = check(f"_{suffix}", Thing("mesh", mesh.cells.shape[1] - 1))[1]
    held = sum(array.nbytes for array in (mesh.points, mesh.cells, mesh.levels, mesh.above))
    if (cost := output.cost.get(mesh.cells.shape[1] - 1)) is not None:
        held += cost.peak(len(mesh.points), len(mesh.cells))
    Budget((file.limits or Limits()).memory).check(held)
    isovalue = None if np.isnan(mesh.isovalue) else float(mesh.isovalue)
    return Exported(
        mesh,
        {"vertices": len(mesh.points), pieces: len(mesh.cells), "isovalue": isovalue, "shape": list(mesh.shape),
         "complete": mesh.complete},
        f"{len(mesh.points):,} vertices, {len(mesh.cells):,} {pieces}",
        _others_in(file, mesh.isovalue) if wanted.isovalue is None else [],
    )


def _surface(file: IsoFile, suffix: str, wanted: Wanted, progress: Any) -> Exported:
    size = wanted.view.get("max_bytes")
    size = file.size if wanted.view.get("partial") and size is None else size
    tin = file.surface(layers=wanted.view.get("layers"), max_bytes=size)
    facts = {"points": len(tin.points), "triangles": len(tin.triangles), "complete": tin.complete}
    text = f"{len(tin.points):,} points, {len(tin.triangles):,} triangles"
    return Exported(_array(tin.raster()) if suffix == _ARRAY else tin, facts, text)


_MAKERS: Mapping[str, Callable[[IsoFile, str, Wanted, Any], Exported]] = {
    "curve": _curves, "areas": _areas, "bands": _areas, "above": _samples, "valid": _samples, "labels": _labels,
    "mesh": _mesh, "surface": _surface,
}


def _array(values: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, values)
    return buffer.getvalue()


def write_surface(tin: Tin, target: Target, options: OutputOptions) -> int:
    """Write a thinned surface, with the order of removal and the errors if the format can hold arrays.

    Raises
    ------
    OptionError, MissingExtraError, OSError
    """
    return write(target, tin, options=options).bytes


def counted(file: IsoFile) -> FileInfo:
    """Inspect a file, decoding it to count its symbols by syntax element.

    Raises
    ------
    FormatError, LimitError
    """
    from ..stream.inspect import inspect

    return inspect(file.data, symbols=True, limits=file.limits) if file.kind != "tiles" else file.info
