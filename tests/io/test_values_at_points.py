"""Values of other files at the points of contours, in every format that holds them, read back by other libraries."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import fails, ok, run
from isocodec.io.formats import FORMATS
from libraries import Late
from tables import looped
from written_contents import PLACES, SPACES, plane, volume

geopandas, nibabel, pyvista, rasterio, trimesh = map(Late, ("geopandas", "nibabel", "pyvista", "rasterio", "trimesh"))
HOLDS = {n: [suffix for form in FORMATS if f"contour{n}" in form.holds for suffix in form.suffixes if form.at_points]
         for n in (2, 3)}
REFUSES = {n: {suffix for form in FORMATS if f"contour{n}" in form.holds for suffix in form.suffixes} - {*HOLDS[n]}
           for n in (2, 3)}


@cache
def other(n: int) -> np.ndarray:
    return np.random.default_rng(n).normal(size=(plane if n == 2 else volume)().shape).astype(np.float32)


def inputs(folder: Path, n: int) -> tuple[Path, Path, isocodec.Contour]:
    """An .iso file, a file of another field in its place, and the contour with values."""
    file, field = (plane("utm"), folder / "b.tif") if n == 2 else (volume("ras"), folder / "b.nii")
    if n == 2:
        (_, dx, x), (dy, _, y) = PLACES["utm"][0]
        with rasterio.open(field, "w", driver="GTiff", width=31, height=25, count=1, dtype="float32", crs="EPSG:32631",
                           transform=rasterio.Affine(dx, 0, x - dx / 2, 0, dy, y - dy / 2)) as raster:
            raster.write(other(2), 1)
    else:
        nibabel.save(nibabel.Nifti1Image(other(3), np.vstack([SPACES["ras"][0], [0, 0, 0, 1]])), field)
    (folder / "a.iso").write_bytes(file.data)
    contour = file.contour(50.5 if n == 3 else 80.5)
    return folder / "a.iso", field, contour.with_values(dose=other(n))


def found_in(path: Path) -> np.ndarray:
    """Values (P,) of the points of a file."""
    if path.suffix == ".npz":
        return np.load(path)["dose"]
    if path.suffix in (".vtp", ".vtu", ".vtk"):
        return np.asarray(pyvista.read(path).point_data["dose"])
    (mesh,) = trimesh.load_scene(path, process=False).geometry.values()
    if path.suffix == ".ply":
        return np.asarray(mesh.metadata["_ply_raw"]["vertex"]["data"]["dose"]).ravel()
    return mesh.vertex_attributes["_dose"].ravel()


@pytest.mark.parametrize(("n", "suffix"), [(n, suffix) for n in (2, 3) for suffix in HOLDS[n]])
def test_values_are_read_back(tmp_path: Path, n: int, suffix: str) -> None:
    """Of each point, or in tables the mean of each line."""
    file, field, contour = inputs(tmp_path, n)
    path = tmp_path / f"out{suffix}"
    ok("decode", file, "-o", path, "--isovalue", contour.isovalue, "--sample", f"dose={field}")
    if n == 3 or suffix in (".vtp", ".vtu", ".vtk", ".npz"):
        assert np.allclose(found_in(path), contour.at_points["dose"], rtol=1e-6)
    elif suffix in (".pmtiles", ".mbtiles"):  # lines are cut at the borders of tiles
        assert geopandas.read_file(path).dose.astype(float).round(5).isin(
            contour.to_geodataframe().dose.round(5)).all()
    else:
        table = (geopandas.read_parquet if suffix == ".parquet" else geopandas.read_file)(path)
        assert np.allclose(np.sort(table.dose.astype(float)), np.sort(contour.to_geodataframe().dose), rtol=1e-6)


@pytest.mark.parametrize("n", [2, 3])
def test_other_formats_refuse_them(tmp_path: Path, n: int) -> None:
    file, field, _ = inputs(tmp_path, n)
    assert len(HOLDS[n]) >= 7 and len(REFUSES[n]) >= 3
    for suffix in REFUSES[n]:
        assert "--sample does not apply" in fails(2, "decode", file, "-o", tmp_path / f"no{suffix}",
                                                  "--sample", f"dose={field}")
    assert not [*tmp_path.glob("no*")]


def test_missing_values_are_nan_but_in_gltf(tmp_path: Path) -> None:
    """glTF forbids them."""
    file, field, contour = inputs(tmp_path, 3)
    gone = np.where(np.arange(13) > 6, np.nan, other(3))
    nibabel.save(nibabel.Nifti1Image(gone, np.vstack([SPACES["ras"][0], [0, 0, 0, 1]])), field)
    wanted = contour.sample(gone)
    assert 0 < np.isnan(wanted).sum() < len(wanted)
    for suffix in (".vtp", ".ply", ".npz"):
        ok("decode", file, "-o", tmp_path / f"a{suffix}", "--isovalue", 50.5, "--sample", f"dose={field}")
        assert np.allclose(found_in(tmp_path / f"a{suffix}"), wanted, rtol=1e-6, equal_nan=True)
    line = fails(2, "decode", file, "-o", tmp_path / "a.glb", "--isovalue", 50.5, "--sample", f"dose={field}")
    assert "dose is missing at" in line and ".vtp" in line and not (tmp_path / "a.glb").exists()


def test_a_map_in_one_step_and_on_meshes(tmp_path: Path) -> None:
    _, field, _ = inputs(tmp_path, 2)
    np.savez(tmp_path / "f.npz", values=other(2)[::-1], placement=PLACES["utm"][0], crs="EPSG:32631")
    ok("encode", tmp_path / "f.npz", "-o", tmp_path / "a.gpkg", "--isovalue", 0.5, "--attribute", "level",
       "--sample", f"own={tmp_path / 'f.npz'}", "--sample", f"other={field}")
    table = geopandas.read_file(tmp_path / "a.gpkg")
    assert np.allclose(table.own, 0.5, atol=1e-3) and table.level.eq(0.5).all() and table.other.std() > 0.01
    points, cells = np.array([[0, 0], [4, 0], [0, 4], [4, 4.0]]), np.array([[0, 1, 2], [1, 3, 2]])
    np.savez(tmp_path / "m.npz", points=points, cells=cells, values=points[:, 0])
    np.savez(tmp_path / "n.npz", points=points, cells=cells, values=points[:, 1])
    ok("encode", tmp_path / "m.npz", "-o", tmp_path / "m.vtp", "--isovalue", 1.5, "--sample", f"y={tmp_path / 'n.npz'}")
    mesh = pyvista.read(tmp_path / "m.vtp")
    assert np.allclose(mesh.point_data["y"], mesh.points[:, 1], atol=1e-6) and mesh.n_points > 2


WRONG: dict[str, tuple[Any, int, str]] = {
    "no file": ("dose=missing.nii", 3, "missing.nii: cannot be opened"),
    "no name": ("b.nii", 2, "not a name and a file"), "a name that is taken": ("points=b.nii", 2, "it is taken"),
    "another shape": ("dose=w.npy", 3, r"w.npy: the values have shape"),
    "a series": ("dose=s.nii", 3, "s.nii: "),
}


@looped("case", WRONG)
def test_errors_name_the_file_that_they_are_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    monkeypatch.chdir(tmp_path)
    inputs(tmp_path, 3)
    np.save("w.npy", np.zeros((3, 4, 5)))
    nibabel.save(nibabel.Nifti1Image(np.zeros((3, 4, 5, 2)), np.eye(4)), "s.nii")
    asked, code, words = WRONG[case]
    assert words in fails(code, "decode", "a.iso", "-o", "a.vtp", "--sample", asked)
    assert not Path("a.vtp").exists()


def test_fields_elsewhere_give_a_warning(tmp_path: Path) -> None:
    file, field, _ = inputs(tmp_path, 3)
    nibabel.save(nibabel.Nifti1Image(other(3), np.diag([1, 1, 1, 1]) + np.outer([1, 1, 1, 0], [0, 0, 0, 900])), field)
    said = run("decode", file, "-o", tmp_path / "a.vtp", "--sample", f"dose={field}")
    assert said.exit_code == 0 and "dose: no point lies next to samples that are not missing" in said.output
