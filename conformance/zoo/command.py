"""The command line of the zoo."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .check import TABLE, check_all, search, table
from .misreadings import RottenError, by_name, environment, load, plant

COMMANDS = ("check", "plant", "decoder", "search", "table")
USAGE_ERROR = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in (*COMMANDS, "-h", "--help"):
        given.insert(0, "check")
    options = _parser().parse_args(given)
    try:
        code: int = options.call(options)
    except (OSError, RottenError) as error:
        print(f"zoo: {error}", file=sys.stderr)
        return USAGE_ERROR
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("zoo", description="Wrong decoders, planted in copies of our own.")
    commands = parser.add_subparsers(required=True)
    checks = commands.add_parser("check", help="are they caught by their vectors? exit code 1 if one is not")
    checks.add_argument("--only", action="append", default=[], metavar="NAME", help="this one; several times for more")
    checks.add_argument("--jobs", type=int, default=2, metavar="N", help="decoders at a time; default: %(default)s")
    checks.add_argument("--list", action="store_true", help="only say what there is")
    checks.set_defaults(call=_check)
    plants = commands.add_parser("plant", help="write a wrong decoder: packages to import, plain Python")
    plants.add_argument("name")
    plants.add_argument("directory", type=Path)
    plants.set_defaults(call=_plant)
    decoders = commands.add_parser("decoder", help="run a wrong decoder as isoconform dump is run")
    decoders.add_argument("name")
    decoders.add_argument("arguments", nargs=argparse.REMAINDER, help="those of isoconform dump")
    decoders.set_defaults(call=_decoder)
    searches = commands.add_parser("search", help="run a wrong decoder over all vectors; print those that catch it")
    searches.add_argument("name")
    searches.set_defaults(call=_search)
    tables = commands.add_parser("table", help=f"write {TABLE.name} anew")
    tables.set_defaults(call=_table)
    return parser


def _check(options: argparse.Namespace) -> int:
    chosen = by_name(load(), options.only)
    if options.list:
        for m in chosen:
            print(f"{m.name:40} {m.clause:12} {m.says} ({m.vector})")
        return 0
    missed = 0
    for finding in check_all(chosen, options.jobs):
        missed += not finding.caught
        word = "caught" if finding.caught else "MISSED"
        print(f"{word}  {finding.misreading.name}, {finding.misreading.vector}: {finding.reason}", flush=True)
    print(f"{len(chosen) - missed} caught, {missed} missed")
    return 1 if missed else 0


def _plant(options: argparse.Namespace) -> int:
    (misreading,) = by_name(load(), [options.name])
    plant(misreading, options.directory)
    return 0


def _decoder(options: argparse.Namespace) -> int:
    (misreading,) = by_name(load(), [options.name])
    with tempfile.TemporaryDirectory(prefix="zoo-") as name:
        plant(misreading, Path(name))
        command = [sys.executable, "-m", "isoconform", "dump", *options.arguments]
        # the names of files are relative to where the command was given
        return subprocess.run(command, env=environment(Path(name), misreading), check=False).returncode


def _search(options: argparse.Namespace) -> int:
    (misreading,) = by_name(load(), [options.name])
    for vector in search(misreading):
        print(vector, flush=True)
    return 0


def _table(options: argparse.Namespace) -> int:
    TABLE.write_text(table(), encoding="utf-8")
    return 0
