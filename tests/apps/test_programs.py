"""Files in the programs that open them: each point of each feature is the one that the library decodes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import PLUGINS, command, found, installed, program, run
from served import served

import isocodec
from home import ROOT
from isocodec import Field, Frames

pytestmark = pytest.mark.apps

MATRIX = [[0.0, 10.0, 500_000.0], [-10.0, 0.0, 4_000_000.0]]
"""A placement: y falls along axis 0, x rises along axis 1."""
SPACE = [[2.0, 0, 0, 5], [0, 3.0, 0, 6], [0, 0, 4.0, 7]]
LAYERS = {"map": "lines", "surface": "triangles", "series": "lines", "labels": "lines", "areas": "areas",
          "tiles": "lines", "overview": "overview"}
"""Layer of GDAL that is compared, of each file."""
WITHOUT_SHAPELY = {key: layer for key, layer in LAYERS.items() if layer != "areas"}
"""Those of Debian's Python, whose shapely is older than 2.1."""


def waves(*sizes: int) -> np.ndarray:
    at = np.meshgrid(*(np.arange(size) for size in sizes), indexing="ij")
    return np.asarray(sum(np.sin(x / (3.0 + i)) for i, x in enumerate(at)) + 0.01 * at[0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of each kind, and what programs make files of."""
    home = tmp_path_factory.mktemp("files")
    labels = np.zeros((40, 50), np.int16)
    labels[5:20, 5:30], labels[15:35, 25:45] = 3, 7
    made = {
        "map": isocodec.encode(Field(waves(60, 80), placement=MATRIX), np.linspace(-1.5, 2.0, 40).tolist()),
        "surface": isocodec.encode(Field(waves(12, 13, 14), placement=SPACE), [0.5, 1.0]),
        "series": isocodec.encode(Frames([waves(30, 40) + shift for shift in (0.0, 0.2, 0.4)], times=[0, 1.5, 4]),
                                  [0.25, 1.0]),
        "labels": isocodec.encode(Field(labels, labels="all", placement=MATRIX, notes={"label 3": "lake"})),
        "moving": isocodec.encode(Frames([waves(12, 13, 14), waves(12, 13, 14) + 0.3], times=[1.0, 2.5]), 0.5),
    }
    for name, data in made.items():
        (home / f"{name}.iso").write_bytes(data)
    isocodec.save(home / "tiles.iso", Field(waves(300, 300), placement=MATRIX), [0.25, 1.0], tile=64)
    (home / "areas.iso").write_bytes(made["labels"])
    (home / "overview.iso").write_bytes((home / "tiles.iso").read_bytes())
    np.save(home / "image.npy", waves(12, 13, 14))
    np.save(home / "labels.npy", labels)
    return home


@pytest.fixture(scope="module")
def put(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return installed(tmp_path_factory.mktemp("home"))


def features(path: Path, layer: str) -> Iterator[tuple[float, int, np.ndarray]]:
    """Isovalue, frame and points of each feature of a layer, as the library decodes them."""
    file: Any = isocodec.open(path)
    for frame, contours in enumerate(file.each_tile() if layer == "overview" else file.each_frame()):
        for contour in contours:
            if layer == "lines" or layer == "overview":
                shapes = [contour.placed[walk] for walk in contour.walks]
            elif layer == "triangles":
                shapes = [contour.placed[contour.placed_cells[:, [0, 1, 2, 0]]].reshape(-1, 3)]
            else:
                shapes = [np.concatenate([ring for each in contour.areas()["coordinates"] for ring in each])]
            for shape in shapes:
                yield contour.isovalue, 0 if layer == "overview" else frame, shape


def assert_all_there(arrays: dict[str, np.ndarray], folder: Path, layers: dict[str, str]) -> None:
    """Each layer's features, one by one: as many points, at the same coordinates."""
    for key, layer in layers.items():
        wanted = [*features(folder / f"{key}.iso", layer)]
        points = np.concatenate([np.pad(each, ((0, 0), (0, 3 - each.shape[1]))) for _, _, each in wanted])
        assert arrays[f"{key} counts"].tolist() == [len(each) for _, _, each in wanted], key
        assert np.array_equal(np.nan_to_num(arrays[f"{key} points"]), points), key
        assert arrays[f"{key} values"].tolist() == [value for value, _, _ in wanted], key
        if f"{key} frames" in arrays:
            assert arrays[f"{key} frames"].tolist() == [frame for _, frame, _ in wanted], key


def layers_by(folder: Path, url: str, layers: dict[str, str]) -> dict[str, tuple[str, str]]:
    """Where GDAL finds each layer: tiles by URL."""
    return {key: (f"/vsicurl/{url}/{key}.iso" if key in ("tiles", "overview") else str(folder / f"{key}.iso"), layer)
            for key, layer in layers.items()}


def test_geopandas(folder: Path, tmp_path: Path) -> None:
    with served(folder) as server:
        asked = {"layers": layers_by(folder, server.url, LAYERS)}
        code = ":".join(str(ROOT / name) for name in ("codec", "spec"))
        assert_all_there(found("geopandas", "in_geopandas.py", asked, Path(code), tmp_path), folder, LAYERS)


def test_ogr2ogr(folder: Path, put: tuple[Path, Path], tmp_path: Path) -> None:
    """What it writes into a GeoPackage; `ogrinfo` counts the same."""
    with served(folder) as server:
        for key, (path, layer) in layers_by(folder, server.url, WITHOUT_SHAPELY).items():
            run([program("ogr2ogr"), str(tmp_path / f"{key}.gpkg"), path, layer], put[1])
            seen = run([program("ogrinfo"), "-so", path, layer], put[1])
            assert f"Feature Count: {len([*features(folder / f'{key}.iso', layer)])}\n" in seen
    asked = {"layers": {key: (str(tmp_path / f"{key}.gpkg"), layer) for key, layer in WITHOUT_SHAPELY.items()}}
    assert_all_there(found("geopandas", "in_geopandas.py", asked, Path(), tmp_path), folder, WITHOUT_SHAPELY)


def test_qgis(folder: Path, put: tuple[Path, Path], tmp_path: Path) -> None:
    """Layers, and contours of a raster by the toolbox."""
    import rasterio

    heights = waves(60, 80).astype(np.float32)
    with rasterio.open(tmp_path / "dem.tif", "w", driver="GTiff", height=60, width=80, count=1, dtype="float32",
                       crs="EPSG:32631", transform=rasterio.transform.from_origin(499_995, 4_000_005, 10, 10)) as dem:
        dem.write(heights, 1)
    contours = {"INPUT": str(tmp_path / "dem.tif"), "ISOVALUES": "0.25,1", "PRECISION": "2m",
                "OUTPUT": str(tmp_path / "made.iso")}
    nouns = {key: isocodec.open(folder / f"{key}.iso").info.noun for key in WITHOUT_SHAPELY}
    with served(folder) as server:
        asked = {"layers": layers_by(folder, server.url, WITHOUT_SHAPELY), "nouns": nouns, "plugins": str(put[0]),
                 "contours": contours}
        assert_all_there(found("qgis", "in_qgis.py", asked, put[1], tmp_path), folder, WITHOUT_SHAPELY)
    field = Field(heights, placement=MATRIX, crs="EPSG:32631")
    assert (tmp_path / "made.iso").read_bytes() == isocodec.encode(field, [0.25, 1.0], precision="2m")


def test_paraview(folder: Path, put: tuple[Path, Path], tmp_path: Path) -> None:
    """Lines and triangles of each time step, fewer layers, and the isosurface of an image."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    image = vtk.vtkImageData()
    image.SetDimensions(12, 13, 14)
    image.SetSpacing(2, 3, 4)
    image.SetOrigin(5, 6, 7)
    image.GetPointData().SetScalars(numpy_to_vtk(waves(12, 13, 14).ravel(order="F"), deep=True))
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(tmp_path / "image.vti"))
    writer.SetInputData(image)
    writer.Write()
    names = ["map", "surface", "series", "moving", "labels"]
    asked = {
        "plugin": str(PLUGINS / "paraview_iso.py"),
        "files": {**{name: (str(folder / f"{name}.iso"), 0) for name in names},
                  "coarse": (str(folder / "surface.iso"), 3)},
        "images": [(str(tmp_path / "image.vti"), str(tmp_path / "made.iso"), 0.5)],
    }
    arrays = found("paraview", "in_paraview.py", asked, put[1], tmp_path)
    for name in [*names, "coarse"]:
        file = isocodec.open(asked["files"][name][0])
        times = [0.0] if file.times is None else file.times.tolist()
        assert arrays[f"{name} times"].tolist() == times
        for frame in range(len(times)):
            contours = file.contours(layers=3) if name == "coarse" else file.contours(frame=frame)
            if contours[0].n == 3:
                shapes = [(each.isovalue, each.placed[cell]) for each in contours for cell in each.placed_cells]
            else:
                shapes = [(each.isovalue, each.placed[walk]) for each in contours for walk in each.walks]
            points = np.concatenate([np.pad(each, ((0, 0), (0, 3 - each.shape[1]))) for _, each in shapes])
            assert arrays[f"{name} {frame} counts"].tolist() == [len(each) for _, each in shapes], name
            assert np.array_equal(arrays[f"{name} {frame} points"], points), name
            assert arrays[f"{name} {frame} values"].tolist() == [value for value, _ in shapes], name
    assert (tmp_path / "made.iso").read_bytes() == isocodec.encode(Field(waves(12, 13, 14), placement=SPACE), 0.5)


def test_blender(folder: Path, put: tuple[Path, Path], tmp_path: Path) -> None:
    """Meshes of each isovalue, frame and layer; at each frame, its own alone are shown."""
    names = ["map", "surface", "series", "moving", "labels"]
    asked = {"plugin": str(PLUGINS / "blender_iso.py"),
             "files": {**{name: (str(folder / f"{name}.iso"), False) for name in names},
                       "detail": (str(folder / "surface.iso"), True)}}
    arrays = found("blender", "in_blender.py", asked, put[1], tmp_path, HOME=str(tmp_path))
    for name in [*names, "detail"]:
        file = isocodec.open(asked["files"][name][0])
        frames = [*file.each_frame()]
        contours = [contour for each in frames for contour in each]
        if name == "detail":
            layers = len(file.info.layers) // 2
            contours += [each for k in range(1, layers) for each in file.contours(layers=k) if len(each.points)]
        for number, contour in enumerate(contours):
            points = np.pad(contour.placed, ((0, 0), (0, 3 - contour.n))).astype(np.float32)
            assert np.array_equal(arrays[f"{name} {number} points"], points), name
            cells = arrays[f"{name} {number} cells"]
            assert np.array_equal(cells, contour.placed_cells), name
            assert arrays[f"{name} {number} value"] == contour.isovalue
        assert f"{name} {len(contours)} points" not in arrays
        assert arrays[f"{name} seen"].tolist() == [*range(len(frames[0]))]
        if len(frames) > 1:
            named = [f"{file.info.caption(one.isovalue)}, frame {k}" for k, each in enumerate(frames) for one in each]
            assert arrays[f"{name} names"].tolist() == named
            assert arrays[f"{name} frames"].tolist() == [1, len(frames)]
            for frame in range(len(frames)):
                own = np.arange(len(frames[0])) + frame * len(frames[0])
                assert arrays[f"{name} shown {frame + 1}"].tolist() == own.tolist()
    assert arrays["detail shown 1"].tolist() == [0, 1]


def test_napari(folder: Path, tmp_path: Path) -> None:
    """Layers of a viewer, and files of what it shows."""
    names = ["map", "surface", "series", "moving", "labels"]
    written = [[str(folder / "image.npy"), str(tmp_path / "image.iso"), "image"],
               [str(folder / "labels.npy"), str(tmp_path / "labels.iso"), "labels"]]
    asked = {"files": {name: str(folder / f"{name}.iso") for name in names}, "written": written}
    arrays = found("napari", "in_napari.py", asked, Path(), tmp_path, HOME=str(tmp_path))
    for name in names:
        file = isocodec.open(folder / f"{name}.iso")
        frames = [*file.each_frame()]
        if name == "labels":
            assert np.array_equal(arrays["labels 0 0"], file.labels()) and "labels 0 Labels" in arrays
            continue
        for number in range(len(file.isovalues)):
            each = [contours[number] for contours in frames]
            if each[0].n == 2:
                shapes = [(frame, line) for frame, contour in enumerate(each) for line in contour.lines]
                assert f"{name} {number} Shapes" in arrays and f"{name} {number} {len(shapes)}" not in arrays
                for place, (frame, line) in enumerate(shapes):
                    wanted = np.insert(line, 0, frame, axis=1) if len(frames) > 1 else line
                    shown = arrays[f"{name} {number} {place}"]
                    assert shown.dtype == np.float32 and np.array_equal(shown, wanted.astype(np.float32)), name
                continue
            assert f"{name} {number} Surface" in arrays
            points = [np.insert(one.points, 0, k, axis=1) if len(frames) > 1 else one.points
                      for k, one in enumerate(each)]
            first = np.cumsum([0, *map(len, points)])
            cells = np.concatenate([one.cells + start for one, start in zip(each, first, strict=False)])
            assert np.array_equal(arrays[f"{name} {number} 0"], np.concatenate(points))
            assert np.array_equal(arrays[f"{name} {number} 1"], cells)
        assert f"{name} {len(file.isovalues)} 0" not in arrays
    made = isocodec.open(tmp_path / "image.iso")
    assert made.placement is not None
    contour = made.contour()
    assert np.array_equal(contour.points, isocodec.decode(isocodec.encode(np.load(folder / "image.npy"), 0.5)).points)
    assert np.allclose(made.placement.place(arrays["image corners"]), arrays["image places"][:, ::-1], rtol=1e-12)
    assert np.array_equal(isocodec.open(tmp_path / "labels.iso").labels(), np.load(folder / "labels.npy"))


def test_a_program_that_is_missing_fails_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("programs.SYSTEM", "")
    with pytest.raises(pytest.fail.Exception, match="apt-get install blender"):
        command("blender", json.dumps({}))
