"""Plugin for napari (npe2; ``napari.yaml`` beside it): reads ``.iso`` files, and makes them of images.

A file opens as Shapes (curves) or Surface, a layer for each isovalue; a file of labels as Labels; a series with time as
its first axis. All lie in samples, as an image of the field does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import isocodec

Layer = tuple[Any, dict[str, Any], str]


def get_reader(path: str | list[str]) -> Callable[[Any], list[Layer]] | None:
    """Return the reader of a path; None for several, and for files that are not ``.iso`` files."""
    return layers_of if isinstance(path, str) and path.lower().endswith(".iso") else None


def layers_of(path: str) -> list[Layer]:
    """Read all isovalues, or the labels, of all frames."""
    file = isocodec.open(path)
    if file.info.noun == "label" and file.kind != "mesh":
        frames = [file.labels(frame=frame) for frame in range(file.frames)] if file.frames > 1 else [file.labels()]
        labels = np.stack(frames) if file.frames > 1 else frames[0]
        return [(labels.astype(int), {"name": "labels", "metadata": file.metadata}, "labels")]
    if file.frames == 1:
        return [contour.to_napari() for contour in file.contours(partial=True)]
    layers = []
    for contours in zip(*file.each_frame(partial=True), strict=True):
        each = [contour.to_napari() for contour in contours]
        _, about, kind = each[0]
        if kind == "shapes":
            data: Any = [np.insert(line, 0, t, axis=1) for t, (lines, _, _) in enumerate(each) for line in lines]
        else:
            first = np.cumsum([0, *(len(points) for (points, _, _), _, _ in each)])
            data = (np.concatenate([np.insert(mesh[0], 0, t, axis=1) for t, (mesh, _, _) in enumerate(each)]),
                    np.concatenate([mesh[1] + start for (mesh, _, _), start in zip(each, first, strict=False)]),
                    np.concatenate([mesh[2] for mesh, _, _ in each]))
        layers.append((data, about, kind))
    return layers


def placed(meta: dict[str, Any], n: int) -> np.ndarray:
    """Placement (n, n + 1) of a layer of n axes, x along the last one: scaled, sheared, turned and moved as it is."""
    shear = np.eye(n)
    shear[np.triu_indices(n, 1)] = meta.get("shear", 0.0)
    linear = np.asarray(meta.get("rotate", np.eye(n))) @ shear * np.asarray(meta.get("scale", np.ones(n)))
    whole = np.eye(n + 1)
    whole[:n] = np.column_stack([linear, meta.get("translate", np.zeros(n))])
    return (np.asarray(meta.get("affine", np.eye(n + 1))) @ whole)[:n][::-1]


def write_image(path: str, data: Any, meta: dict[str, Any]) -> list[str]:
    """Write the isosurface of an image half-way between its contrast limits."""
    values = np.asarray(data)
    low, high = meta.get("contrast_limits") or (np.nanmin(values), np.nanmax(values))
    if not np.nanmin(values) <= (isovalue := (float(low) + float(high)) / 2) < np.nanmax(values):
        raise ValueError(f"the image does not cross {isovalue:g}, the middle of its contrast limits: move these")
    isocodec.save(path, isocodec.Field(values, placement=placed(meta, values.ndim)), isovalue)
    return [path]


def write_labels(path: str, data: Any, meta: dict[str, Any]) -> list[str]:
    """Write labels."""
    values = np.asarray(data)
    isocodec.save(path, isocodec.Field(values, placement=placed(meta, values.ndim), labels="all"))
    return [path]
