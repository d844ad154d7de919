"""Arguments and options that several commands have in common."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..limits import Limits

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

# Whether files can be read is not asked here: a missing file is an error of input (3), not of usage (2).
iso_argument: Decorator = click.argument("source", metavar="IN.iso", type=click.Path(path_type=Path, readable=False))

partial_option: Decorator = click.option("--partial", is_flag=True, help="Decode what there is of a truncated file.")

domain_option: Decorator = click.option(
    "--domain",
    type=click.Path(path_type=Path, readable=False),
    metavar="MESH",
    help="File with the mesh, if IN.iso holds values on one that it does not hold.",
)

frame_option: Decorator = click.option(
    "--frame", type=click.IntRange(min=0), metavar="N", help="Frame of a series, from 0.  [default: the first]"
)

smooth_option: Decorator = click.option(
    "--smooth",
    is_flag=True,
    help="Where only signs are known, place points for a smooth contour, not half-way.",
)

json_option: Decorator = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


class Grouped(click.Command):
    """A command whose help shows its options under headings, in columns of the same width."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One block for each heading; `--help` goes to the last."""
        blocks: dict[str, list[tuple[str, str]]] = {}
        heading = "Options"
        for option in self.get_params(ctx):
            record = option.get_help_record(ctx)
            if isinstance(option, click.Option) and record is not None:
                heading = getattr(option, "heading", heading)
                blocks.setdefault(heading, []).append(record)
        width = max(len(record[0]) for block in blocks.values() for record in block)
        for heading, block in blocks.items():
            formatter.write(f"\n{heading}:\n")
            with formatter.indentation():
                formatter.write_dl([(names.ljust(width), text) for names, text in block])


def section(heading: str, *options: Decorator) -> Decorator:
    """Several options of a `Grouped` command, under a heading of its help."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
            command.__click_params__[-1].heading = heading  # type: ignore[attr-defined]
        return command

    return decorate


class Isovalue(click.ParamType):
    """A number; whole ones stay whole, so that the encoder notices those that would be rounded."""

    name = "float"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | float:
        try:
            return int(value)
        except ValueError:
            number: float = click.FLOAT.convert(value, param, ctx)
            return number


class Size(click.ParamType):
    """A number of bytes: 500M, 4G, 1.5GiB."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        found = _SIZE.fullmatch(str(value).strip())
        if found is None or not math.isfinite(float(found[1])):
            self.fail(f"{value!r} is not a size such as 500M or 4G", param, ctx)
        return int(float(found[1]) * 1024 ** " KMGT".index((found[2] or " ").upper()))


_SIZE = re.compile(r"([0-9]+(?:\.[0-9]*)?)([KMGTkmgt]?)(?:i?[Bb])?")


def limit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """``--limit-memory`` and ``--limit-work``, of every command that decodes."""
    usual = Limits()
    memory = click.option(
        "--limit-memory", type=Size(), metavar="SIZE",
        help=f"Most memory for decoding.  [default: {usual.memory >> 20}M]",
    )
    work = click.option(
        "--limit-work", type=click.IntRange(min=1), metavar="N",
        help=f"Most work, in symbols, besides an allowance for each byte.  [default: {usual.work:,}]",
    )
    return memory(work(command))


def limits_of(memory: int | None, work: int | None, samples: int | None = None) -> Limits:
    """Limits as the options say."""
    given = {"memory": memory, "work": work, "samples": samples}
    return replace(Limits(), **{name: value for name, value in given.items() if value is not None})


def output_option(metavar: str) -> Decorator:
    """``-o``, which every command that writes requires."""
    return click.option(
        "-o", "--output", metavar=metavar, required=True, type=click.Path(path_type=Path), help="File to write."
    )
