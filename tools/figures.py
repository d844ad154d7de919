"""The pictures of the papers anew, from a folder of real arrays: progressive steps on meshes, rate and distortion.

``python tools/figures.py FOLDER -o OUT`` writes

- ``steps-NAME.png`` of terrains: their longest curve in five steps, each of which promises a distance, on its mesh;
- ``topology-NAME.png`` of CT slices: from the coarsest mesh with the right topology to the full grid;
- ``rate-NAME.png`` and ``rate.json``: bytes and largest distance, both ways, of what every strategy
  decodes to, prefixes of progressive files included.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import isocodec
from acceptance import Item, items
from isocodec.cli.plot import spread
from isocodec.field.samples import check_field
from isocodec.io.picture import Step, steps_picture
from isocodec.layers.events import LayerComplete
from isocodec.search.distance import hausdorff
from isocodec.search.original import original

TERRAIN = ("esterel_257", "jacksboro_fault_dem")
SLICES = ("ct_head_693", "ct_head_avm_040", "ct_headsq_40")
DISTANCES = (16.0, 4.0, 1.0, 0.25)
TOLERANCES = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.1)

PREFIXES: dict[str, dict[str, Any]] = {
    "uniform, signs then offsets": {},
    "uniform, signs then exact values": {"exact": True},
    "topology kept, then steps": {"preserve_topology": True, "steps": [4.0, 1.0, 0.25]},
}
"""Files of which every layer is a point of the plot."""
WHOLE: dict[str, dict[str, Any]] = {
    "searched under a tolerance": {},
    "searched, topology kept": {"preserve_topology": True},
}
"""Files for a tolerance each."""
MARKS = "ovsD^"


def stepped(data: bytes, most: int, mesh: bool = True) -> list[Step]:
    """At most so many of the layers of a file, with the meshes under them."""
    decoder = isocodec.Decoder()
    decoder.feed(data)
    chosen = spread(len(isocodec.inspect(data).layers), most)
    steps = []
    done = 0
    for event in decoder:
        if isinstance(event, LayerComplete):
            done += 1
            if done in chosen:
                steps.append(Step(decoder.drawn(), event.offset, len(data), decoder.mesh(0) if mesh else None))
    return steps


def terrain(item: Item) -> bytes:
    """Five steps, the last one exact where the data are integers."""
    steps = [*DISTANCES, "exact"] if item.integer else list(DISTANCES)
    data = isocodec.encode(item.values, item.isovalue, steps=steps, preserve_topology=True)
    decoder = isocodec.Decoder()
    decoder.feed(data)
    # each promise is kept at the end of a layer of geometry
    kept = [
        Step(decoder.drawn(), event.offset, len(data), decoder.mesh(0))
        for event in decoder
        if isinstance(event, LayerComplete) and event.layer.kind in ("offsets", "values")
    ]
    shown = kept[: len(DISTANCES)] + kept[-1:]
    return steps_picture(shown, ".png")


def slices(item: Item) -> bytes:
    """From the coarsest mesh with the right topology on."""
    data = isocodec.encode(item.values, item.isovalue, preserve_topology=True, signs_only=True)
    return steps_picture(stepped(data, 5), ".png")


def rates(item: Item) -> Iterator[tuple[str, int, float]]:
    """Strategy, bytes, largest distance in cells."""
    whole = original(check_field(item.values, item.isovalue))

    def apart(contour: isocodec.Contour) -> float:
        return max(hausdorff(whole.points, whole.cells, contour.points, contour.cells))

    for name, options in PREFIXES.items():
        if "exact" in options and not item.integer:
            continue
        for step in stepped(isocodec.encode(item.values, item.isovalue, **options), 1000, mesh=False):
            yield name, step.bytes, apart(step.contour)
    for name, options in WHOLE.items():
        for tolerance in TOLERANCES:
            data = isocodec.encode(item.values, item.isovalue, tolerance=tolerance, **options)
            yield name, len(data), apart(isocodec.decode(data))


def rate_picture(item: Item, points: list[tuple[str, int, float]], path: Path) -> None:
    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    for mark, name in zip(MARKS, [*PREFIXES, *WHOLE], strict=True):
        some = np.array([(size, d) for strategy, size, d in points if strategy == name and 0 < d < np.inf])
        if len(some):
            axes.plot(*some.T, marker=mark, markersize=4, linewidth=1, label=name)
    axes.set(
        xscale="log", yscale="log", xlabel="bytes", ylabel="Hausdorff distance (cells)",
        title=f"{item.name} at {item.isovalue:g}",
    )  # fmt: skip
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize="small")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the pictures")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    longest: dict[str, tuple[int, Item]] = {}
    for item in items(options.folder, 2):
        short = Path(item.name).name
        if short in TERRAIN + SLICES:
            item = item.half()
            points = len(original(check_field(item.values, item.isovalue)).points)
            longest[short] = max(longest.get(short, (0, item)), (points, item), key=lambda x: x[0])
    every: dict[str, list[tuple[str, int, float]]] = {}
    for short, (_, item) in longest.items():
        if short in TERRAIN:
            (options.output / f"steps-{short}.png").write_bytes(terrain(item))
        else:
            (options.output / f"topology-{short}.png").write_bytes(slices(item))
        every[item.name] = list(rates(item))
        rate_picture(item, every[item.name], options.output / f"rate-{short}.png")
        print(f"{item.name} at {item.isovalue:g}")
    (options.output / "rate.json").write_text(json.dumps(every, indent=1) + "\n")


if __name__ == "__main__":
    main()
