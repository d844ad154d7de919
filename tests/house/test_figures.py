"""The figures' own arithmetic: what is traced of a walk, which layers are shown."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from home import ROOT
from isocodec.field.samples import check_field
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from isocodec.stream.inspect import inspect

pytest.importorskip("matplotlib")
sys.path.insert(0, str(ROOT / "tools"))

import isocodec
from commands import HILLS
from figures import __main__ as figures
from figures.apart import curves_apart, surfaces_apart
from figures.corpus import by_bytes, ends, stages
from figures.cubic import cubic_field, cubic_points, off, uniform_stages
from figures.hyperbola import BASE, PLAN, REFINEMENT, hyperbola_field, listed
from figures.planes import draw_mesh
from figures.surfaces import COARSE, FINE
from figures.surfaces import PLAN as FIGURE_8
from figures.walk import path_of, small_field, symbols_of

pytestmark = pytest.mark.heavy


def test_the_trace_of_a_walk_is_what_the_decoder_knows() -> None:
    field = small_field()
    data = isocodec.encode(field, 0, layers=[("base", None)], profile="baseline")
    symbols = symbols_of(data)
    (layer,) = inspect(data, symbols=True).layers
    names = ["origin", "component", "location", "base_sign"]
    assert layer.symbols == {name: sum(s["element"] == name.replace("_", " ") for s in symbols) for name in names}
    told = {(row, column): above for symbol in symbols for row, column, above in symbol["vertices"]}
    assert len(told) == sum(len(symbol["vertices"]) for symbol in symbols)
    assert all(above == (field[place] > 0) for place, above in told.items())
    # one gate after the other lies in the tube, on edges whose ends differ
    path = path_of(symbols)
    assert len(path) > 50 and np.abs(np.diff(path, axis=0)).max() <= 1
    right = sum(s["right"] for s in symbols if s["context"].startswith("CURVE") and s["vertices"])
    assert right == isocodec.open(data).statistics().layers[0].right


def test_layers_that_share_a_file_by_bytes() -> None:
    data = isocodec.encode(HILLS, 60.5)
    offsets, chosen = ends(data), by_bytes(data, 4)
    assert chosen == sorted(set(chosen)) and chosen[-1] == len(offsets) and len(chosen) <= 4
    for wanted in (len(data) / 4, len(data) / 2):
        best = min(offsets, key=lambda offset: abs(np.log(offset / wanted)))
        assert best in [offsets[number - 1] for number in chosen]
    for number, stage in zip(chosen, stages(data, chosen), strict=True):
        assert stage.bytes == offsets[number - 1]
        alone = isocodec.decode(data, layers=number)
        assert np.array_equal(stage.decoder.contour().points, alone.points)


def test_all_sides_of_a_mesh_are_drawn_once() -> None:
    from matplotlib.figure import Figure

    decoder = stages(isocodec.encode(HILLS, 60.5, precision=2), [1])[0].decoder
    mesh = decoder.grid.mesh()
    axes = Figure().add_subplot()
    draw_mesh(axes, mesh)
    lines = [np.asarray(line) for drawn in axes.collections for line in drawn.get_segments()]
    found = {frozenset(map(tuple, line[:, ::-1])) for line in lines}
    corners = ([0, 1], [1, 2], [2, 0])
    sides = {frozenset(map(tuple, mesh.points[cell[two]])) for cell in mesh.cells for two in corners}
    assert found == sides


def test_the_surface_paper_figure_8_keeps_its_thresholds() -> None:
    """A knotted tube and a slab with edges: what is drawn of them with geometry lies within both thresholds."""
    pytest.importorskip("vtk")
    pytest.importorskip("trimesh")
    z, y, x = np.mgrid[:30, :34, :38] - np.array([14.2, 16.7, 18.1])[:, None, None, None]
    ring = np.hypot(np.hypot(y, x) - 9 - np.sin(3 * np.arctan2(y, x)), z) - 3.1
    slab = np.maximum(np.maximum(abs(z) - 8.3, abs(y) - 7.2), abs(x + y / 3) - 9.4)
    for field in (ring, slab):
        whole = original(check_field(field, 0.0))
        steps = stages(isocodec.encode(field, 0.0, layers=FIGURE_8), [2, 4])
        for step, threshold in zip(steps, (COARSE, FINE), strict=True):
            contour = step.decoder.contour()
            assert max(hausdorff(whole.points, whole.cells, contour.points, contour.cells)) <= threshold + 0.01
            there, back = surfaces_apart((whole.points, whole.cells), (contour.points, contour.cells))
            assert max(there, back) <= threshold


def test_distances_of_other_libraries() -> None:
    """Squares within one another, and tetrahedra that are moved."""
    pytest.importorskip("vtk")
    pytest.importorskip("trimesh")
    square = np.array([[0, 0], [0, 8], [8, 8], [8, 0], [0, 0]], float)
    assert curves_apart([square], [square + 1]) == pytest.approx(np.sqrt(2), abs=0.01)
    assert curves_apart([square], [square, square + 20]) == pytest.approx(np.sqrt(2) * 20, abs=0.01)
    assert curves_apart([square], []) == np.inf
    corners = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], float)
    sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    # from the side that is missing: its middle is farthest from the others
    there, back = surfaces_apart((corners, sides), (corners, sides[:3]))
    assert back == 0 and 1.5 < there <= 3


def test_the_symbols_of_the_hyperbola_are_what_its_meshes_are_made_of() -> None:
    data = isocodec.encode(hyperbola_field(), 0, layers=PLAN, profile="baseline")
    symbols = symbols_of(data)
    for number, layer in enumerate(inspect(data, symbols=True).layers, start=1):
        for name, count in layer.symbols.items():
            assert count == sum(s["layer"] == number and s["element"] == name.replace("_", " ") for s in symbols)
    base, refined = (stage.decoder.grid.mesh() for stage in stages(data, [BASE, REFINEMENT]))
    triangles = {frozenset(map(tuple, base.points[cell].tolist())): level
                 for cell, level in zip(base.cells, base.levels, strict=True)}
    vertices = set(map(tuple, refined.points.tolist()))
    found = []
    for symbol in symbols:
        word, places = symbol["word"], list(map(tuple, symbol["places"]))
        if word in ("R", "K"):
            assert (places[0] in vertices) == (word == "R")
        elif word:
            # the walk came from a triangle next to this one, of that level relative to it
            level = triangles[frozenset(places)]
            from_there = {triangles[t] - level for t in triangles if len(t & set(places)) == 2}
            assert {"=": 0, "<": 1, ">": -1}[word] in from_there
        found.append(word)
    assert set(found) == {"", "=", "<", ">", "R", "K"}
    assert listed(symbols, BASE).endswith(" End") and listed(symbols, REFINEMENT).endswith(" Stop")


def test_the_cubic_comes_nearer_with_every_step() -> None:
    points = cubic_points()
    y, x = (points / 64 - 1).T * 2.6
    assert np.abs(y**2 - x**3 + 3 * x - 1).max() < 1e-9
    assert np.abs(points - np.rint(points)).max() > 0.4 and {*np.sign(y)} >= {-1.0, 1.0}
    far = [off(stage.decoder.contour(), points) for stage in uniform_stages()]
    assert far == sorted(far, reverse=True) and far[0] > 1 and far[-1] < 0.05
    plan = "adaptive-base topology distortion=1\noffsets 5 unit=1"
    # of the samples' curve, which is that near to the cubic
    assert off(isocodec.decode(isocodec.encode(cubic_field(), 0.5, layers=plan)), points) <= 1 + far[-1]


def test_a_figure_that_fails_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["figures", str(tmp_path), "-o", str(tmp_path / "out"), "terrain", "hyperbola"])
    with pytest.raises(SystemExit, match=r"^not drawn: terrain$"):
        figures.main()
    output = capsys.readouterr()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["hyperbola.png"]
    assert "hyperbola: symbols of the base: " in output.out and "terrain/jacksboro_fault_dem.npy nor" in output.err
    monkeypatch.setattr(sys, "argv", ["figures", str(tmp_path), "-o", str(tmp_path / "out"), "none"])
    with pytest.raises(SystemExit):
        figures.main()
    assert f"there are {', '.join(figures.FIGURES)}" in " ".join(capsys.readouterr().err.split())


def test_the_help_lists_all_figures(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["figures", "--help"])
    with pytest.raises(SystemExit, match="0"):
        figures.main()
    lines = capsys.readouterr().out.splitlines()
    for name, draw in figures.FIGURES.items():
        (line,) = (line for line in lines if line.split()[:1] == [name])
        assert line.endswith(str(draw.__doc__).splitlines()[0])
