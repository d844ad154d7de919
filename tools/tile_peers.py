"""Files in tiles beside what other tools make of the same blocks: ``tile_peers.py TERRAIN.npy ISOVALUE``.

The fields are those of `tile_sizes.py`, the volume with 256 samples a side in blocks of 64. Blocks share a row of
samples with their neighbours. Of curves, gdal_contour takes a mosaic of GeoTIFF files (a VRT) at once, or each by
itself, and contourpy each block; of surfaces, scikit-image's marching cubes takes each block and Draco packs its mesh.
Seconds are processor time, of all processes. A seam is an end of a line, or a point of an open edge, within the field,
with no other one at the same place: within a ten-millionth of a sample, or within single precision where that is kept.
"""

from __future__ import annotations

import io
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path

import contourpy
import DracoPy
import numpy as np
import rasterio
import rasterio.transform
from numpy.typing import NDArray
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

import isocodec
from tile_sizes import hills, mosaic

SIDE, BLOCK = 256, 64
BITS = 11
"""Of Draco's positions: a unit is a thirtieth of a sample, no more than an isocodec file's tolerance of 0.05 is off."""
SAME = 1e-7
SINGLE = 1e-3
"""The same of numbers in single precision, of some thousand samples."""
Row = tuple[str, float, int, int]
"""What, seconds, bytes, seams."""


def seconds() -> float:
    """Processor time of this process and of those that it has begun and waited for."""
    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def blocks(shape: Sequence[int], block: int) -> Iterator[tuple[slice, ...]]:
    """Blocks that share a row with the next one."""
    yield from product(*([slice(a, min(a + block + 1, s)) for a in range(0, max(s - 1, 1), block)] for s in shape))


def alone(points: NDArray[np.float64], shape: Sequence[int], same: float) -> int:
    """How many of some points within a field have no other one at their place."""
    last = np.array(shape) - 1
    inner = points[((points > same) & (points < last - same)).all(axis=1)]
    if len(inner) < 2:
        return len(inner)
    return int((KDTree(inner).query(inner, k=2)[0][:, 1] > same).sum())


def ends_of(contour: isocodec.Contour) -> NDArray[np.float64]:
    """Points where lines end, or of edges that one triangle has."""
    cells = contour.cells
    if contour.n == 2:
        return contour.points[np.bincount(cells.ravel(), minlength=len(contour.points)) == 1]
    return contour.points[open_points(cells)]


def open_points(cells: NDArray[np.integer]) -> NDArray[np.int64]:
    """Points of edges that one triangle has."""
    edges = np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(found[count == 1])


def of_isocodec(field: NDArray[np.generic], isovalue: float, tile: int, folder: Path) -> Row:
    """A file in tiles, with the default tolerance."""
    begun = seconds()
    isocodec.save(folder / "tiled.iso", field, isovalue, tile=tile)
    took = seconds() - begun
    contour = isocodec.decode(folder / "tiled.iso")
    size = (folder / "tiled.iso").stat().st_size
    return "isocodec encode --tile", took, size, alone(ends_of(contour), field.shape, SAME)


def of_gdal(field: NDArray[np.generic], isovalue: float, block: int, folder: Path) -> Iterator[Row]:
    """gdal_contour, if it is there: on a mosaic, and file by file. Coordinates are samples, y upwards."""
    program = shutil.which("gdal_contour")
    if program is None:
        return
    names = []
    for number, window in enumerate(blocks(field.shape, block)):
        part = field[window]
        place = rasterio.transform.Affine(1, 0, window[1].start - 0.5, 0, -1, 0.5 - window[0].start)
        names.append(folder / f"{number}.tif")
        with rasterio.open(names[-1], "w", driver="GTiff", count=1, dtype=part.dtype.name, height=part.shape[0],
                           width=part.shape[1], transform=place) as file:
            file.write(part, 1)
    whole = folder / "mosaic.vrt"
    begun = seconds()
    subprocess.run(["gdalbuildvrt", "-q", str(whole), *map(str, names)], check=True)
    for title, sources in (("gdal_contour of a VRT", [whole]), ("gdal_contour block by block", names)):
        made = []
        for number, source in enumerate(sources):
            made.append(folder / f"{len(sources)}-{number}.fgb")
            subprocess.run([program, "-q", "-fl", str(isovalue), "-f", "FlatGeobuf", str(source), str(made[-1])],
                           check=True)
        took = seconds() - begun
        ends = [end for name in made for end in gdal_ends(name)]
        # it draws half a sample beyond the first and last ones: that is no end within
        size = sum(name.stat().st_size for name in made)
        yield title, took, size, alone(np.array(ends).reshape(-1, 2)[:, ::-1] * (-1, 1), field.shape, SAME)
        begun = seconds()


def gdal_ends(name: Path) -> Iterator[tuple[float, float]]:
    """Both ends of all open lines of a file."""
    import pyogrio

    for shape in pyogrio.read_dataframe(name).geometry:
        for line in getattr(shape, "geoms", [shape]):
            if line.coords[0] != line.coords[-1]:
                yield line.coords[0]
                yield line.coords[-1]


def of_contourpy(field: NDArray[np.generic], isovalue: float, block: int) -> Row:
    """Lines block by block, as single precision in compressed NPZ."""
    begun = seconds()
    size, ends = 0, []
    for window in blocks(field.shape, block):
        lines = contourpy.contour_generator(z=field[window]).lines(isovalue)
        start = [window[1].start, window[0].start]
        lines = [(line + start).astype(np.float32) for line in lines]
        size += packed(lines)
        ends += [line[[0, -1]] for line in lines if (line[0] != line[-1]).any()]
    took = seconds() - begun
    points = np.concatenate(ends)[:, ::-1].astype(np.float64)
    return "contourpy block by block, NPZ", took, size, alone(points, field.shape, SINGLE)


def packed(arrays: Sequence[NDArray[np.float32]]) -> int:
    """Bytes of arrays as a compressed archive of all of their numbers, and where each ends."""
    buffer = io.BytesIO()
    whole = np.concatenate(arrays) if arrays else np.zeros((0, 2), np.float32)
    np.savez_compressed(buffer, points=whole, ends=np.cumsum([len(a) for a in arrays]))
    return len(buffer.getvalue())


def of_draco(field: NDArray[np.generic], isovalue: float, block: int) -> Row:
    """Marching cubes block by block, each mesh packed by Draco."""
    begun = seconds()
    meshes = []
    for window in blocks(field.shape, block):
        part = field[window]
        if part.min() < isovalue < part.max():
            points, cells, _, _ = marching_cubes(part, isovalue)
            points = points + np.array([w.start for w in window], np.float32)
            meshes.append(DracoPy.encode(points, cells, quantization_bits=BITS, compression_level=10))
    took = seconds() - begun
    ends = []
    for data in meshes:
        mesh = DracoPy.decode(data)
        ends.append(mesh.points[open_points(mesh.faces)])
    points = np.concatenate(ends).astype(np.float64)
    # at the border of the field positions are rounded, too
    inner = points[((points > 0.05) & (points < np.array(field.shape) - 1.05)).all(axis=1)]
    return f"marching cubes block by block, Draco ({BITS} bits)", took, sum(map(len, meshes)), alone(
        inner, field.shape, SINGLE
    )


def main() -> None:
    """A table in Markdown."""
    terrain, isovalue = mosaic(np.load(sys.argv[1])), float(sys.argv[2])
    volume = hills(SIDE)
    print("| field | how | seconds | bytes | seams |\n| --- | --- | ---: | ---: | ---: |")

    def show(title: str, *rows: Row) -> None:
        for what, took, size, seams in rows:
            print(f"| {title} | {what} | {took:.1f} | {size:,} | {seams:,} |", flush=True)

    each: list[Callable[[Path], None]] = [
        lambda folder: show("terrain", of_isocodec(terrain, isovalue, 1024, folder)),
        lambda folder: show("terrain", *of_gdal(terrain, isovalue, 1024, folder)),
        lambda folder: show("terrain", of_contourpy(terrain, isovalue, 1024)),
        lambda folder: show("volume", of_isocodec(volume, 0.7, BLOCK, folder)),
        lambda folder: show("volume", of_draco(volume, 0.7, BLOCK)),
    ]
    for measure in each:
        with tempfile.TemporaryDirectory() as folder:
            measure(Path(folder))


if __name__ == "__main__":
    main()
