"""The command line: ``isocodec encode | decode | edit | info | verify | plot | thin | serve | plugins``, a module each.

The modules here load in a few milliseconds; whatever takes longer (numpy, matplotlib) is imported by the command that
needs it, when it needs it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import click

from .report import EXIT_CODES, Program

__all__ = ["main"]


def _version(context: click.Context, _: click.Parameter, asked: bool) -> None:
    if not asked or context.resilient_parsing:
        return
    from .. import __version__
    from ..api.selfcheck import kernels

    click.echo(f"isocodec {__version__} (kernels: {kernels()})")
    context.exit()


class _Commands(Mapping[str, click.Command]):
    """The commands by name; the module of one is imported when the command is asked for."""

    names = ("encode", "decode", "edit", "info", "verify", "plot", "thin", "serve", "plugins")

    def __getitem__(self, name: str) -> click.Command:
        match name:
            case "encode":
                from .encode import encode_command as found
            case "decode":
                from .decode import decode_command as found
            case "edit":
                from .edit import edit_command as found
            case "info":
                from .info import info_command as found
            case "verify":
                from .verify import verify_command as found
            case "plot":
                from .plot import plot_command as found
            case "thin":
                from .thin import thin_command as found
            case "serve":
                from .serve import serve_command as found
            case "plugins":
                from .plugins import plugins_command as found
            case _:
                raise KeyError(name)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


@click.group(
    "isocodec", cls=Program, commands=_Commands(), epilog=EXIT_CODES,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Show the version.")
def main() -> None:
    """Progressive, exact and small files (.iso) of isocontours and isosurfaces."""
