"""Coordinates of what is written and read, held against other libraries, and against the tables of docs/formats.md.

The page states for each format by how much a coordinate may differ, as a part of the largest coordinate: "none" or a
number. What is measured is no more than that, and where a number stands, some difference is there.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, ok
from libraries import Late
from written import Y_UP

ezdxf = Late("ezdxf")
geopandas = Late("geopandas")
KDTree = Late("scipy.spatial.KDTree")
shapely = Late("shapely")
trimesh = Late("trimesh")
vtk = Late("vtk")
vtk_to_numpy = Late("vtk.util.numpy_support.vtk_to_numpy")

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
STATED = {
    name: (0.0 if bound == "none" else float(bound), bool(of_size))
    for names, bound, of_size in re.findall(
        r"^\| ([^|]+) \|[^|]+\| (none|[0-9]e-[0-9]+)( of its size)? \|$", PAGE, re.MULTILINE
    )
    for name in re.findall(r"`(\.[a-z0-9.]+)`", names)
}
"""By suffix, what the page says, and whether of the size of the thing or of the largest coordinate."""
UTM = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])
SPACE = np.array([[0.0, 0, -2.1, 400], [0, 1.5, 0, 500], [3.3, 0, 0, 7]])


def holds(suffix: str, found: np.ndarray, expected: np.ndarray) -> None:
    """That the two are the same places, within what the page says."""
    stated, of_size = STATED[suffix]
    scale = np.ptp(expected, axis=0).max() if of_size else np.abs(expected).max()
    there, _ = KDTree(expected).query(found)
    back, _ = KDTree(found).query(expected)
    differ = max(there.max(), back.max()) / scale
    assert differ <= stated
    assert stated == 0 or differ > 0


# ---- Written --------------------------------------------------------------------------------------------------------


def by_geopandas(path: Path) -> np.ndarray:
    read = geopandas.read_parquet if path.suffix == ".parquet" else geopandas.read_file
    return shapely.get_coordinates(read(path).geometry)


def by_json(path: Path) -> np.ndarray:
    lines = [each["geometry"]["coordinates"] for each in json.loads(path.read_text())["features"]]
    return np.concatenate([np.array(line) for line in lines])


def by_ezdxf(path: Path) -> np.ndarray:
    lines = ezdxf.readfile(path).modelspace().query("LWPOLYLINE POLYLINE")
    found = [
        np.array([p[:2] for p in line.get_points()]) if line.dxftype() == "LWPOLYLINE"
        else np.array([v.dxf.location[:2] for v in line.vertices])
        for line in lines
    ]
    return np.concatenate(found)


def by_vtk(path: Path) -> np.ndarray:
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return np.asarray(vtk_to_numpy(reader.GetOutput().GetPoints().GetData()), float)


def by_trimesh(path: Path) -> np.ndarray:
    return np.asarray(trimesh.util.concatenate(trimesh.load_scene(path, process=False).dump()).vertices)


def by_trimesh_turned(path: Path) -> np.ndarray:
    """Coordinates whose y is up."""
    return by_trimesh(path) @ Y_UP


CURVES: dict[str, Callable[[Path], np.ndarray]] = {
    ".geojson": by_json, ".gpkg": by_geopandas, ".fgb": by_geopandas, ".shp": by_geopandas, ".parquet": by_geopandas,
    ".dxf": by_ezdxf, ".vtp": lambda path: by_vtk(path)[:, :2],
}
SURFACES = {
    ".vtp": by_vtk, **dict.fromkeys([".ply", ".stl", ".off", ".obj", ".3mf"], by_trimesh), ".glb": by_trimesh_turned,
}


@pytest.mark.parametrize("suffix", CURVES)
def test_curves_lie_where_they_did(tmp_path: Path, suffix: str) -> None:
    crs = None if suffix == ".geojson" else "EPSG:32631"  # which it does not keep
    isocodec.save(tmp_path / "c.iso", isocodec.Field(HILLS, placement=UTM, crs=crs), 80.5, precision=0.03)
    contour = isocodec.decode(tmp_path / "c.iso")
    ok("decode", tmp_path / "c.iso", "-o", tmp_path / f"c{suffix}")
    holds(suffix, CURVES[suffix](tmp_path / f"c{suffix}"), contour.placed)


@pytest.mark.parametrize("suffix", SURFACES)
def test_surfaces_lie_where_they_did(tmp_path: Path, suffix: str) -> None:
    contour = isocodec.decode(isocodec.encode(isocodec.Field(BALL, placement=SPACE), 55.5))
    isocodec.save(tmp_path / f"c{suffix}", contour)
    holds(suffix, SURFACES[suffix](tmp_path / f"c{suffix}"), contour.placed)
