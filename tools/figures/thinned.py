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
TERRAIN = "terrain/jacksboro_fault_dem"
PICTURES = ("image/camera", "image/fruits")
SURVEY, KEPT = 23_092, 1_092
"""Points of the paper's terrain, and how many it keeps."""
BITS = (0.1, 0.185, 0.4)
"""Bits for a pixel; the paper's picture of this size has the second."""


def thinned(folder: Path, output: Path) -> None:
    """AT: errors and seconds of all criteria on a terrain, and what two of them leave, in the plane and in space."""
    values = np.asarray(load(folder, TERRAIN, 0.0).values, np.float64)
    survey(values)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    kept = {}
    for criterion in CRITERIA:
        began = time.process_time()
        found = isocodec.thin(values, criterion=criterion, to=4)
        seconds = time.process_time() - began
        points = values.size - 1 - np.arange(len(found.order))
        left.loglog(points, np.maximum(found.errors, 1e-3), label=criterion, linewidth=1)
        right.bar(criterion, seconds)
        kept[criterion] = float(found.errors[points == KEPT][0])
        print(f"thinned, {criterion}: {values.size:,} points to {KEPT:,}: largest error {kept[criterion]:.2f}, to 4: "
              f"{seconds:.1f} s")
    left.set_xlabel("points that are left")
    left.set_ylabel("largest error")
    left.legend(fontsize=8)
    right.set_ylabel(f"seconds of one processor, {values.size:,} points to 4")
    save(figure, output / "thinning-criteria.png")
    figure = plt.figure(figsize=(11, 9), layout="constrained")
    for row, criterion in enumerate(("AT1", "NAT")):
        tin = isocodec.thin(values, criterion=criterion, to=KEPT)
        flat = figure.add_subplot(2, 2, 2 * row + 1)
        corners = tin.points[tin.triangles][..., ::-1]
        shown = PolyCollection(list(corners), array=tin.values[tin.triangles].mean(axis=1), cmap="terrain",
                               edgecolors="0.3", linewidths=0.3)
        flat.add_collection(shown)
        flat.autoscale()
        flat.invert_yaxis()
        flat.set_aspect("equal")
        title = f"{criterion}: {KEPT:,} of {values.size:,} points, largest error {kept[criterion]:.0f}"
        flat.set_title(title, fontsize=9)
        space = figure.add_subplot(2, 2, 2 * row + 2, projection="3d")
        y, x = tin.points.T
        space.plot_trisurf(x, -y, tin.values, triangles=tin.triangles, cmap="terrain", linewidth=0.1, edgecolor="0.3")
        space.view_init(45, -60)
    save(figure, output / "thinning-surfaces.png")


def survey(values: NDArray[np.float64]) -> None:
    """Print errors of all criteria on as many scattered points of a terrain as the paper has."""
    chosen = np.sort(np.random.default_rng(0).choice(values.size, SURVEY, replace=False))
    points = np.stack(np.unravel_index(chosen, values.shape), axis=1).astype(float)
    for criterion in CRITERIA:
        began = time.process_time()
        found = isocodec.thin(isocodec.Mesh(points, None, values.ravel()[chosen]), criterion=criterion, to=KEPT)
        print(f"thinned, {criterion}: {SURVEY:,} scattered points to {KEPT:,}: largest error {found.errors[-1]:.2f}, "
              f"{time.process_time() - began:.1f} s")


def thinned_pictures(folder: Path, output: Path) -> None:
    """AT: PSNR over bits of pictures of 512 x 512: coded surfaces, JPEG 2000, JPEG XL (a minute for each surface)."""
    for name in PICTURES:
        item = load(folder, name, 0.0)
        _picture(np.asarray(item.values, np.uint8), item.short, output)


def _picture(whole: NDArray[np.uint8], name: str, output: Path) -> None:
    """Draw and print what each coder makes of a picture."""
    coders: dict[str, Callable[[int], tuple[int, NDArray[np.float64]]]] = {
        "coded surface": lambda size: _surface(whole, size),
        "JPEG 2000": lambda size: _of(jpeg2000_filling(whole, size), imagecodecs.jpeg2k_decode),
        "JPEG XL": lambda size: _of(jpegxl_filling(whole, size), imagecodecs.jpegxl_decode),
    }
    figure, axes = plt.subplots(1, 4, figsize=(16, 4.2), layout="constrained")
    for place, (coder_name, coder) in enumerate(coders.items()):
        reached = []
        axes[1 + place].set_axis_off()
        for bits in BITS:
            began = time.perf_counter()
            try:
                size, decoded = coder(int(bits * whole.size / 8))
            except NothingFitsError:
                print(f"thinned-pictures, {name}, {coder_name}: nothing fits {bits:g} bits a pixel")
                continue
            seconds = time.perf_counter() - began
            reached.append((8 * size / whole.size, psnr(whole, decoded)))
            print(f"thinned-pictures, {name} {whole.shape}, {coder_name}: {size:,} bytes, {reached[-1][0]:.3f} bits a "
                  f"pixel, {reached[-1][1]:.2f} dB, {seconds:.0f} s")
            if bits == BITS[1]:
                axes[1 + place].imshow(decoded, cmap="gray", vmin=0, vmax=255)
                axes[1 + place].set_title(f"{coder_name}: {size:,} bytes, {reached[-1][1]:.2f} dB", fontsize=9)
        if reached:
            axes[0].plot(*np.array(reached).T, marker="o", label=coder_name)
    axes[0].set_xlabel("bits for a pixel")
    axes[0].set_ylabel("PSNR, dB")
    axes[0].legend(fontsize=8)
    save(figure, output / f"thinning-{name}.png")


def _surface(whole: NDArray[np.uint8], size: int) -> tuple[int, NDArray[np.float64]]:
    """Bytes of a coded surface, and the picture that it gives."""
    data = isocodec.encode(isocodec.thin(whole.astype(np.float64), size=size))
    return len(data), isocodec.open(data).surface().raster()


class NothingFitsError(Exception):
    """No file of a coder is as small as was asked for."""


def _of(data: bytes, decode: Callable[[bytes], NDArray[np.generic]]) -> tuple[int, NDArray[np.float64]]:
    """Bytes of a file of another format, and the picture in it."""
    if not data:
        raise NothingFitsError
    return len(data), np.asarray(decode(data), np.float64)
