"""Options of commands as records: each field of a record is an option or an argument of the command line."""

from __future__ import annotations

import errno
import gc
import math
import re
import sys
from collections.abc import Callable, Collection
from dataclasses import field, fields, replace
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..deferred import dataclass
from ..errors import FormatError
from ..limits import Limits
from .report import STANDARD, concerning, one_warning, own_warnings

if TYPE_CHECKING:
    from ..api.inputs import Choice
    from ..api.isofile import IsoFile

R = TypeVar("R", bound="Arguments")

ISOVALUE, PRECISION, LAYERS, PART, INPUT = "Isovalue", "Precision", "Layers", "Part of the file", "Input"
SURFACE, MESH, TILES, DRAWING, OUTPUT, LIMITS = "Surfaces", "Meshes", "Tiles", "Drawing", "Output", "Limits"
HEADINGS = (ISOVALUE, PRECISION, LAYERS, PART, INPUT, SURFACE, MESH, TILES, DRAWING, OUTPUT, LIMITS)
"""Headings of help, in order."""
COLUMN = 30
"""The widest column of options: click puts the text of longer ones on the next line."""


class NumberType(click.ParamType):
    """A number; integers stay integers, so that the encoder notices those that would be rounded."""

    name = "float"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | float:
        try:
            return int(value)
        except ValueError:
            number: float = click.FLOAT.convert(value, param, ctx)
            return number


class LabelType(NumberType):
    """A label, or ``all`` of them."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return value if value == "all" else super().convert(value, param, ctx)


class SizeType(click.ParamType):
    """A number of bytes: 500M, 4G, 1.5GiB."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        found = _SIZE.fullmatch(str(value).strip())
        size = int(float(found[1]) * 1024 ** " KMGT".index((found[2] or " ").upper())) if found else 0
        if size < 1:
            self.fail(f"{value!r} is not a size such as 500M or 4G", param, ctx)
        return size


_SIZE = re.compile(r"([0-9]{1,15}(?:\.[0-9]*)?)([KMGTkmgt]?)(?:i?[Bb])?")


class LimitsType(click.ParamType):
    """Limits on decoding: ``memory=4G,work=1000000,samples=500000000``."""

    name = "limits"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Limits:
        if isinstance(value, Limits):
            return value
        given = {}
        for part in str(value).split(","):
            name, _, number = part.strip().partition("=")
            if name not in ("memory", "work", "samples") or name in given:
                self.fail(f"{part!r} is not one of memory=, work= and samples=", param, ctx)
            given[name] = (SizeType() if name == "memory" else COUNT).convert(number, param, ctx)
        return replace(Limits(), **given)


class NumbersType(click.ParamType):
    """Numbers separated by commas."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a list of numbers separated by commas", param, ctx)


class WindowType(click.ParamType):
    """A window of samples: ``0:100,50:90``."""

    name = "window"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[tuple[float, float], ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple((float(low), float(high)) for low, high in (part.split(":") for part in value.split(",")))
        except ValueError:
            self.fail(f"{value!r} is not a range from:to for each axis, such as 0:100,50:90", param, ctx)


class From(click.IntRange):
    """An integer with a minimum, which the help does not repeat."""

    def _describe_range(self) -> str:
        return ""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        number: int = click.INT.convert(value, param, ctx)
        if self.min is not None and number < self.min:
            self.fail(f"{number} is less than {self.min:g}", param, ctx)
        return number


WHOLE, COUNT = From(min=0), From(min=1)
FILE = click.Path(path_type=Path, readable=False)
"""Whether files are readable is not checked here: a missing file is an error of input (3), not of usage (2)."""


def option(*names: str, heading: str = OUTPUT, **attributes: Any) -> Any:
    """A record field for an option; the attributes are those of `click.Option`."""
    usual = () if attributes.get("multiple") else False if "is_flag" in attributes else None
    default = attributes.get("default", usual)
    return field(default=default, metadata={"names": names, "heading": heading, "attributes": attributes})


def argument(metavar: str, **attributes: Any) -> Any:
    """A record field for a required positional argument."""
    return field(metadata={"names": (), "attributes": {"metavar": metavar, **attributes}})


class Heading(click.Option):
    """An option under a heading of help."""

    heading = OUTPUT


class Grouped(click.Command):
    """A command whose help shows its options under headings, in columns of the same width."""

    def text(self) -> str:
        """The help text without the options; names in braces are replaced by suffixes of formats."""
        if "{" not in (self.help or ""):
            return self.help or ""
        from ..api.output import formats

        return str(self.help).format_map(formats())

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Format help as click does, with the suffixes of formats filled in."""
        self.help = self.text()
        super().format_help_text(ctx, formatter)

    def make_parser(self, ctx: click.Context) -> Any:
        """Warn if an option that is not repeatable is given twice: only the last one counts."""
        parser = super().make_parser(ctx)
        parse = parser.parse_args

        def parsed(args: list[str]) -> Any:
            found = parse(args=args)
            for each in {id(one): one for one in found[2]}.values():
                repeats = sum(one is each for one in found[2]) > 1
                if repeats and isinstance(each, click.Option) and not (each.multiple or each.is_flag):
                    click.echo(f"isocodec: warning: {each.opts[0]} is given twice; the last one counts", err=True)
            return found

        parser.parse_args = parsed  # type: ignore[method-assign]
        return parser

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One block for each heading; `--help` goes to the last."""
        blocks: dict[str, list[tuple[str, str]]] = {}
        for each in self.get_params(ctx):
            record = each.get_help_record(ctx)
            if isinstance(each, click.Option) and record is not None:
                blocks.setdefault(getattr(each, "heading", OUTPUT), []).append(record)
        width = min(max(len(record[0]) for block in blocks.values() for record in block), COLUMN)
        for heading in sorted(blocks, key=HEADINGS.index):
            formatter.write(f"\n{heading}:\n")
            with formatter.indentation():
                formatter.write_dl([(names.ljust(width), text) for names, text in blocks[heading]])


def command(
    name: str, record: type[R], short_help: str, hidden: type | None = None
) -> Callable[[Callable[[R], Any]], Grouped]:
    """Make a command from a function that takes a record of options; the function's docstring is the help.

    Options that the record has from ``hidden`` are described by the help of another command, and only named here.
    """

    def made(function: Callable[[R], Any]) -> Grouped:
        own = vars(record).get("__annotations__", {})
        known = [each for each in fields(record) if each.metadata]
        known.sort(key=lambda each: (each.name == "as_json", each.name != "output", each.name not in own))
        apart = vars(hidden).get("__annotations__", {}) if hidden else {}
        params = [_parameter(each.name, each.metadata, each.name in apart) for each in known]

        def run(**given: Any) -> Any:
            options = record(**given)
            options.load()
            if not gc.isenabled():  # since the process began; what has been loaded is no garbage
                gc.freeze()
                gc.enable()
            return function(options)

        return Grouped(
            name, params=params, callback=run,
            help=cleandoc(function.__doc__ or ""), short_help=short_help,
        )

    return made


def _parameter(name: str, described: Any, hidden: bool) -> click.Parameter:
    attributes = dict(described["attributes"])
    if not described["names"]:
        return click.Argument([name], **attributes)
    made = Heading([*described["names"], name], hidden=hidden, **attributes)
    made.heading = described["heading"]
    return made


def written(record: type, name: str) -> str:
    """An option as the command line writes it: ``--keep-topology``."""
    names = record.__dataclass_fields__[name].metadata["names"]  # type: ignore[attr-defined]
    return str(names[-1]) if names else name


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """The options of a command."""

    as_json: bool = option("--json", is_flag=True, help="Print the result as JSON.")

    def load(self) -> None:
        """Import modules that the command needs in any case, before Python begins to look for garbage."""

    def given(self, *names: str) -> list[str]:
        """Find which of these options differ from their defaults, as the command line writes them."""
        known = {each.name: each.default for each in fields(self)}
        return [written(type(self), name) for name in names if getattr(self, name) != known[name]]

    def refuse(self, why: str, *names: str) -> None:
        """Refuse options: ``--frame does not apply to tiles``."""
        if wrong := self.given(*names):
            raise click.UsageError(f"{' and '.join(wrong)} {'does' if len(wrong) == 1 else 'do'} not {why}")

    def choose(self, *names: str, required: bool = False) -> None:
        """Refuse more than one of these options, or none of them if one is required."""
        chosen = self.given(*names)
        if len(chosen) > 1:
            raise click.UsageError(f"{' and '.join(chosen)} cannot be combined: choose one")
        if required and not chosen:
            listed = [written(type(self), name) for name in names]
            raise click.UsageError(f"give one of {', '.join(listed[:-1])} or {listed[-1]}")


@dataclass(frozen=True, kw_only=True)
class Limited(Arguments):
    """Limits of decoding."""

    limits: Limits = option(
        "--limits", heading=LIMITS, type=LimitsType(), default=Limits(), metavar="NAME=N,..",
        help="Limits on decoding: memory=4G, work=N (symbols, on top of an allowance for each byte), samples=N.  "
        f"[default: {Limits().memory >> 20}M, {Limits().work:,}, {Limits().samples:,}]",
    )


@dataclass(frozen=True, kw_only=True)
class Writing(Arguments):
    """A command that writes a file."""

    output: Path = option("-o", "--output", required=True, type=click.Path(path_type=Path), metavar="OUT",
                          help="File to write.")


@dataclass(frozen=True, kw_only=True)
class Converting(Writing):
    """A command that writes formats of other tools."""

    side: str = option("--side", heading=OUTPUT, type=click.Choice(["above", "below"]), default="above",
                       show_default=True, help="With --what areas or --capped: which side of the curve.")
    layer: str | None = option(
        "--layer", heading=OUTPUT, metavar="NAME",
        help="Layer to write; a GeoPackage that exists keeps its others.  [default: isolines, areas or bands]",
    )
    attribute: str | None = option(
        "--attribute", heading=OUTPUT, metavar="NAME",
        help="Name of the column of isovalues; of bands LOWER,UPPER.  [default: isovalue; label; lower,upper]",
    )
    keep_crs: bool = option(
        "--keep-crs", heading=OUTPUT, is_flag=True,
        help="Write .geojson in the reference system of the file, not in longitude and latitude.",
    )
    in_samples: bool = option("--in-samples", heading=OUTPUT, is_flag=True,
                              help="Write coordinates in samples, even if it is known where samples lie.")
    simplify: str | None = option(
        "--simplify", heading=OUTPUT, metavar="D",
        help="Leave out points of lines and areas, which stay within this distance (30m, or cells); no line crosses "
        "another.",
    )

    @property
    def converted(self) -> dict[str, Any]:
        """Attributes of what is wanted, as the library takes it."""
        from ..api.export import OutputOptions

        options = OutputOptions(self.keep_crs, self.in_samples, getattr(self, "to", None), self.layer, self.attribute)
        return {"side": self.side, "simplify": self.simplify, "options": options}

    def check_converting(self, what: str | None) -> None:
        """Refuse options that do not apply to what is written.

        Raises
        ------
        UsageError
        """
        if what not in (None, "curve", "areas", "bands"):
            self.refuse(f"apply to --what {what}", "attribute", "simplify")


@dataclass(frozen=True, kw_only=True)
class Opening(Limited):
    """A command that opens an ``.iso`` file."""

    source: str = argument("IN.iso")
    mesh: str | None = option(
        "--mesh", heading=INPUT, metavar="FILE", help="The mesh that IN.iso was made on, if the file does not store it."
    )

    def load(self) -> None:
        """Import what opens files."""
        from ..api import opening  # noqa: F401

    def opened(self, source: str | None = None) -> IsoFile:
        """Open the file.

        Raises
        ------
        Failure
        """
        return opened(self.source if source is None else source, self.limits, self.mesh)


def opened(source: str, limits: Limits, mesh: str | None = None) -> IsoFile:
    """Open a file, standard input (``-``) or a URL.

    Raises
    ------
    Failure
    """
    from ..api.opening import open
    from ..api.output import other_format

    known = None
    if mesh is not None:
        from ..api.inputs import mesh_in

        with concerning(mesh), one_warning(mesh):
            known = mesh_in(mesh)
    with concerning(source), own_warnings(source):
        try:
            return open(stream(source), mesh=known, limits=limits)
        except FormatError as error:
            if error.code == "signature" and (suffix := other_format(Path(source).name.lower())) is not None:
                error.remedy = f"{suffix} files are encoded, not decoded; verify takes the .iso file first"
            raise


@dataclass(frozen=True, kw_only=True)
class Viewing(Opening):
    """A command that decodes contours."""

    isovalue: float | None = option("--isovalue", heading=PART, type=float, metavar="V",
                                    help="Isovalue to decode.  [default: all that OUT can hold]")
    frame: int | None = option("--frame", heading=PART, type=WHOLE, metavar="N",
                               help="Frame of a series, from 0.  [default: the first]")
    partial: bool = option("--partial", heading=PART, is_flag=True,
                           help="Decode as much as there is of a truncated file.")
    smooth: bool | None = option(
        "--smooth/--no-smooth", heading=DRAWING, default=None,
        help="Move each point within the part of its grid edge in which the file places it, so that the curve is "
        "smooth.  [default: as the file asks]",
    )


@dataclass(frozen=True, kw_only=True)
class Reading(Arguments):
    """A command that reads a field."""

    key: str | None = option("--key", heading=INPUT, metavar="NAME",
                             help="Array of a file with several (of VTK also BLOCK/ARRAY, ARRAY:x, "
                                  "ARRAY:magnitude); series or segment of DICOM; values of a mesh or points.")
    band: int | None = option("--band", heading=INPUT, type=COUNT, metavar="N",
                              help="Band of a raster or channel of a picture, from 1; 1 takes indices of a palette.")
    bbox: tuple[float, ...] | None = option(
        "--bbox", heading=INPUT, type=NumbersType(), metavar="X,Y,X,Y",
        help="Read samples within these coordinates only: least x and y, largest x and y.",
    )
    frame: int | None = option("--frame", heading=INPUT, type=WHOLE, metavar="N",
                               help="Number, from 0, of the time step or item of a series.")
    nodata: float | None = option("--nodata", heading=INPUT, type=float, metavar="V",
                                  help="Value that marks missing samples, besides NaN.")

    def choice(self, frames: bool = False) -> Choice:
        """Collect what is chosen of a source."""
        from ..api.inputs import Choice

        return Choice(self.key, self.band, self.frame, frames, self.bbox, self.nodata)

    def windowed(self, source: str, missing: str | None = None) -> Any:
        """Open a field for tiles, whose samples may be read later.

        Raises
        ------
        Failure
        """
        from ..api.inputs import windowed

        with concerning(source), one_warning(source):
            return windowed(stream(source), self.choice(), missing or "hole")

    def read(self, source: str, frames: bool = False) -> Any:
        """Read a field, a series of them, or a mesh.

        Raises
        ------
        Failure
        """
        from ..api.inputs import read_input

        with concerning(source), one_warning(source):
            return read_input(stream(source), self.choice(frames))


def stream(source: str) -> Any:
    """Resolve the name of a source: standard input for ``-``; a path or a URL is returned unchanged.

    Raises
    ------
    OSError
        If standard input is closed.
    """
    if source != STANDARD:
        return source
    if sys.stdin is None:
        raise OSError(errno.EBADF, "standard input is closed")
    return sys.stdin.buffer


def notes_of(given: Collection[str]) -> dict[str, str]:
    """Parse texts KEY=TEXT into notes by key."""
    out: dict[str, str] = {}
    for text in given:
        key, equals, note = text.partition("=")
        if not (key and equals) or key in out:
            raise click.UsageError(f"--metadata {text}: give KEY=TEXT, and each key only once")
        out[key] = note
    return out


def multiples_of(interval: float | None, offset: float | None) -> str | None:
    """Write evenly spaced isovalues as the library takes them: ``every 20 from 5``."""
    if interval is None:
        if offset is not None:
            raise click.UsageError("--offset needs --interval")
        return None
    if not 0 < interval < math.inf:
        raise click.UsageError(f"--interval {interval}: must be greater than 0")
    if offset is not None and not math.isfinite(offset):
        raise click.UsageError(f"--offset {offset}: must be finite")
    return f"every {interval!r}" + ("" if offset is None else f" from {offset!r}")
