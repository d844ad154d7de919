"""What an encoder promises, checked on a folder of real arrays by other means; prints Markdown tables.

Every array (``*.npy``, or ``values`` in ``*.npz``) may have a sidecar ``NAME.json`` with a list ``isovalues``; without
one the middle of its range is used. Run for example::

    python tools/promises.py FOLDER topology distance --only terrain
    python tools/promises.py FOLDER polylines --peers peers.jsonl

Topology is read off the drawn curves: pieces that shapely makes of the box, Euler characteristics of surfaces.
Distances are those of points spread densely over one curve or surface to the other one, both ways.
"""

from __future__ import annotations

import argparse
import json
import math
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import networkx
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import isocodec
from acceptance import Item, Sampled, items
from isocodec.drawing.contour import Contour
from isocodec.field.samples import check_field
from isocodec.format.events import LayerComplete
from isocodec.search.original import original
from isocodec.search.promise import Promise
from isocodec.search.proof import Target, hausdorff
from isocodec.stream.inspect import inspect

TOLERANCES = (0.1, 0.25, 1.0, 4.0)
ROUNDING = 1e-9
"""Distances that are exactly the tolerance come out a little larger in floating point."""
PUBLISHED = (2258, 5439, 7353, 1135)
"""Bytes of the surface paper's figure 8: base, its geometry, refinement, its geometry."""

Check = Callable[[list[Item], argparse.Namespace], Iterator[str]]


def labels(contour: Contour) -> tuple[int, NDArray[np.int64]]:
    """Components of a contour: how many, and that of each point."""
    cells, count = contour.cells, len(contour.points)
    rows = np.concatenate([cells[:, i] for i in range(cells.shape[1] - 1)])
    columns = np.concatenate([cells[:, i] for i in range(1, cells.shape[1])])
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(count, count))
    return connected_components(graph, directed=False)


def border(contour: Contour) -> NDArray[np.float64]:
    """The border of the box as segments (B, 2, 2) between its corners and the ends of curves."""
    last = np.array(contour.shape) - 1.0
    ends = contour.points[np.bincount(contour.cells.ravel(), minlength=len(contour.points)) == 1]
    points = np.unique(np.concatenate([ends, [[0, 0], [0, last[1]], last, [last[0], 0]]]), axis=0)
    way = np.where(points[:, 0] == 0, points[:, 1], np.where(points[:, 1] == last[1], last[1] + points[:, 0], 0.0))
    back = (points[:, 0] > 0) & (points[:, 1] < last[1])
    way = np.where(back, last.sum() + np.where(points[:, 0] == last[0], last[1] - points[:, 1],
                                               last[1] + last[0] - points[:, 0]), way)
    ring = points[np.argsort(way)]
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def nesting(contour: Contour) -> str:
    """What lies beside and inside what: a fingerprint of the tree of regions and curves between them, 2-D."""
    lines = shapely.linestrings(np.concatenate([contour.points[contour.cells], border(contour)]))
    pieces = shapely.get_parts(shapely.polygonize(lines))
    _, label = labels(contour)
    component = dict(zip(map(tuple, contour.points), label, strict=True))
    tree = networkx.Graph()
    for number, piece in enumerate(pieces):
        tree.add_node(("region", number), kind="region")
        for point in shapely.get_coordinates(piece):
            curve = component.get(tuple(point))
            if curve is not None:
                tree.add_node(("curve", curve), kind="curve")
                tree.add_edge(("region", number), ("curve", curve))
    return networkx.weisfeiler_lehman_graph_hash(tree, node_attr="kind", iterations=24)


def characteristics(contour: Contour) -> list[int]:
    """Euler characteristics of all components of a surface, sorted."""
    cells = contour.cells
    count, label = labels(contour)
    sides = np.unique(np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1), axis=0)
    used = np.unique(cells)
    euler = np.bincount(label[used], minlength=count)
    euler = euler - np.bincount(label[sides[:, 0]], minlength=count) + np.bincount(label[cells[:, 0]], minlength=count)
    return sorted(euler[np.unique(label[used])].tolist())


def shape_of(contour: Contour) -> list[int] | tuple[int, str] | None:
    """What topology keeps: number of curves and their nesting, or all Euler characteristics."""
    if not len(contour.cells):
        return None
    if len(contour.shape) == 3:
        return characteristics(contour)
    label = labels(contour)[1]
    return len(np.unique(label[contour.cells])), nesting(contour)


def topology(chosen: list[Item], _: argparse.Namespace) -> Iterator[str]:
    """Every layer of a file that keeps the topology has that of the whole curve."""
    yield "| item | isovalue | options | components | bytes | layers | topology |"
    yield "| --- | ---: | --- | ---: | ---: | ---: | --- |"
    failed = files = 0
    for item in chosen:
        # samples that equal the isovalue count as below: a little below it, the curve does not touch itself
        values = item.values.astype(np.float64)
        values[values == item.isovalue] -= 1e-6 * np.ptp(values)
        wanted = shape_of(original(check_field(values, item.isovalue)))
        for name, kept in {"default": {}, "0.25": {"precision": 0.25}, "4, 1": {"precision": [4, 1]}}.items():
            data = isocodec.encode(item.values, item.isovalue, keep_topology=True, **kept)
            decoder = isocodec.Decoder()
            decoder.feed(data)
            found = [shape_of(decoder.contour()) == wanted for event in decoder if isinstance(event, LayerComplete)]
            good = all(found) and len(found) > 0
            failed += not good
            files += 1
            count = 0 if wanted is None else (wanted[0] if isinstance(wanted, tuple) else len(wanted))
            said = "kept" if good else f"LOST in layers {[i for i, same in enumerate(found) if not same]}"
            yield f"| {item.name} | {item.isovalue} | {name} | {count} | {len(data)} | {len(found)} | {said} |"
    yield f"\n{len(chosen)} curves and surfaces, {files} files, {failed} failures"


def farthest(a: Contour, b: Contour) -> float:
    """Largest distance of points spread over one contour to the other."""
    if not len(a.cells) or not len(b.cells):
        return 0.0 if len(a.cells) == len(b.cells) else math.inf
    ours = Sampled.of(a)
    points = np.concatenate([ours.points, a.points[np.unique(a.cells)]])
    theirs = Sampled.of(b)
    apart = theirs.distances(points, candidates=8)
    # the nearest sample may be that of another piece: the farthest points look at many
    worst = np.argsort(apart)[-len(apart) // 50 - 1 :]
    apart[worst] = theirs.distances(points[worst], candidates=300)
    return float(apart.max())


def unproven(a: Contour, b: Contour, tolerance: float) -> int:
    """Pieces of either that are not proven to lie within the tolerance of the other."""
    pairs = ((a, b), (b, a))
    return sum(len(Target(y.points, y.cells, tolerance).exceeded(x.points, x.cells).cells) for x, y in pairs)


def distance(chosen: list[Item], _: argparse.Namespace) -> Iterator[str]:
    """Hausdorff distance of tolerances: proven bounds, and what dense samples find."""
    yield "| item | isovalue | tolerance | bytes | layers | distance |\n| --- | ---: | ---: | ---: | ---: | ---: |"
    failed = count = 0
    for item in chosen:
        whole = original(check_field(item.values, item.isovalue))
        for tolerance in TOLERANCES:
            data = isocodec.encode(item.values, item.isovalue, precision=tolerance)
            contour = isocodec.decode(data)
            sampled = max(farthest(whole, contour), farthest(contour, whole))
            good = sampled <= tolerance + ROUNDING and not unproven(whole, contour, tolerance)
            failed += not good
            count += 1
            layers = len(isocodec.open(data).info.layers)
            mark = "" if good else " FAILED"
            yield f"| {item.name} | {item.isovalue} | {tolerance} | {len(data)} | {layers} | {sampled:.3f}{mark} |"
    yield f"\n{count} files, {failed} failures"


def polylines(chosen: list[Item], options: argparse.Namespace) -> Iterator[str]:
    """``--tolerance 0.25`` against simplified polylines, from a file of sizes (``--peers``)."""
    peer = "dp0.25px+twkb-1/16px+brotli11"
    sizes = {}
    for line in options.peers.read_text().splitlines():
        row = json.loads(line)
        if row["peer"] == peer:
            sizes[row["corpus"], row["isovalue"]] = row["bytes"]
    yield f"| item | isovalue | bytes | {peer} | ratio |\n| --- | ---: | ---: | ---: | ---: |"
    ratios = []
    for item in chosen:
        theirs = sizes.get((item.name, item.isovalue), sizes.get((item.name, item.half().isovalue)))
        if theirs is None:
            continue
        ours = len(isocodec.encode(item.values, item.half().isovalue, precision=0.25))
        ratios.append(ours / theirs)
        yield f"| {item.name} | {item.half().isovalue} | {ours} | {theirs} | {ratios[-1]:.3f} |"
    yield f"\n{len(ratios)} items, geometric mean {np.exp(np.mean(np.log(ratios))):.3f}, largest {max(ratios):.3f}"


def meshes(chosen: list[Item], options: argparse.Namespace) -> Iterator[str]:
    """``--tolerance`` against decimated meshes: sizes from a file (``--meshes``) with lines item, distance, bytes."""
    yield "| item | distance | bytes | decimated | ratio |\n| --- | ---: | ---: | ---: | ---: |"
    sizes = [line.split() for line in options.meshes.read_text().splitlines() if line.strip()]
    for item in chosen:
        for name, tolerance, theirs in sizes:
            if item.name == name:
                ours = len(isocodec.encode(item.values, item.isovalue, precision=float(tolerance)))
                yield f"| {name} | {tolerance} | {ours} | {theirs} | {ours / int(theirs):.3f} |"


def horse(chosen: list[Item], _: argparse.Namespace) -> Iterator[str]:
    """The four steps of the surface paper's figure 8: meshes at distortions 3.0 and 0.2, and the geometry of each."""
    yield "| item | base 3.0 | its geometry | refined 0.2 | its geometry | distances after each step (cells) |"
    yield "| --- | ---: | ---: | ---: | ---: | --- |"
    yield f"| published | {' | '.join(map(str, PUBLISHED))} | |"
    for item in chosen:
        if item.values.ndim != 3:
            continue
        field = check_field(item.values, item.isovalue)
        promise = Promise(field)
        fine = promise.reduction()
        fine.reduce(topology=True, distortion=0.2, original=promise.target(0.2), parts=9)
        coarse = promise.reduction(fine.chosen)
        coarse.reduce(topology=True, distortion=3.0, original=promise.target(3.0), parts=1, unit=1)
        plan = [("adaptive_base", 0, coarse.chosen), ("offsets", 3, 1), ("adapt", 0, fine.chosen), ("offsets", 9, 0)]
        data = isocodec.encode(item.values, item.isovalue, layers=plan)
        whole = promise.contour
        decoder = isocodec.Decoder()
        decoder.feed(data)
        apart = []
        for event in decoder:
            if isinstance(event, LayerComplete):
                drawn = decoder.contour()
                apart.append(max(hausdorff(whole.points, whole.cells, drawn.points, drawn.cells)))
        sizes = [layer.bytes for layer in inspect(data, symbols=True).layers]
        yield f"| {item.name} | {' | '.join(map(str, sizes))} | {', '.join(f'{d:.2f}' for d in apart)} |"


def isovalues(chosen: list[Item], _: argparse.Namespace) -> Iterator[str]:
    """A second isovalue 1, 5 and 20 steps above the first: what it adds, against a file of its own."""
    yield "| item | isovalue | layers | +1 | +5 | +20 |\n| --- | ---: | --- | ---: | ---: | ---: |"
    every: dict[str, list[float]] = {}
    for item in chosen:
        if not item.integer:
            continue
        first = item.half().isovalue
        for name, options in {
            "signs": {
                "precision": "signs"
            }, "default": {}, "exact": {"precision": "exact"}, "0.25": {"precision": 0.25},
        }.items():
            alone = len(isocodec.encode(item.values, first, **options))
            ratios = []
            for step in (1, 5, 20):
                both = len(isocodec.encode(item.values, [first, first + step], **options))
                ratios.append((both - alone) / len(isocodec.encode(item.values, first + step, **options)))
            every.setdefault(name, []).extend(ratios)
            yield f"| {item.name} | {first} | {name} | {' | '.join(f'{r:.2f}' for r in ratios)} |"
    means = {name: float(np.exp(np.mean(np.log(ratios)))) for name, ratios in every.items()}
    yield "\ngeometric means: " + ", ".join(f"{name} {mean:.3f}" for name, mean in means.items())


def reduction(chosen: list[Item], _: argparse.Namespace) -> Iterator[str]:
    """Seconds of reducing the full grid under topology and distortion, warm, and memory of that and what it needs."""
    yield "| item | samples | seconds | bytes per sample beyond the input |\n| --- | ---: | ---: | ---: |"
    for item in chosen:
        promise = Promise(check_field(item.values, item.isovalue))
        promise.reduction().reduce(topology=True, distortion=1.0, original=promise.target(1.0), parts=3)
        began = time.perf_counter()
        promise.reduction().reduce(topology=True, distortion=1.0, original=promise.target(1.0), parts=3)
        seconds = time.perf_counter() - began
        del promise
        tracemalloc.start()
        promise = Promise(check_field(item.values, item.isovalue))
        promise.reduction().reduce(topology=True, distortion=1.0, original=promise.target(1.0), parts=3)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        yield f"| {item.name} | {item.values.size} | {seconds:.2f} | {peak / item.values.size:.1f} |"


CHECKS: dict[str, Check] = {
    "topology": topology, "distance": distance, "polylines": polylines, "meshes": meshes, "horse": horse,
    "isovalues": isovalues, "reduction": reduction,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("checks", nargs="+", choices=CHECKS)
    parser.add_argument("--only", action="append", help="items with this in their name; may be given again")
    parser.add_argument("--axes", type=int, choices=(2, 3), help="only items of this dimension")
    parser.add_argument("--peers", type=Path, help="sizes of polylines, JSON lines")
    parser.add_argument("--meshes", type=Path, help="sizes of meshes, lines of item, distance, bytes")
    options = parser.parse_args()
    chosen = [
        item
        for axes in ((options.axes,) if options.axes else (2, 3))
        for item in items(options.folder, axes)
        if not options.only or any(part in item.name for part in options.only)
    ]
    for name in options.checks:
        began = time.perf_counter()
        print(f"\n## {name}\n", flush=True)
        for row in CHECKS[name](chosen, options):
            print(row, flush=True)
        print(f"\n{time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
