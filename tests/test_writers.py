"""Every suffix with every kind of thing: another library reads the file, or it is refused by name before any work."""

from __future__ import annotations

import ast
import json
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import geopandas
import nibabel
import numpy as np
import pyogrio
import pytest
import pyvista
import shapely
import SimpleITK
import trimesh
import vtk
from isocodec.io.writers.registry import OUTPUTS, SUFFIXES, find, suffixes_of
from isocodec.io.writers.write import render, write
from PIL import Image
from vtk.util.numpy_support import vtk_to_numpy

import isocodec
from commands import BALL, HILLS
from isocodec.drawing.rows import MaskRows
from isocodec.errors import IsoError, MissingExtraError, OptionError
from isocodec.field.placement import Placement
from isocodec.io import writers
from isocodec.io.writers import registry
from isocodec.io.writers.output_formats import Output, OutputOptions
from isocodec.io.writers.things import Areas, Picture, Pyramid, SampleMask, thing_of
from isocodec.tin.tin import Tin

pmtiles_reader = pytest.importorskip("pmtiles.reader")
UTM = [[0.0, 30, 5e5], [-20, 0, 5e6]]
SPACE = Placement(np.array([[0.0, 0, -2.1, 400], [0, 1.5, 0, 500], [3.3, 0, 0, 7]]))
PLANE = isocodec.open(isocodec.encode(isocodec.Field(HILLS, placement=UTM, crs="EPSG:32631"), [80.5, 120.5, 300.5]))
VOLUME = isocodec.open(isocodec.encode(isocodec.Field(BALL, placement=SPACE), [55.5, 40.5, 400.5]))
CURVES, SURFACES = PLANE.contours(), VOLUME.contours()
SCATTERED = Tin(np.array([(0.0, 0), (4, 0), (0, 3)]), np.array([1.0, 2, 3]), np.array([(0, 1, 2)]))
SAMPLED = replace(SCATTERED, shape=(5, 4))
ON_MESH = replace(CURVES[0], points=CURVES[0].placed, shape=(), placement=None, metadata={})


def drawn(suffix: str) -> bytes:
    return render(CURVES[0], options=OutputOptions(to=suffix)) if suffix in (".png", ".svg") else b"%PDF"


def rows(transposed: bool) -> MaskRows:
    """All samples are known."""
    above = BALL.T > 55.5 if transposed else BALL > 55.5
    return MaskRows(above.shape, np.argwhere(np.ones_like(above)).astype(np.int32), above.ravel())


THINGS: dict[str, Callable[[], Any]] = {
    "curve": lambda: CURVES[0],
    "curves": lambda: CURVES[:2],
    "no curve": lambda: CURVES[2],
    "no curve beside another": lambda: CURVES[1:],
    "curve on a mesh": lambda: ON_MESH,
    "surface": lambda: SURFACES[0],
    "surfaces": lambda: SURFACES[:2],
    "no surface": lambda: SURFACES[2],
    "areas above": lambda: Areas(CURVES[:2], "above"),
    "areas below, none above": lambda: Areas(CURVES[2:], "above"),
    "bands": lambda: Areas(CURVES, "bands"),
    "mask": lambda: HILLS > 80.5,
    "placed mask": lambda: SampleMask(BALL > 55.5, SPACE),
    "mask in rows": lambda: SampleMask(rows),
    "mesh of the plane": lambda: PLANE.mesh(whole=True),
    "mesh of space": lambda: VOLUME.mesh(),
    "sampled tin": lambda: SAMPLED,
    "scattered tin": lambda: SCATTERED,
    "pyramid": lambda: Pyramid([lambda width: CURVES[0]]),
    "picture": lambda: Picture(drawn),
}


# ---- What others read -----------------------------------------------------------------------------------------------


def points_of_json(path: Path) -> int:
    whole = json.loads(path.read_text())
    shapes = [f["geometry"] for f in whole.get("features", [whole])]
    return len(np.unique(shapely.get_coordinates([shapely.geometry.shape(shape) for shape in shapes]), axis=0))


def points_of_table(path: Path) -> int:
    table = (geopandas.read_parquet if path.suffix == ".parquet" else geopandas.read_file)(path)
    assert table.crs == "EPSG:32631"
    return len(np.unique(shapely.get_coordinates(table.geometry), axis=0))


def points_of_drawing(path: Path) -> int:
    space = ezdxf.readfile(path).modelspace()
    lines = [np.array([p[:2] for p in line.get_points()]) for line in space.query("LWPOLYLINE")]
    return sum(map(len, lines)) + sum(len(mesh.vertices) for mesh in space.query("MESH"))


def points_of_polygons(path: Path) -> int:
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    found = reader.GetOutput().GetPoints()
    return 0 if found is None or not found.GetNumberOfPoints() else len(vtk_to_numpy(found.GetData()))


def points_of_trimesh(path: Path) -> int:
    if b"\nl " in path.read_bytes():  # lines, which it leaves out
        return path.read_bytes().count(b"\nv ")
    scene = trimesh.load_scene(path, process=False)
    return sum(len(np.unique(mesh.vertices, axis=0)) for mesh in scene.dump())


def points_of_archive(path: Path) -> int:
    data = path.read_bytes()
    assert pmtiles_reader.Reader(lambda offset, length: data[offset : offset + length]).header()["tile_type"]
    return -1


def of_picture(path: Path) -> int:
    with Image.open(path) as picture:
        picture.load()
        assert min(picture.size) > 3
    return -1


def points_of_npz(path: Path) -> int:
    with np.load(path) as arrays:
        return len(arrays["points"])


READERS: dict[str, Callable[[Path], int]] = {
    ".npz": points_of_npz,
    ".npy": lambda path: np.load(path).size * 0 - 1,
    ".png": of_picture,
    ".svg": lambda path: len(ElementTree.parse(path).getroot()) * 0 - 1,
    ".pdf": lambda path: path.read_bytes().index(b"%PDF") - 1,
    ".geojson": points_of_json,
    ".gpkg": points_of_table, ".fgb": points_of_table, ".shp": points_of_table, ".parquet": points_of_table,
    ".pmtiles": points_of_archive,
    ".dxf": points_of_drawing,
    ".vtp": points_of_polygons,
    ".vtu": lambda path: pyvista.read(path).n_points,
    ".ply": lambda path: int(path.read_bytes().partition(b"element vertex ")[2].split()[0]),
    **dict.fromkeys([".stl", ".off", ".obj", ".glb", ".3mf"], points_of_trimesh),
    ".nii": lambda path: int(nibabel.load(path).get_fdata().max() * 0) - 1,
    ".nii.gz": lambda path: int(nibabel.load(path).get_fdata().max() * 0) - 1,
    ".nrrd": lambda path: int(SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(path)).max() * 0) - 1,
}
"""By suffix: how many different points there are, or -1 where a format has none."""


def expected(what: Any) -> int | None:
    """How many different points there are, where that is known."""
    each = [what] if not isinstance(what, list | Areas) else what if isinstance(what, list) else None
    return None if each is None or not all(hasattr(one, "points") for one in each) else sum(
        len(one.points) for one in each
    )


@pytest.fixture(autouse=True)
def nothing_else_changes(tmp_path: Path) -> Iterator[None]:
    def state() -> list[Any]:
        return [
            list(warnings.filters), os.getcwd(), np.geterr(),
            {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"},
            ezdxf.options.write_fixed_meta_data_for_testing, pyogrio.get_gdal_config_option("OGR_CURRENT_DATE"),
        ]

    before = state()
    yield
    assert state() == before


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_written_or_refused(tmp_path: Path, suffix: str, name: str) -> None:
    what, path = THINGS[name](), tmp_path / f"a{suffix}"
    thing = thing_of(what)
    fitting = suffixes_of(thing.kind, thing.n, several=thing.several, sampled=thing.sampled)
    if suffix not in fitting:
        path.write_bytes(b"old")
        with pytest.raises(OptionError, match="cannot hold") as caught:
            write(path, what)
        assert caught.value.code == "suffix" and str(caught.value).startswith(suffix)
        assert all(other in str(caught.value) for other in fitting)
        assert path.read_bytes() == b"old" and [*tmp_path.iterdir()] == [path]
        return
    if name == "no surface" and suffix in (".glb", ".3mf"):
        with pytest.raises(OptionError, match=f"the surface is empty, and {suffix}"):
            write(path, what)
        assert not [*tmp_path.iterdir()]
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        written = write(path, what, options=OutputOptions(keep_crs=True))
    # drawings and meshes have no place for a reference system
    assert written.suffix == suffix
    assert all(remark.endswith("reference system of its coordinates: EPSG:32631") for remark in written.remarks)
    if (suffix, name) not in {(".obj", "no surface"), (".off", "no surface"), (".stl", "no surface"),
                              (".ply", "no surface")}:
        found = READERS[suffix](path)
        # of surfaces points may coincide in single precision; PLY of tetrahedra has all vertices
        assert found == -1 or expected(what) is None or suffix in (".glb", ".stl") or found == expected(what)
    if suffix != ".shp":
        assert [*tmp_path.iterdir()] == [path] and written.bytes == path.stat().st_size
        if suffix not in (".dxf", ".png"):
            assert render(THINGS[name](), options=OutputOptions(True, to=suffix)) == path.read_bytes()


def test_masks_are_counted_and_placed(tmp_path: Path) -> None:
    inside = BALL > 55.5
    for suffix in (".nii", ".nii.gz"):
        path = tmp_path / f"a{suffix}"
        assert write(path, SampleMask(inside, SPACE)).above == inside.sum()
        image = nibabel.load(path)
        assert np.array_equal(np.asarray(image.dataobj), inside) and np.allclose(image.affine[:3], SPACE.matrix)
        write(path, SampleMask(inside, SPACE), options=OutputOptions(in_samples=True))
        assert nibabel.load(path).header["sform_code"] == 0


def test_coordinates_in_samples(tmp_path: Path) -> None:
    for suffix, contour in ((".geojson", CURVES[0]), (".ply", SURFACES[0])):
        bare = replace(contour, placement=None)
        options = OutputOptions(in_samples=True, to=suffix)
        assert render(contour, options=options) == render(bare, options=options)
        assert render(contour, options=options) != render(contour, options=OutputOptions(to=suffix))


def test_what_coordinates_lose_is_said(tmp_path: Path) -> None:
    unnamed = replace(CURVES[0], placement=Placement(np.array(UTM)))
    (remark,) = write(tmp_path / "a.geojson", unnamed).remarks
    assert "not the longitudes and latitudes" in remark and "does not name" in remark
    (remark,) = write(tmp_path / "a.gpkg", replace(unnamed, placement=None)).remarks
    assert ".gpkg is written without a reference system" in remark and "in samples" in remark
    far = replace(SURFACES[0], placement=Placement(SPACE.matrix + [[0, 0, 0, 1e7]] * 3))
    (remark,) = write(tmp_path / "a.ply", far).remarks
    assert "rounded by up to" in remark
    assert write(tmp_path / "a.ply", far, options=OutputOptions(in_samples=True)).remarks == ()


def test_open_files_need_a_format(tmp_path: Path) -> None:
    with (tmp_path / "a").open("wb") as file:
        with pytest.raises(OptionError, match="no suffix"):
            write(file, CURVES[0])
        assert write(file, CURVES[0], options=OutputOptions(to="svg")).suffix == ".svg"
    assert (tmp_path / "a").read_bytes() == render(CURVES[0], options=OutputOptions(to=".svg"))


def test_what_fails_replaces_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor any of the files of a Shapefile."""
    write(tmp_path / "a.shp", CURVES[0])
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert {Path(name).suffix for name in before} >= {".shp", ".shx", ".dbf"}
    (tmp_path / "a.shx").unlink()
    (tmp_path / "a.shx").mkdir()
    with pytest.raises(IsADirectoryError):
        write(tmp_path / "a.shp", CURVES[1])
    (tmp_path / "a.shx").rmdir()
    assert all(path.read_bytes() == before[path.name] for path in tmp_path.iterdir())

    def broken(what: Any, suffix: str, options: OutputOptions) -> Iterator[bytes]:
        yield b"half"
        raise OptionError("no more", code="test")

    monkeypatch.setattr(registry, "OUTPUTS", [Output("contour", (".svg",), "SVG", broken, sampled=False)])
    (tmp_path / "a.svg").write_bytes(b"old")
    with pytest.raises(OptionError, match="no more"):
        write(tmp_path / "a.svg", CURVES[0])
    assert (tmp_path / "a.svg").read_bytes() == b"old" and not [*tmp_path.glob(".*")]


def test_warnings_come_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def noisy(what: Any, suffix: str, options: OutputOptions) -> bytes:
        for text in ("a", "b", "a", "c", "d"):
            warnings.warn(text, stacklevel=1)
        return b"x"

    monkeypatch.setattr(registry, "OUTPUTS", [Output("contour", (".svg",), "SVG", noisy, sampled=False)])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        write(tmp_path / "a.svg", CURVES[0])
    (only,) = caught
    assert str(only.message) == "a; b; c, and 1 more" and only.filename == __file__


def test_missing_libraries_are_named_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for output in OUTPUTS:
        for module in output.libraries:
            with monkeypatch.context() as without:
                without.setitem(sys.modules, module, None)
                with pytest.raises(MissingExtraError) as caught:
                    find(f"a{output.suffixes[0]}", replace(thing_of(THINGS["curve"]()), kind=output.kind,
                                                           n=output.dimensions[0]))
            assert caught.value.remedy == f"pip install '.[{output.extra}]' in a checkout of isocodec"


@pytest.mark.parametrize("what", [3, "text", b"bytes", [], [CURVES[0], 3], np.zeros((2, 2))])
def test_what_has_no_format(tmp_path: Path, what: Any) -> None:
    with pytest.raises(IsoError):
        write(tmp_path / "a.npz", what)
    assert not [*tmp_path.iterdir()]


def test_a_suffix_stands_in_one_module() -> None:
    found: dict[str, set[str]] = {}
    for path in Path(writers.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and node.value in SUFFIXES:
                found.setdefault(node.value, set()).add(path.stem)
    assert found == {suffix: {min(names)} for suffix, names in found.items()} and set(found) == set(SUFFIXES)


def test_formats_name_extras_that_exist() -> None:
    import tomllib

    project = Path(__file__).resolve().parents[1] / "pyproject.toml"
    extras = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert {output.extra for output in OUTPUTS} - {""} <= set(extras)
    assert all(bool(output.extra) == bool(output.libraries) for output in OUTPUTS)


def test_save_is_the_same_call(tmp_path: Path) -> None:
    """Files are decoded for it, but not before it is known that the format holds them."""
    isocodec.save(tmp_path / "a.gpkg", PLANE)
    assert len(geopandas.read_file(tmp_path / "a.gpkg")["isovalue"].unique()) == 2
    isocodec.save(tmp_path / "a.ply", SCATTERED)
    assert (tmp_path / "a.ply").read_bytes() == render(SCATTERED, options=OutputOptions(to=".ply"))
    for suffix in (".stl", ".nii", ".xyz"):
        with pytest.raises(OptionError, match=r"one of \.(npz|png)"):
            isocodec.save(tmp_path / f"b{suffix}", PLANE.data)
    assert not [*tmp_path.glob("b*")]
