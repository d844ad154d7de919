"""Contours of surfaces in files (spec clause 10.9)."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from commands import fails, ok
from isocodec.errors import OptionError


def test_contours_of_surfaces(tmp_path):
    """A surface of all samples has the crossings of the field along the sides of its triangles, turned alike."""
    y, x = np.mgrid[:20, :26]
    field = np.hypot(y - 9.3, x - 12.1)
    data = isocodec.encode_tin(field, error=0.0)
    contour = isocodec.decode(data, isovalue=6.25)
    far = np.abs(np.hypot(contour.points[:, 0] - 9.3, contour.points[:, 1] - 12.1) - 6.25)
    assert far.max() < 0.1 and contour.shape == field.shape
    (line,) = contour.lines
    (other,) = isocodec.decode(isocodec.encode(field, 6.25)).lines

    def area(points):
        return float(np.sum(points[:-1, 0] * points[1:, 1] - points[1:, 0] * points[:-1, 1])) / 2

    assert abs(area(line) - area(other)) < 1.0
    (tmp_path / "a.iso").write_bytes(data)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.svg", "--isovalue", 6.25)
    with pytest.raises(OptionError, match="which isovalue"):
        isocodec.decode(data)
    assert len(isocodec.decode(data, isovalue=1e9).points) == 0
    scattered = isocodec.encode_tin(np.argwhere(field < 99) * 0.5, field.ravel(), error=0.1)
    assert isocodec.decode(scattered, isovalue=6.25).shape == ()
    (tmp_path / "b.iso").write_bytes(scattered)
    ok("decode", tmp_path / "b.iso", "-o", tmp_path / "b.geojson", "--isovalue", 6.25)
    assert ".svg" in fails(2, "decode", tmp_path / "b.iso", "-o", tmp_path / "b.svg", "--isovalue", 6.25)
