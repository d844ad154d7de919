"""Write docs/commands.md: every command with its options, from the command line itself.

    python tools/commands_page.py
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import click

from isocodec.cli import main
from isocodec.cli.parameters import HEADINGS, Grouped
from isocodec.cli.report import EXIT_CODES
from isocodec.verbs import OUTPUT

PAGE = Path(__file__).resolve().parents[1] / "docs" / "commands.md"
WIDTH = 120
_HEAD = """# Command line

<!-- Written by tools/commands_page.py. -->

`isocodec COMMAND --help` shows the same. `-` means standard input or output, and a URL may be given wherever an input
file is read. On success a command prints one line, or one JSON object with `--json`; `info` prints tables, `verify` a
line for each isovalue. If the output itself goes to standard output, the line goes to the error stream.

Words used below: a *level* of the mesh bisects all cells of the level before; the finest level, the *full grid*,
reaches every sample. A *promise* is a bound on the distance from the true curve that a file guarantees and records.
"""


def page() -> str:
    """The page as text."""
    commands = [each for each in main.commands.values() if isinstance(each, Grouped)]
    rows = [f"| [`{each.name}`](#{each.name}) | {each.short_help} |" for each in commands]
    parts = [_HEAD, "| command | |\n| --- | --- |\n" + "\n".join(rows) + "\n"]
    parts += [_command(each) for each in commands]
    codes = EXIT_CODES.removeprefix("\b\n").partition("\n")[2].rpartition("\n")
    parts.append(f"## Exit codes\n\n```text\n{_dedent(codes[0])}\n```\n\n{codes[2]}\n")
    return "\n".join(parts)


def _command(command: Grouped) -> str:
    context = click.Context(command, info_name=command.name, parent=click.Context(main, info_name="isocodec"))
    usage = " ".join(command.collect_usage_pieces(context))
    blocks: dict[str, list[str]] = {}
    for each in command.get_params(context):
        record = each.get_help_record(context)
        if isinstance(each, click.Option) and record is not None and "--help" not in each.opts:
            names, text = (" ".join(part.split()).replace("|", "\\|") for part in record)
            blocks.setdefault(getattr(each, "heading", OUTPUT), []).append(f"| `{names}` | {text} |")
    parts = [f"## {command.name}\n", f"    isocodec {command.name} {usage}\n", _text(command.text())]
    for heading in sorted(blocks, key=HEADINGS.index):
        parts.append(f"| {heading} | |\n| --- | --- |\n" + "\n".join(blocks[heading]) + "\n")
    return "\n".join(parts)


def _text(help_text: str) -> str:
    """Help as Markdown: paragraphs that keep their lines become blocks."""
    out = []
    for paragraph in help_text.split("\n\n"):
        if paragraph.startswith("\b\n"):
            out.append(f"```text\n{paragraph.removeprefix(chr(8) + chr(10))}\n```\n")
        else:
            out.append(textwrap.fill(paragraph, WIDTH, break_long_words=False, break_on_hyphens=False) + "\n")
    return "\n".join(out)


def _dedent(text: str) -> str:
    return "\n".join(line.strip() for line in text.splitlines())


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
