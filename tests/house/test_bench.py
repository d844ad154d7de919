"""The bench in tools/: distances, files of peers, and whole runs on small fields."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from home import ROOT

pytest.importorskip("scipy")
pytest.importorskip("skimage")
pytest.importorskip("contourpy")

sys.path.insert(0, str(ROOT / "tools"))


from bench.classes import BY_KEY, CLASSES
from bench.command import main
from bench.compare import compare
from bench.errors import Shape, apart, middles
from bench.items import load, read_items
from bench.nearest import Boxes
from bench.rows import Book, read_rows
from tables import looped

pytestmark = pytest.mark.heavy

Y, X = np.mgrid[:40, :44]
HILL = (100 + 90 * np.sin(Y / 6) * np.cos(X / 7)).astype(np.uint8)
BALL = (40 * np.hypot.reduce(np.mgrid[-5:6, -5:7, -6:7])).astype(np.int16)


# ---- Distances ----


@pytest.mark.parametrize("n", [2, 3])
def test_distances_are_exact(n):
    generator = np.random.default_rng(1)
    corners = generator.uniform(-4, 4, (30, n, n)) + generator.uniform(-9, 9, (30, 1, n))
    points = generator.uniform(-20, 20, (40, n))
    found = Boxes(corners).distances(points)
    dense = np.einsum("pk,mkd->mpd", middles(60, n), corners).reshape(-1, n)
    brute = np.array([np.linalg.norm(dense - point, axis=1).min() for point in points])
    # edges are at most 14 cells long, so that samples lie at most 14 / 60 cells apart
    assert (found <= brute + 1e-9).all()
    assert np.allclose(found, brute, atol=0.15)


def test_known_distances():
    line = np.array([[0.0, 0.0], [0.0, 10.0]])
    a, b = Shape.of_lines([line]), Shape.of_lines([line + [0.5, 0.0]])
    assert apart(a, b) == pytest.approx((0.5, 0.5))
    longer = Shape.of_lines([np.array([[0.0, 0.0], [0.0, 13.0]])])
    # from the longer one 3 of 13 cells are off, by 1.5 on average
    assert apart(a, longer) == pytest.approx((4.5 / 13, 3.0), rel=0.01)
    assert apart(longer, a) == apart(a, longer)
    assert apart(a, Shape.of_lines([])) == (float("inf"), float("inf"))
    assert apart(Shape.of_lines([]), Shape.of_lines([])) == (0.0, 0.0)


# ---- A run ----


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "sub").mkdir()
    np.save(tmp_path / "sub" / "hill.npy", HILL)
    (tmp_path / "sub" / "hill.json").write_text(json.dumps({"isovalues": [107, 107.5, 400]}))
    np.savez(tmp_path / "ball.npz", values=BALL)
    (tmp_path / "ball.json").write_text(json.dumps({"isovalues": [150]}))
    np.save(tmp_path / "gaps.npy", np.full((9, 9), np.nan))
    return tmp_path


def test_items(folder):
    items, left_out = read_items(folder)
    assert [item.key for item in items] == ["ball@150.5", "sub/hill@107.5"]
    assert left_out == ["gaps: holds NaN or infinity", "sub/hill@400.5: no curve"]
    items, left_out = read_items(folder, [("hill", 90.25), ("b?ll", None), ("none", 3.0)])
    assert [item.key for item in items] == ["ball@150.5", "sub/hill@90.25"]
    assert left_out == ["none: no such array"]
    assert np.array_equal(load(items[0].path), BALL)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """Rows and report of a run of all classes."""
    folder, out = tmp_path_factory.mktemp("fields"), tmp_path_factory.mktemp("out")
    np.save(folder / "hill.npy", HILL)
    np.save(folder / "ball.npy", BALL)
    keys = ",".join(key for key in BY_KEY if key != "picture2")
    assert main([str(folder), "-o", str(out), "--repeat", "1", "--items", "hill@107.5,ball@150.5",
                 "--classes", keys, "--profile", "baseline"]) == 0
    return read_rows(out / "results.jsonl"), (out / "report.md").read_text()


def test_rows_say_what_came_of_each_codec(result):
    rows, report = result
    assert all("bytes" in row or "missing" in row or "gap" in row for row in rows)
    assert max(row["gap"] for row in rows if "gap" in row) < 1e-4
    by_name = {row["peer"]: row for row in rows}
    assert by_name["xz"]["exact"] and by_name["mask-xz9e"]["exact"]
    assert by_name["jbig2-generic"]["missing"] == "jbig2"
    assert "jbig2 is not installed: jbig2-generic" in report


def test_ratios_are_ours_to_the_smallest_peer_that_is_as_good(result):
    rows, report = result
    found = {r.cls.key: r.ratios[0] for r in compare(Book(None, rows))}
    masks = [row["bytes"] for row in rows if row["class"] == "mask3d" and "bytes" in row]
    ours = next(row for row in rows if row["peer"] == "ours-signs" and row["corpus"] == "ball")
    assert found["signs3"].value == ours["bytes"] / min(masks)
    assert found["signs3"].item == "ball@150.5"
    assert f"{ours['bytes'] / min(masks):.3f}" in report
    assert found["progressive"].peer["peer"] == "ours-single"


@looped("cls", [pytest.param(c, id=c.key) for c in CLASSES if c.named and not c.alone])
def test_ours_keeps_to_the_error_of_the_named_peer(result, cls):
    by_name = {row["peer"]: row for row in result[0]}
    peer = by_name[cls.named]
    if "missing" in peer:
        pytest.skip(f"{peer['missing']} is not installed")
    assert by_name[cls.ours][cls.bound] <= peer[cls.bound]


def test_a_tolerance_is_kept(result):
    by_name = {row["peer"]: row for row in result[0]}
    assert by_name["ours-largest"]["err_max"] <= 0.25


# ---- What is missing or goes wrong ----


def test_what_cannot_be_done_is_said(folder, tmp_path, capsys):
    run = [str(folder), "-o", str(tmp_path / "out")]
    assert main([str(tmp_path / "nowhere"), "-o", str(tmp_path)]) == 2
    assert main([*run, "--items", "gaps"]) == 2
    assert "holds NaN" in capsys.readouterr().err
    (tmp_path / "bad.jsonl").write_text('{"peer": 1}\n')
    assert main([*run, "--peers", str(tmp_path / "bad.jsonl")]) == 2
    assert "line 1" in capsys.readouterr().err
    assert main([*run, "--classes", "all"]) == 2
    assert "no class all" in capsys.readouterr().err
    assert main([*run, "--items", "hill", "--profile", "none"]) == 2
    assert "unknown profile" in capsys.readouterr().err
