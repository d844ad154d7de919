"""Steps side by side, pictures of contours, and notebooks: panels, titles, colours and legends."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, fails, ok, run
from isocodec.api import plots
from isocodec.api.plots import plot_steps
from isocodec.errors import FormatError
from isocodec.plotting.panels import StepPanel, colours_of, contour_picture, panels_figure
from isocodec.verbs import Plot

FEW = [20.5, 60.5, 100.5, 140.5]


def mesh() -> isocodec.Mesh:
    points = np.stack(np.meshgrid(np.linspace(0, 2, 20), np.linspace(0, 1, 20)), axis=-1).reshape(-1, 2)
    return isocodec.Mesh(points, None, 80 * points[:, 0] + 13 * points[:, 1], stored="whole")


def file_of(kind: str, folder: Path) -> isocodec.IsoFile:
    if kind == "tiles":
        isocodec.save(folder / "tiles.iso", np.kron(HILLS, np.ones((2, 2), np.uint8)), FEW, tile=32)
        return isocodec.open(folder / "tiles.iso")
    made: dict[str, Any] = {
        "grid": lambda: isocodec.encode(HILLS, FEW, precision="exact"), "one": lambda: isocodec.encode(HILLS, 80.5),
        "series": lambda: isocodec.encode(isocodec.Frames([HILLS, HILLS // 2]), FEW),
        "mesh": lambda: isocodec.encode(mesh(), FEW), "surface": lambda: isocodec.encode(isocodec.thin(HILLS, to=80)),
        "volume": lambda: isocodec.encode(BALL, [40.5, 60.5]),
        "promised": lambda: isocodec.encode(HILLS, 80.5, precision=[4, 1, "exact"]),
    }
    return isocodec.open(made[kind]())


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[StepPanel]:
    """The panels of pictures made since."""
    seen: list[StepPanel] = []

    def noted(panels: list[StepPanel], *_: Any) -> bytes:
        seen.extend(panels)
        return b"picture"

    monkeypatch.setattr(plots, "panels_picture", noted)
    return seen


def sizes(panels: list[StepPanel]) -> list[int]:
    return [int(panel.title.split()[0].replace(",", "")) for panel in panels]


# ---- Steps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["grid", "one", "series", "mesh", "surface", "volume", "tiles", "promised"])
def test_steps_of_each_kind(kind: str, tmp_path: Path, drawn: list[StepPanel]) -> None:
    """From the first that shows something to the whole file, each what so many bytes decode to."""
    file = file_of(kind, tmp_path)
    plotted = plot_steps(file, ".png", Plot(steps=4))
    assert len(drawn) <= 4 and plotted.text.startswith(f"{len(drawn)} step")
    assert any(len(one.cells) for one in drawn[0].contours)
    assert sizes(drawn) == sorted({*sizes(drawn)})
    if kind != "series":
        assert sizes(drawn)[-1] == file.size and "100.0% of the file" in drawn[-1].title
    whole = file.contours() if kind != "surface" else [file.contour(v) for v in plotted.facts["isovalues"]]
    for one, other in zip(drawn[-1].contours, whole, strict=True):
        assert np.array_equal(one.points, other.points)


def test_promises_isovalues_frames_and_meshes_choose_steps(tmp_path: Path, drawn: list[StepPanel]) -> None:
    file = file_of("promised", tmp_path)
    plot_steps(file, ".png", Plot())
    assert [re.findall(r"within ([\d.]+)", panel.title) for panel in drawn] == [["4"], ["1"], []]
    promising = [k for k, one in enumerate(file.info.layers, 1) if one.within is not None]
    for panel, layer in zip(drawn, promising, strict=True):
        assert np.array_equal(panel.contours[0].points, file.contour(layers=layer).points)
    drawn.clear()
    plot_steps(file_of("grid", tmp_path), ".png", Plot(isovalues=(60.5,), steps=2))
    assert [[one.isovalue for one in panel.contours] for panel in drawn] == [[60.5], [60.5]]
    file = file_of("series", tmp_path)
    plotted = plot_steps(file, ".png", Plot(frame=1, steps=1))
    assert np.array_equal(drawn[-1].contours[1].points, file.contour(60.5, frame=1).points) and not plotted.remarks
    assert "only frame 0 of 2" in plot_steps(file, ".png", Plot(steps=1)).remarks[0]
    file = file_of("one", tmp_path)
    plot_steps(file, ".png", Plot(steps=2, draw_mesh=True))
    (points, cells), = drawn[-1].meshes
    assert np.array_equal(points, file.mesh().points) and np.array_equal(cells, file.mesh().cells)
    drawn.clear()
    plot_steps(isocodec.open(isocodec.encode(np.eye(20), 5)), ".png", Plot())
    assert len(drawn) == 1 and not len(drawn[0].contours[0].cells)


def test_a_truncated_file_is_drawn_as_far_as_it_goes(drawn: list[StepPanel]) -> None:
    data = isocodec.encode(HILLS, 80.5)
    part = isocodec.open(data[:-9])
    (remark,) = plot_steps(part, ".png", Plot(steps=3)).remarks
    assert remark == f"the file ends after {part.size} bytes, before it is complete; drawn as far as possible"
    assert np.array_equal(drawn[-1].contours[0].points, part.contour(partial=True).points)
    with pytest.raises(FormatError, match="ends"):
        plot_steps(isocodec.open(data[:8]), ".png", Plot())


# ---- Figures --------------------------------------------------------------------------------------------------------


def figure_of(panels: list[StepPanel], isovalues: list[float] | None = None) -> Any:
    return panels_figure(panels, "front", isovalues or [], 6, 2.6)


def test_panels_lie_side_by_side_with_colours_and_a_legend(tmp_path: Path) -> None:
    contours = file_of("grid", tmp_path).contours()
    figure = figure_of([StepPanel(contours[:2], "a"), StepPanel(contours, "b")], FEW)
    assert [axes.get_title() for axes in figure.axes] == ["a", "b"]
    for axes, count in zip(figure.axes, (2, 4), strict=True):
        found = [one.get_edgecolor()[0] for one in axes.collections]
        assert np.allclose(found, colours_of(FEW)[:count])
        assert axes.get_ylim() == (32.5, -0.5) and axes.get_xlim() == (-0.5, 40.5) and axes.get_aspect() == 1
    (legend,) = figure.legends
    assert [one.get_text() for one in legend.texts] == ["140.5", "100.5", "60.5", "20.5"]
    assert legend.get_title().get_text() == "isovalue"
    lines = figure.axes[1].collections[0].get_segments()
    assert np.allclose(np.concatenate(lines), np.concatenate([line[:, ::-1] for line in contours[0].lines]))


def test_many_panels_take_rows_and_many_isovalues_a_part_of_the_legend() -> None:
    contours = isocodec.open(isocodec.encode(HILLS, "every 5")).contours()
    figure = figure_of([StepPanel(contours)] * 9, [one.isovalue for one in contours])
    assert figure.axes[0].get_subplotspec().get_gridspec().get_geometry() == (2, 6)
    assert len(contours) > 30 and 6 < len(figure.legends[0].texts) <= 12


def test_proportions_of_the_placement() -> None:
    stretched = isocodec.decode(isocodec.encode(isocodec.Field(HILLS, placement=[[0, 30, 0], [-60, 0, 0]]), 80.5))
    assert figure_of([StepPanel([stretched])]).axes[0].get_aspect() == 2
    flat = isocodec.open(isocodec.encode(mesh(), 60.5)).contour()
    axes = figure_of([StepPanel([flat])]).axes[0]
    assert not axes.yaxis_inverted() and axes.get_aspect() == 1
    assert np.allclose(np.concatenate(axes.collections[0].get_segments()), np.concatenate(flat.lines))


def test_the_mesh_below_a_curve_is_its_triangles(tmp_path: Path) -> None:
    file = file_of("one", tmp_path)
    found = file.mesh()
    axes = figure_of([StepPanel([file.contour()], "", [(found.points, found.cells)])]).axes[0]
    (line,) = [one for one in axes.lines if len(one.get_xdata())]
    at = np.column_stack(line.get_data())
    there = {tuple(point) for point in at[~np.isnan(at).any(axis=1)]}
    assert there == {tuple(point[::-1]) for point in found.points[np.unique(found.cells)]}


@pytest.mark.parametrize("isovalues", [[1.0], [0.0, 1, 4], [4.0, 0, 1], [5.0, 5.0], [-1e30, 0, 1e30]])
def test_colours_rise_from_violet_to_yellow(isovalues: list[float]) -> None:
    colours = colours_of(isovalues)
    order = np.argsort(isovalues)
    assert (np.diff(colours[order].sum(axis=1)) >= 0).all() and len(np.unique(colours, axis=0)) == len({*isovalues})


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
@pytest.mark.parametrize("field", [HILLS, BALL], ids=["curve", "surface"])
def test_pictures_of_contours(suffix: str, magic: bytes, field: Any) -> None:
    contours = isocodec.open(isocodec.encode(field, [40.5, 60.5])).contours()
    one, two = (contour_picture(contours, suffix) for _ in range(2))
    assert one == two and one.startswith(magic)


def test_an_svg_lies_over_the_picture_of_its_field() -> None:
    """A unit is a pixel, whose middle is the sample."""
    contours = isocodec.open(isocodec.encode(HILLS, [60.5, 100.5])).contours()
    root = ElementTree.fromstring(contour_picture(contours, ".svg"))
    assert root.attrib["viewBox"] == "0 0 41 33"
    for contour in contours:
        (group,) = root.findall(f".//{{*}}g[@id='isovalue {contour.isovalue}']")
        text = " ".join(path.attrib["d"] for path in group.iterfind(".//{*}path"))
        found = np.array(re.findall(r"-?[\d.]+", text), float).reshape(-1, 2)
        assert np.abs(found[:, None] - 0.5 - contour.points[:, ::-1]).max(axis=2).min(axis=1).max() < 1e-5


# ---- Notebooks ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["grid", "series", "mesh", "volume", "tiles"])
def test_notebooks_show_a_picture_and_facts(kind: str, tmp_path: Path) -> None:
    file = file_of(kind, tmp_path)
    for shown in (file, file.contour()):
        page = ElementTree.fromstring(shown._repr_html_())
        (image,) = page.iter("img")
        assert base64.b64decode(image.attrib["src"].split(",")[1]).startswith(b"\x89PNG")
    known = {row.findtext("th"): row.findtext("td") for row in ElementTree.fromstring(file._repr_html_()).iter("tr")}
    assert known["bytes"] == f"{file.size:,}" and known["isovalues"] == ", ".join(f"{v:g}" for v in file.isovalues)


def test_notebooks_without_a_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond limits, without the mesh that is needed, or without matplotlib; notes are escaped."""
    notes = {"<b>&": "<script>alert(1)</script>"}
    data = isocodec.encode(HILLS, 80.5, metadata=notes)
    points = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    pages = [
        isocodec.open(data, limits=isocodec.Limits(vertices=5)),
        isocodec.open(isocodec.encode(isocodec.Mesh(points, [[0, 1, 2], [1, 3, 2]], [0, 1, 1, 2]), 0.5)),
    ]
    assert all("<img" not in page._repr_html_() and "isovalues" in page._repr_html_() for page in pages)
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    contour = isocodec.decode(data)
    assert contour._repr_png_() is None
    page = isocodec.open(data)._repr_html_()
    assert "<img" not in page and "<script>" not in page and "alert(1)" in page


# ---- The command line -----------------------------------------------------------------------------------------------


def test_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "in.iso").write_bytes(isocodec.encode(HILLS, FEW))
    assert "2 steps of" in ok("plot", tmp_path / "in.iso", "-o", tmp_path / "a.svg", "--steps", 2, "--draw-mesh")
    assert "100.0% of the file" in (tmp_path / "a.svg").read_text()
    ok("plot", tmp_path / "in.iso", "-o", tmp_path / "b.png", "--isovalue", 60.5)
    from PIL import Image

    assert Image.open(io.BytesIO((tmp_path / "b.png").read_bytes())).width > 300
    for words, message in (
        (["--isovalue", 3], "no isovalue 3"), (["--isovalue", 20.5, "--isovalue", 60.5], "need --map"),
        (["--title", "T"], "--title does not apply without --map"), (["--frame", 2], "no frame 2"),
        (["--view", "up"], "'up' is not a view"),
    ):
        assert message in fails(2, "plot", tmp_path / "in.iso", "-o", tmp_path / "c.png", *words)
    (tmp_path / "in.iso").write_bytes(isocodec.encode(HILLS, FEW)[:-5])
    result = run("plot", tmp_path / "in.iso", "-o", tmp_path / "d.png", "--steps", 1)
    assert result.exit_code == 0 and "drawn as far as possible" in result.stderr
