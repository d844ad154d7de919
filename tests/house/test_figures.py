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
from figures import __main__ as figures
from figures.apart import curves_apart, surfaces_apart
from figures.corpus import stages
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
