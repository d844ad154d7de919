"""From rows to ratios: ours to the best peer of each class, on each item and on average."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field

from .classes import CLASSES, Class
from .rows import Book, Row, item_key, key

SAME = 1e-5
"""Part by which errors may differ and count as equal: the rounding of rows."""
LEAST = 1e-5
"""Smallest mean error in cells that is held against a reference."""


@dataclass(frozen=True)
class Ratio:
    """One item of a class; without a peer ``value`` stands alone."""

    item: str
    ours: Row
    peer: Row | None
    value: float


@dataclass
class Result:
    """One class over its items."""

    cls: Class
    ratios: list[Ratio] = field(default_factory=list)

    @property
    def mean(self) -> float:
        """Geometric mean; arithmetic for bits per vertex."""
        values = [r.value for r in self.ratios]
        return statistics.fmean(values) if self.cls.key == "connectivity" else geometric(values)

    @property
    def worst(self) -> Ratio:
        return max(self.ratios, key=lambda r: r.value)

    def seconds(self, name: str) -> float | None:
        """Geometric mean of our ``enc_s`` or ``dec_s`` to the peer's, where both were measured."""
        pairs = self._measured(name)
        return geometric([a / b for a, b in pairs]) if pairs else None

    def megabytes(self, name: str) -> tuple[float, float] | None:
        """Largest ``enc_mb`` or ``dec_mb`` of ours and of the peers, where both were measured."""
        pairs = self._measured(name)
        return (max(a for a, _ in pairs), max(b for _, b in pairs)) if pairs else None

    def _measured(self, name: str) -> list[tuple[float, float]]:
        """Ours and the peer's."""
        pairs = [(r.ours, r.peer) for r in self.ratios if r.peer is not None and not r.peer.get("reference")]
        return [(a[name], b[name]) for a, b in pairs if a[name] is not None]


def geometric(values: Sequence[float]) -> float:
    """Geometric mean of positive numbers."""
    return math.exp(statistics.fmean(math.log(v) for v in values))


def compare(book: Book) -> list[Result]:
    """Every class of which there are rows of ours and of a peer."""
    results = []
    for cls in CLASSES:
        rows = [row for row in book.rows if row["class"] == "ours" and row["peer"] == cls.ours and "bytes" in row]
        ratios = [ratio for ratio in (_ratio(book, cls, row) for row in rows) if ratio is not None]
        if ratios:
            results.append(Result(cls, sorted(ratios, key=lambda r: r.item)))
    return results


def _ratio(book: Book, cls: Class, row: Row) -> Ratio | None:
    if cls.key == "connectivity":
        return Ratio(item_key(row), row, None, 8 * row["bytes"] / row["vertices"])
    if cls.key == "progressive":
        peer = book.get(row["corpus"], row["isovalue"], "ours", "ours-single")
    else:
        peer = best_peer(book, cls, row)
    if peer is None or "bytes" not in peer:
        return None
    return Ratio(item_key(row), row, peer, row["bytes"] / peer["bytes"])


def best_peer(book: Book, cls: Class, row: Row) -> Row | None:
    """The smallest file of a peer that is as good as the class asks for."""
    peers = [p for p in book.group(row["corpus"], row["isovalue"], cls.group) if not p.get("search")]
    named = next((p for p in peers if p["peer"] == cls.named), None)
    if cls.alone:
        return named
    if cls.progressive:
        peers = [p for p in peers if p.get("progressive")]
    if cls.bound:
        limit = cls.limit if not cls.named else named[cls.bound] if named else None
        if limit is None:
            return None
        most = limit * (1 + SAME)
        peers = [p for p in peers if p.get(cls.bound) is not None and p[cls.bound] <= most]
    return min(peers, key=lambda p: p["bytes"], default=None)


@dataclass(frozen=True)
class Agreement:
    """Sizes and mean errors of a peer measured here, over those of the reference."""

    group: str
    peer: str
    items: int
    size: float
    error: float | None
    farthest: float
    item: str


def against_reference(book: Book) -> list[Agreement]:
    """Every peer that was measured here and is in the reference; geometric means."""
    found: dict[tuple[str, str], list[tuple[Row, Row]]] = {}
    for row in book.rows:
        other = book.reference.get(key(row))
        if other is not None and "bytes" in row and "bytes" in other:
            found.setdefault((row["class"], row["peer"]), []).append((row, other))
    out = []
    for (group, peer), pairs in sorted(found.items()):
        sizes = [row["bytes"] / other["bytes"] for row, other in pairs]
        errors = [
            row["err_mean"] / other["err_mean"]
            for row, other in pairs
            if (row.get("err_mean") or 0) > LEAST and (other.get("err_mean") or 0) > LEAST
        ]
        far = max(range(len(sizes)), key=lambda i: abs(math.log(sizes[i])))
        error = geometric(errors) if errors else None
        out.append(Agreement(group, peer, len(pairs), geometric(sizes), error, sizes[far], item_key(pairs[far][0])))
    return out
