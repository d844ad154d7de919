"""One interface to all encoders, chosen by the type of what is encoded (spec clauses 3.5.7, 5.11, 8.1)."""

from __future__ import annotations

import os
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import Checksum, ChunkType, DomainKind

from ..drawing.smoothing import SMOOTHING
from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.labelling import listed
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..field.times import Time, time_text, time_texts, times_of
from ..format.chunks import write_chunk
from ..limits import Limits
from ..tin.tin import Tin
from .container import ContainerEncoder
from .decoder import Decoder
from .file_info import FileInfo
from .given import GivenField, completed, field_of, levels_of, taken
from .grid_encoder import GridEncoder, GridFrames
from .grid_file import Report, grid_file
from .inspect import inspect
from .mesh_encoder import MeshEncoder, MeshFrames
from .options import EncodeOptions, Isovalues, Options
from .series import Series
from .splicing import whole_frames
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
    field = field_of(what)
    given, samples = completed(field, isovalue, asked, [field])
    series = Series(given.isovalues, None, given.options.independent)
    file = grid_file(samples, series, given.options, given.placement, report=progress)
    # a label may be missing, which is known only then
    return GridEncoder(file, samples if given.labels is None else [*samples])


class Encoder:
    """Encodes frames of the same shape, added one by one, into a file: time steps, slices, channels.

    Each frame is predicted from the one before. At most two frames are in memory. The file takes two bytes a frame, and
    two at its end, more than that of `encode`: they let readers know of each frame as soon as it has arrived.

    Parameters
    ----------
    isovalue : number or sequence of numbers, optional
        As for `encode`; the same for all frames. None if the frames are of bool or labels.
    **options
        Options of `encode`; frames whose number is a multiple of ``interval``, 16 by default, are key frames, at which
        decoding can begin.

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
        self._options = isovalue, Options.of(**options), progress
        self._frames = SeriesFrames(*self._options)
        self._checksum = 0
        self._finished = False

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], isovalue: Isovalues | None = None, *, progress: Report | None = None,
        **options: Unpack[EncodeOptions],
    ) -> Encoder:
        """Continue a file whose writer has been interrupted, with the bytes that it would have written.

        The file is shortened to its complete frames, `frames` of them; the next ones can then be appended to it. A
        finished file can be continued, too. The first frame added afterwards needs the placement, the labels and the
        mesh of the others again.

        Parameters
        ----------
        path : path
            What an `Encoder` has written, up to any byte.
        isovalue, progress, **options
            As for the `Encoder` that began the file.

        Raises
        ------
        OSError
            If the file cannot be read or shortened.
        OptionError
            If it was not written frame by frame. `add` raises it if the file was begun with other options,
            but for the precision, which may change between frames.
        FormatError
            If it is damaged. The file is then unchanged.
        """
        encoder = cls(isovalue, progress=progress, **options)
        data = Path(path).read_bytes()
        begun = whole_frames(data)
        if len(begun) < len(data):
            os.truncate(path, len(begun))
        if begun:
            encoder._frames = SeriesFrames(*encoder._options, begun=begun)
            encoder._checksum = zlib.crc32(begun)
        return encoder

    @property
    def frames(self) -> int:
        """Number of frames that have been added."""
        return self._frames.count

    def add(self, frame: ArrayLike | Field | Mesh, time: Time | None = None) -> bytes:
        """Encode one more frame.

        Parameters
        ----------
        frame : Field, (s0, s1) or (s0, s1, s2) array_like; or Mesh, and (V,) array_like after it
            A frame with the shape and type of the first one. Placement and notes are taken from the first frame; for a
            mesh, points and cells.
        time : number, text or date, optional
            The time of the frame: a number, also with a unit as ``"6 h"``, or a date, in UTC unless it states its time
            zone. Either all frames have one, of the same kind and unit, or none.

        Returns
        -------
        bytes
            All bytes of this frame, for the first one with those that begin the file. What has been returned so far
            decodes to all frames added so far.

        Raises
        ------
        InputError
            If the frame cannot be encoded, or differs from the first one in shape, type, missing samples or the kind of
            its time. Frames that were added before are kept.
        OptionError
            If options do not apply, or the series is finished.
        """
        self._check_open()
        return self._ended(self._frames.chunks(frame, time))

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
    begun : bytes
        A file of complete frames that is continued.

    Attributes
    ----------
    grid : GridFrames or None
        Encoder of the frames, once the first one has shown that they are fields.
    count : int
        Number of frames encoded.
    """

    def __init__(
        self, isovalue: Isovalues | None, options: Options, progress: Report | None, known: Any = None,
        begun: bytes = b"",
    ) -> None:
        self._isovalue, self._options, self._report, self._known = isovalue, options, progress, known
        self._begun = begun
        self._info = inspect(begun) if begun else None
        self.grid: GridFrames | None = None
        self._mesh: MeshFrames | None = None
        self._given: GivenField | None = None
        self._alike: tuple[tuple[int, ...], np.dtype[Any]] = (), np.dtype(np.bool_)
        self._found: set[float] = set()
        self.count = 0 if self._info is None else len(self._info.frames)
        self._time = None if self._info is None else self._info.frames[0].time

    def check_whole(self) -> None:
        """Refuse a series without frames, and labels that no frame has."""
        if not self.count:
            raise InputError("a series without frames", code="frames", remedy="add at least one")
        for label in (self._given.labels if self._given else None) or ():
            if label not in self._found and self._info is None:
                raise InputError(f"no frame has the label {label:g}", code="label")

    def chunks(self, frame: Any, time: Time | None = None) -> list[bytes]:
        """Return the chunks of a frame; if an error is raised, earlier frames are kept."""
        self._now = self._checked(time)
        if self._mesh is None and self._info is not None and self._info.domain and not isinstance(frame, Mesh):
            raise InputError("the first frame that continues a file on a mesh has no mesh", code="mesh",
                             remedy="add a Mesh with its values")
        if self._mesh is not None or (self.grid is None and isinstance(frame, Mesh)):
            out = self._of_mesh(frame)
        else:
            out = self._of_grid(field_of(frame))
        if not self.count:
            self._time = self._now
        self.count += 1
        self._begun = b""
        return out

    def _checked(self, time: Time | None) -> str | None:
        """The time of a frame as a note; raises `InputError` if it does not suit that of the first frame."""
        text = None if time is None else time_text(time)
        if self.count and text != self._time and times_of([self._time, text]) is None:
            now, first = ("no time" if one is None else f"the time {one}" for one in (text, self._time))
            raise InputError(f"frame {self.count} has {now}, but the first frame has {first}", code="time",
                             remedy="give all frames times of the same kind, or none")
        return text

    def _continued(self, beginning: list[bytes], isovalues: list[float], mesh: Mesh | None = None) -> Decoder:
        """Decode the last frame of the file that is continued.

        Raises `OptionError` if the file does not begin as the encoder of the next frame would have begun it.
        """
        assert self._info is not None
        mine = b"".join(beginning)
        if isovalues != self._info.isovalues or _alike(mine, inspect(mine)) != _alike(self._begun, self._info):
            raise OptionError(
                "the file was begun with other isovalues or options, or with fields of another shape, mesh, placement "
                "or other missing samples", code="resume", remedy="give what the file was begun with",
            )
        known = self._info.domain is not None and self._info.domain.kind == DomainKind.KNOWN
        given = (mesh.points, mesh.cells) if mesh is not None and mesh.cells is not None and known else None
        decoder = Decoder(Limits(memory=sys.maxsize), mesh=given, frame=self.count - 1)
        decoder.feed(self._begun)
        return decoder.take()

    def _of_grid(self, field: Field) -> list[bytes]:
        given, grid = self._given, self.grid
        alike = field.shape, np.asarray(field.values).dtype
        if given is None or grid is None:
            if self._info is not None and field.labels is not None:
                self._check_labels(field, self._info.isovalues)
                field = replace(field, labels=tuple(self._info.isovalues))
            given, samples = completed(field, self._isovalue, self._options, self._known, series=True)
            if self._info is not None:
                smooth = self._options.precision.smooth and SMOOTHING in self._info.metadata
                precision = replace(given.options.precision, smooth=smooth)
                given = replace(given, options=replace(given.options, precision=precision))
            series = Series(given.isovalues, given.options.interval, given.options.independent)
            grid = GridFrames(grid_file(samples, series, given.options, given.placement, report=self._report))
            if self._info is not None:
                grid.resume(self._continued(grid.file.beginning(), series.isovalues))
        else:
            self._check_alike(field, given, *alike)
            samples = given.samples(field)
        if given.labels is not None:
            samples = [*samples]
        grid.file.series.time = self._now
        out = grid.chunks(samples)
        if given.labels is not None:
            self._found |= {one.isovalue for one in samples if one.signs.any()}
        self.grid, self._given, self._alike = grid, given, alike
        return out

    def _check_alike(self, field: Field, given: GivenField, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        """Refuse a frame that differs from the first one in shape or type, or has labels that would not be encoded."""
        if shape != self._alike[0]:
            raise InputError(
                f"frame {self.count} has the shape {_shape(shape)}, but earlier frames have {_shape(self._alike[0])}",
                code="frames", remedy="all frames of a file must have the same shape",
            )
        if dtype != self._alike[1]:
            raise InputError(
                f"frame {self.count} holds {dtype}, but earlier frames hold {self._alike[1]}", code="frames",
                remedy="convert all frames to the same type",
            )
        self._check_labels(field, given.labels or ())

    def _check_labels(self, field: Field, labels: Sequence[float]) -> None:
        """Refuse a frame with labels that would not be encoded."""
        more = {*(field.labels or ())} - {*labels}
        if more:
            every = sorted({*more, *labels})
            raise InputError(
                f"frame {self.count} has labels that the first frame does not: {listed(sorted(more), ', ')}",
                code="label", remedy=f"give each frame the same: labels=({listed(every, ', ')})",
            )

    def _of_mesh(self, frame: Any) -> list[bytes]:
        if self._mesh is None:
            isovalues = levels_of(frame, self._isovalue, self._options, self._known)
            series = Series(isovalues, self._options.interval, self._options.independent)
            mesh = MeshFrames(frame, series, self._options, complete=False, report=self._report)
            if self._info is not None:
                mesh.resume(self._continued(mesh.beginning(), isovalues, frame))
            self._mesh = mesh
        self._mesh.series.time = self._now
        values: Any = frame.values if isinstance(frame, Mesh) else frame
        return self._mesh.chunks(values)


class _SeriesEncoder(ContainerEncoder):
    """Encodes a series whose frames are all given."""

    def __init__(
        self, frames: Frames, isovalue: Isovalues | None, options: Options, progress: Report | None
    ) -> None:
        if frames.interval is not None:
            options = Options.of(**{**vars(options), "interval": frames.interval})
        self._given, self._times = frames, frames.times
        # frames that can be read only once cannot be examined in advance
        self._frames = SeriesFrames(isovalue, options, progress, frames if frames.repeatable else None)

    def _chunks(self) -> Iterator[bytes]:
        times = self._times
        for number, frame in enumerate(self._given):
            if times is not None and number == len(times):
                time_texts(times, number + 1)  # refuses too few
            yield from self._frames.chunks(frame, None if times is None else times[number])
        self._frames.check_whole()
        time_texts(times, self._frames.count)


def _alike(data: bytes, info: FileInfo) -> list[bytes]:
    """Collect what a series begins with apart from notes: header, mesh, coordinates, mask, interval of key frames."""
    last = next((i for i, chunk in enumerate(info.chunks) if chunk.type == "series"), len(info.chunks))
    kept = [chunk for chunk in info.chunks[: last + 1] if chunk.type != "metadata"]
    return [data[: info.chunks[0].offset], *(data[chunk.offset : chunk.offset + chunk.bytes] for chunk in kept)]


def _shape(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
