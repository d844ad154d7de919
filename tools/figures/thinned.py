"""Adaptive thinning: errors and seconds over points, surfaces in the plane and in space, PSNR over bits (rows AT)."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import imagecodecs
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

import isocodec
from figures.corpus import load
from figures.planes import save
from tin_peers import jpeg2000_filling, jpegxl_filling, psnr

CRITERIA = ("AT1", "AT2", "AT3", "inf", "l2", "NAT")
TERRAIN, WINDOW = "terrain/jacksboro_fault_dem", 150
PICTURE = "image/fruits"
SIDE = 192
KEPT = 400
"""Points of the surfaces that are drawn."""
BITS = (0.1, 0.2, 0.4, 0.8)
"""Bits for a pixel."""


def thinned(folder: Path, output: Path) -> None:
    """Errors and seconds of all criteria on a terrain, and what two of them leave, in the plane and in space."""
    values = np.asarray(load(folder, TERRAIN, 0.0).values, np.float64)[:WINDOW, :WINDOW]
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for criterion in CRITERIA:
        began = time.process_time()
        found = isocodec.thin(values, criterion=criterion, to=4)
        seconds = time.process_time() - began
        points = values.size - 1 - np.arange(len(found.order))
        left.loglog(points, np.maximum(found.errors, 1e-3), label=criterion, linewidth=1)
        right.bar(criterion, seconds)
    left.set_xlabel("points that are left")
    left.set_ylabel("largest error")
    left.legend(fontsize=8)
    right.set_ylabel(f"seconds of one processor, {values.size:,} points to 4")
    save(figure, output / "thinning-criteria.png")
    figure = plt.figure(figsize=(11, 9), layout="constrained")
    for row, criterion in enumerate(("AT1", "NAT")):
        found = isocodec.thin(values, criterion=criterion, to=KEPT)
        tin, error = found, float(found.errors[-1])
        flat = figure.add_subplot(2, 2, 2 * row + 1)
        corners = tin.points[tin.triangles][..., ::-1]
        shown = PolyCollection(list(corners), array=tin.values[tin.triangles].mean(axis=1), cmap="terrain",
                               edgecolors="0.3", linewidths=0.3)
        flat.add_collection(shown)
        flat.autoscale()
        flat.invert_yaxis()
        flat.set_aspect("equal")
        flat.set_title(f"{criterion}: {KEPT} of {values.size:,} points, largest error {error:.0f}", fontsize=9)
        space = figure.add_subplot(2, 2, 2 * row + 2, projection="3d")
        y, x = tin.points.T
        space.plot_trisurf(x, -y, tin.values, triangles=tin.triangles, cmap="terrain", linewidth=0.1, edgecolor="0.3")
        space.view_init(45, -60)
    save(figure, output / "thinning-surfaces.png")


def thinned_pictures(folder: Path, output: Path) -> None:
    """PSNR over bits of a picture: coded surfaces, JPEG 2000 and JPEG XL, and what each makes of a fifth of a bit."""
    whole = np.asarray(load(folder, PICTURE, 0.0).values)[:SIDE, :SIDE].astype(np.uint8)
    coders: dict[str, Callable[[int], tuple[int, NDArray[np.float64]]]] = {
        "coded surface": lambda size: _surface(whole, size),
        "JPEG 2000": lambda size: _of(jpeg2000_filling(whole, size), imagecodecs.jpeg2k_decode),
        "JPEG XL": lambda size: _of(jpegxl_filling(whole, size), imagecodecs.jpegxl_decode),
    }
    figure, axes = plt.subplots(1, 4, figsize=(16, 4.2), layout="constrained")
    for place, (name, coder) in enumerate(coders.items()):
        reached = []
        axes[1 + place].set_axis_off()
        for bits in BITS:
            try:
                size, decoded = coder(int(bits * whole.size / 8))
            except NothingFitsError:
                # its headers alone take more
                continue
            reached.append((8 * size / whole.size, psnr(whole, decoded)))
            if bits == BITS[1]:
                axes[1 + place].imshow(decoded, cmap="gray", vmin=0, vmax=255)
                axes[1 + place].set_title(f"{name}: {size:,} bytes, {reached[-1][1]:.2f} dB", fontsize=9)
        if reached:
            axes[0].plot(*np.array(reached).T, marker="o", label=name)
    axes[0].set_xlabel("bits for a pixel")
    axes[0].set_ylabel("PSNR, dB")
    axes[0].legend(fontsize=8)
    save(figure, output / "thinning-pictures.png")


def _surface(whole: NDArray[np.uint8], size: int) -> tuple[int, NDArray[np.float64]]:
    data = isocodec.encode(isocodec.thin(whole.astype(np.float64), size=size))
    return len(data), isocodec.open(data).surface().raster()


class NothingFitsError(Exception):
    """No file of a coder is as small as was asked for."""


def _of(data: bytes, decode: Callable[[bytes], NDArray[np.generic]]) -> tuple[int, NDArray[np.float64]]:
    if not data:
        raise NothingFitsError
    return len(data), np.asarray(decode(data), np.float64)
