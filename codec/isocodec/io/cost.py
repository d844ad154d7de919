"""Memory that writing takes, in bytes, counted before the work begins: that of the most expensive writer."""

from __future__ import annotations


def peak(points: int, cells: int) -> int:
    """Most memory while one drawing is written."""
    return 300 * points + 240 * cells + (1 << 24)


def kept(points: int) -> int:
    """Memory that is held after a drawing has been written, until the file is complete."""
    return 150 * points
