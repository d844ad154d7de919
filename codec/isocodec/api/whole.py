"""Whole files at once: a field in, bytes out, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import OptionError
from ..field.sampled import Field
from ..grid.layers.plan import Entry
from ..stream.encoder import Encoder
from ..stream.names import CriterionName, Distance, Isovalues, ProfileName
from .content import SpatialImage, described


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
