"""The head of a domain chunk that holds points and values (spec clause 10.9.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from isospec.container import DomainKind, unzigzag, write_varint, zigzag

from ..errors import FormatError
from .header import varint

MOST_EXTENT = 1 << 28
MOST_EXPONENT = 1100
MOST_NUMBER = (1 << 16) - 1
"""Largest number that can code a value."""
MOST_LAYERS = 64
_MANTISSA = 53


@dataclass(frozen=True)
class TinHead:
    """Head of a surface, before its run.

    Attributes
    ----------
    extent : (int, int)
        Positions are below these.
    grid : bool
        Whether positions are sample indices in a field of that shape.
    exponent, origin : int, (int, int)
        For scattered points: position p has the coordinates ``(origin + p) * 2**exponent``.
    offset, step : float
        Number k codes the value ``offset + k * step``.
    palette : tuple of int
        If not empty, number k codes ``offset + palette[k] * step`` instead; increasing, starting with 0.
    largest : int
        Largest number.
    counts : tuple of int
        Number of points that each layer adds.
    """

    extent: tuple[int, int]
    grid: bool
    exponent: int
    origin: tuple[int, int]
    offset: float
    step: float
    palette: tuple[int, ...]
    largest: int
    counts: tuple[int, ...]


def _write_number(value: float) -> bytes:
    """Write a number as an odd integer times a power of two; 0 is written without an exponent."""
    mantissa, exponent = math.frexp(value)
    whole = int(math.ldexp(mantissa, _MANTISSA))
    if whole == 0:
        return write_varint(0)
    shift = (whole & -whole).bit_length() - 1
    return write_varint(zigzag(whole >> shift)) + write_varint(zigzag(exponent - _MANTISSA + shift))


def write_tin(head: TinHead) -> bytes:
    """Write the payload before the run."""
    out = [bytes([DomainKind.POINTS << 4 | (not head.grid) | bool(head.palette) << 1])]
    out += [write_varint(side) for side in head.extent]
    if not head.grid:
        out += [write_varint(zigzag(each)) for each in (head.exponent, *head.origin)]
    out += [_write_number(head.offset), _write_number(head.step), write_varint(head.largest)]
    if head.palette:
        out += [write_varint(b - a) for a, b in zip(head.palette, head.palette[1:], strict=False)]
    out.append(write_varint(len(head.counts)))
    return b"".join(out + [write_varint(count) for count in head.counts])


def read_tin(payload: bytes, start: int) -> tuple[TinHead, int]:
    """Inverse of ``write_tin``: the head, and where the run begins in the payload, which begins at ``start``.

    Raises
    ------
    FormatError
        If it is malformed.
    """
    at = 1

    def wrong(what: str) -> FormatError:
        return FormatError(what, code="domain", offset=start, clause="10.9.1")

    def take(least: int, most: int, what: str) -> int:
        nonlocal at
        found = varint(payload, at, len(payload), "10.9.1")
        if found is None:
            raise wrong("the head is incomplete")
        if not least <= found[0] <= most:
            raise wrong(f"{found[0]} is out of range: {what}")
        at = found[1]
        return found[0]

    def signed(most: int, what: str) -> int:
        found = unzigzag(take(0, 2 * most, what))
        return found

    def number(what: str) -> float:
        whole = signed(1 << _MANTISSA, what)
        if whole == 0:
            return 0.0
        try:
            return math.ldexp(whole, signed(MOST_EXPONENT, what))
        except OverflowError:
            raise wrong(f"too large: {what}") from None

    if payload[0] & 12:
        raise wrong("reserved bits are set")
    grid, several = not payload[0] & 1, payload[0] & 2
    extent = take(1, MOST_EXTENT, "an extent"), take(1, MOST_EXTENT, "an extent")
    exponent, origin = 0, (0, 0)
    if not grid:
        exponent = signed(MOST_EXPONENT, "the unit of positions")
        origin = signed(1 << 61, "the origin"), signed(1 << 61, "the origin")
    offset, step = number("the least value"), number("the step of values")
    if step <= 0:
        raise wrong("the step of values is not greater than 0")
    largest = take(0, MOST_NUMBER, "the largest number")
    palette = [0] if several else []
    for _ in range(largest if several else 0):
        palette.append(palette[-1] + take(1, 1 << 40, "the palette"))
    counts = [take(1, MOST_EXTENT, "points of a layer") for _ in range(take(1, MOST_LAYERS, "the number of layers"))]
    head = TinHead(extent, grid, exponent, origin, offset, step, tuple(palette), largest, tuple(counts))
    return head, at


def values_of(head: TinHead, numbers: Sequence[int]) -> list[float]:
    """Decode numbers to values."""
    return [head.offset + (head.palette[k] if head.palette else k) * head.step for k in numbers]
