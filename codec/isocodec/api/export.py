"""Decode ``.iso`` files to the formats of other tools: check the request, decode, then write."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..drawing.contour import Contour
from ..errors import FormatError, InputError, OptionError
from ..field.labelling import caption, is_of_labels
from ..io import cost
from ..io.formats import (
    USUAL,
    Areas,
    Kind,
    SampleMask,
    Thing,
    check,
    suffix_of,
    suffixes_of,
    thing_of,
    write,
)
from ..limits import Budget, Limits
from ..verbs import Decode, Encode, OutputOptions, Viewed
from .drawings import Counts, Drawings, Fewer, OneByOne

__all__ = ["Exported", "Target", "check_export", "counted", "decoded", "drawn", "suffix_of"]

if TYPE_CHECKING:
    from ..stream.decoder import Decoder
    from ..stream.file_info import FileInfo
    from .isofile import IsoFile

Target = str | os.PathLike[str] | BinaryIO
_KINDS: Mapping[str, Kind] = {
    "curve": "contour", "areas": "areas", "areas-below": "areas", "bands": "areas", "above": "mask",
    "valid": "mask", "mesh": "mesh", "surface": "tin", "labels": "labels",
}
"""Contents of a file that can be written, by the writers' names."""
_SIDES = {"areas": "above", "areas-below": "below", "bands": "bands"}
_LISTED = 5
"""Largest number of isovalues that a remark lists."""


@dataclass
class Exported:
    """Decoded content, ready to be written.

    Attributes
    ----------
    thing : object
        Content that `isocodec.io.formats.write` takes.
    facts : dict
        Counts, for programs.
    text : str
        The same counts, for people.
    remarks : list of str
        Parts of the file that are not written, and losses of the format.
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

        Losses of the format are added to the remarks. Contours that are drawn while they are written report progress.
        Raises `OptionError`, `MissingExtraError` or `OSError`.
        """
        if self.drawings is not None:
            self.drawings.progress = progress
        written = write(target, self.thing, self.options)
        self.remarks += written.remarks
        if self.drawings is not None:
            if progress is not None:
                progress(len(self.drawings) + 1, len(self.drawings) + 1)
            self.count(self.drawings.counts, self.drawings.shape, self.drawings.n)
            if isinstance(self.drawings, Fewer):
                self.facts |= self.drawings.facts
                self.text += self.drawings.text
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


def check_export(path: str | os.PathLike[str], what: str | None, options: OutputOptions) -> str:
    """Check, before decoding, that the suffix of a name fits what is to be written; returns the suffix.

    Raises `OptionError` naming the formats that can be used, and `MissingExtraError`.
    """
    if what is not None:
        return check(path, Thing(_KINDS[what]), options)[0]
    try:
        return check(path, Thing("contour"), options)[0]
    except OptionError:
        # a file of a surface is written as such, to formats that curves do not have
        with suppress(OptionError):
            return check(path, Thing("tin", 2), options)[0]
        raise


def decoded(file: IsoFile, path: str | os.PathLike[str], wanted: Decode, progress: Any = None) -> Exported:
    """Decode what is wanted from a file, in a form that the format of ``path`` can hold.

    Raises `FormatError`, `LimitError` or `OptionError` as `IsoFile.contour` does.
    """
    what = wanted.what or ("surface" if file.kind == "surface" and not wanted.isovalues else "curve")
    suffix = check_export(path, what, wanted)
    wanted.check_what(what)
    made = _MAKERS[what](file, suffix, wanted, progress)
    made.options = wanted
    # bytes after the part that was decoded may be damaged
    with suppress(FormatError):
        if what != "valid":
            made.remarks += other_frames(file, wanted.frame, "decoded")
        if wanted.partial:
            made.remarks += cut_short(file, "decoded")
    return made


def other_frames(file: IsoFile, frame: int | None, done: str) -> list[str]:
    """Remark that there are other frames if none was asked for; ``done`` is what happens to the first: decoded."""
    if frame is not None or file.frames == 1:
        return []
    return [f"only frame 0 of {file.frames} is {done}; choose another with --frame, from 1 to {file.frames - 1}"]


def cut_short(file: IsoFile, done: str) -> list[str]:
    """Remark that a file is not complete."""
    if file.complete:
        return []
    if file.kind == "tiles":
        return ["the file ends before all its tiles: where a tile is missing, curves are coarser or absent"]
    return [f"the file ends after {file.size} bytes, before it is complete; {done} as far as possible"]


def drawn(
    what: Any, path: str | os.PathLike[str], wanted: Decode | Encode, isovalue: Any, progress: Any = None,
    **options: Any,
) -> Exported:
    """Prepare the contours of a field in a form that the format of ``path`` can hold, without an ``.iso`` file.

    Any number of isovalues is allowed. Options of `encode` give the curves that a file with these options has.
    """
    from .tracing import Traced

    shown = wanted.what or "curve"
    contours = Traced(what, isovalue, through_holes=shown != "curve", **options)
    if shown == "curve" and contours.empty:
        # a layer that is there must not make room for nothing
        one = f"at the isovalue {contours.isovalues[0]:g}" if len(contours) == 1 else "at any of the isovalues"
        raise InputError(f"the data have no contours {one}", code="isovalue",
                         remedy="choose isovalues within the data")
    shown_ones = contours if wanted.simplify is None else Fewer(contours, wanted.simplify, progress)
    thing: Any = shown_ones if shown == "curve" else Areas(shown_ones, _SIDES[shown], contours.valid)
    check(path, thing_of(thing), wanted)
    return Exported(thing, {}, "", options=wanted, drawings=shown_ones)


def _curves(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> Exported:
    contours, side, remarks = _contours(file, suffix, wanted, progress), _SIDES.get(wanted.what or ""), list[str]()
    if wanted.capped:
        contours = [contour.capped(above=wanted.capped == "above") for contour in contours]
    thing: Any = contours
    if side is not None:
        valid = file.valid() if file.shape and file.info.mask_bytes is not None else None
        thing = Areas(contours, side, valid)
    if isinstance(contours, OneByOne):
        return Exported(thing, {}, "", drawings=contours)
    if side is None and len(contours) == 1:
        thing, remarks = contours[0], _others(file, contours[0].isovalue, wanted)
    made = Exported(thing, {}, "", remarks)
    made.count([Counts.of(one) for one in contours], contours[0].shape, contours[0].n)
    return made


def _contours(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> OneByOne | list[Contour]:
    """Decode the isovalues wanted, by default all that the format can hold, within the memory limit."""
    from .files import SampledFile

    view = {**wanted.view, "progress": progress}
    kind = _KINDS[wanted.what or "curve"]
    if kind == "areas" and file.info.mask_bytes is not None:
        view["through_holes"] = True
    if wanted.bbox is not None:
        view["window"] = file.window_around(view.pop("bbox"))
    if view.get("window") is not None and (kind == "areas" or wanted.capped):
        raise OptionError("areas and surfaces are not closed along a window", code="window",
                          remedy="crop the file first: isocodec edit --window or --bbox")
    # of the first layers, notes behind them are not read: there may be damage between
    several, of_labels = kind != "areas", "layers" not in view and is_of_labels(file.metadata)
    asked = tuple(dict.fromkeys(wanted.isovalues))
    every = len(asked) != 1 and file.kind != "surface" and ("layers" not in view or file.kind == "tiles")
    if every and suffix in suffixes_of(Thing(kind, len(file.shape) or None, several)):
        in_turn = "within" not in view and not wanted.capped and wanted.simplify is None and not of_labels
        if isinstance(file, SampledFile) and in_turn:
            for isovalue in asked:
                file.info.number_of(isovalue)
            chosen = Viewed(**view)
            drawings = Drawings(file.received(None, chosen), chosen, asked)
            if len(drawings) > 1:
                return drawings
            contours = [*drawings] or [file.contour(wanted.isovalue, **view)]
        else:
            contours = _of_asked(file, asked, view, of_labels)
    elif of_labels and kind == "areas":
        contours = _of_asked(file, asked or file.isovalues[:1], view, True)
    else:
        contours = [file.contour(one, **view) for one in asked or (None,)]
    check(f"_{suffix}", Thing(kind, contours[0].n, several and len(contours) > 1), wanted)
    held = sum(one.points.nbytes + one.cells.nbytes for one in contours)
    sizes = [(len(one.points), len(one.cells)) for one in contours]
    held += sum(cost.kept(points) for points, _ in sizes[1:])
    _check_memory(file, held + max(cost.peak(*size) for size in sizes))
    return contours if wanted.simplify is None else Fewer(contours, wanted.simplify)


def _of_asked(
    file: IsoFile, asked: Sequence[float], view: dict[str, Any], together: bool
) -> list[Contour]:
    """Decode some isovalues, or all if none is asked for; labels together, so that their borders meet."""
    if not asked or together:
        contours = file.contours(**view)
        return [contours[file.info.number_of(one)] for one in asked] if asked else contours
    return [file.contour(one, **view) for one in asked]


def _check_memory(file: IsoFile, held: int) -> None:
    Budget((file.limits or Limits()).memory).check(held)


def _others(source: IsoFile | Decoder, isovalue: float, wanted: Decode) -> list[str]:
    """Remark that there are other isovalues if none was asked for, unless the file is damaged after this one."""
    with suppress(FormatError):
        others = [repr(value).removesuffix(".0") for value in source.isovalues if value != isovalue]
        listed = " or ".join(others[:_LISTED]) + ", .." * (len(others) > _LISTED)
        if others and not wanted.isovalues:
            return [f"only {caption(isovalue, source.metadata)} is written; choose another with --isovalue: {listed}"]
    return []


def _samples(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> Exported:
    from .files import SampledFile

    name, isovalue, remarks = str(wanted.what), wanted.isovalue, list[str]()
    view: Any = {"frame": wanted.frame, "partial": wanted.partial}
    if name == "above" and isinstance(file, SampledFile):
        # bytes after the layers of the isovalue may be damaged
        decoder, number = file.decoded(isovalue, Viewed(**view))
        values, placement, complete = decoder.grid.above(number), decoder.grid.placement, decoder.frames > decoder.frame
        isovalue = decoder.isovalues[number]
        remarks = _others(decoder, isovalue, wanted)
    else:
        values = file.valid() if name == "valid" else file.above(isovalue, **view)
        if name == "above" and isovalue is None and file.isovalues:
            isovalue = file.isovalues[0]
            remarks = _others(file, isovalue, wanted)
        placement, complete = file.placement, file.complete
    count = int(np.count_nonzero(values))
    facts = {"samples": values.size, name: count, "isovalue": isovalue, "shape": list(values.shape),
             "complete": complete}
    return Exported(SampleMask(values, placement), facts, f"{count:,} of {values.size:,} samples {name}", remarks)


def _labels(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> Exported:
    labels = file.labels(frame=wanted.frame, partial=wanted.partial)
    found = [label.item() for label in np.unique(labels)]
    count = len({*found} & {*file.isovalues})
    text = f"{labels.size:,} samples, {count} label{'s' * (count != 1)}"
    facts = {"samples": labels.size, "labels": found, "shape": list(labels.shape)}
    return Exported(SampleMask(labels, file.placement, file.metadata), facts, text)


def _mesh(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> Exported:
    mesh = file.mesh(wanted.isovalue, **wanted.view, progress=progress)
    pieces = "triangles" if mesh.cells.shape[1] == 3 else "tetrahedra"
    check(f"_{suffix}", thing_of(mesh))
    held = sum(array.nbytes for array in (mesh.points, mesh.cells, mesh.levels, mesh.above))
    _check_memory(file, held + cost.peak(len(mesh.points), len(mesh.cells)))
    isovalue = None if np.isnan(mesh.isovalue) else float(mesh.isovalue)
    return Exported(
        mesh,
        {"vertices": len(mesh.points), pieces: len(mesh.cells), "isovalue": isovalue, "shape": list(mesh.shape),
         "complete": mesh.complete},
        f"{len(mesh.points):,} vertices, {len(mesh.cells):,} {pieces}",
        _others(file, mesh.isovalue, wanted),
    )


def _surface(file: IsoFile, suffix: str, wanted: Decode, progress: Any) -> Exported:
    size = file.size if wanted.partial and wanted.max_bytes is None else wanted.max_bytes
    tin = file.surface(layers=wanted.layers, max_bytes=size)
    facts = {"points": len(tin.points), "triangles": len(tin.triangles), "complete": tin.complete}
    return Exported(tin, facts, f"{len(tin.points):,} points, {len(tin.triangles):,} triangles")


_MAKERS: Mapping[str, Callable[[IsoFile, str, Decode, Any], Exported]] = {
    **dict.fromkeys(("curve", *_SIDES), _curves), "above": _samples, "valid": _samples, "labels": _labels,
    "mesh": _mesh, "surface": _surface,
}


def counted(file: IsoFile) -> FileInfo:
    """Inspect a file, decoding it to count its symbols by syntax element; raises `FormatError` or `LimitError`."""
    from ..stream.inspect import inspect

    return inspect(file.data, symbols=True, limits=file.limits) if file.kind != "tiles" else file.info
