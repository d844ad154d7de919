"""Memory of decoding and drawing: what is counted against the limit, and what is freed."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from isocodec import Decoder, Limits, encode
from isocodec.drawing.snapshot import drawing_bytes
from isocodec.errors import LimitError
from isocodec.grid.tube.capacity import state_bytes

SMOOTH, NOISE = "smooth", "noise"
SPARE = 200_000
"""Bytes that a small drawing takes whatever it draws: tables, objects of Python."""


def field(n: int, kind: str) -> NDArray[np.int16]:
    if kind == NOISE:
        return np.random.default_rng(n).integers(-999, 999, (150, 140) if n == 2 else (26, 24, 25)).astype(np.int16)
    axes = np.meshgrid(*[np.linspace(0, 6, s) for s in ((300, 280) if n == 2 else (40, 44, 42))], indexing="ij")
    return np.asarray(np.round(500 * sum(np.sin(2 * x + i) for i, x in enumerate(axes))), np.int16)


@pytest.mark.parametrize("precision", ["signs", None, "exact"])
@pytest.mark.parametrize("kind", [SMOOTH, NOISE])
@pytest.mark.parametrize("n", [2, 3])
def test_drawing_takes_at_most_what_is_counted(n: int, kind: str, precision: str | None) -> None:
    """And that is not far from what it takes: files that could be drawn are not refused."""
    decoder = Decoder()
    decoder.feed(encode(field(n, kind), 0.5, profile="baseline", precision=precision))
    tube = decoder.take().grid.tubes[0]
    assert tube is not None and tube.full
    decoder.contour()
    counted = drawing_bytes(tube)
    tracemalloc.start()
    try:
        contour = decoder.contour()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= counted + SPARE
    assert counted <= 2.5 * peak
    assert contour.points.nbytes + contour.cells.nbytes <= peak


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


def test_limits_of_drawing_hold() -> None:
    data = encode(field(3, NOISE), 0.5)
    whole = Decoder()
    whole.feed(data)
    needed = whole.take().memory + drawing_bytes(whole.grid.tubes[0])
    most = max(whole.budget.peak, needed)
    enough = Decoder(Limits(memory=most))
    enough.feed(data)
    assert len(enough.take().contour().cells)
    if needed > whole.budget.peak:
        short = Decoder(Limits(memory=needed - 1))
        short.feed(data)
        with pytest.raises(LimitError):
            short.take().contour()
