"""Bytes of files in tiles against files of one piece: ``tile_sizes.py TERRAIN.npy ISOVALUE``.

The terrain is reflected four times along each axis to a mosaic of about 4,800 samples a side; the volume is one of
512 samples a side by a formula (`hills`). Tiles of 1024 samples and of 128.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import isocodec


def mosaic(field: NDArray[np.int16], times: int = 4) -> NDArray[np.int16]:
    """A field beside its mirror images, which share a row with it."""
    for axis in range(field.ndim):
        parts = [field if i % 2 == 0 else np.flip(field, axis) for i in range(times)]
        parts = [part if i == 0 else np.delete(part, 0, axis) for i, part in enumerate(parts)]
        field = np.concatenate(parts, axis)
    return field


def hills(side: int) -> NDArray[np.float32]:
    """``sin(x / 9 + sin(z / 31)) + sin(y / 13 + cos(x / 37)) + sin(z / 11 + sin(y / 41))``, in samples."""
    x, y, z = (np.arange(side, dtype=np.float32).reshape([-1 if a == b else 1 for b in range(3)]) for a in range(3))
    a = np.sin(x / 9 + np.sin(z / 31))
    return np.asarray(a + np.sin(y / 13 + np.cos(x / 37)) + np.sin(z / 11 + np.sin(y / 41)), np.float32)


def main() -> None:
    """A line for each field and precision."""
    name, isovalue = sys.argv[1], float(sys.argv[2])
    fields = {"mosaic": (mosaic(np.load(name)), isovalue, 1024), "hills": (hills(512), 0.7, 128)}
    for title, (field, value, tile) in fields.items():
        plane = title == "mosaic"
        for options in (
            {}, {"precision": "signs"}, {"precision": "exact"} if plane else {"precision": "step=0.01"},
            {"precision": 1.0},
        ):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "tiled.iso"
                begun = time.process_time()
                isocodec.save(path, field, value, tile=tile, **options)  # type: ignore[arg-type]
                took = time.process_time() - begun
                tiled = path.stat().st_size
            begun = time.process_time()
            whole = len(isocodec.encode(field, value, **options))  # type: ignore[arg-type]
            other = time.process_time() - begun
            print(
                f"{title} {field.shape} {options}: {tiled:,} bytes in tiles, {whole:,} in one piece, "
                f"{tiled / whole:.3f}; {field.size / took / 1e6:.1f} and {field.size / other / 1e6:.1f} million "
                "samples a second of processor time", flush=True,
            )


if __name__ == "__main__":
    main()
