# gdal: DRIVER_NAME = "ISO"
# gdal: DRIVER_SUPPORTED_API_VERSION = [1]
# gdal: DRIVER_DCAP_VECTOR = "YES"
# gdal: DRIVER_DMD_LONGNAME = "Isocontours (isocodec), read-only"
# gdal: DRIVER_DMD_EXTENSIONS = "iso"
# gdal: DRIVER_DMD_OPENOPTIONLIST = "<OpenOptionList><Option name='LAYERS' type='int' description='Decode at most so many layers'/><Option name='MAX_BYTES' type='int' description='Decode at most so many bytes'/><Option name='BANDS' type='boolean' default='NO' description='Add the areas between isovalues as a layer'/></OpenOptionList>"  # noqa: E501
"""Vector driver for GDAL 3.1 or later: ``.iso`` files in ogr2ogr, geopandas, QGIS, MapServer. It only reads.

GDAL finds it in the folder that ``GDAL_PYTHON_DRIVER_PATH`` names, and reads the lines above. Layers are ``lines`` of
curves or ``triangles`` of surfaces; ``areas`` of labels; ``bands`` if asked for; and of files in tiles ``overview``,
with lines fine enough for a view of `PIXELS` pixels of the spatial filter. Coordinates are those of the file; without a
placement, x runs along axis 1 and y along axis 0, in samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, product
from typing import Any

import numpy as np
from gdal_python_driver import BaseDataset, BaseDriver, BaseLayer

import isocodec

PIXELS = 1000
KINDS = {"lines": "LineString", "overview": "LineString", "triangles": "MultiPolygon Z",
         "areas": "MultiPolygon", "bands": "MultiPolygon"}


def text(points: Any) -> str:
    """Points (K, 2) or (K, 3) in well-known text, each number exact: GDAL 3.6 takes no binary."""
    return "(" + ",".join(" ".join(map(repr, point)) for point in points.tolist()) + ")"


def of_surface(contour: isocodec.Contour) -> str:
    """Triangles of a surface, as polygons: geopandas takes no TIN."""
    return f"MULTIPOLYGON Z ({','.join(f'({text(each)})' for each in contour.placed[contour.cells[:, [0, 1, 2, 0]]])})"


def of_areas(geometry: dict[str, Any]) -> str:
    """A GeoJSON ``MultiPolygon``."""
    polygons = [f"({','.join(text(np.array(ring)) for ring in rings)})" for rings in geometry["coordinates"]]
    return f"MULTIPOLYGON ({','.join(polygons)})" if polygons else "MULTIPOLYGON EMPTY"


class Layer(BaseLayer):
    """Features of one kind, decoded when they are first asked for; those in tiles, for each view."""

    def __init__(self, file: isocodec.IsoFile, name: str, view: dict[str, Any]) -> None:
        self.file, self.view, self.kept = file, view, None
        self.name, self.fid_name, self.spatial_filter_extent = name, "", None
        columns = {"lower": "Real", "upper": "Real"} if name == "bands" else {file.info.noun: "Real"}
        if file.frames > 1:
            columns["frame"] = "Integer"
        self.fields = [{"name": column, "type": kind} for column, kind in columns.items()]
        self.geometry_fields = [{"name": "", "type": KINDS[name], **({"srs": file.crs} if file.crs else {})}]

    def metadata(self, domain: str | None) -> None:
        """The notes of the file are those of the data set."""

    def test_capability(self, capability: str) -> bool:
        return capability in (BaseLayer.StringsAsUTF8, BaseLayer.FastGetExtent)

    def extent(self, force_computation: bool) -> list[float] | None:
        """Bounds of all samples; None where GDAL has to look at the features: on meshes and mapped grids."""
        corners = self.corners()
        return None if corners is None else [*corners.min(axis=0)[:2], *corners.max(axis=0)[:2]]

    def corners(self) -> np.ndarray | None:
        """Places of the grid's corners, in lexicographic order."""
        shape, placement = self.file.shape, self.file.placement
        if not shape or self.file.info.coordinates or (placement is not None and placement.coordinates is not None):
            return None
        corners = np.array(list(product(*((0.0, size - 1.0) for size in shape))))
        return isocodec.Contour(corners, np.zeros((0, len(shape)), int), 0.0, shape, placement=placement).placed

    def window(self) -> dict[str, Any]:
        """Of a file in tiles, the samples that the spatial filter needs, and how fine an overview has to be."""
        size, wide = np.array(self.file.shape) - 1.0, self.spatial_filter_extent
        window = np.column_stack([np.zeros(len(size)), size])
        corners = self.corners()
        if wide is not None and corners is not None and len(size) == 2:
            steps = (corners[[2, 1]] - corners[0]) / size[:, None]
            asked = np.array(list(product(wide[::2], wide[1::2])))
            places = np.linalg.solve(steps.T, (asked - corners[0]).T)
            window = np.column_stack([np.clip(places.min(axis=1), 0, size), np.clip(places.max(axis=1), 0, size)])
        fine = max(float(np.ptp(window, axis=1).max()) / PIXELS, 1.0)
        return {"window": window.tolist(), **({"within": fine} if self.name == "overview" else {})}

    def __iter__(self) -> Iterator[dict[str, Any]]:
        if self.file.kind == "tiles":
            return self.features(**self.window())
        if self.kept is None:
            self.kept = list(self.features())
        return iter(self.kept)

    def features(self, **view: Any) -> Iterator[dict[str, Any]]:
        numbers, view = count(), {**self.view, **view, "partial": True}
        view["through_holes"] = self.name in ("areas", "bands") and self.file.info.mask_bytes is not None
        for frame in range(self.file.frames):
            more = {"frame": frame} if self.file.frames > 1 else {}
            contours = self.file.contours(**{key: value for key, value in {**view, **more}.items() if value})
            for fields, geometry in self.parts(contours):
                yield {"type": "OGRFeature", "id": next(numbers), "fields": {**fields, **more},
                       "geometry_fields": {"": geometry}}

    def parts(self, contours: list[isocodec.Contour]) -> Iterator[tuple[dict[str, Any], str]]:
        """Fields and geometry of each feature of a frame."""
        noun, valid = self.file.info.noun, None
        if self.name in ("areas", "bands") and self.file.info.mask_bytes is not None:
            valid = self.file.valid()
        if self.name == "bands":
            for band in isocodec.bands(contours, valid=valid):
                yield {"lower": band.lower, "upper": band.upper}, of_areas(band.geometry)
            return
        for contour in contours:
            fields = {noun: float(contour.isovalue)}
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
        names = ["lines"] if curves else ["triangles"]
        if file.kind == "tiles":
            names.insert(0, "overview")
        if curves and file.info.noun == "label":
            names.append("areas")
        elif curves and options.get("BANDS", "NO").upper() in ("YES", "TRUE", "ON", "1"):
            names.append("bands")
        self.file, self.layers = file, [Layer(file, name, view) for name in names]

    def metadata(self, domain: str | None) -> dict[str, str] | None:
        return None if domain else self.file.metadata


class Driver(BaseDriver):
    def identify(self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None) -> bool:
        """By its first bytes: images of optical discs have the same suffix."""
        return first_bytes[:4] in (b"\x89ISO", b"\x89IST")

    def open(
        self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None
    ) -> Dataset | None:
        if not self.identify(filename, first_bytes, open_flags):
            return None
        return Dataset(isocodec.open(filename.removeprefix("/vsicurl/")), dict(open_options or {}))
