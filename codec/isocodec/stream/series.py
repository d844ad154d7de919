"""Series of frames, encoded one frame after the other (spec clauses 3.5.7, 5.11)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import Checksum, ChunkType

from ..errors import InputError, OptionError
from ..format.chunks import write_chunk, write_further
from ..format.frames import FRAME_BEFORE, as_last, is_key, write_frame, write_interval
from ..grid.layers.writer import LayerWriter
from ..grid.tube.holes import Holes
from .encoder import Earlier, Encoder
from .names import Isovalues
from .options import EncodeOptions, check_interval


class SeriesEncoder:
    """Encodes isocontours of frames of one shape, which come one by one: time steps, slices, channels.

    Each frame leans on the one before. No more than two of them are in memory.

    Parameters
    ----------
    isovalue : number or sequence of numbers
        As in `encode`; the same for all frames.
    interval : int
        Every so many frames one leans on none before it, so that those from there on decode without the others; 0 if
        only the first does.
    **options
        Those of `encode`; a mask is that of all frames.

    Raises
    ------
    OptionError
        If the interval is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> series = SeriesEncoder(0.5)
    >>> y, x = np.mgrid[:32, :32]
    >>> data = b"".join(series.add(np.hypot(y - 16, x - 16 - t) - 9.0) for t in range(3)) + series.finish()
    """

    def __init__(
        self, isovalue: Isovalues, *, interval: int = 0, **options: Unpack[EncodeOptions]
    ) -> None:
        self._isovalue = isovalue
        self._interval = check_interval(interval)
        self._options = options
        self._frames = 0
        self._before: _FrameEncoder | None = None
        self._dtype: np.dtype[Any] | None = None
        self._waiting = b""
        self._checksum = 0
        self._finished = False

    @property
    def frames(self) -> int:
        """Frames that have been added."""
        return self._frames

    def add(self, field: ArrayLike) -> bytes:
        """Encode one more frame.

        Parameters
        ----------
        field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats

        Returns
        -------
        bytes
            Some more bytes of the file, which belong to this frame and the end of the one before.

        Raises
        ------
        InputError
            If the frame cannot be encoded, or differs from the first one in shape, type or missing samples. Frames that
            were added stay.
        OptionError
            If options contradict one another, or the series is finished.
        """
        self._check_open()
        array: NDArray[Any] = np.ma.asanyarray(field)
        self._check_alike(array)
        before = self._before
        key = is_key(self._frames, self._interval)
        frame = _FrameEncoder(array, self._isovalue, before, key, self._options)
        chunks = list(frame.chunks(self._interval))
        self._before, self._dtype = frame, array.dtype
        frame.part()
        self._frames += 1
        return self._written([self._waiting, *chunks[:-1]], chunks[-1])

    def finish(self) -> bytes:
        """The last bytes of the file.

        Raises
        ------
        InputError
            If there are no frames.
        OptionError
            If the series is finished.
        """
        self._check_open()
        if not self._frames:
            raise InputError("a series without frames", code="frames", remedy="add at least one")
        self._finished = True
        out = self._written([as_last(self._waiting)], b"")
        return out + Checksum.build(self._checksum)

    def _written(self, chunks: list[bytes], waiting: bytes) -> bytes:
        """Bytes that are ready; the last chunk waits, since it may be the last one of the file."""
        out = b"".join(chunks)
        self._checksum = zlib.crc32(out, self._checksum)
        self._waiting = waiting
        return out

    def _check_open(self) -> None:
        if self._finished:
            raise OptionError("the series is finished", code="finished", remedy="make another SeriesEncoder")

    def _check_alike(self, field: NDArray[Any]) -> None:
        """Refuse a frame that is not like the first one."""
        if self._before is None:
            return
        shape = self._before.header.shape
        if field.shape != shape:
            raise InputError(
                f"frame {self._frames} has the shape {_shape(field.shape)}, those before {_shape(shape)}",
                code="frames", remedy="frames of one file have one shape",
            )
        if field.dtype != self._dtype:
            raise InputError(
                f"frame {self._frames} holds {field.dtype}, those before {self._dtype}", code="frames",
                remedy="convert all frames to one type",
            )


class _FrameEncoder(Encoder):
    """Encodes one frame of a series, leaning on the one before unless it is a key frame."""

    def __init__(
        self, field: NDArray[Any], isovalue: Isovalues, before: _FrameEncoder | None, key: bool,
        options: Mapping[str, Any],
    ) -> None:
        self._first = before is None
        self._earlier: list[LayerWriter] = [] if before is None or key else before._strands
        self._key = key
        self._gone: NDArray[np.bool_] | None = None
        self._of_series = before
        super().__init__(field, isovalue, **options)
        self._of_series = None

    def _encoded_mask(self, gone: NDArray[np.bool_] | None) -> tuple[bytes, Holes | None]:
        """That of the first frame, which all others share."""
        self._gone = gone
        before = self._of_series
        if before is None:
            return super()._encoded_mask(gone)
        if not _same(gone, before._gone):
            raise InputError(
                "other samples are missing than in the first frame", code="frames",
                remedy="fill them, or give one mask for all frames",
            )
        self._gone = before._gone
        return before._mask_run, before._holes

    def _leans_on(self, number: int) -> Earlier | None:
        if self._earlier and self.options.leaning:
            return Earlier(self._earlier[number], self.isovalues[number], FRAME_BEFORE)
        return super()._leans_on(number)

    def chunks(self, interval: int) -> Iterator[bytes]:
        """The chunks of the frame, the first one with the header before it."""
        if self._first:
            yield from self._beginning()
            yield write_chunk(ChunkType.FRAME, write_interval(interval))
        for number, isovalue in enumerate(self.isovalues):
            lean = self._lean_of_first if number == 0 else None
            if number > 0:
                strand, lean = self._strand(number, self._strands[-1].progress)
                self._strands.append(strand)
            of = None if lean is None else lean.number
            if not self._first:
                payload = write_frame(of, self._key)
                alone = bool(self._strands[number].layers) and (number == 0 or bool(self._strands[number - 1].layers))
                # layers that begin with a base begin the next isovalue by themselves
                if payload or not alone:
                    yield write_chunk(ChunkType.FRAME, payload)
            elif number > 0:
                yield write_chunk(ChunkType.ISOVALUE, write_further(isovalue, of))
            yield from self._layers(self._strands[number], False)

    def part(self) -> None:
        """The frame is done: keep what the next one leans on."""
        self._earlier = []
        for strand in self._strands:
            strand.tube.part()
        self._fields.clear()
        self._truths.clear()


def encode_frames(
    fields: Sequence[ArrayLike], isovalue: Isovalues, *, interval: int = 0,
    **options: Unpack[EncodeOptions],
) -> bytes:
    """Encode a series of frames of one shape into one file: time steps, slices, channels.

    Parameters
    ----------
    fields : iterable of (s0, s1) or (s0, s1, s2) array_like
        Frames in their order, of one shape and type; an array's first axis counts them.
    isovalue, options
        As in `encode`, the same for all frames.
    interval : int
        Every so many frames one leans on none before it, so that those from there on decode without the others; 0 if
        only the first does.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        If a frame cannot be encoded, frames differ in shape, type or missing samples, or there are none.
    OptionError
        If options contradict one another or are out of range.
    """
    series = SeriesEncoder(isovalue, interval=interval, **options)
    out = [series.add(field) for field in fields]
    return b"".join(out) + series.finish()


def _same(a: NDArray[np.bool_] | None, b: NDArray[np.bool_] | None) -> bool:
    """Whether the same samples are missing."""
    if a is None or b is None:
        return a is b
    return bool((a == b).all())


def _shape(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))

