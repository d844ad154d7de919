"""Data sets of VTK and meshes of meshio: a test for each kind, against VTK itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec import Field, Frames, Mesh
from isocodec.errors import InputError, OptionError
from libraries import Late
from tables import looped

pv, vtk, meshio = Late("pyvista"), Late("vtk"), Late("meshio")

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
AXES = np.array([0.0, 0.5, 1.5, 4.0, 4.5]), np.array([-1.0, 0.0, 2.0, 3.0]), np.array([10.0, 12.0, 17.0])


def filled(data: Any) -> Any:
    """With values at points and of cells, vectors, and a name that both have."""
    x, y, z = data.points.T
    data.point_data["p"] = (x + 2 * y + 3 * z + np.sin(x)).astype(np.float64)
    data.point_data["v"] = np.stack([x, y * y, z - 1], axis=1)
    data.cell_data["c"] = np.arange(data.n_cells, dtype=np.float32) ** 1.5
    data.cell_data["p"] = np.zeros(data.n_cells)
    return data


def grid(kind: str, flat: bool = False) -> Any:
    if kind in ("image", "turned"):
        made = pv.ImageData(dimensions=(5, 4, 1 if flat else 3), spacing=(0.5, 2, 3), origin=(10, 20, 30))
        if kind == "turned":
            made.direction_matrix = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
        else:
            made.SetExtent(2, 6, 0, 3, 1, 1 if flat else 3)
    elif kind == "rectilinear":
        made = pv.RectilinearGrid(*AXES[:2], AXES[2][:1] if flat else AXES[2])
    else:
        x, y, z = np.meshgrid(*AXES[:2], AXES[2][:1] if flat else AXES[2], indexing="ij")
        made = pv.StructuredGrid(x + 0.2 * y, y + 0.1 * x, z)
    return filled(made)


SUFFIX = {"image": "vti", "turned": "vti", "rectilinear": "vtr", "structured": "vts"}
KIND = {"vti": "ImageData", "vtr": "RectilinearGrid", "vts": "StructuredGrid", "vtu": "UnstructuredGrid",
        "vtp": "PolyData"}


def written(data: Any, form: str, suffix: str, folder: Path) -> Any:
    """A file of a form, or the object."""
    if form == "object":
        return data
    if form == "text":
        writer = getattr(vtk, f"vtkXML{KIND[suffix]}Writer")()
        writer.SetDataModeToAscii()
    elif form == "legacy":
        writer, suffix = vtk.vtkDataSetWriter(), "vtk"
        writer.SetFileTypeToBinary()
    elif form == "pieces" and suffix in ("vti", "vtr"):
        writer, suffix = getattr(vtk, f"vtkXMLP{KIND[suffix]}Writer")(), f"p{suffix}"
        writer.SetNumberOfPieces(2)
        writer.SetStartPiece(0)
        writer.SetEndPiece(1)
    else:
        data.save(folder / f"a.{suffix}")
        if form == "collection":
            (folder / "a.pvd").write_text(f'<VTKFile type="Collection"><Collection><DataSet timestep="0" part="0" '
                                          f'file="a.{suffix}"/></Collection></VTKFile>')
            return folder / "a.pvd"
        if form == "blocks":
            (folder / "a.vtm").write_text(
                '<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet><Block index="0" '
                f'name="inner"><DataSet index="0" name="one" file="a.{suffix}"/></Block></vtkMultiBlockDataSet>'
                "</VTKFile>")
            return folder / "a.vtm"
        return folder / f"a.{suffix}"
    writer.SetFileName(str(folder / f"a.{suffix}"))
    writer.SetInputData(data)
    writer.Write()
    return folder / f"a.{suffix}"


def wanted(data: Any, asked: str) -> tuple[Any, Any, int]:
    """Places and values as VTK has them, and how many samples fewer than points there are along each axis."""
    if asked == "c":
        return data.cell_centers().points, data.cell_data["c"], 1
    vector = data.point_data["v"]
    values = {"p": data.point_data["p"], "v:x": vector[:, 0], "v:y": vector[:, 1],
              "v:magnitude": np.linalg.norm(vector, axis=1)}
    return data.points, values[asked], 0


def samples(field: Field) -> tuple[Any, Any]:
    """Places and values of a field, the first axis fastest, as VTK counts."""
    shape = field.values.shape
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).astype(float)
    places = field.placement.place(index.reshape(-1, len(shape))).reshape(*shape, -1)
    return places.transpose(*reversed(range(len(shape))), -1).reshape(-1, places.shape[-1]), field.values.T.ravel()


FORMS = ["object", "xml", "text", "legacy", "pieces", "collection", "blocks"]
ASKED = ["p", "v:x", "v:y", "v:magnitude", "c"]
CELLS = [(kind, FORMS[(number + at) % 7], ASKED[(number * 2 + at) % 5], bool((number + at) % 2))
         for at, kind in enumerate(SUFFIX) for number in range(7)]
"""Forms and values in turn, so that each form meets each kind, and each value each form."""


@looped("kind, form, asked, flat", [
    each for each in CELLS if each[0] != "turned" or each[1] != "legacy"])
def test_grids(kind: str, form: str, asked: str, flat: bool, tmp_path: Path) -> None:
    data = grid(kind, flat)
    field = isocodec.read(written(data, form, SUFFIX[kind], tmp_path), key=asked)
    places, values, fewer = wanted(data, asked)
    assert field.values.shape == tuple(side - fewer for side in (5, 4, 3)[: 2 if flat else 3])
    found, numbers = samples(field)
    assert np.allclose(found, places[:, : found.shape[1]], atol=1e-6) and np.allclose(numbers, values, rtol=2e-5)
    assert found.shape[1] == 3 or f"z = {places[0, 2]:g}" in field.remarks[0]  # the third one is kept, or named


@looped("kind, normal", [(kind, normal) for kind in ("image", "rectilinear") for normal in range(3)])
def test_planes_in_space(kind: str, normal: int) -> None:
    """A picture at z = 0 lies in the plane, other slices in space; of other grids the third coordinate is named."""
    sides = [1 if axis == normal else 4 + axis for axis in range(3)]
    for z in (0, 30):
        data = pv.ImageData(dimensions=sides, spacing=(0.5, 2, 3), origin=(10, 20, z))
        data = data if kind == "image" else data.cast_to_rectilinear_grid()
        data["p"] = np.arange(data.n_points, dtype=np.int16)
        field = isocodec.read(data)
        places, values = samples(field)
        assert np.array_equal(values, data["p"]) and field.values.dtype == np.int16
        flat = kind == "rectilinear" or (normal == 2 and not z)
        assert np.allclose(places, np.delete(data.points, normal, axis=1) if flat else data.points)
        named = f"{'xyz'[normal]} =" in " ".join(field.remarks)
        assert named == (kind == "rectilinear" and bool(z or normal < 2)) and field.placement.in_space == (not flat)


def test_names_and_choices() -> None:
    """An array comes before a component of its name, wherever the vectors stand."""
    data = grid("image")
    numbers, vectors = np.array(data.point_data["p"]), {"v": np.array(data.point_data["v"])}
    arrays = {"v:x": numbers + 7, "v:magnitude": numbers + 2}
    for both in ({**arrays, **vectors}, {**vectors, **arrays}):
        data.clear_data()
        for name, array in both.items():
            data[name] = array
        for name, array in (*arrays.items(), ("v:y", vectors["v"][:, 1])):
            assert np.array_equal(isocodec.read(data, key=name).values.T.ravel(), array)
    line = pv.ImageData(dimensions=(1, 5, 1))
    line["p"] = np.arange(5.0)
    for source, key, words in ((grid("image"), None, "v:magnitude, p, c"), (grid("image"), "q", "no arrays named 'q'"),
                               (pv.Table({"a": np.ones(2)}), None, "Table"), (line, None, "1 x 5 x 1 samples")):
        with pytest.raises(InputError, match=words):
            isocodec.read(source, key=key)


@looped("asked, of, bits, gone", [
    ("p", "point", {7: 2}, [(2, 1, 0)]), ("c", "cell", {5: 32}, [(1, 1, 0)]), ("p", "cell", {0: 32}, [(0, 0, 0)]),
    ("c", "point", {0: 2}, [(0, 0, 0)]), ("p", "cell", {5: 1}, []), ("p", "cell", {0: 8}, []),
    ("p", "cell", dict.fromkeys(range(0, 24, 4), 32), [(0, j, k) for j in range(4) for k in range(3)]),
])
def test_blanked_samples(asked: str, of: str, bits: dict[int, int], gone: Any) -> None:
    """Points that are hidden or all of whose cells are; cells that are hidden or have such points."""
    data = grid("image")
    ghosts = np.zeros(data.n_points if of == "point" else data.n_cells, np.uint8)
    ghosts[[*bits]] = [*bits.values()]
    (data.point_data if of == "point" else data.cell_data)["vtkGhostType"] = ghosts
    field = isocodec.read(data, key=asked)
    assert ([] if field.mask is None else [tuple(each) for each in np.argwhere(field.mask).tolist()]) == gone
    hidden = asked == "p" and of == "cell" and bits != {0: 8}
    assert any("hidden cells are left out only where" in remark for remark in field.remarks) == hidden


# ---- meshes ---------------------------------------------------------------------------------------------------------


def mesh(kind: str) -> Any:
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    plane = pv.Plane(i_resolution=4, j_resolution=3).triangulate()
    faces = plane.faces.reshape(-1, 4)[:, 1:]
    made = {
        "hexahedra": lambda: grid("structured").cast_to_unstructured_grid(),
        "voxels": lambda: grid("image").cast_to_unstructured_grid(),
        "tetrahedra": lambda: grid("structured").triangulate(),
        "wedges": lambda: pv.UnstructuredGrid(
            np.column_stack([np.full(len(faces), 6), faces, faces + plane.n_points]), np.full(len(faces), 13),
            np.concatenate([plane.points, plane.points + [0, 0, 1]])),
        "pyramids": lambda: pv.UnstructuredGrid(
            np.ravel([[5, *side, 8] for side in ([0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                                                 [1, 5, 7, 3])]), np.full(6, 14), np.vstack([cube, [[0.5] * 3]])),
        "quads": lambda: grid("structured", True).cast_to_unstructured_grid(),
        "curved": lambda: pv.Sphere(theta_resolution=12, phi_resolution=9).cast_to_unstructured_grid(),
        "quadratic": lambda: pv.UnstructuredGrid(np.r_[10, np.arange(10)], [24], np.array([
            [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0], [0, 0, 0.5],
            [0.5, 0, 0.5], [0, 0.5, 0.5]], float)),
        "surface": lambda: pv.Sphere(theta_resolution=12, phi_resolution=9),
        "polygons": lambda: pv.PolyData(
            np.array([[0, 0, 0], [2, 0, 0], [3, 1, 0], [1.5, 2, 0], [0, 1, 0], [4, 3, 0]], float),
            np.array([5, 0, 1, 2, 3, 4, 3, 3, 2, 5])),
    }[kind]()
    return filled(made)


MESHES = ("hexahedra", "voxels", "tetrahedra", "wedges", "pyramids", "quads", "curved", "quadratic", "surface",
          "polygons")


def size_of(points: Any, cells: Any) -> float:
    """Length, area or volume."""
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    side = points[cells[:, 1:]] - points[cells[:, :1]]
    gram = np.einsum("tik,tjk->tij", side, side)
    return float((np.sqrt(np.abs(np.linalg.det(gram))) / [1, 1, 2, 6][side.shape[1]]).sum())


@looped("kind, form", [
    (kind, ["xml", "object", "text", "legacy", "collection", "blocks"][at % 6]) for at, kind in enumerate(MESHES)])
def test_meshes(kind: str, form: str, tmp_path: Path) -> None:
    """Cells fill what VTK's fill, and values are those of the points."""
    data = mesh(kind)
    source = written(data, form, "vtp" if kind in ("surface", "polygons") else "vtu", tmp_path)
    for asked in ("p", "v:x", "v:y", "v:magnitude"):
        found = isocodec.read(source, key=asked)
        assert isinstance(found, Mesh)
        places, values, _ = wanted(data, asked)
        number = [np.abs(places[:, : found.points.shape[1]] - point).sum(axis=1).argmin() for point in found.points]
        assert np.allclose(found.points, places[number][:, : found.points.shape[1]], atol=1e-6)
        assert np.allclose(found.values, values[number], rtol=1e-6, atol=1e-5)
    whole = np.abs(data.compute_cell_sizes()["Volume" if found.cells.shape[1] == 4 else "Area"]).sum()
    assert np.isclose(size_of(found.points, found.cells), whole, rtol=1e-5)
    cut = kind not in ("tetrahedra", "curved", "surface")
    assert any("are cut into t" in remark for remark in found.remarks) == cut
    if found.cells.shape[1] == 4:  # cells that meet do so in whole faces
        faces = np.sort(np.concatenate([np.delete(found.cells, i, axis=1) for i in range(4)]), axis=1)
        single, count = np.unique(faces, axis=0, return_counts=True)
        area = data.extract_surface(algorithm=None).area
        assert np.isclose(size_of(found.points, single[count == 1]), area, rtol=1e-5) or kind == "quadratic"


def test_values_of_meshes() -> None:
    """Those of a key, else the only ones, those named z, or none; averages of cells."""
    data = mesh("tetrahedra")
    found = isocodec.read(data, key="c")
    assert np.allclose(found.values, data.cell_data_to_point_data()["c"]) and "averaged at points" in found.remarks[0]
    assert isocodec.read(data).values is None
    data["z"] = np.arange(data.n_points, dtype=np.float32)
    assert np.array_equal(isocodec.read(data).values, data["z"])
    data.clear_data()
    assert isocodec.read(data).values is None and np.array_equal(isocodec.read(data, key="x").values, data.points[:, 0])
    data["q"] = np.arange(data.n_points, dtype=np.int32)
    assert isocodec.read(data).values.dtype == np.int32
    with pytest.raises(InputError, match="'none': x, y, z, q"):
        isocodec.read(data, key="none")


def test_scattered_points_and_sheets(tmp_path: Path) -> None:
    """Points have their heights, or the only values; a curved sheet is a mesh."""
    points = np.array([[0, 0, 5], [4, 0, 6], [0, 3, 7], [5, 4, 8.0]])
    data = pv.PolyData(points)
    for right in (points[:, 2], np.arange(4.0)):
        found = isocodec.read(data)
        assert found.cells is None and np.array_equal(found.points, points[:, :2])
        assert np.array_equal(found.values, right) and np.array_equal(isocodec.read(data, key="z").values, points[:, 2])
        data["q"] = np.arange(4.0)
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    sheet = filled(pv.StructuredGrid(x, y, 0.1 * x * y))
    sheet.save(tmp_path / "a.vts")
    for source in (sheet, tmp_path / "a.vts"):
        assert isocodec.read(source, key="p").cells.shape == (24, 3)


@looped("suffix", ["object", "vtp", "vtu", "stl", "obj", "ply"])
def test_flat_meshes_keep_their_height(tmp_path: Path, suffix: str) -> None:
    """At z = 0 they lie in the plane, others in space."""
    data = pv.Plane(i_resolution=3, j_resolution=2).triangulate()
    data.clear_data()
    for height in (0.0, 5.0):
        data.points[:, 2] = height
        source: Any = data
        if suffix != "object":
            source = tmp_path / f"a.{suffix}"
            (data.cast_to_unstructured_grid() if suffix == "vtu" else data).save(source)
        found = isocodec.read(source)
        assert found.points.shape[1] == (3 if height else 2) and len(found.cells) == 12 and found.values is None
        assert height == 0 or (found.points[:, 2] == height).all()
        assert np.isclose(size_of(found.points, found.cells), 1)


def test_cells_that_are_left_out_or_refused() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    data = pv.UnstructuredGrid(np.array([3, 0, 1, 2, 3, 0, 2, 3, 2, 0, 1, 1, 3]), [5, 5, 3, 1], points)
    data["q"] = np.arange(4.0)
    found = isocodec.read(data)
    assert np.array_equal(found.cells, [[0, 1, 2], [0, 2, 3]]) and "2 cells of lower dimension" in found.remarks[0]
    faces = [4, 0, 1, 3, 2, 4, 4, 5, 7, 6, 4, 0, 1, 5, 4, 4, 2, 3, 7, 6, 4, 0, 2, 6, 4, 4, 1, 3, 7, 5]
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    solid = pv.UnstructuredGrid([31, 6, *faces], [42], cube)
    for source, words in ((solid, "POLYHEDRON"), (pv.Line(), "no triangles")):
        with pytest.raises(InputError, match=words):
            isocodec.read(source)


def test_seams_of_values() -> None:
    """Points that coincide are one, unless their values differ."""
    data = pv.PolyData(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]),
                       np.array([3, 0, 1, 2, 3, 3, 5, 4]))
    data["same"], data["other"] = data.points[:, 0].copy(), np.arange(6.0)
    for key, count in (("same", 4), ("other", 6)):
        found = isocodec.read(data, key=key)
        assert len(found.points) == count and any("not joined" in each for each in found.remarks) == (count == 6)


def test_pieces_are_joined(tmp_path: Path) -> None:
    """Points where pieces meet are one point, so that contours go on there; cells of other pieces are left out."""
    data, pieces = mesh("tetrahedra"), []
    for number in (0, 1):
        piece = data.extract_cells(np.arange(number, data.n_cells, 2))
        piece.save(tmp_path / f"a{number}.vtu")
        pieces.append(f'<Piece Source="a{number}.vtu"/>')
    (tmp_path / "a.pvtu").write_text(
        '<VTKFile type="PUnstructuredGrid" version="0.1"><PUnstructuredGrid GhostLevel="0"><PPointData><PDataArray '
        'type="Float64" Name="p"/></PPointData><PPoints><PDataArray type="Float32" Name="Points" NumberOfComponents='
        f'"3"/></PPoints>{"".join(pieces)}</PUnstructuredGrid></VTKFile>')
    found = isocodec.read(tmp_path / "a.pvtu", key="p")
    assert len(found.points) == data.n_points and len(found.cells) == data.n_cells
    ghosts = np.zeros(data.n_cells, np.uint8)
    ghosts[3] = 1
    data.cell_data["vtkGhostType"] = ghosts
    assert len(isocodec.read(data, key="p").cells) == data.n_cells - 1


# ---- times and blocks -----------------------------------------------------------------------------------------------


def in_time(make: Callable[[], Any], suffix: str, folder: Path, times: tuple[float, ...], move: float = 0) -> Path:
    lines = []
    for number, time in enumerate(times):
        data = make()
        data.point_data["p"] = data.point_data["p"] + 100 * number
        if move:
            data.points += move * number
        data.save(folder / f"t{number}.{suffix}")
        lines.append(f'<DataSet timestep="{time}" part="0" file="t{number}.{suffix}"/>')
    (folder / "t.pvd").write_text('<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>'
                                  + "".join(reversed(lines)) + "</Collection></VTKFile>")
    return folder / "t.pvd"


@looped("times", [(0, 0.5, 1), (3, 5, 7), (0, 0.5, 10)])
def test_times(tmp_path: Path, times: Any) -> None:
    """Of a grid they are a series, of a mesh that stays values."""
    data, path = grid("image"), in_time(lambda: grid("image"), "vti", tmp_path, times)
    series = isocodec.read(path, key="p", frames=True)
    assert isinstance(series, Frames) and len(series.fields) == 3
    for number, field in enumerate(series.fields):
        places, values = samples(field)
        assert np.allclose(values, data.point_data["p"] + 100 * number) and np.allclose(places, data.points)
        assert np.array_equal(isocodec.read(path, key="p", frame=number).values, field.values)
    assert tuple(series.times) == times and not series.fields.remarks
    for choice, error in (({"frame": 3}, "no frame 3"), ({}, "series of 3")):
        with pytest.raises((InputError, OptionError), match=error):
            isocodec.read(path, key="p", **choice)
    path = in_time(lambda: mesh("tetrahedra"), "vtu", tmp_path, times)
    found = isocodec.read(path, key="p")
    assert found.values.shape == (3, len(found.points)) and tuple(found.times) == times
    assert isocodec.open(isocodec.encode(found, 150.5)).times.tolist() == list(times)
    assert np.allclose(found.values[2] - found.values[0], 200)
    assert np.array_equal(isocodec.read(path, key="p", frame=1).values, found.values[1])
    moving = in_time(lambda: mesh("tetrahedra"), "vtu", tmp_path, times, move=1.0)
    with pytest.raises(InputError, match="changes in time"):
        isocodec.read(moving, key="p")
    assert np.array_equal(isocodec.read(moving, key="p", frame=1).values, found.values[1])


def test_blocks(tmp_path: Path) -> None:
    parts = pv.MultiBlock({"grid": grid("image"), "mesh": mesh("tetrahedra"),
                           "deep": pv.MultiBlock({"flat": grid("rectilinear", True)}), "none": None})
    parts.save(tmp_path / "a.vtm")
    for source in (parts, tmp_path / "a.vtm"):
        assert isocodec.read(source, key="grid/p").values.shape == (5, 4, 3)
        assert isocodec.read(source, key="grid/v:magnitude").values.shape == (5, 4, 3)
        assert isocodec.read(source, key="deep/flat/c").values.shape == (4, 3)
        assert np.allclose(isocodec.read(source, key="mesh/p").values, mesh("tetrahedra").point_data["p"])
        with pytest.raises(InputError, match="3 blocks: grid, mesh, deep/flat"):
            isocodec.read(source)


# ---- XDMF and meshio ------------------------------------------------------------------------------------------------


def xdmf(item: str = "", time: str = '<Time Value="0"/>') -> str:
    numbers = " ".join(map(str, range(12)))
    return (
        '<?xml version="1.0"?><Xdmf Version="3.0"><Domain><Grid Name="g" GridType="Uniform">' + time + '<Topology '
        'TopologyType="2DRectMesh" Dimensions="4 3"/><Geometry GeometryType="VXVY"><DataItem Dimensions="3" '
        'Format="XML">0 1 3</DataItem><DataItem Dimensions="4" Format="XML">5 6 7 9</DataItem></Geometry><Attribute '
        'Name="p" Center="Node">' + (item or f'<DataItem Dimensions="4 3" Format="XML">{numbers}</DataItem>')
        + "</Attribute></Grid></Domain></Xdmf>"
    )


@looped("form", ["XML", "HDF", "Binary"])
def test_xdmf_of_a_grid(tmp_path: Path, form: str) -> None:
    numbers, item = np.arange(12.0).reshape(4, 3), ""
    if form != "XML":
        import h5py

        with h5py.File(tmp_path / "s.h5", "w") as file:
            file["p"] = numbers
        numbers.tofile(tmp_path / "s.bin")
        item = (f'<DataItem Dimensions="4 3" NumberType="Float" Precision="8" Format="{form}">'
                f'{"s.h5:/p" if form == "HDF" else "s.bin"}</DataItem>')
    (tmp_path / "a.xdmf").write_text(xdmf(item))
    assert np.array_equal(isocodec.read(tmp_path / "a.xdmf").values, numbers.T)
    (tmp_path / "b.xdmf").write_text(xdmf(item, ""))
    with pytest.raises(InputError, match="need a Time"):
        isocodec.read(tmp_path / "b.xdmf")


def test_xdmf_with_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a series meshio writes its bare mesh: the only values are taken."""
    monkeypatch.chdir(tmp_path)  # where meshio writes the samples
    points, cells = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0], [5, 4, 0.0]]), np.array([[0, 1, 2], [1, 3, 2]])
    import meshio.xdmf

    with meshio.xdmf.TimeSeriesWriter(tmp_path / "a.xdmf") as series:
        series.write_points_cells(points, [("triangle", cells)])
        for time in (0.0, 1.5, 3.0):
            series.write_data(time, point_data={"depth": points[:, 0] + time})
    for key in (None, "depth", "TimeSeries_meshio", "TimeSeries_meshio/depth"):
        found = isocodec.read(tmp_path / "a.xdmf", key=key)
        assert np.array_equal(found.values, points[:, 0] + np.array([[0], [1.5], [3]]))
        assert np.array_equal(found.cells, cells) and tuple(found.times) == (0, 1.5, 3)
    (tmp_path / "a.h5").unlink()
    with pytest.raises(FileNotFoundError):  # VTK would crash
        isocodec.read(tmp_path / "a.xdmf")


@looped("suffix", ["msh", "ply", "vtu", "xdmf", "inp", "mesh", "bdf", "med"])
def test_formats_of_meshio(tmp_path: Path, suffix: str) -> None:
    points, cells = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0], [5, 4, 0.0]]), np.array([[0, 1, 2], [1, 3, 2]])
    values = {"depth": np.arange(4) / 8} if suffix in ("msh", "ply", "vtu", "xdmf") else {}
    meshio.Mesh(points, [("triangle", cells)], point_data=values).write(
        tmp_path / f"a.{suffix}", file_format={"msh": "gmsh", "inp": "abaqus"}.get(suffix))
    found = isocodec.read(tmp_path / f"a.{suffix}", key="depth" if values else None)
    assert np.allclose(found.points, points[:, :2]) and np.array_equal(found.cells, cells)
    assert not values or np.allclose(found.values, values["depth"])


def test_meshes_of_meshio_in_memory() -> None:
    made = meshio.Mesh(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), [("quad", np.array([[0, 1, 2, 3]]))],
                       point_data={"u": np.arange(8.0).reshape(4, 2)})
    found = isocodec.read(made, key="u:y")
    assert len(found.cells) == 2 and np.array_equal(found.values, [1, 3, 5, 7])


@looped("suffix", ["msh", "ply", "obj", "stl", "inp"])
def test_meshio_does_not_end_the_program(tmp_path: Path, suffix: str, capfd: Any) -> None:
    (tmp_path / f"a.{suffix}").write_bytes(b"nothing of the kind\n" * 9)
    with pytest.raises(InputError):
        isocodec.read(tmp_path / f"a.{suffix}")
    assert not capfd.readouterr().out


@looped("kind, form", [
    ("vti", "xml"), ("vti", "legacy"), ("vts", "text"), ("vtu", "xml"), ("vtu", "legacy"), ("vti", "blocks"),
    ("vti", "collection"), ("vti", "pieces"),
])
def test_damaged_files(kind: str, form: str, tmp_path: Path, capfd: Any) -> None:
    """A file that is cut short is refused, or has the values that the whole one has; VTK would give zeros."""
    data = grid({"vti": "image", "vts": "structured"}[kind]) if kind != "vtu" else mesh("tetrahedra")
    source = written(data, form, kind, tmp_path)
    whole = isocodec.read(source, key="p").values
    victim = max(tmp_path.iterdir(), key=lambda path: path.stat().st_size)
    content = victim.read_bytes()
    for size in (0, len(content) // 3, len(content) // 2, len(content) * 9 // 10):
        victim.write_bytes(content[:size])
        try:
            found = isocodec.read(source, key="p").values
        except InputError as error:
            assert "0x" not in str(error)
            continue
        assert np.array_equal(found, whole), size
    assert "ERR" not in capfd.readouterr().err
