"""Values on triangles in space, which keep their winding."""

from __future__ import annotations

import numpy as np

import isocodec
from explicit_meshes import torus
from isocodec import Mesh
from tables import looped

POINTS, CELLS = torus(24, 16)
POINTS = 4 * POINTS * [1, 1.2, 0.8] + [3, -2, 5]
HEIGHT = POINTS @ [0.3, 0.2, 1.0]
STORED = ("known", "coded", "whole")


def enclosed(points: np.ndarray, cells: np.ndarray) -> float:
    a, b, c = (points[cells[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@looped("stored", STORED)
@looped("turned", [False, True])
def test_triangles_keep_their_winding(stored: str, turned: bool) -> None:
    """Those of a mesh that both sides have as they are; of a closed surface outwards, of an open one to the front."""
    cells = CELLS[:, ::-1] if turned else CELLS
    data = isocodec.encode(Mesh(POINTS, cells, HEIGHT, stored=stored), 4.5)
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
