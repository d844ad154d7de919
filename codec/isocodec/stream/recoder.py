"""Files from what other files tell: their curves on the full grid, as fields to be encoded anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.decoded_samples import DecodedSamples, near_values, values_of_steps
from ..field.samples import Samples
from ..format.kinds import LayerKind
from ..grid.layers.plan import Entry
from ..grid.tube.decoded import Decoded
from .decoder import Decoder
from .encoder import Encoder


@dataclass(frozen=True)
class Source:
    """An isovalue of a file.

    Attributes
    ----------
    field : DecodedSamples
    geometry : list of entries
        Layers behind the full grid that tell the same again.
    """

    field: DecodedSamples
    geometry: list[Entry]


def sources_of(decoder: Decoder, what: str = "the file") -> list[Source]:
    """All isovalues of a file that a decoder has taken whole; ``what`` names it in messages.

    Raises
    ------
    OptionError
        If it is not on the full grid, is a series, has coordinates of its own, or tells values in part.
    LimitError
        If it has more samples than the limits allow.
    """
    assert decoder.header is not None
    if decoder.interval is not None:
        raise OptionError(f"{what} is a series of frames", code="recode", remedy="decode frames, encode them again")
    if decoder.mapped() is not None:
        raise OptionError(f"{what} has coordinates of its own", code="recode", remedy="encode the field itself again")
    gone = ~decoder.valid()
    missing = gone if gone.any() else None
    found = []
    for number, isovalue in enumerate(decoder.isovalues):
        signs = np.ascontiguousarray(decoder.mask(number))
        state = decoder.state(number)
        assert state is not None
        found.append(source_of(state, Samples(signs, isovalue, signs, decoder.header.scale, missing), what))
    return found


def source_of(state: Decoded, field: Samples, what: str) -> Source:
    """What a state on the full grid tells of a field, of which only the signs are looked at.

    Raises
    ------
    OptionError
        If it tells values or crossings in part; ``what`` names the file.
    """
    signs, isovalue, scale, gone = field.signs, field.isovalue, field.scale, field.gone
    n = signs.ndim
    in_part = OptionError(f"{what} tells values or crossings in part, or both", code="recode",
                          remedy="give signs_only, or encode the field itself again")
    if (state.missing >= 0).any():
        beside = _beside(signs, gone)[tuple(state.position.T)]
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
    return Source(field, [(LayerKind.OFFSETS, radix) for radix in _radices(int(parts[0]))] if len(parts) else [])


def _beside(signs: NDArray[np.bool_], gone: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Samples with a neighbour along an axis on the other side, of edges that some whole unit cell has (5.10.2)."""
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


def _radices(parts: int) -> list[int]:
    """Odd factors of a number of parts, rising: a layer each."""
    out, factor = [], 3
    while parts > 1:
        while parts % factor == 0:
            out.append(factor)
            parts //= factor
        factor += 2
    return out


class Recoder(Encoder):
    """Encodes what files tell.

    Parameters
    ----------
    sources : sequence of Source
        Of fields of one shape, with the same samples missing.
    kept : bool
        Tell the same again, whatever options say of precision.
    options
        As of `Encoder`.
    """

    def __init__(self, sources: Sequence[Source], kept: bool, **options: Any) -> None:
        self._sources = sources
        self._kept = kept
        fields = [source.field for source in sources]
        super().__init__(fields[0].signs, [field.isovalue for field in fields], **options)

    def _sampled(
        self, values: NDArray[Any], gone: NDArray[np.bool_] | None
    ) -> tuple[list[Samples], NDArray[np.bool_] | None]:
        return [source.field for source in self._sources], self._sources[0].field.gone

    def _behind_grid(self, number: int, asked: list[Entry]) -> list[Entry]:
        return self._sources[number].geometry if self._kept else asked
