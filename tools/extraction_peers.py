"""The same contours by several tools: their length or area, points, seconds and bytes, side by side.

Measured is what is installed: contourpy, scikit-image, VTK, and gdal_contour on the path; the others are named. Data
are those of the demonstration. Seconds are the best of five, of a program with its start and its files. Bytes are those
of the format in which a tool's contours are kept: .iso files with --exact; VTP as VTK writes it by default; FlatGeobuf
of gdal_contour; points and cells in single precision as compressed NPZ where a tool writes none.

    python tools/extraction_peers.py          # the tables of the page, in Markdown
"""

from __future__ import annotations

import importlib.util
import io
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

import isocodec

DATA = Path(__file__).resolve().parent.parent / "demo" / "data"
CURVES = (("terrain", "jacksboro_fault_dem", 500.5), ("coins", "coins", 107.5))
SURFACES = (("ct-bone", "ct_headsq_quarter", 1150.5), ("ct-skin", "ct_headsq_quarter", 500.5))
REPEAT = 5

Field = NDArray[np.float32]


@dataclass(frozen=True)
class Found:
    """Points (P, n) in index coordinates, segments or triangles (M, n) of them, and how to write them down."""

    points: NDArray[np.float64]
    cells: NDArray[np.integer]
    write: Callable[[], bytes]

    @property
    def size(self) -> float:
        """Length or area, in cells or their squares."""
        corners = self.points[self.cells]
        u = corners[:, 1] - corners[:, 0]
        if corners.shape[1] == 2:
            return float(np.linalg.norm(u, axis=1).sum())
        return float(np.linalg.norm(np.cross(u, corners[:, 2] - corners[:, 0]), axis=1).sum() / 2)


def main() -> None:
    """Print tables."""
    for items, tools, size in ((CURVES, OF_CURVES, "length"), (SURFACES, OF_SURFACES, "area")):
        print(f"| item | tool | points | {size} | farthest point, cells | seconds | bytes |")
        print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
        for name, file, isovalue in items:
            with np.load(DATA / f"{file}.npz") as arrays:
                field = arrays["values"]
            ours: Found | None = None
            for tool, (there, extract) in tools.items():
                if not there():
                    continue
                seconds, found = best(lambda: extract(field, isovalue))  # noqa: B023 - called at once
                ours = ours or found
                row = [name, tool, f"{count_points(found):,}", f"{found.size:,.1f}", f"{farthest(ours, found):.2g}",
                       f"{seconds:.3f}", f"{len(found.write()):,}"]
                print("| " + " | ".join(row) + " |")
        print()
    tools = {**OF_CURVES, **OF_SURFACES}
    missing = [tool for tool, (there, _) in tools.items() if not there()]
    if missing:
        print("Not measured, not installed: " + ", ".join(missing))


def best(work: Callable[[], Found]) -> tuple[float, Found]:
    """Shortest of several times in seconds, and what was found."""
    shortest = float("inf")
    for _ in range(REPEAT):
        started = time.perf_counter()
        found = work()
        shortest = min(shortest, time.perf_counter() - started)
    return shortest, found


def count_points(found: Found) -> int:
    """Different places."""
    return len(np.unique(np.round(found.points, 4), axis=0))


def farthest(a: Found, b: Found) -> float:
    """Distance of a point of either to the nearest of the other, the largest."""
    there, _ = KDTree(a.points).query(b.points)
    back, _ = KDTree(b.points).query(a.points)
    return float(max(there.max(), back.max()))


def joined(lines: list[NDArray[Any]], write: Callable[[], bytes] | None = None) -> Found:
    """Polylines, each with its points."""
    points = np.concatenate(lines).astype(float)
    ends = np.cumsum([len(line) for line in lines])
    starts = np.setdiff1d(np.arange(len(points) - 1), ends - 1)
    cells = np.stack([starts, starts + 1], axis=1)
    return Found(points, cells, write or (lambda: arrays_of(points, cells)))


def arrays_of(points: NDArray[Any], cells: NDArray[Any]) -> bytes:
    """Points in single precision and numbers of points, compressed."""
    file = io.BytesIO()
    np.savez_compressed(file, points=points.astype(np.float32), cells=cells.astype(np.int32))
    return file.getvalue()


def installed(library: str) -> Callable[[], bool]:
    """Whether a library can be imported."""
    return lambda: importlib.util.find_spec(library) is not None


# ---- Tools ----------------------------------------------------------------------------------------------------------


def ours(field: NDArray[Any], isovalue: float) -> Found:
    """Encoded and decoded."""
    data = isocodec.encode(field, isovalue, precision="exact")
    contour = isocodec.decode(data)
    return Found(contour.points, contour.cells, lambda: data)


def contourpy_lines(field: NDArray[Any], isovalue: float) -> Found:
    import contourpy

    lines = contourpy.contour_generator(z=field.astype(float)).lines(isovalue)
    return joined([np.asarray(line)[:, ::-1] for line in lines])


def skimage_lines(field: NDArray[Any], isovalue: float) -> Found:
    from skimage.measure import find_contours

    return joined(find_contours(field.astype(float), isovalue))


def skimage_surface(field: NDArray[Any], isovalue: float) -> Found:
    from skimage.measure import marching_cubes

    points, cells, _, _ = marching_cubes(field.astype(np.float32), isovalue)
    return Found(points.astype(float), cells, lambda: arrays_of(points, cells))


def vtk_contour(field: NDArray[Any], isovalue: float) -> Found:
    """Flying edges; of samples in single precision."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    image = vtk.vtkImageData()
    image.SetDimensions(*field.shape[::-1], *[1] * (3 - field.ndim))
    image.GetPointData().SetScalars(numpy_to_vtk(field.astype(np.float32).ravel(), deep=True))
    edges = vtk.vtkFlyingEdges2D() if field.ndim == 2 else vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, isovalue)
    if field.ndim == 3:
        edges.ComputeNormalsOff()
    edges.Update()
    output = edges.GetOutput()
    cells = output.GetLines() if field.ndim == 2 else output.GetPolys()
    points = vtk_to_numpy(output.GetPoints().GetData()).astype(float)[:, : field.ndim][:, ::-1]
    return Found(points, vtk_to_numpy(cells.GetConnectivityArray()).reshape(-1, field.ndim), lambda: vtp(output))


def vtp(output: Any) -> bytes:
    import vtk

    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputData(output)
    writer.WriteToOutputStringOn()
    writer.Update()
    return str(writer.GetOutputString()).encode("latin-1", "replace")


def gdal_lines(field: NDArray[Any], isovalue: float) -> Found:
    """Points of gdal_contour lie half a cell on from samples, which are middles of pixels there."""
    import geopandas
    import shapely

    with tempfile.TemporaryDirectory() as folder:
        # the plainest raster that gdal reads: a header and bytes
        values = Path(folder, "values.bin")
        field.astype("<f4").tofile(values)
        rows, columns = field.shape
        about = {"samples": columns, "lines": rows, "bands": 1, "data type": 4, "interleave": "bsq", "byte order": 0}
        Path(folder, "values.hdr").write_text("ENVI\n" + "".join(f"{k} = {v}\n" for k, v in about.items()))
        out = Path(folder, "out.fgb")
        command = ["gdal_contour", "-q", "-f", "FlatGeobuf", "-lco", "SPATIAL_INDEX=NO", "-fl", f"{isovalue}"]
        subprocess.run([*command, str(values), str(out)], check=True, capture_output=True)
        data = out.read_bytes()
        lines = geopandas.read_file(out).geometry
    arrays = [shapely.get_coordinates(line)[:, ::-1] for line in lines]
    return joined([np.stack([abs(line[:, 0]) - 0.5, line[:, 1] - 0.5], axis=1) for line in arrays], lambda: data)


OF_CURVES: dict[str, tuple[Callable[[], bool], Callable[[NDArray[Any], float], Found]]] = {
    "isocodec, encoding and decoding": (lambda: True, ours),
    "contourpy": (installed("contourpy"), contourpy_lines),
    "scikit-image": (installed("skimage"), skimage_lines),
    "VTK, flying edges": (installed("vtk"), vtk_contour),
    "gdal_contour": (lambda: shutil.which("gdal_contour") is not None, gdal_lines),
}
OF_SURFACES = {
    "isocodec, encoding and decoding": (lambda: True, ours),
    "scikit-image": (installed("skimage"), skimage_surface),
    "VTK, flying edges": (installed("vtk"), vtk_contour),
}
"""Tools by name: whether they are there, and what they extract; the first one is what points are compared with."""


if __name__ == "__main__":
    main()
