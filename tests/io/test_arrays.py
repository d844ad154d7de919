"""Arrays of numpy, their files and archives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from tables import looped

CELLS = np.arange(60, dtype=np.int16).reshape(3, 4, 5)


@looped("dtype", ["u1", ">i2", "<f4", ">f8", "f2", "?"])
def test_types(tmp_path: Path, dtype: str) -> None:
    """Kept in native order, truth values as bytes; samples stay in the file."""
    values = (CELLS % 2).astype(dtype)
    np.save(tmp_path / "a.npy", values)
    found: Any = isocodec.read(tmp_path / "a.npy").values
    assert np.array_equal(found, values) and found.dtype.isnative
    assert found.dtype == (np.uint8 if dtype == "?" else np.dtype(dtype).newbyteorder("="))
    assert isinstance(found, np.memmap) or isinstance(found.base, np.memmap) or dtype[0] in ">?"


def test_masks_markers_and_frames() -> None:
    values = np.ma.masked_equal(CELLS, 7)
    field: Any = isocodec.read(values)
    assert np.array_equal(field.mask, CELLS == 7)
    assert np.array_equal(isocodec.read(CELLS, nodata=9).mask, CELLS == 9)
    assert isocodec.encode(values, 20.5) == isocodec.encode(field, 20.5)
    assert np.array_equal(isocodec.read(CELLS, frame=1).values, CELLS[1])
    assert all(np.array_equal(a.values, b) for a, b in zip(isocodec.read(CELLS, frames=True), CELLS, strict=True))
    for array, choice, words in ((CELLS, {"frame": 3}, "no frame 3: the series has 3"),
                                 (CELLS[0], {"frame": 0}, "not a series"),
                                 (CELLS[0], {"frames": True}, "three or four axes")):
        with pytest.raises(OptionError, match=words):
            isocodec.read(array, **choice)


@looped("array, held", [
    (np.array([["a", "b"]]), "<U1"), (np.ones((2, 2), complex), "complex"), (np.zeros((2, 2), [("r", "u1")]), "'r'"),
    (np.array([["2020-01-01"]], "M8[D]"), "datetime"),
])
def test_only_real_numbers(tmp_path: Path, array: Any, held: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=held):
        isocodec.read(tmp_path / "a.npy")


def test_archives(tmp_path: Path) -> None:
    """The only array, the one named ``values``, or that of a key."""
    np.save(tmp_path / "a.npy", CELLS)
    np.savez(tmp_path / "one.npz", anything=CELLS)
    np.savez(tmp_path / "a.npz", values=CELLS, other=CELLS + 1)
    np.savez(tmp_path / "b.npz", a=CELLS, b=CELLS)
    np.savez(tmp_path / "c.npz", a=np.array([None, {}], dtype=object))
    np.savez(tmp_path / "d.npz")
    other = {"key": "other", "frame": 2}
    for name, choice, right in (("one", {}, CELLS), ("a", {}, CELLS), ("a", other, CELLS[2] + 1)):
        assert np.array_equal(isocodec.read(tmp_path / f"{name}.npz", **choice).values, right)
    for name, choice, words in (("b.npz", {}, "2 arrays: a, b: choose one with --key"), ("c.npz", {}, "cannot be read"),
                                ("d.npz", {}, "no arrays"), ("a.npy", {"key": "a"}, "single array")):
        with pytest.raises((InputError, OptionError), match=words):
            isocodec.read(tmp_path / name, **choice)


@looped("names", ["placement crs", "lon lat", "x y", "nodes"])
def test_archives_with_places(tmp_path: Path, names: str) -> None:
    values, x, y = CELLS[0], 5 + 0.5 * np.arange(5), 50 - 2.0 * np.arange(4)
    places = {"placement crs": {"placement": np.array([[0, 0.5, 5], [-2, 0, 50]]), "crs": "EPSG:32631"},
              "lon lat": {"lon": x, "lat": y}, "x y": {"x": x, "y": y},
              "nodes": dict(zip(("x", "y"), np.meshgrid(x, y), strict=True))}[names]
    np.savez(tmp_path / "a.npz", values=values, **places)
    field: Any = isocodec.read(tmp_path / "a.npz")
    assert np.allclose(field.placement.place(np.array([[3.0, 4.0]])), [[7, 44]])
    assert field.crs == ("EPSG:32631" if "crs" in names else None)
    np.savez(tmp_path / "b.npz", values=values, x=x[:-1], y=y)
    with pytest.warns(UserWarning, match="do not fit"):
        assert isocodec.read(tmp_path / "b.npz").placement is None


def test_archives_with_meshes(tmp_path: Path) -> None:
    points, cells = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]), np.array([[0, 1, 2], [1, 3, 2]])
    np.savez(tmp_path / "a.npz", points=points, cells=cells, h=np.arange(4.0), t=np.arange(8.0).reshape(2, 4))
    for choice, right in (({"key": "h"}, [0, 1, 2, 3]), ({"key": "t", "frame": 1}, [4, 5, 6, 7]),
                          ({"key": "x"}, [0, 1, 0, 1]), ({}, None)):
        mesh: Any = isocodec.read(tmp_path / "a.npz", **choice)
        assert np.array_equal(mesh.points, points) and np.array_equal(mesh.cells, cells)
        assert mesh.values is None if right is None else mesh.values.tolist() == right
    with pytest.raises(InputError, match=r"'none'.*h, t"):
        isocodec.read(tmp_path / "a.npz", key="none")
