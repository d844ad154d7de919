"""Contour maps in one step: `encode` to formats of other tools, against `encode` and `decode`, and other readers."""

from __future__ import annotations

import json
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, fails, ok, run
from isocodec.api.export import drawn
from isocodec.api.tracing import Traced
from isocodec.drawing.contour import Contour
from isocodec.field.placement import Placement
from isocodec.io.formats import FORMATS
from isocodec.verbs import Decode
from libraries import Late
from tables import looped

geopandas = Late("geopandas")

ROWS, COLUMNS = np.mgrid[:33, :41]
HOLES = np.zeros(HILLS.shape, bool)
HOLES[10:14, 8:20] = HOLES[30, 40] = True
CAVE = np.zeros(BALL.shape, bool)
CAVE[3:6, 3:6, 3:9] = True
UTM = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])
PLACED = ["--spacing", "-20,30", "--origin", "500000,5000000", "--crs", "EPSG:32631"]
BENT = Placement(coordinates=(COLUMNS + 0.1 * np.sin(ROWS / 5), 2.0 * ROWS + 0.05 * COLUMNS), crs="EPSG:32631")
GLOBE = Placement(coordinates=(np.arange(33) * 5.0 - 80, np.arange(40) * 9.0 - 180), periodic=(1,), periods=(360, 0),
                  crs="EPSG:4326")
WAVES = np.rint(50 * np.cos(np.radians(np.arange(40) * 9))[None] + 3 * np.arange(33)[:, None]).astype(np.int16)
FIELDS: dict[str, tuple[Any, Any]] = {
    "integers": (isocodec.Field(HILLS), [40, 80, 80.5]),
    "wide": (isocodec.Field(HILLS.astype(np.int64) * 10**12), [8 * 10**13]),
    "signed": (isocodec.Field(HILLS.astype(np.int16) - 100), "every 50 from 3"),
    "holes": (isocodec.Field(HILLS, mask=HOLES), [40.5, 80]),
    "below": (isocodec.Field(HILLS, mask=HOLES, missing="below"), [40.5, 80]),
    "nearest": (isocodec.Field(HILLS, mask=HOLES, missing="nearest"), [40.5, 80]),
    "matrix": (isocodec.Field(HILLS, placement=UTM, crs="EPSG:32631", notes={"unit": "m"}), [40, 80.5]),
    "coordinates": (isocodec.Field(HILLS, placement=BENT), [40, 80.5]),
    "periodic": (isocodec.Field(WAVES, placement=GLOBE), [40.5, 90]),
    "mask": (isocodec.Field(HILLS > 80), None),
    "labels": (isocodec.Field(HILLS // 50, labels=[1, 2]), None),
    "outside": (isocodec.Field(HILLS), [1000]),
    "volume": (isocodec.Field(BALL), [40, 60.5]),
    "cave": (isocodec.Field(BALL, mask=CAVE), [40, 60.5]),
    "floats": (isocodec.Field(HILLS / 3 + 1e-3), [20.5]),
    "floats with holes": (isocodec.Field(np.where(HOLES, np.nan, HILLS / 3)), [20.5]),
    # of points that are stored whole, places do not depend on the isovalues
    "mesh": (
        isocodec.Mesh(np.random.default_rng(7).random((60, 2)) * 10, None, np.arange(60.0) % 13, stored="whole"),
        [3.1, 7],
    ),
}


def pieces(contour: Contour) -> np.ndarray:
    """The segments or triangles of a contour in the world, in an order that does not depend on that of its points."""
    whole = contour.joined
    flat = whole.placed[whole.placed_cells].reshape(len(whole.cells), whole.cells.shape[1] * whole.placed.shape[1])
    return flat[np.lexsort(flat.round(6).T)]


def exact(what: Any, name: str) -> dict[str, Any]:
    if name in ("mask", "labels", "mesh"):
        return {}
    return {"precision": "exact" if what.values.dtype.kind in "iu" else "step=1e-10"}


@looped("name", FIELDS)
def test_contours_are_those_of_the_exact_file(name: str) -> None:
    what, isovalue = FIELDS[name]
    traced = Traced(what, isovalue)
    file = isocodec.open(isocodec.encode(what, isovalue, **exact(what, name)))
    assert traced.isovalues == file.isovalues
    for contour, other in zip(traced, file.contours(), strict=True):
        assert (contour.isovalue, contour.shape, contour.n) == (other.isovalue, other.shape, other.n)
        assert (contour.masked, contour.origin_above, contour.complete) == (other.masked, other.origin_above, True)
        assert contour.metadata.get("crs") == other.metadata.get("crs")
        for attribute in ("crs", "unit", "periodic", "periods"):
            assert getattr(contour.placement, attribute, None) == getattr(other.placement, attribute, None)
        assert pieces(contour).shape == pieces(other).shape
        assert np.abs(pieces(contour) - pieces(other)).max(initial=0) <= (1e-9 if "floats" in name else 0)


@looped("what", ["areas", "bands"])
@looped("name", ["integers", "matrix", "holes", "mask"])
def test_areas_are_those_of_the_exact_file(tmp_path: Path, name: str, what: str) -> None:
    field, isovalue = FIELDS[name]
    (tmp_path / "a.iso").write_bytes(isocodec.encode(field, isovalue, **exact(field, name)))
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.gpkg", "--what", what)
    drawn(field, "b.gpkg", Decode(what=what), isovalue).write(tmp_path / "b.gpkg")
    tables = [geopandas.read_file(tmp_path / each) for each in ("a.gpkg", "b.gpkg")]
    assert tables[0].drop(columns="geometry").equals(tables[1].drop(columns="geometry"))
    assert tables[0].geometry.symmetric_difference(tables[1].geometry).area.max() < 1e-9


@pytest.mark.parametrize("more", [["--precision", 1], ["--precision", "signs"], ["--precision", 1, "--keep-topology"]])
def test_with_a_precision_they_are_those_of_such_a_file(tmp_path: Path, more: list[Any]) -> None:
    np.save(tmp_path / "hills.npy", HILLS)
    for each in ("a.iso", "b.npz"):
        ok("encode", tmp_path / "hills.npy", "-o", tmp_path / each, "--isovalue", 80.5, *more)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.npz")
    one, two = (np.load(tmp_path / each) for each in ("a.npz", "b.npz"))
    assert np.array_equal(one["points"], two["points"]) and np.array_equal(one["cells"], two["cells"])


@looped("suffix", sorted({s for o in FORMATS if "contour" in o.holds for s in o.suffixes} - {".dcm"}))
def test_every_format_holds_what_decode_writes(tmp_path: Path, suffix: str) -> None:
    """Of a plane or of space, one isovalue or as many as the format holds; the same counts, and a file that is read."""
    output = next(o for o in FORMATS if "contour" in o.holds and suffix in o.suffixes)
    field, values = (HILLS, [40.5, 80.5]) if "contour2" in output.holds else (BALL, [40.5, 60.5])
    if not output.several:
        values = values[:1]
    np.save(tmp_path / "a.npy", field)
    isovalues = [word for value in values for word in ("--isovalue", value)]
    isovalues += PLACED if "contour2" in output.holds else []
    ok("encode", tmp_path / "a.npy", "-o", tmp_path / "a.iso", "--precision", "exact", *isovalues)
    one = json.loads(ok("decode", tmp_path / "a.iso", "-o", tmp_path / f"a{suffix}", "--json"))
    two = json.loads(ok("encode", tmp_path / "a.npy", "-o", tmp_path / f"b{suffix}", "--json", *isovalues))
    for record in (one, two):
        for name in ("output", "seconds", "bytes"):
            assert record.pop(name) is not None
    assert two.pop("dtype") and two.pop("missing") == 0
    assert one == two and (tmp_path / f"b{suffix}").stat().st_size > 0
    assert not list(tmp_path.glob("b*.iso*"))


def test_more_isovalues_than_a_file_holds(tmp_path: Path) -> None:
    np.save(tmp_path / "hills.npy", HILLS)
    line = fails(3, "encode", tmp_path / "hills.npy", "-o", tmp_path / "a.iso", "--interval", 0.01)
    assert "a file holds at most 4,096" in line
    ok("encode", tmp_path / "hills.npy", "-o", tmp_path / "a.gpkg", "--interval", "1,0.5")
    found = geopandas.read_file(tmp_path / "a.gpkg")
    assert sorted(set(found.isovalue)) == [v + 0.5 for v in range(int(HILLS.min()), int(HILLS.max()))]
    assert "100,000" in fails(3, "encode", tmp_path / "hills.npy", "-o", tmp_path / "b.gpkg", "--interval", 1e-4)
    assert not (tmp_path / "b.gpkg").exists()


@looped("option", [["--attribute", "z"], ["--layer", "z"]])
@looped("suffix", sorted({s for o in FORMATS if "contour" in o.holds for s in o.suffixes}))
def test_what_a_format_does_not_have_is_refused(tmp_path: Path, suffix: str, option: list[Any]) -> None:
    """No option is ignored: it has an effect, or one line says that it has none."""
    output = next(o for o in FORMATS if "contour" in o.holds and suffix in o.suffixes)
    np.save(tmp_path / "in.npy", HILLS if "contour2" in output.holds else BALL)
    words = ["encode", tmp_path / "in.npy", "--isovalue", 60.5, *PLACED * ("contour2" in output.holds), "-o"]
    result = run(*words, tmp_path / f"a{suffix}", *option)
    if result.exit_code:
        assert option[0] in result.stderr and not (tmp_path / f"a{suffix}").exists()
        return
    ok(*words, tmp_path / f"b{suffix}")
    one, two = (b"".join(each.read_bytes() for each in sorted(tmp_path.glob(f"{name}.*"))) for name in "ab")
    assert one != two


@looped("option", [
    ["--what", "areas"], ["--layer", "a"], ["--attribute", "a"], ["--in-samples"],
])
def test_options_of_other_formats_do_not_apply_to_iso(tmp_path: Path, option: list[Any]) -> None:
    np.save(tmp_path / "in.npy", HILLS)
    assert option[0] in fails(2, "encode", tmp_path / "in.npy", "-o", tmp_path / "a.iso", "--isovalue", 60.5, *option)


@looped("option", [
    ["--tile", 32], ["--frames"], ["--order", "independent"], ["--profile", "baseline"], ["--metadata", "a=b"],
    ["--layers", 2],
])
def test_options_of_iso_do_not_apply_to_other_formats(tmp_path: Path, option: list[Any]) -> None:
    np.save(tmp_path / "in.npy", HILLS)
    assert option[0] in fails(2, "encode", tmp_path / "in.npy", "-o", tmp_path / "a.gpkg", "--isovalue", 60.5, *option)


def test_drawings_are_released_one_by_one(tmp_path: Path) -> None:
    """While a map is written, one contour is alive; progress rises, and ends at its total when the file is there."""
    alive, most, seen = weakref.WeakSet[Contour](), [0], list[tuple[int, int]]()
    made = drawn(isocodec.Field(HILLS), "a.gpkg", Decode(), "every 2")
    draw = made.drawings.draw

    def watched(number: int) -> Contour:
        contour = draw(number)
        alive.add(contour)
        most[0] = max(most[0], len(alive))
        return contour

    made.drawings.draw = watched  # type: ignore[method-assign]

    def progress(done: int, total: int) -> None:
        seen.append((done, total))
        assert (tmp_path / "a.gpkg").exists() == (done == total)

    made.write(tmp_path / "a.gpkg", progress)
    count = len(made.drawings)
    assert count > 64 and most[0] == 1
    assert seen == [(number, count + 1) for number in range(1, count + 2)]
