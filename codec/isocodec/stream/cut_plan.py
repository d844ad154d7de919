"""Cuts of a mesh that isovalues are coded on: within distances, with the topology kept, under a criterion
(docs/encoders.md, 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..errors import OptionError
from ..field.samples import Samples
from ..mesh.complex import Complex
from ..mesh.cut import CellHistory
from ..mesh.hierarchy import Hierarchy, has_hierarchy
from ..mesh.isovalue import MeshIsovalue
from ..search.curvature import curvature
from ..search.mesh_cuts import KeptCut, MeshContour, without_crossings
from ..search.mesh_topology import safe_nodes
from ..search.tolerance import EXACT
from .options import Options

Cut = KeptCut | NDArray[np.bool_]
"""A cut that keeps a distance, with its points; or nodes of one, (N,), with points of the field."""


@dataclass(frozen=True)
class CutPromise:
    """Distances and topology that cuts keep.

    Attributes
    ----------
    distances : tuple of float
        In the unit of the points, one for each cut, decreasing; 0 for exact values, at the end.
    topology : bool
        Whether each cut has the contour's components, rims and handles.
    stepwise : bool
        Whether each layer promises something, so that signs of the whole mesh are no alternative.
    """

    distances: tuple[float, ...]
    topology: bool
    stepwise: bool

    @property
    def exact(self) -> bool:
        """Whether the last cut is the whole mesh, with values."""
        return self.distances[-1:] == (EXACT,)


def cut_promise_of(options: Options) -> CutPromise | None:
    """The promise that options ask of cuts; None if they ask for nothing."""
    precision = options.precision
    distances = precision.steps or (() if precision.tolerance is None else (precision.tolerance,))
    stepwise = options.keep_topology or precision.steps is not None
    return CutPromise(distances, options.keep_topology, stepwise) if stepwise or distances else None


def check_cuts(domain: Complex, options: Options, progressive: bool | None, shared: bool) -> None:
    """Refuse what cuts of a mesh cannot do; ``shared``: encoder and decoder both have the mesh."""
    topology, steps, criterion = options.keep_topology, options.precision.steps or (), options.layers.criterion
    name, code = ("keep_topology", "keep_topology") if topology else (f"precision {options.precision.text!r}", "steps")
    if criterion is not None and not topology:
        name, code = f"layers {criterion!r}", "layers"
    if not shared and steps[-1:] == (EXACT,):
        raise OptionError("exact values after distances are for meshes that both sides have", code="steps",
                          remedy='give stored="known" (--stored known), or leave exact out')
    if progressive is False:
        raise OptionError(f"{name} needs progressive signs", code=code, remedy="leave progressive out")
    if shared and not has_hierarchy(domain):
        raise OptionError(f"{name}: the mesh is too large for its unit", code=code, remedy="leave it out")
    if any(not later < step for step, later in pairwise(steps)):
        raise OptionError("the distances must decrease", code=code, remedy="for example 4, 1, 0.25")


def cut_under(
    options: Options, domain: Complex, points: NDArray[np.float64], hierarchy: Hierarchy, history: CellHistory,
    field: Samples,
) -> NDArray[np.bool_]:
    """Find the nodes, (N,), that stay under the criterion of the options, as of grids, and with the topology if asked.

    Raises `OptionError` if the criterion is a level that the mesh does not have.
    """
    criterion, number = options.layers.criterion, options.layers.parameter or 0.0
    inside = np.zeros(len(history.vertex), np.bool_)
    if criterion == "topology" or options.keep_topology:
        inside |= ~safe_nodes(history, field.signs)
    if criterion == "level":
        levels = len(hierarchy.rounds)
        if not (number.is_integer() and number <= levels):
            raise OptionError(f"the level {number:g} is not an integer up to that of the whole mesh, {levels}",
                              code="criterion")
        gone = sum(len(each.vertex) for each in hierarchy.rounds[: levels - int(number)])
        inside[gone:] = True
    if criterion in ("crossing", "curvature"):
        contour = MeshContour(domain, history, points, field, 1.0)
        crossed = np.zeros(len(history.cell), np.bool_)
        crossed[contour.mixed] = True
        if criterion == "curvature":
            drawn = contour.original
            bent = curvature(Contour(drawn.points, drawn.pieces, field.isovalue, ()))[drawn.pieces].mean(axis=1)
            crossed[:] = False
            crossed[drawn.owner[bent > number]] = True
        inside[history.maker[crossed & (history.maker >= 0)]] = True
    return inside


class CutPlan:
    """Chooses cuts.

    Parameters
    ----------
    domain : Complex
    points : (V, d) float64
    history : CellHistory
    promise : CutPromise
    least : float
        Distances below this one are kept on the whole mesh, without a search.
    watch : callable, optional
        Called whenever a cut is held against a contour.
    """

    def __init__(
        self, domain: Complex, points: NDArray[np.float64], history: CellHistory, promise: CutPromise,
        least: float = 0.0, watch: Callable[[], object] | None = None,
    ) -> None:
        self._domain, self._points, self._history, self._promise = domain, points, history, promise
        self._least, self._watch = least, watch
        self._every = np.ones(len(history.vertex), np.bool_)

    def cuts(self, fields: Sequence[Samples], whole: Callable[[Samples], int], step: int) -> list[list[Cut]]:
        """Choose cuts for isovalues, each part of the next.

        Parameters
        ----------
        fields : sequence of Samples
            The values for each isovalue.
        whole : callable
            The bytes that an isovalue takes on the whole mesh.
        step : int
            Of offsets there.

        Returns
        -------
        list of list of Cut
            Without any where the whole mesh takes fewer bytes.
        """
        found = [self._nested(field, whole) for field in fields]
        flat = self._domain.n == self._domain.mesh.position.shape[1] == 2
        if len(fields) > 1 and flat and any(_kept(each) is not None for each in found):
            curves = [self._contour(field, self._promise.distances[-1]).whole(max(step, 1)) for field in fields]
            last = without_crossings([_kept(each) for each in found], curves)
            for number, one in enumerate(last):
                if one is None and _kept(found[number]) is not None:
                    found[number] = [*found[number][:-1], self._every] if self._promise.stepwise else []
        return found

    def _nested(self, field: Samples, whole: Callable[[Samples], int]) -> list[Cut]:
        """Choose the cuts of an isovalue, one for each distance."""
        promise, inside, found = self._promise, ~self._every, list[Cut]()
        if promise.topology:
            inside = ~safe_nodes(self._history, field.signs)
        if not promise.distances:
            return [inside, self._every]
        for distance in promise.distances[:-1]:
            contour = self._contour(field, distance)
            one = contour.uncut() if distance < self._least else contour.coarsest(inside)
            if one is None:
                raise OptionError(f"a step of {distance:g} is finer than positions of the mesh are known", code="steps",
                                  remedy="leave that one out")
            found.append(one)
            inside = one.inside
        if promise.exact or promise.distances[-1] < self._least:
            return [*found, self._every]
        begun = partial(MeshIsovalue, self._domain, field.isovalue)
        kept, size = self._contour(field, promise.distances[-1]).shortest(inside, begun)
        if promise.stepwise:
            return [*found, self._every if kept is None else kept]
        return [kept] if kept is not None and size < whole(field) else []

    def _contour(self, field: Samples, distance: float) -> MeshContour:
        """The contour of the whole mesh, for cuts within a distance of it."""
        return MeshContour(self._domain, self._history, self._points, field, distance, self._watch)


def _kept(cuts: Sequence[Cut]) -> KeptCut | None:
    """The last cut, if its points are not those of the whole mesh."""
    return cuts[-1] if cuts and isinstance(cuts[-1], KeptCut) else None
