"""Encode and decode the shipped data: tables of sizes, checks against scikit-image, pictures and files in demo/out/.

``python tools/demo.py --markdown`` prints the tables of docs/comparison.md; ``--docs`` writes the pictures of docs.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import skimage.measure
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

import isocodec
from isocodec.cli import main as command_line
from isocodec.plotting.panels import StepPanel, panels_picture
from isocodec.stream.file_info import LayerInfo
from isocodec.stream.inspect import inspect

ROOT = Path(__file__).resolve().parent.parent
DATA = Path("demo", "data")
OUT = Path("demo", "out")
DOCS = Path("docs")

MODES: dict[str, dict[str, Any]] = {
    "signs only": {"precision": "signs"},
    "within 0.05": {},
    "within 0.005": {"precision": 0.005},
    "exact": {"precision": "exact"},
}
"""What is kept of the curve: its crossings within 0.05 cells if nothing else is asked for."""
LAYERED = ("signs only", "within 0.05", "exact")
"""Modes of the tables by layer."""
DECIMALS = 2
"""Of GeoJSON coordinates; their rounding error of 0.005 cells is that of the third mode."""


@dataclass(frozen=True)
class Item:
    """A shipped field at one isovalue, and the name of its files."""

    name: str
    file: str
    isovalue: float
    layers: bool = False

    @property
    def path(self) -> Path:
        return DATA / f"{self.file}.npz"

    def load(self) -> NDArray[Any]:
        with np.load(self.path) as arrays:
            return arrays["values"]


# Isovalues between two integers, so that no sample lies on the curve.
ITEMS = (
    Item("terrain", "jacksboro_fault_dem", 500.5, layers=True),
    Item("coins", "coins", 107.5),
    Item("camera", "camera", 128.5),
    Item("ct-skin", "ct_headsq_quarter", 500.5, layers=True),
    Item("ct-bone", "ct_headsq_quarter", 1150.5, layers=True),
)


@dataclass(frozen=True)
class Extracted:
    """What other tools extract from a field: points, and their files' sizes in bytes by name of the format."""

    points: NDArray[np.float64]
    sizes: dict[str, int]
    tolerance: float


def extract_curve(field: NDArray[Any], isovalue: float) -> Extracted:
    """Marching squares by scikit-image, as GeoJSON with two decimals and gzip."""
    lines = skimage.measure.find_contours(field.astype(np.float64), isovalue)
    rounded = [[[round(x, DECIMALS), round(y, DECIMALS)] for y, x in line.tolist()] for line in lines]
    text = json.dumps({"type": "MultiLineString", "coordinates": rounded}, separators=(",", ":")).encode()
    sizes = {"GeoJSON + gzip": len(gzip.compress(text, 9, mtime=0))}
    return Extracted(np.unique(np.concatenate(lines), axis=0), sizes, 1e-9)


def extract_surface(field: NDArray[Any], isovalue: float) -> Extracted:
    """Marching cubes by scikit-image, as binary STL, plain and with gzip."""
    vertices, faces, _, _ = skimage.measure.marching_cubes(field.astype(np.float32), isovalue, method="lorensen")
    stl = binary_stl(vertices, faces)
    sizes = {"STL": len(stl), "STL + gzip": len(gzip.compress(stl, 9, mtime=0))}
    return Extracted(np.unique(vertices.astype(np.float64), axis=0), sizes, 1e-4)


def binary_stl(vertices: NDArray[Any], faces: NDArray[Any]) -> bytes:
    """80 bytes of title, a count, and for each triangle a normal, three vertices and two spare bytes."""
    record = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("spare", "<u2")])
    triangles = np.zeros(len(faces), record)
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    triangles["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    triangles["vertices"] = corners
    return b"isocodec demo".ljust(80) + np.uint32(len(faces)).tobytes() + triangles.tobytes()


def on_grid_edges(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points that marching cubes has, too: the drawing adds one inside a few cubes to keep the surface manifold."""
    return points[(points % 1 != 0).sum(axis=1) <= 1]


def distance(points: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Largest distance from a point of either set to the nearest of the other, in cells."""
    there, _ = KDTree(others).query(points)
    back, _ = KDTree(points).query(others)
    return float(max(there.max(), back.max()))


@dataclass(frozen=True)
class Result:
    """One item: its files by mode, what other tools make of it, and the decoded points compared with theirs."""

    item: Item
    shape: tuple[int, ...]
    files: dict[str, bytes]
    extracted: Extracted
    points: int
    """Decoded points on grid edges."""
    errors: dict[str, float]
    """Largest distance between them and the extracted points, by mode."""

    @property
    def equal(self) -> bool:
        """Whether the exact file decodes to the extracted points, no more and no fewer."""
        return self.points == len(self.extracted.points) and self.errors["exact"] <= self.extracted.tolerance


def measure(item: Item) -> Result:
    """Encode an item in every mode, decode it, compare."""
    field = item.load()
    extracted = (extract_curve if field.ndim == 2 else extract_surface)(field, item.isovalue)
    files = {}
    errors = {}
    points = 0
    for mode, options in MODES.items():
        files[mode] = isocodec.encode(field, item.isovalue, **options)
        decoded = on_grid_edges(isocodec.decode(files[mode]).points)
        errors[mode] = distance(decoded, extracted.points)
        points = len(decoded)
    return Result(item, field.shape, files, extracted, points, errors)


def summary(results: Sequence[Result]) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table of sizes in bytes; the results are all curves or all surfaces."""
    others = list(results[0].extracted.sizes)
    rows = []
    for result in results:
        row = [result.item.name, f"{result.item.isovalue:g}", f"{result.points:,}"]
        row += [f"{len(result.files[mode]):,}" for mode in MODES]
        row += [f"{result.extracted.sizes[name]:,}" for name in others]
        rows.append(row)
    return ["item", "isovalue", "points", *MODES, *others], rows


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, numbers to the right."""
    lines = [headings, ["---", *["---:"] * (len(headings) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def without_isovalue(headings: list[str], rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """The table without its second column, so that it fits into 80 columns."""
    return [headings[0], *headings[2:]], [[row[0], *row[2:]] for row in rows]


def plain_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="left" if number == 0 else "right")
    for row in rows:
        table.add_row(*row)
    return table


def layer_name(layer: LayerInfo) -> str:
    """What a layer sends, in short."""
    if layer.kind == "values":
        return f"values, bit {layer.plane}"
    if layer.kind == "offsets":
        return f"offsets, 1/{layer.parts} cell"
    return f"{layer.kind} {layer.level}"


def layer_table(result: Result) -> Table:
    """Bytes by layer of the files of one item; layers that a file does not have stay empty."""
    found: dict[str, dict[str, LayerInfo]] = {}
    overhead = {}
    for mode in LAYERED:
        info = inspect(result.files[mode], symbols=True)
        overhead[mode] = info.overhead_bytes
        for layer in info.layers:
            found.setdefault(layer_name(layer), {})[mode] = layer
    rows = []
    for name, by_mode in found.items():
        symbols = sum((next(iter(by_mode.values())).symbols or {}).values())
        rows.append([name, f"{symbols:,}", *(f"{by_mode[m].bytes:,}" if m in by_mode else "" for m in LAYERED)])
    rows.append(["all that is not coded data", "", *(f"{overhead[m]:,}" for m in LAYERED)])
    rows.append(["file", "", *(f"{len(result.files[m]):,}" for m in LAYERED)])
    title = f"{result.item.name}: {' x '.join(map(str, result.shape))} at {result.item.isovalue:g}, bytes by layer"
    return plain_table(title, ["layer", "symbols", *LAYERED], rows)


def run(*arguments: str | Path) -> None:
    """A command of ``isocodec``, shown as one would type it."""
    words = [str(a) for a in arguments]
    print("$ isocodec", *words, flush=True)
    command_line(words, standalone_mode=False)


def leave_files() -> None:
    """Files and pictures, made by the command line."""
    OUT.mkdir(exist_ok=True)
    for item in ITEMS:
        if not item.layers:
            continue
        iso = OUT / f"{item.name}.iso"
        run("encode", item.path, "-o", iso, "--isovalue", f"{item.isovalue:g}")
        run("plot", iso, "-o", OUT / f"{item.name}-steps.png")
        run("decode", iso, "-o", OUT / f"{item.name}.{'geojson' if item.name == 'terrain' else 'stl'}")
        if item.name != "ct-skin":
            run("decode", iso, "-o", OUT / f"{item.name}.png")


def leave_docs() -> None:
    """The pictures of docs, in few colours: the steps of two files, several isovalues, a map, a smooth drawing."""
    from PIL import Image

    for item in ITEMS:
        if item.name not in ("terrain", "ct-bone"):
            continue
        iso = OUT / f"{item.name}.iso"
        picture = DOCS / f"{item.name}.png"
        OUT.mkdir(exist_ok=True)
        run("encode", item.path, "-o", iso, "--isovalue", f"{item.isovalue:g}")
        run("plot", iso, "-o", picture, "--steps", "4")
        with Image.open(io.BytesIO(picture.read_bytes())) as image:
            image.convert("RGB").quantize(16).save(picture, optimize=True)
    (terrain,) = (item for item in ITEMS if item.name == "terrain")
    steps = ["--isovalue", f"{terrain.isovalue:g}", "--keep-topology", "--precision", "16,4,1,0.25,exact"]
    made = (("contours", ["--interval", "100"], ["decode"]), ("steps", steps, ["plot", "--draw-mesh"]))
    for name, asked, shown in made:
        iso, picture = OUT / f"{name}.iso", DOCS / f"{name}.png"
        run("encode", terrain.path, "-o", iso, *asked)
        run(*shown, iso, "-o", picture)
        with Image.open(io.BytesIO(picture.read_bytes())) as image:
            image.convert("RGB").quantize(32).save(picture, optimize=True)
    placed = "placement=0 0.000833333 -84.414 -0.000833333 0 36.733"
    notes = [word for note in (placed, "crs=EPSG:4326", "unit=m") for word in ("--metadata", note)]
    look = ["--interval", "50", "--title", "Jacksboro fault", "--size", "13"]
    run("plot", terrain.path, "-o", DOCS / "map.png", "--map", *look, *notes)
    with Image.open(io.BytesIO((DOCS / "map.png").read_bytes())) as image:
        small = image.convert("RGB").resize((image.width * 3 // 5, image.height * 3 // 5))
        small.quantize(48).save(DOCS / "map.png", optimize=True)
    with Image.open(io.BytesIO(half_round(terrain))) as image:
        image.convert("RGB").quantize(16).save(DOCS / "half-round.png", optimize=True)
    (skin,) = (item for item in ITEMS if item.name == "ct-skin")
    with Image.open(io.BytesIO(smoothing(skin))) as image:
        image.convert("RGB").quantize(32).save(DOCS / "smooth.png", optimize=True)


def half_round(item: Item) -> bytes:
    """A picture of a file before the last round but one of refinement, half-way through it, and after it."""
    data = isocodec.encode(item.load(), item.isovalue)
    layers = inspect(data, symbols=True).layers
    number = [i for i, layer in enumerate(layers) if layer.kind == "refine"][-3]
    begin, end = (layers[number + more].offset or 0 for more in (0, 1))
    steps = []
    for size in (begin, (begin + end) // 2, end):
        decoder = isocodec.Decoder()
        decoder.feed(data[:size])
        steps.append(StepPanel([decoder.take().contour()], title(size, len(data))))
    return panels_picture(steps)


def title(size: int, total: int) -> str:
    """A title as `isocodec plot` writes it."""
    return f"{size:,} bytes\n{size / total:.1%} of the file"


def smoothing(item: Item) -> bytes:
    """A picture of the signs of a file half-way, smoothed, and of the whole file."""
    data = isocodec.encode(item.load(), item.isovalue)
    layers = inspect(data, symbols=True).layers
    signs = sum(layer.kind != "offsets" for layer in layers)
    steps = [
        StepPanel([isocodec.open(data).contour(layers=signs, smooth=smooth)],
                  title(layers[signs].offset or 0, len(data)))
        for smooth in (False, True)
    ]
    return panels_picture([*steps, StepPanel([isocodec.decode(data)], title(len(data), len(data)))])


def main() -> None:
    """Run the demonstration; ends with 1 if a comparison fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", action="store_true", help="print the tables of docs/comparison.md only")
    parser.add_argument("--docs", action="store_true", help="write the pictures of docs only")
    chosen = parser.parse_args()
    as_markdown = chosen.markdown
    os.chdir(ROOT)
    if chosen.docs:
        leave_docs()
        return
    console = Console()
    started = time.perf_counter()
    if as_markdown:
        results = [measure(item) for item in ITEMS]
    else:
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as processes:
            measured = processes.map(measure, ITEMS)
            leave_files()
            results = list(measured)
        print()
    curves = summary([result for result in results if len(result.shape) == 2])
    surfaces = summary([result for result in results if len(result.shape) == 3])
    failed = [result.item.name for result in results if not result.equal]
    if as_markdown:
        print(markdown(*curves), "", markdown(*surfaces), sep="\n")
    else:
        for result in results:
            if result.item.layers:
                console.print(layer_table(result))
        console.print(plain_table("Curves, sizes in bytes", *without_isovalue(*curves)))
        console.print(f"GeoJSON: the curve of find_contours, with {DECIMALS} decimals.\n")
        console.print(plain_table("Surfaces, sizes in bytes", *without_isovalue(*surfaces)))
        console.print("STL: the surface of marching_cubes, binary, 50 bytes a triangle, vertices repeated.\n")
        modes = list(MODES)
        errors = [[r.item.name, *(f"{r.errors[m]:.2g}" for m in modes), "yes" if r.equal else "NO"] for r in results]
        title = "Largest distance in cells between decoded and extracted points"
        console.print(plain_table(title, ["item", *modes, "equal if exact"], errors))
        console.print(f"\n{time.perf_counter() - started:.0f} s. Pictures and files are in {OUT}/.")
    if failed:
        raise SystemExit(f"the decoded points are not those that scikit-image extracts: {', '.join(failed)}")


if __name__ == "__main__":
    main()
