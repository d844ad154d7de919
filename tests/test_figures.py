"""The figures' own arithmetic: what is traced of a walk, which layers are shown."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from isocodec.field.samples import check_field
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from isocodec.stream.inspect import inspect

pytest.importorskip("matplotlib")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))

import isocodec
from commands import HILLS
from figures.corpus import by_bytes, ends, stages
from figures.planes import draw_mesh
from figures.surfaces import COARSE, FINE, PARTS, PLAN, steps_of
from figures.walk import path_of, small_field, symbols_of


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
    right = sum(s["bit"] for s in symbols if s["context"].startswith("CURVE") and s["vertices"])
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
    z, y, x = np.mgrid[:30, :34, :38] - np.array([14.2, 16.7, 18.1])[:, None, None, None]
    ring = np.hypot(np.hypot(y, x) - 9 - np.sin(3 * np.arctan2(y, x)), z) - 3.1
    slab = np.maximum(np.maximum(abs(z) - 8.3, abs(y) - 7.2), abs(x + y / 3) - 9.4)
    for field in (ring, slab):
        data = isocodec.encode(field, 0.0, layers=PLAN.format(coarse=COARSE, parts=PARTS))
        whole = original(check_field(field, 0.0))
        found = [stage.decoder.contour() for stage in stages(data, steps_of(data))]
        for contour, threshold in ((found[1], COARSE), (found[3], FINE)):
            assert max(hausdorff(whole.points, whole.cells, contour.points, contour.cells)) <= threshold + 0.01
