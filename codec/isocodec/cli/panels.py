"""After which layers of a file ``isocodec plot`` draws what has come."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..format.kinds import GEOMETRY


class Panels:
    """Chooses layers as they come, from the first one on after which there is something to see.

    Parameters
    ----------
    kinds : sequence of str
        Of the layers, in their order.
    steps : int
        Panels at most.
    promised : sequence of int
        Numbers of the layers, from 1 on, that promise something.

    Attributes
    ----------
    chosen : list of int
        Numbers of the layers after which to draw, as far as that is known.
    """

    def __init__(self, kinds: Sequence[str], steps: int, promised: Sequence[int] = ()) -> None:
        self._kinds, self._steps, self._promised = [*kinds], steps, promised
        self._seen = False
        self.chosen: list[int] = []

    def draws(self, layer: int, seen: Callable[[], bool]) -> bool:
        """Whether to draw after a layer, as always after the last; ``seen`` finds out whether there is something."""
        if not self._seen:
            before = layer - 1
            promised = [number - before for number in self._promised if number > before]
            self.chosen = [before + number for number in shown(self._kinds[before:], self._steps, promised)]
        if layer not in self.chosen:
            return False
        self._seen = self._seen or layer >= len(self._kinds) or seen()
        return self._seen


def shown(kinds: list[str], steps: int, promised: Sequence[int] = ()) -> list[int]:
    """Numbers of the layers after which to draw: promised ones, ends of geometry that a mesh follows on, or any."""
    told = [kind in GEOMETRY for kind in kinds]
    ends = [i + 1 for i, here in enumerate(told) if here and not (i + 1 < len(told) and told[i + 1])]
    if promised:
        # what comes behind the last promise is more precise: all values
        ends = sorted({*promised, len(kinds)})
    if len(ends) < 2:
        return spread(len(kinds), steps)
    return [ends[k - 1] for k in spread(len(ends), steps)]


def spread(layers: int, steps: int) -> list[int]:
    """At most ``steps`` numbers of layers, evenly spread over 1 .. ``layers``; the last is all of them."""
    if steps == 1 or layers <= 1:
        return [max(layers, 1)]
    count = min(steps, layers)
    return [1 + round(k * (layers - 1) / (count - 1)) for k in range(count)]
