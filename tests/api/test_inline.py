"""What notebooks show, read as XML."""

from __future__ import annotations

import base64
import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS
from libraries import Late

Image = Late("PIL.Image")

SVG = "{http://www.w3.org/2000/svg}"


def parsed(html: str) -> ElementTree.Element:
    return ElementTree.fromstring(html)


def facts(page: ElementTree.Element) -> dict[str, str]:
    return {row.findtext("th") or "": row.findtext("td") or "" for row in page.iter("tr")}


def test_a_file() -> None:
    """Every isovalue is a path whose points are those of the contour, scaled; size, layers and notes stand under it."""
    data = isocodec.encode(HILLS, [60.5, 100.5], metadata={"<b>&": "<script>alert(1)</script>"})
    page = parsed(isocodec.open(data)._repr_html_())
    paths = list(page.iter(f"{SVG}path"))
    assert [path.findtext(f"{SVG}title") for path in paths] == ["isovalue 60.5", "isovalue 100.5"]
    scale = 480 / 41
    for path, contour in zip(paths, isocodec.open(data).contours(), strict=True):
        numbers = np.array([float(x) for x in re.findall(r"-?[\d.]+(?:e-?\d+)?", path.attrib["d"])]).reshape(-1, 2)
        expected = np.concatenate([line[:, ::-1] for line in contour.lines])
        assert np.allclose(numbers / scale - 0.5, expected, atol=0.05)
    known = facts(page)
    assert known["bytes"] == f"{len(data):,}" and known["isovalues"] == "60.5, 100.5"
    assert known["layers"] == str(len(isocodec.open(data).info.layers))
    assert known["<b>&"] == "<script>alert(1)</script>"
    assert not list(page.iter("script"))


def test_a_curve_and_a_surface() -> None:
    curve = parsed(isocodec.decode(isocodec.encode(HILLS, 80.5), layers=3)._repr_html_())
    assert len(list(curve.iter(f"{SVG}path"))) == 1 and facts(curve)["isovalue"] == "80.5"
    surface = parsed(isocodec.decode(isocodec.encode(BALL, 55.5))._repr_html_())
    (image,) = surface.iter("img")
    with Image.open(io.BytesIO(base64.b64decode(image.attrib["src"].split(",")[1]))) as picture:
        assert picture.size[0] > 100
    assert facts(surface)["samples"] == "17 x 17 x 17"


def test_promises_frames_and_meshes() -> None:
    steps = facts(parsed(isocodec.open(isocodec.encode(HILLS, 80.5, precision=[4, 1]))._repr_html_()))
    assert steps["promise"] == "within 4 cells, 1 cell"
    assert facts(
        parsed(isocodec.open(isocodec.encode(isocodec.Frames([HILLS] * 3), 80.5))._repr_html_())
    )["frames"] == "3"
    points = np.random.default_rng(1).random((60, 2))
    scattered = parsed(isocodec.open(isocodec.encode(isocodec.Mesh(points, None, points[:, 0]), 0.5))._repr_html_())
    assert len(list(scattered.iter(f"{SVG}path"))) == 1


@pytest.mark.parametrize("limits", [isocodec.Limits(vertices=5), isocodec.Limits(memory=1 << 20)])
def test_too_much_for_the_limits(limits: isocodec.Limits) -> None:
    big = np.indices((300, 300)).sum(axis=0) % 7
    page = parsed(isocodec.open(isocodec.encode(big, 3.5), limits=limits)._repr_html_())
    assert not list(page.iter(f"{SVG}path")) and not list(page.iter("img"))
    assert facts(page)["isovalues"] == "3.5"


def test_mesh_that_the_file_does_not_hold() -> None:
    points = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    known = isocodec.encode(isocodec.Mesh(points, [[0, 1, 2], [1, 3, 2]], [0, 1, 1, 2]), 0.5)
    page = parsed(isocodec.open(known)._repr_html_())
    assert not list(page.iter(f"{SVG}path")) and facts(page)["isovalues"] == "0.5"
