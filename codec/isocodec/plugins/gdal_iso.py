# gdal: DRIVER_NAME = "ISO"
# gdal: DRIVER_SUPPORTED_API_VERSION = [1]
# gdal: DRIVER_DCAP_VECTOR = "YES"
# gdal: DRIVER_DMD_LONGNAME = "Isocontours (isocodec), read-only"
# gdal: DRIVER_DMD_EXTENSIONS = "iso"
# gdal: DRIVER_DMD_OPENOPTIONLIST = "<OpenOptionList><Option name='LAYERS' type='int' description='Decode at most so many layers'/><Option name='MAX_BYTES' type='int' description='Decode at most so many bytes'/><Option name='BANDS' type='boolean' default='NO' description='Add the areas between isovalues as a layer'/></OpenOptionList>"  # noqa: E501
"""Vector driver for GDAL 3.1 or later: ``.iso`` files in ogr2ogr, geopandas, QGIS, MapServer. It only reads.

GDAL finds it in the folder that ``GDAL_PYTHON_DRIVER_PATH`` names, and reads the lines above. Layers are ``lines`` of
curves or ``triangles`` of surfaces; ``areas`` of labels; ``bands`` if asked for; and of files in tiles ``overview``,
with cells at most two pixels wide if the spatial filter is `PIXELS` wide, cut at the borders of tiles.
"""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import blake2b
from itertools import count, product
from typing import Any

import numpy as np
from gdal_python_driver import BaseDataset, BaseDriver, BaseLayer

import isocodec
from isocodec.plugins import has_polygons

PIXELS = 1000
AREAS = dict.fromkeys(("areas", "bands"), "MultiPolygon")
KINDS = {"lines": "LineString", "overview": "LineString", "triangles": "MultiPolygon Z", **AREAS}


def text(points: Any) -> str:
    """Points (K, 2) or (K, 3) in well-known text, each number exact: GDAL 3.6 takes no binary."""
    return "(" + ",".join(" ".join(map(repr, point)) for point in points.tolist()) + ")"


def of_surface(contour: isocodec.Contour) -> str:
    """Triangles of a surface, as polygons: geopandas takes no TIN."""
    corners = contour.placed[contour.placed_cells[:, [0, 1, 2, 0]]]
    return f"MULTIPOLYGON Z ({','.join(f'({text(each)})' for each in corners)})"


def of_areas(geometry: dict[str, Any]) -> str:
    """A GeoJSON ``MultiPolygon``."""
    polygons = [f"({','.join(text(np.array(ring)) for ring in rings)})" for rings in geometry["coordinates"]]
    return f"MULTIPOLYGON ({','.join(polygons)})" if polygons else "MULTIPOLYGON EMPTY"


class Features(BaseLayer):
    """Layer with features of one kind, decoded when they are first asked for; those in tiles, for each view."""

    def __init__(self, file: Any, name: str, view: dict[str, Any]) -> None:
        self.file, self.view, self.kept = file, view, list[dict[str, Any]]()
        self.name, self.fid_name, self.spatial_filter_extent = name, "", None
        self.number: Any = int if file.info.noun == "label" and not any(v % 1 for v in file.isovalues) else float
        kind = "Integer64" if self.number is int else "Real"
        columns = {"lower": kind, "upper": kind} if name == "bands" else {file.info.noun: kind}
        columns |= {"name": "String"} if name != "bands" and "name" in self.empty().columns(1) else {}
        columns |= {"frame": "Integer", "time": "String"} if file.frames > 1 else {}
        self.fields = [{"name": column, "type": kind} for column, kind in columns.items()]
        self.geometry_fields = [{"name": "", "type": KINDS[name], **({"srs": file.crs} if file.crs else {})}]

    def test_capability(self, capability: str) -> bool:
        return capability in (BaseLayer.StringsAsUTF8, BaseLayer.FastGetExtent)

    def extent(self, force_computation: bool) -> list[float] | None:
        """Bounds of all samples; None where GDAL has to look at the features: on meshes and mapped grids."""
        if not self.file.shape or self.file.info.coordinates:
            return None
        corners = self.empty().place(np.array([*product(*((0.0, size - 1.0) for size in self.file.shape))]))
        return [*corners.min(axis=0)[:2], *corners.max(axis=0)[:2]]

    def empty(self) -> isocodec.Contour:
        """A contour of the file without points."""
        none, shape, notes = np.zeros((0, len(self.file.shape) or 2)), self.file.shape, self.file.metadata
        return isocodec.Contour(none, none.astype(int), 0, shape, placement=self.file.placement, metadata=notes)

    def window(self) -> dict[str, Any] | None:
        """Find what the spatial filter needs of a file in tiles, and how fine an overview is; None for nothing."""
        box, view, spans = self.spatial_filter_extent, dict(self.view), [size - 1.0 for size in self.file.shape]
        if box is not None and len(spans) == 2:
            try:
                placed = self.file.placement is not None
                ends = self.file.window_around(box) if placed else [(box[1], box[3]), (box[0], box[2])]
            except isocodec.IsoError:  # no sample lies there
                return None
            view["window"] = [(max(low, 0.0), min(high, last)) for (low, high), last in zip(ends, spans, strict=True)]
            spans = [high - low for low, high in view["window"]]
        if self.name == "overview" and "layers" not in view and max(spans) > PIXELS:
            view["within"] = 2.0 * max(spans) / PIXELS
        return None if min(spans) < 0 else view

    def __iter__(self) -> Iterator[dict[str, Any]]:
        if self.file.kind == "tiles" and self.name not in AREAS:
            return iter(()) if (view := self.window()) is None else self.features(self.file, view)
        if not self.kept:
            self.kept = [*self.features(self.file.whole() if self.file.kind == "tiles" else self.file, self.view)]
        return iter(self.kept)

    def features(self, file: Any, view: dict[str, Any]) -> Iterator[dict[str, Any]]:
        at, masked = count(), self.name in AREAS and file.info.mask_bytes is not None
        view = {**view, "partial": self.name == "overview" or bool(self.view), "through_holes": masked}
        frames = (file.contours(**view, frame=frame) for frame in range(file.frames))
        for frame, contours in enumerate(file.each_tile(**view) if self.name == "overview" else frames):
            more = {"frame": frame, "time": contours[0].metadata.get("time")} if file.frames > 1 else {}
            for fields, geometry in self.parts(contours, file.valid() if masked else None):
                digest = blake2b(f"{fields}{geometry}".encode(), digest_size=7).hexdigest()
                number = int(digest, 16) if file.kind == "tiles" else next(at)  # which a filter does not change
                yield {"type": "OGRFeature", "id": number, "fields": fields | more, "geometry_fields": {"": geometry}}

    def parts(self, contours: list[isocodec.Contour], valid: Any) -> Iterator[tuple[dict[str, Any], str]]:
        """Fields and geometry of each feature of a frame or tile; ``valid`` samples, if some are missing."""
        if self.name == "bands":
            for band in isocodec.bands(contours, valid=valid):
                yield {"lower": band.lower, "upper": band.upper}, of_areas(band.geometry)
            return
        for contour in contours:
            fields = {key: row[0] if key == "name" else self.number(row[0]) for key, row in contour.columns(1).items()}
            if self.name == "triangles":
                yield fields, of_surface(contour)
            elif self.name == "areas":
                yield fields, of_areas(contour.areas(valid=valid))
            else:
                whole = contour.joined
                yield from ((fields, f"LINESTRING {text(whole.along(walk))}") for walk in whole.walks)


class Dataset(BaseDataset):
    def __init__(self, file: isocodec.IsoFile, options: dict[str, str]) -> None:
        view = {key.lower(): int(options[key]) for key in ("LAYERS", "MAX_BYTES") if key in options}
        curves = file.kind == "mesh" or len(file.shape) == 2
        names = [*(["overview"] if file.kind == "tiles" else []), "lines" if curves else "triangles"]
        wanted = "areas" if file.info.noun == "label" else "bands"
        if curves and (wanted == "areas" or options.get("BANDS", "NO").upper() in ("YES", "TRUE", "ON", "1")):
            names += [wanted] if has_polygons() else []
        self.file, self.layers = file, [Features(file, name, view) for name in names]

    def metadata(self, domain: str | None) -> Any:
        return None if domain else self.file.metadata


class Driver(BaseDriver):
    def identify(self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None) -> bool:
        """Look at the first bytes: images of optical discs have the same suffix."""
        return first_bytes[:4] in (b"\x89ISO", b"\x89IST")

    def open(self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None) -> Dataset | None:
        if not self.identify(filename, first_bytes, open_flags):
            return None
        return Dataset(isocodec.open(filename.removeprefix("/vsicurl/")), dict(open_options or {}))
