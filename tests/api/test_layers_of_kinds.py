"""The table of kinds of files and of what reads their layers: every cell shows the same beginning of a file."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import explicit_meshes
import isocodec
from commands import ok
from isocodec import Contour, Field, Frames, IsoFile, Mesh
from isocodec.api.export import counted
from isocodec.api.plots import plot_steps
from isocodec.drawing.tessellation import Tessellation
from isocodec.errors import OptionError, TruncatedError
from isocodec.verbs import Plot
from tables import looped

Y, X = np.mgrid[:40, :48]
HILL = ((Y - 17) ** 2 + (X - 20) ** 2 + X * Y % 7).astype(np.int32)
BALL = np.rint(4 * ((np.mgrid[:12, :12, :12] - 5.3) ** 2).sum(0)).astype(np.int32)
POINTS, CELLS = explicit_meshes.plane(1, 200, kept=1.0)
CORNERS, TETRAHEDRA = explicit_meshes.space(2, 90, kept=1.0)
HEIGHTS, RADII = (150.5, 300.5), (200.5, 300.5)


def distances(points: np.ndarray) -> np.ndarray:
    return np.rint(10 * np.hypot(*(points[:, :2] - 50).T)).astype(np.int32)


def of_mesh(points: np.ndarray, cells: np.ndarray | None, *, precision: Any = None, **stored: Any) -> bytes:
    return isocodec.encode(Mesh(points, cells, distances(points), **stored), RADII, precision=precision)


def in_tiles(path: Path) -> bytes:
    isocodec.save(path / "tiles.iso", HILL, HEIGHTS, tile=32, precision="exact")
    return (path / "tiles.iso").read_bytes()


KINDS: dict[str, Callable[[Path], bytes]] = {
    "plane": lambda _: isocodec.encode(HILL, HEIGHTS, precision="exact", order="independent"),
    "volume": lambda _: isocodec.encode(BALL, 60.5, precision="exact"),
    "steps": lambda _: isocodec.encode(Field(HILL), HEIGHTS, precision="2,1", order="independent"),
    "series": lambda _: isocodec.encode(Frames([HILL, HILL + 7]), HEIGHTS, precision="exact"),
    "whole": lambda _: of_mesh(POINTS, CELLS, stored="whole"),
    "points": lambda _: of_mesh(POINTS, None, stored="whole"),
    "needed": lambda _: of_mesh(POINTS, None),
    "coded": lambda _: of_mesh(POINTS, CELLS, stored="coded"),
    "known": lambda _: of_mesh(POINTS, CELLS, progressive=False),
    "levels": lambda _: of_mesh(POINTS, CELLS, progressive=True),
    "levels in space": lambda _: of_mesh(CORNERS, TETRAHEDRA, progressive=True),
    "levels, stored": lambda _: of_mesh(POINTS, CELLS, progressive=True, stored="whole"),
    "cuts": lambda _: of_mesh(POINTS, CELLS, precision="20,10,5"),
    "surface": lambda _: isocodec.encode(isocodec.thin(HILL.astype(float), error=5.0, layers=3)),
    "tiles": in_tiles,
}
SAMPLED = ("plane", "volume", "steps", "series", "tiles")
"""Kinds whose contours lie on grids."""
NOT_CUT = {"tiles": "max_bytes does not apply"}
"""Kinds whose meshes cannot be taken from the first bytes, with the message."""


@cache
def data_of(kind: str, path: Path) -> bytes:
    return KINDS[kind](path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("layers")


def opened(kind: str, data: bytes) -> IsoFile:
    mesh = {"levels in space": (CORNERS, TETRAHEDRA), "levels": (POINTS, CELLS), "known": (POINTS, CELLS),
            "cuts": (POINTS, CELLS)}
    return isocodec.open(data, mesh=mesh.get(kind))


def isovalue_of(file: IsoFile) -> float:
    return file.isovalues[0] if file.isovalues else HEIGHTS[0]


def first(file: IsoFile) -> list[Any]:
    """Layers of the first isovalue of the first frame."""
    return [layer for layer in counted(file).layers if (layer.frame, layer.isovalue) == (0, 0)]


def end_of(file: IsoFile, layer: Any) -> int:
    """Bytes after which a layer is there: on a mesh, those of its chunk."""
    end = layer.offset + layer.bytes
    if file.kind != "mesh":
        return end
    return next(one.offset + one.bytes for one in file.info.chunks if one.offset + one.bytes >= end)


def check_same(one: Contour, other: Contour) -> None:
    assert np.array_equal(one.points, other.points) and np.array_equal(one.cells, other.cells)


def check_on(contour: Contour, mesh: Tessellation, kind: str) -> None:
    """Check that a contour has one point on each crossed edge of a mesh, and no others; of unit cells of a grid, which
    are drawn without their diagonals, at least on the other edges.
    """
    ends = np.unique(np.sort(mesh.cells[:, [*combinations(range(mesh.cells.shape[1]), 2)]].reshape(-1, 2)), axis=0)
    ends = ends[mesh.above[ends[:, 0]] != mesh.above[ends[:, 1]]]
    low, high = (mesh.points[ends[:, i]].astype(np.float64) for i in (0, 1))
    along = high - low
    far = contour.points[:, None] - low
    share = np.clip((far * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    away = np.sqrt(((far - share[..., None] * along) ** 2).sum(axis=2))
    found = np.unique(away.argmin(axis=1)) if away.size else np.zeros(0, np.int64)
    assert len(found) == len(contour.points) and (not away.size or away.min(axis=1).max() < 1e-6)
    needed = (along != 0).sum(axis=1) == 1 if kind in SAMPLED else np.ones(len(ends), np.bool_)
    assert np.isin(np.flatnonzero(needed), found).all()
    mixed = mesh.above[mesh.cells]
    assert (mixed.any(axis=1) & ~mixed.all(axis=1)).all()


def check_info(file: IsoFile, kind: str, path: Path) -> None:
    layers = first(file)
    assert len(layers) > 1 and all(layer.bytes is not None for layer in layers)
    assert [layer.kind for layer in file.info.layers] == [layer.kind for layer in counted(file).layers]
    assert sum(layer.bytes for layer in counted(file).layers) == file.size - file.info.overhead_bytes
    shown = ok("info", path / "a.iso").splitlines()
    assert len([line for line in shown if line[:6].strip().isdigit()]) == len(file.info.layers) or file.frames > 1


def check_contour(file: IsoFile, kind: str, path: Path) -> None:
    layers = first(file)
    drawn = [file.contour(isovalue_of(file), layers=k) for k in range(1, len(layers) + 1)]
    check_same(drawn[-1], file.contour(isovalue_of(file)))
    assert len({one.points.tobytes() for one in drawn}) > 1
    assert kind == "tiles" or not drawn[0].complete


def check_mesh(file: IsoFile, kind: str, path: Path) -> None:
    for k in range(1, len(first(file)) + 1):
        check_on(file.contour(isovalue_of(file), layers=k), file.mesh(isovalue_of(file), layers=k), kind)
        whole = file.mesh(isovalue_of(file), layers=k, whole=True)
        assert len(whole.cells) >= len(file.mesh(isovalue_of(file), layers=k).cells)


def check_edit(file: IsoFile, kind: str, path: Path) -> None:
    for k in range(1, len(first(file)) + 1):
        made = opened(kind, file.edited(layers=k))
        check_same(made.contour(isovalue_of(file)), file.contour(isovalue_of(file), layers=k))
        assert kind == "tiles" or len(counted(made).layers) == k
    text = ok("edit", path / "a.iso", "-o", path / "b.iso", "--layers", 1)
    assert kind == "tiles" or " bytes, 1 of " in text


def check_decode(file: IsoFile, kind: str, path: Path) -> None:
    mesh = []
    if file.mesh_given is not None:
        np.savez(path / "mesh.npz", points=file.mesh_given[0], cells=file.mesh_given[1])
        mesh = ["--mesh", path / "mesh.npz"]
    ok("decode", path / "a.iso", "-o", path / "a.npz", "--isovalue", isovalue_of(file), "--layers", 2, *mesh)
    assert np.array_equal(np.load(path / "a.npz")["points"], file.contour(isovalue_of(file), layers=2).points)
    if kind == "surface":
        ok("decode", path / "a.iso", "-o", path / "s.npz", "--layers", 2)
        assert np.array_equal(np.load(path / "s.npz")["points"], file.surface(layers=2).points)


def check_plot(file: IsoFile, kind: str, path: Path) -> None:
    isovalue = isovalue_of(file)
    shown = plot_steps(file, ".png", Plot(isovalues=() if isovalue is None else (isovalue,), steps=99)).facts["layers"]
    counts = [len(file.contour(isovalue, layers=k).cells) for k in range(1, len(first(file)) + 1)]
    assert shown == sorted(shown)
    if not any(layer.within for layer in first(file)):  # of others the promises are shown
        assert len(shown) == sum(count > 0 for count in counts)


def check_ends(file: IsoFile, kind: str, path: Path) -> None:
    for k, layer in enumerate(first(file), 1):
        if layer.offset is None:
            return  # tiles: everywhere in the file
        there = {"max_bytes": end_of(file, layer), "partial": True}
        if kind not in SAMPLED:  # where the same bytes may hold symbols of the next layer
            check_same(file.contour(isovalue_of(file), **there), file.contour(isovalue_of(file), layers=k))
        check_on(file.contour(isovalue_of(file), **there), file.mesh(isovalue_of(file), **there), kind)
        # what comes behind a layer does not matter
        cut = opened(kind, file.data[: end_of(file, layer)])
        check_same(cut.contour(isovalue_of(file), layers=k), file.contour(isovalue_of(file), layers=k))


def check_middles(file: IsoFile, kind: str, path: Path) -> None:
    if kind in NOT_CUT:
        with pytest.raises(OptionError, match=NOT_CUT[kind]):
            file.mesh(isovalue_of(file), max_bytes=file.size - 1)
        return
    for layer in first(file):
        there: dict[str, Any] = {"max_bytes": layer.offset + layer.bytes // 2, "partial": True}
        try:
            contour = file.contour(isovalue_of(file), **there)
        except TruncatedError:
            with pytest.raises(TruncatedError):
                file.mesh(isovalue_of(file), **there)
            continue
        if len(contour.cells):
            check_on(contour, file.mesh(isovalue_of(file), **there), kind)
    cut = opened(kind, file.data[: first(file)[-1].offset + 1])
    drawn = plot_steps(cut, ".png", Plot(isovalues=() if isovalue_of(file) is None else (isovalue_of(file),), steps=99))
    assert len(drawn.facts["layers"]) >= 1 and drawn.remarks


@looped(
    ("precision", "within"),
    [("20,10,5", [20.0, 10.0, 5.0]), (3.0, [3.0]), ("20,5,exact", [20.0, 5.0, 0.0]), ("exact", [0.0]), ("signs", []),
     (None, [])],
)
def test_layers_on_meshes_state_their_distance(precision: Any, within: list[float]) -> None:
    """Those that complete a step, at the beginning of a file, too, and no others."""
    data = of_mesh(POINTS, CELLS, precision=precision)
    file = isocodec.open(data, mesh=(POINTS, CELLS))
    layers = file.info.layers
    for number, isovalue in enumerate(RADII):
        own = [layer.within for layer in layers if layer.isovalue == number and layer.kind != "levels"]
        assert np.allclose([one for one in own if one is not None], within, atol=1e-6), isovalue
        assert not within or own[-1] is not None
    for isovalue, found in zip(RADII, file.verify(Mesh(POINTS, CELLS, distances(POINTS))), strict=True):
        assert not within or max(found.there, found.back) <= within[-1] + 0.01, isovalue  # as finely as it is measured
    for end in (layers[-1].offset, layers[len(layers) // 2].offset):
        begun = isocodec.open(data[:end]).info.layers
        assert [layer.within for layer in begun] == [layer.within for layer in layers][: len(begun)]
    shorter = isocodec.open(file.edited(layers=1)).info.layers
    assert [layer.within for layer in shorter] == [layer.within for layer in layers][:1]


def test_distances_in_other_units_are_stated_in_that_of_the_points() -> None:
    for unit, within in (("m", 5000.0), ("km", 5.0)):
        mesh, notes = Mesh(POINTS, CELLS, distances(POINTS)), {"coordinate_unit": unit}
        file = isocodec.open(isocodec.encode(mesh, RADII[0], precision="5000m", metadata=notes))
        assert file.info.layers[-1].within == pytest.approx(within)
        assert file.promise == "within 5000m"


CHECKS = {name.removeprefix("check_"): check for name, check in globals().items() if name.startswith("check_")
          and name not in ("check_same", "check_on")}


def test_kinds_are_all_there(folder: Path) -> None:
    kinds = {opened(kind, data_of(kind, folder)).kind for kind in KINDS}
    assert kinds == {"grid", "series", "mesh", "surface", "tiles"}


@looped("kind", KINDS)
@pytest.mark.parametrize("operation", CHECKS)
def test_layers(operation: str, kind: str, folder: Path, tmp_path: Path) -> None:
    data = data_of(kind, folder)
    (tmp_path / "a.iso").write_bytes(data)
    CHECKS[operation](opened(kind, data), kind, tmp_path)
