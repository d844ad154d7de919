"""Pictures show all isovalues of a file, each in its colour, or one alone; steps are those of the whole file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import run
from isocodec.api.plots import Panels, Steps, runs_of, steps_of
from isocodec.drawing.pictures.colours import colours_of, places_of
from isocodec.drawing.pictures.picture import contour_picture
from isocodec.drawing.pictures.shading import vertex_normals
from libraries import Late
from tables import looped

to_hex = Late("matplotlib.colors.to_hex")
Image = Late("PIL.Image")
Delaunay = Late("scipy.spatial.Delaunay")

MANY = [float(value) for value in range(5, 215, 5)]
"""42 isovalues."""


def cone(size: int = 96) -> np.ndarray:
    y, x = np.mgrid[0:size, 0:size]
    return np.asarray(np.round(230 - 3.4 * np.hypot(x - size / 2, y - size / 2)).clip(0)).astype(np.int16)


def ball() -> np.ndarray:
    at = np.indices((28, 28, 28)) - 13.5
    return np.asarray(np.round(50 - 4 * np.sqrt((at**2).sum(axis=0)))).astype(np.int16)


def mesh() -> isocodec.Mesh:
    points = np.stack(np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40)), axis=-1).reshape(-1, 2)
    return isocodec.Mesh(points, Delaunay(points).simplices, 200 * points[:, 0] + 13 * points[:, 1], stored="whole")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of each kind with several isovalues."""
    folder = tmp_path_factory.mktemp("files")
    few = [20.5, 60.5, 100.5, 140.5]
    made: dict[str, Any] = {
        "map": isocodec.encode(cone(), [value + 0.5 for value in MANY], precision="exact"),
        "series": isocodec.encode(isocodec.Frames([cone(), cone() // 2]), few, precision="exact"),
        "mesh": isocodec.encode(mesh(), few),
        "surface": isocodec.encode(isocodec.thin(cone(48), to=300)),
        "volume": isocodec.encode(ball(), [0.5, 20.5], precision="exact"),
    }
    for name, data in made.items():
        (folder / f"{name}.iso").write_bytes(data)
    isocodec.save(folder / "tiles.iso", cone(), few, precision="exact", tile=32)
    return {name: folder / f"{name}.iso" for name in (*made, "tiles")}


COUNTS = {"map": 42, "series": 4, "mesh": 4, "tiles": 4}


@looped("kind", sorted(COUNTS))
@looped("suffix", [".svg", ".png"])
def test_colour_of_every_isovalue_is_in_the_picture(files: dict[str, Path], kind: str, suffix: str) -> None:
    file = isocodec.open(files[kind])
    plotted = steps_of(file, f"o{suffix}", Steps(count=1))
    data = plotted.render()
    colours = colours_of(file.isovalues)
    assert len({to_hex(colour) for colour in colours}) == len(file.isovalues) == COUNTS[kind]
    assert plotted.facts["isovalues"] == list(file.isovalues)
    if suffix == ".svg":
        text = data.decode()
        drawn = [text.count(f"stroke: {to_hex(colour)}") for colour in colours]
        assert min(drawn) >= 1
        return
    pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).reshape(-1, 3)
    for colour in np.rint(colours * 255):
        assert (np.abs(pixels - colour).max(axis=1) <= 1).sum() > 5


@looped("kind", ["map", "series", "mesh", "tiles", "volume"])
def test_one_isovalue_alone(files: dict[str, Path], kind: str) -> None:
    file = isocodec.open(files[kind])
    chosen = file.isovalues[1]
    plotted = steps_of(file, "o.svg", Steps(count=2, isovalue=chosen))
    assert plotted.facts["isovalues"] == [chosen]
    assert not any(to_hex(colour) in plotted.render().decode() for colour in colours_of(file.isovalues))


def test_steps_are_those_of_the_whole_file(files: dict[str, Path]) -> None:
    for kind in COUNTS:
        file = isocodec.open(files[kind])
        steps = steps_of(file, "o.png", Steps(count=4)).facts["steps"]
        assert len(steps) == len(set(steps)) and steps == sorted(steps), kind
        assert kind == "series" or steps[-1] >= file.size - 8, kind


def test_volume_and_surface_of_points(files: dict[str, Path]) -> None:
    volume = steps_of(isocodec.open(files["volume"]), "o.png", Steps(count=1))
    assert volume.facts["isovalues"] == [0.5, 20.5]
    pixels = np.asarray(Image.open(io.BytesIO(volume.render())).convert("RGB")).reshape(-1, 3).astype(int)
    # the inner surface is green, the outer one, blue, is seen around it
    assert (pixels[:, 1] - pixels[:, 2] > 40).sum() > 500
    assert (pixels[:, 2] - pixels[:, 0] > 15).sum() > 500
    surface = steps_of(isocodec.open(files["surface"]), "o.png", Steps())
    assert len(surface.facts["isovalues"]) > 5
    assert surface.render().startswith(b"\x89PNG")


def test_command_line_draws_all_or_one(files: dict[str, Path], tmp_path: Path) -> None:
    target = tmp_path / "o.svg"
    done = run("plot", files["map"], "-o", target, "--steps", 2)
    assert done.exit_code == 0 and "only isovalue" not in done.stderr
    text = target.read_text()
    assert "42 isovalues" in text or text.count("<path") > 100
    assert run("plot", files["map"], "-o", target, "--isovalue", 100.5).exit_code == 0


@looped(("isovalues", "expected"), [
    ([1.0], [0]), ([0.0, 1, 2], [0, 0.5, 1]), ([2.0, 0, 1], [1, 0, 0.5]), ([0.0, 1, 4], [0, 0.25, 1]),
    ([1.0, 10, 100, 1000], [0, 1 / 3, 2 / 3, 1]), ([5.0, 5.0], [0, 0]), ([-1e30, 0, 1e30], [0, 0.5, 1]),
])
def test_places_of_colours(isovalues: list[float], expected: list[float]) -> None:
    assert np.allclose(places_of(isovalues), expected)


@looped(("isovalues", "steps", "expected"), [
    ([0] * 3 + [1] * 2 + [2] * 2, 3, [3, 5, 7]), ([0] * 3 + [1] * 2 + [2] * 2, 2, [5, 7]),
    ([0] * 2 + [1] * 2, 4, [1, 2, 3, 4]), ([0] * 2 + [1] * 2, 5, [1, 2, 3, 4]), ([0] * 2 + [1] * 2, 1, [4]),
])
def test_panels_over_isovalues(isovalues: list[int], steps: int, expected: list[int]) -> None:
    panels = Panels(["values"] * len(isovalues), steps, (), isovalues)
    assert [number for number in range(1, len(isovalues) + 1) if panels.draws(number, lambda: True)] == expected
    assert sum(map(len, runs_of(isovalues))) == len(isovalues)


def test_curves_of_many_isovalues_on_a_mesh_are_one_picture() -> None:
    contours = isocodec.open(isocodec.encode(mesh(), [20.5, 60.5, 100.5])).contours()
    pixels = np.asarray(Image.open(io.BytesIO(contour_picture(contours))).convert("RGB")).reshape(-1, 3)
    for colour in np.rint(colours_of([20.5, 60.5, 100.5]) * 255):
        assert (np.abs(pixels - colour).max(axis=1) <= 1).sum() > 20


def test_normals_of_vertices_are_those_of_trimesh() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(3)
    found = vertex_normals(np.asarray(ball.vertices), np.asarray(ball.faces))
    assert np.einsum("ij,ij->i", found, ball.vertices).min() > 0.999
    box = trimesh.creation.box().subdivide()
    theirs = trimesh.geometry.weighted_vertex_normals(len(box.vertices), box.faces, box.face_normals,
                                                      np.repeat(box.area_faces[:, None], 3, axis=1))
    assert np.allclose(vertex_normals(np.asarray(box.vertices), np.asarray(box.faces)), theirs)
