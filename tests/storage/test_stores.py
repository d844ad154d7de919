"""Files written to stores by URL: what a store holds is what a file would, whole or not at all."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import fails, ok
from isocodec.errors import MissingExtraError
from libraries import Late

fsspec = Late("fsspec")
FIELD = np.add.outer(np.sin(np.arange(80) / 9), np.cos(np.arange(90) / 7))


@pytest.fixture
def store():
    system = fsspec.filesystem("memory")
    yield system
    system.store.clear()


def test_files_tiles_and_other_formats(store, tmp_path: Path) -> None:
    np.save(tmp_path / "field.npy", FIELD)
    isocodec.save("memory://maps/whole.iso", FIELD, 0.5)
    assert store.cat("/maps/whole.iso") == isocodec.encode(FIELD, 0.5)
    isocodec.save("memory://maps/tiles.iso", FIELD, 0.5, tile=32)
    isocodec.save(tmp_path / "tiles.iso", FIELD, 0.5, tile=32)
    assert store.cat("/maps/tiles.iso") == (tmp_path / "tiles.iso").read_bytes()
    ok("encode", tmp_path / "field.npy", "--isovalue", 0.5, "-o", "memory://maps/c.iso")
    ok("edit", "memory://maps/c.iso", "--layers", 3, "-o", "memory://maps/few.iso")
    assert len(store.cat("/maps/few.iso")) < len(store.cat("/maps/c.iso")) == len(store.cat("/maps/whole.iso"))
    ok("decode", "memory://maps/c.iso", "-o", "memory://maps/c.npz")
    (tmp_path / "c.npz").write_bytes(store.cat("/maps/c.npz"))
    with np.load(tmp_path / "c.npz") as arrays:
        assert np.array_equal(arrays["points"], isocodec.open("memory://maps/c.iso").contour().points)


def test_what_fails_leaves_the_store_as_it_was(store, tmp_path: Path) -> None:
    isocodec.save("memory://maps/map.iso", FIELD, 0.5)
    before = store.cat("/maps/map.iso")
    with pytest.raises(isocodec.IsoError):
        isocodec.save("memory://maps/map.iso", FIELD, 0.5, precision="nonsense")
    assert store.cat("/maps/map.iso") == before
    np.save(tmp_path / "field.npy", FIELD)
    encode = ("encode", tmp_path / "field.npy", "--isovalue", 0.5, "-o")
    assert "web servers are only read" in fails(3, *encode, "https://example.org/map.iso")
    assert "Protocol not known" in fails(3, *encode, "nowhere://map.iso")


@pytest.mark.parametrize("url, package", [("gs://maps/map.iso", "gcsfs"), ("az://maps/map.iso", "adlfs")])
def test_packages_of_stores_are_named(url: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    for use in (isocodec.open, lambda url: isocodec.save(url, FIELD, 0.5)):
        with pytest.raises(MissingExtraError, match=package):
            use(url)
