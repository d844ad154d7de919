"""Rows: one file of one codec on one item, as JSON lines; reading, writing and holding them together."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

Row = dict[str, Any]
"""``corpus``, ``isovalue``, ``class`` (group), ``peer``; then ``bytes``, ``enc_s``, ``dec_s``, ``enc_mb``, ``dec_mb``,
``err_mean``, ``err_max`` (cells), ``exact``, ``progressive``, ``note``, or ``missing``: the libraries that are not
installed, or ``failed``: what went wrong."""


def key(row: Row) -> tuple[str, float, str, str]:
    return row["corpus"], row["isovalue"], row["class"], row["peer"]


def item_key(row: Row) -> str:
    """For tables."""
    return f"{row['corpus']}@{row['isovalue']:g}"


def read_rows(path: Path) -> list[Row]:
    """Rows of a file of JSON lines; of two with the same key the later one."""
    found: dict[tuple[str, float, str, str], Row] = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
            found[key(row)] = row
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path}, line {number}: not a row of a bench ({error})") from None
    return list(found.values())


def plain(row: Row) -> Row:
    """Numbers that JSON knows, with as many digits as mean something."""
    out: Row = {}
    for name, value in row.items():
        if isinstance(value, float) and name != "isovalue":
            value = None if not math.isfinite(value) else float(f"{value:.6g}")
        out[name] = value
    return out


class Book:
    """Rows as they come, each written at once to a file, and behind them rows of a reference.

    Parameters
    ----------
    path : Path or None
        Where rows are added; None: nowhere.
    earlier : iterable of Row
        Rows that the file has.
    reference : iterable of Row
        Sizes that are known from elsewhere.
    """

    def __init__(self, path: Path | None, earlier: Iterable[Row] = (), reference: Iterable[Row] = ()) -> None:
        self._path = path
        self._rows = {key(row): row for row in earlier}
        self.reference = {key(row): row for row in reference}

    @property
    def rows(self) -> list[Row]:
        """All measured rows."""
        return list(self._rows.values())

    def add(self, row: Row) -> None:
        row = plain(row)
        self._rows[key(row)] = row
        if self._path:
            with self._path.open("a") as file:
                print(json.dumps(row), file=file)

    def get(self, corpus: str, isovalue: float, group: str, peer: str) -> Row | None:
        """A measured row; that of the reference, marked so, if the peer is missing."""
        row = self._rows.get((corpus, isovalue, group, peer))
        if row is None or "missing" not in row:
            return row
        other = self.reference.get(key(row))
        return None if other is None else {**other, "progressive": row["progressive"], "reference": True}

    def group(self, corpus: str, isovalue: float, group: str) -> list[Row]:
        """Rows with a size of a group's peers, from the reference if a peer is missing."""
        names = [row["peer"] for row in self._rows.values() if key(row)[:3] == (corpus, isovalue, group)]
        rows = [self.get(corpus, isovalue, group, name) for name in names]
        return [row for row in rows if row is not None and "bytes" in row]

    def missing(self) -> dict[str, list[str]]:
        """Libraries that are not installed, and the peers that need them."""
        out: dict[str, set[str]] = {}
        for row in self._rows.values():
            if "missing" in row:
                out.setdefault(row["missing"], set()).add(row["peer"])
        return {name: sorted(peers) for name, peers in sorted(out.items())}
