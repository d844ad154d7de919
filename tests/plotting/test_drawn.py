"""What ``plot`` draws: steps, the last one of a part of a file, and the mesh."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, fails, ok, run
from files import picture as field_of
from isocodec.api import plots
from isocodec.drawing.pictures import picture
from isocodec.drawing.pictures.picture import Step
from isocodec.drawing.pictures.view import USUAL, upright
from isocodec.stream.inspect import inspect
from libraries import Late

Figure = Late("matplotlib.figure.Figure")


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Step]:
    """The steps of pictures made since."""
    seen: list[Step] = []
    make = plots.steps_picture

    def noted(steps: list[Step], *how: object) -> bytes:
        seen.extend(steps)
        return make(steps, *how)

    monkeypatch.setattr(plots, "steps_picture", noted)
    return seen


def same(a: isocodec.Contour, b: isocodec.Contour) -> bool:
    return np.array_equal(a.points, b.points) and np.array_equal(a.cells, b.cells) and a.complete == b.complete


# ---- Steps ----------------------------------------------------------------------------------------------------------


def test_each_step_is_what_its_bytes_decode_to(curve: Path, curve_data: bytes, drawn: list[Step]) -> None:
    ok("plot", curve, "-o", curve.with_suffix(".png"), "--steps", 3)
    layers = len(isocodec.open(curve_data).info.layers)
    assert len(drawn) == 3
    first = next(n for n in range(1, layers + 1) if len(isocodec.decode(curve_data, layers=n).cells))
    for step, number in zip(drawn, (first, first + round((layers - first) / 2), layers), strict=True):
        alone = isocodec.decode(curve_data, layers=number)
        assert np.array_equal(step.contours[0].points, alone.points)
        assert step.total == len(curve_data) and not step.meshes and step.within is None
    assert [step.bytes for step in drawn] == sorted({step.bytes for step in drawn})
    assert drawn[-1].bytes <= len(curve_data)


@pytest.mark.parametrize("mesh", [False, True])
def test_the_last_step_of_a_part_of_a_file(tmp_path: Path, drawn: list[Step], mesh: bool) -> None:
    """Behind the whole layers comes what the bytes of the next one tell: of all bytes, and with no promise."""
    data = isocodec.encode(field_of((50, 60), 3), 0.5, precision=[4, 1, 0.25])
    layers = inspect(data, symbols=True).layers
    promised = [i for i, layer in enumerate(layers, 1) if layer.within]
    last = layers[-1]
    assert last.offset is not None and last.bytes is not None and last.bytes > 40
    part = tmp_path / "part.iso"
    part.write_bytes(data[: last.offset + last.bytes // 2])
    size = part.stat().st_size
    assert "use --partial" in fails(5, "plot", part, "-o", tmp_path / "a.png")
    assert not drawn
    result = run("plot", part, "-o", tmp_path / "a.png", "--partial", *(["--draw-mesh"] if mesh else []))
    assert result.exit_code == 0
    said = f"{tmp_path / 'a.png'}: {len(promised)} steps of {size:,} bytes, "
    assert re.fullmatch(re.escape(said) + r"[0-9.]+ s\n", result.stdout)
    assert [step.within for step in drawn] == [4, 1, None]
    *_, before, received = drawn
    assert received.bytes == received.total == size == before.total > before.bytes
    assert same(received.contours[0], isocodec.decode(data, max_bytes=size))
    assert not np.array_equal(received.contours[0].points, before.contours[0].points)
    assert np.array_equal(before.contours[0].points, isocodec.decode(data, layers=promised[1]).points)
    assert bool(received.meshes) == mesh


def test_a_part_that_ends_with_a_layer_has_no_step_more(tmp_path: Path, drawn: list[Step]) -> None:
    data = isocodec.open(isocodec.encode(HILLS, 80.5, layers=4)).edited(layers=2)
    part = tmp_path / "part.iso"
    part.write_bytes(data[:-2])
    result = run("plot", part, "-o", tmp_path / "a.png", "--partial")
    assert result.exit_code == 0 and len(drawn) == 2
    assert same(drawn[-1].contours[0], isocodec.decode(data[:-2], max_bytes=len(data)))


# ---- Words for truncated files --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("verb", "out", "word"), [
        (["decode"], "c.svg", "decoded"), (["plot"], "c.png", "drawn"),
        (["decode", "--what", "above"], "c.npy", "decoded"),
    ]
)
def test_truncated_files_are_not_called_invalid(tmp_path: Path, verb: list[str], out: str, word: str) -> None:
    data = isocodec.encode(HILLS, 80.5)
    part = tmp_path / "part.iso"
    part.write_bytes(data[:-6])
    why = f"isocodec: {part}: the file ends after {len(data) - 6} bytes, before it is complete"
    line = fails(5, *verb, part, "-o", tmp_path / out)
    assert line.startswith(why) and line.endswith(": use --partial to decode as much as there is")
    assert "valid" not in line and not (tmp_path / out).exists()
    result = run(*verb, part, "-o", tmp_path / out, "--partial")
    assert result.exit_code == 0 and (tmp_path / out).exists()
    said = f"{why.replace(': the file', ': warning: the file')}; {word} as far as possible"
    assert result.stderr.splitlines()[-1] == said
    part.write_bytes(data[:-6] + bytes(6))
    assert "not a valid .iso file: " in fails(4, *verb, part, "-o", tmp_path / out)


@pytest.mark.parametrize("out", ["c.npz", "c.geojson", "c.svg", "c.png"])
@pytest.mark.parametrize("most", [1, 3, 8])
def test_fewer_bytes_than_a_header(curve: Path, tmp_path: Path, out: str, most: int) -> None:
    """Whether a part would do or not: there is no curve to be written."""
    for more in ((), ("--partial",)):
        line = fails(5, "decode", curve, "-o", tmp_path / out, "--max-bytes", most, *more)
        assert line == f"isocodec: {curve}: the file ends before its curve begins"
        assert not (tmp_path / out).exists()


# ---- The mesh -------------------------------------------------------------------------------------------------------


def drawn_mesh(contour: isocodec.Contour, *mesh: np.ndarray) -> np.ndarray:
    """What is drawn of a mesh: lines of points in the picture's coordinates."""
    axes: Any = Figure().add_subplot()
    picture._draw_mesh(axes, contour, *mesh)
    (lines,) = axes.collections
    return np.array(lines.get_segments())


def test_the_mesh_under_a_curve_is_its_triangles(curve_data: bytes) -> None:
    """Each side once, columns across and rows down, whoever shares it."""
    decoder = isocodec.Decoder()
    decoder.feed(curve_data)
    decoder.close()
    mesh = decoder.grid.mesh()
    position, triangles = mesh.points, mesh.cells
    sides = {
        frozenset((tuple(position[a][::-1]), tuple(position[b][::-1])))
        for x, y, z in triangles for a, b in ((x, y), (y, z), (z, x))
    }
    segments = drawn_mesh(decoder.contour(), position, triangles)
    assert len(segments) == len(sides) < 3 * len(triangles)
    assert {frozenset(map(tuple, segment)) for segment in segments} == sides


@pytest.mark.parametrize("field", [BALL, 100 - BALL], ids=["above outside", "above inside"])
def test_the_mesh_of_a_surface_is_what_looks_at_the_viewer(field: np.ndarray) -> None:
    """Of a ball the nearer half, whichever side of it is above; triangles as they lie in the picture of the surface."""
    isovalue = 55.5 if field is BALL else 44.5
    contour = isocodec.decode(isocodec.encode(field, isovalue, precision="exact"))
    corners = contour.points[contour.cells] - 8.0
    world = upright(contour).T
    near = corners.mean(axis=1) @ world @ USUAL.towards
    # normals of a ball point away from its middle, or towards it; those at its outline may look either way
    clear = np.abs(near) > 1.0
    segments = drawn_mesh(contour, *(np.zeros((0, k), np.int64) for k in (3, 4)))
    assert segments.shape[1:] == (4, 2) and np.array_equal(segments[:, 0], segments[:, 3])
    flat = corners @ world @ USUAL.screen
    shown = {segment[:3].round(9).tobytes() for segment in segments + 0.0}
    is_shown = np.array([triangle.tobytes() in shown for triangle in flat.round(9) + 0.0])
    assert clear.sum() > 0.5 * len(near)
    assert np.array_equal(is_shown[clear], near[clear] > 0)
