"""Pictures of surfaces, and of curves in space: parallel projection by matplotlib, triangles and segments sorted by
depth, triangles shaded smoothly.

A picture has world coordinates x, y and z, with z upwards; the front is at +y, as for a patient in a volume whose
coordinates are right, front and up. With a placement, these are the coordinates of the file. Without one, axes 0, 1, 2
of the array run down, back and left, since volumes are usually stored slice by slice from the top, and rows of a slice
from the front.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..extras import optional

Points = NDArray[np.float64]

USUAL = "36.25,24.3"
"""Default view: from one side, in front and above."""
_VIEWS = {"front": "0,0", "back": "180,0", "right": "90,0", "left": "-90,0", "top": "0,90", "bottom": "0,-90"}
"""Views by name; right and left are those of the object: +x and -x."""
_LIGHT = np.array([-0.4, 0.5, 1]) / np.sqrt(1.41)
"""Direction to the light, over the viewer's left shoulder."""
_SHADOW, _VEIL = 0.3, 0.35
"""Light in the shadow; opacity of surfaces around another one."""
_BEHIND, _GROUND = 0.3, (0.9, 0.9, 0.9)
"""Strength of the farthest segments of curves; colour of the surface that curves lie on."""


def drawing(module: str) -> Any:
    """Import a module of matplotlib; raises `MissingExtraError`."""
    return optional(f"matplotlib.{module}", extra="plot", purpose="drawing a picture")


def rotation(view: str) -> Points:
    """Matrix (3, 3) of a view, from world coordinates to the right, up and towards the viewer.

    A view is a name, or azimuth (0 at the front, 90 on the side of +x) and elevation in degrees, separated by a comma.
    """
    try:
        azimuth, elevation = np.radians([float(part) for part in _VIEWS.get(view, view).split(",")])
        if not (np.isfinite(azimuth) and abs(elevation) <= np.pi / 2):
            raise ValueError
    except ValueError:
        raise OptionError(f"{view!r} is not a view", code="view",
                          remedy=f"give AZIMUTH,ELEVATION in degrees, or one of {', '.join(_VIEWS)}") from None
    right = np.array([-np.cos(azimuth), np.sin(azimuth), 0])
    towards = np.append(np.cos(elevation) * np.array([np.sin(azimuth), np.cos(azimuth)]), np.sin(elevation))
    return np.stack([right, np.cross(towards, right), towards])


def world(contour: Any) -> Points:
    """Matrix from samples to the world of a picture, where the shortest step has length 1, the longest 100 at most."""
    axes = contour.points.shape[1]
    if contour.placement is None or contour.placement.matrix is None:
        return -np.eye(3)[::-1] if contour.shape and axes == 3 else np.eye(axes)
    matrix = contour.placement.matrix[:, :axes]
    steps = np.linalg.norm(matrix, axis=0)
    return np.asarray(matrix / steps * np.minimum(steps / steps.min(), 100))


def draw_in_space(
    axes: Any, contours: Sequence[Any], colours: Sequence[Any], view: str,
    meshes: Sequence[tuple[Points, NDArray[np.int64]]] = (),
) -> None:
    """Draw surfaces or curves of one field in the box of their samples, and with meshes their triangles.

    The innermost surface is opaque, and those around it are seen through; curves fade towards the back, and lie on the
    triangles of their meshes.
    """
    turn = (rotation(view) @ world(contours[0])).T
    points = np.concatenate([one.points for one in contours])
    sides = [(0, n - 1) for n in contours[0].shape] or zip(points.min(axis=0), points.max(axis=0), strict=True)
    box = np.array([*product(*sides)]) @ turn
    # corners are numbered by their bits
    for a, b in combinations(range(8), 2):
        if a ^ b in (1, 2, 4):
            axes.plot(*box[[a, b], :2].T, color="0.75", linewidth=0.5, zorder=1)
    pairs = [(one, colour) for one, colour in zip(contours, colours, strict=True) if len(one.cells)]
    pairs.sort(key=lambda pair: np.ptp(pair[0].points, axis=0).sum())
    for mesh, cells in meshes if contours[0].n == 2 else ():
        _paint(axes, mesh @ turn, cells, _GROUND, True, False)
    for number, (contour, colour) in enumerate(pairs):
        if contour.n == 2:
            _trace(axes, contour.points @ turn, contour.cells, colour, box[:, 2])
        else:
            _paint(axes, contour.points @ turn, contour.cells, colour, bool(meshes), number > 0)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _trace(axes: Any, points: Points, cells: NDArray[np.int64], colour: Any, depths: Points) -> None:
    """Draw the segments of a curve from back to front, within the depths of a box."""
    ends = points[cells[np.argsort(points[cells, 2].sum(axis=1))]]
    near = (ends[:, :, 2].mean(axis=1) - depths.min()) / max(np.ptp(depths), 1e-300)
    strength = (_BEHIND + (1 - _BEHIND) * near)[:, None]
    axes.add_collection(drawing("collections").LineCollection(
        ends[:, :, :2], colors=1 - strength * (1 - np.array(colour[:3])), linewidths=0.9, capstyle="round", zorder=3,
    ))


def _paint(axes: Any, points: Points, cells: NDArray[np.int64], colour: Any, edges: bool, veil: bool) -> None:
    """Draw the triangles of a surface from back to front, lit by the normals of their corners."""
    cells = cells[np.argsort(points[cells, 2].sum(axis=1))]
    a, b, c = points[cells.T]
    normals = np.zeros_like(points)
    for corner in cells.T:
        np.add.at(normals, corner, np.cross(b - a, c - a))
    # both sides are lit alike, since an open surface shows its inside
    normals *= np.where(normals[:, 2:] < 0, -1, 1) / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    lit = _SHADOW + (1 - _SHADOW) * np.maximum(normals @ _LIGHT, 0)
    shades = drawing("colors").LinearSegmentedColormap.from_list("shades", ["black", colour])
    how = {"triangles": cells, "cmap": shades, "vmin": 0, "vmax": 1, "rasterized": True}
    if edges:
        how |= {"facecolors": lit[cells].mean(axis=1), "edgecolors": "0.3", "linewidth": 0.2}
    drawn = axes.tripcolor(*points.T[:2], *([] if edges else [lit]), shading="flat" if edges else "gouraud", **how)
    if veil:
        # the whole picture is seen through, not each triangle
        drawn.set_agg_filter(lambda image, _: (image * [1, 1, 1, _VEIL], 0, 0))
