"""Make files from what other files hold: their curves on the full grid, as fields to be re-encoded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product, zip_longest

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.decoded_samples import DecodedSamples, near_values, values_of_steps
from ..field.samples import Samples
from ..format.kinds import LayerKind
from ..grid.layers.plan import Entry
from ..grid.tube.decoded import Decoded
from ..search.tolerance import radices_of
from .container import closed
from .decoder import Decoder
from .grid_encoder import GridFrames
from .grid_file import grid_file
from .options import Options
from .series import Series


@dataclass(frozen=True)
class Source:
    """An isovalue of a file.

    Attributes
    ----------
    field : DecodedSamples
    geometry : list of entries
        Layers after the full grid that code the same geometry again.
    """

    field: DecodedSamples
    geometry: list[Entry]


def sources_of(decoder: Decoder, what: str = "the file", *, before: bool = False) -> list[Source]:
    """Sources of all isovalues of a completely decoded frame; ``what`` names the file in messages.

    ``before``: those of the previous frame, while the next one begins.

    Raises
    ------
    OptionError
        If the mesh does not reach every sample, the file has coordinates, or it holds values only in part.
    LimitError
        If it has more samples than the limits allow.
    """
    assert decoder.header is not None
    if decoder.grid.mapped() is not None:
        raise OptionError(f"{what} has coordinates", code="recode", remedy="encode the field itself again")
    gone = ~decoder.grid.valid()
    missing = gone if gone.any() else None
    found = []
    for number, isovalue in enumerate(decoder.isovalues):
        signs = np.ascontiguousarray(decoder.grid.above(number, before=before))
        state = decoder.grid.state(number, before=before)
        assert state is not None
        found.append(source_of(state, Samples(signs, isovalue, signs, decoder.header.scale, missing), what))
    return found


def source_of(state: Decoded, field: Samples, what: str) -> Source:
    """Recover the source of a field from a state on the full grid; of the field, only the signs are used.

    Raises
    ------
    OptionError
        If it stores values or crossings only in part; ``what`` names the file.
    """
    signs, isovalue, scale, gone = field.signs, field.isovalue, field.scale, field.gone
    n = signs.ndim
    in_part = OptionError(f"{what} stores values or crossings only in part", code="recode",
                          remedy="use precision signs, or encode the field itself again")
    if (state.missing >= 0).any():
        beside = beside_crossings(signs, gone)[tuple(state.position.T)]
        if len(state.edge_parts) or (state.missing[beside] > 0).any():
            raise in_part
        steps = np.full(signs.shape, -1, np.int64)
        known = state.missing == 0
        steps[tuple(state.position[known].T)] = state.number[known]
        field = DecodedSamples(
            values_of_steps(signs, isovalue, scale, steps), isovalue, signs, scale, gone, number=steps
        )
        return Source(field, [(LayerKind.VALUES, None)])
    moves = state.edge_high - state.edge_low
    parts = np.unique(state.edge_parts)
    if len(parts) > 1 or (np.abs(moves).sum(axis=1) != 1).any():
        raise in_part
    keys = np.ravel_multi_index(tuple(state.edge_low.T), signs.shape) * n + np.argmax(moves, axis=1)
    order = np.argsort(keys)
    edges, places = keys[order], ((state.edge_number + 0.5) / state.edge_parts)[order]
    values = near_values(signs, isovalue, edges, places)
    field = DecodedSamples(values, isovalue, signs, scale, gone, edges=edges, places=places)
    return Source(field, [(LayerKind.OFFSETS, radix) for radix in radices_of(int(parts[0]))] if len(parts) else [])


def beside_crossings(signs: NDArray[np.bool_], gone: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Samples with an axis neighbour on the other side, along edges of cells without missing corners (5.10.2)."""
    n = signs.ndim
    whole = np.ones([s - 1 for s in signs.shape], np.bool_)
    if gone is not None:
        for corner in product((0, 1), repeat=n):
            whole &= ~gone[tuple(slice(c, c + s) for c, s in zip(corner, whole.shape, strict=True))]
    out = np.zeros(signs.shape, np.bool_)
    for axis in range(n):
        low: list[slice] = [slice(None)] * n
        high = list(low)
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        # an edge has cells on both sides along each other axis
        held = whole
        for other in range(n):
            if other != axis:
                around = [(1, 1) if a == other else (0, 0) for a in range(n)]
                padded = np.pad(held, around)
                held = np.delete(padded, -1, other) | np.delete(padded, 0, other)
        crossed = (signs[tuple(low)] != signs[tuple(high)]) & held
        out[tuple(low)] |= crossed
        out[tuple(high)] |= crossed
    return out


def recoded_frames(
    frames: Sequence[Sequence[Source]], interval: int | None, options: Options, *, kept: bool = False,
    promised: Sequence[float | None] | None = None, times: Sequence[str | None] = (),
) -> bytes:
    """Encode a file of what frames of files hold.

    Parameters
    ----------
    frames : sequence of sequences of Source
        By frame, sources of fields of the same shape, with the same missing samples.
    interval : int or None
        Interval of key frames; None if the file is not a series.
    options : Options
        The metadata include the notes of the placement.
    kept : bool
        Code the same curves, whatever the precision is.
    promised : sequence of float or None, optional
        Distances that the curves of isovalues are promised to keep to those of the field; nothing if not given.
    times : sequence of str or None
        Times of frames.
    """
    promised = [None] * len(frames[0]) if promised is None else promised
    samples = [[source.field for source in sources] for sources in frames]
    geometry = None
    if kept:
        # an isovalue whose curve is empty in one frame may have geometry in others
        geometry = [max((one.geometry for one in sources), key=len) for sources in zip(*frames, strict=True)]
    series = Series([one.isovalue for one in samples[0]], interval, options.independent)
    encoder = GridFrames(grid_file(samples[0], series, options, geometry=geometry, promised=promised))

    def chunks() -> Iterator[bytes]:
        for fields, series.time in zip_longest(samples, times):
            yield from encoder.chunks(fields)

    return b"".join(closed(chunks()))
