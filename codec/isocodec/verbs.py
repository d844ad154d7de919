"""One record a verb: every option is written here once, for Python and for the command line, with the checks on it.

The command line makes its options from the fields: their names, annotations and defaults, and how `option` describes
them. This module imports no numpy, so that help and usage errors come at once.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import Field, dataclass, field, fields
from itertools import chain
from numbers import Integral
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from .errors import OptionError

ISOVALUE, PRECISION, LAYERS, PART, INPUT = "Isovalue", "Precision", "Layers", "Part of the file", "Input"
SURFACE, MESH, TILES, DRAWING, OUTPUT = "Surfaces", "Meshes", "Tiles", "Drawing", "Output"
HEADINGS = (ISOVALUE, PRECISION, LAYERS, PART, INPUT, SURFACE, MESH, TILES, DRAWING, OUTPUT)
"""Headings of help, in order."""
Progress = Callable[[int, int], object]
ThinningName: TypeAlias = Literal["AT1", "AT2", "AT3", "inf", "l2", "NAT"]
"""Name of a criterion that finds the least significant point of a triangulation."""
Number = int | float
"""Integers stay integers, so that an encoder notices those that would be rounded."""
MOST_VALUES = 4096
"""Most numbers in a range: as many as a file has isovalues."""


def option(text: str, heading: str = OUTPUT, *, default: Any = None, **how: Any) -> Any:
    """A field that is an option of the command line, with its help.

    Other keywords: ``flag``, if it is not the field's name; ``metavar``; ``least``, the smallest number; ``read``, a
    function that parses a text; ``shown``, whether help states the default.
    """
    return field(default=default, metadata={"help": text, "heading": heading, **how})


def flag_of(each: Field[Any]) -> str:
    """An option as the command line writes it: ``--keep-topology``."""
    return str(each.metadata.get("flag", f"--{each.name.replace('_', '-')}"))


# -- values as the command line writes them ---------------------------------------------------------------------------


def number_of(text: str) -> Number:
    """Parse a number: ``20``, ``0.5``."""
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        raise OptionError(f"{text!r} is not a valid float", code="number") from None


def values_of(text: str) -> tuple[Number, ...]:
    """Parse numbers and ranges, in decimal and with the stop where steps meet it: ``1000,1500``, ``0:1:0.1``."""
    parts = [_range_of(part) if ":" in part else (number_of(part),) for part in text.split(",")]
    return tuple(chain.from_iterable(parts))


def _range_of(text: str) -> tuple[Number, ...]:
    from decimal import Decimal

    try:
        start, stop, step = map(Decimal, text.split(":"))
        last = (stop - start) / step
        if 0 <= last < MOST_VALUES:
            return tuple(number_of(str(start + number * step)) for number in range(int(last) + 1))
        wrong = f"has {'no' if last < 0 else f'more than {MOST_VALUES:,}'} values"
    except (ValueError, ArithmeticError):
        wrong = "is not a range"
    raise OptionError(f"{text!r} {wrong}", code="range", remedy="give START:STOP:STEP, such as 1000:2000:50")


def labels_of(text: str) -> tuple[Any, ...]:
    """Parse labels and ranges of labels, or ``all``."""
    return ("all",) if text == "all" else values_of(text)


def numbers_of(text: str) -> tuple[float, ...]:
    """Parse numbers: ``30,-30``."""
    return tuple(float(number_of(part)) for part in text.split(","))


def window_of(text: str) -> tuple[tuple[float, float], ...]:
    """Parse a window of samples: ``0:100,50:90``."""
    try:
        return tuple((float(low), float(high)) for low, high in (part.split(":") for part in text.split(",")))
    except ValueError:
        raise OptionError(f"{text!r} is not a range from:to for each axis", code="window",
                          remedy="for example 0:100,50:90") from None


def size_of(text: str) -> int:
    """Parse a number of bytes: ``500M``, ``4G``, ``1.5GiB``."""
    found = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]*)?)([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    size = int(float(found[1]) * 1024 ** " KMGT".index((found[2] or " ").upper())) if found else 0
    if size < 1:
        raise OptionError(f"{text!r} is not a size", code="size", remedy="for example 500M or 4G")
    return size


def every_of(text: str) -> str:
    """Parse the spacing of isovalues, and where they begin, to what the library takes: ``every 20 from 5``."""
    interval, *start = map(number_of, text.split(","))
    if len(start) > 1 or not (0 < interval < math.inf and all(map(math.isfinite, start))):
        raise OptionError(f"{text!r} is not a finite interval greater than 0, with or without a finite start",
                          code="interval", remedy="for example 20, or 20,5")
    return " from ".join([f"every {interval!r}", *map(repr, start)])


def note_of(text: str) -> tuple[str, str]:
    """Parse a note, ``KEY=TEXT``."""
    key, equals, note = text.partition("=")
    if not (key and equals):
        raise OptionError(f"{text!r} is not a note", code="metadata", remedy="give KEY=TEXT")
    return key, note


def sample_of(text: str) -> tuple[str, str]:
    """Parse the name of values and the file that they come from, ``NAME=FILE``."""
    name, _, source = text.partition("=")
    if not (name and source):
        raise OptionError(f"{text!r} is not a name and a file", code="sample", remedy="for example dose=dose.nii")
    return name, source


# -- records ----------------------------------------------------------------------------------------------------------


class OptionRecord:
    """Options of which only some are given."""

    def given(self, *names: str) -> list[str]:
        """Find which of these differ from their defaults, as the command line writes them."""
        known: dict[str, Any] = {each.name: each for each in fields(self)}  # type: ignore[arg-type]
        values = [(known[name], getattr(self, name), known[name].default) for name in names]
        return [flag_of(each) for each, value, usual in values
                if value is not usual and (usual is None or value != usual)]

    def refuse(self, why: str, *names: str) -> None:
        """Refuse options: ``--frame does not apply to tiles``."""
        if wrong := self.given(*names):
            raise OptionError(f"{' and '.join(wrong)} {'does' if len(wrong) == 1 else 'do'} not {why}", code="options")

    def choose(self, *names: str, required: bool = False) -> None:
        """Refuse more than one of these options, or none if one is required."""
        chosen = self.given(*names)
        if len(chosen) > 1:
            raise OptionError(f"{' and '.join(chosen)} cannot be combined", code="options", remedy="choose one")
        if required and not chosen:
            known: dict[str, Any] = {each.name: each for each in fields(self)}  # type: ignore[arg-type]
            *others, last = (flag_of(known[name]) for name in names)
            raise OptionError(f"give one of {', '.join(others)} or {last}", code="options")


@dataclass(frozen=True)
class Choice(OptionRecord):
    """Choice from a source that holds several things, as of `isocodec.read`.

    With ``lazy``, samples are read by windows later, if the format can do that.
    """

    key: str | None = option(
        "Array of a file with several (of VTK also BLOCK/ARRAY, ARRAY:x, ARRAY:magnitude); series or segment of DICOM; "
        "values of a mesh or points.", INPUT, metavar="NAME",
    )
    band: int | None = option("Band of a raster or channel of a picture, from 1; 1 takes indices of a palette.", INPUT,
                              metavar="N", least=1)
    bbox: Sequence[float] | None = option(
        "Read samples within these coordinates only: least x and y, largest x and y.", INPUT, metavar="X,Y,X,Y",
        read=numbers_of,
    )
    frame: int | None = option("Number, from 0, of the time step or item of a series.", INPUT, metavar="N", least=0)
    nodata: float | None = option("Value that marks missing samples, besides NaN.", INPUT, metavar="V")
    frames: bool = False
    lazy: bool = False


@dataclass(frozen=True)
class OutputOptions(OptionRecord):
    """Options of writing in formats of other tools; ``to`` is the format of a name without a suffix."""

    layer: str | None = option("Layer to write; a GeoPackage that exists keeps its others.  [default: isolines, areas "
                               "or bands]", metavar="NAME")
    attribute: str | None = option("Name of the column of isovalues; of bands LOWER,UPPER.  [default: isovalue; label; "
                                   "lower,upper]", metavar="NAME")
    sample: tuple[tuple[str, str], ...] = option(
        "Write the values of the field (or mesh) in FILE at the points, too; in tables their mean along each line. "
        "Repeatable.", default=(), metavar="NAME=FILE", read=sample_of,
    )
    in_samples: bool = option("Write coordinates in samples, even if it is known where samples lie.", default=False)
    like: str | None = option(
        "DICOM series (a file, or a folder of slices) whose patient, study and frame of reference OUT takes if it is a "
        ".dcm.", metavar="SERIES",
    )
    simplify: str | None = option(
        "Leave out points of lines and areas, which stay within this distance (30m, or cells); no line crosses "
        "another.", metavar="D",
    )
    to: str | None = None

    def check_names(self, what: str) -> None:
        """Refuse names of columns, unless two are given for bands and one for curves and areas."""
        names = 0 if self.attribute is None else self.attribute.count(",") + 1
        most = {"bands": 2, "curve": 1, "areas": 1, "areas-below": 1}.get(what, 0)
        if names and names != most:
            raise OptionError(f"--attribute names {most or 'no'} column{'s' * (most != 1)} for {what}",
                              code="attribute",
                              remedy=("leave it out", "--attribute elev", "--attribute low,high")[most])


@dataclass(frozen=True)
class Viewed(OptionRecord):
    """Request of what to draw from a file: the parameters of `IsoFile.contour`, checked."""

    frame: int | None = option("Frame of a series, from 0.  [default: the first]", PART, metavar="N", least=0)
    layers: int | None = option("Decode the first N layers of an isovalue.", PART, metavar="N", least=1)
    max_bytes: int | None = option("Decode the first N bytes.", PART, metavar="N", read=size_of)
    window: Sequence[Sequence[float]] | None = option(
        "Decode a window of samples, from:to for each axis; from a tiled file only this part is read.", PART,
        metavar="A:B,C:D", read=window_of,
    )
    bbox: Sequence[float] | None = option(
        "The same by coordinates of the file: least x and y, largest x and y (of volumes with z).", PART,
        metavar="X,Y,X,Y", read=numbers_of,
    )
    within: Any = option(
        "Stop refining as soon as mesh cells are at most N samples wide.", PART, metavar="N", read=number_of,
    )
    partial: bool = option("Decode as much as there is of a truncated file.", PART, default=False)
    smooth: bool | None = option(
        "Move each point within the part of its grid edge in which the file places it, so that the curve is smooth.  "
        "[default: as the file asks]", DRAWING,
    )
    through_holes: bool = option("Draw curves through missing samples, where the encoder chose their course.", DRAWING,
                                 default=False)
    progress: Progress | None = None

    def __post_init__(self) -> None:
        check_count(self.layers, "layers")
        check_count(self.max_bytes, "max_bytes")
        check_count(self.frame, "frame", 0)
        self.choose("window", "bbox")

    @property
    def view(self) -> dict[str, Any]:
        """The parameters that are given, by name."""
        known = {each.name: getattr(self, each.name) for each in fields(Viewed)}
        return {name: value for name, value in known.items() if (value is not None and value is not False)
                or (name, value) == ("smooth", False)}

    def refuse_for(self, kind: str, *names: str) -> None:
        """Refuse parameters that do not apply to a kind of file."""
        for name in names:
            if getattr(self, name) not in (None, False):
                raise OptionError(f"{name} does not apply to {_KINDS[kind]}", code=name.replace("_", "-"))


_KINDS = {
    "grid": "curves of a grid", "series": "a series of frames", "mesh": "curves on a mesh",
    "surface": "a triangulated surface", "tiles": "curves in tiles",
}
_NOT_OF_AREAS = ("capped", "through_holes")
_NOT_OF_SAMPLES = (*_NOT_OF_AREAS, "layers", "max_bytes", "window", "bbox", "within", "smooth", "attribute",
                   "simplify")
_APART = {
    "curve": (), "areas": _NOT_OF_AREAS, "areas-below": _NOT_OF_AREAS, "bands": _NOT_OF_AREAS,
    "above": _NOT_OF_SAMPLES, "valid": (*_NOT_OF_SAMPLES, "frame", "isovalues"),
    "labels": (*_NOT_OF_SAMPLES, "isovalues"), "mesh": (*_NOT_OF_AREAS, "smooth", "attribute", "simplify"),
    "surface": (*_NOT_OF_AREAS, "window", "bbox", "within", "frame", "smooth", "isovalues", "attribute", "simplify"),
}
"""Options of decoding that do not apply, by what is decoded."""


@dataclass(frozen=True)
class Decode(Viewed, OutputOptions):
    """Request of what to decode from a file, and how to write it; without ``what``, its surface or its curves."""

    what: Literal["curve", "areas", "areas-below", "bands", "above", "valid", "labels", "mesh", "surface"] | None = (
        option("One of: curve (of a volume, a surface), areas (above a curve), areas-below, bands (between curves), "
               "above (mask), valid (mask of the samples that are not missing), labels, mesh, surface (triangulated).  "
               "[default: curve, or surface if the file holds one]", metavar="WHAT")
    )
    isovalues: tuple[Number, ...] = option(
        "Isovalues to decode: 10,20, or 10:50:10. Repeatable.  [default: all that OUT can hold]", PART, default=(),
        flag="--isovalue", metavar="V,..", read=values_of,
    )
    capped: Literal["above", "below"] | None = option(
        "Close a surface in space where it leaves the field, around what lies above or below it.", DRAWING,
    )
    to: str | None = option("Format of OUT if its name has no suffix, or is -; for example .geojson.", metavar="SUFFIX")
    threads: int | None = option("Number of threads that decode tiles.  [default: all cores for volumes, else 1]",
                                 metavar="N", least=1)

    def __post_init__(self) -> None:
        Viewed.__post_init__(self)
        if self.capped:
            self.refuse("apply with --capped", "window", "bbox")
        if self.what:
            self.check_what(self.what)

    def check_what(self, what: str) -> None:
        """Refuse options that do not apply to what is decoded."""
        self.refuse(f"apply to {what}", *_APART[what])
        self.check_names(what)
        if what in ("above", "mesh") and len(self.isovalues) > 1:
            raise OptionError(f"{what} is of one isovalue, and {len(self.isovalues)} are given", code="isovalue",
                              remedy="give one isovalue")

    @property
    def isovalue(self) -> Number | None:
        """The first of the isovalues; None if none is given."""
        return self.isovalues[0] if self.isovalues else None


_CODED = ("tile", "frames", "layers", "order", "effort", "stored", "mesh_error", "metadata", "profile")
"""Options of .iso files that other formats do not have."""
_CONVERTED = ("what", "layer", "attribute", "sample", "in_samples", "like", "simplify")
"""Options of other formats."""
_OF_WHOLE = ("order", "effort", "keep_topology", "layers", "frames", "interval", "periodic")
"""Options that do not apply to tiles."""


@dataclass(frozen=True)
class Encode(Choice, OutputOptions):
    """Request of what to encode, and how; names that `isocodec.encode` has are its parameters."""

    isovalues: tuple[Number, ...] = option(
        "Samples with value > V are inside. Repeatable: 10,20,50, or a range START:STOP:STEP, 0:1:0.1.", ISOVALUE,
        default=(), flag="--isovalue", metavar="V,..", read=values_of,
    )
    every: str | None = option("All multiples of S within the range of the data, in one file; with V: V, V + S, "
                               "V + 2 S, ..", ISOVALUE, flag="--interval", metavar="S[,V]", read=every_of)
    labels: tuple[Any, ...] = option(
        "Inside is value == K; all: of all values but 0. --precision signs by default. Repeatable: 1,2, or 1:9:1.",
        ISOVALUE, default=(), flag="--label", metavar="K,..", read=labels_of,
    )
    order: str | None = option(
        "levels: the first bytes show all isovalues (default where possible); isovalues: one by one; independent: each "
        "decodable alone.", ISOVALUE, metavar="O",
    )
    precision: str | None = option(
        "exact (integers); step=S (floats); signs (samples inside); a distance in cells or in the world: 0.05, 100m, "
        "0.2mm; falling ones, also with exact or step=S at last: 4,1,0.25,exact; drawn smooth: '0.2 smooth'.  "
        "[default: 0.05]", PRECISION, metavar="P",
    )
    keep_topology: bool = option("Keep the topology of the contour in every layer.", PRECISION, default=False)
    effort: Literal["normal", "best"] = option(
        "best: take ten to fifty times the time at distances from 0.1 to 0.75 cells, for files that are 1 to 3 % "
        "smaller, smooth ones up to 25 %.", PRECISION, default="normal", metavar="E",
    )
    layers: str | None = option(
        "One of: a level L, to start from the uniform mesh of that level instead of searching for the best mesh; a "
        "criterion that the coarsened mesh must meet (crossing, topology, curvature=K, distortion=D or level=L).",
        LAYERS, metavar="L",
    )
    frames: bool = option("Encode the slices, or the volumes of a 4-D file, as a series.", INPUT, default=False)
    interval: int | None = option(
        "Make every K-th frame a key frame, which decodes on its own.  0: the first only.  [default: 16]", INPUT,
        flag="--frame-interval", metavar="K", least=0,
    )
    missing: Literal["hole", "below", "above", "nearest"] | None = option(
        "What to do with missing samples: hole, the contour ends there (default); below or above, count them as such; "
        "nearest, copy the nearest sample.", INPUT, metavar="HOW",
    )
    spacing: Sequence[float] | None = option("Distances of samples along the axes; may be negative.", INPUT,
                                               metavar="S,S[,S]", read=numbers_of)
    origin: Sequence[float] | None = option("Coordinates of the first sample.", INPUT, metavar="X,Y[,Z]",
                                              read=numbers_of)
    crs: str | None = option("Reference system of the coordinates: EPSG:32631, WKT or PROJJSON.", INPUT, metavar="CRS")
    periodic: tuple[int, ...] = option("Join the two ends of this axis (counted from 0). Repeatable.", INPUT,
                                       default=(), metavar="AXIS", least=0)
    stored: Literal["known", "coded", "whole", "delaunay"] | None = option(
        "known: decoders have the mesh (default); coded: the file stores the cells that the contour crosses; whole: it "
        "stores all cells or points;  delaunay: it stores the points that the contour needs, which decoders "
        "triangulate (default for points).", MESH, metavar="HOW",
    )
    mesh_error: float | None = option("For a mesh that the file stores: largest error of its point positions.", MESH,
                                      metavar="D")
    tile: int | None = option(
        "Encode tile by tile, N = 2**k samples along each axis, for fields larger than memory. Run the same command "
        "again to resume an interrupted one.", TILES, metavar="N", least=1,
    )
    threads: int | None = option("Number of threads that encode tiles.  [default: all cores]", TILES, metavar="N",
                                 least=1)
    metadata: tuple[tuple[str, str], ...] = option("Add a note to the file. Repeatable.", default=(),
                                                   metavar="KEY=TEXT", read=note_of)
    profile: Literal["main", "baseline"] = option("Entropy coding: main (default) or baseline.", default="main",
                                                  metavar="NAME")
    what: Literal["curve", "areas", "areas-below", "bands"] | None = option(
        "Unless OUT is .iso: curve (default), areas (above curves), areas-below, or bands (between curves).",
        metavar="WHAT",
    )

    def check(self, converts: bool) -> None:
        """Refuse options that cannot be combined; ``converts``: contours are written in another format than .iso."""
        if converts:
            self.refuse("apply unless OUT is .iso", *_CODED)
            self.check_names(self.what or "curve")
        else:
            self.refuse("apply to .iso files", *_CONVERTED)
        if self.tile is None:
            self.refuse("apply without --tile", "threads")
        else:
            self.refuse("apply to tiles", *_OF_WHOLE)
        self.choose("isovalues", "every", "labels", required=True)
        if "all" in self.labels and len(self.labels) > 1:
            raise OptionError("--label all takes no other labels", code="labels")
        self.choose("labels", "missing")
        check_notes(self.metadata)

    def check_input(self, kind: str) -> None:
        """Refuse options that do not apply to a mesh, a field or a series."""
        if kind == "mesh":
            self.refuse("apply to meshes and points", "labels", "missing", "spacing", "origin", "periodic", "frames")
        else:
            self.refuse("apply to sampled fields", "stored", "mesh_error")
        if kind == "field":
            self.refuse("apply to a single field: add --frames", "interval")

    @property
    def isovalue(self) -> Any:
        """Isovalues as the library takes them."""
        return self.every or (self.isovalues[0] if len(self.isovalues) == 1 else [*self.isovalues] or None)

    @property
    def marked(self) -> bool:
        """Whether samples are expected to be missing."""
        return self.nodata is not None or self.missing is not None


@dataclass(frozen=True)
class Edit(OptionRecord):
    """Changes to make to a file: the parameters of `IsoFile.edited`."""

    layers: int | None = option("Keep the first N layers, counted over all isovalues; of a tiled file, the first N "
                                "stages of every tile.", PART, metavar="N", least=1)
    size: int | None = option("Keep the layers that fit into this many bytes: 900, 20K.", PART, metavar="SIZE",
                              read=size_of)
    window: Sequence[Sequence[float]] | None = option("Keep a window of samples, from:to for each axis.", PART,
                                                      metavar="A:B,C:D", read=window_of)
    bbox: Sequence[float] | None = option(
        "The same by coordinates of the file: least x and y, largest x and y (of volumes with z).", PART,
        metavar="X,Y,X,Y", read=numbers_of,
    )
    isovalues: tuple[Number, ...] | None = option("Keep these isovalues: 10,20, or 10:50:10. Repeatable.", PART,
                                                  flag="--isovalue", metavar="V,..", read=values_of)
    profile: Literal["main", "baseline"] | None = option(
        "Encode the curves again in this profile; no point moves.", PRECISION,
    )
    precision: Any = option(
        "Encode the curves again less precisely: signs, or a distance from the curves of IN.iso, in cells or in the "
        "world: 0.5, 10m.", PRECISION, metavar="P",
    )
    keep_topology: bool = option("With --precision: keep the topology of the curves in every layer.", PRECISION,
                                 default=False)

    def check(self, several: bool = False) -> None:
        """Refuse changes that cannot be combined, or none; ``several`` files are merged, in one profile."""
        names = [each.name for each in fields(self)]
        if several:
            self.refuse("apply to several files: merge them first", *(name for name in names if name != "profile"))
        elif not self.given(*names):
            raise OptionError("nothing to change", code="edit",
                              remedy="give layers, size, window, bbox, isovalues, profile or precision")
        self.choose("window", "bbox")
        if self.layers is not None and self.size is not None:
            raise OptionError("layers and size cannot be combined", code="options", remedy="choose one")


@dataclass(frozen=True)
class Info(OptionRecord):
    """Request of what to show of a file."""

    statistics: bool = option(
        "Also count symbols by syntax element, bits per crossed pixel, vertex and face, and how many signs were "
        "predicted correctly (decodes the file).", default=False,
    )


@dataclass(frozen=True)
class Plugins(OptionRecord):
    """Request of what to do with plugins for other programs."""

    bundle: Path | None = option("Write isocodec for other programs to OUT.zip.", metavar="OUT.zip")
    qgis: bool = option("Install the plugin for QGIS, with isocodec, in the user's default profile.", default=False)


@dataclass(frozen=True)
class Serve(OptionRecord):
    """Request of a server of files with the viewer."""

    port: int = option("Port on this computer; 0 for any free one.", default=8137, metavar="N", least=0, shown=True)
    viewer: Path | None = option("Folder of the viewer.  [default: the one that was built]", metavar="FOLDER")

    def check(self) -> None:
        """Refuse ports that do not exist."""
        if self.port > 65535:
            raise OptionError(f"port {self.port} is not one of 0 to 65535", code="port")


@dataclass(frozen=True)
class Verify(Choice):
    """A field to verify a file against, and the distance to check."""

    within: str | None = option(
        "Distance to check, in cells or in the world: 0.5, 10m; on a mesh in the unit of its points, for a surface the "
        "largest error of its values.  [default: the promise of IN.iso]", INPUT, metavar="D",
    )


@dataclass(frozen=True)
class Plot(Choice):
    """Request of a picture of a file or a field."""

    isovalues: tuple[Number, ...] = option(
        "Isovalue to draw alone; with --map also several: 10,20, or 10:50:10.  [default: all]", ISOVALUE, default=(),
        flag="--isovalue", metavar="V,..", read=values_of,
    )
    every: str | None = option("With a field: draw all multiples of S.  [default: about 20 lines]", ISOVALUE,
                               flag="--interval", metavar="S[,V]", read=every_of)
    frame: int | None = option("Frame of a series, from 0.  [default: the first]", PART, metavar="N", least=0)
    steps: int = option("Number of steps.", DRAWING, default=5, metavar="N", least=1, shown=True)
    draw_mesh: bool = option("Also draw the triangles that the curve crosses, or those of the surface.", DRAWING,
                             default=False)
    view: str | None = option(
        "Look at a surface, or a curve in space, from front, back, left, right, top or bottom, or from "
        "AZIMUTH,ELEVATION in degrees (0,0 is the front, 90,0 the side of +x).", DRAWING, metavar="VIEW",
    )
    map: bool = option("Draw a contour map.", DRAWING, default=False)
    title: str = option("With --map: title of the map.", DRAWING, default="", metavar="TEXT")
    size: float = option("With --map: length of the longest side, 4 to 400.", DRAWING, default=20.0, metavar="CM",
                         shown=True)
    metadata: tuple[tuple[str, str], ...] = option("With a field: state what it does not: placement, crs or unit.",
                                                   INPUT, default=(), metavar="KEY=TEXT", read=note_of)

    def check(self, coded: bool, mesh: str | None) -> None:
        """Refuse options that cannot be combined; ``coded``: an .iso file is drawn, on a mesh if there is one."""
        if self.map:
            self.refuse("apply to maps", "steps", "draw_mesh", "view")
        else:
            self.refuse("apply without --map", "every", "title", "size")
        if coded:
            self.refuse("apply to .iso files, which have their isovalues and notes", "every", "metadata", "nodata",
                        "key", "band", "bbox")
        elif mesh is not None:
            raise OptionError("--mesh does not apply to fields", code="options")
        self.choose("every", "isovalues")
        if not self.map and len(self.isovalues) > 1:
            raise OptionError("several isovalues need --map", code="options", remedy="give one isovalue")
        if not 4 <= self.size <= 400:
            raise OptionError(f"a map of {self.size:g} cm", code="size", remedy="give 4 to 400")
        check_notes(self.metadata)


@dataclass(frozen=True)
class Thin(Choice):
    """Request to thin a terrain, a picture or points: the parameters of `isocodec.thin`."""

    contours: tuple[Number, ...] | None = option(
        "If OUT is .iso: keep the contours of these values, and hardly any other points: 10,20, or 10:50:10. "
        "Repeatable.", SURFACE, flag="--isovalue", metavar="V,..", read=values_of,
    )
    layers: int = option("If OUT is .iso: store the points in N layers at most, so that any beginning of the file "
                         "gives a good surface.", SURFACE, default=1, metavar="N", least=1)
    criterion: ThinningName | None = option(
        "How points are ranked; the point whose removal does least harm goes first. AT1: largest error in the "
        "triangles around the point; AT2: error at the point itself; AT3: the same, estimated faster from triangles in "
        "each direction; inf: largest error over all points; l2: sum of squared errors; NAT: distance to the nearest "
        "point, whatever the values.  [default: AT1; if OUT is .iso, points are chosen so that the file is best]",
        SURFACE,
    )
    to: int | None = option("Keep N points.", SURFACE, flag="--points", metavar="N", least=3)
    error: float | str | None = option("Keep as few points as miss no value by more than E: 0.5, or 2m.", SURFACE,
                                       metavar="E", read=str)
    size: int | None = option("Keep as many points as fit into an .iso file of this size.", SURFACE, metavar="SIZE",
                              read=size_of)
    tolerance: float | str | None = option(
        "With --isovalue: keep its contour to within D, in samples or in the world (0.5, 10m), and little else.",
        SURFACE, metavar="D", read=str,
    )
    step: float | None = option("In an .iso file: round values to multiples of this step.", SURFACE, metavar="S")

    def check(self, coded: bool = True) -> None:
        """Refuse what cannot be combined or is out of range; without ``coded``, OUT is not an .iso file."""
        if not coded:
            self.refuse("apply unless OUT ends in .iso", "size", "layers", "contours", "step")
        apart = [name for name in ("size", "contours", "tolerance") if getattr(self, name) is not None]
        if self.criterion is not None and apart:
            raise OptionError(f"a criterion and {apart[0]} cannot be combined", code="criterion",
                              remedy="leave the criterion out")
        if self.criterion not in (None, *(names := get_args(ThinningName))):
            raise OptionError(f"unknown criterion {self.criterion!r}", code="criterion",
                              remedy=f"one of {', '.join(names)}")
        if sum(each is not None for each in (self.error, self.to, self.size, self.contours)) != 1:
            raise OptionError("give exactly one of error, to (--points), size or contours (--isovalue)", code="tin",
                              remedy="error=5.0, or size=2000")
        if self.contours is not None and not (self.contours and all(map(math.isfinite, self.contours))):
            raise OptionError("contours must be finite numbers, one or more", code="isovalue", remedy="contours=[500]")
        check_count(self.to, "to", 3)
        check_count(self.size, "size")
        check_count(self.layers, "layers")
        if (self.contours is None) != (self.tolerance is None) or not _in_range(self.tolerance, 1e-300):
            raise OptionError("contours (--isovalue) need a --tolerance greater than 0, and that needs contours",
                              code="tolerance", remedy="contours=[500], tolerance=0.5")
        if not _in_range(self.error, 0):
            raise OptionError(f"the error is {self.error}; it must be 0 or greater", code="error")
        alone = self.criterion is None and (self.error is not None or self.contours is not None)
        if self.step is not None and (alone or not _in_range(self.step, 1e-300)):
            raise OptionError("step needs a number of points or a size, and must be greater than 0", code="step",
                              remedy="with error=, the rounding step follows from the error")


def _in_range(number: Any, least: float) -> bool:
    """Whether a number that may be missing, or a text with a unit, is finite and not too small."""
    return number is None or isinstance(number, str) or least <= number < math.inf


def threads_of(given: int | None) -> int:
    """Number of threads; all cores that this process may use if none is given."""
    if given is not None:
        check_count(given, "threads")
        return given
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_count(count: Any, name: str, least: int = 1) -> None:
    """Refuse a count that is not an integer of at least ``least``."""
    if count is not None and (isinstance(count, bool) or not isinstance(count, Integral) or count < least):
        raise OptionError(f"{name} is {count}; it must be an integer of at least {least}",
                          code=name.replace("_", "-"))


def check_notes(notes: Sequence[tuple[str, str]]) -> None:
    """Refuse a key of a note that is given twice."""
    keys = [key for key, _ in notes]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise OptionError(f"two notes {twice[0]}", code="metadata", remedy="give KEY=TEXT, and each key only once")
