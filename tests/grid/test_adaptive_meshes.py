"""Adaptive meshes: bases, refinements and offsets on any closed set of vertices, against recursive bisection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brute import examples, meshes, mixed_leaves, sign_fields
from files import fed
from isocodec.drawing import snapshot
from isocodec.grid.lattice.vertex_set import finest_level, has
from isocodec.stream.decoder import Decoder
from isocodec.stream.encoder import Encoder, encoder_of
from isoconform.meshes import chosen, closed, level_of, parents

Mesh = frozenset[tuple[int, ...]]

UNEVEN_POINTS = [(0, 0), (7, 5), (9, 4), (11, 6), (12, 2)]
UNEVEN_MESH = frozenset([(0, 8), (4, 0), (4, 4), (8, 0), (8, 8)])


def leaves_of(decoder: Decoder) -> list[tuple[int, bytes]]:
    """Leaves of a decoder's state by level and positions, as often as they are there."""
    leaves = snapshot.leaves_of(decoder.grid._tube, 0.5, lambda number, above: number)
    return [(int(level), leaves.position[row].astype(np.int64).tobytes()) for level, row in
            zip(leaves.levels, leaves.simplices, strict=True)]


def check(data: bytes, encoder: Encoder, field: NDArray[np.bool_], mesh: Mesh) -> Decoder:
    """Decoder and encoder agree; the leaves are those of recursive bisection, each once."""
    decoder = fed(data)
    assert decoder.grid.state().lines() == snapshot.state_of(encoder.frame.strands[-1].tube).lines()
    found = leaves_of(decoder)
    assert len(found) == len(set(found))
    assert set(found) == mixed_leaves(field, mesh)
    return decoder


@st.composite
def cases(draw, n: int, most: int) -> tuple[NDArray[np.bool_], list[Mesh]]:
    """A field and some meshes, each one inside the next."""
    field = draw(sign_fields(n, most))
    out: list[Mesh] = []
    for _ in range(draw(st.integers(1, 3))):
        out.append(draw(meshes(field.shape, out[-1] if out else frozenset())))
    return field, out


@pytest.mark.parametrize(("n", "most"), [(2, 12), (3, 6)])
def test_adaptive_base(n, most):
    @settings(examples(200), deadline=None)
    @given(cases(n, most))
    def run(case):
        field, (mesh, *_) = case
        encoder = encoder_of(field, 0.5, layers=[("adaptive_base", 0, chosen(field.shape, mesh))])
        check(b"".join(encoder), encoder, field, mesh)

    run()


@pytest.mark.parametrize(("n", "most"), [(2, 12), (3, 6)])
def test_refinements_in_any_order(n, most):
    """Uniform and adaptive bases and refinements follow on each other; new components come in all of them."""

    @settings(examples(250), deadline=None)
    @given(cases(n, most), st.data())
    def run(case, data):
        field, steps = case
        full = n * max(max(field.shape) - 2, 0).bit_length()
        level = data.draw(st.integers(0, full))
        uniform = frozenset(w for w in parents(field.shape) if level_of(w, field.shape) < level)
        plan = []
        mesh = frozenset()
        if data.draw(st.booleans()):
            plan.append(("base", level))
            mesh = uniform
        else:
            mesh = steps.pop(0) | uniform
            plan.append(("adaptive_base", level, chosen(field.shape, mesh)))
        for step in steps:
            if level < full:
                mesh = mesh | step
                plan.append(("adapt", 1, chosen(field.shape, mesh)))
        if data.draw(st.booleans()) and level < full:
            plan.append(("refine", None))
            mesh = frozenset(parents(field.shape))
        encoder = encoder_of(field, 0.5, layers=plan)
        check(b"".join(encoder), encoder, field, mesh)

    run()


def test_finest_level():
    for shape in [(5, 5), (9, 4), (3, 6), (5, 4, 7)]:
        n = len(shape)
        k = max(max(shape) - 2, 0).bit_length()
        for w in parents(shape):
            if all(x < s for x, s in zip(w, shape, strict=True)):
                assert finest_level(chosen(shape, closed(shape, [w])), k, n) == level_of(w, shape)


def test_flags_off_the_box():
    c = chosen((3, 6), frozenset())
    assert not any(has(c, *map(np.int64, w + (0,))) for w in parents((3, 6)))


def test_inference_along_an_edge_cut_unevenly():
    """The further half of an edge may be cut, and its middle known, while the nearer half is not (5.5.4)."""
    field = np.zeros((13, 11), bool)
    field[tuple(zip(*UNEVEN_POINTS, strict=True))] = True
    mesh = chosen(field.shape, UNEVEN_MESH)
    encoder = encoder_of(field, 0.5, layers=[("adaptive_base", 0, mesh), ("refine", None)])
    data = b"".join(encoder)
    assert fed(data).grid.state().lines() == snapshot.state_of(encoder.frame.strands[-1].tube).lines()
