"""Meshes in the file: positions and connectivity, and isovalues on them (spec clause 10.10)."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

import isocodec
from brute import HEAVY, INTERPRETED
from explicit_meshes import components, crossings, euler, plane, space, torus
from files import fed
from isocodec import Decoder, IsoError, Mesh, decode, encode
from isocodec.entropy.run import Account
from isocodec.errors import InputError, OptionError
from isocodec.mesh.mesh_run import decoded_mesh, encoded_mesh
from isocodec.mesh.quantised import quantised
from tables import looped

MANY = 60 if HEAVY else 6
MAKERS = {"plane": plane, "space": space, "surface": lambda seed: torus(6 + seed % 5, 5)}


def values_of(points, seed):
    """Hills of integers."""
    x = points / max(np.ptp(points), 1e-9) * 6 + seed
    return np.rint(100 * np.sin(x[:, 0]) * np.cos(x[:, 1]) + 20 * x[:, -1]).astype(np.int64)


def same_cells(cells):
    return {tuple(cell) for cell in np.sort(cells, axis=1).tolist()}


def nothing(size, passing):
    """Let memory be taken as it is needed."""


@pytest.mark.parametrize("name", MAKERS)
def test_meshes_return(name):
    """All cells and positions, whatever borders, pieces, holes and handles there are."""
    for seed in range(MANY):
        points, cells = MAKERS[name](seed)
        used, numbers = np.unique(cells, return_inverse=True)
        found, domain = quantised(points[used], numbers.reshape(cells.shape), 0.001)
        run, coded, order = encoded_mesh(domain, found.extent, found.unit)
        size = len(used), len(cells)
        back = decoded_mesh(run, 0, size, cells.shape[1], found.extent, found.unit, Account(), nothing)
        assert np.array_equal(back.mesh.cell, coded.mesh.cell)
        assert np.array_equal(back.mesh.position, domain.mesh.position[order])
        assert same_cells(order[back.mesh.cell]) == same_cells(domain.mesh.cell)
        mine = np.sort(order[back.mesh.cell], axis=1)
        neighbours = {
            (tuple(cell), tuple(mine[other])) for cell, row in zip(mine.tolist(), back.mesh.neighbour, strict=True)
            for other in row if other >= 0
        }
        original = np.sort(domain.mesh.cell, axis=1)
        wanted = {
            (tuple(cell), tuple(original[other]))
            for cell, row in zip(original.tolist(), domain.mesh.neighbour, strict=True)
            for other in row if other >= 0
        }
        assert neighbours == wanted


@looped("name", MAKERS)
@looped("mesh", ["coded", "whole"])
def test_contours(name, mesh):
    """The contour has the topology of that of the mesh as given, and lies within the errors."""
    for seed in range(MANY):
        given = MAKERS[name](seed)
        values = values_of(given[0], seed)
        isovalue = int(np.median(values)) + 0.5
        for options in ({"precision": "exact"}, {"precision": 0.01}, {"precision": "signs"}):
            contour = decode(encode(Mesh(*given, values, stored=mesh, error=0.01), isovalue, **options))
            known = decode(encode(Mesh(*given, values, progressive=False), isovalue, **options), mesh=given)
            assert contour.complete
            assert len(contour.points) == len(known.points) and len(contour.cells) == len(known.cells)
            assert components(len(contour.points), contour.cells) == components(len(known.points), known.cells)
            if given[1].shape[1] == 3:
                assert euler(len(contour.points), contour.cells) == euler(len(known.points), known.cells)
            if options != {"precision": "signs"}:
                wanted = np.array(list(crossings(given, values, isovalue).values()))
                far = np.sqrt(((contour.points[:, None] - wanted[None]) ** 2).sum(axis=2))
                assert np.median(far.min(axis=1)) <= 0.05


def test_errors_of_meshes():
    """Vertices lie within the error that was asked for, also where coordinates are large."""
    points, cells = plane(8, 60, 1.0)
    points = points + [7e5, 5e6]
    for error in (5.0, 0.3, 0.01):
        data = encode(Mesh(points, cells, values_of(points, 2), stored="whole", error=error), 0.5)
        decoder = fed(data)
        there = decoder.on_mesh._points
        distance = np.sqrt(((points[:, None] - there[None]) ** 2).sum(axis=2))
        assert distance.min(axis=1).max() <= error and distance.min(axis=0).max() <= error
        assert isocodec.open(data).info.as_dict()["domain"]["kind"] == "coded"
    for bad in (0, -1.0, np.nan):
        with pytest.raises(OptionError):
            encode(Mesh(points, cells, points[:, 0], stored="coded", error=bad), 7e5)
    with pytest.raises(InputError):
        encode(Mesh(points, cells, points[:, 0], stored="whole", error=1e-9), 7e5)


@pytest.mark.parametrize("name", MAKERS)
def test_damaged(name):
    """Whatever bytes come, a decoder ends with an error of ours or a contour."""
    given = MAKERS[name](2)
    values = values_of(given[0], 2)
    data = encode(Mesh(*given, values, stored="whole"), int(np.median(values)) + 0.5, precision=0.1)
    rng = np.random.default_rng(1)
    ended = set()
    for _ in range(20 if INTERPRETED else 400 if HEAVY else 60):
        wrong = bytearray(data)
        for _ in range(rng.integers(1, 4)):
            wrong[rng.integers(8, len(wrong) - 4)] = rng.integers(256)
        decoder = Decoder()
        try:
            decoder.feed(bytes(wrong))
            list(decoder)
        except IsoError as error:
            ended.add(error.code)
        if decoder.contents is not None and decoder.contents.kind in ("grid", "mesh"):
            decoder.contour(0)
        else:  # nothing is known yet, and nothing drawn
            with suppress(IsoError):
                assert not len(decoder.contour(0).points)
    assert "checksum" in ended or INTERPRETED


def test_random_runs():
    """Runs of random bytes decode to a complex or are refused."""
    rng = np.random.default_rng(3)
    ended = {"complex": 0}
    for _ in range(10 if INTERPRETED else 300):
        d = int(rng.integers(2, 4))
        corners = int(rng.integers(3, d + 2))
        data = rng.bytes(int(rng.integers(1, 60)))
        vertices, cells = rng.integers(corners, 30), rng.integers(1, 40)
        try:
            found = decoded_mesh(data, 0, (int(vertices), int(cells)), corners, [50] * d, 1.0, Account(), nothing)
        except IsoError as error:
            ended[error.code] = ended.get(error.code, 0) + 1
            continue
        ended["complex"] += 1
        assert (np.sort(found.mesh.cell, axis=1)[:, 1:] != np.sort(found.mesh.cell, axis=1)[:, :-1]).all()
        assert len(same_cells(found.mesh.cell)) == len(found.mesh.cell)
    assert len(ended) > 2 or INTERPRETED
