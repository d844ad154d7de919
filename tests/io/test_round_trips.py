"""Round trips of all writers: format x content x place, read back by other libraries: same points, same system."""

from __future__ import annotations

import gzip
import json
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import isocodec
from isocodec.errors import OptionError
from isocodec.field.placement import LPS, RAS, Placement
from isocodec.io.writers.registry import OUTPUTS
from isocodec.io.writers.things import Areas, SampleMask, Thing, thing_of
from isocodec.io.writers.write import write
from libraries import Late

ezdxf = Late("ezdxf")
geopandas = Late("geopandas")
mapbox_vector_tile = Late("mapbox_vector_tile")
meshio = Late("meshio")
nibabel = Late("nibabel")
Image = Late("PIL.Image")
pmtiles_reader = Late("pmtiles.reader")
pyproj = Late("pyproj")
pyvista = Late("pyvista")
KDTree = Late("scipy.spatial.KDTree")
shapely = Late("shapely")
SimpleITK = Late("SimpleITK")
trimesh = Late("trimesh")

Array = np.ndarray
LAEA = pyproj.CRS("+proj=laea +lat_0=48 +lon_0=9 +x_0=1000 +datum=WGS84").to_wkt()


# ---- What is written ------------------------------------------------------------------------------------------------


def bumps() -> Array:
    """Integers with a hill, a hollow in it and a slope that leaves the field."""
    i, j = np.indices((25, 31))
    far = np.hypot(i - 12, 0.8 * (j - 15))
    return np.rint(100 - 8 * np.abs(far - 5) + 3 * (j > 24) * (j - 24) ** 2).astype(np.int32)


def ball() -> Array:
    i, j, k = np.indices((11, 12, 13))
    return np.rint(90 - 13 * np.sqrt((i - 5) ** 2 + 0.8 * (j - 5.5) ** 2 + (k - 6) ** 2) - i).astype(np.int32)


def grid(x: float, dx: float, y: float, dy: float) -> Array:
    """A map: x along axis 1, y along axis 0."""
    return np.array([[0, dx, x], [dy, 0, y]])


def curvilinear() -> Placement:
    i, j = np.indices((25, 31))
    return Placement(coordinates=[2 + j * 0.01 + 0.001 * i, 45 - 0.012 * i + 1e-5 * j**2], crs="EPSG:4326")


PLACES: dict[str, Callable[[], Placement | None]] = {
    "samples": lambda: None,
    "no system": lambda: Placement(grid(5e5, 30, 5e6, -20)),
    "UTM": lambda: Placement(grid(5e5, 30, 5e6, -20), crs="EPSG:32631"),
    "rows to the north": lambda: Placement(grid(5e5, 30, 5e6, 20), crs="EPSG:32631"),
    "turned": lambda: Placement(np.array([[12, 25, 4e5], [-20, 9, 6e6]]), crs="EPSG:25832"),
    "without a number": lambda: Placement(grid(-3e3, 30, 1e3, -30), crs=LAEA),
    "across 180": lambda: Placement(grid(58e4, 4e3, 74e5, -4e3), crs="EPSG:32660"),
    "longitudes to 360": lambda: Placement(grid(165, 1, 20, -1), crs="EPSG:4326"),
    "beyond 180": lambda: Placement(grid(200, 1, 20, -1), crs="EPSG:4326"),
    "north pole": lambda: Placement(grid(-6e5, 4e4, 48e4, -4e4), crs="EPSG:3413"),
    "south pole": lambda: Placement(grid(-6e5, 4e4, 48e4, -4e4), crs="EPSG:3031"),
    "beside the pole": lambda: Placement(grid(-5e5, 4e4, 9e5, -4e4), crs="EPSG:3413"),
    "nodes": curvilinear,
    "plane in a body": lambda: Placement(np.array([[0.5, 0, 3], [0, 0.7, -2], [0.1, 0.2, 9]]), crs=RAS),
}
SPACES: dict[str, Callable[[], Placement | None]] = {
    "samples": lambda: None,
    "RAS": lambda: Placement(np.array([[-0.7, 0, 0, 30], [0, 0.8, 0.1, -20], [0, 0, 1.5, 7]]), crs=RAS),
    "LPS": lambda: Placement(np.array([[0.7, 0, 0, 30], [0, 0.8, 0, -20], [0, 0, 1.5, 7]]), crs=LPS),
    "UTM": lambda: Placement(np.array([[0, 0, 30, 5e5], [0, -30, 0, 5e6], [5.0, 0, 0, 100]]), crs="EPSG:32631"),
}


@cache
def plane(place: str) -> isocodec.IsoFile:
    field = isocodec.Field(bumps(), placement=PLACES[place]())
    return isocodec.open(isocodec.encode(field, [60.5, 80.5, 84, 900.5], precision="exact"))


@cache
def volume(place: str) -> isocodec.IsoFile:
    field = isocodec.Field(ball(), placement=SPACES[place]())
    return isocodec.open(isocodec.encode(field, [30.5, 50.5, 45, 900.5], precision="exact"))


@cache
def on_mesh(crs: str | None) -> isocodec.IsoFile:
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.random((400, 2)) * [900, 600], [[0, 0], [900, 0], [0, 600], [900, 600]]])
    points += [5e5, 5e6]
    values = np.rint(3e2 - np.hypot(*(points - [500450, 5000300]).T))
    return isocodec.open(isocodec.encode(isocodec.Mesh(points, None, values, crs=crs), 150.5))


@cache
def thinned(crs: str | None) -> Any:
    made = None if crs is None else Placement(grid(5e5, 30, 5e6, -20), crs=crs)
    return isocodec.thin(isocodec.Field(bumps().astype(float), placement=made), to=150)


def drawn(file: isocodec.IsoFile, *numbers: int) -> Any:
    found = file.contours()
    return found[numbers[0]] if len(numbers) == 1 else [found[i] for i in numbers]


CONTENTS: dict[str, Callable[[], Any]] = {}
for _place in PLACES:
    CONTENTS[f"curve, {_place}"] = lambda p=_place: drawn(plane(p), 1)
    CONTENTS[f"areas above, {_place}"] = lambda p=_place: Areas([drawn(plane(p), 1)], "above")
    CONTENTS[f"areas below, {_place}"] = lambda p=_place: Areas([drawn(plane(p), 1)], "below")
for _place in ("samples", "UTM", "across 180", "north pole"):
    CONTENTS[f"curves, {_place}"] = lambda p=_place: drawn(plane(p), 0, 1)
    CONTENTS[f"ties, {_place}"] = lambda p=_place: drawn(plane(p), 2)
    CONTENTS[f"areas of ties, {_place}"] = lambda p=_place: Areas([drawn(plane(p), 2)], "above")
    CONTENTS[f"no curve, {_place}"] = lambda p=_place: drawn(plane(p), 3)
    CONTENTS[f"no areas, {_place}"] = lambda p=_place: Areas([drawn(plane(p), 3)], "above")
    CONTENTS[f"bands, {_place}"] = lambda p=_place: Areas(drawn(plane(p), 0, 1, 3), "bands")
    CONTENTS[f"mesh, {_place}"] = lambda p=_place: plane(p).mesh(80.5)
    CONTENTS[f"mask, {_place}"] = lambda p=_place: SampleMask(bumps() > 80.5, plane(p).placement)
for _place in SPACES:
    CONTENTS[f"surface, {_place}"] = lambda p=_place: drawn(volume(p), 1)
    CONTENTS[f"surfaces, {_place}"] = lambda p=_place: drawn(volume(p), 0, 1)
    CONTENTS[f"surface with ties, {_place}"] = lambda p=_place: drawn(volume(p), 2)
    CONTENTS[f"no surface, {_place}"] = lambda p=_place: drawn(volume(p), 3)
    CONTENTS[f"mesh of space, {_place}"] = lambda p=_place: volume(p).mesh(50.5)
    CONTENTS[f"mask of space, {_place}"] = lambda p=_place: SampleMask(ball() > 50.5, volume(p).placement)
    CONTENTS[f"labels of space, {_place}"] = lambda p=_place: SampleMask(
        np.digitize(ball(), [30, 50]).astype(np.uint8), volume(p).placement)
for _crs in (None, "EPSG:32631"):
    CONTENTS[f"curve on a mesh, {_crs}"] = lambda c=_crs: on_mesh(c).contour()
    CONTENTS[f"surface of samples, {_crs}"] = lambda c=_crs: thinned(c)


@cache
def content(name: str) -> Any:
    return CONTENTS[name]()


@cache
def thing(name: str) -> Thing:
    return thing_of(content(name))


# ---- What others read -----------------------------------------------------------------------------------------------


@dataclass
class Back:
    """What another library found in a file.

    Attributes
    ----------
    points : (P, 2 or 3)
    lines : list of (K, 2 or 3)
    areas : list of shapely geometries
    triangles : (M, 3, 3) corners
    system : object that pyproj takes, or None
    space : the sides of a body that coordinates run to
    isovalues : as far as the format holds them
    """

    points: Array
    lines: list[Array] | None = None
    areas: list[Any] | None = None
    triangles: Array | None = None
    system: Any = None
    space: str | None = None
    isovalues: set[float] | None = None


def space_in(text: bytes) -> str | None:
    found = re.search(rb"SPACE=(RAS|LPS)", text)
    return found[1].decode() if found else None


def of_shapes(shapes: list[Any], **more: Any) -> Back:
    points = shapely.get_coordinates(shapes, include_z=any(shapely.has_z(shapes)))
    if all(shape.geom_type.endswith("Polygon") for shape in shapes):
        return Back(points, areas=shapes, **more)
    lines = [np.array(line.coords) for shape in shapes for line in getattr(shape, "geoms", [shape])]
    return Back(points, lines, **more)


def of_json(path: Path) -> Back:
    whole = json.loads(path.read_text())
    features = whole.get("features", [whole])
    shapes = [shapely.geometry.shape(feature["geometry"]) for feature in features]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system = geopandas.read_file(path).crs
    values = {feature["properties"].get("isovalue") for feature in features}
    space = {RAS: "RAS", LPS: "LPS", None: None}[whole.get("space")]
    return of_shapes(shapes, system=system, isovalues=values, space=space)


def of_table(path: Path) -> Back:
    table = (geopandas.read_parquet if path.suffix == ".parquet" else geopandas.read_file)(path)
    values = set(table["isovalue"]) if "isovalue" in table else None
    # FlatGeobuf has no empty areas, but rows without one
    shapes = [shapely.MultiPolygon() if shape is None else shape for shape in table.geometry]
    return of_shapes(shapes, system=table.crs, isovalues=values)


def of_archive(path: Path) -> Back:
    """Lines of the highest zoom level, in Web Mercator."""
    data = path.read_bytes()

    def get(offset: int, length: int) -> bytes:
        return data[offset : offset + length]

    header = pmtiles_reader.Reader(get).header()
    lines, values = [], set()
    half = np.pi * 6378137
    for (zoom, x, y), packed in pmtiles_reader.all_tiles(get):
        tile = mapbox_vector_tile.decode(gzip.decompress(packed), default_options={"y_coord_down": True})
        for feature in tile["contours"]["features"] if zoom == header["max_zoom"] else []:
            values.add(feature["properties"]["isovalue"])
            for line in getattr(shape := shapely.geometry.shape(feature["geometry"]), "geoms", [shape]):
                places = (np.array(line.coords) / 4096 + [x, y]) / (1 << zoom)
                lines.append((places - 0.5) * [2 * half, -2 * half])
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    return Back(points, lines, system="EPSG:3857", isovalues=values)


def of_drawing(path: Path) -> Back:
    space = ezdxf.readfile(path).modelspace()
    values = {float(each.dxf.layer.removeprefix("ISO_")) for each in space}
    lines = []
    for each in space.query("LWPOLYLINE"):
        points = np.array([point[:2] for point in each.get_points()])
        lines.append(np.concatenate([points, points[:1]]) if each.closed else points)
    for each in space.query("POLYLINE"):
        points = np.array([tuple(point.dxf.location) for point in each.vertices])
        lines.append(np.concatenate([points, points[:1]]) if each.is_closed else points)
    meshes = list(space.query("MESH"))
    corners = [np.array(mesh.vertices)[[list(face) for face in mesh.faces]] for mesh in meshes]
    points = [*lines, *(np.array(mesh.vertices) for mesh in meshes)]
    return Back(np.concatenate(points) if points else np.zeros((0, 2)), lines or None,
                triangles=np.concatenate(corners) if corners else None, isovalues=values)


def of_vtk(path: Path) -> Back:
    found = pyvista.read(path)
    points = np.asarray(found.points, float)
    space = found.field_data["SPACE"][0] if "SPACE" in found.field_data else None
    values = set(np.asarray(found.cell_data["isovalue"]).tolist()) if "isovalue" in found.cell_data else None
    if path.suffix == ".vtu":
        cells = {block.type: block.data for block in meshio.read(path).cells} if found.n_cells else {}
        lines = [points[pair] for pair in cells.get("line", [])]
        triangles = points[cells["triangle"]] if "triangle" in cells else None
        return Back(points, lines or None, triangles=triangles, isovalues=values)
    if found.n_lines:
        rows, at, lines = found.lines.tolist(), 0, []
        while at < len(rows):
            lines.append(points[rows[at + 1 : at + 1 + rows[at]]])
            at += 1 + rows[at]
        return Back(points, lines, space=space, isovalues=values)
    triangles = points[found.faces.reshape(-1, 4)[:, 1:]] if found.n_cells else None
    return Back(points, triangles=triangles, space=space, isovalues=values)


def of_ply(path: Path) -> Back:
    data = path.read_bytes()
    if b"element edge" not in data:
        return of_trimesh(path)
    head, _, body = data.partition(b"end_header\n")
    count, edges = (int(re.search(rb"element %s (\d+)" % name, head)[1]) for name in (b"vertex", b"edge"))
    points = np.frombuffer(body, "<f8", 3 * count).reshape(-1, 3)
    pairs = np.frombuffer(body, "<i4", offset=24 * count).reshape(edges, 2)
    return Back(points, [points[pair] for pair in pairs], space=space_in(head))


def of_obj(path: Path) -> Back:
    text = path.read_text()
    if "\nv " not in f"\n{text}":
        return Back(np.zeros((0, 3)))
    if "\nl " not in text:
        return of_trimesh(path)
    found = pyvista.read(path)  # in single precision: the text has more digits
    points = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")], float)
    assert np.allclose(found.points, points, rtol=1e-6)
    walks = [[int(n) - 1 for n in line.split()[1:]] for line in text.splitlines() if line.startswith("l ")]
    values = {float(line.split()[-1]) for line in text.splitlines() if line.startswith("o ")}
    return Back(points, [points[walk] for walk in walks], isovalues=values, space=space_in(text.encode()))


def of_trimesh(path: Path) -> Back:
    data = path.read_bytes()
    if (not re.search(rb"element face [1-9]", data) and path.suffix == ".ply") or data in (b"OFF\n0 0 0\n",
                                                                                       b"# empty isosurface\n"):
        return Back(np.zeros((0, 3)), triangles=np.zeros((0, 3, 3)), space=space_in(data[:300]))
    if path.suffix == ".stl" and len(data) == 84:
        return Back(np.zeros((0, 3)), triangles=np.zeros((0, 3, 3)), space=space_in(data[:84]))
    scene = trimesh.load_scene(path, process=False)
    parts = scene.dump()
    points = np.concatenate([part.vertices for part in parts])
    corners = np.concatenate([part.vertices[part.faces] for part in parts])
    space = space_in(data[:300])
    if path.suffix == ".glb":
        about = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["scenes"][0]["extras"]
        assert about["up"] == "y"
        back = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        points, corners, space = points @ back, corners @ back, about.get("SPACE")
    named = {name: float(name.split()[-1]) for name in scene.geometry if "isovalue" in name}
    return Back(points, triangles=corners, isovalues=set(named.values()) or None, space=space)


def of_npz(path: Path) -> Back:
    with np.load(path) as arrays:
        values = {float(arrays["isovalue"])} if "isovalue" in arrays else None
        return Back(arrays["points"], isovalues=values)


def of_svg(path: Path) -> Back:
    lines, values = [], set()
    for group in ElementTree.parse(path).getroot():
        values.add(float(group[0].text.split()[-1]))
        for each in group[1:]:
            text = each.get("d")
            points = np.array([pair.split(",") for pair in text.strip("MZ").split(" ")], float)
            lines.append(np.concatenate([points, points[:1]]) if text.endswith("Z") else points)
    return Back(np.concatenate(lines) if lines else np.zeros((0, 2)), lines, isovalues=values)


def of_nifti(path: Path) -> Back:
    image = nibabel.load(path)
    found = np.asarray(image.dataobj)
    placed = image.header["sform_code"] > 0
    at = np.argwhere(found).astype(float)
    return Back(nibabel.affines.apply_affine(image.affine, at) if placed else at, space="RAS" if placed else None)


def of_nrrd(path: Path) -> Back:
    image = SimpleITK.ReadImage(path)
    at = np.argwhere(SimpleITK.GetArrayFromImage(image).T)
    places = np.array([image.TransformIndexToPhysicalPoint([int(n) for n in one]) for one in at]).reshape(-1, 3)
    named = b"\nspace: left-posterior-superior\n" in path.read_bytes()
    return Back(places if named else at.astype(float), space="LPS" if named else None)


READERS: dict[str, Callable[[Path], Back]] = {
    ".npz": of_npz, ".npy": lambda path: Back(np.argwhere(np.load(path)).astype(float)), ".svg": of_svg,
    ".png": lambda path: Back(np.argwhere(np.asarray(Image.open(path).convert("L")) < 128).astype(float)),
    ".geojson": of_json,
    **dict.fromkeys([".gpkg", ".fgb", ".shp", ".parquet"], of_table),
    ".pmtiles": of_archive, ".dxf": of_drawing, ".vtp": of_vtk, ".vtu": of_vtk,
    ".ply": of_ply, ".obj": of_obj, **dict.fromkeys([".stl", ".off", ".glb", ".3mf"], of_trimesh),
    ".nii": of_nifti, ".nii.gz": of_nifti, ".nrrd": of_nrrd,
}
_SPREAD = 8
"""Steps of single precision within which points lie that would fall together."""
SINGLE = {".stl": 2.0**-23, ".ply": 2.0**-23, ".glb": 2.0**-23, ".vtp": 0.0, ".nrrd": 1e-12, ".nii": 2.0**-22,
          ".nii.gz": 2.0**-22}
"""Part of the largest coordinate that a format loses."""
DEGREES = ("EPSG:4326", "EPSG:4979")
"""Longitude and latitude, without and with heights."""
EMPTY = {".glb", ".3mf"}
"""Formats that do not hold an empty surface."""


# ---- What is expected -----------------------------------------------------------------------------------------------


@dataclass
class Expected:
    """Points in the coordinates of the placement, and pairs or triples of them."""

    points: Array
    cells: Array | None
    placement: Placement | None
    cell: float
    isovalues: set[float]


def expected(what: Any) -> Expected:
    if isinstance(what, SampleMask):
        at = np.argwhere(np.asarray(what.rows)).astype(float)
        placed = what.placement is not None and what.placement.placed
        return Expected(what.placement.place(at) if placed else at, None, what.placement, 1.0, set())
    if isinstance(what, isocodec.Contour | list | Areas):
        each = what if isinstance(what, list) else what.contours if isinstance(what, Areas) else [what]
        points = np.concatenate([one.placed for one in each])
        counts = np.cumsum([0, *(len(one.points) for one in each)])
        cells = np.concatenate([one.placed_cells + n for one, n in zip(each, counts, strict=False)])
        frame = each[0].frame
        cell = 1.0 if frame is None or not each[0].shape else float(np.linalg.norm(frame, axis=0).min())
        return Expected(points, cells, each[0].placement, cell, {float(one.isovalue) for one in each})
    if hasattr(what, "levels"):
        flat = what.points.astype(float)
        about = replace(drawn(plane("samples"), 1), placement=what.placement, shape=what.shape)
        return Expected(about.place(flat), what.cells, what.placement, 1.0, set())
    from isocodec.io.writers.things import PlacedTin

    placed = PlacedTin.of(what)
    return Expected(placed.vertices, placed.triangles, placed.placement, 1.0, set())


def same_system(found: Any, wanted: Any) -> bool:
    """Whether two systems put a point at one place."""
    a, b = (pyproj.Transformer.from_crs(pyproj.CRS.from_user_input(each), 4326, always_xy=True)
            for each in (found, wanted))
    place = pyproj.Transformer.from_crs(4326, pyproj.CRS.from_user_input(wanted), always_xy=True).transform(7.0, 47.0)
    return bool(np.allclose(a.transform(*place), b.transform(*place), atol=1e-9))


def apart(points: Array, others: Array) -> float:
    """The farthest that a point lies from the nearest of others."""
    if not len(points):
        return 0.0
    return float(KDTree(others).query(points)[0].max()) if len(others) else np.inf


def named(placement: Placement | None) -> bool:
    return placement is not None and bool(placement.crs) and placement.space is None


def cells() -> list[Any]:
    found = []
    for output in OUTPUTS:
        for suffix in output.suffixes:
            for name in CONTENTS:
                about = ABOUT.get(name.partition(",")[0])
                if about is None or about[0] != output.kind or not output.fits(*about[1:]):
                    continue
                found.append(pytest.param(suffix, name, id=f"{suffix}-{name}"))
    return found


ABOUT: dict[str, tuple[str, int, bool, bool]] = {
    "curve": ("contour", 2, False, True), "curves": ("contour", 2, True, True), "ties": ("contour", 2, False, True),
    "no curve": ("contour", 2, False, True), "areas above": ("areas", 2, False, True),
    "areas below": ("areas", 2, False, True), "areas of ties": ("areas", 2, False, True),
    "no areas": ("areas", 2, False, True), "bands": ("areas", 2, False, True), "mesh": ("mesh", 2, False, True),
    "mask": ("mask", 2, False, True), "surface": ("contour", 3, False, True), "surfaces": ("contour", 3, True, True),
    "surface with ties": ("contour", 3, False, True), "no surface": ("contour", 3, False, True),
    "mesh of space": ("mesh", 3, False, True), "mask of space": ("mask", 3, False, True),
    "labels of space": ("labels", 3, False, True), "curve on a mesh": ("contour", 2, False, False),
    "surface of samples": ("tin", 2, False, True),
}
"""Kind, axes, whether there are several isovalues, whether it is sampled, by the beginning of names of contents."""
CELLS = cells()


def test_all_contents_and_writers_are_there() -> None:
    """Of each writer a cell; what is said of contents is so."""
    assert {name.partition(",")[0] for name in CONTENTS} == set(ABOUT) and len(CELLS) >= 80
    for name in CONTENTS:
        kind, n, several, sampled = ABOUT[name.partition(",")[0]]
        assert thing(name) == Thing(kind, n, several, sampled), name  # type: ignore[arg-type]
    tried = {(cell.values[0], thing(cell.values[1]).kind, thing(cell.values[1]).n) for cell in CELLS}
    for output in OUTPUTS:
        if output.kind not in ("picture", "pyramid"):
            for suffix in output.suffixes:
                assert any((suffix, output.kind, n) in tried for n in output.dimensions), (suffix, output.kind)


def nowhere(suffix: str, name: str) -> bool:
    """Whether a map cannot be made, for want of a system."""
    return suffix == ".pmtiles" and name.rpartition(", ")[2] in ("samples", "no system", "plane in a body")


@pytest.mark.cover(2)
@pytest.mark.parametrize(("suffix", "name"), CELLS)
def test_round_trips(tmp_path: Path, suffix: str, name: str) -> None:
    what, path = content(name), tmp_path / f"a{suffix}"
    if nowhere(suffix, name) or (suffix in EMPTY and name.startswith("no surface")):
        with pytest.raises(OptionError, match=r"reference system|is empty"):
            write(path, what)
        assert not [*tmp_path.iterdir()]
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        remarks = write(path, what).remarks
        back = READERS[suffix](path)
    wanted = expected(what)
    if suffix != ".png":
        check_system(suffix, what, back, wanted, remarks)
        check_points(suffix, name, what, back, wanted)
    check_shapes(suffix, name, back)


def check_system(suffix: str, what: Any, back: Back, wanted: Expected, remarks: tuple[str, ...]) -> None:
    """The file states the system, or a remark says that it does not."""
    output = next(each for each in OUTPUTS if suffix in each.suffixes and each.kind == thing_of(what).kind
                  and each.fits(thing_of(what).n, thing_of(what).several, thing_of(what).sampled))
    if output.coordinates == "samples":
        return
    placement = wanted.placement
    empty = not len(wanted.points)
    space = placement.space if placement is not None else None
    if suffix in (".nii", ".nii.gz", ".nrrd"):
        assert (back.space is not None) == (placement is not None and placement.matrix is not None)
    else:
        assert back.space == (space if output.names_space and not (empty and suffix in (".obj", ".off")) else None)
    if output.coordinates == "degrees" and suffix == ".geojson":
        if named(placement):
            assert back.system in DEGREES and remarks == ()
        else:
            assert back.system is None or pyproj.CRS(back.system).is_engineering
    elif output.names_crs and suffix != ".pmtiles":
        assert same_system(back.system, placement.crs) if named(placement) else back.system is None
    elif not empty and ((named(placement) and not output.names_crs) or (space and not output.names_space)):
        assert any("does not state the reference system" in remark for remark in remarks)
    if not named(placement) and not space and not empty and output.names_crs:
        assert any("reference system" in remark or "not the longitudes" in remark for remark in remarks)
    if back.isovalues is not None and wanted.isovalues and not (empty and not back.isovalues):
        assert back.isovalues <= wanted.isovalues | {None}
        if not isinstance(what, Areas) and not empty and len(wanted.isovalues) == 1:
            assert back.isovalues == wanted.isovalues


def degrees_of(points: Array, placement: Placement) -> Array:
    """Longitude within 180 degrees, and latitude, by pyproj."""
    lon, lat = pyproj.Transformer.from_crs(placement.crs, 4326, always_xy=True).transform(points[:, 0], points[:, 1])
    return np.column_stack([(np.array(lon) + 180) % 360 - 180, lat, points[:, 2:]])


def on_ball(points: Array) -> Array:
    """Points of a sphere, where 180 degrees are no seam."""
    lon, lat = np.radians(points[:, :2]).T
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat), *points[:, 2:].T])


def check_points(suffix: str, name: str, what: Any, back: Back, wanted: Expected) -> None:
    """All points are there, and no others but those of borders and bends, which lie on lines between them."""
    points, found, placement = wanted.points, back.points, wanted.placement
    largest = float(abs(points).max(initial=1.0))
    close = max(1e-9, SINGLE.get(suffix, 0.0), 4e-16 * largest / wanted.cell) * max(largest, 1.0) / wanted.cell
    close = {".obj": 2e-8, ".off": 2e-8, ".3mf": 1e-6}.get(suffix, close)
    close = {".svg": 1e-6, ".npz": 0.0, ".npy": 0.0}.get(suffix, max(close * wanted.cell, 2e-15 * largest))
    if "ties" in name and suffix in SINGLE:
        close *= _SPREAD
    kind = thing_of(what).kind
    if suffix in (".npz", ".npy"):
        points = what.points if hasattr(what, "points") else np.argwhere(np.asarray(what.rows)) if isinstance(
            what, SampleMask) else points
        if suffix == ".npy" and kind == "tin":
            return
    elif suffix == ".svg":
        points = np.concatenate([one.points[:, ::-1] for one in (what if isinstance(what, list) else [what])])
    elif suffix == ".geojson" and named(placement):
        points, close = degrees_of(points, placement), 1e-11
        points, found = on_ball(points), on_ball(found)
        if wanted.points.shape[1] > 2:
            close = 1e-9
    elif suffix == ".pmtiles":
        points = degrees_of(points, placement)
        points = points[abs(points[:, 1]) < 85]
        x, y = pyproj.Transformer.from_crs(4326, 3857, always_xy=True).transform(*points[:, :2].T)
        width = 2 * np.pi * 6378137
        points, close = np.column_stack([x, y]), width / 4096  # refined below
        zooms = json.dumps(sorted({round(float(n), 3) for n in abs(np.diff(found[:, 0])) if n > 0})[:1])
        close = 2 * json.loads(zooms)[0] if len(found) > 1 and json.loads(zooms) else close
        # the seam of the map is none of the world
        found = np.concatenate([found, found + [width, 0], found - [width, 0]]) if len(found) else found
    elif suffix in (".nii", ".nii.gz", ".nrrd"):
        body = placement is not None and placement.matrix is not None
        if not body:
            points = np.argwhere(np.asarray(what.rows)).astype(float)
        points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        crs = placement.crs if body else None
        turned = body and (back.space == "RAS") == (crs == LPS)
        points = points * [-1, -1, 1] if turned else points
    if points.shape[1] < found.shape[1]:
        points = np.pad(points, ((0, 0), (0, found.shape[1] - points.shape[1])))
    if points.shape[1] > found.shape[1]:
        points = points[:, : found.shape[1]]
    if kind == "areas":
        assert apart(points, found) <= close or name.startswith(("bands", "areas of ties"))
        return
    assert apart(points, found) <= close
    bent = suffix in (".geojson", ".pmtiles") and named(placement)
    if not bent and suffix != ".npz":
        assert apart(found, points) <= close


def check_shapes(suffix: str, name: str, back: Back) -> None:
    """No line without length, no triangle without area, areas valid; longitudes within 180 degrees, lines cut there."""
    degrees = suffix == ".geojson" and back.system in DEGREES
    if degrees and len(back.points):
        assert abs(back.points[:, 0]).max() <= 180 and abs(back.points[:, 1]).max() <= 90
    for line in back.lines or []:
        steps = np.diff(line, axis=0)
        assert len(line) > 1 and (np.linalg.norm(steps, axis=1) > 0).all()
        if degrees:
            assert abs(steps[:, 0]).max() < 180
    for area in back.areas or []:
        assert area.is_valid and (area.is_empty or area.area > 0)
        for part in getattr(area, "geoms", [area]):
            if suffix != ".shp" and part.exterior is not None and not part.is_empty:
                assert part.exterior.is_ccw and not any(ring.is_ccw for ring in part.interiors)
    if back.triangles is not None and len(back.triangles):
        a, b, c = (back.triangles[:, i] for i in range(3))
        assert (np.linalg.norm(np.cross(b - a, c - a), axis=-1) > 0).all()
