"""Everything that the frames of a file on a grid have in common (spec clauses 3.3, 3.5, 3.7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType, Profile

from ..field.placement import Placement
from ..field.samples import Samples, mask_field
from ..format.chunks import write_chunk
from ..format.header import Header
from ..format.kinds import LayerKind
from ..grid.lattice.tables import cube_exponent
from ..grid.layers.layer_writer import encoded_mask
from ..grid.layers.plan import Entry
from ..grid.tube.holes import Holes
from ..search import strategy
from ..search.ground_truth import truth_of
from ..search.shared_sides import SharedSides
from ..search.tolerance import HALF, radices
from .container import beginning
from .coordinate_coding import coordinates_payload
from .options import DEFAULT_TOLERANCE, SEARCHED, Options
from .series import Series

Report = Callable[[int, int], object]
"""Called with the number of layers done and the total; during the search for a mesh, with the curves tried and 0."""


@dataclass(frozen=True)
class GridFile:
    """Properties shared by all frames of a file on a grid.

    Attributes
    ----------
    options : Options
    series : Series
    header : Header
    metadata : mapping of str to str
    periodic : tuple of int
        Periodic axes; the fields include the repeated plane of samples that closes each axis.
    gone : (s0, .., sn-1) bool, or None
        Which samples are missing.
    holes : Holes or None
        The missing samples, in the form that decoders have.
    shared : list of bytes
        Chunks of mask and coordinates.
    promised : sequence of float or None
        Distances in cells that the last layers of isovalues promise.
    values : list of entries
        Layers of values that the options ask for.
    fine : float or None
        Distance that crossings on the full grid are stored to; None without crossings.
    searched : float or None
        Distance in cells for which a plan of the frame is searched, if it is.
    free : bool
        Whether crossings may be coded with slack.
    full_level : int
        Level of the full grid.
    geometry : sequence of lists of entries, or None
        Layers after the full grid, for each isovalue, whatever the options are.
    report : callable or None
    """

    options: Options
    series: Series
    header: Header
    metadata: Mapping[str, str]
    periodic: tuple[int, ...]
    gone: NDArray[np.bool_] | None
    holes: Holes | None
    shared: list[bytes]
    promised: Sequence[float | None]
    values: list[Entry]
    fine: float | None
    searched: float | None
    free: bool
    full_level: int
    geometry: Sequence[list[Entry]] | None
    report: Report | None

    @property
    def on_grid(self) -> bool:
        """Whether the options lead to the full grid without fixing the layers in between."""
        o = self.options
        return o.layers.default and o.precision.steps is self.searched is None and not o.keep_topology

    def of_frame(self, fields: Sequence[Samples]) -> GridFile:
        """The file with the search that suits a frame, given at each isovalue."""
        return replace(self, searched=_searched(fields, self.options, bool(self.periodic)))

    @cached_property
    def sides(self) -> SharedSides | None:
        """Both ends of periodic axes, which are described alike; None without such axes."""
        return SharedSides.of_axes(self.header.shape, self.periodic) if self.periodic else None

    def beginning(self) -> list[bytes]:
        """Write the header, and the chunks that concern the whole file."""
        return beginning(self.header, self.metadata, self.shared, self.series.interval)


def grid_file(
    fields: Sequence[Samples], series: Series, options: Options, placement: Placement | None = None,
    geometry: Sequence[list[Entry]] | None = None, promised: Sequence[float | None] | None = None,
    report: Report | None = None,
) -> GridFile:
    """Make a file on a grid: code what concerns all frames, and find once what the options mean for each isovalue.

    Parameters
    ----------
    fields : sequence of Samples
        The first frame at each isovalue, periodic axes closed.
    series : Series
    options : Options
        Complete.
    placement : Placement, optional
    geometry, report
        As of `GridFile`.
    promised : sequence of float or None, optional
        As of `GridFile`, whatever the options are.

    Raises
    ------
    InputError
        If samples cannot have these coordinates.
    """
    first = fields[0]
    shape, gone = first.signs.shape, first.gone
    notes = options.metadata if placement is None else {**options.metadata, **placement.notes(), **options.metadata}
    header = Header(shape, first.isovalue, options.precision.step, options.entropy)
    holes, shared = None, []
    if coordinates := coordinates_payload(placement, shape, gone):
        shared.append(write_chunk(ChunkType.COORDINATES, coordinates, ancillary=True))
    if gone is not None:
        missing = mask_field(gone)
        run, holes = encoded_mask(header, missing, truth_of(missing))
        shared.append(write_chunk(ChunkType.MASK, run))
    precision = options.precision
    if promised is None:
        # under a criterion the mesh keeps to another distance, or to none; a plan has its promises
        promised = [precision.tolerance if options.layers.criterion is None else None] * len(series.isovalues)
    values: list[Entry] = [(LayerKind.VALUES, None)] if precision.exact or precision.step is not None else []
    fine = None if values or precision.signs else precision.offsets or DEFAULT_TOLERANCE
    searched = _searched(fields, options, placement is not None and bool(placement.periodic))
    # smoothed crossings lie in their parts
    free = options.entropy == Profile.MAIN and not precision.smooth and _in_order(series.isovalues, options, fine)
    return GridFile(
        options, series, header, notes, () if placement is None else placement.periodic, gone, holes, shared, promised,
        values, fine, searched, free, len(shape) * cube_exponent(shape), geometry, report,
    )


def _searched(fields: Sequence[Samples], options: Options, periodic: bool) -> float | None:
    """The distance for which a plan is searched: also of single smooth surfaces, which slack at a slant suits."""
    tolerance, alone = options.precision.tolerance, len(fields) == 1 and options.entropy == Profile.MAIN
    if alone and tolerance is not None and SEARCHED <= tolerance < HALF and not (options.precision.smooth or periodic):
        return tolerance if strategy.is_smooth(fields[0].signs) else options.searched
    return options.searched


def _in_order(isovalues: Sequence[float], options: Options, fine: float | None) -> bool:
    """Whether the crossings of several isovalues stay in order if they are coded with slack (docs/encoders.md, 3).

    First digits cannot pass those of the isovalue that is used for prediction, so each isovalue must lie beyond all
    earlier ones.
    """
    if len(isovalues) == 1:
        return True
    before = zip(isovalues[1:], accumulate(isovalues, min), accumulate(isovalues, max), strict=False)
    outward = not any(low < value < high for value, low, high in before)
    return not options.independent and outward and len(radices(fine)) <= 1
