"""One codec on one item: what it takes and how far it is off, as a row."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

import isocodec

from .items import Item
from .measure import Codec, took
from .ours import File
from .rows import Book, Row

SEARCH = 10
"""Steps of the search for a lossy picture's or volume's setting."""

Check = Callable[[Any], Row]
"""From what a peer decoded to ``exact``, or ``err_mean`` and ``err_max``."""


class Recorder:
    """Adds rows of one item to a book.

    Parameters
    ----------
    book : Book
    item : Item
    repeat : int
        Runs of which the shortest counts.
    """

    def __init__(self, book: Book, item: Item, repeat: int) -> None:
        self._book = book
        self._item = item
        self._repeat = repeat

    def add(self, group: str, name: str, **more: Any) -> Row:
        """A row as it is."""
        row = {"corpus": self._item.name, "isovalue": self._item.isovalue, "class": group, "peer": name, **more}
        self._book.add(row)
        return row

    def get(self, group: str, name: str) -> Row | None:
        """A row of this item, or of the reference if the peer is missing."""
        return self._book.get(self._item.name, self._item.isovalue, group, name)

    def say(self, text: str) -> None:
        print(f"{self._item.key}: {text}", file=sys.stderr, flush=True)

    # ---- Peers ----

    def peer(self, group: str, codec: Codec, check: Check) -> None:
        """Encode, decode and check; a peer that is not installed or fails is told so in its row."""
        known: Row = {"progressive": codec.progressive, "note": codec.note}
        if codec.lacks:
            self.add(group, codec.name, missing=" ".join(codec.lacks), **known)
            return
        try:
            data, enc = took(codec.encode, self._repeat)
            read, dec = took(functools.partial(codec.decode, data), self._repeat)
            found = check(read)
        except Exception as error:  # of any library, of any kind
            self._fail(group, codec.name, f"{type(error).__name__}: {error}")
            return
        if found.get("exact") is False:
            self._fail(group, codec.name, "decoded to something else")
            return
        self.add(
            group, codec.name, bytes=len(data), enc_s=enc.seconds, dec_s=dec.seconds, enc_mb=enc.megabytes,
            dec_mb=dec.megabytes, **found, **known,
        )

    def lossy(self, group: str, make: Callable[[float], Codec], check: Check, target: float) -> None:
        """The smallest file with a mean error within the target, by bisection of a setting from 0 (best) to 1."""
        name = make(0).name
        if make(0).lacks:
            self.peer(group, make(0), check)
            return
        best: tuple[int, Codec] | None = None
        low, high = 0.0, 1.0
        for step in range(SEARCH):
            setting = (low + high) / 2
            trial = make(setting)
            try:
                data = trial.encode()
                found = check(trial.decode(data))
            except Exception as error:  # of any library, of any kind
                self._fail(group, name, f"{trial.note}: {type(error).__name__}: {error}")
                return
            self.add(group, f"{name}, step {step}", bytes=len(data), search=True, note=trial.note, **found)
            good = found["err_mean"] <= target
            if good and (best is None or len(data) < best[0]):
                best = (len(data), trial)
            low, high = (setting, high) if good else (low, setting)
        if best is None:
            self._fail(group, name, f"no setting keeps to a mean error of {target:g}")
        else:
            self.peer(group, best[1], check)

    def _fail(self, group: str, name: str, reason: str) -> None:
        self.add(group, name, failed=reason)
        self.say(f"{name} failed: {reason}")

    # ---- Ours ----

    def ours(
        self, name: str, make: Callable[[], bytes], crossings: Any = None, smooth: bool = False, **more: Any
    ) -> None:
        """Encode and decode; ``crossings`` are the points that the curve must have, in any order."""
        data, enc = took(make, self._repeat)
        contour, dec = took(lambda: isocodec.decode(data, smooth=smooth), self._repeat)
        if crossings is not None and not np.array_equal(crossings, on_grid(contour.points)):
            self._fail("ours", name, "decoded to something else")
            return
        self.add(
            "ours", name, bytes=len(data), enc_s=enc.seconds, dec_s=dec.seconds, enc_mb=enc.megabytes,
            dec_mb=dec.megabytes, **more,
        )

    def file(self, name: str, file: File | None) -> None:
        """Seconds and memory of a file that a search has found."""
        if file is None:
            self._fail("ours", name, "no file keeps to the error")
            return
        self.ours(name, file.make, smooth=file.smooth, err_mean=file.err_mean, err_max=file.err_max, note=file.how)


def on_grid(points: Any) -> Any:
    """The points (K, n) that lie on grid edges, sorted."""
    chosen = points[(points != np.round(points)).sum(axis=1) == 1]
    return chosen[np.lexsort(chosen.T)]


def half_way(mask: Any) -> Any:
    """Middles (K, n) of the grid edges between samples of which one lies above, sorted."""
    parts = []
    for axis in range(mask.ndim):
        places = np.argwhere(np.diff(mask, axis=axis)).astype(float)
        places[:, axis] += 0.5
        parts.append(places)
    points = np.concatenate(parts)
    return points[np.lexsort(points.T)]
