"""Vector tiles of curves for web maps: PMTiles, an archive of Mapbox Vector Tiles in Web Mercator.

A tile is 256 pixels wide; at the highest zoom level a pixel is no wider than a sample. Each tile has 4096 units.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.globe import Globe, ragged
from ...errors import OptionError
from ...extras import optional
from ...field.labelling import noun_of
from ...field.reference_system import is_named, to_degrees
from .output_formats import Cost, Output, OutputOptions
from .things import Pyramid

if TYPE_CHECKING:
    from ...drawing.contour import Contour

LAYER = "contours"
"""Usual name of the layer of all tiles."""
EXTENT = 4096
"""Number of units along each side of a tile."""
PIXELS = 256
MOST_ZOOM = 22
BUFFER = 64
"""Width, in units, of the buffer around a tile in which curves continue."""
LONGEST = 1024
"""Largest length of a segment, in units; longer ones are divided."""
ROUNDING = 2
"""Largest distance, in units, by which simplification may move a curve below the highest zoom level."""
MOST_TILES = 1 << 20
"""Largest number of tiles that the highest zoom level of a field may have."""
POLAR, _POLE = 85.06, 89.0
"""Latitudes, in degrees: there are no tiles beyond the first, and curves end at the second."""
_LATTICE = 7
"""Places along each axis at which the distance of samples is measured."""
Key = tuple[int, int, int]
"""Zoom, column and row of a tile."""
Features = list[tuple[float, list[NDArray[np.int32]]]]
"""Isovalues with their lines, in units of a tile."""
AtWidth = Callable[[float], "Contour"]
"""Returns the contour to draw where a pixel is this many samples wide; 1 is the finest."""


def _render(contours: Iterable[Contour], suffix: str, options: OutputOptions) -> bytes:
    """Make the archive of contours that are the same at all zoom levels, apart from simplification."""

    def same(contour: Contour) -> AtWidth:
        return lambda width: contour

    return _render_pyramid(Pyramid(map(same, contours)), suffix, options)


def _render_pyramid(pyramid: Pyramid, suffix: str, options: OutputOptions) -> bytes:
    """Make the archive of isovalues that are drawn as coarsely as each zoom level allows.

    Raises
    ------
    OptionError
        If the reference system of a contour is not known.
    MissingExtraError
    """
    writer = optional("pmtiles.writer", extra="pmtiles", purpose=f"writing {suffix}")
    tiles: dict[Key, Features] = {}
    bounds, most, noun = [], 0, ""
    for at in pyramid.isovalues:
        finest = at(1.0)
        most, noun = zoom_of(finest), noun_of(finest.metadata)
        for zoom in range(most + 1):
            lines = mercator_lines(at(2.0 ** (most - zoom)))
            if zoom == most:
                bounds += [line[:, :2] for line in lines]
            for key, geometry in cut(lines, zoom, 0 if zoom == most else ROUNDING):
                tiles.setdefault(key, []).append((finest.isovalue, geometry))
    # an empty map has one tile, too
    return _archive(writer, tiles or {(0, 0, 0): []}, bounds, most, options.layer or LAYER, noun)


def zoom_of(contour: Contour) -> int:
    """Find the lowest zoom level at which a pixel is no wider than most samples, and a field has few enough tiles."""
    move = to_degrees(_placed(contour).placement)
    lattice = np.stack(np.meshgrid(*(np.linspace(0, size - 2, _LATTICE) for size in contour.shape), indexing="ij"), -1)
    ends = lattice.reshape(-1, 1, 2) + np.array([[0, 0], [1, 0], [0, 1]])
    degrees = move(contour.flat.place(ends.reshape(-1, 2)))
    places = _mercator(degrees).reshape(_LATTICE, _LATTICE, 3, 2)
    for axis in (2, 1, 0):
        places[..., 0] = np.unwrap(places[..., 0], axis=axis, period=1.0)
    inside = (abs(degrees[:, 1].reshape(-1, 3)) < POLAR).all(axis=1)
    steps = np.linalg.norm(places[:, :, 1:] - places[:, :, :1], axis=-1).min(axis=-1).ravel()[inside]
    if not len(steps):
        return 0
    low, high = (f(places.clip([-np.inf, 0], [np.inf, 1]), axis=(0, 1, 2)) for f in (np.min, np.max))
    finest = math.ceil(-math.log2(max(PIXELS * float(np.median(steps)), 0.5**MOST_ZOOM)) - 1e-6)
    while finest > 0 and np.prod(np.ceil((high - low) * 2.0**finest)) > MOST_TILES:
        finest -= 1
    return min(max(finest, 0), MOST_ZOOM)


def mercator_lines(contour: Contour) -> list[NDArray[np.float64]]:
    """Lines of a contour in Web Mercator, (K, 2) each: 0 to 1 southwards; eastwards, too, and beyond."""
    shapely = optional("shapely", extra="pmtiles", purpose="making vector tiles")
    whole = _placed(contour).joined
    globe = Globe.of(whole.placement, whole.placed, whole.cells)
    assert globe is not None
    points, starts = globe.unrolled(*ragged([whole.along(walk) for walk in whole.walks]))
    places = _mercator(points)
    lines = np.split(places, starts[1:-1]) if len(places) else []
    if not len(places) or 0 <= places[:, 1].min() <= places[:, 1].max() <= 1:
        return lines
    west, east = places[:, 0].min(), places[:, 0].max()
    parts = shapely.get_parts(shapely.clip_by_rect([shapely.LineString(line) for line in lines], west, 0, east, 1))
    return [shapely.get_coordinates(part) for part in parts if part.geom_type == "LineString" and not part.is_empty]


def _placed(contour: Contour) -> Contour:
    contour = contour.flat
    if not is_named(contour.placement):
        raise OptionError(
            "vector tiles need to know where the curve lies, but the file has no placement or names no reference "
            "system",
            code="crs", remedy="encode with a placement and --crs EPSG:..",
        )
    return contour


def _mercator(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    latitude = np.radians(np.clip(degrees[:, 1], -_POLE, _POLE))
    south = 0.5 - np.log(np.tan(np.pi / 4 + latitude / 2)) / (2 * np.pi)
    return np.stack([degrees[:, 0] / 360.0 + 0.5, south], axis=1)


def cut(
    lines: list[NDArray[np.float64]], zoom: int, rounding: float
) -> Iterable[tuple[Key, list[NDArray[np.int32]]]]:
    """Yield the tiles of a zoom level with their lines, in units of the tile, (K, 2) each.

    Segments that reach into a tile or its buffer are not clipped, so that no point moves.
    """
    shapely = optional("shapely", extra="pmtiles", purpose="making vector tiles")
    scale = float(EXTENT << zoom)
    points, ends = [], []
    for line in lines:
        units = line * scale
        if rounding:
            thinned = shapely.simplify(shapely.LineString(units), rounding, preserve_topology=False)
            units = shapely.get_coordinates(thinned)
        whole = np.floor(_divided(units) + 0.5).astype(np.int64)
        moved = np.ones(len(whole), np.bool_)
        moved[1:] = (whole[1:] != whole[:-1]).any(axis=1)
        if moved.sum() > 1:
            points.append(whole[moved])
            ends.append(len(points[-1]))
    if not points:
        return
    point = np.concatenate(points)
    start = np.delete(np.arange(len(point)), np.cumsum(ends) - 1)
    low, high = np.minimum(point[start], point[start + 1]), np.maximum(point[start], point[start + 1])
    first, last = (low - BUFFER) // EXTENT, (high + BUFFER) // EXTENT
    found = []
    for column in (0, 1):
        for row in (0, 1):
            tile = first + [column, row]
            inside = (tile <= last).all(axis=1) & (tile[:, 1] >= 0) & (tile[:, 1] < 1 << zoom)
            found.append(np.column_stack([tile[inside], start[inside]]))
    held = np.unique(np.concatenate(found), axis=0)
    # a line continues in a tile as long as its segments are consecutive
    breaks = np.flatnonzero((np.diff(held[:, :2], axis=0) != 0).any(axis=1) | (np.diff(held[:, 2]) != 1)) + 1
    by_tile: dict[Key, list[NDArray[np.int32]]] = {}
    for a, b in zip([0, *breaks.tolist()], [*breaks.tolist(), len(held)], strict=True):
        x, y, at = held[a].tolist()
        line = (point[at : at + b - a + 1] - np.array([x, y]) * EXTENT).astype(np.int32)
        by_tile.setdefault((zoom, x % (1 << zoom), y), []).append(line)
    yield from by_tile.items()


def _divided(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide a line so that no segment is longer than `LONGEST` along an axis."""
    parts = np.maximum(np.ceil(np.abs(np.diff(line, axis=0)).max(axis=1, initial=0) / LONGEST), 1).astype(np.int64)
    if not len(parts) or parts.max() == 1:
        return line
    at = np.repeat(np.arange(len(parts)), parts)
    part = (np.arange(len(at)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[at]
    return np.concatenate([line[at] + part[:, None] * (line[at + 1] - line[at]), line[-1:]])


def _tile(features: Features, name: str, noun: str) -> bytes:
    """Make a tile with one layer, whose features have the isovalue as their only property, named by a noun."""
    shapely = optional("shapely", extra="pmtiles", purpose="making vector tiles")
    encoder = optional("mapbox_vector_tile", extra="pmtiles", purpose="making vector tiles")
    found = [
        {"geometry": shapely.MultiLineString(lines), "properties": {noun: isovalue}}
        for isovalue, lines in features
    ]
    layer = {"name": name, "features": found}
    return bytes(encoder.encode(layer, default_options={"y_coord_down": True, "extents": EXTENT}))


def _archive(
    writer: Any, tiles: dict[Key, Features], lines: list[NDArray[np.float64]], most: int, name: str,
    noun: str,
) -> bytes:
    """Make the archive of tiles, in the order of their numbers."""
    from gzip import compress

    format_ = optional("pmtiles.tile", extra="pmtiles", purpose="writing .pmtiles")
    out = io.BytesIO()
    archive = writer.Writer(out)
    for number, key in sorted((format_.zxy_to_tileid(*key), key) for key in tiles):
        archive.write_tile(number, compress(_tile(tiles[key], name, noun), mtime=0))
    # each line within one turn, or beyond
    points = np.concatenate([line - [np.floor(line[:, 0].min()), 0] for line in lines] or [np.array([[0.5, 0.5]])])
    west, east = (float(f(points[:, 0])) * 360 - 180 for f in (np.min, np.max))
    north, south = (math.degrees(math.atan(math.sinh((0.5 - float(f(points[:, 1]))) * 2 * math.pi)))
                    for f in (np.min, np.max))
    if east > 180:
        west, east = -180.0, 180.0
    header = {
        "tile_compression": format_.Compression.GZIP, "tile_type": format_.TileType.MVT,
        "min_lon_e7": math.floor(west * 1e7), "max_lon_e7": math.ceil(east * 1e7),
        "min_lat_e7": math.floor(south * 1e7), "max_lat_e7": math.ceil(north * 1e7),
    }
    layer = {"id": name, "fields": {noun: "Number"}, "minzoom": 0, "maxzoom": most}
    archive.finalize(header, {"vector_layers": [layer]})
    return out.getvalue()


_SHARED: Any = {
    "suffixes": (".pmtiles",), "title": "PMTiles", "several": (2,), "holds": "a property", "coordinates": "degrees",
    "heights": False, "names_crs": True, "layer": LAYER, "extra": "pmtiles",
    "libraries": ("shapely", "pyproj", "mapbox_vector_tile", "pmtiles.writer"),
    "cost": {2: Cost(480, 150, 1 << 20, kept=300)},
}
OUTPUTS = (Output("contour", render=_render, **_SHARED), Output("pyramid", render=_render_pyramid, **_SHARED))
