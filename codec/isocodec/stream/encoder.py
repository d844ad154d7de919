"""One interface to all encoders, chosen by the type of what is encoded (spec clauses 3.5.7, 5.11, 8.1)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import Checksum, ChunkType

from ..drawing.smoothing import SMOOTHING
from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.labelling import listed
from ..field.meshed import Mesh
from ..field.placement import Placement
from ..field.sampled import Field
from ..field.samples import Samples
from ..format.chunks import write_chunk
from ..search.original import original
from ..search.rounds import rounds_for
from ..search.tolerance import radices
from ..tin.tin import Tin
from .container import ContainerEncoder, Ending
from .given import field_of, frames_of, levels_of, options_of, placement_of_file, samples_of, taken
from .grid_encoder import GridEncoder, GridFrames, Report, grid_file
from .mesh_encoder import MeshEncoder, MeshFrames
from .options import EncodeOptions, Isovalues, Options
from .series import Series
from .surface_encoder import SurfaceEncoder

if TYPE_CHECKING:
    from typing import Unpack


def encoder_of(
    what: Any, isovalue: Isovalues | None = None, *, progress: Report | None = None, **options: Unpack[EncodeOptions]
) -> ContainerEncoder:
    """Make the encoder of a file, which yields its bytes chunk by chunk; parameters as for `isocodec.encode`."""
    asked = Options.of(**options)
    if isinstance(what, Tin):
        if isovalue is not None:
            raise OptionError("a surface has no isovalue", code="isovalue",
                              remedy="leave it out; from a file of a surface any contour can be decoded")
        return SurfaceEncoder(what, asked)
    if isinstance(what, Frames):
        return _SeriesEncoder(what, isovalue, asked, progress)
    what = taken(what)
    if isinstance(what, Mesh):
        return MeshEncoder(what, levels_of(what, isovalue, asked, [what]), asked, progress)
    return grid_encoder(field_of(what), isovalue, asked, progress)


def grid_encoder(
    field: Field, isovalue: Isovalues | None, options: Options, progress: Report | None = None
) -> GridEncoder:
    """Make the encoder of one field."""
    isovalues = levels_of(field, isovalue, options, [field])
    options = options_of(field, isovalue, options)
    placement = placement_of_file(field, options)
    samples = samples_of(field, isovalues, options, placement)
    options = _as_smooth(options, samples, placement)
    return GridEncoder(grid_file(samples, Series(isovalues), options, placement, report=progress), samples)


def _as_smooth(options: Options, fields: Sequence[Samples], placement: Placement | None) -> Options:
    """Options with the rounds of smoothing of a field at its isovalue, or without if it is too rough to be smoothed."""
    precision = options.precision
    if not precision.smooth:
        if SMOOTHING in options.metadata and precision.tolerance is not None:
            raise OptionError(f"the note {SMOOTHING} would break the promise of precision {precision.text!r}",
                              code="metadata", remedy=f'use precision "{precision.text} smooth"')
        return options
    if len(fields) > 1:
        raise OptionError("smooth applies to files of one isovalue: curves of several could cross", code="smooth",
                          remedy="leave it out")
    if placement is not None and placement.periodic:
        raise OptionError("periodic axes and smooth cannot be combined", code="periodic", remedy="leave it out")
    rounds = rounds_for(original(fields[0]), math.prod(radices(precision.offsets)))
    if not rounds:
        return replace(options, precision=replace(precision, smooth=False))
    return replace(options, metadata={**options.metadata, SMOOTHING: str(rounds)})


class Encoder:
    """Encodes frames of the same shape, added one by one, into a file: time steps, slices, channels.

    Each frame is predicted from the one before. At most two frames are in memory. The file takes two bytes a frame, and
    two at its end, more than that of `encode`: they let readers know of each frame as soon as it has arrived.

    Parameters
    ----------
    isovalue : number or sequence of numbers, optional
        As for `encode`; the same for all frames. None if the frames are of bool or labels.
    **options
        Options of `encode`; frames whose number is a multiple of ``interval`` are key frames, at which decoding can
        begin.

    Raises
    ------
    OptionError
        If options are out of range or cannot be combined.

    Examples
    --------
    >>> import numpy as np
    >>> series = Encoder(0.5)
    >>> y, x = np.mgrid[:32, :32]
    >>> data = b"".join(series.add(np.hypot(y - 16, x - 16 - t) - 9.0) for t in range(3)) + series.finish()
    """

    def __init__(
        self, isovalue: Isovalues | None = None, *, progress: Report | None = None, **options: Unpack[EncodeOptions]
    ) -> None:
        self._frames = SeriesFrames(isovalue, Options.of(**options), progress)
        self._checksum = 0
        self._finished = False

    @property
    def frames(self) -> int:
        """Number of frames that have been added."""
        return self._frames.count

    def add(self, frame: ArrayLike | Field | Mesh) -> bytes:
        """Encode one more frame.

        Parameters
        ----------
        frame : Field, (s0, s1) or (s0, s1, s2) array_like; or Mesh, and (V,) array_like after it
            A frame with the shape and type of the first one. Placement and notes are taken from the first frame; for a
            mesh, points and cells.

        Returns
        -------
        bytes
            All bytes of this frame, for the first one with those that begin the file. What has been returned so far
            decodes to all frames added so far.

        Raises
        ------
        InputError
            If the frame cannot be encoded, or differs from the first one in shape, type or missing samples. Frames that
            were added before are kept.
        OptionError
            If options do not apply, or the series is finished.
        """
        self._check_open()
        return self._ended(self._frames.chunks(frame))

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
        self._frames.check_whole()
        self._finished = True
        return self._ended([], last=True) + Checksum.build(self._checksum)

    def _ended(self, chunks: list[bytes], last: bool = False) -> bytes:
        """Chunks of a frame, and the one that marks its end."""
        data = b"".join([*chunks, write_chunk(ChunkType.FRAME_END, b"", ancillary=True, last=last)])
        self._checksum = zlib.crc32(data, self._checksum)
        return data

    def _check_open(self) -> None:
        if self._finished:
            raise OptionError("the series is finished", code="finished", remedy="make a new Encoder")


class SeriesFrames:
    """Makes chunks frame by frame, of fields or of values on a mesh; the first frame determines which.

    Parameters
    ----------
    isovalue, options, progress
        As for `encode`.
    known : iterable, optional
        All frames, if they can be examined in advance.

    Attributes
    ----------
    grid : GridFrames or None
        Encoder of the frames, once the first one has shown that they are fields.
    count : int
        Number of frames encoded.
    """

    def __init__(
        self, isovalue: Isovalues | None, options: Options, progress: Report | None, known: Any = None
    ) -> None:
        self._isovalue, self._options, self._report, self._known = isovalue, options, progress, known
        self.grid: GridFrames | None = None
        self._mesh: MeshFrames | None = None
        self._first: Field | None = None
        self._found: set[float] = set()
        self.count = 0

    def check_whole(self) -> None:
        """Refuse a series without frames, and labels that no frame has."""
        if not self.count:
            raise InputError("a series without frames", code="frames", remedy="add at least one")
        labels = None if self._first is None else self._first.labels
        for label in labels or ():
            if label not in self._found:
                raise InputError(f"no frame has the label {label:g}", code="label")

    def chunks(self, frame: Any) -> list[bytes]:
        """Return the chunks of a frame; if an error is raised, earlier frames are kept."""
        on_mesh = isinstance(frame, Mesh) if self._first is None and self._mesh is None else self._mesh is not None
        out = self._of_mesh(frame) if on_mesh else self._of_grid(field_of(frame))
        self.count += 1
        return out

    def _of_grid(self, field: Field) -> list[bytes]:
        first = self._first or field
        if self.grid is not None:
            self._check_alike(field, first)
            _check_labels(field, first, self.count)
            file = self.grid.file
            placement = placement_of_file(first, file.options)
            samples = samples_of(
                Field(field.values, field.mask, labels=first.labels, missing=first.missing), file.series.isovalues,
                file.options, placement, series=True,
            )
            self._found |= _inside(samples) if first.labels is not None else set()
            return self.grid.chunks(samples)
        isovalues = levels_of(field, self._isovalue, self._options, self._known)
        options = options_of(field, self._isovalue, self._options)
        placement = placement_of_file(field, options)
        samples = samples_of(field, isovalues, options, placement, series=True)
        options = _as_smooth(options, samples, placement)
        series = Series(isovalues, options.interval)
        grid = GridFrames(grid_file(samples, series, options, placement, report=self._report))
        out = grid.chunks(samples)
        # the samples themselves are no longer needed
        values = np.asarray(field.values)
        like = np.broadcast_to(np.zeros((), values.dtype), values.shape)
        self.grid = grid
        self._found = _inside(samples) if field.labels is not None else set()
        self._first = Field(like, None, field.placement, labels=field.labels, missing=field.missing)
        return out

    def _check_alike(self, field: Field, first: Field) -> None:
        """Refuse a frame that differs from the first one in shape or type."""
        if field.shape != first.shape:
            raise InputError(
                f"frame {self.count} has the shape {_shape(field.shape)}, but earlier frames have "
                f"{_shape(first.shape)}",
                code="frames", remedy="all frames of a file must have the same shape",
            )
        found, before = np.asarray(field.values).dtype, first.values.dtype
        if found != before:
            raise InputError(
                f"frame {self.count} holds {found}, but earlier frames hold {before}", code="frames",
                remedy="convert all frames to the same type",
            )

    def _of_mesh(self, frame: Any) -> list[bytes]:
        values: Any = frame.values if isinstance(frame, Mesh) else frame
        if self._mesh is None:
            isovalues = levels_of(frame, self._isovalue, self._options, self._known)
            self._mesh = MeshFrames(
                frame, Series(isovalues, self._options.interval), self._options, complete=False, report=self._report
            )
        return self._mesh.chunks(values)


class _SeriesEncoder(ContainerEncoder):
    """Encodes a series whose frames are all given."""

    def __init__(
        self, frames: Frames, isovalue: Isovalues | None, options: Options, progress: Report | None
    ) -> None:
        if frames.interval is not None:
            options = Options.of(**{**vars(options), "interval": frames.interval})
        self._given = frames
        self._frames = SeriesFrames(isovalue, options, progress, frames_of(frames))

    def _pieces(self) -> Iterator[bytes]:
        """Yield the pieces of the file without its checksum."""
        ending = Ending()
        for frame in self._given:
            yield ending.add(self._frames.chunks(frame))
        self._frames.check_whole()
        yield ending.last()


def _check_labels(field: Field, first: Field, number: int) -> None:
    """Refuse a frame with labels that the first one does not list, which would not be encoded."""
    more = {*(field.labels or ())} - {*(first.labels or ())}
    if more:
        every = sorted({*more, *(first.labels or ())})
        raise InputError(f"frame {number} has labels that the first frame does not: {listed(sorted(more), ', ')}",
                         code="label", remedy=f"give each frame the same: labels=({listed(every, ', ')})")


def _inside(samples: Sequence[Samples]) -> set[float]:
    """The isovalues that some samples lie above, or the labels that some samples have."""
    return {one.isovalue for one in samples if one.signs.any()}


def _shape(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
