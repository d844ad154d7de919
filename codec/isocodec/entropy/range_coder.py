"""The binary adaptive range coder, one function for both directions (spec clause 6).

A run is one string of bytes, read as a binary fraction. The coder keeps an interval of width ``RANGE`` (at most
2**32) and splits it by a 16-bit probability; every intermediate stays below 2**48. The decoder keeps the
distance ``CODE`` from the interval's start to the value of the bytes. Bytes that have not arrived are counted as
``UNKNOWN`` low bits of it: a symbol is decoded only if they cannot change it (clause 6.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import NEED, SPENT, inlined, record
from ..kernel.types import (
    Int16Matrix,
    Int16Vector,
    Int32Matrix,
    Int32Vector,
    IntMatrix,
    IntVector,
    Registers,
    UInt8Vector,
)

ENCODE, DECODE = 0, 1
ONE = 1 << 16
"""Probability one."""
FLOOR = 32
"""No probability is nearer to 0 or 1 than this (clause 6.5): it bounds the symbols that a byte can hold."""
TOP = 1 << 24
STRETCH_SHIFT = 4
"""Probabilities are looked up in ``Blend.stretch`` without these last bits."""
TRUST_SHIFT = 8
"""Bits of the entries of ``Blend.trust`` behind the point."""
WORD = 1 << 32
BEYOND = 4
"""Bytes past its end that a run may be read for, as zeros (clause 6.3)."""
MARGIN = 16
"""Free bytes that the encoder wants before it codes a symbol."""
UNLIMITED = 1 << 62


class CoderRegisters(Registers):
    """The state of a coder.

    Attributes
    ----------
    mode : int
        ``ENCODE`` or ``DECODE``.
    low, range : int
        Encoder: where the interval begins; both: how wide it is.
    code, unknown : int
        Decoder: distance from the interval's start to the value of the bytes, and how many low bits of it are unknown.
    pos, end, final : int
        Next byte, where those that have arrived end, and whether they are all.
    left, over : int
        Symbols that may be coded yet, and whether a run was read too far past its end.
    """

    mode: int
    low: int
    range: int
    code: int
    unknown: int
    pos: int
    end: int
    final: int
    left: int
    over: int


@record
class Panel(NamedTuple):
    """Further opinions, of counts, on symbols that have them (spec clause 7.18), see ``entropy.panel``; mostly empty.

    ``prob`` and ``seen`` are the adaptive probabilities, ``mix`` (kinds, opinions) the weights of the opinions,
    ``about`` is what is seen around the present symbol, ``place`` the contexts that follow from it, ``said`` their
    logits.
    """

    prob: IntVector
    seen: IntVector
    mix: IntMatrix
    about: IntVector
    place: IntVector
    said: IntVector


@record
class Blend(NamedTuple):
    """Additional models of the main profile (spec clause 7.11), see ``entropy.mixer``; empty in the baseline profile.

    ``weight`` (rows, HIDDEN) and ``out`` (networks, HIDDEN + 1) are the networks, ``mix`` (classes, INPUTS) the weights
    that adapt, ``squash`` and ``stretch`` the logistic function and its inverse, ``row`` the number of rows that a pass
    has listed, then those, ``trace`` room for the rows of all symbols while networks are trained, ``panel`` what
    frames of a series have beside.
    """

    weight: Int16Matrix
    out: Int32Matrix
    mix: IntMatrix
    squash: Int32Vector
    stretch: Int16Vector
    trust: Int16Vector
    row: IntVector
    trace: Int32Matrix
    panel: Panel


@record
class Coder(NamedTuple):
    """Registers, the bytes of the run, and the adaptive models: probability of a 1 and number of updates."""

    reg: CoderRegisters
    buf: UInt8Vector
    prob: IntVector
    seen: IntVector
    rate: IntVector
    blend: Blend


def start(reg: CoderRegisters, mode: int) -> None:
    """Set the registers for the first symbol of a run."""
    reg.clear()
    reg.mode = mode
    reg.range = WORD
    reg.left = UNLIMITED
    if mode == DECODE:
        reg.unknown = 32


@inlined
def _pull(cd):
    """Move bytes that have arrived since into the unknown part of the code."""
    reg = cd.reg
    while reg.unknown > 0:
        if reg.pos < reg.end:
            reg.code += np.int64(cd.buf[np.uint64(reg.pos)]) << (reg.unknown - 8)
        elif reg.final == 0:
            return
        reg.pos += 1
        reg.unknown -= 8


@inlined
def adapt(cd, ctx, bit):
    """Update one model (clause 6.5): the step shrinks with the number of symbols seen."""
    adapt_in(cd, cd.prob, cd.seen, ctx, bit)


@inlined
def adapt_in(cd, probs, counts, ctx, bit):
    """Adapt a model of any list."""
    # unsigned: no test whether it counts from the end
    at = np.uint64(ctx)
    probs[at], counts[at] = adapted(cd, probs[at], counts[at], bit)


@inlined
def adapted(cd, p, seen, bit):
    """Probability of a 1 and number of symbols seen after one more symbol (clause 6.5)."""
    step = cd.rate[np.uint64(seen)]
    if bit:
        p += ((ONE - p) * step) >> 16
    else:
        p -= (p * step) >> 16
    return min(max(p, FLOOR), ONE - FLOOR), min(seen + 1, len(cd.rate) - 1)


@inlined
def logit_of(cd, p, seen):
    """Logit of an adaptive probability, shrunk as long as few symbols have trained it."""
    found = np.int64(cd.blend.stretch[np.uint64(p >> STRETCH_SHIFT)])
    return (found * cd.blend.trust[np.uint64(seen)]) >> TRUST_SHIFT


@inlined
def emit(cd, p, bit):
    """Code one symbol whose probability of a 1 is ``p``: write ``bit``, or return the decoded one.

    Returns NEED, with nothing changed, when the coder needs bytes (or room), and SPENT when the symbols that were
    granted have been coded.
    """
    reg = cd.reg
    if reg.left == 0:
        return SPENT
    width = reg.range
    bound = (width * p) >> 16
    if reg.mode == ENCODE:
        if reg.pos + MARGIN > len(cd.buf):
            return NEED
        if bit:
            width = bound
        else:
            width -= bound
            low = reg.low + bound
            if low >= WORD:
                low -= WORD
                i = reg.pos - 1
                while cd.buf[i] == 255:
                    cd.buf[i] = 0
                    i -= 1
                cd.buf[i] += 1
            reg.low = low
        while width < TOP:
            low = reg.low
            cd.buf[np.uint64(reg.pos)] = low >> 24
            reg.pos += 1
            reg.low = (low & 0xFFFFFF) << 8
            width <<= 8
    else:
        if reg.unknown > 0:
            _pull(cd)
            most = reg.code + (np.int64(1) << reg.unknown) - 1
            if reg.code < bound <= most:
                return NEED
        if reg.pos > reg.end + BEYOND:
            reg.over = 1
            return NEED
        if reg.code < bound:
            bit = 1
            width = bound
        else:
            bit = 0
            reg.code -= bound
            width -= bound
        while width < TOP:
            reg.code <<= 8
            if reg.unknown == 0 and reg.pos < reg.end:
                reg.code += np.int64(cd.buf[np.uint64(reg.pos)])
                reg.pos += 1
            elif reg.unknown == 0 and reg.final:
                reg.pos += 1
            else:
                reg.unknown += 8
            width <<= 8
    reg.range = width
    reg.left -= 1
    return bit


@inlined
def code(cd, ctx, bit):
    """Code one symbol in context ``ctx``; as ``emit``."""
    bit = emit(cd, cd.prob[np.uint64(ctx)], bit)
    if bit >= 0:
        adapt(cd, ctx, bit)
    return bit


@inlined
def code_below(cd, ctx, above, bit):
    """Code in a context below another one, from which it starts when it is used for the first time."""
    if ctx != above and cd.seen[np.uint64(ctx)] == 0:
        cd.prob[np.uint64(ctx)] = cd.prob[np.uint64(above)]
    bit = code(cd, ctx, bit)
    if bit >= 0 and ctx != above:
        adapt(cd, above, bit)
    return bit


def _carry(data: bytearray) -> bytearray:
    """Add one to the last byte, with carries."""
    i = len(data) - 1
    while data[i] == 255:
        data[i] = 0
        i -= 1
    data[i] += 1
    return data


def finish(cd: Coder) -> bytes:
    """Bytes of an encoded run: the shortest ending whose value lies in the final interval (clause 6.3)."""
    low, width, pos = cd.reg.low, cd.reg.range, cd.reg.pos
    for extra in range(5):
        unit = 1 << (32 - 8 * extra)
        value = -(-low // unit) * unit
        if value < low + width:
            break
    head = bytearray(cd.buf[:pos].tobytes())
    if value >= WORD:
        head = _carry(head)
        value -= WORD
    return bytes(head) + value.to_bytes(4, "big")[:extra]


def cut(cd: Coder) -> bytes:
    """Shortest bytes, from those that a decoder has read, that decode to the symbols decoded so far.

    The bytes from the decoder's window on are dropped as far as the interval allows, if need be adding one to
    the last byte kept.
    """
    reg = cd.reg
    known = (32 - reg.unknown) // 8
    pos, end = reg.pos, reg.end
    window = pos - known  # of the 4-byte window in which CODE and RANGE are measured
    data = bytearray(cd.buf[: min(pos, end)].tobytes()).ljust(max(pos, window + 4), b"\0")
    width, distance = reg.range, reg.code
    word = int.from_bytes(data[window : window + 4], "big")
    for keep in range(5):
        rest = word & ((1 << (32 - 8 * keep)) - 1)
        head = data[: window + keep]
        if distance - rest >= 0:
            return bytes(head)
        if distance - rest + (1 << (32 - 8 * keep)) < width:
            return bytes(_carry(head))
    return bytes(data[: window + 4])
