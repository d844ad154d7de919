"""What is encoded of an input: its field, or each frame of a series in turn, with holes found or filled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .isovalues import range_of
from .report import warn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..io.readers.slices import Slices


class Prepared:
    """Samples of one frame after the other, and what was seen of those that were encoded.

    Parameters
    ----------
    frames : Slices
        No more than one of them is kept.
    nodata : float or None
        The value of missing samples, besides NaN.
    label : float or None
        Take which samples have it instead; none is missing then.

    Attributes
    ----------
    fill : str or None
        What missing samples become instead of holes, as `isocodec.field.missing.filled` has it.
    tied : str
        Kinds of samples that are compared with the isovalues.
    missing, holes : int
        Samples that were missing, and those of them that were left as holes.
    dtype : dtype or None
        Type of the samples.
    """

    def __init__(self, frames: Slices, nodata: float | None, label: float | None) -> None:
        self._frames, self._nodata, self._label = frames, nodata, label
        self._kept: tuple[int, NDArray[Any], NDArray[Any] | None] | None = None
        self.fill: str | None = None
        self.tied = ""
        self.missing = self.holes = 0
        self.dtype: Any = None
        self._ends: tuple[Any, Any] | None = None
        self._ties: dict[float, int] = {}

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis of a frame."""
        whole, axis = self._frames.shape, self._frames.axis
        return whole[:axis] + whole[axis + 1 :]

    def _read(self, number: int) -> tuple[NDArray[Any], NDArray[Any] | None]:
        """The samples of a frame, and which are missing if any are."""
        from ..api.labels import labelled
        from ..field.missing import missing_samples

        if self._kept is None or self._kept[0] != number:
            self._kept = None
            field = self._frames.frame(number)
            if self._label is not None:
                # of a series not each frame has it
                field = labelled(field, self._label) if len(self) == 1 else field == self._label
                self._kept = number, field, None
            else:
                gone = missing_samples(field, self._nodata)
                self._kept = number, field, gone if gone.any() else None
        return self._kept[1:]

    def samples(self, number: int, isovalues: Sequence[float]) -> tuple[NDArray[Any], NDArray[Any] | None]:
        """The samples of a frame, and which of them are holes if any are."""
        from ..field.missing import filled

        field, gone = self._read(number)
        return (field, gone) if gone is None or self.fill is None else (filled(field, gone, self.fill, isovalues), None)

    def range(self, progress: Callable[[int, int], object] | None) -> tuple[float, float]:
        """The least and the largest sample of all frames.

        Raises
        ------
        InputError
            If all are missing.
        """
        found = []
        for number in range(len(self)):
            field, gone = self._read(number)
            there = field if gone is None else field[~gone]
            if there.size:
                found.append(range_of(there))
            if progress and len(self) > 1:
                progress(number + 1, len(self))
        if not found:
            raise InputError("all samples are missing", code="missing")
        return min(low for low, _ in found), max(high for _, high in found)

    def each(self, isovalues: Sequence[float]) -> Iterator[tuple[NDArray[Any], NDArray[Any] | None]]:
        """The samples of all frames as `samples` has them, each looked at on the way.

        Raises
        ------
        InputError
            If no frame has the label.
        """
        for number in range(len(self)):
            field, hole = self.samples(number, isovalues)
            gone = self._read(number)[1]
            self.missing += 0 if gone is None else int(gone.sum())
            self.holes += 0 if hole is None else int(hole.sum())
            self.dtype = field.dtype
            there = field if hole is None else field[~hole]
            if there.size:
                low, high = there.min(), there.max()
                self._ends = (low, high) if self._ends is None else (min(low, self._ends[0]), max(high, self._ends[1]))
            for isovalue in isovalues if field.dtype.kind in self.tied else ():
                self._ties[isovalue] = self._ties.get(isovalue, 0) + int((there == isovalue).sum())
            yield field, hole
        if self._label is not None and self._ends is not None and not self._ends[1]:
            raise InputError(f"no sample has the label {self._label:g}", code="label")

    def warn(self, source: Path, isovalues: Sequence[float], valued: bool, preserve_topology: bool) -> None:
        """Say which isovalues lie outside the data, and of which there are samples that may surprise, if these were
        looked for."""
        assert self._ends is not None
        low, high = self._ends
        for isovalue in isovalues:
            if not low <= isovalue < high:
                warn(
                    source, f"the isovalue {isovalue:g} lies outside the data ({low:g} to {high:g}): the curve is empty"
                )
        tied = [isovalue for isovalue, count in self._ties.items() if count]
        if not tied:
            return
        text = "points of the contour coincide there" if valued else "they count as below"
        if preserve_topology:
            text = "they count as below in the topology"
        elif self.dtype.kind in "biu" and len(tied) == 1:
            text += f", which {tied[0] + 0.5:g} avoids"
        of = f"the isovalue {tied[0]:g}" if len(tied) == 1 else f"one of {len(tied)} isovalues ({tied[0]:g}, ..)"
        warn(source, f"{sum(self._ties.values()):,} samples equal {of}: {text}")
