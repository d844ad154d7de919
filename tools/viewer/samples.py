"""Files for the viewer's tests and pictures: ``samples.py FOLDER`` writes them there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

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


def main() -> None:
    folder = Path(sys.argv[1])
    noisy = isocodec.encode(hills(1800, 60), isovalue=0.5, profile="baseline", precision="exact")
    (folder / "terrain.iso").write_bytes(noisy)
    less = isocodec.encode(hills(1000, 60), isovalue=0.5, profile="baseline", precision="exact")
    (folder / "hills.iso").write_bytes(less)
    handles = isocodec.encode(gyroid(80, 5), isovalue=0.0, profile="baseline")
    (folder / "gyroid.iso").write_bytes(handles)
    few = isocodec.encode(gyroid(48, 1.5), isovalue=0.0, profile="baseline")
    (folder / "handles.iso").write_bytes(few)
    frames = [hills(288, 0)[t : t + 192, t : t + 256] for t in range(0, 24, 3)]
    (folder / "waves.iso").write_bytes(isocodec.encode(isocodec.Frames(frames), isovalue=0.5))


if __name__ == "__main__":
    main()
