"""An input that is open, whatever its format: what its header states, and its samples when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import OptionError
from ...field.cropping import PartWindows
from ...field.missing import missing_samples
from ...field.placement import FRAME_STEP, Placement
from ...field.sampled import Field
from .reading import about
from .slices import Slices
from .source import InputFile, check_kind

Array = NDArray[Any]
Held = TypeVar("Held")
IN_MEMORY = InputFile(Path())
"""Source of what is in memory already."""


@dataclass(frozen=True)
class Choice:
    """Choice from an input that holds several things.

    Attributes
    ----------
    key, channel, slice_tolerance, bbox, frame, average, classes, labels
        As of `isocodec.read`, ``average`` being its ``average_cells``; ``frame`` of meshes only.
    """

    key: str | None = None
    channel: int | None = None
    slice_tolerance: float | None = None
    bbox: tuple[float, ...] | None = None
    frame: int | None = None
    average: bool = False
    classes: tuple[int, ...] = ()
    labels: bool = False


class Opened:
    """An input that is open; a context manager, or to be closed.

    Subclasses read the header in ``_open`` and give ``_values``, and where the format has them ``_place``, ``_windows``
    and ``_series``. Errors in any of these name the input.

    Parameters
    ----------
    source : InputFile or object
        A file, or what is in memory already, which is then ``_given``.
    choice : Choice, optional

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis, without the axes of one sample that a format adds.
    dtype : dtype
    nodata : float or None
        Value of missing samples, besides NaN.
    name, unit : str or None
        What the values are, and their unit.
    label : str
        How errors name the input; empty for objects in memory.
    remarks : tuple of str
        What the input holds and is left out, besides what its placement remarks on.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    nodata: float | None = None
    name: str | None = None
    unit: str | None = None
    label: str = ""
    remarks: tuple[str, ...] = ()

    def __init__(self, source: Any, choice: Choice | None = None) -> None:
        of_file = isinstance(source, InputFile)
        self._source: InputFile = source if of_file else IN_MEMORY
        self._given: Any = None if of_file else source
        self._held = ExitStack()
        try:
            self._open(choice or Choice())
        except BaseException:
            self._held.close()
            raise

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the files that are open for this input."""
        # without the error that ended its use, if any: that is not about opening
        self._held.close()

    def hold(self, resource: AbstractContextManager[Held]) -> Held:
        """Keep a resource open as long as this input."""
        return self._held.enter_context(resource)

    def holding(self, first: ExitStack) -> Opened:
        """Keep something open that is closed last; returns the same input."""
        first.callback(self._held.close)
        self._held = first
        return self

    def hand_over(self) -> ExitStack:
        """Hand over what is kept open, with the duty to close it."""
        return self._held.pop_all()

    def values(self, frame: int | None = None) -> Array:
        """Read the samples (s0, .., sn-1), or one frame of a series, contiguous, native, with the stored type.

        Frames are counted along the first axis of an array, the last of volumes. Truth values of files become uint8.

        Raises
        ------
        InputError, LimitError, MissingExtraError
        OptionError
            If the series has no such frame.
        """
        return np.asarray(self._known(frame))

    def _known(self, frame: int | None) -> Array:
        """The samples, of a masked array if the format states which are missing."""
        with about(self.label):
            return numbers(self._values(frame))

    def place(self, n: int, frame: int | None = None) -> Placement:
        """Find where samples lie, of a field of n axes: the whole, a frame of a series, or one of its slices."""
        with about(self.label):
            return self._place(n, frame)

    def windows(self, nodata: float | None = None) -> Any:
        """Give an object with ``shape``, ``dtype`` and slices, which reads windows alone; None if the format has none.

        Samples that equal ``nodata`` are masked.
        """
        with about(self.label):
            found = self._windows()
            return found if found is None or nodata is None else PartWindows(found, nodata=nodata)

    def windowed(self, nodata: float | None = None) -> Field | None:
        """Describe a field as `field` does, but without reading its samples; None if the format has no windows."""
        found = self.windows(nodata)
        if found is None:
            return None
        place = self.place(len(found.shape))
        values: Any = PartWindows(found)
        return Field(
            values, None, place if place.placed else None, unit=self.unit, name=self.name,
            remarks=(*self.remarks, *((place.remark,) if place.remark else ())),
        )

    def field(self, frame: int | None = None, *, nodata: float | None = None) -> Field:
        """Read a field with all that the input states, or with another value of missing samples (NaN: only NaN)."""
        values = self._known(frame) if nodata is None else self.values(frame)
        return self._described(values, self.place(values.ndim, frame), self.nodata if nodata is None else nodata)

    def frames(self, axis: int | None = None, frame: int | None = None, *, placed: bool = True) -> Slices:
        """Give the samples as a series, or the slices of one volume of a series.

        ``axis`` counts frames: the first one unless the format states another, which is then the only choice.

        Raises
        ------
        OptionError
            If the samples do not have three or four axes, or not this one.
        InputError, LimitError, MissingExtraError
        """
        with about(self.label):
            series = None if frame is not None else self._series()
            if series is not None:
                if axis not in (None, series.axis, -1):
                    raise OptionError(f"--frame-axis {axis}: the last axis counts volumes in this file", code="frame")
                return replace(series, place=self._place(len(series.frame_shape), None)) if placed else series
            whole = self._slices(frame)
            axis = 0 if axis is None else axis
            if whole.ndim not in (3, 4):
                raise OptionError(
                    f"--frames makes a series of an array of three or four axes; the data have {whole.ndim}",
                    code="frame",
                )
            if not -whole.ndim <= axis < whole.ndim:
                raise OptionError(f"--frame-axis {axis}: the data have the axes 0 to {whole.ndim - 1}", code="frame")
            axis %= whole.ndim
            in_turn = whole.transpose([axis, *(each for each in range(whole.ndim) if each != axis)])
            place = self._place_of_slices(axis, whole.ndim - 1) if placed else Placement()
            return Slices(whole.shape, axis, lambda number: in_turn[number], in_turn.shape[1:], place)

    def fields(self, slices: Slices, nodata: float | None = None) -> Callable[[int], Field]:
        """Give what makes a field of each of some slices."""
        marker = self.nodata if nodata is None else nodata
        notes = {FRAME_STEP: slices.step} if slices.step else {}
        return lambda number: self._described(slices.frame(number), slices.place, marker, notes)

    def _described(
        self, values: Array, place: Placement, nodata: float | None, notes: Mapping[str, str] | None = None
    ) -> Field:
        gone = missing_samples(np.asarray(values), nodata)
        if values.dtype.kind == "f":
            gone &= ~np.isnan(np.asarray(values))
        return Field(
            values, gone if gone.any() else None, place if place.placed else None, unit=self.unit, name=self.name,
            notes=notes, remarks=(*self.remarks, *((place.remark,) if place.remark else ())),
        )

    def _place_of_slices(self, axis: int, n: int) -> Placement:
        """Placement of a slice of n axes: files state it for slices along their first axis (times, pages)."""
        if axis:
            whole = self._place(n + 1, None)
            if not whole.placed and not whole.remark:
                return Placement()
            return Placement(remark="its coordinates are ignored; set the steps of a slice with --spacing")
        place = self._place(n, 0)
        return unjoined(place)

    def _open(self, choice: Choice) -> None:
        raise NotImplementedError

    def _values(self, frame: int | None) -> Array:
        raise NotImplementedError

    def _place(self, n: int, frame: int | None) -> Placement:
        return Placement()

    def _slices(self, frame: int | None) -> Any:
        """The array that is cut into frames, with all of its axes."""
        return numbers(self._values(frame))

    def _windows(self) -> Any:
        """The samples by slices, or None."""
        return None

    def _series(self) -> Slices | None:
        """The frames of a format that states which axis counts them."""
        return None


class Windows:
    """A file's samples, by slices; opened where it is read, so that other processes receive no more than its name."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __init__(self, path: Path) -> None:
        self._path = path.resolve()
        self.shape, self.dtype = self._file.shape, self._file.dtype

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_file"}

    @cached_property
    def _file(self) -> Any:
        raise NotImplementedError


@dataclass(frozen=True)
class Format:
    """A format of fields.

    Attributes
    ----------
    suffixes : tuple of str
        In lower case, with their dots.
    extra : str
        Extra of this package with the library that reads it; empty if none is needed.
    signatures : tuple of (int, bytes, str)
        Offset and bytes by which a file without a name is recognised, and the suffix that it gets.
    keyed, channels, folder, averages : bool
        Whether a file may hold several arrays, or channels of a picture; is a folder; has values of cells.
    confined : str
        Library that is called in a process apart, as it may crash or hang; empty if it is called here.
    """

    name: str
    suffixes: tuple[str, ...]
    open: Callable[[InputFile, Choice], Opened]
    extra: str = ""
    signatures: tuple[tuple[int, bytes, str], ...] = ()
    keyed: bool = False
    channels: bool = False
    folder: bool = False
    confined: str = ""
    averages: bool = False


def unjoined(place: Placement) -> Placement:
    """Placement of frames, whose ends are not joined, with a remark if they meet."""
    if not place.periodic:
        return place
    remark = f"its ends along axis {place.periodic[0]} are not joined, as it is a series"
    return replace(place, periodic=(), remark="; ".join(filter(None, (place.remark, remark))))


def numbers(array: Array) -> Array:
    """Check that ``array``, which may be masked, holds real numbers; make it contiguous, native, truth values uint8."""
    check_kind(array.dtype)
    if array.dtype.kind == "b":
        array = array.astype(np.uint8)
    bare = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
    return np.ma.MaskedArray(bare, np.ascontiguousarray(array.mask)) if hasattr(array, "mask") else bare

