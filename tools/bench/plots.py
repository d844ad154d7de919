"""Plots of a bench: rate over distortion of every item, ratios of every class."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from .compare import compare
from .measure import library
from .rows import Book, Row

GROUPS = ("contour2d", "image2d", "mesh3d", "volume3d", "ours")
FAMILIES = ("ours", "twkb", "dp", "geojson", "topojson", "image-jxl", "image-j2k", "draco", "meshopt", "ply",
            "volume-sperr", "volume-sz3")
"""Beginnings of names; what has one in common is a line."""
LEAST = 1e-4
"""Smallest error that is drawn, in cells."""
ERRORS = {"err_mean": "mean error", "err_max": "largest error"}

Points = list[tuple[float, int]]
"""Errors in cells, and bytes."""


def plot(book: Book, folder: Path) -> list[str]:
    """Write PNG files; their names."""
    if library("matplotlib") is None:
        return []
    import matplotlib

    matplotlib.use("Agg")
    names = []
    items = sorted({(row["corpus"], row["isovalue"]) for row in book.rows})
    for corpus, isovalue in items:
        rows = [row for row in book.rows if (row["corpus"], row["isovalue"]) == (corpus, isovalue)]
        name = f"rate-{corpus.replace('/', '-')}-{isovalue:g}.png"
        if _rate(rows, f"{corpus} @ {isovalue:g}", folder / name):
            names.append(name)
    if _ratios(book, folder / "ratios.png"):
        names.append("ratios.png")
    return names


def lines(rows: Sequence[Row], error: str) -> dict[str, Points]:
    """For each family the files that no other one of it beats in both error and bytes, by rising error."""
    points = defaultdict(list)
    for row in rows:
        family = next((f for f in FAMILIES if row["peer"].startswith(f)), None)
        if family and row["class"] in GROUPS and "bytes" in row and row.get(error) is not None:
            points[family].append((row[error], row["bytes"]))
    fronts: dict[str, Points] = {}
    for family in sorted(points):
        front = fronts.setdefault(family, [])
        for point in sorted(points[family]):
            if not front or point[1] < front[-1][1]:
                front.append(point)
    return fronts


def _rate(rows: list[Row], title: str, path: Path) -> bool:
    """Bytes over mean and over largest error, a line for each family of settings."""
    from matplotlib import pyplot

    if len(lines(rows, "err_mean")) < 2:
        return False
    figure, panels = pyplot.subplots(1, 2, figsize=(12, 5), sharey=True)
    for axes, (error, label) in zip(panels, ERRORS.items(), strict=True):
        for family, points in lines(rows, error).items():
            style = {"linewidth": 2.5, "color": "black", "zorder": 3} if family == "ours" else {"linewidth": 1}
            xs, ys = [max(x, LEAST) for x, _ in points], [y for _, y in points]
            axes.plot(xs, ys, marker="o", markersize=3, label=family, **style)
        axes.set(xscale="log", yscale="log", xlabel=f"{label} (cells; below {LEAST:g} at {LEAST:g})")
        axes.grid(alpha=0.3)
    panels[0].set(ylabel="bytes", title=title)
    panels[0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot.close(figure)
    return True


def _ratios(book: Book, path: Path) -> bool:
    """Ratio of every item in every class that has peers."""
    from matplotlib import pyplot

    results = [r for r in compare(book) if r.cls.key != "connectivity"]
    if not results:
        return False
    figure, axes = pyplot.subplots(figsize=(8, 0.5 * len(results) + 1.5))
    for place, result in enumerate(reversed(results)):
        axes.plot([r.value for r in result.ratios], [place] * len(result.ratios), "o", color="tab:blue", alpha=0.5)
        axes.plot([result.mean], [place], "|", color="black", markersize=18, markeredgewidth=2)
    axes.set_yticks(range(len(results)), [r.cls.key for r in reversed(results)])
    axes.axvline(1, color="grey", linewidth=1)
    axes.set(xlabel="bytes, ours to the best peer: items and mean (bar)", xlim=(0, None))
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot.close(figure)
    return True
