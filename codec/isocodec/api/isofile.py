"""One class for every kind of ``.iso`` file: opened once, then asked for curves, samples and information."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import IsoError, OptionError
from ..field.cropping import check_box, window_around
from ..field.placement import CRS, Placement, read_placement
from ..field.times import Time, nearest, times_of
from ..limits import Limits
from ..stream.file_info import FileInfo
from ..stream.promises import promise_of
from ..verbs import Edit, Progress, Viewed, check_count
from .native import native
from .operations import ViewOptions, impossible

if TYPE_CHECKING:
    from typing import Self, Unpack

    from ..drawing.contour import Contour
    from ..drawing.tessellation import Tessellation
    from ..stream.options import ProfileName
    from ..stream.statistics import FileStatistics
    from ..tin.tin import Tin
    from .verification import Verified

_DRAWN = 16
"""Largest number of isovalues that a notebook shows."""


class IsoFile:
    """An ``.iso`` file of any kind.

    Attributes
    ----------
    kind : str
        ``grid``: curves or surfaces of a sampled field; ``series``: of several fields, frame by frame; ``mesh``: of
        values on a mesh; ``surface``: a triangulated surface; ``tiles``: curves or surfaces in tiles, which are read
        when they are needed.
    size : int
        Bytes.
    shape : tuple of int
        Samples along each axis of the field; empty on a mesh.
    isovalues : tuple of float
        In the order of the file.
    frames : int
        Number of complete frames of a series; 1 for other files.
    metadata : dict of str to str
        Notes of the file.
    complete : bool
        Whether the file is complete and, unless it is tiled, its checksum is correct.
    limits : Limits or None
    mesh_given : (points, cells) or None
        The mesh that the file was made on, if it was given.
    """

    kind: str
    limits: Limits | None
    _refused: tuple[str, ...] = ()
    """Parameters of a view that do not apply to drawings of this kind of file."""
    mesh_given: tuple[ArrayLike, ArrayLike] | None = None
    _widget: Any = None

    def __enter__(self) -> Self:
        """Return the file itself: it is read by each method that needs bytes, so there is nothing to close."""
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __repr__(self) -> str:
        values = ", ".join(f"{value:g}" for value in self.isovalues[:5]) + ", .." * (len(self.isovalues) > 5)
        return f"IsoFile({self.kind}, {self.size:,} bytes, shape={self.shape}, {self.info.noun}s {values})"

    def _repr_html_(self) -> str:
        """Draw the first isovalues for notebooks, with size, layers and promises.

        The drawing is omitted if it would exceed the limits, or needs a mesh that the file does not store.
        """
        from ..plotting.panels import html_of

        try:
            contours = [self.contour(value) for value in self.isovalues[:_DRAWN]]
        except IsoError:
            contours = []
        return html_of(contours, self._facts)

    def _repr_mimebundle_(self, **_: Any) -> Any:
        """Draw the file as a widget, which sharpens while bytes arrive, with facts only for pages without widgets.

        None without anywidget: notebooks then take the picture.
        """
        if find_spec("anywidget") is None:
            return None
        from ..plotting.panels import html_of
        from ..plotting.widget import Widget

        self._widget = self._widget or Widget(self._read, self._repr_html_)
        data, notes = self._widget._repr_mimebundle_()
        return {**data, "text/plain": repr(self), "text/html": html_of([], self._facts)}, notes

    @property
    def _facts(self) -> dict[str, str]:
        info = self.info
        facts = {
            "kind": self.kind, "bytes": f"{self.size:,}", "layers": f"{len(info.layers):,}", "profile": info.profile,
            "samples": " x ".join(map(str, self.shape)), "frames": f"{self.frames:,}" if self.frames > 1 else "",
            f"{info.noun}s": ", ".join(f"{value:g}" for value in self.isovalues),
            "promise": self.promise or "", **self.metadata,
        }
        return {name: fact for name, fact in facts.items() if fact}

    @property
    def times(self) -> NDArray[Any] | None:
        """Times of the complete frames of a series, (F,) float64 or datetime64 in UTC; None if they are not known.

        The unit of numbers is in ``info.frames[0].time``, if it is known.
        """
        return times_of(frame.time for frame in self.info.frames if frame.complete)

    def frame_at(self, time: Time) -> int:
        """Number of the complete frame whose time is nearest to a number or a date.

        Raises
        ------
        OptionError
            If the file does not state times, or states dates instead of numbers or the reverse.
        """
        if (times := self.times) is None:
            raise OptionError("the file does not state the times of its frames", code="time",
                              remedy="choose a frame by its number")
        return nearest(times, time)

    @property
    def promise(self) -> str | None:
        """Precision that the complete file promises, in words: ``within 1m (0.034 cells)``; None if it is none.

        Distances are in the unit that was asked for. It is without what bytes that are missing would change.
        """
        return promise_of(self.info)

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis of the field."""
        return tuple(self.info.shape)

    @property
    def isovalues(self) -> tuple[float, ...]:
        """Isovalues, in the order of the file."""
        return tuple(self.info.isovalues)

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file."""
        return dict(self.info.metadata)

    @property
    def placement(self) -> Placement | None:
        """Placement of the samples as stated in the notes; for grids with coordinates, see `Contour.placement`."""
        return read_placement(self.metadata, len(self.shape))

    @property
    def crs(self) -> str | None:
        """Reference system of the coordinates, as the file names it."""
        return self.metadata.get(CRS)

    def _viewed(self, **view: Unpack[ViewOptions]) -> Viewed:
        """Check the parameters of a view."""
        made = Viewed(**view)
        made.refuse_for(self.kind, *self._refused)
        return made if made.bbox is None else replace(made, window=self.window_around(made.bbox), bbox=None)

    def window_around(self, bbox: Sequence[float]) -> Sequence[Sequence[float]]:
        """Find the window that a box of coordinates covers: start and end along each axis, in samples.

        Raises `OptionError` if samples have no coordinates, or if the box lies outside of the field.
        """
        if not self.shape:
            return list(zip(*check_box(bbox, len(bbox) // 2), strict=True))
        return window_around(self._place, self.shape, bbox).tolist()

    @property
    def _place(self) -> Placement | None:
        """Placement of the samples, also by coordinates in the file."""
        return self.placement

    # -- drawings ------------------------------------------------------------------------------------------------

    def contour(
        self, isovalue: float | None = None, *, frame: int | None = None, layers: int | None = None,
        max_bytes: int | None = None, window: Sequence[Sequence[float]] | None = None,
        bbox: Sequence[float] | None = None,
        within: float | Callable[..., float] | None = None, smooth: bool | None = None, through_holes: bool = False,
        partial: bool = False, progress: Progress | None = None,
    ) -> Contour:
        """Decode the curve or surface of an isovalue.

        Parameters
        ----------
        isovalue : float, optional
            An isovalue of the file, the first if not given. Required for a triangulated surface, where it can be any.
        frame : int, optional
            Frame of a series, from 0; the first if not given. Only the frames it is predicted from are decoded as well.
        layers : int, optional
            Decode only this many layers, or all if the file has fewer.
        max_bytes : int, optional
            Decode only the first bytes of the file, even if they give an incomplete curve.
        window : n pairs of numbers, optional
            Start and end along each axis, in samples (on a mesh, in its coordinates); cells that reach into this window
            are drawn. From a tiled file, nothing else is read.
        bbox : sequence of float, optional
            The window around a box of coordinates of the file, instead: least x, y (, z), then largest.
        within : float or callable, optional
            For grids: stop refining as soon as cubes of the mesh are at most this many samples wide. For tiled files
            also a function that returns this number for the window of a tile, n pairs of samples.
        smooth : bool, optional
            Move the points within the parts of grid edges in which the file places them, the whole edge if it only
            records which are crossed, so that the curve is smooth. On average this brings points closer to the true
            curve where the field is smooth, by up to half the distance, and moves them away from it where the field is
            rough. Guaranteed distances hold with smoothing only if the file asks for it (``encode`` with
            ``precision="0.2 smooth"``), which is followed if this is not given.
        through_holes : bool
            Draw the curve through missing samples, too; its course there was chosen by the encoder.
        partial : bool
            Draw as much as there is of a truncated file. Complete frames of a series need no such permission.
        progress : callable, optional
            Called with the number of layers done and the total.

        Returns
        -------
        Contour
            ``points`` (P, n) float64 in array index coordinates, ``cells`` (M, n) int64.

        Raises
        ------
        FormatError
            If the bytes are not a valid file; ``TruncatedError`` if they end too early.
        LimitError
            If the file needs more than the limits allow.
        OptionError
            If the file does not have the isovalue or the frame, or a parameter does not apply to its kind.
        InputError
            If the given mesh is not the one that the file was made on.
        """
        return self._contour(isovalue, self._viewed(
            frame=frame, layers=layers, max_bytes=max_bytes, window=window, bbox=bbox, within=within,
            smooth=smooth, through_holes=through_holes, partial=partial, progress=progress,
        ))

    def contours(self, **view: Unpack[ViewOptions]) -> list[Contour]:
        """Decode the curves or surfaces of all isovalues, in the order of the file; see `contour`.

        On the full grid those of labels share their borders, and meet where three or more labels do; that of one label
        alone, which `contour` decodes, leaves a gap there.
        """
        return self._contours(self._viewed(**view))

    def each_frame(
        self, *, start: int = 0, smooth: bool | None = None, partial: bool = False
    ) -> Iterator[list[Contour]]:
        """Decode frame by frame; at most two frames are in memory.

        Parameters
        ----------
        start : int
            Number of the first frame to be drawn; decoding begins at the last key frame up to it.
        smooth : bool, optional
            As for `contour`.
        partial : bool
            Stop after the last complete frame of a file that is truncated or still grows. Otherwise `TruncatedError` is
            raised there.

        Yields
        ------
        list of Contour
            Curves or surfaces of all isovalues, frame by frame. A file that is not a series has one frame.
        """
        check_count(start, "start", 0)
        return self._each_frame(start, smooth, partial)

    def refreshed(self) -> IsoFile:
        """Open a file that grows again, for its further frames; only what follows its last complete frame is read.

        Returns
        -------
        IsoFile
            This file, if it is complete.

        Raises
        ------
        OptionError
            If it was not opened from a path or a URL, or is tiled.
        InputError
            If the frames that were read before have been changed.
        OSError
            If it cannot be read.
        """
        if not self.complete:
            raise OptionError(f"a file of kind {self.kind} does not grow frame by frame", code="kind",
                              remedy="open it again")
        return self

    def mesh(
        self, isovalue: float | None = None, *, whole: bool = False, **view: Unpack[ViewOptions]
    ) -> Tessellation:
        """Decode the mesh that the curve of an isovalue is coded on.

        Parameters
        ----------
        isovalue : float, optional
        whole : bool
            Decode the mesh of the whole field; otherwise only the cells that the curve crosses.
        view
            Parameters of `contour`.

        Returns
        -------
        Tessellation
            Triangles or tetrahedra with their levels, vertices with their signs.
        """
        return self._mesh(isovalue, self._viewed(**view), whole)

    # -- arrays --------------------------------------------------------------------------------------------------

    def above(self, isovalue: float | None = None, **view: Unpack[ViewOptions]) -> NDArray[np.bool_]:
        """Decode which samples lie above an isovalue.

        Parameters
        ----------
        isovalue : float, optional
        view
            ``frame``, ``max_bytes``, ``partial``, ``progress``, as for `contour`.

        Returns
        -------
        NDArray
            Bool, in the shape of the field: ``field > isovalue``, compared exactly; undefined where samples are missing
            (see `valid`). On a mesh (V,), one value for each vertex of `mesh`.

        Raises
        ------
        OptionError
            If the mesh of the file is coarser than the grid, or than the mesh that the file was made on.
        FormatError, LimitError
            As `contour`; ``limits.samples`` bounds the result.
        """
        return self._above(isovalue, self._viewed(**view))

    def valid(self, *, max_bytes: int | None = None) -> NDArray[np.bool_]:
        """Decode which samples are valid, that is, not missing: bool, in the shape of the field.

        With ``max_bytes``, only the first bytes of the file are decoded; an error is raised if they are too few.
        """
        return self._valid(max_bytes)

    def labels(
        self, *, frame: int | None = None, max_bytes: int | None = None, partial: bool = False
    ) -> NDArray[Any]:
        """Decode the labels of a segmentation.

        Parameters
        ----------
        frame, max_bytes, partial
            As for `contour`.

        Returns
        -------
        NDArray
            The labels of the file, 0 elsewhere, in the shape of the field and the type of what was encoded.

        Raises
        ------
        OptionError
            If the isovalues of the file are not labels, if it does not have the frame, or if its mesh is coarser than
            the grid.
        """
        return self._labels(Viewed(frame=frame, max_bytes=max_bytes, partial=partial))

    def surface(self, *, layers: int | None = None, max_bytes: int | None = None) -> Tin:
        """Decode a triangulated surface, its first layers, or as much of it as the first ``max_bytes`` bytes hold.

        Raises
        ------
        OptionError
            If the file is of another kind.
        """
        return self._surface(Viewed(layers=layers, max_bytes=max_bytes))

    # -- checks and other files ------------------------------------------------------------------------------------

    def statistics(self) -> FileStatistics:
        """Decode the file and count its bits by layer and by isovalue."""
        raise NotImplementedError

    def verify(
        self, field: Any, *, frame: int | None = None, within: float | str | None = None
    ) -> list[Verified]:
        """Measure the file against the field that it was made from.

        Parameters
        ----------
        field : array_like, Field, Mesh, DataArray or image
            What was encoded; for a series, one frame.
        frame : int, optional
            Number of the field in a series, from 0.
        within : float or str, optional
            Distance to check, instead of what the file promises: in cells, on a mesh in the unit of its points, of a
            surface that of its values; or with a unit, "0.2mm".

        Returns
        -------
        list of Verified
            One for each isovalue, in the order of the file; of a surface a single one, with distances of values, unless
            it was made for contours.

        Raises
        ------
        InputError
            If the field has another shape than the file's, or other samples are missing.
        OptionError
            If the distance has a unit, and that of the coordinates is not known.
        """
        from .verification import BY_KIND

        return BY_KIND[self.kind](self, native(field), frame, within)

    def edited(
        self, *, layers: int | None = None, size: int | None = None, window: Sequence[Sequence[float]] | None = None,
        bbox: Sequence[float] | None = None, isovalues: Sequence[float] | None = None,
        profile: ProfileName | None = None, precision: Any = None, keep_topology: bool = False,
    ) -> bytes:
        """Make another file from this one; the field is not needed.

        Parameters
        ----------
        layers : int, optional
            Keep the first layers, counted over all isovalues, or all if there are fewer; of a tiled file, the first
            stages.
        size : int, optional
            Keep as many symbols or layers as fit into this many bytes.
        window : n pairs of numbers, optional
            Keep a window of samples, enlarged to whole samples, with its start rounded down to an even index; no point
            moves.
        bbox : sequence of float, optional
            The window around a box of coordinates of the file, instead: least x, y (, z), then largest.
        isovalues : sequence of float, optional
            Keep only these isovalues.
        profile : str, optional
            ``main`` or ``baseline``.
        precision : optional
            ``"signs"``, or a tolerance from the curve that this file decodes to, in cells or with a unit. What the file
            promises of that curve comes on top; if that is nothing, nothing is promised.
        keep_topology : bool
            With a precision: the curve of every layer has the components of the complete curve, nested in the same way.

        Returns
        -------
        bytes
            An ``.iso`` file with the notes of this one.

        Raises
        ------
        OptionError
            If no change is asked for, or the file cannot be changed in this way.
        FormatError, LimitError
        """

        chosen = None if isovalues is None else tuple(isovalues)
        edit = Edit(layers, size, window, bbox, chosen, profile, precision, keep_topology)
        edit.check()
        if bbox is not None:
            edit = replace(edit, window=self.window_around(bbox), bbox=None)
        return self._edited(edit)

    # -- of each kind of file ------------------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """Bytes of the file."""
        raise NotImplementedError

    @property
    def frames(self) -> int:
        """Number of complete frames of a series; 1 for other files."""
        return 1

    @property
    def complete(self) -> bool:
        """Whether the file is complete and, unless it is tiled, its checksum is correct."""
        raise NotImplementedError

    @property
    def data(self) -> bytes:
        """The bytes of the file; of a tiled file, this reads everything."""
        raise NotImplementedError

    @property
    def info(self) -> FileInfo:
        """Layers, chunks, offsets and promises, read without decoding."""
        raise NotImplementedError

    def _read(self, start: int, end: int) -> bytes:
        return self.data[start:end]

    def _contour(self, isovalue: float | None, view: Viewed) -> Contour:
        raise NotImplementedError

    def _contours(self, view: Viewed) -> list[Contour]:
        raise NotImplementedError

    def _each_frame(self, start: int, smooth: bool | None, partial: bool) -> Iterator[list[Contour]]:
        raise NotImplementedError

    def _mesh(self, isovalue: float | None, view: Viewed, whole: bool) -> Tessellation:
        raise NotImplementedError

    def _above(self, isovalue: float | None, view: Viewed) -> NDArray[np.bool_]:
        raise NotImplementedError

    def _valid(self, max_bytes: int | None) -> NDArray[np.bool_]:
        raise NotImplementedError

    def _labels(self, view: Viewed) -> NDArray[Any]:
        raise impossible("labels", self.kind)

    def _surface(self, view: Viewed) -> Tin:
        raise impossible("surface", self.kind)

    def _edited(self, edit: Edit) -> bytes:
        raise NotImplementedError
