"""The mesh as a file: against recursive bisection, and read back with the libraries that its users have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import blobs, clamped, examples, exponent, meshes, mixed_leaves, volumes
from commands import BALL, HILLS, fails, ok
from isocodec.drawing.tessellation import Tessellation, tessellated
from isocodec.errors import TruncatedError
from isoconform.meshes import chosen
from libraries import Late
from written import rendered

meshio = Late("meshio")
shapely = Late("shapely")
trimesh = Late("trimesh")

# Two triangles of a square of 4 samples a side, split along the diagonal from (0, 0); one vertex lies above.
SQUARE = Tessellation(
    points=np.array([(0, 0), (0, 3), (3, 0), (3, 3)]),
    cells=np.array([(0, 2, 3), (0, 3, 1)]),
    levels=np.array([0, 1]),
    above=np.array([False, True, False, False]),
    isovalue=0.5,
    shape=(4, 4),
)


def decoder_of(data: bytes, **options) -> isocodec.Decoder:
    decoder = isocodec.Decoder(**options)
    decoder.feed(data)
    decoder.close()
    return decoder


@st.composite
def cases(draw, n: int, most: int):
    shape = tuple(draw(st.lists(st.integers(2, most), min_size=n, max_size=n)))
    return shape, draw(meshes(shape, frozenset())), draw(st.integers(0, 2**16))


def check_mesh(case, n: int) -> None:
    """It fills the box, is conforming, and its crossed leaves are those of recursive bisection."""
    shape, mesh, seed = case
    field = blobs(shape, seed)
    plan = [("adaptive_base", 0, chosen(shape, mesh))]
    decoder = decoder_of(isocodec.encode(field, 0.5, layers=plan))
    whole = decoder.grid.mesh()
    corners = whole.points[whole.cells]
    assert volumes(corners).min() > 0
    assert volumes(corners).sum() == np.prod(np.array(shape) - 1) * (2 if n == 2 else 6)
    sides = np.sort(np.concatenate([np.delete(whole.cells, i, axis=1) for i in range(n + 1)]), axis=1)
    side, count = np.unique(sides, axis=0, return_counts=True)
    assert count.max() <= 2
    at = whole.points[side[count == 1]]
    border = (at == 0).all(axis=1) | (at == np.array(shape) - 1).all(axis=1)
    assert border.any(axis=1).all()  # a side with one simplex lies on the border: no hanging vertices
    signs = whole.above[whole.cells]
    mixed = signs.any(axis=1) & ~signs.all(axis=1)
    crossed = np.unique(whole.cells[mixed])
    assert np.array_equal(whole.above[crossed], field[tuple(whole.points[crossed].T)])
    tube = decoder.grid.mesh(whole=False)

    def named(mesh: Tessellation, cells) -> set[tuple[int, frozenset[tuple[int, ...]]]]:
        levels = mesh.levels[cells]
        return {(int(level), frozenset(map(tuple, places))) for level, places in
                zip(levels.tolist(), mesh.points[mesh.cells[cells]].tolist(), strict=True)}

    expected = {
        (level, frozenset(map(tuple, np.frombuffer(places, np.int64).reshape(n + 1, n).tolist())))
        for level, places in mixed_leaves(field, mesh)
    }
    assert named(whole, mixed) == named(tube, slice(None)) == expected
    assert np.array_equal(tube.above, field[tuple(tube.points.T)])


@given(cases(2, 12))
@examples(40)
def test_meshes_in_the_plane(case) -> None:
    check_mesh(case, 2)


@given(cases(3, 6))
@examples(25)
def test_meshes_in_space(case) -> None:
    check_mesh(case, 3)


@pytest.mark.parametrize("shape, level", [((5, 9), 3), ((4, 6, 3), 5), ((3, 3, 3), 3)])
def test_uniform_meshes_are_those_of_a_level(shape: tuple[int, ...], level: int) -> None:
    none = np.zeros((0, len(shape)), np.int64)
    points, cells, levels = tessellated(shape, exponent(shape), level, none, lambda size: None)
    assert set(levels) == {level}
    found = {frozenset(map(tuple, corners)) for corners in points[cells].tolist()}
    assert found == {frozenset(map(tuple, corners)) for corners in clamped(shape, level).tolist()}


@pytest.mark.parametrize("field, isovalue", [(HILLS, 60.5), (BALL, 50.5)])
def test_on_the_full_grid_signs_are_those_of_all_samples(field: np.ndarray, isovalue: float) -> None:
    mesh = decoder_of(isocodec.encode(field, isovalue)).grid.mesh()
    assert len(mesh.points) == field.size
    assert np.array_equal(mesh.above, field[tuple(mesh.points.T)] > isovalue)
    nothing = decoder_of(isocodec.encode(field, -1)).grid.mesh()
    assert nothing.above.all()


def test_the_bytes_of_a_small_ply() -> None:
    """x runs along axis 1, y along axis 0; triangles are turned so that they are seen counter-clockwise."""
    data = rendered(SQUARE, ".ply")
    head, _, body = data.partition(b"end_header\n")
    assert head.splitlines()[2:] == [
        b"element vertex 4", b"property double x", b"property double y", b"property double z", b"property uchar above",
        b"element face 2", b"property list uchar int vertex_indices", b"property uchar level",
    ]
    zero, three = bytes(8), bytes.fromhex("0000000000000840")  # 3.0
    assert body == (
        zero * 3 + b"\0" + three + zero * 2 + b"\1" + zero + three + zero + b"\0" + three * 2 + zero + b"\0"
        + bytes([3, 0, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0, 0]) + bytes([3, 0, 0, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 1])
    )


def test_the_polygons_of_a_small_geojson() -> None:
    features = json.loads(rendered(SQUARE, ".geojson"))["features"]
    assert [feature["properties"] for feature in features] == [
        {"level": 0, "above": [0, 0, 0]}, {"level": 1, "above": [0, 1, 0]},
    ]
    assert features[0]["geometry"]["coordinates"] == [[[0, 0], [3, 3], [0, 3], [0, 0]]]
    for feature in features:
        polygon = shapely.geometry.shape(feature["geometry"])
        assert polygon.area == 4.5 and polygon.exterior.is_ccw


@pytest.mark.parametrize("mirrored", [False, True])
def test_vtu_of_a_surface_is_read_back(tmp_path: Path, mirrored: bool) -> None:
    source, out = tmp_path / "ball.iso", tmp_path / "mesh.vtu"
    placement = [(0, 0, 2, 10), (0, 3, 0, -5), (1 if mirrored else -1, 0, 0, 0)]
    source.write_bytes(isocodec.encode(isocodec.Field(BALL, placement=placement), 50.5, layers="distortion=1"))
    assert "tetrahedra" in ok("decode", source, "--what", "mesh", "--whole", "-o", out)
    read = meshio.read(out)
    cells = read.cells_dict["tetra"]
    corners = read.points[cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    # 16 cells a side, of 2 * 3 * 1 each
    assert volume.min() > 0 and volume.sum() == pytest.approx(16**3 * 6)
    assert read.points.min(axis=0).tolist() == [10, -5, 0 if mirrored else -16]
    index = np.rint((read.points - (10, -5, 0)) / (2, 3, 1 if mirrored else -1)).astype(int)[:, ::-1]
    mesh = decoder_of(source.read_bytes()).grid.mesh()
    assert np.array_equal(index, mesh.points)
    assert np.array_equal(read.point_data["above"], mesh.above)
    assert np.array_equal(read.cell_data["level"][0], mesh.levels)
    ok("decode", source, "--what", "mesh", "-o", out, "--in-samples")
    tube = meshio.read(out)
    assert 0 < len(tube.cells_dict["tetra"]) < len(cells) and tube.points.max() <= 16
    assert (np.ptp(tube.point_data["above"][tube.cells_dict["tetra"]], axis=1) == 1).all()


def test_ply_of_a_surface_is_read_back(tmp_path: Path) -> None:
    source, out = tmp_path / "ball.iso", tmp_path / "mesh.ply"
    source.write_bytes(isocodec.encode(BALL, 50.5, layers="distortion=1"))
    ok("decode", source, "--what", "mesh", "--whole", "-o", out)
    mesh = decoder_of(source.read_bytes()).grid.mesh()
    read = trimesh.load(out, process=False)
    assert np.array_equal(read.vertices, mesh.points)
    sides = np.sort(np.concatenate([np.delete(mesh.cells, i, axis=1) for i in range(4)]), axis=1)
    assert np.array_equal(np.unique(np.sort(read.faces, axis=1), axis=0), np.unique(sides, axis=0))
    assert len(read.faces) == len(np.unique(sides, axis=0))


def test_a_curve_in_each_format_has_the_same_triangles(tmp_path: Path) -> None:
    source = tmp_path / "hills.iso"
    source.write_bytes(isocodec.encode(isocodec.Field(HILLS, placement=(-30.0, 30.0)), 60.5, precision=1))
    for part in ("whole", "tube"):
        told = {}
        for suffix in (".vtu", ".ply", ".geojson"):
            out = tmp_path / f"mesh{suffix}"
            whole = ["--whole"] if part == "whole" else []
            facts = json.loads(ok("decode", source, "--what", "mesh", *whole, "-o", out, "--json"))
            told[suffix] = facts["triangles"]
        read = meshio.read(tmp_path / "mesh.vtu")
        cells = read.cells_dict["triangle"]
        flat = trimesh.load(tmp_path / "mesh.ply", process=False)
        features = json.loads((tmp_path / "mesh.geojson").read_text())["features"]
        assert set(told.values()) == {len(cells)} == {len(flat.faces)} == {len(features)}
        assert np.array_equal(flat.vertices, read.points) and np.array_equal(flat.faces, cells)
        rings = np.array([feature["geometry"]["coordinates"][0][:3] for feature in features])
        assert np.array_equal(rings, read.points[cells][:, :, :2])
        areas = [shapely.geometry.shape(feature["geometry"]).area for feature in features]
        # rows run southwards: y from -960 to 0, x from 0 to 1200
        assert rings.reshape(-1, 2).min() >= -960
        if part == "whole":
            assert sum(areas) == 960 * 1200


def test_layers_have_meshes_of_their_own(tmp_path: Path) -> None:
    source, out = tmp_path / "hills.iso", tmp_path / "mesh.vtu"
    source.write_bytes(isocodec.encode(HILLS, 60.5, layers="base 2\nrefine"))
    counts = []
    for layers in (1, 3, 11):
        ok("decode", source, "--what", "mesh", "--whole", "-o", out, "--layers", layers)
        read = meshio.read(out)
        assert set(read.cell_data["level"][0]) == {layers + 1}
        counts.append(len(read.cells_dict["triangle"]))
    # a root square of 64, of which 32 x 40 cells are there; two triangles for each square of 32, then of 16, of 1
    assert counts == [2 * 1 * 2, 2 * 2 * 3, 2 * 32 * 40]


def test_what_cannot_be_written(tmp_path: Path) -> None:
    source = tmp_path / "ball.iso"
    data = isocodec.encode(BALL, 50.5)
    source.write_bytes(data)
    assert "--smooth/--no-smooth does not apply to --what mesh" in fails(
        2, "decode", source, "--what", "mesh", "--smooth", "-o", tmp_path / "a.ply"
    )
    line = fails(2, "decode", source, "--what", "mesh", "-o", tmp_path / "a.stl")
    assert "one of .geojson, .vtu, .ply" in line
    assert ".geojson cannot hold the mesh of a 3-D field" in fails(
        2, "decode", source, "--what", "mesh", "-o", tmp_path / "a.geojson"
    )
    few = ("decode", source, "--what", "mesh", "--whole", "-o", tmp_path / "a.vtu")
    assert "needs more than 2 MiB" in fails(6, *few, "--limit-memory", "2M")
    source.write_bytes(isocodec.encode(BALL, 50.5, layers=12))
    assert "too little has been received to know the mesh" in fails(5, *few, "--max-bytes", 40)
    ok("decode", source, "--what", "mesh", "-o", tmp_path / "part.vtu", "--max-bytes", 40)
    (tmp_path / "part.vtu").unlink()
    assert [path.name for path in tmp_path.iterdir()] == ["ball.iso"]
    decoder = isocodec.Decoder()
    with pytest.raises(TruncatedError):
        decoder.grid.mesh()
