"""The command line: ``isocodec encode | decode | edit | info | verify | plot | thin``, a module each.

The modules here load in a few milliseconds; whatever takes longer (numpy, matplotlib) is imported by the command that
needs it, when it needs it.
"""

from __future__ import annotations

import click

from .decode import decode_command
from .edit import edit_command
from .encode import encode_command
from .info import info_command
from .plot import plot_command
from .report import EXIT_CODES, Program
from .thin import thin_command
from .verify import verify_command

__all__ = ["main"]


def _version(context: click.Context, _: click.Parameter, asked: bool) -> None:
    if not asked or context.resilient_parsing:
        return
    from importlib import metadata

    from ..api.selfcheck import kernels

    try:
        version = f"isocodec {metadata.version('isocodec')}"
    except metadata.PackageNotFoundError:
        version = "isocodec, run from its sources (not installed)"
    click.echo(f"{version} (kernels: {kernels()})")
    context.exit()


@click.group("isocodec", cls=Program, epilog=EXIT_CODES, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Show the version.")
def main() -> None:
    """Progressive, exact and small files (.iso) of isocontours and isosurfaces."""


for command in (
    encode_command, decode_command, edit_command, info_command, verify_command, plot_command, thin_command,
):
    main.add_command(command)
