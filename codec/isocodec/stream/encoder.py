"""The incremental encoder: a field in, bytes out as layers get done (spec clause 8.1)."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from isospec.container import Checksum, ChunkType, Profile

from ..errors import FormatError, OptionError
from ..field.placement import PLACEMENT, placement_of, read_placement, write_placement
from ..field.samples import check_field
from ..format.chunks import (
    LayerRecord,
    Promises,
    write_chunk,
    write_further,
    write_index,
    write_metadata,
    write_promises,
)
from ..format.header import Header, write_header
from ..format.program import Layer, Progress, write_program
from ..layers.plan import Entry
from ..layers.writer import LayerWriter, field_tube
from ..mesh.tables import cube_exponent
from ..passes.runner import Tube
from ..search import strategy
from ..search.ground_truth import truth_of
from ..search.promise import Promise
from ..search.tolerance import grid_offsets, radices
from .options import SEARCHED, Asked, check_options, isovalues_of, notes_of, number_of, plan_of, steps_of, whole_of

DEFAULT_TOLERANCE = 0.05
"""Largest distance in cells between decoded and extracted curve when nothing else is asked for."""
INDEX_SHARE = 100
"""A level index is written if it takes at most this fraction of the data."""


class Encoder:
    """Encodes isocontours of a field; iterating, once, yields the bytes of the file, chunk by chunk.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats
    isovalue : number or sequence of numbers
        One isovalue, or several of the same field, in the order in which the file has them: finite numbers of Python's
        or numpy's, fractions or decimals. Files hold double precision; whole numbers beyond it are refused.
    exact : bool
        Integer data: send the values next to the curve to the last bit.
    tolerance : float, optional
        Largest distance, in cells, of every point of the decoded curve from the extracted one and the reverse. From
        0.1 on the mesh and the fineness of crossings are chosen so that the file is small; the distance is proven on
        the decoded curve. Below, and by default with 0.05, all crossings of the grid are told, without a search. With
        a ``criterion`` the mesh is that of the criterion, and the distance is that of its crossings alone.
    signs_only : bool
        Send no geometry: which samples lie above is exact, crossings are drawn half-way.
    step : float, optional
        Float data: send the values next to the curve to within half this step.
    base_level : int, optional
        Uniform level of the base; the level of the full grid makes a single-rate file.
    preserve_topology : bool
        Every layer, from the base on, has as many components as the curve, nested alike; surfaces with the same
        Euler characteristics. Samples equal to the isovalue count as below it.
    steps : sequence of float, optional
        What layers promise one after the other, falling, in cells; "exact" (or 0) at the end stands for all values.
    criterion : str, optional
        Reduce the mesh under one criterion, as published: ``crossing``, ``topology``, ``curvature`` (``parameter``:
        mean curvature above which the finest mesh stays, 1 / cells), ``distortion`` (``parameter``: distance in
        cells from the original curve to the new one), ``level`` (``parameter``: that of a uniform mesh).
    parameter : float, optional
    leaning : bool
        Whether each further isovalue makes use of what the file says of the nearest one before it.
    plan : sequence of entries, optional
        Instead of all these but ``step``: the layers one by one, as ``("base", level)``, ``("refine", rounds)``,
        ``("values", bits)``, ``("offsets", radix)``, where None means as far as it goes; ``("adaptive_base", level,
        mesh)``, ``("adapt", births, mesh)`` with the mesh that they lead to (`mesh.vertex_set.Chosen`),
        ``("leaf_base",)``, ``("offsets", radix, unit)``. ``("promise", distance)`` behind layers other than values says
        how far their curve lies from the original one at most, which nobody proves. A mapping gives each isovalue a
        plan of its own.
    profile : str
        ``main``, or ``baseline``, which makes larger files for smaller and faster decoders.
    metadata : mapping of str to str, optional
    placement : (n,), (n, n + 1) or (n + 1, n + 1) array_like, optional
        Where the samples lie: distances of neighbours along each axis of the array, or a row for each coordinate x, y
        (, z) with what a step along each axis adds to it and what it is at sample 0; a last row of 0 .. 0 1 may follow.
        It goes into the metadata, and changes nothing but `Contour.placed`; tolerances stay in cells.
    progress : callable, optional
        Called with the layers done and their total; before, while a mesh is searched for, with the number of curves
        tried and 0.

    Raises
    ------
    InputError
        If the field or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.
    """

    def __init__(
        self,
        field: ArrayLike,
        isovalue: float | Sequence[float],
        *,
        exact: bool = False,
        tolerance: float | None = None,
        signs_only: bool = False,
        step: float | None = None,
        base_level: int | None = None,
        preserve_topology: bool = False,
        steps: Sequence[float] | None = None,
        criterion: str | None = None,
        parameter: float | None = None,
        leaning: bool = True,
        plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None = None,
        profile: str = "main",
        metadata: Mapping[str, str] | None = None,
        placement: ArrayLike | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        self._asked = Asked(
            exact, number_of("tolerance", tolerance), signs_only, number_of("step", step),
            whole_of("base_level", base_level), preserve_topology, steps_of(steps), criterion,
            number_of("parameter", parameter), plan,
        )  # fmt: skip
        check_options(self._asked)
        self._leaning = leaning
        if str(profile).upper() not in Profile.__members__:
            names = ", ".join(p.name.lower() for p in Profile)
            raise OptionError(f"unknown profile {profile!r}", code="profile", remedy=f"choose one of: {names}")
        self.isovalues = isovalues_of(isovalue)
        self._fields = [check_field(field, value, self._asked.step) for value in self.isovalues]
        self._truths = [truth_of(one) for one in self._fields]
        first = self._fields[0]
        if (exact or strategy.EXACT in (self._asked.steps or [])) and not first.integer:
            raise OptionError(
                "exact is for integer data, and the field holds floats", code="exact", remedy="use step or tolerance"
            )
        self._metadata = notes_of(metadata or {})
        if placement is not None:
            if PLACEMENT in self._metadata:
                raise OptionError("placement and metadata of that name contradict one another", code="options")
            self._metadata[PLACEMENT] = write_placement(placement_of(placement, first.values.ndim))
        elif PLACEMENT in self._metadata and read_placement(self._metadata, first.values.ndim) is None:
            raise OptionError(
                f"the note {PLACEMENT}, {self._metadata[PLACEMENT]!r}, says nothing that a reader would understand",
                code="placement", remedy="see clause 3.7.2, or give the numbers as the option of that name",
            )  # fmt: skip
        self._report = progress
        self._tried = 0
        self.header = Header(first.values.shape, first.isovalue, self._asked.step, Profile[profile.upper()])
        self._strands: list[LayerWriter] = []
        self._strands.append(self._strand(0, Progress(self._full_level))[0])
        self._begun = False

    @property
    def layers(self) -> list[Layer]:
        """Layers known so far, of all isovalues."""
        return [layer for strand in self._strands for layer in strand.layers]

    @property
    def records(self) -> list[LayerRecord]:
        """What the layers that are done took."""
        return [record for strand in self._strands for record in strand.records]

    @property
    def _full_level(self) -> int:
        return len(self.header.shape) * cube_exponent(self.header.shape)

    @property
    def _tube(self) -> Tube:
        return self._strands[-1].tube

    def _strand(self, number: int, progress: Progress) -> tuple[LayerWriter, int | None]:
        """The layers of an isovalue, ready to be encoded when those before it are done; the one that it leans on."""
        lean = self._leans_on(number)
        try:
            plan = self._plan_of(number, lean)
        except strategy.NotKeptError:
            if lean is None:
                raise
            lean = None
            plan = self._plan_of(number, None)
        begun = progress.begin(None if lean is None else self._strands[lean].progress)
        return LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun), lean

    def _fresh(self, number: int, lean: int | None) -> Tube:
        """A tube of an isovalue that nothing is told of yet."""
        earlier, other = (None, 0.0) if lean is None else (self._strands[lean].tube, self.isovalues[lean])
        return field_tube(self.header, self._fields[number], self._truths[number], earlier, other)

    def _plan_of(self, number: int, lean: int | None) -> Sequence[Entry]:
        """What the options come to for one isovalue."""
        o = self._asked
        if o.plan is not None:
            plan = plan_of(o.plan, self.isovalues[number])
            if not len(plan) and number == len(self.isovalues) - 1:
                raise OptionError("the plan has no layers", code="plan", remedy='begin it with ("base", level)')
            return plan
        values: list[Entry] = [("values", None)] if o.exact or o.step is not None else []
        fine = None if values or o.signs_only else o.tolerance or DEFAULT_TOLERANCE
        free = self.header.profile == Profile.MAIN and self._slack_keeps_order(fine)
        offsets = grid_offsets(fine, free)
        searched = o.tolerance if o.base_level is None and (o.tolerance or 0) >= SEARCHED else None
        if searched is o.steps is o.criterion is None and not o.preserve_topology:
            return strategy.grid_plan(len(self.header.shape), self._full_level, o.base_level) + values + offsets
        truth = self._truths[number]
        promise = Promise(self._fields[number], lambda: self._fresh(number, lean), free, self._try, truth)
        if o.steps is not None:
            return strategy.stepwise(promise, o.steps, o.preserve_topology)
        if o.criterion is not None:
            mesh: strategy.Plan = strategy.reduced(promise, o.criterion, o.parameter, o.preserve_topology)
            return mesh + values + [("offsets", radix, 0) for radix in radices(fine)]
        if searched is not None:
            return strategy.smallest(promise, searched, o.preserve_topology)
        return strategy.whole_mesh(promise, True) + values + offsets

    def _slack_keeps_order(self, tolerance: float | None) -> bool:
        """Whether crossings of several isovalues stay in order if they are told with slack (spec annex G.3).

        First digits do not get past those of the isovalue leaned on. So each isovalue has to lie beyond all before it.
        """
        before = [self.isovalues[:i] for i in range(1, len(self.isovalues))]
        outward = all(not min(b) < v < max(b) for b, v in zip(before, self.isovalues[1:], strict=True))
        return len(self.isovalues) == 1 or (self._leaning and outward and len(radices(tolerance)) <= 1)

    def _leans_on(self, number: int) -> int | None:
        """Number of the earlier isovalue that lies nearest."""
        if number == 0 or not self._leaning:
            return None
        return min(range(number), key=lambda i: abs(self.isovalues[i] - self.isovalues[number]))

    def __iter__(self) -> Iterator[bytes]:
        if self._begun:
            raise OptionError("an encoder can be iterated only once", code="iterated", remedy="make another one")
        self._begun = True
        checksum = 0
        for piece in self._pieces():
            checksum = zlib.crc32(piece, checksum)
            yield piece
        yield Checksum.build(checksum)

    def _pieces(self) -> Iterator[bytes]:
        """The file but for its checksum."""
        yield write_header(self.header)
        if self._metadata:
            yield write_chunk(ChunkType.METADATA, write_metadata(self._metadata), ancillary=True)
        for number in range(len(self.isovalues)):
            if number > 0:
                strand, lean = self._strand(number, self._strands[-1].progress)
                self._strands.append(strand)
                yield write_chunk(ChunkType.ISOVALUE, write_further(self.isovalues[number], lean))
            yield from self._layers(self._strands[number], number == len(self.isovalues) - 1)

    def _layers(self, strand: LayerWriter, last: bool) -> Iterator[bytes]:
        """Chunks of layers of one isovalue; behind the last one the level index."""
        if strand.within:
            promises = write_promises(Promises(strand.within, self._asked.preserve_topology))
            yield write_chunk(ChunkType.PROMISES, promises, ancillary=True)
        program = replace(strand.progress.begin(None), lean_level=strand.progress.lean_level)
        done = 0
        while done < len(strand.layers):
            try:
                end, run = strand.encode_run(done, self._done)
            except FormatError as error:
                if all(layer.births for layer in self.layers if layer.kind == "adapt"):
                    raise
                raise OptionError(
                    "an adaptive layer of the plan leaves out new components that there are", code="plan",
                    remedy='("adapt", 1, mesh)',
                ) from error  # fmt: skip
            payload = write_program(strand.layers[done:end], program, strand.bits) + run
            done = end
            ends = last and done == len(strand.layers)
            index = write_index(self.layers, self.records) if ends else b""
            if len(index) * INDEX_SHARE > sum(s.run_bytes for s in self._strands):
                index = b""
            yield write_chunk(ChunkType.LAYERS, payload, last=ends and not index)
            if index:
                yield write_chunk(ChunkType.INDEX, index, ancillary=True, last=True)

    def _try(self) -> None:
        self._tried += 1
        if self._report:
            self._report(self._tried, 0)

    def _done(self) -> None:
        if self._report:
            waiting = len(self.isovalues) - len(self._strands)
            self._report(len(self.records), len(self.layers) + waiting * len(self._strands[0].layers))
