"""Commands of click, made from the records of `isocodec.verbs`, and what the commands share."""

from __future__ import annotations

import errno
import sys
import time
from collections.abc import Callable
from dataclasses import Field, dataclass, fields, replace
from inspect import cleandoc
from itertools import chain
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import click

from .. import verbs
from ..errors import FormatError, InputError, OptionError
from ..limits import Limits
from .report import STANDARD, Failure, Program, concerning, one_warning, own_warnings, result, warn

if TYPE_CHECKING:
    from ..api.isofile import IsoFile

R = TypeVar("R", bound=verbs.OptionRecord)
LIMITS = "Limits"
HEADINGS = (*verbs.HEADINGS, LIMITS)
"""Headings of help, in order."""
COLUMN = 30
"""The widest column of options: click puts the text of longer ones on the next line."""
_READ: dict[Any, Callable[[str], Any]] = {int: int, float: float, Path: Path}
"""Functions that parse a text, by annotation."""


class Parsed(click.ParamType):
    """A value that a function parses; its errors are errors of usage."""

    name = "value"

    def __init__(self, read: Callable[[str], Any], least: int | None = None) -> None:
        self.read, self.least = read, least

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            found = self.read(value)
        except OptionError as error:
            self.fail(str(error), param, ctx)
        except ValueError:
            self.fail(f"{value!r} is not a valid {'integer' if self.read is int else 'float'}", param, ctx)
        if self.least is not None and found < self.least:
            self.fail(f"{value} is less than {self.least}", param, ctx)
        return found


def target_of(text: str) -> Path | str:
    """Parse the name of a file, or the URL of an object in a store, which stays as it is."""
    return text if "://" in text else Path(text)


def limits_of(text: str) -> Limits:
    """Parse limits on decoding: ``memory=4G,work=1000000,samples=500000000``."""
    given: dict[str, int] = {}
    for part in text.split(","):
        name, _, number = part.strip().partition("=")
        if name not in ("memory", "work", "samples") or name in given:
            raise OptionError(f"{part!r} is not one of memory=, work= and samples=", code="limits")
        given[name] = verbs.size_of(number)
    return replace(Limits(), **given)


@dataclass(frozen=True)
class Call(verbs.OptionRecord):
    """Parts of a command line beside the options of its verb: files, limits, and how the result is printed."""

    source: Any = ""
    field: str = ""
    output: Any = verbs.option("File to write.", default=Path(), flag="-o --output", read=target_of,
                                metavar="OUT", required=True)
    mesh: str | None = verbs.option("The mesh that IN.iso was made on, if the file does not store it.", verbs.INPUT,
                                    metavar="FILE")
    limits: Limits = verbs.option(
        "Limits on decoding: memory=4G, work=N (symbols, on top of an allowance for each byte), samples=N.  "
        f"[default: {Limits().memory >> 20}M, {Limits().work:,}, {Limits().samples:,}]", LIMITS, default=Limits(),
        metavar="NAME=N,..", read=limits_of,
    )
    as_json: bool = verbs.option("Print the result as JSON.", default=False, flag="--json")

    def opened(self, source: str | None = None, threads: int | None = None) -> IsoFile:
        """Open the file, standard input (``-``) or a URL; raises `Failure`."""
        from ..api.opening import open
        from ..api.output import other_format

        source, known = self.source if source is None else source, None
        if self.mesh is not None:
            found = self.read(verbs.Choice(), self.mesh)
            if getattr(found, "cells", None) is None:
                raise Failure(self.mesh, InputError("holds no mesh of points and cells", code="mesh",
                                                    remedy="give the mesh that was encoded"))
            known = found.points, found.cells
        with concerning(source), own_warnings(source):
            try:
                return open(stream(source), mesh=known, limits=self.limits, threads=threads)
            except FormatError as error:
                if error.code == "signature" and (suffix := other_format(Path(source).name.lower())) is not None:
                    error.remedy = f"{suffix} files are encoded, not decoded; verify takes the .iso file first"
                raise

    def read(self, choice: verbs.Choice, source: str | None = None) -> Any:
        """Read a field, a series of fields, or a mesh; raises `Failure`."""
        from ..api.inputs import load

        source = self.source if source is None else source
        with concerning(source), one_warning(source):
            return load(stream(source), choice)

    def warn(self, *remarks: str) -> None:
        """Print remarks on the input as warnings."""
        for remark in remarks:
            warn(self.source, remark)

    def done(self, text: str, facts: dict[str, Any]) -> None:
        """Print the result of a command that has written a file, with the seconds it took."""
        seconds = time.perf_counter() - Program.started  # loading of libraries included
        result(f"{click.format_filename(self.output)}: {text}, {seconds:.2f} s",
               {"output": str(self.output), **facts, "seconds": round(seconds, 3)}, self.as_json)


def stream(source: str) -> Any:
    """Resolve the name of a source: standard input for ``-``; a path or a URL is returned unchanged.

    Raises `OSError` if standard input is closed.
    """
    if source != STANDARD:
        return source
    if sys.stdin is None:
        raise OSError(errno.EBADF, "standard input is closed")
    return sys.stdin.buffer


class Heading(click.Option):
    """An option under a heading of help."""

    heading = verbs.OUTPUT


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
                blocks.setdefault(getattr(each, "heading", verbs.OUTPUT), []).append(record)
        width = min(max(len(record[0]) for block in blocks.values() for record in block), COLUMN)
        for heading in sorted(blocks, key=HEADINGS.index):
            formatter.write(f"\n{heading}:\n")
            with formatter.indentation():
                formatter.write_dl([(names.ljust(width), text) for names, text in blocks[heading]])


def command(
    name: str, record: type[R], short_help: str, *arguments: str, shares: tuple[str, ...] = (),
    hidden: type[verbs.OptionRecord] | None = None,
) -> Callable[[Callable[[Call, R], Any]], Grouped]:
    """Make a command from a function that takes a call and a record of options; its docstring is the help.

    ``arguments`` name the files that are read: the source, one or ``IN.iso ...``, and the field. ``shares`` names
    fields of `Call` that are options of this command besides ``as_json``. Options of the record ``hidden`` are
    described by the help of another command.
    """

    def made(function: Callable[[Call, R], Any]) -> Grouped:
        shared = {each.name: each for each in _parameters(Call) if each.name in (*shares, "as_json")}
        params: list[click.Parameter] = [*_parameters(record, hidden), *shared.values()]
        params.sort(key=lambda each: each.name != "output")
        files = dict(zip(("source", "field"), arguments, strict=False))
        usual = {each.name: each.default for each in fields(record)}  # type: ignore[arg-type]

        def run(**given: Any) -> Any:
            call = Call(**{name: given.pop(name) for name in (*files, *shared)})
            try:
                return function(call, record(**{name: given[name] if given[name] != () else usual[name]
                                                for name in given}))
            except OptionError as error:  # about no file
                raise click.UsageError(str(error)) from error

        params += [click.Argument([name], metavar=metavar, required=True, nargs=-1 if "..." in metavar else 1)
                   for name, metavar in files.items()]
        return Grouped(name, params=params, callback=run, help=cleandoc(function.__doc__ or ""), short_help=short_help)

    return made


def _parameters(
    record: type[verbs.OptionRecord], hidden: type[verbs.OptionRecord] | None = None
) -> list[click.Parameter]:
    """Make the options of a record, its own before those of the records that it extends."""
    known = {each.name: each for each in fields(record)}  # type: ignore[arg-type]
    types, apart = get_type_hints(record), vars(hidden)["__annotations__"] if hidden else {}
    names = dict.fromkeys(name for each in record.__mro__ for name in vars(each).get("__annotations__", {}))
    return [_parameter(known[name], types[name], name in apart) for name in names if known[name].metadata]


def _parameter(each: Field[Any], kind: Any, hidden: bool) -> click.Option:
    """Make an option: a bool is a flag, a tuple repeatable, a Literal a choice; others are numbers or texts."""
    how, flags = each.metadata, verbs.flag_of(each).split()
    optional = NoneType in get_args(kind)
    kind = get_args(kind)[0] if optional else kind
    repeatable = get_origin(kind) is tuple
    kind = get_args(kind)[0] if repeatable else kind
    read = how.get("read") or _READ.get(kind)
    more: dict[str, Any] = {"type": str}
    if kind is bool:
        more = {"is_flag": True}
        flags = [f"{flags[0]}/--no-{flags[0][2:]}"] if optional else flags
    elif get_origin(kind) is Literal:
        more = {"type": click.Choice(get_args(kind))}
    elif read is not None:
        more = {"type": Parsed(read, how.get("least"))}
    if read in (verbs.values_of, verbs.labels_of):
        more["callback"] = lambda ctx, param, value: tuple(chain.from_iterable(value))
    made = Heading([*flags, each.name], help=how["help"], hidden=hidden, metavar=how.get("metavar"),
                   multiple=repeatable, default=() if repeatable else each.default, show_default=how.get("shown"),
                   required=how.get("required", False), **more)
    made.heading = how["heading"]
    return made
