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

partial_option: Decorator = click.option("--partial", is_flag=True, help="Of a truncated file, take what was received.")

smooth_option: Decorator = click.option(
    "--smooth",
    is_flag=True,
    help="Points that only the edge is told of: not half-way, but where the contour bends evenly.",
)

json_option: Decorator = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


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
        help=f"Most memory that decoding may take.  [default: {usual.memory >> 20}M]",
    )  # fmt: skip
    work = click.option(
        "--limit-work", type=click.IntRange(min=1), metavar="N",
        help=f"Most time, in symbols, beside what is allowed for each byte.  [default: {usual.work:,}]",
    )  # fmt: skip
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
