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


class Features(BaseLayer):
    """Layer with features of one kind, decoded when they are first asked for; those in tiles, for each view."""

    def __init__(self, file: isocodec.IsoFile, name: str, view: dict[str, Any]) -> None:
        self.file, self.view = file, view
        self.kept: list[dict[str, Any]] | None = None
        self.name, self.fid_name, self.spatial_filter_extent = name, "", None
        columns = {"lower": "Real", "upper": "Real"} if name == "bands" else {file.info.noun: "Real"}
        if name != "bands" and "name" in self.empty().columns(1):
            columns["name"] = "String"
        if file.frames > 1:
            columns |= {"frame": "Integer", "time": "String"}
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
        shape = self.file.shape
        if not shape or self.file.info.coordinates:
            return None
        return self.empty().place(np.array(list(product(*((0.0, size - 1.0) for size in shape)))))

    def empty(self) -> isocodec.Contour:
        """A contour of the file without points."""
        n, file = len(self.file.shape) or 2, self.file
        return isocodec.Contour(np.zeros((0, n)), np.zeros((0, n), int), 0.0, file.shape, placement=file.placement,
                                metadata=file.metadata)

    def window(self) -> dict[str, Any] | None:
        """Find what the spatial filter needs of a file in tiles, and how fine an overview is; None for nothing."""
        view: dict[str, Any] = {}
        window = [(0.0, size - 1.0) for size in self.file.shape]
        if (box := self.spatial_filter_extent) is not None and len(window) == 2:
            if self.file.placement is None:
                window = [(max(low, 0.0), min(high, last))
                          for low, high, (_, last) in zip(box[1::-1], box[:1:-1], window, strict=True)]
                if any(low > high for low, high in window):
                    return None
            else:
                try:
                    window = self.file.window_around(box)
                except isocodec.IsoError:  # no sample lies there
                    return None
            view["window"] = window
        if self.name == "overview":
            view["within"] = max(max(end - start for start, end in window) / PIXELS, 1.0)
        return view

    def __iter__(self) -> Iterator[dict[str, Any]]:
        if self.file.kind == "tiles":
            return iter(()) if (view := self.window()) is None else self.features(**view)
        if self.kept is None:
            self.kept = list(self.features())
        return iter(self.kept)

    def features(self, **view: Any) -> Iterator[dict[str, Any]]:
        numbers, view = count(), {**self.view, **view, "partial": True}
        view["through_holes"] = self.name in ("areas", "bands") and self.file.info.mask_bytes is not None
        for frame in range(self.file.frames):
            contours = self.file.contours(**{key: value for key, value in {**view, "frame": frame}.items() if value})
            more = {"frame": frame, "time": contours[0].metadata.get("time")} if self.file.frames > 1 else {}
            for fields, geometry in self.parts(contours):
                yield {"type": "OGRFeature", "id": next(numbers), "fields": {**fields, **more},
                       "geometry_fields": {"": geometry}}

    def parts(self, contours: list[isocodec.Contour]) -> Iterator[tuple[dict[str, Any], str]]:
        """Fields and geometry of each feature of a frame."""
        valid = None
        if self.name in ("areas", "bands") and self.file.info.mask_bytes is not None:
            valid = self.file.valid()
        if self.name == "bands":
            for band in isocodec.bands(contours, valid=valid):
                yield {"lower": band.lower, "upper": band.upper}, of_areas(band.geometry)
            return
        for contour in contours:
            fields = {name: rows[0] if name == "name" else float(rows[0]) for name, rows in contour.columns(1).items()}
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
        self.file, self.layers = file, [Features(file, name, view) for name in names]

    def metadata(self, domain: str | None) -> dict[str, str] | None:
        return None if domain else self.file.metadata


class Driver(BaseDriver):
    def identify(self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None) -> bool:
        """Look at the first bytes: images of optical discs have the same suffix."""
        return first_bytes[:4] in (b"\x89ISO", b"\x89IST")

    def open(
        self, filename: str, first_bytes: bytes, open_flags: int, open_options: Any = None
    ) -> Dataset | None:
        if not self.identify(filename, first_bytes, open_flags):
            return None
        return Dataset(isocodec.open(filename.removeprefix("/vsicurl/")), dict(open_options or {}))
