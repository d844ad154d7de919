"""The command line."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import isocodec
from isocodec.grid.lattice.tables import cube_exponent

from .classes import BY_KEY, CLASSES, LARGEST
from .compare import compare
from .items import Item, read_items, wanted
from .ours import Ours
from .plots import plot
from .record import Recorder
from .report import failed, markdown, summary
from .rows import Book, read_rows
from .run import run_item

RESULTS, REPORT = "results.jsonl", "report.md"


def parser() -> argparse.ArgumentParser:
    keys = "\n".join(f"  {c.key:22} {c.title}" for c in CLASSES)
    out = argparse.ArgumentParser(
        prog="python tools/bench", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Ours and what a user would pick instead, on a folder of arrays (.npy, or `values` in .npz),\n"
        "each at the `isovalues` of its sidecar NAME.json (integers: floor + 0.5), or in the middle of its range.",
        epilog=f"classes:\n{keys}\n\nPeers: pip install '.[bench]', and jbigkit's shared library (Debian: "
        "libjbig0).",
    )
    out.add_argument("folder", type=Path, help="folder of arrays, searched to the bottom")
    out.add_argument("-o", "--output", type=Path, required=True, metavar="OUT",
                     help=f"folder for {RESULTS}, {REPORT} and plots")
    out.add_argument("--classes", metavar="KEY,..", default=",".join(BY_KEY), help="classes to measure, otherwise all")
    out.add_argument("--items", metavar="NAME[@ISOVALUE],..",
                     help="arrays by name, path or wildcards; otherwise those of --peers, or all")
    out.add_argument("--peers", type=Path, metavar="FILE",
                     help="JSON lines of peers' sizes, to check against and in place of missing peers")
    out.add_argument("--profile", help="profile of our files; that of the encoder if not given")
    out.add_argument("--cut-surfaces", action="store_true", help="try cut files of surfaces: smaller, slower to make")
    out.add_argument("--repeat", type=int, default=3, metavar="N", help="runs of which the shortest counts (3)")
    out.add_argument("--add", action="store_true", help="keep the rows that OUT has and add to them")
    out.add_argument("--report-only", action="store_true", help="measure nothing, write the report of OUT's rows anew")
    out.add_argument("--no-plots", action="store_true")
    return out


def main(arguments: Sequence[str] | None = None) -> int:
    """Run; 0, or 2 if what was asked for cannot be done."""
    try:
        return run(parser().parse_args(arguments))
    except (OSError, ValueError, isocodec.errors.OptionError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2


def run(chosen: argparse.Namespace) -> int:
    """Measure what is chosen and write the report."""
    if not chosen.folder.is_dir():
        raise ValueError(f"{chosen.folder} is not a folder")
    if chosen.repeat < 1:
        raise ValueError(f"--repeat {chosen.repeat}: needed is at least 1")
    reference = read_rows(chosen.peers) if chosen.peers else []
    chosen.output.mkdir(parents=True, exist_ok=True)
    path = chosen.output / RESULTS
    if not (chosen.add or chosen.report_only):
        path.unlink(missing_ok=True)
    book = Book(path, read_rows(path) if path.exists() else (), reference)
    left_out: list[str] = []
    if not chosen.report_only:
        items, left_out = pick(chosen, reference)
        if not items:
            raise ValueError("\n  ".join([f"no array in {chosen.folder} fits", *left_out]))
        measure(chosen, items, book)
    write(book, chosen.output, left_out, not chosen.no_plots)
    return 0


def pick(chosen: argparse.Namespace, reference: list[dict[str, Any]]) -> tuple[list[Item], list[str]]:
    """The items to measure, and what is left out."""
    pairs = [wanted(text) for text in chosen.items.split(",")] if chosen.items else []
    return read_items(chosen.folder, pairs or sorted({(row["corpus"], row["isovalue"]) for row in reference}))


def measure(chosen: argparse.Namespace, items: list[Item], book: Book) -> None:
    """All items, one after the other."""
    keys = chosen.classes.split(",")
    unknown = [key for key in keys if key not in BY_KEY]
    if unknown:
        raise ValueError(f"no class {', '.join(unknown)}; there are {', '.join(BY_KEY)}")
    options = {"profile": chosen.profile} if chosen.profile else {}
    warm_up(options)
    for item in items:
        started = time.perf_counter()
        run_item(item, keys, Ours(item, options, chosen.cut_surfaces), Recorder(book, item, chosen.repeat))
        print(f"{item.key}: {time.perf_counter() - started:.1f} s", file=sys.stderr, flush=True)


def warm_up(options: dict[str, Any]) -> None:
    """Load all of our kernels, so that no measurement does; balls that are larger than the mesh of a base."""
    for n in (2, 3):
        ball = np.hypot.reduce(np.mgrid[(slice(-10, 11),) * n])
        level = n * cube_exponent(ball.shape)
        for more in ({"precision": LARGEST}, {"precision": "step=0.5"}, {"precision": "signs"}, {"layers": level}):
            isocodec.decode(isocodec.encode(ball, 7.3, **options, **more))


def write(book: Book, folder: Path, left_out: list[str], plots: bool) -> None:
    """Report and plots; the table of ratios, and which peers are missing or failed, go to the terminal too."""
    names = plot(book, folder) if plots else []
    (folder / REPORT).write_text(markdown(book, left_out, names))
    print(summary(compare(book)))
    for name, peers in book.missing().items():
        print(f"missing: {name}: {', '.join(peers)}", file=sys.stderr)
    if failed(book):
        print(f"{len(failed(book))} files failed, see {folder / REPORT}", file=sys.stderr)
