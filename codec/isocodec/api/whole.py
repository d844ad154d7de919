"""Whole files at once: a field in, bytes out, and back."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..drawing.contour import Contour
from ..errors import IsoError, OptionError, TruncatedError
from ..field.sampled import Field
from ..format.chunks import octets
from ..format.events import LayerComplete
from ..grid.layers.plan import Entry
from ..io.readers.described import SpatialImage, described
from ..limits import Limits
from ..storage.content import Readable, content
from ..stream.decoder import Decoder
from ..stream.encoder import Encoder
from ..stream.names import CriterionName, Distance, Isovalues, ProfileName
from ..tiles.structure import is_tiled
from .frames import check_frame, frame_of
from .mesh_api import chain_of, check_count, explicit_contour, mesh_decoded, on_mesh
from .tiled_api import tiled_contours


def encode(
    field: ArrayLike | Field | SpatialImage,
    isovalue: Isovalues | None = None,
    *,
    exact: bool = False,
    tolerance: float | str | None = None,
    signs_only: bool = False,
    step: float | None = None,
    base_level: int | None = None,
    preserve_topology: bool = False,
    steps: Sequence[Distance] | None = None,
    criterion: CriterionName | None = None,
    parameter: float | None = None,
    leaning: bool = True,
    mask: ArrayLike | None = None,
    plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None = None,
    profile: ProfileName = "main",
    metadata: Mapping[str, str] | None = None,
    placement: ArrayLike | None = None,
    coordinates: Sequence[ArrayLike] | None = None,
    coordinates_error: float | None = None,
    periodic: int | Sequence[int] | None = None,
    period: float | Sequence[float] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> bytes:
    """Encode one or more isocontours or isosurfaces of a sampled field.

    Choose the precision with one of ``exact``, ``tolerance``, ``steps``, ``signs_only`` and ``step``. Without any,
    crossings on the full grid are kept to within 0.05 cells.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats; or a Field, a DataArray, an image
        Samples on a regular grid. NaN, and what a masked array masks, is missing: the curve ends at unit cells with a
        missing corner. Of what `read` returns, and of what it takes (a DataArray of xarray, images of nibabel and
        SimpleITK), mask, placement, coordinates, reference system, name and unit go into the file, too, unless
        ``placement`` and ``metadata`` say otherwise.
    isovalue : number or sequence of numbers, optional
        May be left out where the field is of bool: its border is kept then, with ``signs_only`` unless a precision is
        chosen. Otherwise one isovalue, or several of the same field, in the order in which the file has them: finite
        numbers of Python's or numpy's, fractions or decimals. Samples greater than it lie above. Files hold double
        precision; whole numbers beyond it are refused.
    exact : bool
        Integer data: keep the values next to the curve to the last bit.
    tolerance : float or str, optional
        Largest distance, in cells, between the decoded and the extracted curve, both ways; a text with a unit, as
        "100m", is one in the world of ``placement`` or ``coordinates`` (in their unit, or m or km where these are
        longitudes of a ``period`` of 360 and latitudes), which everywhere holds at least so closely. From 0.1 on the
        encoder searches for a mesh and a precision of crossings that make the file small, and proves the distance on
        the decoded curve. Below, and by default with 0.05, it codes all crossings of the grid, without a search. With a
        ``criterion``, that chooses the mesh, and the tolerance holds for its crossings alone.
    signs_only : bool
        Keep no geometry: which samples lie above is exact, crossings are drawn half-way.
    step : float, optional
        Float data: keep the values next to the curve to within half this step.
    base_level : int, optional
        Uniform level of the base; the level of the full grid makes a single-rate file.
    preserve_topology : bool
        Every layer, from the base on, has as many components as the curve, nested alike; surfaces with the same
        Euler characteristics. Samples equal to the isovalue count as below it.
    steps : sequence of float or str, optional
        Falling distances, in cells, that the layers promise one after the other; the last may be "exact" (or 0).
    criterion : str, optional
        Reduce the mesh under one criterion, as published: ``crossing``, ``topology``, ``curvature`` (``parameter``:
        mean curvature above which the finest mesh stays, 1 / cells), ``distortion`` (``parameter``: distance in
        cells from the original curve to the new one), ``level`` (``parameter``: that of a uniform mesh).
    parameter : float, optional
        Number that the criterion takes.
    leaning : bool
        Whether each further isovalue is coded with the help of the nearest one before it in the file.
    mask : array_like of bool, optional
        Of the field's shape, True where a sample is missing, as in ``numpy.ma``.
    plan : sequence of entries, optional
        Instead of all these but ``step``: the layers one by one, as ``("base", level)``, ``("refine", rounds)``,
        ``("values", bits)``, ``("offsets", radix)``, where None means as far as it goes; ``("values", None, left)``
        leaves so many bits; ``("adaptive_base", level, mesh)``, ``("adapt", births, mesh)`` with the mesh that they
        lead to (`mesh.vertex_set.Chosen`) or the criteria of its reduction (`layers.plan.Criteria`),
        ``("leaf_base",)``, ``("offsets", radix, unit)``. ``("promise", distance)`` behind layers other than values
        states how far their curve lies from the original one at most, without proof. A mapping gives each isovalue a
        plan of its own. `read_plan` makes plans of text.
    profile : str
        ``main``, or ``baseline``, which makes larger files for smaller and faster decoders.
    metadata : mapping of str to str, optional
        Notes to go into the file.
    placement : (n,), (n, n + 1) or (n + 1, n + 1) array_like, optional
        Where the samples lie: distances of neighbours along each axis of the array, or a row for each coordinate x, y
        (, z) with what a step along each axis adds to it and what it is at sample 0; a last row of 0 .. 0 1 may follow.
        It goes into the metadata, and changes nothing but `Contour.placed`; tolerances stay in cells.
    coordinates : sequence of n array_like, optional
        Where the samples lie on a mapped grid, instead of a placement: an array for each axis of the field, in its
        order (in the plane x runs along axis 1, in space x, y, z along the axes 0, 1, 2); or x, y (, z) for each
        sample, as arrays of n axes that broadcast to the field's shape. Cells must not fold. Where samples are missing
        they may be anything. `Contour.placed` follows them, multilinear within each cell.
    coordinates_error : float, optional
        Cells by which coordinates may be off in the file; 0.005 if not given.
    periodic : int or sequence of int, optional
        Axes of the field along which the first sample follows on the last one. The file has that plane of samples once
        more behind the last one, so that curves end at neither.
    period : float or sequence of float, optional
        Distance after which a coordinate is the same, 360 for longitudes: that of x, or of x, y (, z) with 0 for none.
    progress : callable, optional
        Called with the layers done and their total; before, while a mesh is searched for, with the number of curves
        tried and 0.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        If the field or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:64, :64]
    >>> data = encode(np.hypot(y - 31.5, x - 31.5), 20.0)
    >>> decode(data).lines[0].shape[1]
    2
    """
    options: dict[str, Any] = {
        "mask": mask, "placement": placement, "metadata": metadata, "coordinates": coordinates, "period": period,
    }
    values: Any = field
    if not isinstance(field, np.ndarray):
        values, options = described(field, **options)
    if isovalue is None:
        if plan is None and np.asarray(values).dtype.kind != "b":
            raise OptionError("which isovalue?", code="isovalue", remedy="only the border of a mask (bool) needs none")
        isovalue = 0.5
        signs_only = signs_only or not (exact or tolerance or step or steps or plan)
    return b"".join(
        Encoder(
            values, isovalue, exact=exact, tolerance=tolerance, signs_only=signs_only, step=step,
            base_level=base_level, preserve_topology=preserve_topology, steps=steps, criterion=criterion,
            parameter=parameter, leaning=leaning, plan=plan, profile=profile, coordinates_error=coordinates_error,
            periodic=periodic, progress=progress, **options,
        )
    )


def decode(
    data: Readable,
    *,
    isovalue: float | None = None,
    frame: int | None = None,
    layers: int | None = None,
    max_bytes: int | None = None,
    smooth: bool = False,
    through_holes: bool = False,
    mesh: tuple[ArrayLike, ArrayLike] | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Contour:
    """Decode a file to its curve or surface.

    Parameters
    ----------
    data : bytes, path, URL or file object
        A whole file, or where it is.
    isovalue : float, optional
        Which one, of a file that holds several; the first if not given. Others are decoded as far as it leans on them.
        Of a file that holds a surface (`encode_tin`), any.
    frame : int, optional
        Which one, from 0, of a series; the first if not given. Of others only those are decoded that it leans on.
    layers : int, optional
        Decode that many layers only; all if there are fewer.
    max_bytes : int, optional
        Decode the first bytes only, whatever curve they give.
    smooth : bool
        Put points of which the file only says the edge where the curve bends as evenly as that allows, not half-way:
        nearer to the curve in the mean where the field is smooth, by up to a half, farther from it where the field is
        rough or has few values. What the file does say stays; a tolerance holds without this only, and curves of
        several isovalues may cross.
    through_holes : bool
        Draw the curve through missing samples, too, where the encoder chose its way; `areas` takes it.
    mesh : (points, cells), optional
        The mesh of a file that was made on one and does not hold it: what `encode_mesh` was given.
    limits : Limits, optional
        What the file may need at most, where it comes from strangers.
    progress : callable, optional
        Called with the layers done and their total.

    Returns
    -------
    Contour
        ``points`` (P, n) float64 in array index coordinates, ``cells`` (M, n) int64.

    Raises
    ------
    OSError
        If a file cannot be opened.
    FormatError
        If the bytes are not a valid file; ``TruncatedError`` if they end too early, with ``max_bytes`` only if they end
        before the curve begins.
    LimitError
        If the file needs more than the limits allow.
    InputError
        If the mesh is not the one that the file was made on.
    """
    data = content(data, limits)
    if is_tiled(data):
        others = {"frame": frame, "max_bytes": max_bytes, "smooth": smooth, "through_holes": through_holes}
        return tiled_contours(data, isovalue, layers, limits, mesh=mesh, **others)[0]
    if on_mesh(data):
        return explicit_contour(data, isovalue, frame, mesh, max_bytes, limits)
    decoder, number = decoded(data, isovalue, layers, max_bytes, limits, progress, frame)
    return _drawn(decoder, [number], smooth, through_holes)[0]


def decode_all(
    data: Readable,
    *,
    frame: int | None = None,
    max_bytes: int | None = None,
    smooth: bool = False,
    mesh: tuple[ArrayLike, ArrayLike] | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> list[Contour]:
    """Decode a file to the curves or surfaces of all its isovalues, in the file's order.

    Parameters, errors
    ------------------
    As in `decode`. Of the first bytes, those isovalues that begin in them.

    Returns
    -------
    list of Contour
    """
    data = content(data, limits)
    if is_tiled(data):
        return tiled_contours(data, None, None, limits, frame=frame, max_bytes=max_bytes, smooth=smooth, mesh=mesh)
    if on_mesh(data):
        on = mesh_decoded(data, mesh, None, max_bytes, limits, frame)
        return [on.drawn(number) for number in range(len(on.isovalues))]
    decoder = received(data, None, max_bytes, limits, progress, frame=frame)
    return _drawn(decoder, range(len(decoder.isovalues)), smooth, False)


def _drawn(decoder: Decoder, numbers: Iterable[int], smooth: bool, through_holes: bool) -> list[Contour]:
    """Contours of isovalues; what each was drawn from goes when it has been."""
    out: list[Contour] = []
    try:
        for number in numbers:
            decoder.hold(sum(contour.points.nbytes + contour.cells.nbytes for contour in out))
            out.append(decoder.drawn(number, smooth, through_holes))
            decoder.discard(number)
    except IsoError:
        decoder.discard()
        raise
    return out


def decode_mask(
    data: Readable,
    *,
    isovalue: float | None = None,
    frame: int | None = None,
    max_bytes: int | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> NDArray[np.bool_]:
    """Decode a file to which samples lie above its isovalue.

    Parameters
    ----------
    data : bytes, path, URL or file object
        A file on the full grid: one made without a ``criterion``, and with no tolerance, or last step, from 0.1 on.
    isovalue, frame, max_bytes, limits, progress
        As in `decode`.

    Returns
    -------
    NDArray
        Bool, of the shape of the field that was encoded: ``field > isovalue``, with both compared exactly (numpy would
        round the isovalue to the type of a float32 field). What it says of missing samples means nothing:
        `decode_valid` tells which they are.

    Raises
    ------
    OptionError
        If the mesh of the file is coarser than the samples.
    FormatError, LimitError
        As `decode`; ``limits.samples`` bounds the result. ``TruncatedError`` if the first bytes do not tell yet.
    """
    decoder, number = decoded(content(data, limits), isovalue, None, max_bytes, limits, progress, frame)
    return decoder.mask(number)


def decode_valid(data: Readable, *, max_bytes: int | None = None, limits: Limits | None = None) -> NDArray[np.bool_]:
    """Decode which samples of a file are valid; the others are missing.

    Parameters
    ----------
    data : bytes, path, URL or file object
    max_bytes, limits
        As in `decode`.

    Returns
    -------
    NDArray
        Bool, of the shape of the field that was encoded; all True if the file has no mask.

    Raises
    ------
    FormatError, LimitError
        As `decode`; ``limits.samples`` bounds the result. ``TruncatedError`` if the first bytes do not tell yet.
    """
    return received(content(data, limits), (), max_bytes, limits).valid()


def decoded(
    data: bytes,
    isovalue: float | None = None,
    layers: int | None = None,
    max_bytes: int | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, int], object] | None = None,
    frame: int | None = None,
) -> tuple[Decoder, int]:
    """A decoder that has taken what was asked for of an isovalue of a file, and its number."""
    if layers is not None:
        check_count(layers, "layers", "layers")
    number, chain = chain_of(data, isovalue)
    decoder = received(data, chain, max_bytes, limits, progress, number, layers, frame)
    if number >= len(decoder.isovalues):
        raise TruncatedError("the file ends before its curve begins", code="truncated")
    return decoder, number


def received(
    data: bytes,
    only: Collection[int] | None,
    max_bytes: int | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, int], object] | None = None,
    number: int = 0,
    layers: int | None = None,
    frame: int | None = None,
) -> Decoder:
    """A decoder that has taken a frame, the first ``layers`` layers of its isovalue ``number``, or the first bytes."""
    if max_bytes is not None:
        check_count(max_bytes, "max_bytes", "max-bytes")
    wanted = frame_of(frame)
    decoder = Decoder(limits, only=only, frame=wanted)
    try:
        decoder.feed(octets(data)[:max_bytes])
        done = 0
        for event in decoder:
            if isinstance(event, LayerComplete):
                if progress:
                    progress(event.number, len(decoder.layers))
                done += decoder.present == (wanted, number)
                if done == layers:
                    return decoder
        if max_bytes is None:
            decoder.close()
        if not decoder.isovalues:
            raise TruncatedError("the file ends before its curve begins", code="truncated")
        check_frame(decoder, wanted)
    except IsoError:
        # the frames of an error that somebody keeps would keep all this, too
        decoder.discard()
        raise
    return decoder
