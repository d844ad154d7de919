"""Values on triangles in space: every operation, every format, and the winding of the triangles."""

from __future__ import annotations

import numpy as np

import isocodec
from isocodec import Mesh
from tables import looped


def sphere(around: int = 24, rings: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Points of a sphere of radius 1, its poles last, and triangles that run counter-clockwise from outside."""
    up, turn = np.meshgrid(np.pi * np.arange(1, rings + 1) / (rings + 1), 2 * np.pi * np.arange(around) / around,
                           indexing="ij")
    points = np.stack([np.sin(up) * np.cos(turn), np.sin(up) * np.sin(turn), np.cos(up)], axis=-1).reshape(-1, 3)
    number = np.arange(rings * around).reshape(rings, around)
    beside = np.roll(number, -1, axis=1)
    a, b, c, d = (each.ravel() for each in (number[:-1], number[1:], beside[1:], beside[:-1]))
    top, bottom = np.full(around, len(points)), np.full(around, len(points) + 1)
    cells = [(a, b, c), (a, c, d), (top, number[0], beside[0]), (bottom, beside[-1], number[-1])]
    return np.vstack([points, [[0, 0, 1], [0, 0, -1]]]), np.concatenate([np.stack(each, axis=1) for each in cells])


POINTS, CELLS = sphere()
POINTS = 10 * POINTS * [1, 1.2, 0.8] + [3, -2, 5]
HEIGHT = POINTS @ [0.3, 0.2, 1.0]
LEVELS = (4.5, 7.5)
STORED = ("known", "coded", "whole")


def enclosed(points: np.ndarray, cells: np.ndarray) -> float:
    a, b, c = (points[cells[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@looped("stored", STORED)
@looped("turned", [False, True])
def test_triangles_keep_their_winding(stored: str, turned: bool) -> None:
    """Those of a mesh that both sides have as they are; of a closed surface outwards, of an open one to the front."""
    cells = CELLS[:, ::-1] if turned else CELLS
    data = isocodec.encode(Mesh(POINTS, cells, HEIGHT, stored=stored), LEVELS[0])
    file = isocodec.open(data, mesh=(POINTS, cells) if stored == "known" else None)
    mesh = file.mesh(whole=True)
    if stored == "known":
        assert np.array_equal(mesh.cells, cells)
    elif stored == "whole":
        assert np.isclose(enclosed(mesh.points, mesh.cells), abs(enclosed(POINTS, CELLS)), rtol=0.02)
    for part in (file.mesh(), mesh):
        edges = np.concatenate([part.cells[:, [0, 1]], part.cells[:, [1, 2]], part.cells[:, [2, 0]]])
        assert len(np.unique(edges, axis=0)) == len(edges)
    upper = CELLS[(POINTS[CELLS][:, :, 2] > 5).all(axis=1)]
    data = isocodec.encode(Mesh(POINTS, upper[:, ::-1], HEIGHT, stored="whole"), 9.5)
    open_mesh = isocodec.open(data).mesh(whole=True)
    a, b, c = (open_mesh.points[open_mesh.cells[:, i]] for i in range(3))
    assert np.cross(b - a, c - a).sum(axis=0)[2] > 0
