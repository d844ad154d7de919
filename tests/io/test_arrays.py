"""Arrays of numpy, their files and archives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError

CELLS = np.arange(60, dtype=np.int16).reshape(3, 4, 5)


@pytest.mark.parametrize("dtype", ["u1", ">i2", "<f4", ">f8", "f2", "?"])
def test_types(tmp_path: Path, dtype: str) -> None:
    values = (CELLS % 2).astype(dtype)
    np.save(tmp_path / "a.npy", values)
    found = isocodec.read(tmp_path / "a.npy").values
    assert np.array_equal(found, values) and found.dtype.isnative
    assert found.dtype == (np.uint8 if dtype == "?" else np.dtype(dtype).newbyteorder("="))


def test_files_are_mapped(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", CELLS)
    found: Any = isocodec.read(tmp_path / "a.npy")
    assert isinstance(found.values, np.memmap) or isinstance(found.values.base, np.memmap)


def test_masks_and_markers() -> None:
    values = np.ma.masked_equal(CELLS, 7)
    field: Any = isocodec.read(values)
    assert np.array_equal(field.mask, CELLS == 7)
    assert np.array_equal(isocodec.read(CELLS, nodata=9).mask, CELLS == 9)
    assert isocodec.encode(values, 20.5) == isocodec.encode(field, 20.5)


def test_frames() -> None:
    assert np.array_equal(isocodec.read(CELLS, frame=1).values, CELLS[1])
    series = isocodec.read(CELLS, frames=True)
    assert [np.array_equal(each.values, one) for each, one in zip(series, CELLS, strict=True)] == [True] * 3
    with pytest.raises(OptionError, match="no frame 3: the series has 3"):
        isocodec.read(CELLS, frame=3)
    with pytest.raises(OptionError, match="not a series"):
        isocodec.read(CELLS[0], frame=0)
    with pytest.raises(OptionError, match="three or four axes"):
        isocodec.read(CELLS[0], frames=True)


@pytest.mark.parametrize("array, held", [
    (np.array([["a", "b"]]), "strings"), (np.ones((2, 2), complex), "complex"),
    (np.array([["2020-01-01"]], "M8[D]"), "dates"), (np.zeros((2, 2), [("r", "u1")]), r"records \(r\)"),
])
def test_only_real_numbers(tmp_path: Path, array: Any, held: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=held):
        isocodec.read(tmp_path / "a.npy")


def test_archives(tmp_path: Path) -> None:
    np.savez(tmp_path / "one.npz", anything=CELLS)
    assert np.array_equal(isocodec.read(tmp_path / "one.npz").values, CELLS)
    np.savez(tmp_path / "a.npz", values=CELLS, other=CELLS + 1)
    assert np.array_equal(isocodec.read(tmp_path / "a.npz").values, CELLS)
    assert np.array_equal(isocodec.read(tmp_path / "a.npz", key="other", frame=2).values, CELLS[2] + 1)
    np.savez(tmp_path / "b.npz", a=CELLS, b=CELLS)
    with pytest.raises(InputError, match="2 arrays: a, b: choose one with --key"):
        isocodec.read(tmp_path / "b.npz")
    with pytest.raises(OptionError, match="single array"):
        np.save(tmp_path / "a.npy", CELLS)
        isocodec.read(tmp_path / "a.npy", key="a")
    np.savez(tmp_path / "c.npz", a=np.array([None, {}], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        isocodec.read(tmp_path / "c.npz")


@pytest.mark.parametrize("names", ["placement crs", "lon lat", "x y", "nodes"])
def test_archives_with_places(tmp_path: Path, names: str) -> None:
    values, x, y = CELLS[0], 5 + 0.5 * np.arange(5), 50 - 2.0 * np.arange(4)
    places = {"placement crs": {"placement": np.array([[0, 0.5, 5], [-2, 0, 50]]), "crs": "EPSG:32631"},
              "lon lat": {"lon": x, "lat": y}, "x y": {"x": x, "y": y},
              "nodes": dict(zip(("x", "y"), np.meshgrid(x, y), strict=True))}[names]
    np.savez(tmp_path / "a.npz", values=values, **places)
    field: Any = isocodec.read(tmp_path / "a.npz")
    placed = field.placement.place(np.array([[3.0, 4.0]]))
    assert np.allclose(placed, [[7, 44]]) and field.crs == ("EPSG:32631" if "crs" in names else None)
    np.savez(tmp_path / "b.npz", values=values, x=x[:-1], y=y)
    with pytest.warns(UserWarning, match="do not fit"):
        assert isocodec.read(tmp_path / "b.npz").placement is None


def test_archives_with_meshes(tmp_path: Path) -> None:
    points, cells = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]), np.array([[0, 1, 2], [1, 3, 2]])
    np.savez(tmp_path / "a.npz", points=points, cells=cells, h=np.arange(4.0), t=np.arange(8.0).reshape(2, 4))
    mesh: Any = isocodec.read(tmp_path / "a.npz", key="h")
    assert np.array_equal(mesh.points, points) and np.array_equal(mesh.values, np.arange(4))
    assert isocodec.read(tmp_path / "a.npz", key="t", frame=1).values.tolist() == [4, 5, 6, 7]
    assert isocodec.read(tmp_path / "a.npz").values is None
    assert isocodec.read(tmp_path / "a.npz", key="x").values.tolist() == [0, 1, 0, 1]
    with pytest.raises(InputError, match=r"'none'.*h, t"):
        isocodec.read(tmp_path / "a.npz", key="none")
