"""Command line: ``run`` (the default), ``dump``, ``explain``, ``fuzz`` and ``generate``."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

from isocodec.limits import TIERS, Limits

from .decoders import TIMEOUT, Batch, Command, Decoder, Reference, serve
from .dump_file import dump_file
from .manifest import Vector, default_directory, read_manifest
from .runner import Result, asked, run

COMMANDS = ("run", "dump", "explain", "fuzz", "generate")
USAGE_ERROR = 2
DECODER = (
    "a command that prints canonical text as dump does, with {file} for the file, {layers} for the number of layers to "
    "decode (0: all), {piece} for the bytes to take at a time (0: all) and {python} for this interpreter; default: the "
    "reference decoder"
)
BATCH = "the command follows the batch protocol: it is run once and takes the names of files on standard input"


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
    runs.add_argument("--decoder", metavar="COMMAND", help=DECODER)
    runs.add_argument("--batch", action="store_true", help=BATCH)
    runs.add_argument("--only", action="append", metavar="NAME", help="this vector; may be given several times")
    runs.add_argument("--layers", action="store_true", help="also compare states after each layer")
    runs.add_argument(
        "--tier", type=int, choices=sorted(TIERS), default=max(TIERS),
        help="tier of conformance that the decoder is to have; default: %(default)s",
    )
    runs.add_argument("--jobs", type=int, default=1, metavar="N", help="processes that decode; default: %(default)s")
    runs.add_argument("--json", action="store_true", help="print a JSON object")
    runs.set_defaults(call=_run)

    dumps = commands.add_parser(
        "dump", help="print the decoded state; exit code 0, 5 (cut off), 4 (invalid) or 6 (over the limits)"
    )
    dumps.add_argument("file", type=Path, nargs="?")
    dumps.add_argument("--layers", type=int, default=0, metavar="N", help="decode N layers only; 0, the default: all")
    dumps.add_argument("--tier", type=int, choices=sorted(TIERS), help="with the limits of a tier of conformance")
    dumps.add_argument("--coordinates", action="store_true", help="print coordinates of a mapped grid, too")
    dumps.add_argument("--batch", action="store_true", help="answer requests of the batch protocol on standard input")
    dumps.set_defaults(call=_dump)

    explains = commands.add_parser(
        "explain", help="print an annotated dump: byte by byte, and symbol by symbol with context and probability"
    )
    explains.add_argument("file", type=Path)
    explains.set_defaults(call=_explain)

    fuzzes = commands.add_parser(
        "fuzz", help="hold a decoder against the reference on files made from the syntax; exit code 1 if it disagrees"
    )
    fuzzes.add_argument("--decoder", metavar="COMMAND", help=DECODER)
    fuzzes.add_argument("--batch", action="store_true", help=BATCH)
    fuzzes.add_argument("--encoder", action="store_true", help="instead, try what holds of our encoder (hypothesis)")
    fuzzes.add_argument("--tiles", action="store_true", help="files in tiles instead of others")
    fuzzes.add_argument("--minutes", type=float, default=1.0, metavar="N", help="default: %(default)s")
    fuzzes.add_argument("--files", type=int, metavar="N", help="end after N cases, whatever the time")
    fuzzes.add_argument("--seed", type=int, default=0, metavar="S", help="another seed gives other files; default: 0")
    fuzzes.add_argument("--out", type=Path, metavar="DIR", help="save findings there, each with an annotated dump")
    fuzzes.add_argument("--most", type=int, default=5, metavar="N", help="end after N sorts of findings; default: 5")
    fuzzes.add_argument(
        "--shrink", type=float, default=30.0, metavar="S", help="seconds that a finding may be shrunk for; %(default)s"
    )
    fuzzes.add_argument("--timeout", type=float, default=TIMEOUT, metavar="S", help="seconds for a file; %(default)s")
    fuzzes.add_argument("--memory", type=int, metavar="MB", help="address space of the decoder's process (POSIX)")
    fuzzes.add_argument("--json", action="store_true", help="print a JSON object")
    fuzzes.set_defaults(call=_fuzz)

    generates = commands.add_parser("generate", help="write all vectors and their manifest anew")
    generates.add_argument("directory", type=Path)
    generates.set_defaults(call=_generate)
    return parser


def _decoder(options: argparse.Namespace, memory: int | None = None, timeout: float | None = None) -> Decoder:
    if options.decoder is None:
        if options.batch:
            raise ValueError("--batch needs a --decoder")
        return Reference()
    return (Batch if options.batch else Command)(options.decoder, memory=memory, timeout=timeout)


def _run(options: argparse.Namespace) -> int:
    vectors = read_manifest(options.vectors)
    if options.only:
        unknown = set(options.only) - {v.name for v in vectors}
        if unknown:
            raise ValueError(f"no vector is called {', '.join(sorted(unknown))}")
        vectors = [v for v in vectors if v.name in options.only]
    if options.layers and options.decoder and not options.batch and "{layers}" not in options.decoder:
        raise ValueError("the command does not say where the number of {layers} goes")
    results = []
    for result in _results(options, vectors) if options.jobs < 2 else _results_of_many(options, vectors):
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


def _results(options: argparse.Namespace, vectors: Sequence[Vector]) -> Iterator[Result]:
    """Run one decoder over vectors."""
    decoder = _decoder(options)
    try:
        yield from run(vectors, options.vectors, asked(decoder), layers=options.layers, tier=options.tier)
    finally:
        decoder.close()


def _listed(options: argparse.Namespace, vectors: Sequence[Vector]) -> list[Result]:
    """Results in a process of its own, which can hand over a list."""
    return list(_results(options, vectors))


def _results_of_many(options: argparse.Namespace, vectors: Sequence[Vector]) -> list[Result]:
    """Run decoders side by side; results in the order of the vectors."""
    parts = [vectors[first :: 8 * options.jobs] for first in range(8 * options.jobs)]
    with ProcessPoolExecutor(options.jobs) as pool:
        found = {result.name: result for part in pool.map(partial(_listed, options), parts) for result in part}
    return [found[vector.name] for vector in vectors]


def _dump(options: argparse.Namespace) -> int:
    if options.batch:
        serve(sys.stdin.buffer, sys.stdout.buffer)
        return 0
    if options.file is None:
        raise ValueError("dump needs a file, or --batch")
    limits = None if options.tier is None else Limits.tier(options.tier)
    output = dump_file(options.file, layers=options.layers, limits=limits)
    if output.error is not None:
        print(f"isoconform: {output.error}", file=sys.stderr)
    text = output.text + output.coordinates if options.coordinates else output.text
    sys.stdout.buffer.write(text.encode("ascii"))
    return output.exit_code


def _explain(options: argparse.Namespace) -> int:
    from .explain import explained
    from .plain import environment, interpreted
    from .tiled_dump import is_tiled
    from .tiled_explain import explained_tiled

    data = options.file.read_bytes()
    if is_tiled(data):
        print("\n".join(explained_tiled(data)))
        return 0
    if not interpreted():
        # kernels that are compiled cannot be listened to
        words = [sys.executable, "-m", "isoconform", "explain", str(options.file)]
        return subprocess.run(words, env=environment(), check=False).returncode
    print("\n".join(explained(data)))
    return 0


def _fuzz(options: argparse.Namespace) -> int:
    if options.encoder:
        return _fuzz_encoder(options)
    from .findings import described, saved
    from .fuzz import Campaign

    decoder = _decoder(options, None if options.memory is None else options.memory << 20, options.timeout)
    campaign = Campaign(
        decoder, seed=options.seed, minutes=options.minutes, files=options.files, most=options.most,
        shrinking=options.shrink, tiles=options.tiles,
    )
    found = []
    try:
        for number, finding in enumerate(campaign.run(), 1):
            place = saved(finding, options.seed, options.out, number) if options.out else None
            found.append(described(finding, place))
            if not options.json:
                print(f"{found[-1]['sort']}: {found[-1]['reason']}\n  {found[-1]['hex']}", flush=True)
    finally:
        campaign.close()
    report = campaign.report
    about = {"files": report.files, "questions": report.questions, "seconds": round(report.seconds, 1),
             "seed": options.seed, "not_asked": sorted(report.unknown), "findings": found}
    if options.json:
        print(json.dumps(about, indent=1))
    else:
        unknown = f", not asked: {', '.join(sorted(report.unknown))}" if report.unknown else ""
        took = f"{report.files} files, {report.questions} answers in {report.seconds:.0f} s"
        print(f"{took}{unknown}: {len(found)} findings")
    return 1 if found else 0


def _fuzz_encoder(options: argparse.Namespace) -> int:
    if options.decoder is not None:
        raise ValueError("--encoder is about our encoder, a --decoder has no part in it")
    try:
        from .properties import try_encoder
    except ImportError as missing:
        raise ValueError("fuzzing the encoder needs hypothesis: pip install '.[dev]'") from missing
    fields = try_encoder(options.minutes, options.seed)
    print(f"{fields} fields, encoded and decoded: no finding")
    return 0


def _generate(options: argparse.Namespace) -> int:
    from .generate import generate

    vectors = generate(options.directory)
    print(f"{len(vectors)} vectors, {sum(v.bytes for v in vectors)} bytes, in {options.directory}")
    return 0
