"""Files held against their fields: what they promise is kept, and what was tampered with is found."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, run
from explicit_meshes import plane, space, torus
from isocodec.errors import InputError
from isocodec.field.placement import Placement
from isocodec.field.samples import check_field
from isocodec.search.original import original
from libraries import Late
from tables import heavy, looped

maximum_filter = Late("scipy.ndimage.maximum_filter")
minimum_filter = Late("scipy.ndimage.minimum_filter")
shapely = Late("shapely")


@looped(
    "options",
    [
        {}, {"precision": "exact"}, {"precision": "signs"}, {"precision": 0.5}, {"precision": [4, 1, 0.25]},
        {"precision": 1.0},
    ],
)
def test_promises_are_kept(options: dict[str, Any]) -> None:
    """The distances are those that shapely measures between the same two curves."""
    data = isocodec.encode(HILLS, [80.5, 100.5], **options)
    found = isocodec.open(data).verify(HILLS, within=0.5 if options == {"precision": "signs"} else None)
    assert [one.isovalue for one in found] == [80.5, 100.5]
    assert all(one.kept is (True if options else None) for one in found)
    for one, contour in zip(found, isocodec.open(data).contours(), strict=True):
        first = original(check_field(HILLS, one.isovalue))
        ours, theirs = (shapely.MultiLineString([*c.points[c.cells]]) for c in (contour, first))
        measured = [
            shapely.distance(shapely.points(shapely.get_coordinates(curve.segmentize(0.05))), other).max()
            for curve, other in ((ours, theirs), (theirs, ours))
        ]
        for exact, bound in zip(measured, (one.there, one.back), strict=True):
            assert exact - 1e-6 <= bound <= exact + 0.03
        assert not one.wrong
        if isinstance(options.get("precision"), list):
            assert one.promised == options["precision"][-1]


@looped("precision", [0.07, 0.0004, *heavy(0.021, 0.011, 1e-5)])
@looped("shape", [(17, 18), *heavy((6, 7, 5))])
def test_fine_promises_are_measured_finely(shape: tuple[int, ...], precision: float) -> None:
    """Kept is kept, however fine; and half of what is needed is not."""
    field = np.cumsum(np.random.default_rng(1).normal(size=shape), axis=1)
    file = isocodec.open(isocodec.encode(field, 0.1, precision=precision))
    (found,) = file.verify(field)
    assert found.kept and 0 < max(found.there, found.back) <= 1.02 * precision + 1e-6
    assert not file.verify(field, within=precision / 2)[0].kept


RAMP = np.tile(np.arange(12.0), (9, 1))
METRES = Placement(np.array([[0.0, 10, 0], [-10, 0, 0]]), unit="m")


@pytest.mark.cover(2)
@pytest.mark.parametrize("unit", ["", "m"])
@pytest.mark.parametrize("off", [-1e-2, -1e-3, -1e-5, 0.0, 1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("away", [0.011, 0.125, 0.4999])
def test_numbers_agree_with_the_verdict(away: float, off: float, unit: str, tmp_path: Path) -> None:
    """A straight line, from which that of the field is a known distance away: bounds hold it, however near a promise.

    Kept are distances that exceed no promise, as numbers and as they are printed.
    """
    field = isocodec.Field(RAMP, placement=METRES if unit else None)
    (tmp_path / "a.iso").write_bytes(isocodec.encode(field, 5.25, precision="signs"))
    (place,) = {*isocodec.decode(tmp_path / "a.iso").points[:, 1].tolist()}
    other = RAMP - (place + away - 5.25)
    np.save(tmp_path / "b.npy", other)
    promised = round(away + off, 6)
    within = f"{promised * 10:.6g}m" if unit else f"{promised}"
    if promised <= 0:
        return
    (found,) = isocodec.open(tmp_path / "a.iso").verify(other, within=within)
    assert found.kept is (off >= 0)
    for least, most in ((found.there_least, found.there), (found.back_least, found.back)):
        assert least - 2e-6 <= away <= most + 2e-6 and most - least <= 0.001 + 1e-6
        assert (most > promised + 1e-9) is (off < 0) and (least > promised + 1e-9) is (off < 0)
    line = run("verify", tmp_path / "a.iso", tmp_path / "b.npy", "--within", within).stdout
    shown = re.findall(r"([0-9.e-]+) cells (?:\(.*?\) )?(?:file|field) to", line.partition("): " if unit else ": ")[2])
    assert len(shown) == 2 and all((float(text) > promised) is (off < 0) for text in shown), line
    assert ("NOT KEPT" in line) is (off < 0)


def test_what_is_not_kept(tmp_path: Path) -> None:
    data = isocodec.encode(HILLS, 80.5)
    other = HILLS.copy()
    other[tuple(np.argwhere(HILLS > 80.5)[0])] = 0
    (one,) = isocodec.open(data).verify(other)
    assert one.wrong == 1 and not one.kept
    (one,) = isocodec.open(data).verify(HILLS, within=0.001)
    assert not one.kept and one.wrong == 0
    with pytest.raises(InputError, match="has shape"):
        isocodec.open(data).verify(HILLS[1:])


@pytest.mark.parametrize("shape", [(70, 90), (40, 36, 38)])
def test_files_in_tiles(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """What is measured is the joined curve, of more than one tile."""
    tolerance = 0.5
    field = np.rint(100 * np.sin(np.indices(shape) / 7).sum(axis=0)).astype(np.int16)
    np.save(tmp_path / "field.npy", field)
    path = tmp_path / "tiled.iso"
    ok(
        "encode", tmp_path / "field.npy", "-o", path, "--isovalue", "55.5", "--tile", 32,
        "--precision", tolerance,
    )
    (one,) = isocodec.open(path).verify(field, within=tolerance)
    assert one.kept and one.wrong is None and 0 < max(one.there, one.back) <= tolerance + 0.002
    (less,) = isocodec.open(path).verify(field, within=one.there / 2)
    assert not less.kept
    record = json.loads(ok("verify", path, tmp_path / "field.npy", "--within", tolerance, "--json"))
    assert record["kept"] and record["isovalues"][0]["there"] == one.there
    assert run("verify", path, tmp_path / "field.npy", "--within", one.there / 2).exit_code == 9
    with pytest.raises(InputError, match="has shape"):
        isocodec.open(path).verify(field[1:])


def sample(own: tuple[float, float], around: tuple[float, float] = (-1, 256)) -> tuple[int, ...]:
    """A sample of the hills between two values, those next to it between two others."""
    good = (own[0] < HILLS) & (own[1] > HILLS)
    good &= (around[0] < minimum_filter(HILLS, 3)) & (around[1] > maximum_filter(HILLS, 3))
    return tuple(np.argwhere(good)[0].tolist())


# what a sample is changed to, and the numbers of the isovalues 80.5 and 120.5 whose curves are then others
CHANGES: dict[str, tuple[tuple[int, ...], int, tuple[int, ...]]] = {
    "none": ((), 0, ()), "first": (sample((80.5, 120.5), (-1, 120.5)), 0, (0,)),
    "last": (sample((120.5, 256), (80.5, 256)), 81, (1,)), "both": (sample((120.5, 256)), 0, (0, 1)),
}
PRECISIONS: list[Any] = [None, "exact", "signs", 0.02]


@pytest.mark.cover(2)
@pytest.mark.parametrize("precision", PRECISIONS, ids=str)
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("isovalues", [[80.5, 120.5], [120.5, 80.5]], ids=str)
@pytest.mark.parametrize("frames", [None, 0, 1])
def test_one_isovalue_that_is_not_kept_breaks_the_file(
    frames: int | None, isovalues: list[float], change: str, precision: Any, tmp_path: Path
) -> None:
    """Whichever it is, in whichever frame, as text and as JSON; without a promise nobody judges what is right."""
    at, value, wrong = CHANGES[change]
    other = HILLS.copy()
    if at:
        other[at] = value
    data = _file(frames, tuple(isovalues), precision)
    (tmp_path / "a.iso").write_bytes(data)
    np.save(tmp_path / "other.npy", other if frames is None else np.stack([HILLS, HILLS]))
    if frames is not None:
        stack = np.stack([HILLS // 2, HILLS // 2])
        stack[frames] = other
        np.save(tmp_path / "other.npy", stack)
    told = () if frames is None else ("--frame", frames)
    words = ["verify", tmp_path / "a.iso", tmp_path / "other.npy", *told]
    text, machine = run(*words), run(*words, "--json")
    broken = [[80.5, 120.5][number] for number in wrong]
    assert text.exit_code == machine.exit_code == (9 if broken else 0), text.output + machine.output
    lines, record = text.stdout.splitlines(), json.loads(machine.stdout)
    assert [one["isovalue"] for one in record["isovalues"]] == isovalues
    kept = [one["kept"] for one in record["isovalues"]]
    assert kept == [False if each in broken else None if precision is None else True for each in isovalues]
    assert record["kept"] is (False if broken else None if precision is None else True)
    assert [("NOT KEPT" in line) for line in lines] == [each in broken for each in isovalues]


@cache
def _file(frames: int | None, isovalues: tuple[float, ...], precision: Any) -> bytes:
    given: dict[str, Any] = {} if precision is None else {"precision": precision}
    if frames is None:
        return isocodec.encode(HILLS, list(isovalues), **given)
    stack = [HILLS // 2, HILLS // 2]
    stack[frames] = HILLS
    return isocodec.encode(isocodec.Frames(stack), list(isovalues), **given)


def test_signs_of_missing_samples_do_not_count() -> None:
    """Whatever lies where they are missing."""
    gone = np.zeros(HILLS.shape, np.bool_)
    gone[8:14, 10:20] = gone[:3] = True
    data = isocodec.encode(isocodec.Field(HILLS, mask=gone), [80.5, 120.5], precision="exact")
    for value in (0, 255):
        other = np.where(gone, np.uint8(value), HILLS)
        found = isocodec.open(data).verify(isocodec.Field(other, mask=gone))
        assert [(one.wrong, one.kept) for one in found] == [(0, True)] * 2


@pytest.mark.parametrize("name", ["flat.npz", "curved.npz", "solid.npz"])
def test_against_a_mesh_in_a_file(tmp_path: Path, name: str) -> None:
    """A file on a mesh that it does not store is verified against the file with that mesh and its values."""
    made = {"flat.npz": plane(1), "curved.npz": torus(), "solid.npz": space(1)}
    points, cells = (np.asarray(each) for each in made[name])
    depth = points[:, 0] * 2 + np.sin(3 * points[:, 1])
    isovalue = float(np.median(depth)) + 1e-3
    np.savez(tmp_path / name, points=points, cells=cells, depth=depth, other=-depth)
    path, tolerance = tmp_path / "mesh.iso", 0.25 * float(np.ptp(points, axis=0).max())
    ok("encode", tmp_path / name, "-o", path, "--key", "depth", "--isovalue", isovalue, "--precision", tolerance)
    record = json.loads(ok("verify", path, tmp_path / name, "--key", "depth", "--json"))
    # on a cut of the mesh there are no signs of all vertices
    assert record["kept"] and record["isovalues"][0]["wrong"] is None
    ok("encode", tmp_path / name, "-o", path, "--key", "depth", "--isovalue", isovalue)
    record = json.loads(ok("verify", path, tmp_path / name, "--key", "depth", "--json"))
    assert record["isovalues"][0]["wrong"] == 0
    assert run("verify", path, tmp_path / name, "--key", "other").exit_code == 9
    np.savez(tmp_path / "moved.npz", points=points[:, ::-1] + 1, cells=cells, depth=depth)
    assert "mesh" in fails(3, "verify", path, tmp_path / "moved.npz", "--key", "depth")
    np.save(tmp_path / "bare.npy", depth[: len(depth) // 2 * 2].reshape(2, -1))
    assert "give the mesh with its values" in fails(3, "verify", path, tmp_path / "bare.npy")
