"""Arguments and options that several commands have in common."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

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


def output_option(metavar: str) -> Decorator:
    """``-o``, which every command that writes requires."""
    return click.option(
        "-o", "--output", metavar=metavar, required=True, type=click.Path(path_type=Path), help="File to write."
    )
