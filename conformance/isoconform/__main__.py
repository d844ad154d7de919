"""Command line: ``run`` (the default), ``dump`` and ``generate``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from .dump import dump
from .manifest import default_directory, read_manifest
from .decoders import Batch, Command, serve
from .runner import asked, reference, run

COMMANDS = ("run", "dump", "generate")
USAGE_ERROR = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in (*COMMANDS, "-h", "--help"):
        given.insert(0, "run")
    options = _parser().parse_args(given)
    try:
        code: int = options.call(options)
    except (OSError, ValueError) as error:
        print(f"isoconform: {error}", file=sys.stderr)
        return USAGE_ERROR
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("isoconform", description=__doc__)
    commands = parser.add_subparsers(required=True)

    runs = commands.add_parser("run", help="run a decoder over the vectors; exit code 1 if it disagrees anywhere")
    runs.add_argument("--vectors", type=Path, default=default_directory(), metavar="DIR", help="default: %(default)s")
    runs.add_argument(
        "--decoder", metavar="COMMAND",
        help="a command that prints canonical text as dump does, with {file} for the file, {layers} for the number of "
        "layers to decode (0: all) and {python} for this interpreter; default: the reference decoder",
    )  # fmt: skip
    runs.add_argument("--only", action="append", metavar="NAME", help="this vector; may be given several times")
    runs.add_argument("--layers", action="store_true", help="also compare states after each layer")
    runs.add_argument("--json", action="store_true", help="print a JSON object")
    runs.set_defaults(call=_run)

    dumps = commands.add_parser(
        "dump", help="print the decoded state; exit code 0, 5 (cut off), 4 (invalid) or 6 (over the limits)"
    )
    dumps.add_argument("file", type=Path, nargs="?")
    dumps.add_argument("--batch", action="store_true", help="answer requests of the batch protocol on standard input")
    dumps.add_argument("--layers", type=int, default=0, metavar="N", help="decode N layers only; 0, the default: all")
    dumps.set_defaults(call=_dump)

    generates = commands.add_parser("generate", help="write all vectors and their manifest anew")
    generates.add_argument("directory", type=Path)
    generates.set_defaults(call=_generate)
    return parser


def _run(options: argparse.Namespace) -> int:
    vectors = read_manifest(options.vectors)
    if options.only:
        unknown = set(options.only) - {v.name for v in vectors}
        if unknown:
            raise ValueError(f"no vector is called {', '.join(sorted(unknown))}")
        vectors = [v for v in vectors if v.name in options.only]
    decode = asked(Command(options.decoder)) if options.decoder else reference
    if options.layers and options.decoder and "{layers}" not in options.decoder:
        raise ValueError("the command does not say where the number of {layers} goes")
    results = []
    for result in run(vectors, options.vectors, decode, layers=options.layers):
        results.append(result)
        if not options.json:
            print(f"ok    {result.name}" if result.passed else f"FAIL  {result.name}: {result.reason}", flush=True)
    passed = sum(result.passed for result in results)
    failed = len(results) - passed
    if options.json:
        print(json.dumps({"passed": passed, "failed": failed, "vectors": [asdict(r) for r in results]}, indent=1))
    else:
        print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


def _dump(options: argparse.Namespace) -> int:
    if options.batch:
        serve(sys.stdin.buffer, sys.stdout.buffer)
        return 0
    if options.file is None:
        raise ValueError("dump needs a file, or --batch")
    output = dump(options.file.read_bytes(), layers=options.layers)
    if output.error is not None:
        print(f"isoconform: {output.error}", file=sys.stderr)
    sys.stdout.buffer.write(output.text.encode("ascii"))
    return output.exit_code


def _generate(options: argparse.Namespace) -> int:
    from .generate import generate

    vectors = generate(options.directory)
    print(f"{len(vectors)} vectors, {sum(v.bytes for v in vectors)} bytes, in {options.directory}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
