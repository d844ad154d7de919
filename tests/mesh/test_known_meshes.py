"""Explicit domains: contours of values at the vertices of meshes (spec clause 10)."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

import isocodec
from brute import HEAVY, INTERPRETED
from explicit_meshes import components, crossings, euler, pieces, plane, space
from isocodec import Decoder, IsoError, Limits, Mesh, decode, encode
from isocodec.errors import FormatError, InputError, LimitError, OptionError, TruncatedError
from libraries import Late
from tables import looped

cKDTree = Late("scipy.spatial.cKDTree")

MANY = 6 if INTERPRETED else 150 if HEAVY else 10
"""Random complexes, of each dimension."""


def rounded(points):
    """Points as a sorted array that can be compared."""
    found = np.round(points, 6) + 0.0
    return found[np.lexsort(found.T)]


def noise(count, seed, low=0, high=100):
    return np.random.default_rng(seed).integers(low, high, count)


def smooth(points):
    """A few hills."""
    x = points / 20
    return np.rint(100 * np.sin(x[:, 0]) * np.cos(x[:, 1]) + 3 * x[:, -1]).astype(np.int64)


def check(mesh, values, isovalue, **options):
    """Encode and decode; points and pieces are those of brute force."""
    # a distance is kept with fewer points otherwise
    progressive = False if isinstance(options.get("precision"), float) else None
    data = encode(Mesh(*mesh, values, progressive=progressive), isovalue, **options)
    contour = decode(data, mesh=mesh)
    wanted = crossings(mesh, values, isovalue)
    assert contour.complete
    assert len(contour.points) == len(wanted)
    if options.get("precision") == "exact":
        points = np.array(list(wanted.values())).reshape(-1, mesh[0].shape[1])
        assert np.allclose(rounded(contour.points), rounded(points))
    return data, contour


@pytest.mark.parametrize("make", [plane, space])
@pytest.mark.parametrize("values_of", ["noise", "smooth"])
def test_random_complexes(make, values_of):
    """Points, components and Euler characteristics are those of brute force; with borders, pieces, lone vertices."""
    for seed in range(MANY):
        mesh = make(seed)
        values = noise(len(mesh[0]), seed) if values_of == "noise" else smooth(mesh[0])
        isovalue = int(np.median(values)) + 0.5
        _, contour = check(mesh, values, isovalue, precision="exact")
        number = {edge: i for i, edge in enumerate(crossings(mesh, values, isovalue))}
        if make is plane:
            cells = [[number[edge] for edge in edges] for edges in pieces(mesh, values, isovalue)]
            cells = np.array(cells, np.int64).reshape(-1, 2)
            assert components(len(number), cells) == components(len(contour.points), contour.cells)
            assert euler(len(number), cells) == euler(len(contour.points), contour.cells)
        else:
            cells = [[number[edge] for edge in edges] for edges in pieces(mesh, values, isovalue)]
            linked = [(cell[0], other) for cell in cells for other in cell[1:]]
            assert components(len(number), np.array(linked, np.int64).reshape(-1, 2)) == components(
                len(contour.points), contour.cells
            )
            assert len(contour.cells) == sum(len(cell) - 2 for cell in cells)


def test_orientation():
    """Curves have the higher values on their left; normals of surfaces point to lower values."""
    points, cells = plane(5, 60, 1.0)
    contour = check((points, cells), points[:, 0], 50.0, precision="step=1e-6")[1]
    assert (np.diff(contour.points[contour.cells], axis=1)[:, 0, 1] <= 1e-9).all()
    points, cells = space(5, 40, 1.0)
    contour = check((points, cells), points[:, 2], 50.0, precision="step=1e-6")[1]
    a, b, c = (contour.points[contour.cells[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] <= 1e-9).all()


def test_several_isovalues():
    """Each leans on others, takes fewer bytes for it, and is that of a file of its own."""
    mesh = plane(4, 60 if INTERPRETED else 500, 0.95)
    values = smooth(mesh[0])
    isovalues = [20.5, -30.5, 60.5, 0]
    for options in ({"precision": "exact"}, {"precision": 0.5}, {"precision": "signs"}):
        data = encode(Mesh(*mesh, values), isovalues, **options)
        alone = encode(Mesh(*mesh, values), isovalues, order="independent", **options)
        assert len(data) < len(alone)
        for contour, isovalue in zip(isocodec.open(data, mesh=mesh).contours(), isovalues, strict=True):
            single = decode(encode(Mesh(*mesh, values), isovalue, **options), mesh=mesh)
            assert np.array_equal(rounded(contour.points), rounded(single.points))
            assert np.array_equal(contour.points, decode(data, mesh=mesh, isovalue=isovalue).points)
            assert contour.isovalue == isovalue
    assert decode(alone, mesh=mesh, isovalue=60.5).complete


def test_piece_by_piece():
    """Nothing depends on how bytes come; a file that ends early has the layers before."""
    mesh = plane(7)
    values = noise(len(mesh[0]), 7)
    data = encode(Mesh(*mesh, values), [30, 60], precision="exact", metadata={"unit": "m"})
    whole = Decoder(mesh=mesh)
    whole.feed(data)
    events = list(whole)
    pieces_ = Decoder(mesh=mesh)
    found = []
    for byte in data:
        pieces_.feed(bytes([byte]))
        found += list(pieces_)
    pieces_.close()
    assert found == events
    assert pieces_.metadata == {"unit": "m"}
    for size in range(len(data)):
        decoder = Decoder(mesh=mesh)
        decoder.feed(data[:size])
        with pytest.raises(TruncatedError):
            decoder.close()
        assert len(decoder.contour(0).points) <= len(whole.contour(0).points)
    with pytest.raises(FormatError):
        decode(data + b"x", mesh=mesh)


def test_another_mesh():
    """A mesh that is not the file's is refused; the message says in what it differs."""
    points, cells = plane(3)
    data = encode(Mesh(points, cells, noise(len(points), 1)), 40)
    with pytest.raises(InputError, match="does not store"):
        decode(data)
    with pytest.raises(InputError, match="points"):
        decode(data, mesh=(points[:-1], cells[(cells < len(points) - 1).all(axis=1)]))
    with pytest.raises(InputError, match="SHA-256"):
        decode(data, mesh=(points, cells[::-1]))
    moved = points.copy()
    moved[3] += 1e-3
    with pytest.raises(InputError, match="SHA-256"):
        decode(data, mesh=(moved, cells))
    nearly = points * (1 + 1e-12)
    assert decode(data, mesh=(nearly, cells)).complete
    decoder = Decoder()
    decoder.feed(data)
    with pytest.raises(InputError, match="does not store"):
        list(decoder)
    decoder = Decoder(mesh=(points, cells))
    decoder.feed(encode(np.eye(5), 0.5))
    with pytest.raises(OptionError, match="not of values on a mesh"):
        _ = decoder.take().on_mesh


SQUARE = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], float)
BAD = {
    "points": (SQUARE[:2], [[0, 1, 1]], "points"),
    "NaN": (np.where(SQUARE == 1, np.nan, SQUARE), [[0, 1, 2]], "points"),
    "range": (SQUARE, [[0, 1, 4]], "cells"),
    "shape": (SQUARE, [[0, 1]], "cells"),
    "tetrahedra in the plane": (SQUARE, [[0, 1, 2, 3]], "cells"),
    "repeated vertex": (SQUARE, [[0, 1, 2], [1, 1, 3]], "degenerate"),
    "no area": (np.array([[0, 0], [1, 0], [2, 0], [0, 1]]), [[0, 1, 3], [0, 1, 2]], "degenerate"),
    "twice": (SQUARE, [[0, 1, 2], [2, 0, 1]], "repeated"),
    "manifold": (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]), [[0, 1, 2], [0, 1, 3], [1, 0, 4]],
                 "manifold"),
    "coincident": (np.array([[0, 0], [1, 0], [0, 1], [1, 0], [2, 2]]), [[0, 1, 2], [1, 2, 4], [3, 4, 2]], "coincident"),
}


@looped("name", BAD)
def test_no_complex(name):
    """Meshes that are none are refused, with the numbers of what is wrong."""
    points, cells, code = BAD[name]
    with pytest.raises(InputError) as caught:
        encode(Mesh(points, cells, np.arange(len(points))), 1.5)
    assert caught.value.code == code


@pytest.mark.parametrize(
    "values",
    [np.arange(2), [0, 1, 2, np.nan], ["a"] * 4, np.zeros((4, 1))],
)
def test_values_that_do_not_fit(values):
    with pytest.raises(InputError):
        encode(Mesh(SQUARE, [[0, 1, 2], [1, 3, 2]], values), 1.5)


def test_options_that_do_not_fit():
    mesh = SQUARE, [[0, 1, 2], [1, 3, 2]]
    for values, options in (
        ([0.0, 1, 2, 3], {"precision": "exact"}),
        ([0, 1, 2, 3], {"precision": "step=0.5"}),
        ([0.0, 1, 2, 3], {"precision": [1, 4]}),
        ([0.0, 1, 2, 3], {"precision": f"step={-1}"}),
        ([0, 1, 2, 3], {"layers": 2}),
    ):
        with pytest.raises(OptionError):
            encode(Mesh(*mesh, values), 1.5, **options)
    with pytest.raises(OptionError):
        encode(Mesh(*mesh, [0, 1, 2, 3], stored="unknown"), 1.5)


@pytest.mark.parametrize("make", [plane, space])
def test_damaged(make):
    """Whatever bytes come, a decoder ends with an error of ours or a contour."""
    mesh = make(9)
    data = encode(Mesh(*mesh, noise(len(mesh[0]), 9)), [30, 60], precision=1)
    rng = np.random.default_rng(1)
    for _ in range(20 if INTERPRETED else 300 if HEAVY else 40):
        wrong = bytearray(data)
        for _ in range(rng.integers(1, 4)):
            wrong[rng.integers(len(wrong))] = rng.integers(256)
        decoder = Decoder(mesh=mesh)
        try:
            decoder.feed(bytes(wrong))
            list(decoder)
        except IsoError:
            pass
        if decoder.contents is not None and decoder.contents.kind in ("grid", "mesh"):
            decoder.contour(0)
        else:  # nothing is known yet, and nothing drawn
            with suppress(IsoError):
                assert not len(decoder.contour(0).points)


def test_limits():
    mesh = plane(3)
    data = encode(Mesh(*mesh, noise(len(mesh[0]), 1)), [40, 50])
    for limits in (
        Limits(vertices=10), Limits(simplices=10), Limits(symbols=20), Limits(isovalues=1), Limits(layers=1),
        Limits(bytes=20), Limits(memory=1000),
    ):
        with pytest.raises(LimitError):
            isocodec.open(data, mesh=mesh, limits=limits).contours()


SIDES = {"above": [True] * 3, "below": [False] * 3, "both": [True, False, True]}


@looped("side", SIDES)
@looped("stored", ["known", "coded", "whole"])
@looped("levels", [False, True])
@looped("make", [plane, space])
def test_sides_of_parts_that_no_curve_enters(make, levels, stored, side):
    """Parts beside one another, each on a side of its own; beside a part that is crossed they have their sides, too."""
    points, cells = make(3, 25, 1.0)
    apart = np.eye(points.shape[1])[0] * 3 * np.ptp(points[:, 0])
    above = np.array(SIDES[side])
    for crossed in (False, True):
        values = [np.where(one, 1.0, -1.0) + np.zeros(len(points)) for one in above]
        if crossed:
            values[1] = points[:, 0] - np.median(points[:, 0])
        mesh = Mesh(
            np.concatenate([points + i * apart for i in range(3)]),
            np.concatenate([cells + i * len(points) for i in range(3)]), np.concatenate(values), stored=stored,
            progressive=levels,
        )
        found = isocodec.open(
            encode(mesh, [0.0, 0.25]), mesh=(mesh.points, mesh.cells) if stored == "known" else None
        )
        for isovalue in (0.0, 0.25):
            there = found.mesh(isovalue, whole=True)
            # a mesh in the file has its vertices in an order of its own
            _, same = cKDTree(mesh.points).query(there.points)
            if stored != "coded":
                np.testing.assert_array_equal(there.above, (mesh.values > isovalue)[same])
            elif not crossed:
                # one cell at least, whatever its side
                assert len(there.cells) == 1 and (there.above == above[0]).all()


@looped("infinite", [np.inf, -np.inf])
@looped("vertex", range(3))
def test_beside_an_infinite_value_the_crossing_is_at_the_finite_one(infinite, vertex):
    """As on grids: as beside an ever larger one."""
    mesh = np.array([[0.0, 0], [8, 0], [0, 8]]), np.array([[0, 1, 2]])
    finite = -np.sign(infinite)
    values = np.where(np.arange(3) == vertex, infinite, finite)
    points = decode(encode(Mesh(*mesh, values), 0.0), mesh=mesh).points
    ends = mesh[0][np.arange(3) != vertex]
    assert np.abs(points[:, None] - ends[None]).max(axis=2).min(axis=1).max() < 0.5
