"""What holds of the encoder on any field, tried on those of `isoconform.strategies` for some minutes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isocodec import Decoder, encode
from isocodec.grid.tube.decoded import Decoded

from .dump import COMPLETE, canonical, dump, grid_of
from .meshes import exponent
from .strategies import cuts, fields, options, pieces

EXAMPLES = 100
"""Fields between two looks at the clock."""


def decoded(data: bytes, parts: Sequence[bytes] = ()) -> Decoder:
    """A decoder that has taken a file, or its parts; it need not be complete."""
    decoder = Decoder()
    for part in parts or [data]:
        decoder.feed(part)
        for _ in decoder:
            pass
    return decoder


def check(field: NDArray[Any], isovalue: float, data: bytes, parts: Sequence[bytes], start: bytes) -> None:
    """What is decoded is the field's, in pieces, too, and a start of the file says nothing else.

    Raises
    ------
    AssertionError
    """
    whole = dump(data)
    assert whole.exit_code == COMPLETE, f"a file that the encoder wrote: {whole.error}"
    assert canonical(decoded(data, parts)) == whole.text, "in pieces another state"
    state = _state(data)
    assert state is not None
    _check_state(field, isovalue, state)
    early = _state(start)
    if early is not None:
        _check_state(field, isovalue, early, complete=False)


def _state(data: bytes) -> Decoded | None:
    """The decoded state of a file, or of the start of one; None before the header has come."""
    grid = grid_of(decoded(data))
    return grid.state() if grid else None


def _check_state(field: NDArray[Any], isovalue: float, state: Decoded, complete: bool = True) -> None:
    samples = [field[tuple(position)].item() for position in state.position.tolist()]
    signs = [sample > isovalue for sample in samples]
    assert signs == state.above.tolist(), "another sign than the field's"
    if field.dtype.kind in "iu":
        floor = int(np.floor(isovalue))
        near = _next_to_curve(field, isovalue)[tuple(state.position.T)].tolist()
        told = zip(samples, state.missing.tolist(), state.number.tolist(), near, strict=True)
        for sample, missing, number, active in told:
            if missing == 0 and active:
                assert sample in (floor + 1 + number, floor - number), "another value than the field's"
    if complete and state.level == field.ndim * exponent(field.shape):
        known = np.zeros(field.shape, bool)
        known[tuple(state.position.T)] = True
        assert known[_next_to_curve(field, isovalue)].all(), "a crossed edge whose ends are not known"


def _next_to_curve(field: NDArray[Any], isovalue: float) -> NDArray[np.bool_]:
    """Samples with a neighbour along an axis on the other side of the isovalue."""
    above = np.array([sample > isovalue for sample in field.ravel().tolist()], bool).reshape(field.shape)
    near = np.zeros(field.shape, bool)
    for axis in range(field.ndim):
        crossed = np.diff(above, axis=axis)
        for side in (0, 1):
            part = [slice(None)] * field.ndim
            part[axis] = slice(side, field.shape[axis] - 1 + side)
            near[tuple(part)] |= crossed
    return near


@st.composite
def cases(draw: st.DrawFn) -> tuple[NDArray[Any], float, dict[str, Any], bytes, list[bytes], bytes]:
    """A field, an isovalue, options, the file, the file in pieces, and a start of it."""
    field, isovalue = draw(fields())
    chosen = draw(options(field))
    data = encode(field, isovalue, **chosen)
    return field, isovalue, chosen, data, draw(pieces(data)), draw(cuts(data))


def try_encoder(minutes: float, first: int = 0) -> int:
    """Try the properties until the time is over; how many fields it were.

    Raises
    ------
    AssertionError
        Of the smallest case that hypothesis finds, which it prints.
    """
    end, done = time.monotonic() + 60 * minutes, 0
    while time.monotonic() < end:

        @seed(first + done)
        @settings(
            max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck),
            phases=(Phase.generate, Phase.shrink),
        )
        @given(cases())
        def holds(case: tuple[NDArray[Any], float, dict[str, Any], bytes, list[bytes], bytes]) -> None:
            field, isovalue, _, data, parts, start = case
            check(field, isovalue, data, parts, start)

        holds()
        done += EXAMPLES
    return done
