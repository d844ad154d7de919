"""Place labels along contour lines where these are straight and isolated, and break the lines under them.

All coordinates are on the page, in points of 1/72 inch, with y upwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass

Points = NDArray[np.float64]

_CELL = 2.0
"""Side of the cells in which the density of lines is measured."""
_APART = 200.0
"""Least distance between labels along one line; a third of it, in a straight line, between lines of one isovalue."""
_ROOM = 2.0
"""Least distance between a label and the ends of its line."""
_BENT = 1.5
"""Largest deviation of a line from straight under its label."""
_CROWDED = 5.0
"""Length of other lines that a label may hide, as a multiple of the label's length."""


@dataclass(frozen=True)
class Label:
    """A text, the middle of its position, and its angle in degrees, -90 to 90."""

    text: str
    at: Points
    angle: float


@dataclass
class Page:
    """Occupied places on a page.

    Attributes
    ----------
    shut : (rows, columns) bool
        Cells that labels must not cover; the grid of cells begins at the lower left corner of the page.
    crowd : (rows, columns) float64
        Total length of lines in each cell.
    """

    shut: NDArray[np.bool_]
    crowd: Points = field(init=False)

    def __post_init__(self) -> None:
        self.crowd = np.zeros(self.shut.shape)

    def cells(self, points: Points) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Row and column of points (.., 2), and whether they lie on the page."""
        column, row = np.moveaxis(np.floor(points / _CELL).astype(np.int64), -1, 0)
        rows, columns = self.shut.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1), inside

    def add(self, line: Points) -> None:
        """Add a line to the density."""
        even, step = _even(line)
        row, column, inside = self.cells(even)
        np.add.at(self.crowd, (row[inside], column[inside]), step)

    def free(self, boxes: Points) -> NDArray[np.bool_]:
        """Whether labels may cover all the points in boxes, (B, K, 2)."""
        row, column, inside = self.cells(boxes)
        return np.asarray((inside & ~self.shut[row, column]).all(axis=1))

    def hidden(self, boxes: Points, area: float) -> Points:
        """Total length of lines in each box of this area."""
        row, column, _ = self.cells(boxes)
        return np.asarray(self.crowd[row, column].mean(axis=1) * (area / _CELL**2))

    def shut_box(self, box: Points) -> None:
        """Mark a place as occupied."""
        row, column, inside = self.cells(box)
        self.shut[row[inside], column[inside]] = True


def page_of(width: float, height: float) -> Page:
    """Make an empty page, whose border no label may touch."""
    shut = np.ones((int(np.ceil(height / _CELL)), int(np.ceil(width / _CELL))), np.bool_)
    shut[1:-1, 1:-1] = False
    return Page(shut)


def label_lines(
    page: Page, lines: Sequence[tuple[Points, str]], widths: dict[str, float], height: float
) -> tuple[list[Label], list[Points]]:
    """Choose the positions of labels, beginning with the longest line.

    Parameters
    ----------
    page : Page
        A page to which all lines have been added.
    lines : sequence of ((K, 2) float64, str)
        Lines with their texts.
    widths : mapping of str to float
        Widths of the texts.
    height : float
        Height of the texts.

    Returns
    -------
    list of Label
    list of (K, 2) float64
        The lines without the parts under labels.
    """
    labels: list[Label] = []
    pieces: list[Points] = []
    for line, text in sorted(lines, key=lambda one: -_length(one[0])):
        width = widths[text]
        chosen = _along(page, line, width, height, [one.at for one in labels if one.text == text])
        labels += [Label(text, at, angle) for _, at, angle in chosen]
        pieces += _cut(line, [(start, start + width + 2 * _ROOM) for start, *_ in chosen])
    return labels, pieces


def _along(
    page: Page, line: Points, width: float, height: float, others: list[Points]
) -> list[tuple[float, Points, float]]:
    """Labels of one line: start along the line, middle and angle of each."""
    even, step = _even(line)
    window = int(np.ceil((width + 2 * _ROOM) / step))
    if len(even) < 1.5 * window:
        return []
    start = np.arange(0, len(even) - window, 2)
    first, middle, last = even[start], even[start + window // 2], even[start + window]
    chord = last - first
    length = np.maximum(np.hypot(*chord.T), 1e-9)
    along = chord / length[:, None]
    normal = along[:, ::-1] * [-1, 1]
    quarters = np.stack([even[start + window * k // 4] - first for k in (1, 2, 3)])
    bent = np.abs((quarters * normal).sum(axis=-1)).max(axis=0)
    centre = (first + last) / 4 + middle / 2
    across = along[:, None, None] * _samples(width + _ROOM)[:, None, None]
    upwards = normal[:, None, None] * _samples(height + _ROOM)[None, :, None]
    boxes = centre[:, None] + (across + upwards).reshape(len(start), -1, 2)
    hidden = page.hidden(boxes, (width + _ROOM) * (height + _ROOM)) / width - 1
    angle = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    angle = (angle + 90) % 180 - 90
    good = (bent <= _BENT) & (hidden <= _CROWDED) & page.free(boxes)
    cost = hidden + bent / _BENT + np.abs(angle) / 180
    order = np.flatnonzero(good)
    chosen: list[tuple[float, Points, float]] = []
    for i in order[np.argsort(cost[order], kind="stable")].tolist():
        place = float(start[i]) * step
        if any(abs(place - other) < _APART for other, *_ in chosen):
            continue
        if any(np.hypot(*(centre[i] - at)) < _APART / 3 for at in others) or not page.free(boxes[i : i + 1])[0]:
            continue
        page.shut_box(boxes[i])
        chosen.append((place, centre[i], float(angle[i])))
    return chosen


def _samples(size: float) -> Points:
    """Sample positions along a side, relative to its middle, no farther apart than cells are wide."""
    return np.linspace(-size / 2, size / 2, int(np.ceil(size / _CELL)) + 1)


def _length(line: Points) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _far(line: Points) -> Points:
    """Distance of each point along its line."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))


def _at(line: Points, far: Points, where: Points) -> Points:
    return np.stack([np.interp(where, far, line[:, k]) for k in (0, 1)], axis=1)


def _even(line: Points) -> tuple[Points, float]:
    """Resample a line at even distances of about one point (1/72 inch); returns the points and the distance."""
    far = _far(line)
    count = max(int(np.ceil(far[-1])), 1)
    return _at(line, far, np.linspace(0, far[-1], count + 1)), max(float(far[-1]) / count, 1e-9)


def _cut(line: Points, gaps: list[tuple[float, float]]) -> list[Points]:
    """Cut a line: keep what lies before one distance along it, and after another."""
    far = _far(line)
    edges = [0.0, *(edge for gap in sorted(gaps) for edge in gap), float(far[-1])]
    pieces = []
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        if end > start:
            inner = line[(far > start) & (far < end)]
            ends = _at(line, far, np.array([start, end]))
            pieces.append(np.concatenate([ends[:1], inner, ends[1:]]))
    return pieces
