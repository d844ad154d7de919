"""Promises by kind of file and precision: info states them, verify holds files to them, edits keep them true."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, ok, run
from encoded import encoded
from isocodec.field.placement import Placement
from tables import looped

WHERE = Placement([[0, 0.5, 0], [-0.5, 0, 0]], unit="m")
VALUE = 80.5
GRID = {
    None: None, 0.5: "within 0.5 cells", 0.05: "within 0.05 cells", 0.0123: "within 0.0123 cells",
    "1m": "within 1m (2 cells)", "50cm": "within 50cm (1 cell)", "4,1": "within 4 cells, 1 cell",
    "4,exact": "within 4 cells, then all values exactly", "4m,1m": "within 4m (8 cells), 1m (2 cells)",
    "1,0.4m": "within 1 cell, 0.4m (0.8 cells)", "exact": "all values exactly", "signs": "all signs",
    "step=0.5": "values to within 0.25", "4,1,step=0.5": "within 4 cells, 1 cell, then values to within 0.25",
    "4m,step=0.5": "within 4m (8 cells), then values to within 0.25",
}
MESH = {
    None: None, 0.05: "within 0.05 mm", "400um": "within 400um", "0.4mm": "within 0.4mm", "exact": "all values exactly",
    "signs": "all signs", "step=0.5": "values to within 0.25",
    "4,step=0.5": "within 4 mm, then values to within 0.25",
}
STORED = {None: None, 0.05: "within 0.05 mm", "0.4mm": "within 0.4mm"}
TILES = {precision: text and text.replace(" (2 cells)", "").replace(" (1 cell)", "") for precision, text in GRID.items()
         if "," not in str(precision)}
TABLE = [
    *(("grid", *one) for one in GRID.items()), *(("series", *one) for one in GRID.items()),
    *(("tiles", *one) for one in TILES.items()), *(("mesh known", *one) for one in MESH.items()),
    *(("mesh whole", *one) for one in STORED.items()), *(("mesh coded", *one) for one in STORED.items()),
    *(("mesh delaunay", *one) for one in STORED.items()),
    ("surface", {"error": 5.0}, "values within 5 m"), ("surface", {"error": "500cm"}, "values within 500cm"),
    ("surface", {"contours": [VALUE], "tolerance": 0.5}, "contours of 80.5 within 0.5 cells"),
    ("surface", {"contours": [VALUE, 60.5], "tolerance": "50cm"}, "contours of 80.5, 60.5 within 50cm"),
    ("surface", {"to": 60}, None),
]


def field(precision: Any, moved: int = 0) -> isocodec.Field:
    values = np.roll(HILLS, moved, 0)
    return isocodec.Field(values * 1.0 if "step" in str(precision) else values, placement=WHERE, unit="m")


@cache
def points() -> tuple[Any, Any, Any]:
    """Points, triangles and heights."""
    side = 29
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2) * 2.0
    rng = np.random.default_rng(1)
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    cells = np.concatenate([np.stack([k, k + 1, k + side], 1), np.stack([k + 1, k + side + 1, k + side], 1)])
    return (grid + rng.uniform(-0.4, 0.4, grid.shape), cells,
            4 * np.hypot(*(grid - side).T) + rng.normal(size=len(grid)))


def made(kind: str, precision: Any, path: Path) -> tuple[isocodec.IsoFile, Any, Any]:
    """A file, what it was made from, and something else."""
    one, other = field(precision), field(precision, 3)
    if kind == "surface":
        return isocodec.open(isocodec.encode(isocodec.thin(one, **precision))), one, other
    if kind == "grid":
        return isocodec.open(isocodec.encode(one, VALUE, precision=precision)), one, other
    if kind == "series":
        return isocodec.open(isocodec.encode(isocodec.Frames([one, other]), VALUE, precision=precision)), one, other
    if kind == "tiles":
        isocodec.save(path, one, VALUE, tile=32, precision=precision)
        return isocodec.open(path), one, other
    where, cells, heights = points()
    heights = np.rint(heights).astype(np.int64) if precision == "exact" else heights
    stored: Any = kind.split()[1]
    a, b = (isocodec.Mesh(where, None if stored == "delaunay" else cells, each, stored=stored, unit="mm")
            for each in (heights, heights + 12))
    known = (where, cells) if stored == "known" else None
    return isocodec.open(isocodec.encode(a, VALUE, precision=precision), mesh=known), a, b


WRITTEN = (None, "4m,1m", {"error": "500cm"}, {"to": 60})
"""What is asked of the command line, too: with a promise, with steps and without either."""


@pytest.mark.parametrize(("kind", "precision", "promise"), TABLE)
def test_what_is_asked_for_is_promised_and_verified(
    kind: str, precision: Any, promise: str | None, tmp_path: Path
) -> None:
    file, one, other = made(kind, precision, tmp_path / "a.iso")
    assert file.promise == promise
    frame = {"frame": 0} if kind == "series" else {}
    for found in file.verify(one, **frame):
        assert found.kept is (None if promise is None else True)
        assert (found.promise is None) is (promise is None)
        if found.promised:
            assert max(found.there, found.back) <= found.promised * 1.03 + 1e-9
    broken = {found.kept for found in file.verify(other, **frame)}
    # what is known of signs is wrong, whatever is promised
    unknown = kind.startswith(("tiles", "surface", "mesh whole", "mesh coded", "mesh delaunay"))
    assert broken == {None if promise is None and unknown else False}
    if kind in ("grid", "tiles", "surface") and precision in WRITTEN:
        check_commands(file, one, other, promise, tmp_path)


def check_commands(file: isocodec.IsoFile, one: Any, other: Any, promise: str | None, path: Path) -> None:
    """The same on the command line."""
    np.save(path / "one.npy", one.values)
    np.save(path / "other.npy", other.values)
    (path / "b.iso").write_bytes(file.data)
    assert " ".join((promise or "nothing about distances").split()) in " ".join(ok("info", path / "b.iso").split())
    assert json.loads(ok("info", path / "b.iso", "--json"))["promise"] == promise
    shown = ok("verify", path / "b.iso", path / "one.npy")
    assert ("kept; promised" in shown) is (promise is not None)
    assert ("no promise; measured" in shown) is (promise is None)
    found = json.loads(ok("verify", path / "b.iso", path / "one.npy", "--json"))
    assert found["kept"] is (None if promise is None else True)
    result = run("verify", path / "b.iso", path / "other.npy")
    if promise is not None:
        assert result.exit_code == 9 and "NOT KEPT" in result.stdout
    assert "ok" not in result.stdout


def kept_on(file: isocodec.IsoFile, mesh: isocodec.Mesh) -> bool:
    (found,) = file.verify(mesh)
    return bool(found.kept and found.promised and max(found.there, found.back) <= found.promised)


def text_of(data: bytes) -> str | None:
    return isocodec.open(data).promise


def kept(data: bytes) -> set[bool | None]:
    return {found.kept for found in isocodec.open(data).verify(field(None))}


@looped(
    ("precision", "edit", "promise"),
    [
        ("2cm", {"profile": "baseline"}, "within 2cm (0.04 cells)"),
        ("2cm", {"isovalues": [60.5]}, "within 2cm (0.04 cells)"),
        ("2cm", {"precision": 0.3}, "within 0.34 cells"), ("2cm", {"precision": "10cm"}, "within 0.24 cells"),
        ("2cm", {"precision": "signs"}, "all signs"), ("2cm", {"layers": 4}, None), ("2cm", {"size": 150}, None),
        ("2cm", {"size": 100_000}, "within 2cm (0.04 cells)"), ("exact", {"profile": "baseline"}, "all values exactly"),
        ("exact", {"precision": 0.3}, "within 0.3 cells"), ("exact", {"precision": "10cm"}, "within 10cm (0.2 cells)"),
        ("exact", {"size": 160}, None), (None, {"precision": 0.3}, None), (None, {"profile": "baseline"}, None),
    ],
)
def test_edits_promise_what_is_true(precision: Any, edit: dict[str, Any], promise: str | None) -> None:
    data = isocodec.encode(field(None), [VALUE, 60.5], precision=precision)
    edited = isocodec.open(data).edited(**edit)
    assert text_of(edited) == promise
    assert kept(edited) == {None if promise is None else True}


@looped("last", ["exact", "step=0.5"])
@looped("layers", range(1, 18, 3))
def test_the_first_layers_of_steps(layers: int, last: str) -> None:
    """Only where a step ends something is promised."""
    data = encoded(field(last), VALUE, precision=f"2m,0.5m,{last}")
    whole = isocodec.open(data).info.layers
    short = isocodec.open(data).edited(layers=min(layers, len(whole)))
    within = whole[min(layers, len(whole)) - 1].within
    (found,) = isocodec.open(short).verify(field(last))
    assert found.promised == within and found.kept is (None if within is None else True)
    assert (text_of(short) is None) is (within is None)


def test_merged_files_promise_what_all_of_them_do() -> None:
    def one(isovalue: float, precision: Any) -> bytes:
        return isocodec.encode(field(None), isovalue, precision=precision)

    assert text_of(isocodec.merge([one(VALUE, "2cm"), one(60.5, "2cm")])) == "within 2cm (0.04 cells)"
    mixed = isocodec.merge([one(VALUE, "2cm"), one(60.5, None)])
    assert [found.kept for found in isocodec.open(mixed).verify(field(None))] == [True, None]
    assert "promise" not in isocodec.open(mixed).metadata


@looped(
    ("edit", "promise"),
    [({"profile": "baseline"}, "within 2cm (0.04 cells)"), ({"layers": 2}, None), ({"layers": 9}, "within 2cm"),
     ({"precision": 0.3}, "within 0.34 cells"), ({"window": ((0, 20), (0, 20))}, None)],
)
def test_edits_of_tiles(edit: dict[str, Any], promise: str | None, tmp_path: Path) -> None:
    isocodec.save(tmp_path / "a.iso", field(None), VALUE, tile=32, precision="2cm")
    assert text_of(isocodec.open(tmp_path / "a.iso").edited(**edit)) == promise


def test_shorter_meshes_promise_what_their_last_layer_keeps_and_surfaces_nothing() -> None:
    where, cells, heights = points()
    file = isocodec.open(isocodec.encode(isocodec.Mesh(where, cells, heights, progressive=True), VALUE, precision=0.05))
    assert file.promise == "within 0.05 in the unit of its points"
    short = isocodec.open(file.edited(layers=1), mesh=(where, cells))
    assert short.promise == f"within {file.info.layers[0].within:.4g} in the unit of its points"
    assert short.contour().cells.size and kept_on(short, isocodec.Mesh(where, cells, heights))
    steps = isocodec.Mesh(where, cells, heights, unit="mm")
    file = isocodec.open(isocodec.encode(steps, VALUE, precision="8mm,0.2cm,0.5"), mesh=(where, cells))
    assert file.promise == "within 8mm, 0.2cm, 0.5 mm"
    (end,) = [number for number, layer in enumerate(file.info.layers, 1) if round(layer.within or 0, 3) == 2]
    short = isocodec.open(file.edited(layers=end), mesh=(where, cells))
    assert short.promise == "within 8, 2 mm" and kept_on(short, steps)
    alone = isocodec.open(isocodec.open(isocodec.encode(steps, [VALUE, 60.5], precision=2.0)).edited(isovalues=[VALUE]))
    assert alone.promise == "within 2 mm" and alone.info.layers[-1].within == pytest.approx(2)
    signs = isocodec.open(isocodec.open(isocodec.encode(steps, VALUE, precision=0.01)).edited(precision="signs"))
    assert "promises" not in [chunk.type for chunk in signs.info.chunks] and signs.promise == "all signs"
    surface = isocodec.open(isocodec.encode(isocodec.thin(field(None), error=3, layers=3)))
    assert surface.promise == "values within 3 m" and text_of(surface.edited(layers=1)) is None
