"""Files of ours that meet a demand: a mean or largest distance, on the whole grid or a coarser mesh, whole or cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import isocodec
from isocodec.drawing.contour import Contour
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.search.strategy import BASE_CYCLES

from .errors import Shape, apart
from .items import Item

FINE = 2.0**-20
"""Tolerance in cells that stands for the extracted curve of floats."""
LARGEST_RADIX = 63
COARSER = (1.5, 2.0, 3.0)
"""Largest distances that are tried for a coarse mean one, in units of it."""
FREER = (1.08, 1.17, 1.26, 1.36, 1.48)
"""Tolerances that are tried around offsets that will do, in units of half a part."""
LEAST_SEARCHED = 0.5
"""Smallest of them in cells that is worth the search."""
CUTS = 8
"""Steps of the search for the place at which a file is cut."""
PLANES = 16
"""Most bits of values that are tried."""


def parts_list() -> list[int]:
    """Numbers of parts that edges can be divided into by one layer of offsets or two, rising."""
    one = range(1, LARGEST_RADIX + 1)
    return sorted({a * b for a in one for b in one})


def radices(parts: int) -> list[int]:
    """Layers of offsets that come to a number of parts."""
    if parts <= LARGEST_RADIX:
        return [parts] if parts > 1 else []
    return next([parts // b, b] for b in range(LARGEST_RADIX, 0, -1) if parts % b == 0 and parts // b <= LARGEST_RADIX)


@dataclass(frozen=True)
class File:
    """A file that was tried, how it is made and drawn, and how far its curve lies from the extracted one (cells)."""

    how: str
    make: Callable[[], bytes]
    data: bytes
    err_mean: float
    err_max: float
    smooth: bool = False


@dataclass
class Ours:
    """Our encoder on one item.

    Attributes
    ----------
    item : Item
    options : dict
        Go into every call of the encoder.
    cut_surfaces : bool
        Whether files of surfaces may be cut, too, between two layers of offsets; that makes them smaller, and takes
        about as long as decoding them.
    tried : dict of str to File
        All files that a search has made.
    """

    item: Item
    options: dict[str, Any] = field(default_factory=dict)
    cut_surfaces: bool = False
    tried: dict[str, File] = field(default_factory=dict)

    def encode(self, **more: Any) -> bytes:
        return isocodec.encode(self.item.values, self.item.isovalue, **self.options, **more)

    @property
    def full_level(self) -> int:
        """Level of the full grid."""
        return self.item.n * cube_exponent(self.item.values.shape)

    @cached_property
    def extracted(self) -> Contour:
        """The curve or surface that is encoded, with every crossing where interpolation puts it."""
        return isocodec.decode(self.encode(precision="exact" if self.item.integer else FINE))

    @cached_property
    def truth(self) -> Shape:
        return Shape.of_mesh(self.extracted.points, self.extracted.cells)

    def offsets(self, parts: int) -> File:
        """Crossings to the middle of one of so many parts of an edge."""
        return self._planned(self._offsets_name(parts), [("offsets", radix) for radix in radices(parts)])

    @staticmethod
    def _offsets_name(parts: int) -> str:
        return f"offsets in {parts} parts" if parts > 1 else "signs alone"

    def smoothed(self) -> File:
        """Signs alone, drawn with smoothing."""
        signs = self.offsets(1)
        return self._tell(f"{signs.how}, smoothed", signs.make, smooth=True)

    def values(self, planes: int) -> File:
        """The highest bits of the samples next to the curve."""
        return self._planned(f"{planes} bits of values", [("values", planes)])

    def tolerance(self, largest: float) -> File:
        """A proven largest distance, both ways."""
        return self._tell(f"tolerance {largest:g}", lambda: self.encode(precision=largest))

    def smallest(self, bound: str, target: float) -> File | None:
        """The smallest file found whose ``err_mean`` or ``err_max`` is at most the target; None if there is none."""
        found = [f for f in self._families(bound, target) if f is not None and getattr(f, bound) <= target]
        return min(found, key=lambda file: len(file.data), default=None)

    def _planned(self, how: str, entries: Sequence[Any]) -> File:
        """The whole grid, then what else is told of it."""
        level = min(BASE_CYCLES * self.item.n, self.full_level)
        refine = [("refine", None)] if level < self.full_level else []
        return self._tell(how, lambda: self.encode(layers=[("base", level), *refine, *entries]))

    def _tell(self, how: str, make: Callable[[], bytes], smooth: bool = False) -> File:
        """Encode, decode and measure, once."""
        if how not in self.tried:
            data = make()
            contour = isocodec.decode(data, smooth=smooth)
            mean, largest = apart(self.truth, Shape.of_mesh(contour.points, contour.cells))
            self.tried[how] = File(how, make, data, mean, largest, smooth)
        return self.tried[how]

    def _families(self, bound: str, target: float) -> Iterator[File | None]:
        """The best file of each kind, and others."""
        signs = self.offsets(1)
        if getattr(signs, bound) <= target:
            yield signs
            if self.item.n == 2:
                largest = [factor * target for factor in COARSER] if bound == "err_mean" else [target]
                yield from (self.tolerance(d) for d in largest if d >= LEAST_SEARCHED)
            return
        # curves ask for more than smoothing gives, surfaces do not
        if self.item.n == 3 and getattr(self.smoothed(), bound) <= target:
            yield self.smoothed()
            return
        choices = parts_list()
        finer = self._coarsest(choices, bound, target)
        yield finer
        if finer is not None and bound == "err_mean" and (self.item.n == 2 or self.cut_surfaces):
            at = next(i for i, parts in enumerate(choices) if self._offsets_name(parts) == finer.how)
            if self.item.n == 2:
                # a tolerance leaves the encoder free to tell what is cheapest within it
                yield from (self.tolerance(factor * 0.5 / choices[at]) for factor in FREER)
                # where crossings have few different places, fewer parts may come nearer to them
                yield from (self.offsets(parts) for parts in choices[1:at] if parts <= LARGEST_RADIX)
            # one size coarser for all crossings, much finer for some
            coarser = choices[at - 1]
            layers = [("offsets", radix) for radix in (*radices(coarser), 3)]
            yield self._cut(
                self._planned(f"offsets in {coarser} parts, then 3", layers), self.offsets(coarser), bound, target
            )
        if finer is not None and finer.how == self.offsets(choices[1]).how:
            yield self._cut(finer, signs, bound, target)
            if self.item.n == 3:
                yield self._cut(finer, signs, bound, target, smooth=True)
        if self.item.integer and self.item.n == 2:
            enough = next((b for b in range(1, PLANES + 1) if getattr(self.values(b), bound) <= target), None)
            if enough is not None:
                yield self.values(enough)
                yield self._cut(self.values(enough), self.values(enough - 1) if enough > 1 else signs, bound, target)

    def _coarsest(self, choices: list[int], bound: str, target: float) -> File | None:
        """Offsets in the fewest parts that will do; errors go roughly as 1 / parts, so few have to be tried."""
        low, high = 0, len(choices)  # choices[low] will not do; choices[high] will, or there is none
        wanted = getattr(self.offsets(choices[0]), bound) / max(target, 1e-9)
        while high - low > 1:
            at = next((i for i, parts in enumerate(choices) if parts >= wanted), len(choices) - 1)
            at = min(max(at, low + 1), high - 1)
            error = getattr(self.offsets(choices[at]), bound)
            low, high = (low, at) if error <= target else (at, high)
            wanted = choices[at] * error / max(target, 1e-9)
        return self.offsets(choices[high]) if high < len(choices) else None

    def _cut(self, finer: File, coarser: File, bound: str, target: float, smooth: bool = False) -> File | None:
        """The finer file cut as early as the target allows; every prefix is a file of its own."""
        low, high, best = len(coarser.data), len(finer.data), None
        for _ in range(CUTS):
            if high - low < max(8, high // 200):
                break
            size = (low + high) // 2
            how = f"{finer.how}, cut at {size} bytes" + (", smoothed" if smooth else "")
            file = self._tell(how, self._cutter(finer, size), smooth)
            if getattr(file, bound) <= target:
                high, best = size, file
            else:
                low = size
        return best

    @staticmethod
    def _cutter(finer: File, size: int) -> Callable[[], bytes]:
        return lambda: isocodec.open(finer.make()).edited(size=size)
