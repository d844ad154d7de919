"""Files and objects of VTK against VTK itself: format x {points, cells, vectors, times, blocks, coordinates}."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import vtk
from isocodec.io.readers.input_formats import read_mesh

import isocodec
from isocodec import Field, Frames, Mesh
from isocodec.errors import InputError, LimitError, OptionError

# ---- made by VTK ----------------------------------------------------------------------------------------------------

AXES = np.array([0.0, 0.5, 1.5, 4.0, 4.5]), np.array([-1.0, 0.0, 2.0, 3.0]), np.array([10.0, 12.0, 17.0])


def filled(data: Any) -> Any:
    """With values at points and of cells, vectors, and a name that both have."""
    x, y, z = data.points.T
    data.point_data["p"] = (x + 2 * y + 3 * z + np.sin(x)).astype(np.float64)
    data.point_data["v"] = np.stack([x, y * y, z - 1], axis=1)
    data.cell_data["c"] = np.arange(data.n_cells, dtype=np.float32) ** 1.5
    data.cell_data["p"] = np.zeros(data.n_cells)
    return data


def image(flat: bool = False) -> Any:
    made = pv.ImageData(dimensions=(5, 4, 1 if flat else 3), spacing=(0.5, 2, 3), origin=(10, 20, 30))
    made.SetExtent(2, 6, 0, 3, 1, 1 if flat else 3)
    return filled(made)


def turned(flat: bool = False) -> Any:
    made = pv.ImageData(dimensions=(5, 4, 1 if flat else 3), spacing=(0.5, 2, 3), origin=(10, 20, 30))
    made.direction_matrix = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
    return filled(made)


def rectilinear(flat: bool = False) -> Any:
    return filled(pv.RectilinearGrid(*AXES[:2], AXES[2][:1] if flat else AXES[2]))


def structured(flat: bool = False) -> Any:
    x, y, z = np.meshgrid(*AXES[:2], AXES[2][:1] if flat else AXES[2], indexing="ij")
    return filled(pv.StructuredGrid(x + 0.2 * y, y + 0.1 * x, z))


GRIDS = {"image": image, "turned": turned, "rectilinear": rectilinear, "structured": structured}
SUFFIX = {"image": "vti", "turned": "vti", "rectilinear": "vtr", "structured": "vts"}
KIND = {"vti": "ImageData", "vtr": "RectilinearGrid", "vts": "StructuredGrid", "vtu": "UnstructuredGrid",
        "vtp": "PolyData"}


def of_itself(data: Any, suffix: str, folder: Path) -> Any:
    return data


def as_xml(data: Any, suffix: str, folder: Path) -> Any:
    data.save(folder / f"a.{suffix}")
    return folder / f"a.{suffix}"


def as_text(data: Any, suffix: str, folder: Path) -> Any:
    writer = getattr(vtk, f"vtkXML{KIND[suffix]}Writer")()
    writer.SetFileName(str(folder / f"t.{suffix}"))
    writer.SetInputData(data)
    writer.SetDataModeToAscii()
    writer.Write()
    return folder / f"t.{suffix}"


def as_legacy(data: Any, suffix: str, folder: Path) -> Any:
    writer = vtk.vtkDataSetWriter()
    writer.SetFileName(str(folder / "a.vtk"))
    writer.SetInputData(data)
    writer.SetFileTypeToBinary()
    writer.Write()
    return folder / "a.vtk"


def as_pieces(data: Any, suffix: str, folder: Path) -> Any:
    if suffix in ("vtu", "vtp"):
        return parted(data, suffix, folder)
    writer = getattr(vtk, f"vtkXMLP{KIND[suffix]}Writer")()
    writer.SetFileName(str(folder / f"a.p{suffix}"))
    writer.SetInputData(data)
    writer.SetNumberOfPieces(2)
    writer.SetStartPiece(0)
    writer.SetEndPiece(1)
    writer.SetGhostLevel(0)
    writer.Write()
    return folder / f"a.p{suffix}"


def parted(data: Any, suffix: str, folder: Path) -> Any:
    """Every other cell in one piece; values of both ends are the same where pieces meet."""
    pieces = []
    for number in (0, 1):
        piece = data.extract_cells(np.arange(number, data.n_cells, 2))
        piece = piece.extract_surface(algorithm=None) if suffix == "vtp" else piece
        piece.save(folder / f"a{number}.{suffix}")
        pieces.append(f'<Piece Source="a{number}.{suffix}"/>')
    arrays = '<PDataArray type="Float64" Name="p"/><PDataArray type="Float64" Name="v" NumberOfComponents="3"/>'
    kind = KIND[suffix]
    (folder / f"a.p{suffix}").write_text(
        f'<VTKFile type="P{kind}" version="0.1"><P{kind} GhostLevel="0"><PPointData>{arrays}</PPointData><PCellData>'
        '<PDataArray type="Float32" Name="c"/></PCellData><PPoints><PDataArray type="Float32" Name="Points" '
        f'NumberOfComponents="3"/></PPoints>{"".join(pieces)}</P{kind}></VTKFile>'
    )
    return folder / f"a.p{suffix}"


def as_collection(data: Any, suffix: str, folder: Path) -> Any:
    as_xml(data, suffix, folder)
    (folder / "a.pvd").write_text(
        f'<VTKFile type="Collection"><Collection><DataSet timestep="0" part="0" file="a.{suffix}"/></Collection>'
        "</VTKFile>"
    )
    return folder / "a.pvd"


def as_blocks(data: Any, suffix: str, folder: Path) -> Any:
    as_xml(data, suffix, folder)
    (folder / "a.vtm").write_text(
        '<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet><Block index="0" name="inner">'
        f'<DataSet index="0" name="one" file="a.{suffix}"/></Block></vtkMultiBlockDataSet></VTKFile>'
    )
    return folder / "a.vtm"


def as_xdmf(data: Any, suffix: str, folder: Path) -> Any:
    from vtkmodules.vtkIOXdmf2 import vtkXdmfWriter

    writer = vtkXdmfWriter()
    writer.SetFileName(str(folder / "a.xdmf"))
    writer.SetHeavyDataFileName(str(folder / "a.h5"))
    writer.SetInputData(data)
    writer.Write()
    return folder / "a.xdmf"


FORMS: dict[str, Callable[[Any, str, Path], Any]] = {
    name.removeprefix("as_"): form for name, form in globals().items() if name.startswith("as_")
}
FORMS["object"] = of_itself
ASKED = ("p", "v:x", "v:1", "v:magnitude", "c", "averaged")


def wanted(data: Any, asked: str) -> tuple[np.ndarray, np.ndarray, int]:
    """Places and values as VTK has them, and how many samples fewer than points there are along each axis."""
    if asked == "c":
        return data.cell_centers().points, data.cell_data["c"], 1
    if asked == "averaged":
        return data.points, data.cell_data_to_point_data()["c"], 0
    vector = data.point_data["v"]
    values = {"p": data.point_data["p"], "v:x": vector[:, 0], "v:1": vector[:, 1],
              "v:magnitude": np.linalg.norm(vector, axis=1)}
    return data.points, values[asked], 0


def samples(field: Field) -> tuple[np.ndarray, np.ndarray]:
    """Places and values of a field, the first axis fastest, as VTK counts."""
    shape = field.values.shape
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).astype(float)
    places = field.placement.place(index.reshape(-1, len(shape))).reshape(*shape, -1)
    order = (*reversed(range(len(shape))), len(shape))
    return places.transpose(order).reshape(-1, places.shape[-1]), field.values.T.ravel()


@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("flat", [False, True], ids=["space", "plane"])
def test_grids(grid: str, form: str, asked: str, flat: bool, tmp_path: Path) -> None:
    data = GRIDS[grid](flat)
    if grid == "turned" and form in ("legacy", "xdmf"):
        pytest.skip("the format has no directions")
    if form == "xdmf" and (flat or asked.startswith("v")):
        pytest.skip("its writer makes no vectors and no planes; see below")
    source = FORMS[form](data, SUFFIX[grid], tmp_path)
    field = isocodec.read(source, key=asked.replace("averaged", "c"), average_cells=asked == "averaged")
    places, values, fewer = wanted(data, asked)
    n = 2 if flat else 3
    assert field.values.shape == tuple(side - fewer for side in (5, 4, 3)[:n])
    if grid == "image" and form == "xdmf":
        places = places - places[0]  # its writer forgets where the extent begins
    found, numbers = samples(field)
    if grid == "image" and form == "xdmf":
        found = found - found[0]
    assert np.allclose(found, places[:, : found.shape[1]], atol=1e-6) and np.allclose(numbers, values, rtol=2e-5)


@pytest.mark.parametrize("last", [False, True])
def test_an_array_named_as_a_component(last: bool) -> None:
    """It comes before the component, wherever the vectors stand."""
    data = image()
    numbers, vectors = np.array(data.point_data["p"]), {"v": np.array(data.point_data["v"])}
    arrays = {"v:x": numbers + 7, "v:magnitude": numbers + 2}
    data.clear_data()
    for name, array in ({**arrays, **vectors} if last else {**vectors, **arrays}).items():
        data[name] = array
    for name, array in (*arrays.items(), ("v:y", vectors["v"][:, 1])):
        assert np.array_equal(isocodec.read(data, key=name).values.T.ravel(), array)


def test_a_collection_with_a_folder_of_its_name(tmp_path: Path) -> None:
    """As PyVista and ParaView write it; a link in its place is not followed."""
    data = image()
    pv.MultiBlock({"one": data}).save(tmp_path / "b.vtm")
    assert np.array_equal(isocodec.read(tmp_path / "b.vtm", key="p").values, isocodec.read(data, key="p").values)
    (tmp_path / "b").rename(tmp_path / "c")
    (tmp_path / "b").symlink_to("c")
    with pytest.raises(InputError, match="links to another directory"):
        isocodec.read(tmp_path / "b.vtm", key="p")


# ---- meshes ---------------------------------------------------------------------------------------------------------


def hexahedra() -> Any:
    return filled(structured().cast_to_unstructured_grid())


def voxels() -> Any:
    return filled(image().cast_to_unstructured_grid())


def tetrahedra() -> Any:
    return filled(structured().triangulate())


def wedges() -> Any:
    plane = pv.Plane(i_resolution=4, j_resolution=3).triangulate()
    n, faces = plane.n_points, plane.faces.reshape(-1, 4)[:, 1:]
    cells = np.column_stack([np.full(len(faces), 6), faces, faces + n])
    points = np.concatenate([plane.points, plane.points + [0, 0, 1]])
    return filled(pv.UnstructuredGrid(cells, np.full(len(cells), pv.CellType.WEDGE), points))


def pyramids() -> Any:
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    cells = [[5, *side, 8] for side in sides]
    points = np.concatenate([cube, [[0.5, 0.5, 0.5]]])
    return filled(pv.UnstructuredGrid(np.array(cells).ravel(), np.full(6, pv.CellType.PYRAMID), points))


def quads() -> Any:
    return filled(structured(True).cast_to_unstructured_grid())


def curved() -> Any:
    return filled(pv.Sphere(theta_resolution=12, phi_resolution=9).cast_to_unstructured_grid())


def quadratic() -> Any:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0],
                       [0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5]], float)
    return filled(pv.UnstructuredGrid(np.r_[10, np.arange(10)], [pv.CellType.QUADRATIC_TETRA], points))


def surface() -> Any:
    return filled(pv.Sphere(theta_resolution=12, phi_resolution=9))


def polygons() -> Any:
    points = np.array([[0, 0, 0], [2, 0, 0], [3, 1, 0], [1.5, 2, 0], [0, 1, 0], [4, 3, 0]], float)
    return filled(pv.PolyData(points, np.array([5, 0, 1, 2, 3, 4, 3, 3, 2, 5])))


MESHES = {one.__name__: one for one in (
    hexahedra, voxels, tetrahedra, wedges, pyramids, quads, curved, quadratic, surface, polygons
)}


def size_of(points: np.ndarray, cells: np.ndarray) -> float:
    """Length, area or volume."""
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    side = points[cells[:, 1:]] - points[cells[:, :1]]
    gram = np.einsum("tik,tjk->tij", side, side)
    return float((np.sqrt(np.abs(np.linalg.det(gram))) / [1, 1, 2, 6][side.shape[1]]).sum())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", MESHES)
def test_meshes(kind: str, form: str, tmp_path: Path) -> None:
    """Cells fill what VTK's fill, values are those of the points, and contours are those of VTK."""
    data = MESHES[kind]()
    if kind == "quadratic" and form == "xdmf":
        pytest.skip("its writer does not know such cells")
    source = FORMS[form](data, "vtp" if isinstance(data, pv.PolyData) else "vtu", tmp_path)
    for asked in ("p", "averaged") if form == "xdmf" else ("p", "v:x", "v:1", "v:magnitude", "averaged"):
        mesh = isocodec.read(source, key=asked.replace("averaged", "c").replace(":1", ":y"),
                             average_cells=asked == "averaged")
        assert isinstance(mesh, Mesh)
        places, values, _ = wanted(data, asked)
        number = [np.abs(places[:, : mesh.points.shape[1]] - point).sum(axis=1).argmin() for point in mesh.points]
        assert np.allclose(mesh.points, places[number][:, : mesh.points.shape[1]], atol=1e-6)
        assert np.allclose(mesh.values, values[number], rtol=2e-5 if form == "xdmf" else 1e-6, atol=1e-5)
    volume = mesh.cells.shape[1] == 4
    measured = data.compute_cell_sizes()
    whole = np.abs(measured["Volume" if volume else "Area"]).sum()
    assert np.isclose(size_of(mesh.points, mesh.cells), whole, rtol=1e-5)
    mesh = isocodec.read(source, key="p")
    level = float(np.quantile(mesh.values, 0.4)) + 1e-3
    cut = pv.UnstructuredGrid(
        np.column_stack([np.full(len(mesh.cells), mesh.cells.shape[1]), mesh.cells]).ravel(),
        np.full(len(mesh.cells), 10 if volume else 5), np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1]))),
    )
    cut.point_data["p"] = mesh.values
    known = Mesh(mesh.points, mesh.cells, mesh.values, stored="whole", error=1e-5)
    contour = isocodec.decode(isocodec.encode(known, level, precision=1e-4))
    oracle = cut.contour([level], scalars="p").compute_cell_sizes()
    expected = oracle["Area" if volume else "Length"].sum()
    assert np.isclose(size_of(contour.points, contour.cells), expected, rtol=0.01)


def test_cutting_keeps_cells_together() -> None:
    """Faces of tetrahedra from neighbouring cells meet: only those on the outside have one cell."""
    for make in (hexahedra, voxels, wedges, pyramids):
        data = make()
        mesh = isocodec.read(data, key="p")
        faces = np.sort(np.concatenate([np.delete(mesh.cells, i, axis=1) for i in range(4)]), axis=1)
        single = np.unique(faces, axis=0, return_counts=True)
        assert np.isclose(
            size_of(mesh.points, single[0][single[1] == 1]), data.extract_surface().area, rtol=1e-5
        ), make.__name__


def test_remarks_and_refusals(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="cut into tetrahedra"):
        isocodec.read(hexahedra(), key="p")
    with pytest.warns(UserWarning, match="higher order"):
        isocodec.read(quadratic(), key="p")
    with pytest.raises(OptionError, match="average-cells"):
        isocodec.read(tetrahedra(), key="c")
    polyhedron = pv.UnstructuredGrid(
        [31, 6, 4, 0, 1, 3, 2, 4, 4, 5, 7, 6, 4, 0, 1, 5, 4, 4, 2, 3, 7, 6, 4, 0, 2, 6, 4, 4, 1, 3, 7, 5],
        [pv.CellType.POLYHEDRON], np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float),
    )
    with pytest.raises(InputError, match="cells of other kinds"):
        isocodec.read(polyhedron)
    with pytest.raises(InputError, match="p; v:x"):
        isocodec.read(image())
    with pytest.raises(InputError, match="no arrays 'q'"):
        isocodec.read(image(), key="q")
    with pytest.raises(InputError, match="Table"):
        isocodec.read(pv.Table({"a": np.ones(2)}))
    image().save(tmp_path / "a.vti")
    with pytest.raises(LimitError):
        isocodec.read(tmp_path / "a.vti", key="p", samples=50)


# ---- times and blocks -----------------------------------------------------------------------------------------------


def in_time(make: Callable[[], Any], suffix: str, folder: Path, move: float = 0.0) -> Path:
    lines = []
    for number, time in enumerate((0.0, 0.5, 10.0)):
        data = make()
        data.point_data["p"] = data.point_data["p"] + 100 * time
        if move:
            data.points += move * time
        data.save(folder / f"t{number}.{suffix}")
        lines.append(f'<DataSet timestep="{time}" part="0" file="t{number}.{suffix}"/>')
    (folder / "t.pvd").write_text(
        '<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>' + "".join(reversed(lines))
        + "</Collection></VTKFile>"
    )
    return folder / "t.pvd"


@pytest.mark.parametrize("grid", GRIDS)
def test_times_of_grids(grid: str, tmp_path: Path) -> None:
    data, path = GRIDS[grid](), in_time(GRIDS[grid], SUFFIX[grid], tmp_path)
    series = isocodec.read(path, key="p", frames=True)
    assert isinstance(series, Frames) and len(series.fields) == 3
    for number, time in enumerate((0.0, 0.5, 10.0)):
        for field in (series.fields[number], isocodec.read(path, key="p", frame=number)):
            places, values = samples(field)
            assert np.allclose(values, data.point_data["p"] + 100 * time) and np.allclose(places, data.points)
    with pytest.raises(OptionError, match="no frame 3"):
        isocodec.read(path, key="p", frame=3)


def test_times_of_meshes(tmp_path: Path) -> None:
    path = in_time(tetrahedra, "vtu", tmp_path)
    mesh = isocodec.read(path, key="p")
    assert mesh.values.shape == (3, mesh.points.shape[0])
    assert np.allclose(mesh.values[2] - mesh.values[0], 1000)
    assert np.array_equal(isocodec.read(path, key="p", frame=1).values, mesh.values[1])
    moving = in_time(tetrahedra, "vtu", tmp_path, move=1.0)
    with pytest.raises(InputError, match="changes in time"):
        isocodec.read(moving, key="p")
    assert np.array_equal(isocodec.read(moving, key="p", frame=1).values, mesh.values[1])


def test_blocks(tmp_path: Path) -> None:
    parts = pv.MultiBlock({"grid": image(), "mesh": tetrahedra(), "deep": pv.MultiBlock({"flat": rectilinear(True)})})
    parts.save(tmp_path / "a.vtm")
    for source in (parts, tmp_path / "a.vtm"):
        assert isocodec.read(source, key="grid/p").values.shape == (5, 4, 3)
        assert isocodec.read(source, key="grid/v:magnitude").values.shape == (5, 4, 3)
        assert isocodec.read(source, key="deep/flat/c").values.shape == (4, 3)
        mesh = isocodec.read(source, key="mesh/p")
        assert isinstance(mesh, Mesh) and np.allclose(mesh.values, tetrahedra().point_data["p"])
        with pytest.raises(InputError, match="3 blocks: grid; mesh; deep/flat"):
            isocodec.read(source)


def test_blanked_points_are_missing() -> None:
    data = image()
    data.GetPointData().AddArray(vtk.vtkUnsignedCharArray())
    ghosts = np.zeros(data.n_points, np.uint8)
    ghosts[7] = 2
    data.point_data["vtkGhostType"] = ghosts
    values = isocodec.read(data, key="p").values
    assert np.isnan(values).sum() == 1 and np.isnan(values[2, 1, 0])


def test_pieces_are_joined(tmp_path: Path) -> None:
    """Points where pieces meet are one point, so that contours go on there."""
    data = tetrahedra()
    mesh = isocodec.read(as_pieces(data, "vtu", tmp_path), key="p")
    assert len(mesh.points) == data.n_points and len(mesh.cells) == data.n_cells


def test_a_surface_in_space_is_a_mesh(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    data = filled(pv.StructuredGrid(x, y, 0.1 * x * y))
    assert isinstance(isocodec.read(data, key="p"), Mesh)
    data.save(tmp_path / "a.vts")
    with pytest.raises(InputError, match="--values"):
        isocodec.read(tmp_path / "a.vts", key="p")
    assert read_mesh(tmp_path / "a.vts").cells.shape == (24, 3)


# ---- XDMF -----------------------------------------------------------------------------------------------------------


def xdmf(item: str) -> str:
    numbers = " ".join(map(str, range(12)))
    return (
        '<?xml version="1.0"?><Xdmf Version="3.0"><Domain><Grid Name="g" GridType="Uniform"><Topology '
        'TopologyType="2DRectMesh" Dimensions="4 3"/><Geometry GeometryType="VXVY"><DataItem Dimensions="3" '
        'Format="XML">0 1 3</DataItem><DataItem Dimensions="4" Format="XML">5 6 7 9</DataItem></Geometry><Attribute '
        'Name="p" Center="Node">' + (item or f'<DataItem Dimensions="4 3" Format="XML">{numbers}</DataItem>')
        + "</Attribute></Grid></Domain></Xdmf>"
    )


def item(name: str, form: str = "HDF") -> str:
    return f'<DataItem Dimensions="4 3" NumberType="Float" Precision="8" Format="{form}">{name}</DataItem>'


def test_xdmf_with_other_files(tmp_path: Path) -> None:
    import h5py

    folder, elsewhere = tmp_path / "in", tmp_path / "out"
    folder.mkdir(), elsewhere.mkdir()
    numbers = np.arange(12.0).reshape(4, 3)
    for place in (folder, elsewhere):
        with h5py.File(place / "s.h5", "w") as file:
            file["p"] = numbers
        numbers.tofile(place / "s.bin")
    with h5py.File(folder / "link.h5", "w") as file:
        file["p"] = h5py.ExternalLink(str(elsewhere / "s.h5"), "/p")
        layout = h5py.VirtualLayout((4, 3), "f8")
        layout[:] = h5py.VirtualSource(str(elsewhere / "s.h5"), "p", (4, 3))
        file.create_virtual_dataset("virtual", layout)
    path = folder / "a.xdmf"

    def read(text: str, **options: Any) -> np.ndarray:
        path.write_text(text)
        return isocodec.read(path, **options).values

    for inside in ("", item("s.h5:/p"), item(" s.h5:/p\n"), item("s.bin", "Binary")):
        assert np.array_equal(read(xdmf(inside)), numbers.T)
    for outside in ("../out/s.h5:/p", f"{elsewhere}/s.h5:/p", "link.h5:/p", "link.h5:/virtual"):
        with pytest.raises(InputError, match="follow-paths"):
            read(xdmf(item(outside)))
        if "link" not in outside:
            assert np.array_equal(read(xdmf(item(outside)), follow=True), numbers.T)
    for outside in (f"{elsewhere}/s.bin", "../out/s.bin"):
        with pytest.raises(InputError, match="follow-paths"):
            read(xdmf(item(outside, "Binary")))
    with pytest.raises(InputError, match="entities"):
        read(xdmf("").replace("<Xdmf", '<!DOCTYPE a [<!ENTITY b SYSTEM "s.bin">]><Xdmf', 1))
    include = '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="../out/s.bin"/>'
    with pytest.raises(InputError, match="follow-paths"):
        read(xdmf("").replace("<Attribute", include + "<Attribute", 1))
    with pytest.raises(InputError):
        read(xdmf(item("s.h5:/q")))
    with pytest.raises(LimitError):
        read(xdmf(""), samples=11)


@pytest.mark.parametrize("suffix", ["pvti", "pvtu", "vtm", "pvd"])
def test_pieces_elsewhere(suffix: str, tmp_path: Path) -> None:
    """Files that a file names lie beside it, or are followed by request only."""
    make = {"pvti": as_pieces, "pvtu": as_pieces, "vtm": as_blocks, "pvd": as_collection}[suffix]
    data, kind = (tetrahedra(), "vtu") if suffix == "pvtu" else (image(), "vti")
    source = make(data, kind, tmp_path)
    (tmp_path / "out").mkdir()
    for path in tmp_path.glob(f"*.{kind}"):
        path.rename(tmp_path / "out" / path.name)
    text = source.read_text()
    for name in ("out/a", f"{tmp_path}/out/a", "out&#47;a"):
        source.write_text(text.replace('"a', f'"{name}'))
        with pytest.raises(InputError, match="names another file"):
            isocodec.read(source, key="p")
        assert np.isfinite(np.asarray(isocodec.read(source, key="p", follow=True).values)).all()


@pytest.mark.parametrize("form", [name for name in FORMS if name != "object"])
@pytest.mark.parametrize("kind", ["vti", "vts", "vtu"])
def test_damage_is_an_error(kind: str, form: str, tmp_path: Path) -> None:
    """A file that is cut short is refused, or has the values that the whole one has."""
    data = {"vti": image, "vts": structured, "vtu": tetrahedra}[kind]()
    source = FORMS[form](data, kind, tmp_path)
    whole = isocodec.read(source, key="p").values
    victim = max(tmp_path.iterdir(), key=lambda path: path.stat().st_size)
    content = victim.read_bytes()
    for size in (0, 8, len(content) // 3, len(content) // 2, len(content) * 9 // 10):
        victim.write_bytes(content[:size])
        try:
            found = isocodec.read(source, key="p").values
        except (InputError, LimitError):
            continue
        assert np.array_equal(found, whole), size
