"""Encode a field, a series, a mesh or a surface to bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..stream.encoder import encoder_of
from ..stream.options import KEY_INTERVAL, EffortName, Isovalues, LayersGiven, PrecisionGiven, ProfileName
from ..verbs import Progress
from .native import native
from .selfcheck import check_kernels

if TYPE_CHECKING:
    from ..field.sampled import SpatialImage
    from ..tin.tin import Tin


def encode(
    what: ArrayLike | Field | Frames | Mesh | Tin | SpatialImage,
    isovalue: Isovalues | None = None,
    *,
    precision: PrecisionGiven = None,
    keep_topology: bool = False,
    profile: ProfileName = "main",
    effort: EffortName = "normal",
    layers: LayersGiven = None,
    order: str | None = None,
    interval: int = KEY_INTERVAL,
    metadata: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> bytes:
    """Encode isocontours or isosurfaces, or a triangulated surface.

    Parameters
    ----------
    what : (s0, s1) or (s0, s1, s2) array_like, Field, Frames, Mesh or Tin
        Samples on a regular grid: bool, integers or floats. NaN and masked samples of a masked array are missing: the
        curve ends at unit cells with a missing corner. A `Field` adds a mask, placement (where the samples lie), names,
        units and labels, which the file stores, too; so do the in-memory objects that `read` accepts (a DataArray of
        xarray, images of nibabel and SimpleITK). `Frames` are a series, a `Mesh` has values at points, a `Tin` is a
        surface from `thin`.
    isovalue : number, sequence of numbers, or str, optional
        One isovalue, or several in the order in which the file is to have them: finite numbers of Python or numpy,
        fractions or decimals. Samples greater than the isovalue lie above it. Files hold double precision; integers
        that it cannot represent are refused. "every 20" means all multiples of 20 within the range of the data, "every
        20 from 5" the same values shifted by 5. None for a field of bool, whose border is encoded, for a field with
        labels, and for a `Tin`.
    precision : optional
        How closely the file keeps to the contour. A number: the largest distance, in cells, between the decoded and the
        extracted curve, both ways; on a mesh in the unit of its points. A text with a unit, as "100m" or "0.2mm": a
        distance in the world, on the ellipsoid where coordinates are longitudes and latitudes or projected, to which
        the file keeps everywhere; it is refused where the unit of the coordinates is not known. From 0.75 cells on, for
        a smooth surface from 0.1, the encoder searches for a mesh that makes the file small, and proves the distance on
        the decoded curve; below, it codes the signs of the full grid, and crossings as coarsely as the distance allows.
        In the complete file, curves of several isovalues of a plane do not cross one another. With a criterion as
        ``layers``, that chooses the mesh, and the distance holds for its crossings alone.
        "exact": values of integers next to the curve, to the last bit. "step=0.5": values of floats next to the curve
        to within half a step. "signs": which samples lie above, no geometry; crossings are drawn half-way. "0.2 smooth"
        and "signs smooth": the file asks readers to move points within the parts of edges that it states, where that
        brings the curve nearer in the mean, and keeps to the distance with and without that; for smooth fields, such as
        distances, at one isovalue. Falling distances, as [4, 1, 0.25, "exact"], "4m,1m,exact" or [4, 1, "step=0.5"]:
        what the layers promise one after the other.
        None: 0.05 cells; "signs" for labels, and for a field of bool without an isovalue; on a mesh 0.05 of the median
        edge. The values of a `Tin` that `thin` did not choose for a file are rounded to within a number, or to steps.
    keep_topology : bool
        Make the curve of every layer, from the base on, have as many components as the complete curve, nested in the
        same way; for surfaces, with the same Euler characteristics. Samples equal to the isovalue count as below it.
    profile : str
        ``main``, or ``baseline``, which makes larger files for smaller and faster decoders.
    effort : str
        ``best`` takes ten to fifty times the time at distances from 0.1 to 0.75 cells, and tries coarser meshes, and
        how far crossings may be off where the curve meets an edge at a slant: 1 to 3 % fewer bytes, up to 25 % where it
        is smooth. Some of that is done for smooth surfaces without being asked for.
    layers : optional
        For grids; of these, meshes take the criteria except distortion. A number: the uniform level of the base; the
        level of the full grid makes a file of one layer. A criterion, which coarsens the mesh as published: "crossing",
        "topology", "curvature=K" (mean curvature above which the finest mesh stays, 1 / cells; on meshes by the unit of
        their points), "distortion=D" (distance in cells from the original curve to the new one), "level=L" (that of a
        uniform mesh). Or a plan (docs/plans.md): the layers one by one, a sequence of entries ``("base", level)``,
        ``("refine", rounds)``, ``("values", bits)``, ``("offsets", radix)``, where None means as many as possible;
        ``("values", None, left)`` leaves ``left`` bits uncoded; ``("adaptive_base", level, mesh)``, ``("adapt", births,
        mesh)`` with the resulting mesh (`grid.lattice.vertex_set.Chosen`) or the criteria
        by which to coarsen it (`grid.layers.plan.Criteria`), ``("leaf_base",)``, ``("offsets", radix, unit)``.
        ``("promise", distance)`` after layers other than values records that their curve lies at most that far from
        the original one, without proof. A mapping gives a separate plan for each isovalue.
    order : str, optional
        Order of the layers of several isovalues. "levels": level by level, so that the first bytes of the file show all
        isovalues coarsely; "isovalues": one isovalue after the other, each predicted from earlier ones; "independent":
        one after the other, each coded without the others, as is every frame of a series. By default
        "levels" for 2 to 256 isovalues of a field on the mesh of the grid (no plan or criterion, no search for a mesh),
        unless the values are stored exactly; "isovalues" otherwise.
    interval : int
        In a series, make every frame whose number is a multiple of this a key frame, which is not predicted from
        earlier frames, so that decoding can begin there; by default 16, and 0 for the first frame only.
    metadata : mapping of str to str, optional
        Notes to add to those of the field; they replace notes of the same name.
    progress : callable, optional
        Called with the number of layers done and the total; before that, during the search for a mesh, with the number
        of curves tried and 0.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        If the field, the mesh or the isovalue cannot be encoded.
    OptionError
        If options cannot be combined, do not apply or are out of range.

    Examples
    --------
    >>> import isocodec, numpy as np
    >>> y, x = np.mgrid[:64, :64]
    >>> data = encode(np.hypot(y - 31.5, x - 31.5), 20.0)
    >>> isocodec.decode(data).lines[0].shape[1]
    2
    """
    check_kernels()
    options: dict[str, Any] = {
        "precision": precision, "keep_topology": keep_topology, "profile": profile, "effort": effort,
        "layers": layers, "order": order, "interval": interval, "metadata": metadata,
    }
    return b"".join(encoder_of(native(what), isovalue, progress=progress, **options))
