"""Checks on a folder of real arrays that are too long for the test suite; prints a Markdown table.

Every array (``*.npy``, or ``values`` in ``*.npz``) may have a sidecar ``NAME.json`` with a list ``isovalues``; without
one the middle of its range is used. Run for example::

    python tools/acceptance.py FOLDER exact2d exact3d tolerance prefix figures overhead -o results

The oracles are scikit-image's ``find_contours`` and ``marching_cubes`` and the marching squares in this file.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skimage.measure import find_contours, marching_cubes

import isocodec
from isocodec.format.events import LayerComplete

LARGEST = 200**3
"""Volumes with more samples are left out of the exactness check."""


@dataclass(frozen=True)
class Item:
    """One array at one isovalue."""

    name: str
    values: NDArray
    isovalue: float

    @property
    def integer(self) -> bool:
        return self.values.dtype.kind in "iu"

    def half(self) -> Item:
        """At floor + 0.5, for integers: no sample lies on it."""
        return Item(self.name, self.values, math.floor(self.isovalue) + 0.5) if self.integer else self


def items(folder: Path, axes: int) -> Iterator[Item]:
    """All arrays of ``axes`` axes without NaN, at all their isovalues."""
    for path in sorted([*folder.rglob("*.npy"), *folder.rglob("*.npz")]):
        loaded = np.load(path)
        values = loaded["values"] if path.suffix == ".npz" else loaded
        if values.ndim != axes or (values.dtype.kind == "f" and np.isnan(values).any()):
            continue
        sidecar = path.with_suffix(".json")
        isovalues = json.loads(sidecar.read_text()).get("isovalues") if sidecar.exists() else None
        for isovalue in isovalues or [(float(values.min()) + float(values.max())) / 2]:
            yield Item(str(path.relative_to(folder).with_suffix("")), values, float(isovalue))


def same_sets(found: NDArray, wanted: NDArray, tolerance: float) -> float:
    """Largest distance from a point of one set to the other, both ways; infinite if the sets differ in number."""
    found, wanted = np.unique(found, axis=0), np.unique(wanted, axis=0)
    if len(found) == 0 or len(wanted) == 0:
        return 0.0 if len(found) == len(wanted) else math.inf
    there = cKDTree(wanted).query(found)[0].max()
    back = cKDTree(found).query(wanted)[0].max()
    return float(max(there, back))


def exact2d(folder: Path) -> Iterator[str]:
    """Exactness, 2-D: decoded points are find_contours' points."""
    yield "| item | isovalue | bytes | points | largest difference |\n| --- | ---: | ---: | ---: | ---: |"
    worst = 0.0
    count = 0
    for item in items(folder, 2):
        if not item.integer:
            continue
        item = item.half()
        data = isocodec.encode(item.values, item.isovalue, precision="exact")
        points = isocodec.decode(data).points
        lines = find_contours(item.values.astype(float), item.isovalue)
        wanted = np.concatenate(lines) if lines else np.zeros((0, 2))
        difference = same_sets(points, wanted, 1e-9)
        worst, count = max(worst, difference), count + 1
        yield f"| {item.name} | {item.isovalue} | {len(data)} | {len(points)} | {difference:.1e} |"
    yield f"\n{count} curves, largest difference {worst:.1e}: {'ok' if worst <= 1e-9 else 'FAILED'}"


def bad_edges(contour: isocodec.Contour) -> int:
    """Edges of a surface that break a consistently oriented manifold, those on the border of the box aside."""
    a = contour.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    last = np.array(contour.shape) - 1
    points = contour.points
    on_border = ((points[a] == 0).all(1) | (points[a] == last).all(1)).any(1)
    key = a[:, 0] * len(points) + a[:, 1]
    back = a[:, 1] * len(points) + a[:, 0]
    _, counts = np.unique(key, return_counts=True)
    alone = ~np.isin(key, back)
    return int((counts > 1).sum()) + int((alone & ~on_border).sum())


def exact3d(folder: Path) -> Iterator[str]:
    """Exactness, 3-D: vertices on grid edges are those of marching cubes, and the surface is a manifold."""
    yield "| item | isovalue | bytes | points | centre points | largest difference | bad edges |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    worst, broken, count = 0.0, 0, 0
    for item in items(folder, 3):
        if item.values.size > LARGEST:
            continue
        item = item.half()
        options = {"precision": "exact"} if item.integer else {"precision": 2.0**-20}
        data = isocodec.encode(item.values, item.isovalue, **options)
        contour = isocodec.decode(data)
        wanted = np.zeros((0, 3))
        if item.values.min() < item.isovalue < item.values.max():
            wanted = marching_cubes(item.values.astype(np.float64), item.isovalue, method="lorensen")[0].astype(float)
        whole = (contour.points == np.round(contour.points)).sum(1)
        difference = same_sets(contour.points[whole >= 2], wanted, 1e-4)
        edges = bad_edges(contour)
        worst, broken, count = max(worst, difference), broken + edges, count + 1
        centres = int((whole < 2).sum())
        yield (
            f"| {item.name} | {item.isovalue} | {len(data)} | {len(contour.points)} | {centres} | {difference:.1e} "
            f"| {edges} |"
        )
    verdict = "ok" if worst <= 1e-4 and broken == 0 else "FAILED"
    yield f"\n{count} surfaces, largest difference {worst:.1e}, {broken} bad edges: {verdict}"


def marching_squares(values: NDArray, isovalue: float) -> NDArray[np.float64]:
    """Segments (M, 2, 2) of marching squares, saddles joined along the mesh's diagonal.

    The diagonal of a cell runs from its corner with even indices to the one with odd indices.
    """
    f = values.astype(np.float64)
    above = values > (isovalue if values.dtype.kind == "f" else math.floor(isovalue))
    rows, columns = f.shape
    i, j = (a.ravel() for a in np.mgrid[: rows - 1, : columns - 1])
    even = np.stack([i + i % 2, j + j % 2], 1)
    odd = np.stack([i + (i + 1) % 2, j + (j + 1) % 2], 1)
    side = [np.stack([even[:, 0], odd[:, 1]], 1), np.stack([odd[:, 0], even[:, 1]], 1)]
    segments = []

    def crossing(p: NDArray, q: NDArray) -> NDArray:
        fp, fq = f[p[:, 0], p[:, 1]], f[q[:, 0], q[:, 1]]
        return p + ((isovalue - fp) / (fq - fp))[:, None] * (q - p)

    s_even, s_odd = above[even[:, 0], even[:, 1]], above[odd[:, 0], odd[:, 1]]
    s_side = [above[s[:, 0], s[:, 1]] for s in side]
    joined = s_even == s_odd
    for k in (0, 1):
        cut_off = joined & (s_side[k] != s_even)  # a corner off the diagonal alone
        p = side[k][cut_off]
        segments.append(np.stack([crossing(p, even[cut_off]), crossing(p, odd[cut_off])], 1))
    apart = ~joined
    # one segment, from one side of the diagonal to the other: through the edges that differ on each side
    ends = []
    for k in (0, 1):
        to_even = s_side[k] != s_even
        near = np.where(to_even[:, None], even, odd)
        ends.append(crossing(side[k][apart], near[apart]))
    segments.append(np.stack(ends, 1))
    return np.concatenate(segments)


def one_way(a: NDArray, b: NDArray, step: float = 0.1) -> float:
    """Largest distance from densely sampled segments a to segments b, each (M, 2, 2) and at most one cell long."""
    if len(a) == 0 or len(b) == 0:
        return 0.0 if len(a) == len(b) else math.inf
    t = np.linspace(0, 1, int(1.5 / step))
    points = (a[:, None, 0] + t[None, :, None] * (a[:, None, 1] - a[:, None, 0])).reshape(-1, 2)
    middles = b.mean(1)
    nearest = cKDTree(middles).query(points, k=min(12, len(b)))[1].reshape(len(points), -1)
    best = np.full(len(points), np.inf)
    for column in nearest.T:
        p, d = b[column, 0], b[column, 1] - b[column, 0]
        length = np.maximum((d * d).sum(1), 1e-30)
        u = np.clip(((points - p) * d).sum(1) / length, 0, 1)
        best = np.minimum(best, np.hypot(*(p + u[:, None] * d - points).T))
    return float(best.max())


def tolerance(folder: Path) -> Iterator[str]:
    """Tolerance 0.05: Hausdorff distance between decoded curve and marching squares, both ways."""
    yield "| item | isovalue | bytes | decoded to extracted | extracted to decoded |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    worst, count = 0.0, 0
    for item in items(folder, 2):
        item = item.half()
        data = isocodec.encode(item.values, item.isovalue, precision=0.05)
        contour = isocodec.decode(data)
        ours = contour.points[contour.cells]
        wanted = marching_squares(item.values, item.isovalue)
        there, back = one_way(ours, wanted), one_way(wanted, ours)
        worst, count = max(worst, there, back), count + 1
        yield f"| {item.name} | {item.isovalue} | {len(data)} | {there:.4f} | {back:.4f} |"
    yield f"\n{count} curves, largest distance {worst:.4f}: {'ok' if worst <= 0.05 else 'FAILED'}"


@dataclass(frozen=True)
class Sampled:
    """A curve or surface with points spread over it: which cell each is on, and the length or area it stands for."""

    corners: NDArray
    points: NDArray
    cell: NDArray
    weight: NDArray

    @staticmethod
    def of(contour: isocodec.Contour) -> Sampled:
        step = 0.3 if contour.points.shape[1] == 2 else 0.6
        corners = contour.points[contour.cells]
        if contour.points.shape[1] == 2:
            size = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
            number = np.maximum(np.ceil(size / step).astype(int), 1)
        else:
            size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
            number = np.maximum(np.ceil(size / (step * step)).astype(int), 1)
        cell = np.repeat(np.arange(len(corners)), number)
        if corners.shape[1] == 2:
            place = (np.arange(len(cell)) - np.repeat(np.cumsum(number) - number, number) + 0.5) / number[cell]
            mix = np.stack([1 - place, place], 1)
        else:
            mix = np.random.default_rng(0).dirichlet(np.ones(3), len(cell))
        return Sampled(corners, (corners[cell] * mix[:, :, None]).sum(1), cell, (size / number)[cell])

    def distances(self, points: NDArray, candidates: int = 4) -> NDArray:
        """Distance of points to the cells of the nearest samples."""
        nearest = cKDTree(self.points).query(points, k=min(candidates, len(self.points)))[1].reshape(len(points), -1)
        best = np.full(len(points), np.inf)
        for column in nearest.T:
            best = np.minimum(best, _to_cells(points, self.corners[self.cell[column]]))
        return best


def _to_segments(points: NDArray, a: NDArray, b: NDArray) -> NDArray:
    d = b - a
    u = np.clip(((points - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-30), 0, 1)
    return np.linalg.norm(a + u[:, None] * d - points, axis=1)


def _to_cells(points: NDArray, corners: NDArray) -> NDArray:
    """Distance of each point to its segment or triangle."""
    count = corners.shape[1]
    edges = [_to_segments(points, corners[:, i], corners[:, (i + 1) % count]) for i in range(count if count > 2 else 1)]
    best = np.min(edges, axis=0)
    if count == 3:
        a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(u, v)
        square = np.maximum((normal * normal).sum(1), 1e-30)
        w = points - a
        s = (np.cross(w, v) * normal).sum(1) / square
        t = (np.cross(u, w) * normal).sum(1) / square
        inside = (s >= 0) & (t >= 0) & (s + t <= 1)
        best = np.where(inside, np.abs((w * normal).sum(1)) / np.sqrt(square), best)
    return best


def mean_distance(a: Sampled, b: Sampled) -> float:
    """Mean of the mean distances from a to b and from b to a."""
    if len(a.points) == 0 or len(b.points) == 0:
        return math.inf
    there = np.average(b.distances(a.points), weights=a.weight)
    back = np.average(a.distances(b.points), weights=b.weight)
    return float(there + back) / 2


def prefix(folder: Path, output: Path | None, cuts: int = 200, files: int = 10) -> Iterator[str]:
    """Cuts of files: errors, symbols received, distances at the ends of layers, a plot over all cuts."""
    rng = np.random.default_rng(1)
    every = [i for i in [*items(folder, 2), *items(folder, 3)] if 2000 < i.values.size < 1 << 19]
    chosen: dict[str, Item] = {}
    for item in every:
        chosen.setdefault(item.name, item)
    names = sorted(chosen)
    names = [names[i] for i in np.unique(np.linspace(0, len(names) - 1, files).round().astype(int))]
    yield "| item | isovalue | kind | bytes | cuts without error | symbols a prefix | worst growth at a layer's end |"
    yield "| --- | ---: | --- | ---: | ---: | --- | ---: |"
    curves = {}
    for name in names:
        item = chosen[name].half()
        options = {"precision": "exact"} if item.integer and names.index(name) % 2 else {}
        data = isocodec.encode(item.values, item.isovalue, **options)
        whole = isocodec.Decoder()
        whole.feed(data)
        at_layers: list[tuple[int, float]] = []
        # the extracted curve: exact2d and exact3d check that this is what others extract
        reference = Sampled.of(isocodec.decode(isocodec.encode(item.values, item.isovalue, precision=2.0**-20)))
        for event in whole:
            if isinstance(event, LayerComplete):
                at_layers.append((event.offset, mean_distance(Sampled.of(whole.contour()), reference)))
        growth = max(
            (b / a - 1 for (_, a), (_, b) in itertools.pairwise(at_layers) if math.isfinite(a) and b > 1e-9), default=0
        )
        fine, ordered, points = 0, True, []
        before = dict.fromkeys(whole.symbols, 0)
        for length in sorted(rng.integers(1, len(data), cuts)):
            decoder = isocodec.Decoder()
            decoder.feed(data[:length])
            try:
                contour = decoder.contour()
                try:
                    decoder.close()
                except isocodec.errors.TruncatedError:
                    fine += 1
            except isocodec.IsoError as error:
                print(f"{name} cut at {length}: {error}", file=sys.stderr)
                continue
            ordered &= all(before[k] <= v <= whole.symbols[k] for k, v in decoder.symbols.items())
            before = decoder.symbols
            if len(contour.cells):
                points.append((int(length), mean_distance(Sampled.of(contour), reference)))
        curves[f"{name} @ {item.isovalue}"] = points
        kind = "exact" if options else "0.05"
        row = [name, item.isovalue, kind, len(data), f"{fine} / {cuts}", ordered, f"{100 * growth:+.1f} %"]
        yield f"| {' | '.join(map(str, row))} |"
    if output:
        _plot(curves, output / "prefix.png")
        yield f"\nplot: {output / 'prefix.png'}"


def _plot(curves: dict[str, list[tuple[int, float]]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9, 6))
    for name, points in curves.items():
        axes.plot(*zip(*points, strict=True), label=name, linewidth=1)
    axes.set(xscale="log", yscale="log", ylim=(1e-4, None))
    axes.set(xlabel="bytes received", ylabel="mean distance to the extracted curve (cells)")
    axes.legend(fontsize=7)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def figures(folder: Path) -> Iterator[str]:
    """F-2bits and F-80: raw symbols per crossed pixel, and the share of right predictions."""
    yield (
        "| item | isovalue | crossed pixels | single rate: sign bits / pixel | with localisation | prediction right, "
        "base | progressive: sign symbols / pixel | prediction right |"
    )
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    rows = []
    for item in items(folder, 2):
        item = item.half()
        full = 2 * max(max(item.values.shape) - 2, 0).bit_length()
        above = item.values > math.floor(item.isovalue) if item.integer else item.values > item.isovalue
        corners = above[:-1, :-1].astype(int) + above[1:, :-1] + above[:-1, 1:] + above[1:, 1:]
        pixels = int(((corners > 0) & (corners < 4)).sum())
        if pixels == 0:
            continue
        row = []
        for level in (full, None):
            decoder = isocodec.Decoder()
            decoder.feed(isocodec.encode(item.values, item.isovalue, precision="signs", layers=level))
            for _ in decoder:
                pass
            s = decoder.symbols
            made, right = decoder.grid.predictions
            signs = s["base_sign"] + s["refinement_sign"]
            row += [signs / pixels, sum(s.values()) / pixels, right / max(made, 1)]
        rows.append(row)
        yield (
            f"| {item.name} | {item.isovalue} | {pixels} | {row[0]:.2f} | {row[1]:.2f} | {row[2]:.2f} | {row[4]:.2f} "
            f"| {row[5]:.2f} |"
        )
    m = np.mean(rows, 0)
    yield f"\nmeans over {len(rows)} curves: {m[0]:.2f}, {m[1]:.2f}, {m[2]:.3f}; {m[4]:.2f}, {m[5]:.3f}"


def overhead(folder: Path) -> Iterator[str]:
    """Container overhead of exact files of integer data."""
    yield "| item | isovalue | bytes | overhead | share |\n| --- | ---: | ---: | ---: | ---: |"
    failed = 0
    for axes in (2, 3):
        for item in items(folder, axes):
            if not item.integer or item.values.size > 1 << 22:
                continue
            item = item.half()
            for options in ({"precision": "exact"}, {}, {"precision": "signs"}):
                data = isocodec.encode(item.values, item.isovalue, **options)
                spent = isocodec.open(data).info.overhead_bytes
                good = spent <= 24 if len(data) <= 4096 else spent <= max(0.015 * len(data), 24)
                failed += not good
                if not good or options:
                    mark = "" if good else " FAILED"
                    share = 100 * spent / len(data)
                    yield f"| {item.name} | {item.isovalue} | {len(data)} | {spent} | {share:.2f} %{mark} |"
    yield f"\n{failed} failures"


CHECKS = {
    "exact2d": exact2d, "exact3d": exact3d, "tolerance": tolerance, "figures": figures, "overhead": overhead,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("checks", nargs="*", choices=[*CHECKS, "prefix", []], help="all if none is named")
    parser.add_argument("-o", "--output", type=Path, help="folder for plots")
    arguments = parser.parse_args()
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
    for name in arguments.checks or [*CHECKS, "prefix"]:
        started = time.perf_counter()
        print(f"\n## {name}\n", flush=True)
        rows = prefix(arguments.folder, arguments.output) if name == "prefix" else CHECKS[name](arguments.folder)
        for row in rows:
            print(row, flush=True)
        print(f"\n{time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
