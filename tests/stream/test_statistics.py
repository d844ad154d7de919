"""What ``info --statistics`` counts, against counts of the samples themselves."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import isocodec
from brute import crossing_edges
from commands import BALL, HILLS, ok
from isocodec.stream.inspect import inspect


def crossed_cells(above: np.ndarray) -> int:
    """Cells of the grid whose corners are not all of one sign."""
    n = above.ndim
    ends = [[slice(i >> a & 1, above.shape[a] - 1 + (i >> a & 1)) for a in range(n)] for i in range(2**n)]
    corners = [above[tuple(end)] for end in ends]
    return int((np.any(corners, axis=0) & ~np.all(corners, axis=0)).sum())


@pytest.mark.parametrize("profile", ["main", "baseline"])
@pytest.mark.parametrize("field, isovalue", [(HILLS, 60.5), (BALL, 50.5)])
def test_counts_are_those_of_the_field(field: np.ndarray, isovalue: float, profile: str) -> None:
    data = isocodec.encode(field, isovalue, precision="exact", profile=profile)
    found = isocodec.open(data).statistics()
    (whole,) = found.contours
    above = field > isovalue
    assert whole.pixels == crossed_cells(above)
    # surfaces have points inside some cells, besides those on the grid's edges
    assert whole.vertices >= len(crossing_edges(above)[0]) >= whole.vertices - 10
    contour = isocodec.decode(data)
    assert (whole.vertices, whole.faces) == (len(contour.points), len(contour.cells))
    info = inspect(data, symbols=True)
    geometry = sum(8 * layer.bytes for layer in info.layers if layer.kind == "values")
    assert whole.geometry_bits == geometry > 0
    assert whole.bits == 8 * (info.bytes - info.overhead_bytes)
    symbols = [layer.symbols or {} for layer in info.layers]
    signs = [each.get("base_sign", 0) + each.get("refinement_sign", 0) for each in symbols]
    assert [layer.signs for layer in found.layers] == signs and whole.signs == sum(signs) > 0
    assert all(0 <= layer.right <= layer.predicted <= layer.signs for layer in found.layers)


def right(field: np.ndarray, **options) -> float:
    layers = isocodec.open(isocodec.encode(field, 0.5, precision="signs", **options)).statistics().layers
    return sum(layer.right for layer in layers) / sum(layer.predicted for layer in layers)


def test_a_straight_line_is_predicted_and_noise_is_not() -> None:
    rows, columns = np.mgrid[:65, :65]
    line = 0.5 + columns - rows / 3 - 20.2
    noise = np.random.default_rng(1).integers(0, 2, (65, 65))
    full = {"layers": 12}
    # along a straight line it is the mesh that the prediction has to guess
    assert right(line, **full) > 0.8 > 0.6 > right(noise, **full) > 0.4
    assert right(line) > 0.8


def test_each_isovalue_has_its_own(tmp_path: Path) -> None:
    source = tmp_path / "two.iso"
    source.write_bytes(isocodec.encode(HILLS, [60.5, 80.5], precision="signs"))
    found = json.loads(ok("info", source, "--statistics", "--json"))["statistics"]
    assert [one["isovalue"] for one in found["contours"]] == [60.5, 80.5]
    assert [one["pixels"] for one in found["contours"]] == [crossed_cells(HILLS > 60), crossed_cells(HILLS > 80)]
    for number, one in enumerate(found["contours"]):
        own = [layer for layer in found["layers"] if layer["isovalue"] == number]
        assert one["connectivity_bits"] == sum(layer["bits"] for layer in own) > 0 == one["geometry_bits"]
    assert "statistics" not in json.loads(ok("info", source, "--json"))


def test_a_part_and_a_coarse_mesh() -> None:
    data = isocodec.encode(HILLS, 60.5)
    part = isocodec.open(data[: len(data) // 4]).statistics()
    assert 0 < len(part.layers) < len(isocodec.open(data).info.layers)
    (coarse,) = isocodec.open(isocodec.encode(HILLS, 60.5, precision=2)).statistics().contours
    assert coarse.pixels is None and coarse.simplices > 0
    # a curve that closes has as many segments as points; those at the border one less each
    assert coarse.faces <= coarse.vertices
