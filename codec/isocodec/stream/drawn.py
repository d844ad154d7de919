"""Drawings of the decoded state of an isovalue: its contour, its mask, its mesh (spec clause 9)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.drawing import draw, draw_with_ends
from ..drawing.leaves import Leaves
from ..drawing.rows import MaskRows
from ..drawing.smoothing import rounds_of
from ..drawing.snapshot import drawing_bytes, known_rows, leaves_of, state_of
from ..drawing.tessellation import Tessellation, compact, inferred, tessellated
from ..errors import LimitError, OptionError, TruncatedError
from ..field.samples import interval_value
from ..format.header import Header
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..limits import Budget, Limits


def contour_of(
    tube: Tube | None, isovalue: float, header: Header | None, metadata: Mapping[str, str], complete: bool,
    smooth: bool | None, budget: Budget, holes: Holes | None = None, through_holes: bool = False,
) -> Contour:
    """Draw the contour of a tube, empty before a mesh is known; ``through_holes``: also through missing samples.

    ``smooth``: whether points move within their parts, None if as the file's notes ask.
    """
    if header is None:
        return Contour(np.zeros((0, 2)), np.zeros((0, 2), np.int64), float("nan"), (0, 0), False)
    n = len(header.shape)
    if tube is None:
        contour = Contour(np.zeros((0, n)), np.zeros((0, n), np.int64), float("nan"), header.shape, False)
    else:
        # a file asks for it on the full grid, a caller anywhere
        rounds = rounds_of(metadata, smooth) if smooth or tube.full else 0
        leaves = _leaves_of(tube, isovalue, header, budget, holes)
        if through_holes:
            leaves = replace(leaves, whole=None)
        drawn = draw(leaves, complete=complete, smooth=rounds, check=_beside(tube, budget))
        contour = replace(drawn, origin_above=tube.origin_above)
    return replace(contour, metadata=dict(metadata))


def _leaves_of(tube: Tube, isovalue: float, header: Header, budget: Budget, holes: Holes | None) -> Leaves:
    """All that the drawing of a tube needs."""
    budget.check(drawing_bytes(tube))
    return leaves_of(
        tube, isovalue, lambda steps, above: interval_value(isovalue, header.scale, steps, above), holes, listed=False
    )


def _beside(tube: Tube, budget: Budget) -> Callable[[int], None]:
    """Check whether there is room for some bytes beside those of a tube's drawing."""
    return lambda size: budget.check(drawing_bytes(tube) + size)


def ends_of(
    tube: Tube, isovalue: float, header: Header, complete: bool, budget: Budget, holes: Holes | None
) -> tuple[Contour, NDArray[np.int64]]:
    """Draw the contour of a tube; also returns the samples between which its points lie: see `draw_with_ends`."""
    leaves = _leaves_of(tube, isovalue, header, budget, holes)
    contour, ends = draw_with_ends(leaves, complete=complete, check=_beside(tube, budget))
    return replace(contour, origin_above=tube.origin_above), ends


def mask_rows_of(
    tube: Tube | None, received: int, complete: bool, last_first: bool, limits: Limits, budget: Budget
) -> MaskRows:
    """Find which samples lie above, by rows; ``received`` and ``complete``: how much of the file has arrived."""
    if tube is None or not tube.full:
        if not complete:
            raise TruncatedError(
                "too little has been received to know which samples lie above", code="truncated", offset=received,
                clause="9.7", remedy="feed more of the file",
            )
        raise OptionError(
            "the file does not hold which samples lie above: its mesh is coarser than the grid", code="mask",
            remedy="if the file was cut, use the whole file; otherwise encode signs alone, exact values, or with a "
            "tolerance below 0.1",
        )
    _check_samples(tube.shape, limits)
    rows = known_rows(tube, last_first)
    budget.check(rows.bytes)
    return rows


def valid_rows_of(
    mask: Tube | None, header: Header | None, received: int, complete: bool, last_first: bool, limits: Limits,
    budget: Budget,
) -> MaskRows:
    """Find which samples are valid, by rows; ``mask`` is the tube of the mask, or None."""
    if header is None or (mask is None and not complete):
        raise TruncatedError(
            "too little has been received to know which samples are valid", code="truncated", offset=received,
            clause="9.8", remedy="feed more of the file",
        )
    if mask is not None:
        return mask_rows_of(mask, received, complete, last_first, limits, budget)
    _check_samples(header.shape, limits)
    shape = header.shape[::-1] if last_first else header.shape
    return MaskRows(shape, np.zeros((1, len(shape)), np.int32), np.ones(1, np.bool_))


def _check_samples(shape: tuple[int, ...], limits: Limits) -> None:
    """Raise `LimitError` if a mask would have more samples than the limits allow."""
    if math.prod(shape) > limits.samples:
        raise LimitError(
            f"a mask of {math.prod(shape):,} samples, more than {limits.samples:,}",
            code="limit-samples", clause="11.2", remedy="to allow this, raise Limits.samples (--limits samples=..)",
        )


def mesh_of(tube: Tube | None, n: int, budget: Budget) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Positions and simplices of the crossed leaves of a tube's mesh with ``n`` axes."""
    if tube is None:
        return np.zeros((0, n), np.int64), np.zeros((0, n + 1), np.int64)
    budget.check(drawing_bytes(tube, listed=True))
    leaves = leaves_of(tube, 0.0, lambda steps, above: steps)
    return leaves.position.astype(np.int64), leaves.simplices


def tessellation_of(
    tube: Tube | None, isovalue: float, header: Header | None, metadata: Mapping[str, str], complete: bool,
    whole: bool, budget: Budget,
) -> Tessellation:
    """The mesh of a tube, with signs and levels: the mesh of the whole field, or only its crossed leaves."""
    if tube is None or header is None or tube.origin_above is None or (whole and tube.running == "base"):
        raise TruncatedError("too little has been received to know the mesh", code="truncated", clause="4.7")
    budget.check(drawing_bytes(tube, listed=True))
    if whole:
        state = state_of(tube)
        points, cells, levels = tessellated(tube.shape, tube.k, state.level, state.mesh, budget.check)
        above = inferred(points, cells, state.position, state.above, tube.origin_above)
    else:
        leaves = leaves_of(tube, 0.0, lambda steps, above: steps)
        points, above, cells = compact(leaves.position.astype(np.int64), leaves.above, leaves.simplices)
        levels = leaves.levels
    return Tessellation(points, cells, levels, above, isovalue, tube.shape, complete, metadata=dict(metadata))
