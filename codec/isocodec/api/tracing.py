"""Contours of a field, drawn one by one from its samples: a contour map without an .iso file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.meeting import Partition, meeting
from ..errors import InputError
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..format.coordinate_record import read_coordinates
from ..limits import Budget, Limits
from ..search.original import original
from ..stream.coordinate_coding import DecodedCoordinates, coordinates_payload
from ..stream.given import completed, levels_of
from ..stream.options import Options
from ..verbs import Progress
from .drawings import OneByOne

MOST = 100_000
"""Largest number of isovalues."""


class Traced(OneByOne):
    """Contours of a field or a mesh, drawn as a decoder draws those of its exact file.

    On a mesh, or with options of `encode`, each contour is decoded from a file of its isovalue, which is not kept.
    There can be any number of isovalues. `valid` (s0, s1) marks the samples that are not missing; it is None if all are
    valid, and on a mesh.
    """

    def __init__(
        self, what: Field | Mesh, isovalue: Any, *, through_holes: bool = False, progress: Progress | None = None,
        **options: Any,
    ) -> None:
        if isinstance(what, Frames):
            raise InputError("is a series, of which one frame can be drawn", code="frames", remedy="give --frame N")
        asked = Options.of()
        isovalues = levels_of(what, isovalue, asked, [what], MOST)
        shape = () if isinstance(what, Mesh) else what.shape
        tetrahedra = isinstance(what, Mesh) and what.cells is not None and np.shape(what.cells)[1:] == (4,)
        super().__init__(isovalues, shape, len(shape) or 2 + tetrahedra, progress)
        self._what, self._through_holes, self._options = what, through_holes, options
        self.valid: NDArray[np.bool_] | None = None
        self._labels: list[Contour] | None = None
        drawn = self._coded if isinstance(what, Mesh) else self._on_grid(what, asked)
        self._draw = self._coded if options else drawn
        # errors come before anything is written
        self._first: Contour | None = self._draw(self.isovalues[0])

    @property
    def empty(self) -> bool:
        """Whether no isovalue has a contour, before any is drawn."""
        first = self._first
        return first is not None and not len(first.points) and not any(
            len(self._draw(isovalue).points) for isovalue in self.isovalues[1:]
        )

    def draw(self, number: int) -> Contour:
        """Draw the contour of an isovalue, by its number."""
        first, self._first = self._first, None
        return self._draw(self.isovalues[number]) if first is None else first

    def _on_grid(self, field: Field, asked: Options) -> Callable[[float], Contour]:
        isovalue = self.isovalues if field.labels is None else None
        given, samples = completed(field, isovalue, asked, most=MOST)
        options, placement, first = given.options, given.placement, samples[0]
        notes = {**options.metadata, **(placement.notes() if placement is not None else {})}
        self.shape, self.n, gone = first.signs.shape, first.signs.ndim, first.gone
        self.valid = None if gone is None else ~gone
        # a file rounds its coordinates
        payload, limits = coordinates_payload(placement, self.shape, gone), Limits()
        record = read_coordinates(payload, self.shape) if payload else None
        where = DecodedCoordinates(Budget(limits.memory), limits).placement(record, self.shape, notes)

        def drawn(isovalue: float) -> Contour:
            field = samples[self.isovalues.index(isovalue)]
            contour = original(replace(field, gone=None) if self._through_holes else field, measured=False)
            return replace(contour, placement=where, metadata=dict(notes), origin_above=bool(field.signs.flat[0]))

        several = field.labels is not None and len(self.isovalues) > 1
        labels = Partition.of((one.signs for one in samples), self.valid) if several else None
        if labels is None:
            return drawn
        return dict(zip(self.isovalues, meeting([*map(drawn, self.isovalues)], labels), strict=True)).__getitem__

    def _coded(self, isovalue: float) -> Contour:
        from .encoding import encode
        from .files import whole_file

        what: Any = self._what
        if isinstance(what, Field) and what.labels is not None:
            if self._labels is None:
                self._labels = whole_file(encode(what, **self._options), None).contours(
                    through_holes=self._through_holes)
            return self._labels[self.isovalues.index(isovalue)]
        mesh = (what.points, what.cells) if isinstance(what, Mesh) and what.cells is not None else None
        data = encode(what, isovalue, **self._options)
        return whole_file(data, None, mesh).contour(through_holes=self._through_holes)
