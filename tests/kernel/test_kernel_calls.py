"""Kernels as they are called: types, how values lie in memory, arguments and results."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from commands import HILLS
from isocodec.errors import KernelError
from isocodec.grid.lattice.store import new_flags
from isocodec.grid.tube.ranks import enter_numbers_at
from isocodec.kernel import record
from isocodec.kernel.call import FINE, Kernel
from isocodec.kernel.types import (
    BOOL,
    FLOAT,
    INT,
    Array,
    FloatMatrix,
    IntVector,
    UInt8Vector,
    kind_of,
)
from isocodec.stream.encoder import encoder_of
from tables import looped


@record
class Inner(NamedTuple):
    flags: UInt8Vector


@record
class Outer(NamedTuple):
    numbers: IntVector
    inner: Inner
    places: FloatMatrix


def slots(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}q", *values)


# --- values in slots ------------------------------------------------------------------------------------------------


def outer() -> Outer:
    return Outer(np.arange(3), Inner(np.arange(2, dtype=np.uint8)), np.zeros((2, 2)))


VECTOR, RECORD = Array("int64", 1), kind_of(Outer)


@looped(
    ("kind", "value", "match"),
    [
        *((INT, value, f"{type(value).__name__} instead of {INT}") for value in (1.0, True, np.True_, None, "1")),
        *((FLOAT, value, f"{type(value).__name__} instead of {FLOAT}") for value in (1, True, np.int64(1))),
        *((BOOL, value, f"{type(value).__name__} instead of {BOOL}") for value in (1, 0.0, None)),
        *((INT, value, None) for value in (1 << 63, -(1 << 63) - 1, np.uint64((1 << 64) - 1))),
        (VECTOR, np.zeros(3, np.int32), "int32, 1d instead of"), (VECTOR, np.zeros((3, 1), np.int64), "int64, 2d"),
        (VECTOR, [1, 2], "list"), (VECTOR, np.zeros(3, ">i8"), ">i8, 1d"),
        (VECTOR, np.zeros(6, np.int64)[::2], "an array with gaps"),
        (VECTOR, np.zeros(3, np.int64)[::-1], "an array with gaps"), (VECTOR, np.int64(3), "int64"),
        (VECTOR, np.ma.zeros(3, np.int64), "int64, 1d"), (RECORD, (1, 2), "tuple instead of Outer"),
        (RECORD, None, "NoneType instead of Outer"), (RECORD, outer()._replace(numbers=[1]), "numbers: list"),
        (RECORD, outer()._replace(inner=Inner(np.zeros(2))), "inner: flags: float64, 1d"),  # type: ignore[arg-type]
    ],
)
def test_what_does_not_fit(kind, value, match):
    with pytest.raises((TypeError, OverflowError), match=match):
        kind.pack(value)


def test_changed_records_are_noted_anew():
    """Whichever member changes, before or after the first call; the one that it was made from stays."""
    kind = kind_of(Outer)

    def plain(value: Outer) -> bytes:
        return kind.pack(Outer(value.numbers, Inner(value.inner.flags), value.places))

    value = outer()
    early = value._replace(numbers=np.arange(7))
    first = kind.pack(value)
    changed = [
        value._replace(numbers=np.arange(5)), value._replace(inner=Inner(np.zeros(9, np.uint8))),
        value._replace(places=np.zeros((3, 1)), numbers=np.arange(6)), value._replace(), early,
    ]
    again = [each._replace(places=np.ones((1, 1))) for each in changed]
    for each in (*changed, *again):
        assert kind.pack(each) == plain(each) == kind.pack(each)
    assert len({kind.pack(each) for each in (value, *changed)}) == len(changed)  # one is the same
    assert kind.pack(value) == first == plain(value)


def test_a_kernel_reads_the_array_that_took_the_place_of_another():
    encoder = encoder_of(HILLS, 80.5, precision="signs")
    assert b"".join(encoder)
    tube = encoder.frame.strands[0].tube
    state, numbers = tube.state, tube.numbers
    position = state.vertex[:5, :3].astype(np.int64)
    out = np.zeros(5, np.int64)
    for known, expected in ((state.known, [*range(5)]), (new_flags(2), [-1] * 5), (state.known, [*range(5)])):
        enter_numbers_at(numbers._replace(known=known), position, out)
        assert out.tolist() == expected
    enter_numbers_at(numbers, position, out)
    assert out.tolist() == [*range(5)]


# --- calls ----------------------------------------------------------------------------------------------------------


def returning(function: Callable[..., Any], content: bytes, status: int = FINE[0]) -> Kernel:
    """A kernel whose entry writes some bytes where the results go."""

    def entry(results: Any, fault: Any, frame: bytes) -> int:
        ctypes.memmove(results, content, len(content))
        return status

    return Kernel(function, lambda _: entry)


def nothing() -> None: ...


def test_a_status_of_a_fault_is_an_index_error():
    for status in (1, -1, 7):
        with pytest.raises(IndexError, match=r"kernel .*nothing: an index out of bounds"):
            returning(nothing, b"", status)()
    assert returning(nothing, b"", FINE[1])() is None


def weighed(values: IntVector, weight: float, turned: bool) -> float: ...


@looped(
    ("arguments", "match"),
    [
        ((np.zeros(2), 1.0, True), r"weighed, argument values: float64, 1d instead of int64\[1d\]"),
        ((np.zeros(4, np.int64)[::2], 1.0, True), "weighed, argument values: an array with gaps"),
        ((np.zeros(2, np.int64), 1, True), "weighed, argument weight: int instead of float64"),
        ((np.zeros(2, np.int64), 1.0, 1), "weighed, argument turned: int instead of bool"),
        ((np.zeros(2, np.int64), 1.0), r"weighed\(values: int64\[1d\], .*\) -> float64 called with 2 arguments"),
        ((np.zeros(2, np.int64), 1.0, True, 0), "called with 4 arguments"),
    ],
)
def test_arguments_of_other_types(arguments, match):
    """Never is anything else compiled, or run as plain Python instead."""
    with pytest.raises(KernelError, match=match) as caught:
        returning(weighed, slots(0))(*arguments)
    assert caught.value.code == "kernel-signature" and caught.value.exit_code == 8
