"""Contexts laid out in blocks, and coders that begin with them (spec clauses 6.5, 7.2, 10.4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from isospec.tables import MOST_LOGIT, Tables, shipped, unpacked

from .guesses import MOST_OPINIONS
from .panel import no_panel
from .range_coder import ONE, STRETCH_SHIFT, TRUST_SHIFT, Blend, Coder, CoderRegisters

RATES = 160
"""Symbols after which an adaptive probability follows the last ones only."""


class Layout:
    """Contexts in blocks with names, numbered one after the other.

    Parameters
    ----------
    blocks : mapping of str to (int, float, int)
        For each block its number of contexts, the probability of a 1 that they start with, and how many symbols that
        start counts as.

    Attributes
    ----------
    count : int
        All contexts.
    """

    def __init__(self, blocks: Mapping[str, tuple[int, float, int]]) -> None:
        self._blocks = dict(blocks)
        self._first: dict[str, int] = {}
        self.count = 0
        for name, (count, _, _) in blocks.items():
            self._first[name] = self.count
            self.count += count

    def __getitem__(self, name: str) -> int:
        """The first context of a block."""
        return self._first[name]

    def firsts(self, *names: str) -> Iterator[int]:
        """The first contexts of several blocks."""
        return map(self._first.__getitem__, names)

    def begun(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Probability of a 1 and number of symbols seen for each context, before the first symbol."""
        counts = [count for count, _, _ in self._blocks.values()]
        prob = np.repeat([round(p * ONE) for _, p, _ in self._blocks.values()], counts)
        return prob, np.repeat([weight for _, _, weight in self._blocks.values()], counts)


def rates() -> NDArray[np.int64]:
    """Adaptation step, of 2**16, by number of symbols seen: the mean of all, then of about the last ``RATES``."""
    return np.array([ONE // (i + 1) for i in range(1, RATES)], np.int64)


class Logistic(NamedTuple):
    """``squash``, ``stretch`` and ``trust`` of a `Blend`."""

    squash: NDArray[np.int32]
    stretch: NDArray[np.int16]
    trust: NDArray[np.int16]


def logistic(squash: NDArray[np.int64]) -> Logistic:
    """The logistic function, its inverse, and how far adaptive probabilities are trusted, by symbols seen."""
    # the least logit that reaches the centre of each class of probabilities
    half = 1 << STRETCH_SHIFT >> 1
    centres = (np.arange(ONE >> STRETCH_SHIFT) << STRETCH_SHIFT) + half
    stretch = np.minimum(np.searchsorted(squash, centres), 2 * MOST_LOGIT) - MOST_LOGIT
    count = np.arange(RATES)
    trust = (2 * count << TRUST_SHIFT) // (2 * count + 3)
    # as small as may be: they are looked up all the time
    return Logistic(squash.astype(np.int32), stretch.astype(np.int16), trust.astype(np.int16))


@cache
def shipped_tables() -> tuple[NDArray[np.int64], dict[int, Tables]]:
    """The normative tables: the logistic function, and what is trained for 2 and for 3 axes."""
    return unpacked(shipped())


@cache
def shipped_logistic() -> Logistic:
    """The tables of `Logistic` that coders have."""
    return logistic(shipped_tables()[0])


def no_blend() -> Blend:
    """The blend of coders whose symbols have one context each."""
    whole = np.zeros(0, np.int64)
    table, short, small = np.zeros((0, 1), np.int64), np.zeros((0, 1), np.int32), np.zeros(0, np.int16)
    return Blend(
        np.zeros((0, 1), np.int16), short, table, np.zeros(0, np.int32), small, small, whole, short, no_panel()
    )


def context_coder(prob: NDArray[np.int64], seen: NDArray[np.int64], room: int = 0) -> Coder:
    """A coder whose symbols have one context each.

    Parameters
    ----------
    prob, seen : (C,) int64
        Probabilities and symbols seen, which the coder changes.
    room : int
        Bytes.
    """
    return Coder(CoderRegisters(), np.zeros(room, np.uint8), prob, seen, rates(), no_blend())


def opinion_coder(layout: Layout, mixes: int, weight: int) -> Coder:
    """A coder without networks whose symbols have several opinions, mixed (see `entropy.guesses`).

    Parameters
    ----------
    layout : Layout
    mixes : int
        Sets of mixing weights.
    weight : int
        Weight that every opinion starts with, of 2**16.
    """
    short = np.zeros((0, 0), np.int32)
    blend = Blend(
        np.zeros((0, 0), np.int16), short, np.full((mixes, MOST_OPINIONS), weight, np.int64), *shipped_logistic(),
        np.zeros(2 * MOST_OPINIONS + 1, np.int64), short, no_panel(),
    )
    return Coder(CoderRegisters(), np.zeros(0, np.uint8), *layout.begun(), rates(), blend)


def put_away(coder: Coder) -> Coder:
    """The coder's models in as few bytes as they take, without the run: for `gone_on` only."""
    return coder._replace(
        reg=CoderRegisters(), buf=np.zeros(0, np.uint8), prob=coder.prob.astype(np.uint16),
        seen=coder.seen.astype(np.uint8),
    )


def gone_on(coder: Coder, room: int) -> Coder:
    """A coder with copies of the models of another one, put away or not, and room for so many bytes."""
    blend = coder.blend._replace(mix=coder.blend.mix.copy())
    return Coder(
        CoderRegisters(), np.zeros(room, np.uint8), coder.prob.astype(np.int64), coder.seen.astype(np.int64),
        coder.rate, blend,
    )


def take_over(coder: Coder, earlier: Coder) -> None:
    """Let a coder go on with copies of the models of another one of the same layout."""
    coder.prob[:], coder.seen[:] = earlier.prob, earlier.seen
    coder.blend.mix[:] = earlier.blend.mix
