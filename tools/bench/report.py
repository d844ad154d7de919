"""The Markdown report of a bench."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from . import errors
from .compare import Result, against_reference, compare
from .rows import Book, Row, item_key

METHOD = f"""Ratios are bytes of whole files of ours, headers and all, to those of the best real peer of the item, the
smallest of those that are as good. Means over items are geometric; of bits per vertex, arithmetic.
Distances are in cells. Curves are sampled every {errors.STEP[2]:g} cell along their length, surfaces in the middles of
parts of triangles with no edge longer than {errors.STEP[3]:g} cell and at vertices (of large ones {errors.MOST}
samples), and the exact distance of each sample to the other curve or surface is taken, both ways: the mean error is the
larger of both ways' means by length or area, the largest error the largest distance.
Every codec is held against what it was given: peers the lines of contourpy or the surface of scikit-image's
`marching_cubes`, ours what it decodes to without loss. These have the same points and differ in how saddles are joined.
Seconds are ratios of encoding and decoding, ours to the best peer, in one process and one run; MB are the largest peak
memory over the items, of ours / of the best peers. Bytes of a peer marked with \\* come from the reference, since the
peer is not installed; it then counts for bytes alone."""


def markdown(book: Book, left_out: Iterable[str] = (), plots: Iterable[str] = ()) -> str:
    """The whole report."""
    results = compare(book)
    parts = ["# Ours and its peers", METHOD, "## Classes", summary(results), *_missing(book)]
    parts += _listed("Failed", (f"{row['peer']}, {item_key(row)}: {row['failed']}" for row in failed(book)))
    parts += _listed("Left out", left_out)
    for result in results:
        parts += _details(result)
    parts += [*_points(book), *_reference(book), *(f"![{name}]({name})" for name in plots)]
    return "\n\n".join(parts) + "\n"


def summary(results: list[Result]) -> str:
    """The table of ratios, a line for each class."""
    rows = []
    for r in results:
        seconds = [_number(r.seconds(name)) for name in ("enc_s", "dec_s")]
        memory = [_pair(r.megabytes(name)) for name in ("enc_mb", "dec_mb")]
        worst = f"{r.worst.value:.3f} ({r.worst.item})"
        rows.append([r.cls.title, str(len(r.ratios)), f"{r.mean:.3f}", worst, *seconds, *memory])
    heads = ["class", "items", "mean", "worst", "encoding s", "decoding s", "encoding MB", "decoding MB"]
    return _table(heads, rows)


def failed(book: Book) -> list[Row]:
    """Files that could not be made, decoded to something else or do not keep to their error."""
    return [row for row in book.rows if "failed" in row]


def _table(heads: list[str], rows: Iterable[list[str]], left: int = 1) -> str:
    rule = ["---"] * left + ["---:"] * (len(heads) - left)
    return "\n".join("| " + " | ".join(line) + " |" for line in [heads, rule, *rows])


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2g}"


def _pair(values: tuple[float, float] | None) -> str:
    return "" if values is None else f"{values[0]:.0f} / {values[1]:.0f}"


def _missing(book: Book) -> Iterator[str]:
    yield "## Missing peers"
    lines = [f"- {name} is not installed: {', '.join(peers)}" for name, peers in book.missing().items()]
    yield "\n".join(lines) or "None."


def _listed(title: str, lines: Iterable[str]) -> Iterator[str]:
    items = [f"- {line}" for line in lines]
    if items:
        yield f"## {title}"
        yield "\n".join(items)


def _details(result: Result) -> Iterator[str]:
    yield f"## {result.cls.title[0].upper()}{result.cls.title[1:]}"
    rows: list[list[str]] = []
    if result.cls.key == "connectivity":
        for r in result.ratios:
            rows.append([r.item, str(r.ours["bytes"]), str(r.ours["vertices"]), f"{r.value:.3f}"])
        yield _table(["item", "bytes", "vertices", "bits / vertex"], rows)
        return
    for r in result.ratios:
        assert r.peer is not None
        peer = r.peer["peer"] + ("\\*" if r.peer.get("reference") else "")
        sizes = [r.item, str(r.ours["bytes"]), _error(r.ours), peer, str(r.peer["bytes"]), _error(r.peer)]
        rows.append([*sizes, f"{r.value:.3f}", r.ours.get("note", "")])
    yield _table(["item", "ours", "mean / largest", "best peer", "its bytes", "mean / largest", "ratio", "how"], rows)


def _error(row: Row) -> str:
    return "" if row.get("err_mean") is None else f"{row['err_mean']:.4f} / {row['err_max']:.3f}"


def _points(book: Book) -> Iterator[str]:
    """The points of ours against those of the peers."""
    gaps = [(r["gap"], item_key(r)) for r in book.rows if "gap" in r]
    if gaps:
        worst, item = max(gaps)
        yield f"Our extracted points against those of the peers: at most {worst:.1e} cells ({item}; {len(gaps)} items)."


def _reference(book: Book) -> Iterator[str]:
    found = against_reference(book)
    if found:
        yield "## Peers' sizes here and in the reference"
        rows = []
        for a in found:
            error = "" if a.error is None else f"{a.error:.3f}"
            rows.append([a.peer, a.group, str(a.items), f"{a.size:.4f}", f"{a.farthest:.4f} ({a.item})", error])
        yield "Here over reference, geometric means."
        yield _table(["peer", "group", "items", "bytes", "farthest", "mean error"], rows, left=2)
