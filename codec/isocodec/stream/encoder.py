"""One interface to all encoders, chosen by the type of what is encoded (spec clauses 3.5.7, 5.11, 8.1)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import Checksum, ChunkType

from ..errors import InputError, OptionError
from ..field.framed import Frames
from ..field.labelling import listed
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..format.chunks import write_chunk
from ..tin.tin import Tin
from .container import ContainerEncoder
from .given import GivenField, completed, field_of, levels_of, taken
from .grid_encoder import GridEncoder, GridFrames
from .grid_file import Report, grid_file
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
        self._given: GivenField | None = None
        self._alike: tuple[tuple[int, ...], np.dtype[Any]] = (), np.dtype(np.bool_)
        self._found: set[float] = set()
        self.count = 0

    def check_whole(self) -> None:
        """Refuse a series without frames, and labels that no frame has."""
        if not self.count:
            raise InputError("a series without frames", code="frames", remedy="add at least one")
        for label in (self._given.labels if self._given else None) or ():
            if label not in self._found:
                raise InputError(f"no frame has the label {label:g}", code="label")

    def chunks(self, frame: Any) -> list[bytes]:
        """Return the chunks of a frame; if an error is raised, earlier frames are kept."""
        if self._mesh is not None or (self.grid is None and isinstance(frame, Mesh)):
            out = self._of_mesh(frame)
        else:
            out = self._of_grid(field_of(frame))
        self.count += 1
        return out

    def _of_grid(self, field: Field) -> list[bytes]:
        given, grid = self._given, self.grid
        alike = field.shape, np.asarray(field.values).dtype
        if given is None or grid is None:
            given, samples = completed(field, self._isovalue, self._options, self._known, series=True)
            series = Series(given.isovalues, given.options.interval, given.options.independent)
            grid = GridFrames(grid_file(samples, series, given.options, given.placement, report=self._report))
        else:
            self._check_alike(field, given, *alike)
            samples = given.samples(field)
        if given.labels is not None:
            samples = [*samples]
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
        more = {*(field.labels or ())} - {*(given.labels or ())}
        if more:
            every = sorted({*more, *(given.labels or ())})
            raise InputError(
                f"frame {self.count} has labels that the first frame does not: {listed(sorted(more), ', ')}",
                code="label", remedy=f"give each frame the same: labels=({listed(every, ', ')})",
            )

    def _of_mesh(self, frame: Any) -> list[bytes]:
        if self._mesh is None:
            isovalues = levels_of(frame, self._isovalue, self._options, self._known)
            series = Series(isovalues, self._options.interval, self._options.independent)
            self._mesh = MeshFrames(frame, series, self._options, complete=False, report=self._report)
        values: Any = frame.values if isinstance(frame, Mesh) else frame
        return self._mesh.chunks(values)


class _SeriesEncoder(ContainerEncoder):
    """Encodes a series whose frames are all given."""

    def __init__(
        self, frames: Frames, isovalue: Isovalues | None, options: Options, progress: Report | None
    ) -> None:
        if frames.interval is not None:
            options = Options.of(**{**vars(options), "interval": frames.interval})
        self._given = frames
        # frames that can be read only once cannot be examined in advance
        self._frames = SeriesFrames(isovalue, options, progress, frames if frames.repeatable else None)

    def _chunks(self) -> Iterator[bytes]:
        for frame in self._given:
            yield from self._frames.chunks(frame)
        self._frames.check_whole()


def _shape(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
