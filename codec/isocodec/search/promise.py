"""A promise: the original curve, and trial encodings held against it (rows C2-distortion, S3-distortion)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from dataclasses import field as derived

import numpy as np
from numpy.typing import NDArray

from isospec.container import Profile

from ..drawing.contour import Contour
from ..drawing.drawing import draw
from ..drawing.leaves import Leaves
from ..field.samples import OFFSET_BITS, Field
from ..format.header import Header
from ..format.program import Progress
from ..layers.plan import Entry
from ..layers.writer import LayerWriter, field_tube
from ..mesh.tables import cube_exponent
from ..mesh.vertex_set import Chosen
from ..passes.runner import Tube
from ..passes.snapshot import leaves_of
from ..tube.holes import Holes
from ..tube.truth import Place
from .curvature import curvature
from .distance import Target
from .fit import AGAIN, REACHES, ROUNDS, fitted_offsets
from .ground_truth import GroundTruth, truth_of
from .original import original
from .reduction import Reduction


@dataclass
class Promise:
    """The original curve of a field, and trial encodings held against it.

    Attributes
    ----------
    field : Field
    fresh : callable, optional
        Makes tubes for trial encodings, as that of the file: what is known of earlier isovalues changes what
        is told. By default those of a file of its own.
    free : bool
        Whether crossings may be told with slack (see `Slack`).
    tried : callable, optional
        Called after each trial.
    truth : Truth, optional
        What the encoder knows of the field, if that has been made.
    holes : Holes, optional
        The mask, where samples are missing.
    contour : Contour
        The original curve.
    phi : ndarray of float32
        The field less its isovalue.
    """

    field: Field
    fresh: Callable[[], Tube] | None = None
    free: bool = True
    tried: Callable[[], object] | None = None
    truth: GroundTruth | None = None
    holes: Holes | None = None
    contour: Contour = derived(init=False)
    phi: NDArray[np.float32] = derived(init=False)
    _targets: dict[float, Target] = derived(init=False, default_factory=dict)

    def __post_init__(self) -> None:
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
        return Reduction(self.field.signs, self.phi, self.contour.points[self._on_grid], start, self._truth.busy)

    def curvature(self) -> NDArray[np.float64]:
        """Curvature of the original curve at the points of its reductions, in 1 / cells."""
        return curvature(self.contour)[self._on_grid]

    def trial(self, plan: Sequence[Entry]) -> tuple[int, Contour]:
        """Bytes of the runs of a plan, and what a decoder draws in the end."""
        total, tube = self._encoded(plan)
        if self.tried:
            self.tried()
        return total, draw(self._leaves(tube))

    def placed(self, mesh: Chosen, parts: int, unit: int, tolerance: float, before: Place | None = None) -> Place:
        """Where the curve is to cross the edges of a mesh so that it lies within a tolerance, if it can be.

        ``before`` are the places on a mesh of which most edges are left.
        """
        tube = self._encoded([("adaptive_base", 0, mesh), ("offsets", parts, unit)])[1]
        told = tube.estimates
        position = tube.state.vertex[:, : self.n].astype(np.int64)
        low, high = position[told.edges[:, 0]], position[told.edges[:, 1]]
        where = np.ldexp((before or self.field.crossings)(low, high) + 0.5, -OFFSET_BITS)
        number = fitted_offsets(
            self.contour, [self.target(reach * tolerance) for reach in REACHES], self._leaves(tube), told.edges,
            told.parts, where, tolerance, AGAIN if before else ROUNDS,
        )  # fmt: skip
        return Places(self.field, low, high, ((2 * number + 1) << (OFFSET_BITS - 1)) // told.parts)

    def _leaves(self, tube: Tube) -> Leaves:
        return leaves_of(tube, self.field.isovalue, lambda number, above: number)

    def _encoded(self, plan: Sequence[Entry]) -> tuple[int, Tube]:
        tube = self.fresh() if self.fresh else self._alone()
        # the earlier isovalue has a limit of steps, which trials do not take part in
        steps = tube.lean.state.counters.work if tube.lean else 0
        strand = LayerWriter(self.field, tube, plan, Progress(tube.full_level))
        total = done = 0
        while done < len(strand.layers):
            done, run = strand.encode_run(done, lambda: None)
            total += len(run)
        if tube.lean:
            tube.lean.state.counters.work = steps
        return total, tube

    def _alone(self) -> Tube:
        header = Header(self.field.values.shape, self.field.isovalue, self.field.scale, Profile.MAIN)
        return field_tube(header, self.field, self._truth, holes=self.holes)

    def excess(self, contour: Contour, tolerance: float) -> np.ndarray:
        """Places where the two curves are not proven to lie within the tolerance of each other, (K, n)."""
        ours, theirs = (self.contour.points, self.contour.cells), (contour.points, contour.cells)
        there = Target(*theirs, tolerance).exceeded(*ours).places
        return np.concatenate([there, self.target(tolerance).exceeded(*theirs).places])

    def target(self, limit: float) -> Target:
        """The original curve, for others to be held against it."""
        if limit not in self._targets:
            self._targets[limit] = Target(self.contour.points, self.contour.cells, limit)
        return self._targets[limit]


class Places:
    """Chosen places on edges; on others those where the field crosses."""

    def __init__(self, field: Field, low: NDArray[np.int64], high: NDArray[np.int64], where: NDArray[np.int64]) -> None:
        self._field = field
        names = np.hstack([low, high])
        self._where = {name.tobytes(): int(x) for name, x in zip(names, where, strict=True)}

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """As ``Field.crossings``."""
        out = self._field.crossings(low, high)
        for i, name in enumerate(np.hstack([low, high])):
            out[i] = self._where.get(name.tobytes(), out[i])
        return out
