"""Signs of a mesh level by level (spec clause 10.8)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import isocodec
from explicit_meshes import Mesh, components, plane, space, torus
from isocodec.mesh.complex import complex_of
from isocodec.mesh.hierarchy import hierarchy_of


def curve(
    mesh: Mesh, values: np.ndarray, isovalue: float, precision: object, progressive: bool | None = None
) -> isocodec.Contour:
    given = isocodec.Mesh(*mesh, values, progressive=progressive)
    return isocodec.decode(isocodec.encode(given, isovalue, precision=precision), mesh=mesh)  # type: ignore[arg-type]


def middles(mesh: Mesh, cells: np.ndarray, above: np.ndarray) -> set[tuple[float, ...]]:
    """Middles of the sides of cells that are crossed, by brute force."""
    sides = {tuple(sorted(side)) for cell in cells.tolist() for side in combinations(cell, 2)}
    return {tuple((mesh[0][a] + mesh[0][b]) / 2) for a, b in sides if above[a] != above[b]}


def crossed(cells: np.ndarray, above: np.ndarray) -> int:
    """Number of cells with vertices on both sides."""
    return int((above[cells].any(axis=1) & ~above[cells].all(axis=1)).sum())


MESHES = {
    "plane": lambda seed: plane(seed, 120, [1.0, 0.95, 0.7][seed % 3]), "space": lambda seed: space(seed, 90, 0.95),
    "surface": lambda seed: torus(12 + seed % 9, 8),
}


@pytest.mark.cover(1)
@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("seed", range(30))
def test_the_same_curve_as_along_a_walk(seed: int, kind: str) -> None:
    mesh = MESHES[kind](seed)
    rng = np.random.default_rng(seed)
    scale = 20 * np.ptp(mesh[0]) / 100
    values = rng.integers(-9, 10, len(mesh[0])) if seed % 2 else np.sin(mesh[0] / scale).sum(axis=1)
    precision = ["exact", 0.3, "signs"][seed % 3] if seed % 2 else 0.3
    got, want = (curve(mesh, values, 0.5, precision, each) for each in (True, False))
    # offsets are halves of parts, the same on each edge whatever the order
    assert {tuple(p) for p in got.points.round(9)} == {tuple(p) for p in want.points.round(9)}
    assert len(got.cells) == len(want.cells)
    assert components(len(got.points), got.cells) == components(len(want.points), want.cells)


@pytest.mark.cover(2)
@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("seed", range(8))
def test_every_layer_shows_the_curve_of_its_mesh(kind: str, seed: int) -> None:
    """Cut anywhere, a file gives the contour of the cells that are left, by brute force of their nodes."""
    larger = {"plane": plane, "space": space, "surface": big_torus}[kind]
    mesh = MESHES[kind](seed + 3) if seed < 6 else larger(seed, 3000, 1.0)
    scale = np.ptp(mesh[0]) / (4 + seed)
    above = np.sin(mesh[0] / scale).sum(axis=1) > 0.1
    domain, _ = complex_of(*mesh)
    hierarchy = hierarchy_of(domain)
    decoder = isocodec.Decoder(mesh=mesh)
    data = isocodec.encode(isocodec.Mesh(*mesh, above.astype(int), progressive=True), 0.5, precision="signs")
    seen = set()
    for end in range(0, len(data), 3):
        decoder.feed(data[end : end + 3])
        contour = decoder.take().contour()
        if decoder.contents is None or decoder.contents.kind != "mesh":
            continue
        found = decoder.on_mesh.strand()
        if found is None or found.rounds is None:
            continue
        cells = hierarchy.cells(found.rounds)
        assert {tuple(p) for p in contour.points} == middles(mesh, cells, above)
        assert components(len(contour.points), contour.cells) <= max(len(contour.points), 1)
        if domain.n == 2:
            assert len(contour.cells) == crossed(cells, above)
        seen.add(found.rounds)
    assert len(seen) >= (2 if seed < 6 else 3) and min(seen) == 0


def big_torus(seed: int, count: int, kept: float) -> Mesh:
    points, cells = torus(40 + seed, count // 40)
    return points, cells[: int(kept * len(cells))]


def test_meshes_in_the_file_have_levels_where_asked() -> None:
    for mesh, stored in ((plane(2, 300, 1.0), "whole"), (space(2, 80, 1.0), "coded"), (torus(20, 12), "whole")):
        values = np.sin(mesh[0] / (np.ptp(mesh[0]) / 7)).sum(axis=1)
        found = [
            isocodec.decode(isocodec.encode(
                isocodec.Mesh(*mesh, values, stored=stored, progressive=each), 0.1, precision="signs",
            )) for each in (True, False)
        ]
        points = [{tuple(p) for p in one.points} for one in found]
        assert points[0] == points[1] and len(found[0].cells) == len(found[1].cells)
