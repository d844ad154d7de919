"""A promise: the original curve, and trial encodings held against it (rows C2-distortion, S3-distortion)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from dataclasses import field as derived
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from isospec.container import Profile

from ..drawing.contour import Contour
from ..drawing.drawing import draw
from ..drawing.leaves import Leaves
from ..drawing.snapshot import leaves_of
from ..field.samples import OFFSET_BITS, Samples, interval_value
from ..format.header import Header
from ..format.program import Progress
from ..grid.lattice.tables import cube_exponent
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.layer_writer import LayerWriter, field_tube
from ..grid.layers.plan import Entry
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from .coarsening import Reduction
from .curvature import curvature
from .fences import Fences
from .ground_truth import GroundTruth, truth_of
from .original import original
from .proof import Target
from .shared_sides import JoinedReduction, SharedSides

ROUNDED = 2.0**-OFFSET_BITS
"""Share of an edge to which crossings are rounded before they are stored, so that they may be as much too far away."""


@dataclass
class Promise:
    """The original curve of a field, and trial encodings held against it.

    Attributes
    ----------
    field : Samples
    fresh : callable, optional
        Makes tubes for trial encodings that start from the same state as the file's, because what is known from earlier
        isovalues affects what is coded. By default those of an independent file.
    free : bool
        Whether crossings may be coded with slack (see `Slack`).
    tried : callable, optional
        Called after each trial.
    truth : Truth, optional
        What the encoder knows of the field, if that has been made.
    holes : Holes, optional
        The mask, where samples are missing.
    fixed : callable, optional
        Which edges, by the positions of their ends, are coded as crossed where the field crosses them.
    sides : SharedSides, optional
        Both ends of periodic axes: crossed edges in them stay those of the full grid in all reductions, and are fixed.
    fences : Fences, optional
        Curves of neighbouring isovalues, which the curve must not cross.
    leans : bool
        Whether what is known from an earlier isovalue affects what is coded.
    lean_level : int
        Uniform level of that isovalue, -1 without one.
    contour : Contour
        The original curve.
    phi : ndarray of float32
        The field less its isovalue.
    """

    field: Samples
    fresh: Callable[[], Tube] | None = None
    free: bool = True
    tried: Callable[[], object] | None = None
    truth: GroundTruth | None = None
    holes: Holes | None = None
    fixed: Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.bool_]] | None = None
    sides: SharedSides | None = None
    fences: Fences | None = None
    leans: bool = False
    lean_level: int = -1
    contour: Contour = derived(init=False)
    phi: NDArray[np.float32] = derived(init=False)
    _targets: dict[float, Target] = derived(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        if self.sides:
            self.fixed = self.sides.holds
        self.contour = original(self.field)
        self._truth = self.truth or truth_of(self.field)
        largest = np.finfo(np.float32).max
        self.phi = np.empty(self.field.values.shape, np.float32)
        # slice by slice: in double precision the whole would take several times the memory
        for samples, phi in zip(self.field.values, self.phi, strict=True):
            phi[...] = np.clip(samples.astype(np.float64) - self.field.isovalue, -largest, largest)
        # points on edges of the grid: one of each that the curve crosses
        self._on_grid = (self.contour.points != np.floor(self.contour.points)).sum(axis=1) <= 1

    @property
    def n(self) -> int:
        """Number of axes."""
        return self.field.signs.ndim

    @property
    def full_level(self) -> int:
        """Level of the full grid."""
        return self.n * cube_exponent(self.field.signs.shape)

    def reduction(self, start: Chosen | None = None) -> Reduction:
        """A reduction of the full grid, or of a mesh."""
        given = self.field.signs, self.phi, self.crossing_points, start, self._truth.busy
        return JoinedReduction(*given, *self._at_sides) if self.sides else Reduction(*given)

    @cached_property
    def _at_sides(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Vertices that crossed edges in the sides need."""
        assert self.sides is not None
        return self.sides.vertices(self.field.signs)

    @property
    def crossing_points(self) -> NDArray[np.float64]:
        """Points of the original curve on edges of the grid, one of each crossed one."""
        return self.contour.points[self._on_grid]

    def curvature(self) -> NDArray[np.float64]:
        """Curvature of the original curve at the points of its reductions, in 1 / cells."""
        return curvature(self.contour)[self._on_grid]

    def trial(self, plan: Sequence[Entry]) -> tuple[int, Contour]:
        """Bytes of the runs of a plan, and what a decoder draws in the end."""
        total, leaves = self.leaves(plan)
        return total, draw(leaves, measured=True)

    def leaves(self, plan: Sequence[Entry]) -> tuple[int, Leaves]:
        """Bytes of the runs of a plan, and the leaves in the end."""
        total, tube = self._encoded(plan)
        if self.tried:
            self.tried()
        return total, self._leaves(tube)

    def after_entries(self, plan: Sequence[Entry], wanted: Collection[int]) -> dict[int, Contour]:
        """Drawings of a decoder after some entries of a plan, by number."""
        found: dict[int, Contour] = {}
        done = 0

        def seen(tube: Tube, ends: Sequence[int]) -> None:
            nonlocal done
            done += 1
            here = [number for number in wanted if number < len(ends) and ends[number] == done]
            if here:
                found[here[0]] = draw(self._leaves(tube), measured=True)

        self._encoded(plan, seen)
        if self.tried:
            self.tried()
        return found

    def _leaves(self, tube: Tube) -> Leaves:
        isovalue, scale = self.field.isovalue, self.field.scale
        return leaves_of(tube, isovalue, lambda steps, above: interval_value(isovalue, scale, steps, above))

    def _encoded(
        self, plan: Sequence[Entry], seen: Callable[[Tube, Sequence[int]], object] | None = None
    ) -> tuple[int, Tube]:
        """Bytes of the runs of a plan, and the tube in the end."""
        tube = self.fresh() if self.fresh else self._alone()
        # the earlier isovalue has a limit of steps, which trials do not take part in
        steps = tube.lean.state.counters.work if tube.lean else 0
        strand = LayerWriter(self.field, tube, plan, Progress(tube.full_level, lean_level=self.lean_level))
        total = done = 0
        while done < len(strand.layers):
            done, run = strand.encode_run(done, (lambda: seen(tube, strand.ends)) if seen else (lambda: None))
            total += len(run)
        if tube.lean:
            tube.lean.state.counters.work = steps
        return total, tube

    def _alone(self) -> Tube:
        header = Header(self.field.values.shape, self.field.isovalue, self.field.scale, Profile.MAIN)
        return field_tube(header, self.field, self._truth, holes=self.holes)

    def excess(self, contour: Contour, tolerance: float) -> np.ndarray:
        """Places where the two curves are not proven to lie within the tolerance of each other, (K, n).

        Also those where the curve crosses one of a neighbouring isovalue that is coded.
        """
        limit = tolerance + ROUNDED
        there = Target(contour.points, contour.cells, limit).exceeded(self.contour.points, self.contour.cells)
        here = self.target(limit).exceeded(contour.points, contour.cells)
        across = [self.fences.coded_crossed(contour)] if self.fences else []
        return np.concatenate([there.places, here.places, *across])

    def faults(self, contour: Contour, tolerance: float) -> NDArray[np.float64]:
        """Places as of `excess`, and where the curve crosses one of a neighbouring isovalue that is yet to be coded."""
        places = self.excess(contour, tolerance)
        return np.concatenate([places, self.fences.waiting_crossed(contour)]) if self.fences else places

    def target(self, limit: float) -> Target:
        """The original curve, for others to be held against it."""
        if limit not in self._targets:
            self._targets[limit] = Target(self.contour.points, self.contour.cells, limit)
        return self._targets[limit]
