"""Memory of decoding and drawing: what is counted against the limit, and what is freed."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from isocodec import Decoder, encode
from isocodec.drawing import clipping
from isocodec.drawing.clipping import clipped
from isocodec.drawing.snapshot import drawing_bytes
from isocodec.errors import LimitError
from isocodec.grid.tube.capacity import state_bytes
from isocodec.limits import Budget

SMOOTH, NOISE, CHECKER = "smooth", "noise", "checker"
SPARE = 200_000
"""Bytes that a small drawing takes whatever it draws: tables, objects of Python."""


def field(n: int, kind: str) -> NDArray[np.int16]:
    if kind == NOISE:
        return np.random.default_rng(n).integers(-999, 999, (150, 140) if n == 2 else (26, 24, 25)).astype(np.int16)
    if kind == CHECKER:
        # points in the middle of all cells (n = 3)
        return np.asarray(np.indices((150, 140) if n == 2 else (26, 24, 25)).sum(axis=0) % 2 * 10 - 5, np.int16)
    axes = np.meshgrid(*[np.linspace(0, 6, s) for s in ((300, 280) if n == 2 else (40, 44, 42))], indexing="ij")
    return np.asarray(np.round(500 * sum(np.sin(2 * x + i) for i, x in enumerate(axes))), np.int16)


@contextmanager
def accounted(decoder: Decoder, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """What is asked for and what is taken while something is drawn."""
    found = SimpleNamespace(asked=0, peak=0)
    check = decoder.budget.check

    def noted(passing: int) -> None:
        found.asked = max(found.asked, passing)
        check(passing)

    monkeypatch.setattr(decoder.budget, "check", noted)
    tracemalloc.start()
    try:
        yield found
        found.peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.cover(2)
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("precision", ["signs", None, "exact"])
@pytest.mark.parametrize("kind", [SMOOTH, NOISE, CHECKER])
@pytest.mark.parametrize("n", [2, 3])
def test_drawing_takes_at_most_what_is_counted(
    n: int, kind: str, precision: str | None, smooth: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And that is not far from what it takes: files that could be drawn are not refused."""
    decoder = Decoder()
    decoder.feed(encode(field(n, kind), 0.5, profile="baseline", precision=precision))
    tube = decoder.take().grid.tubes[0]
    assert tube is not None and tube.full
    decoder.contour(smooth=smooth)
    with accounted(decoder, monkeypatch) as found:
        contour = decoder.contour(smooth=smooth)
    assert found.peak <= found.asked + SPARE
    assert found.asked <= 2.5 * found.peak
    assert smooth or found.asked == drawing_bytes(tube)
    assert contour.points.nbytes + contour.cells.nbytes <= found.peak


@pytest.mark.parametrize("n", [2, 3])
def test_a_complete_file_holds_no_more_than_drawing_needs(n: int) -> None:
    data = encode(field(n, SMOOTH), 0.5)
    decoder = Decoder()
    decoder.feed(data[:-1])
    decoder.take()
    before = decoder.memory
    decoder.feed(data[-1:])
    tube = decoder.take().grid.tubes[0]
    assert decoder.complete and tube is not None
    st = tube.state
    assert len(st.vertex) == tube.vertices and len(st.leaf) == st.counters.leaves
    assert not st.below.size and not st.active.size and not tube.estimates._beside.around.size
    assert decoder.memory < 0.6 * before
    assert decoder.memory >= state_bytes(st, tube._mark)


def test_one_piece_in_very_many_cells_is_refused() -> None:
    """A piece of a coarse mesh in the largest box would be cut into some 2**40."""
    budget, size = Budget(1 << 28), 1 << 20
    corners = np.array([[0.5, 0.5, 0.5], [size - 2.5, 0.5, 7.5], [0.5, size - 2.5, 9.5]])
    with pytest.raises(LimitError, match="memory"):
        clipped(corners, np.array([[0, 1, 2]]), (size,) * 3, lambda low: np.ones(len(low), np.bool_), budget.check)


@pytest.mark.parametrize("n", [2, 3])
def test_cells_are_cut_some_at_a_time(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever portions, the same is left."""
    rng = np.random.default_rng(1)
    points, cells = rng.uniform(0, 9, (40, n)), rng.permutation(40)[: 39 // n * n].reshape(-1, n)

    def left() -> list[list[float]]:
        out = clipped(points, cells, (10,) * n, lambda low: low.sum(axis=1) % 5 != 0, lambda size: None)
        return sorted(np.round(out.points[out.cells], 9).reshape(-1, n * n).tolist())

    at_once = left()
    monkeypatch.setattr(clipping, "_TOGETHER", 4)
    assert left() == at_once and len(at_once) > len(cells)
