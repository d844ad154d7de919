"""The frames of a series in a file: slices of an array or a volume, pages, or the volumes of a NIfTI file."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import OptionError
from .place import Place, read_place
from .read import numbers, read_field
from .reading import reading
from .source import Source, source_of
from .volume import (
    ITK_SUFFIXES,
    NIFTI_SUFFIXES,
    NiftiVolumes,
    is_series_of_volumes,
    itk_array,
    itk_reader,
    open_nifti,
    single,
)


@dataclass(frozen=True)
class Frames:
    """Frames, each made when it is asked for.

    Attributes
    ----------
    shape : tuple of int
        Of the array that the file holds.
    axis : int
        Which of its axes counts the frames, from 0.
    frame : callable
        Gives the one of a number, (s0, s1) or (s0, s1, s2) array.
    place : Place
        Where the samples of each of them lie.
    step : str
        Time from one to the next with its unit, if the file says so; else empty.
    """

    shape: tuple[int, ...]
    axis: int
    frame: Callable[[int], NDArray[Any]]
    place: Place = field(default_factory=Place)
    step: str = ""

    def __len__(self) -> int:
        return self.shape[self.axis]


def read_frames(
    path: str | os.PathLike[str], axis: int | None = None, *, key: str | None = None, channel: int | None = None,
    frame: int | None = None, samples: int | None = None, follow: bool = False, placed: bool = True,
) -> Frames:
    """The frames of a file.

    Parameters
    ----------
    path, key, channel, frame, samples, follow
        As of `read_field`: with ``frame`` slices of that one of a series. Of a NIfTI file with four axes volumes are
        read one at a time, and ``samples`` bounds each.
    axis : int, optional
        The axis that counts them: the first if not given, the last of such a NIfTI file.
    placed : bool
        Read where samples lie, too.

    Raises
    ------
    OptionError
        If the field has not three or four axes, or not this one.
    OSError, InputError, LimitError, MissingExtraError
        As `read_field`.
    """
    source = source_of(path, samples, follow)
    given: dict[str, Any] = {"samples": samples, "follow": follow}
    if (key, channel, frame) == (None, None, None) and (volumes := _volumes(source)) is not None:
        if axis not in (None, 3, -1):
            raise OptionError(f"--frame-axis {axis}: the last axis counts the volumes of this file", code="frame")
        return replace(volumes, place=read_place(path, volumes.frame(0).ndim, **given)) if placed else volumes
    whole = read_field(path, key=key, channel=channel, frame=frame, **given)
    axis = 0 if axis is None else axis
    if whole.ndim not in (3, 4):
        raise OptionError(
            f"--frames makes a series of an array of three or four axes; the data have {whole.ndim}", code="frame"
        )
    if not -whole.ndim <= axis < whole.ndim:
        raise OptionError(f"--frame-axis {axis}: the data have the axes 0 to {whole.ndim - 1}", code="frame")
    axis %= whole.ndim
    in_turn = np.moveaxis(whole, axis, 0)
    asked = (lambda n, frame: read_place(path, n, key, frame=frame, **given)) if placed else (lambda n, frame: Place())
    return Frames(whole.shape, axis, lambda number: in_turn[number], _place_of_slices(asked, axis, whole.ndim - 1))


def _volumes(source: Source) -> Frames | None:
    """The volumes of a NIfTI, NRRD or MetaImage file that has a series of them; those of NIfTI are not read yet."""
    if source.named(*NIFTI_SUFFIXES):
        with reading("NIfTI volume"):
            if is_series_of_volumes(open_nifti(source).dataobj.shape):
                volumes = NiftiVolumes(source)
                return Frames(volumes.shape, 3, lambda number: numbers(volumes[number]), step=volumes.step)
    elif source.named(*ITK_SUFFIXES):
        with reading("volume"):
            if is_series_of_volumes(itk_reader(source).GetSize()):
                whole = itk_array(source)
                return Frames(whole.shape, 3, lambda number: numbers(single(whole, number)))
    return None


def _place_of_slices(read: Callable[[int, int | None], Place], axis: int, n: int) -> Place:
    """Where the samples of a slice of n axes lie; ``read`` asks the input, of so many axes and of one of its frames.

    Files say it of slices along their first axis: times, pages. Ends that meet are not joined in a series.
    """
    if axis:
        whole = read(n + 1, None)
        if whole.placement is None and whole.mapped is None and not whole.remark:
            return Place()
        return Place(remark="its coordinates are ignored; set the steps of a slice with --spacing")
    place = read(n, 0)
    if place.mapped is None or not place.mapped.periodic:
        return place
    remark = f"its ends along axis {place.mapped.periodic[0]} are not joined, as it is a series"
    return replace(place, mapped=replace(place.mapped, periodic=()), remark=remark)


def one_frame(field: NDArray[Any], place: Place) -> Frames:
    """A field as the only frame of a series."""
    return Frames((1, *field.shape), 0, lambda number: field, place)


