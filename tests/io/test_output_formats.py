"""Choice of a format by a suffix; whole files or none; the command line and `save`."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from dicom_files import slices

import isocodec
from commands import run
from isocodec.errors import InputError, MissingExtraError, OptionError
from isocodec.io.formats import FORMATS, SUFFIXES, OutputOptions, Thing, check, suffix_of, suffixes_of, write
from isocodec.storage.atomic import beside
from written_contents import content, plane, volume, written

NAMES = {"contour2": ("curve", "utm"), "contour3": ("surface", "ras"), "areas2": ("above", "utm"),
         "mask2": ("mask", "utm"), "labels2": ("labels", "utm"), "labels3": ("labels of space", "ras"),
         "tin2": ("tin", "utm")}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_each_suffix_holds_what_it_promises(tmp_path: Path, suffix: str) -> None:
    """One kind of content each, by its name or by an option; by content the tables of the other modules."""
    kind = next(one.holds.split()[-1] for one in FORMATS if suffix in one.suffixes)
    options = {"like": str(slices(tmp_path / "a", np.ones((2, 3, 4), "u2")))} if suffix == ".dcm" else {}
    path, made = written(tmp_path, suffix, NAMES[kind], **options)
    assert made.bytes == path.stat().st_size > 0
    assert not [one for one in tmp_path.iterdir() if one.stem not in ("a", "a.nii")]
    write(bare := tmp_path / "b", content(*NAMES[kind]), OutputOptions(to=suffix, **options))
    assert bare.read_bytes()[:4] == path.read_bytes()[:4]


def test_the_page_of_formats_lists_all() -> None:
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    below = page.partition("## Written")[2].partition("## Coordinates")[0]
    assert set(re.findall(r"`(\.[a-z0-9.]+)`", below)) >= {*SUFFIXES}


@pytest.mark.parametrize(("name", "suffix"), [
    ("a.nii.gz", ".nii.gz"), ("A.GeoJSON", ".geojson"), ("a.geojsonl", ".geojsonl"), ("a.iso", None), (".gpkg", None),
])
def test_suffixes(name: str, suffix: str | None) -> None:
    assert suffix_of(name) == suffix


@pytest.mark.parametrize(("name", "thing", "message"), [
    ("a.xyz", Thing("contour"), "not a supported output format"), ("a", Thing("contour"), "without a suffix"),
    ("a.stl", Thing("contour", 2), r"a curve \(of a 2-D field\): one of"),
    ("a.gpkg", Thing("contour", 3), r"a surface \(of a 3-D field\): one of"),
    ("a.ply", Thing("contour", 3, True), "several contours"), ("a.nii", Thing("contour"), "cannot hold a contour"),
])
def test_formats_that_cannot_hold_it(name: str, thing: Thing, message: str) -> None:
    with pytest.raises(OptionError, match=message) as caught:
        check(name, thing)
    assert all(suffix in str(caught.value.remedy) for suffix in suffixes_of(thing))


@pytest.mark.parametrize(("options", "suffix"), [
    ({"layer": "a"}, ".vtp"), ({"attribute": "a"}, ".vtp"),
])
def test_options_that_do_not_apply(options: dict[str, Any], suffix: str) -> None:
    with pytest.raises(OptionError, match="does not apply"):
        check(f"a{suffix}", Thing("contour", 2), OutputOptions(**options))


def test_a_missing_library_names_its_extra() -> None:
    absent = mock.patch("isocodec.io.formats.find_spec", lambda name: None)
    with absent, mock.patch.dict("sys.modules", {"pyogrio": None}):
        with pytest.raises(MissingExtraError, match=r"\[vector\]"):
            check("a.gpkg", Thing("contour", 2))
        check("a.npz", Thing("contour", 2))


@pytest.mark.parametrize("what", [3, "text", [], [1, 2], np.zeros((2, 2))])
def test_what_cannot_be_written(what: Any, tmp_path: Path) -> None:
    with pytest.raises(OptionError):
        write(tmp_path / "a.gpkg", what)


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".gpkg", ("curve", "utm"))
    before = path.read_bytes()
    broken = mock.patch("pyogrio.write_dataframe", side_effect=RuntimeError("no\nway"))
    with broken, pytest.raises(OSError, match=r"cannot be written as \.gpkg \(no way\)"):
        written(tmp_path, ".gpkg", ("curves", "utm"))
    assert path.read_bytes() == before and [*tmp_path.iterdir()] == [path]


def test_a_full_disk_is_noticed(tmp_path: Path) -> None:
    full = mock.patch("isocodec.storage.atomic._check_space", side_effect=OSError(28, "No space left on device"))
    with full, pytest.raises(OSError, match="No space left"):
        written(tmp_path, ".fgb", ("curve", "utm"))
    assert not [*tmp_path.iterdir()]


def test_side_files_come_too_and_permissions_stay(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".shp", ("curve", "utm"))
    assert {one.suffix for one in tmp_path.iterdir()} >= {".shp", ".shx", ".dbf", ".prj"}
    path.chmod(0o640)
    link = tmp_path / "link.shp"
    link.symlink_to(path)
    write(link, content("curves", "utm"))
    assert path.stat().st_mode & 0o777 == 0o640 and link.is_symlink()


def test_files_that_are_open_elsewhere_are_not_replaced(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".gpkg", ("curve", "utm"))
    (tmp_path / "a.gpkg-wal").write_bytes(b"")
    with pytest.raises(OSError, match="another program"):
        write(path, content("curve", "utm"))


def test_open_files_receive_the_bytes(tmp_path: Path) -> None:
    out = io.BytesIO()
    write(out, content("curve", "utm"), OutputOptions(to=".fgb"))
    assert out.getvalue() == written(tmp_path, ".fgb", ("curve", "utm"))[0].read_bytes()
    with pytest.raises(OSError, match="several files"), beside(io.BytesIO(), ".shp") as path:
        path.write_bytes(b"")
        path.with_suffix(".dbf").write_bytes(b"")


# ---- save and the command line --------------------------------------------------------------------------------------


def test_save_writes_what_it_is_given(tmp_path: Path) -> None:
    import geopandas

    file = plane("utm")
    for name, what in (("a", file), ("b", file.data), ("c", file.contours())):
        isocodec.save(tmp_path / f"{name}.gpkg", what)
        assert set(geopandas.read_file(tmp_path / f"{name}.gpkg").isovalue) == {60.5, 80.5}
    isocodec.save(tmp_path / "d.gpkg", isocodec.Field(np.add.outer(np.arange(9.0), np.arange(9.0))), [3.5, 7.5])
    assert set(geopandas.read_file(tmp_path / "d.gpkg").isovalue) == {3.5, 7.5}
    with pytest.raises(InputError, match="no contours"):
        isocodec.save(tmp_path / "e.gpkg", isocodec.Field(np.zeros((9, 9))), 3.5)
    isocodec.save(tmp_path / "f.vtu", volume("ras").mesh(50.5))
    assert (tmp_path / "f.vtu").exists()


@pytest.fixture
def coded(tmp_path: Path) -> Path:
    (tmp_path / "a.iso").write_bytes(plane("utm").data)
    return tmp_path / "a.iso"


@pytest.mark.parametrize(("arguments", "columns"), [
    (["--what", "areas-below"], {"isovalue", "side", "complete"}),
    (["--what", "bands", "--attribute", "low,high"], {"low", "high"}),
    (["--attribute", "elev", "--layer", "lines"], {"elev", "closed", "complete"}),
    (["--in-samples"], {"isovalue", "closed", "complete"}),
])
def test_decode_to_a_table(coded: Path, arguments: list[str], columns: set[str]) -> None:
    import geopandas

    out = coded.with_suffix(".gpkg")
    done = run("decode", str(coded), "-o", str(out), *arguments)
    assert done.exit_code == 0, done.stderr
    table = geopandas.read_file(out)
    assert set(table.columns) == columns | {"geometry"}


@pytest.mark.parametrize(("arguments", "message"), [
    (["--attribute", "a,b"], "names 1 column"), (["--what", "bands", "--attribute", "a"], "names 2 columns"),
    (["--attribute", "closed"], "taken"),
])
def test_decode_refuses(coded: Path, arguments: list[str], message: str) -> None:
    done = run("decode", str(coded), "-o", str(coded.with_suffix(".gpkg")), *arguments)
    assert done.exit_code == 2 and message in done.stderr


def test_areas_are_closed_along_missing_samples(tmp_path: Path) -> None:
    import geopandas

    field = np.add.outer(np.arange(20.0), np.arange(20.0))
    field[5:8, 9:13] = np.nan
    isocodec.save(tmp_path / "a.iso", field, 15.5)
    np.save(tmp_path / "a.npy", field)
    out = tmp_path / "a.gpkg"
    for command in (["decode", str(tmp_path / "a.iso")], ["encode", str(tmp_path / "a.npy"), "--isovalue", "15.5"]):
        areas = {}
        for side in ("areas", "areas-below"):
            out.unlink(missing_ok=True)
            done = run(*command, "-o", str(out), "--what", side)
            assert done.exit_code == 0, done.stderr
            areas[side] = geopandas.read_file(out).area.sum()
        assert sum(areas.values()) == pytest.approx(19 * 19 - 4 * 5)
