"""Rate and distortion of curves and surfaces, for every strategy (row F-rd)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import isocodec
from figures.corpus import Item, load, original_of
from figures.planes import save
from isocodec.errors import OptionError
from isocodec.format.events import LayerComplete
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.layers.plan import Criteria
from isocodec.search.proof import hausdorff

Point = tuple[str, int, float]
"""Strategy, bytes, largest distance in cells, both ways."""
CURVES = (("terrain/esterel_257", 300.5), ("medical/mni152_axial_100", 120.5), ("image/car_plate_de", 127.5))
SURFACES = (("sdf/horse_65", 0.5), ("sdf/eight_65", 0.5))
TOLERANCES = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.1)
DIVISIONS = (1, 3, 5, 9, 21, 63)
DISTORTIONS = (4, 2, 1, 0.5, 0.25)
QUANTISED = (3, 5, 9, 21)
"""Parts of crossings on meshes of one threshold: the mesh of each keeps it with what is lost by rounding."""
MARKS = "ovsD^<>pP*XhH"

PREFIXES: dict[str, dict[str, Any]] = {
    "progressive, uniform, signs then offsets": {},
    "progressive, uniform, signs then exact values": {"precision": "exact"},
    "progressive, topology kept, steps 4, 1, 0.25": {"keep_topology": True, "precision": [4.0, 1.0, 0.25]},
}
"""Files of which every layer is a point of the plot."""
SEARCHED: dict[str, dict[str, Any]] = {
    "searched under a tolerance": {}, "searched, topology kept": {"keep_topology": True},
}
"""Files for a tolerance each."""
Plan = list[tuple[Any, ...]]


def in_parts(parts: int, unit: int = 0) -> Plan:
    """Crossings in so many parts; nothing for one."""
    return [("offsets", parts, unit)] if parts > 1 else []


def _on(geometry: Plan, **criteria: Any) -> Plan:
    """Geometry on a mesh by criteria."""
    return [("adaptive_base", 0, Criteria(**criteria)), *geometry]


FAMILIES: dict[str, list[Plan]] = {
    "single rate, offsets in 1 to 63 parts": [[("base", None), *in_parts(parts)] for parts in DIVISIONS],
    "single rate, values of 1 bit and more": [[("base", None), ("values", bits)] for bits in (1, 2, 3, 4, 5, 6)],
    "crossing, 1 to 63 parts": [_on(in_parts(parts), crossing=True) for parts in DIVISIONS],
    "topology, 1 to 63 parts": [_on(in_parts(parts, 2), topology=True) for parts in DIVISIONS],
    "curvature 1 to 0.1": [_on(in_parts(5), curvature=k) for k in (1, 0.7, 0.5, 0.3, 0.2, 0.1)],
    "distortion 4 to 0.25, 5 parts": [_on(in_parts(5, 1), distortion=d) for d in DISTORTIONS],
    "distortion and topology, 5 parts": [
        _on(in_parts(5, 1), topology=True, distortion=d) for d in DISTORTIONS
    ],
    **{
        f"distortion {d}, 3 to 21 parts": [
            _on(in_parts(parts, 1), distortion=d) for parts in QUANTISED
        ]
        for d in (4, 1, 0.5)
    },
}
"""Files by plan, a point each; of coarse meshes every 2 or 4 samples are divided."""


def measured(item: Item) -> Iterator[Point]:
    """All strategies on one item."""
    whole = original_of(item)

    def apart(contour: isocodec.Contour) -> float:
        return max(hausdorff(whole.points, whole.cells, contour.points, contour.cells))

    n, full = item.values.ndim, item.values.ndim * cube_exponent(item.values.shape)
    for name, options in PREFIXES.items():
        decoder = isocodec.Decoder()
        decoder.feed(isocodec.encode(item.values, item.isovalue, **options))
        for event in decoder:
            if isinstance(event, LayerComplete) and (event.layer.level == full or event.layer.level % n == 0):
                yield name, event.offset, apart(decoder.contour())
    for name, plans in FAMILIES.items():
        for plan in plans:
            try:
                data = isocodec.encode(item.values, item.isovalue, layers=plan)
            except OptionError:
                # there are not that many bits of values, or crossings are too coarse for a distance
                continue
            yield name, len(data), apart(isocodec.decode(data))
    for level in range(2 * n, full, n):
        data = isocodec.encode(item.values, item.isovalue, layers=[("base", level), ("offsets", 5, 1)])
        yield "uniform levels, 5 parts", len(data), apart(isocodec.decode(data))
    for name, options in SEARCHED.items():
        for tolerance in TOLERANCES if n == 2 else (2.0, 1.0, 0.5):
            data = isocodec.encode(item.values, item.isovalue, precision=tolerance, **options)
            yield name, len(data), apart(isocodec.decode(data))


def draw(item: Item, points: list[Point], path: Path) -> None:
    """Bytes and distance, a line for each strategy."""
    figure, axes = plt.subplots(figsize=(9.0, 5.2), layout="constrained")
    names = list(dict.fromkeys(name for name, _, _ in points))
    colours = plt.get_cmap("tab20")(np.linspace(0, 1, len(names)))
    for mark, name, colour in zip(MARKS * 2, names, colours, strict=False):
        some = np.array(sorted((size, far) for of, size, far in points if of == name and 0 < far < np.inf))
        if len(some):
            axes.plot(*some.T, marker=mark, markersize=4, linewidth=1, label=name, color=colour)
    axes.set(xscale="log", yscale="log", xlabel="bytes", ylabel="Hausdorff distance (cells)", title=item.title)
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, path)


def _rates(folder: Path, out: Path, chosen: tuple[tuple[str, float], ...]) -> None:
    for name, isovalue in chosen:
        item = load(folder, name, isovalue)
        points = list(measured(item))
        for strategy, size, far in points:
            print(f"rates, {item.title}, {strategy}: {size:,} bytes, {far:.3f} cells")
        draw(item, points, out / f"rate-{item.short}.png")
        (out / f"rate-{item.short}.json").write_text(json.dumps(points, indent=1) + "\n")


def rates(folder: Path, out: Path) -> None:
    """F-rd: rate and distortion of curves, single rate and progressive, each criterion, quantisations."""
    _rates(folder, out, CURVES)


def surface_rates(folder: Path, out: Path) -> None:
    """F-rd: the same of surfaces."""
    _rates(folder, out, SURFACES)
