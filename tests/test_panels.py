"""After which layers ``isocodec plot`` draws: evenly spread, and not before there is something to see."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import ok
from isocodec.api import plots
from isocodec.api.plots import Panels, shown, spread


@pytest.mark.parametrize(
    ("layers", "steps", "chosen"),
    [(9, 5, [1, 3, 5, 7, 9]), (3, 5, [1, 2, 3]), (10, 2, [1, 10]), (7, 1, [7]), (1, 5, [1]), (0, 5, [1])],
)
def test_steps_are_spread_over_the_layers(layers: int, steps: int, chosen: list[int]) -> None:
    assert spread(layers, steps) == chosen


@pytest.mark.parametrize(
    ("kinds", "steps", "chosen"),
    [
        ("base refine refine refine offsets", 3, [1, 3, 5]),
        ("adaptive_base offsets adapt offsets refine refine values values", 5, [2, 4, 8]),
        ("adaptive_base offsets adapt offsets offsets refine values", 2, [2, 7]),
        ("base refine", 5, [1, 2]),
    ],
)
def test_steps_of_a_file_are_those_that_it_was_made_with(kinds: str, steps: int, chosen: list[int]) -> None:
    assert shown(kinds.split(), steps) == chosen


@pytest.mark.parametrize(
    ("kinds", "seen_from", "promised", "drawn"),
    [
        ("base refine refine refine refine refine refine offsets", 1, (), [1, 3, 6, 8]),
        ("base refine refine refine refine refine refine offsets", 4, (), [4, 5, 7, 8]),
        ("base refine refine refine refine refine refine offsets", 7, (), [7, 8]),
        ("base refine refine refine refine refine refine offsets", 9, (), [8]),  # an empty curve
        ("adaptive_base offsets adapt offsets adapt offsets", 3, (), [4, 6]),
        ("base refine refine refine refine refine", 2, (1, 3, 5), [3, 5, 6]),
        ("base refine refine refine refine refine", 4, (1, 3), [4, 5, 6]),
    ],
)
def test_steps_begin_where_there_is_something(
    kinds: str, seen_from: int, promised: Sequence[int], drawn: list[int]
) -> None:
    """By hand."""
    panels = Panels(kinds.split(), 4, promised)
    count = len(kinds.split())
    found = [layer for layer in range(1, count + 1) if panels.draws(layer, lambda layer=layer: layer >= seen_from)]
    assert found == drawn


def drawn_of(data: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *options: object) -> list[plots.Step]:
    """What ``plot`` hands over to be drawn."""
    found: list[plots.Step] = []

    def steps_picture(steps: Sequence[plots.Step], *_: Any) -> bytes:
        found.extend(steps)
        return b"picture"

    monkeypatch.setattr(plots, "steps_picture", steps_picture)
    (tmp_path / "in.iso").write_bytes(data)
    ok("plot", tmp_path / "in.iso", "-o", tmp_path / "out.png", *options)
    return found


def test_no_panel_of_a_surface_is_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thin shell, which coarse meshes miss: the panels are spread over the layers that have met it."""
    radius = np.sqrt(((np.mgrid[:40, :40, :40] - 19.4) ** 2).sum(axis=0))
    data = isocodec.encode(-abs(radius - 11.3), -0.8)
    count = len(isocodec.open(data).info.layers)
    met = [layer for layer in range(1, count + 1) if len(isocodec.decode(data, layers=layer).cells)]
    steps = drawn_of(data, tmp_path, monkeypatch, "--steps", 4)
    assert met[0] > 1 and len(steps) == min(4, len(met))
    sizes = [len(step.contours[0].cells) for step in steps]
    assert min(sizes) > 0
    assert sizes[0] == len(isocodec.decode(data, layers=met[0]).cells)
    assert sizes[-1] == len(isocodec.decode(data).cells)
    assert sorted({step.bytes for step in steps}) == [step.bytes for step in steps]


def test_nothing_but_an_empty_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (step,) = drawn_of(isocodec.encode(np.eye(20), 5), tmp_path, monkeypatch)
    assert not len(step.contours[0].cells)
