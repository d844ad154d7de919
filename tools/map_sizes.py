"""Contour maps of the demo terrain beside the formats of maps, at equal largest error.

All formats get the same lines, those of an exact file: each line simplified (Douglas-Peucker of GEOS) and its points
rounded to parts of a cell, as far as the largest distance of the curves, measured both ways for each isovalue, allows.
Of all roundings the one with the fewest bytes counts. Formats whose library is missing are named.

    python tools/map_sizes.py                 # the tables of the pages, in Markdown
    python tools/map_sizes.py --isovalues 10 --error 0.5
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

import isocodec
from bench.errors import Shape, apart
from bench.lines import quantised, simplified, to_twkb

TERRAIN = Path(__file__).resolve().parent.parent / "demo" / "data" / "jacksboro_fault_dem.npz"
PARTS = (2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Of a cell, that points are rounded to."""
HALVINGS = 7
"""Of the simplification's tolerance, that the largest one within the error is searched by."""

Lines = list[NDArray[np.float64]]
Map = Mapping[float, Lines]
"""Polylines of each isovalue, (K, 2) in index coordinates."""


def main() -> None:
    """Print tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--isovalues", type=int, action="append", help="how many; 10 and 40 if not given")
    parser.add_argument("--error", type=float, action="append", help="in cells; 0.5 and 0.05 if not given")
    chosen = parser.parse_args()
    with np.load(TERRAIN) as arrays:
        field = arrays["values"]
    columns = [(n, e) for e in chosen.error or (0.5, 0.05) for n in chosen.isovalues or (10, 40)]
    found = [sizes(field, count, error) for count, error in columns]
    heads = [f"{count} isovalues, {error:g} cells" for count, error in columns]
    print("| format | " + " | ".join(heads) + " |\n| --- |" + " ---: |" * len(heads))
    for name in found[0]:
        print(f"| {name} | " + " | ".join(f"{column[name]:,}" for column in found) + " |")
    missing = [name for name, (library, _) in FORMATS.items() if not there(library)]
    if missing:
        print("\nNot measured, their libraries are not installed: " + ", ".join(missing))


def sizes(field: NDArray[np.integer], count: int, error: float) -> dict[str, int]:
    """Bytes of each format, of so many isovalues at so large an error."""
    isovalues = evenly(field, count)
    exact = {c.isovalue: c.lines for c in isocodec.open(isocodec.encode(field, isovalues, precision="exact")).contours()}
    data = isocodec.encode(field, isovalues, precision=error)
    ours = {contour.isovalue: contour.lines for contour in isocodec.open(data).contours()}
    assert distance(exact, ours) <= error * 1.001, "the file is farther away than it may be"
    out = {"isocodec": len(data)}
    maps = {parts: within(exact, parts, error) for parts in PARTS if 0.5 / parts < error}
    for name, (library, write) in FORMATS.items():
        if there(library):
            out[name] = min(len(write(lines, parts)) for parts, lines in maps.items() if lines is not None)
    return out


def evenly(field: NDArray[np.integer], count: int) -> list[float]:
    """Isovalues between whole numbers, at even distances."""
    low, high = int(field.min()), int(field.max())
    return [float(low + (high - low) * (2 * k + 1) // (2 * count)) + 0.5 for k in range(count)]


def there(library: str) -> bool:
    """Whether a library is installed."""
    return importlib.util.find_spec(library) is not None


def distance(a: Map, b: Map) -> float:
    """The largest of any isovalue, both ways, in cells."""
    return max(apart(Shape.of_lines(a[value]), Shape.of_lines(b[value]))[1] for value in a)


def within(exact: Map, parts: int, error: float) -> Map | None:
    """The lines with the fewest points that are rounded to parts of a cell and keep to an error; None if none do."""
    best = None
    low, high = 0.0, error
    for step in range(HALVINGS):
        tolerance = (low + high) / 2 if step else high
        found = {value: rounded(simplified(lines, tolerance), parts) for value, lines in exact.items()}
        if distance(exact, found) <= error:
            best, low = found, tolerance
        else:
            high = tolerance
        if low == high:
            break
    return best


def rounded(lines: Lines, parts: int) -> Lines:
    """Points at multiples of a part of a cell."""
    return [quantised(line, parts)[:, ::-1] / parts for line in lines]


# ---- Formats --------------------------------------------------------------------------------------------------------


def brotli(write: Callable[[Map, int], bytes], lines: Map, parts: int) -> bytes:
    """What a web server would make of a file, at the best quality."""
    import brotli

    return bytes(brotli.compress(write(lines, parts), quality=11))


def twkb(lines: Map, parts: int) -> bytes:
    """A multi-line string each; which isovalue it has is not counted."""
    return b"".join(to_twkb(each, parts) for each in lines.values())


def geojson(lines: Map, parts: int) -> bytes:
    """A feature each."""
    decimals = len(str(parts))
    features = [
        {"type": "Feature", "properties": {"isovalue": value}, "geometry": {
            "type": "MultiLineString", "coordinates": [np.round(line[:, ::-1], decimals).tolist() for line in each]}}
        for value, each in lines.items()
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, separators=(",", ":")).encode()


def topojson(lines: Map, parts: int) -> bytes:
    """An object each, on a grid of parts of a cell; isolines share no arcs."""
    from topojson import Topology

    shapes = [shape(each) for each in lines.values()]
    grid = {"scale": [1 / parts, 1 / parts], "translate": [0, 0]}
    names = [f"{value:g}" for value in lines]
    made = Topology(shapes, topology=False, prequantize=False, topoquantize=grid, object_name="isolines")
    return bytes(made.to_json().encode()) + ",".join(names).encode()


def tile(lines: Map, parts: int) -> bytes:
    """One tile, whose units are parts of a cell; a feature each."""
    import mapbox_vector_tile

    features = [
        {"geometry": shapely.transform(shape(each), lambda p: np.round(p * parts)), "properties": {"isovalue": value}}
        for value, each in lines.items()
    ]
    layer = {"name": "isolines", "features": features}
    extent = parts * 1024
    return bytes(mapbox_vector_tile.encode(layer, default_options={"y_coord_down": True, "extents": extent}))


def table(driver: str, suffix: str, lines: Map, parts: int) -> bytes:
    """A row each, without a spatial index."""
    import geopandas

    frame = geopandas.GeoDataFrame({"isovalue": list(lines)}, geometry=[shape(each) for each in lines.values()])
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "'crs' was not provided")
        path = Path(folder, f"map{suffix}")
        frame.to_file(path, driver=driver, engine="pyogrio", SPATIAL_INDEX="NO")
        return path.read_bytes()


def shape(lines: Sequence[NDArray[np.float64]]) -> shapely.MultiLineString:
    """In x and y."""
    return shapely.MultiLineString([line[:, ::-1] for line in lines])


geobuf = partial(table, "FlatGeobuf", ".fgb")
package = partial(table, "GPKG", ".gpkg")
FORMATS: dict[str, tuple[str, Callable[[Map, int], bytes]]] = {
    "TWKB + brotli": ("brotli", partial(brotli, twkb)),
    "MVT": ("mapbox_vector_tile", tile),
    "MVT + brotli": ("mapbox_vector_tile", partial(brotli, tile)),
    "TopoJSON + brotli": ("topojson", partial(brotli, topojson)),
    "GeoJSON + brotli": ("brotli", partial(brotli, geojson)),
    "FlatGeobuf": ("geopandas", geobuf),
    "FlatGeobuf + brotli": ("geopandas", partial(brotli, geobuf)),
    "GeoPackage": ("geopandas", package),
    "GeoPackage + brotli": ("geopandas", partial(brotli, package)),
}
"""By name: the library that has to be there, and what writes a map."""


if __name__ == "__main__":
    main()
