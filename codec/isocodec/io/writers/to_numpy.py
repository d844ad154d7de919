"""Arrays of numpy: contours and triangulated surfaces as NPZ, masks, labels and pictures of surfaces as NPY."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...drawing.contour import Contour
from .output_formats import Cost, Output, OutputOptions
from .things import PlacedTin, SampleMask


def _contour_npz(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """Write points in samples, and the placement, if there is one."""
    contour = next(iter(contours))
    arrays: dict[str, Any] = {
        "points": contour.points,
        "cells": contour.cells,
        "isovalue": np.float64(contour.isovalue),
        "shape": np.asarray(contour.shape, dtype=np.int64),
    }
    placement = contour.placement
    if placement is not None and placement.matrix is not None:
        arrays["placement"] = placement.matrix
        arrays["crs"] = np.asarray(placement.crs or "")
    if placement is not None and placement.coordinates is not None:
        arrays["placed"] = contour.placed
    return _saved(arrays)


def _tin_npz(placed: PlacedTin, _: str, __: OutputOptions) -> bytes:
    """Write points with coordinates in the order of the array's axes."""
    tin = placed.tin
    return _saved({
        "points": tin.points, "values": tin.values, "cells": tin.triangles, "placement": placed.placement.matrix,
        "crs": np.asarray(placed.placement.crs or ""), **placed.notes,
    })


def _saved(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _mask_npy(mask: SampleMask, _: str, __: OutputOptions) -> Iterator[bytes]:
    shape, rows = mask.taken()
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": mask.dtype.str, "fortran_order": False, "shape": shape})
    yield head.getvalue()
    for some in rows:
        yield some.tobytes()


def _raster_npy(placed: PlacedTin, _: str, __: OutputOptions) -> bytes:
    """Write a surface resampled on the grid."""
    buffer = io.BytesIO()
    np.save(buffer, placed.tin.raster())
    return buffer.getvalue()


_CURVES_AND_SURFACES = {2: Cost(40, 48), 3: Cost(40, 48)}
OUTPUTS = (
    Output("contour", (".npz",), "NPZ", _contour_npz, (2, 3), coordinates="samples", sampled=False,
           cost=_CURVES_AND_SURFACES),
    Output("tin", (".npz",), "NPZ", _tin_npz, coordinates="samples", sampled=False),
    Output("mask", (".npy",), "NPY", _mask_npy, (2, 3), coordinates="samples"),
    Output("labels", (".npy",), "NPY", _mask_npy, (2, 3), coordinates="samples"),
    Output("tin", (".npy",), "NPY, resampled on the grid", _raster_npy, coordinates="samples"),
)
