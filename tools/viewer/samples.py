"""Files for the viewer's tests and pictures: ``samples.py FOLDER`` writes them there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

import isocodec


def hills(size: int, noise: float) -> np.ndarray:
    """Sums of waves with noise, int32 of shape (size, size)."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0:size, 0:size].astype(float)
    field = np.zeros((size, size))
    for _ in range(40):
        a, b = rng.normal(0, 0.05, 2)
        field += np.sin(a * x + b * y + rng.uniform(0, 6))
    return np.round(field * 40 + rng.normal(0, noise, (size, size))).astype(np.int32)


def gyroid(size: int, turns: float) -> np.ndarray:
    """A surface of handles, float64 of shape (size, size, size)."""
    x, y, z = np.mgrid[0:size, 0:size, 0:size] * (2 * np.pi * turns / size)
    return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)


DATA = Path(__file__).parents[2] / "demo" / "data"


def real(name: str) -> np.ndarray:
    """A field of the demonstration."""
    return np.load(DATA / f"{name}.npz")["values"]


def shown(folder: Path) -> None:
    """Write what the pictures of the gallery show: a map of 42 isovalues, in tiles, too; a surface; a head; a mesh."""
    levels = [240.5 + 20 * k for k in range(42)]
    step = 1 / 1200
    place = [[0, step, -84.4138], [-step, 0, 36.7329]]
    relief = isocodec.Field(real("jacksboro_fault_dem"), placement=place, crs="EPSG:4326", unit="m")
    (folder / "map.iso").write_bytes(isocodec.encode(relief, levels, precision=0.1))
    isocodec.save(folder / "tiles.iso", relief, levels, precision="exact", tile=128)
    (folder / "tin.iso").write_bytes(isocodec.encode(isocodec.thin(relief, to=4000)))
    # slices from the top, rows from the front, in millimetres right, front and up
    body = [[0, 0, -3.2, 0], [0, -3.2, 0, 0], [-1.5, 0, 0, 0]]
    head = isocodec.Field(real("ct_headsq_quarter"), placement=body)
    (folder / "head.iso").write_bytes(isocodec.encode(head, [500.5, 1150.5], precision=0.2))
    rng = np.random.default_rng(4)
    points = rng.uniform(0, 6, (3000, 2))
    values = np.sin(points[:, 0]) * np.cos(1.5 * points[:, 1]) + 0.3 * points[:, 0]
    mesh = isocodec.Mesh(points, Delaunay(points).simplices, values, stored="whole")
    (folder / "mesh.iso").write_bytes(isocodec.encode(mesh, [-0.5, 0, 0.5, 1, 1.5, 2]))


WAVES = ["0 s", "1 s", "1.5 s", "4 s", "5 s", "6 s", "7 s", "7.25 s"]
"""Times of the frames of a series."""


def main() -> None:
    folder = Path(sys.argv[1])
    shown(folder)
    less = isocodec.encode(hills(1000, 60), isovalue=0.5, profile="baseline", precision="exact")
    (folder / "hills.iso").write_bytes(less)
    handles = isocodec.encode(gyroid(80, 5), isovalue=0.0, profile="baseline")
    (folder / "gyroid.iso").write_bytes(handles)
    few = isocodec.encode(gyroid(48, 1.5), isovalue=0.0, profile="baseline")
    (folder / "handles.iso").write_bytes(few)
    frames = [hills(288, 0)[t : t + 192, t : t + 256] for t in range(0, 24, 3)]
    (folder / "waves.iso").write_bytes(isocodec.encode(isocodec.Frames(frames, times=WAVES), [-150, -75, 0.5, 75, 150]))
    noisy = isocodec.encode(hills(1800, 60), isovalue=0.5, profile="baseline", precision="exact")
    (folder / "terrain.iso").write_bytes(noisy)


if __name__ == "__main__":
    main()
