"""Incremental decoder for every kind of file: bytes in, events and drawings out (spec clause 8).

`session` goes through the bytes chunk by chunk. It performs no input or output itself.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import ChunkType

from ..errors import FormatError, OptionError, TruncatedError
from ..format.chunks import Envelope
from ..format.events import Event
from ..format.header import Header
from ..limits import Limits
from .outline import holds_surface
from .session import Contents, Session

if TYPE_CHECKING:
    from ..drawing.contour import Contour
    from .grid_contents import GridContents
    from .mesh_contents import MeshContents
    from .surface_contents import SurfaceContents


class Decoder(Session):
    """Decodes a file as its bytes arrive; the header and, for meshes, the domain chunk determine the kind of file.

    ``feed`` only stores bytes; iterating decodes them and yields events until more bytes are needed; ``contour`` draws
    what has been decoded so far; ``close`` declares that no more bytes will come. The result does not depend on how the
    bytes were divided. Once an error has been raised, every later call raises it again.

    Parameters
    ----------
    limits : Limits, optional
    mesh : (points, cells), optional
        The mesh that was encoded, for files that do not store it: (V, d) coordinates and (T, n + 1) vertices.
    only : collection of int, optional
        Numbers of the isovalues to decode, from 0, including those that they are predicted from; the chunks of others
        are skipped. All isovalues if not given.
    frame : int, optional
        For a series, the frame to decode, from 0; frames that it is predicted from are decoded, too, and the chunks of
        others are skipped. If not given, all frames are decoded one after the other, and drawings show the latest that
        has begun.

    Attributes
    ----------
    header : Header or None
    contents : GridContents, MeshContents, SurfaceContents or None
        Decoded state specific to the kind of file; None before the header has been read.

    Raises
    ------
    FormatError
        While iterating or in ``close``: the bytes violate the specification.
    InputError
        While iterating: the mesh is not the one that the file was made on.
    LimitError
        While iterating: the file needs more than the limits allow.
    """

    contents: GridContents | MeshContents | SurfaceContents | DomainBeginning | None

    def __init__(
        self, limits: Limits | None = None, *, mesh: tuple[ArrayLike, ArrayLike] | None = None,
        only: Collection[int] | None = None, frame: int | None = None,
    ) -> None:
        super().__init__(limits, partial(_contents_of, mesh=mesh))
        self.outline.only, self.outline.wanted = only, frame

    @property
    def isovalues(self) -> list[float]:
        """Isovalues read so far, including skipped ones; empty for a surface."""
        return self.outline.isovalues

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file read so far."""
        return self.outline.metadata

    @property
    def interval(self) -> int | None:
        """Interval of a series: frames whose number is a multiple of it are key frames; 0 if only the first is.

        None for a file without frames, and before this is known.
        """
        return self.outline.interval

    @property
    def frame(self) -> int:
        """Number of the frame that can be drawn: the latest that has begun or, once read, the one that is wanted."""
        frame, wanted = self.outline.frame, self.outline.wanted
        return frame if wanted is None else min(frame, wanted)

    @property
    def present(self) -> tuple[int, int]:
        """Number of the current frame, and of its isovalue whose layers are being read or come next."""
        return self.outline.frame, self.outline.number

    @property
    def announced(self) -> int:
        """Number of layers of a grid's file announced so far; 0 for other files."""
        return len(self.outline.layers)

    @property
    def memory(self) -> int:
        """Bytes that currently count towards `Limits.memory`."""
        return self.budget.held

    def take(self) -> Decoder:
        """Decode everything that has been fed, dropping events; returns the decoder."""
        for _ in self:
            pass
        return self

    def contour(
        self, number: int = 0, *, isovalue: float | None = None, smooth: bool | None = None,
        through_holes: bool = False, before: bool = False,
    ) -> Contour:
        """Draw what has been decoded of an isovalue (spec clause 9), up to the events taken so far.

        Where a partly received layer has not been decoded yet, the result of the layer before is drawn.

        Parameters
        ----------
        number : int
            Number of the isovalue in the file, from 0.
        isovalue : float, optional
            For a surface: any value.
        smooth, through_holes
            As for `IsoFile.contour`.
        before : bool
            Draw the previous frame, which is complete, while the next one begins.

        Raises
        ------
        LimitError
            If drawing takes more memory than the limits allow; the decoder is unchanged.
        """
        contents = self.contents
        if contents is None or isinstance(contents, DomainBeginning):
            from ..drawing.contour import Contour

            self.check()
            n = self.header.n if self.header is not None else 2
            return Contour(np.zeros((0, n)), np.zeros((0, n), np.int64), float("nan"), (0,) * n, False)
        if contents.kind == "surface":
            return self.surface.contour(isovalue=isovalue, smooth=smooth)
        drawn = self.grid if contents.kind == "grid" else self.on_mesh
        return drawn.contour(number, smooth=smooth, through_holes=through_holes, before=before)

    def hold(self, size: int) -> None:
        """Count ``size`` bytes held by the caller (for example for drawings) towards the memory limit from now on.

        Raises
        ------
        LimitError
            If that exceeds the limit; the decoder is unchanged.
        """
        self.budget.hold(self, size)

    def discard(self, number: int | None = None) -> None:
        """Release the decoded state of an isovalue, or of all, once drawn; nothing that follows may depend on it.
        """
        if self._is("grid"):
            self.grid.discard(number)

    def _is(self, kind: str) -> bool:
        return self.contents is not None and self.contents.kind == kind

    def _of(self, kind: str, what: str) -> Any:
        """The contents of a file of one kind.

        Raises
        ------
        OptionError
            If the file is of another kind.
        TruncatedError
            If its kind is not known yet.
        """
        if self._is(kind):
            return self.contents
        if self.contents is None or self._is("domain"):
            raise TruncatedError(
                f"the file ends before its {'mesh' if self.header else 'header'} is complete", code="truncated",
                offset=len(self.data), clause="8.3",
            )
        raise OptionError(f"the file is not of {what}", code="kind")

    @property
    def grid(self) -> GridContents:
        """The contents of the file of a grid; errors as of `_of`."""
        return cast("GridContents", self._of("grid", "a sampled grid"))

    @property
    def on_mesh(self) -> MeshContents:
        """The contents of a file of values on a mesh; errors as of `_of`."""
        return cast("MeshContents", self._of("mesh", "values on a mesh"))

    @property
    def surface(self) -> SurfaceContents:
        """The contents of the file of a surface; errors as of `_of`."""
        return cast("SurfaceContents", self._of("surface", "a triangulated surface"))

    @property
    def symbols(self) -> dict[str, int]:
        """Symbols of a grid's file received so far, by syntax element; empty for other files."""
        return self.grid.symbols if self._is("grid") else {}


class DomainBeginning:
    """Chunks of a file without a grid, up to the one that shows whether it holds a mesh or a surface."""

    kind = "domain"

    def __init__(self, session: Session, header: Header, mesh: tuple[ArrayLike, ArrayLike] | None) -> None:
        self.outline = session.outline
        self._session, self._header, self._mesh = session, header, mesh

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`: the first byte of the domain chunk states the kind."""
        session = self._session
        if chunk.type != ChunkType.DOMAIN:
            return None, True
        if chunk.start == chunk.end:
            raise FormatError("the domain chunk is empty", code="domain", offset=chunk.start, clause="3.5.8")
        if len(session.data) <= chunk.start:
            return None, False
        if holds_surface(self._header, session.data[chunk.start]):
            from .surface_contents import SurfaceContents

            session.contents = SurfaceContents(session)
        else:
            from .mesh_contents import MeshContents

            session.contents = MeshContents(session, self._header, self._mesh)
        return session.contents.arrive(chunk, at)

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """See `Contents.take`."""
        return self.outline.read(chunk, bytes(self._session.data[chunk.start : chunk.end]), behind)

    def drop(self) -> None:
        """See `Contents.drop`."""


def _contents_of(session: Session, header: Header, *, mesh: tuple[ArrayLike, ArrayLike] | None) -> Contents:
    """Make the contents for a file's chunks, if the header determines them."""
    if header.cells is not None:
        return DomainBeginning(session, header, mesh)
    from .grid_contents import GridContents

    return GridContents(session, header)
