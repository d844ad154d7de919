"""Writers and pictures: each against what another library reads; files whole or not at all."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import numpy as np
import pytest

from files import same
from isocodec.drawing.contour import Contour
from isocodec.errors import MissingExtraError
from isocodec.io.formats import write
from isocodec.storage.atomic import check_target, write_bytes
from libraries import Late
from written import rendered

trimesh = Late("trimesh")

# A diamond around sample (2, 3), closed, and one segment that leaves the grid.
SQUARE = [(1.0, 3.0), (2.0, 2.0), (3.0, 3.0), (2.0, 4.25)]
CURVE = Contour(
    points=np.array([*SQUARE, (0.0, 0.5), (0.5, 0.0)]),
    cells=np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5)]),
    isovalue=2.5,
    shape=(5, 7),
)
NO_CURVE = Contour(np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64), 9.0, (5, 7))

# A tetrahedron, its triangles seen counter-clockwise from outside: volume 1 * 2 * 3 / 6 = 1.
SURFACE = Contour(
    points=np.array([(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 3.0, 1.0), (1.0, 1.0, 4.0)]),
    cells=np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
    isovalue=0.25,
    shape=(4, 5, 6),
)
NO_SURFACE = Contour(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), 9.0, (4, 5, 6))


# ---- Curves out -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("contour", [CURVE, SURFACE, NO_CURVE, NO_SURFACE])
def test_npz_out(tmp_path: Path, contour: Contour) -> None:
    write(tmp_path / "c.npz", contour)
    with np.load(tmp_path / "c.npz") as arrays:
        assert sorted(arrays.files) == ["cells", "isovalue", "points", "shape"]
        assert same(arrays["points"], contour.points)
        assert same(arrays["cells"], contour.cells)
        assert arrays["isovalue"] == contour.isovalue
        assert arrays["shape"].tolist() == list(contour.shape)




@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_surfaces_out(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"s{suffix}"
    write(path, SURFACE)
    mesh = trimesh.load_mesh(path)
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1.0)
    assert mesh.bounds.tolist() == [[1, 1, 1], [2, 3, 4]]
    if suffix == ".stl":
        # Binary: 80 bytes of header, the number of triangles, 50 bytes for each.
        assert path.stat().st_size == 84 + 50 * 4


@pytest.mark.parametrize(
    ("module", "contour", "suffix", "extra"),
    [
        ("trimesh", SURFACE, ".ply", "mesh"),
        ("matplotlib.figure", CURVE, ".png", "plot"),
    ],
)
def test_writing_names_the_missing_extra(
    monkeypatch: pytest.MonkeyPatch, module: str, contour: Contour, suffix: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match="needs") as caught:
        rendered(contour, suffix)
    assert caught.value.remedy == f"pip install '.[{extra}]' in a checkout of isocodec"




# ---- Whole or not at all --------------------------------------------------------------------------------------------


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.npz"
    target.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_bytes(target, b"new")
    assert caught.value.filename == str(target)
    with pytest.raises(FileNotFoundError) as missing:
        write(tmp_path / "none" / "a.svg", CURVE)
    assert missing.value.filename == str(tmp_path / "none" / "a.svg")
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_a_rename_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.npz"
    target.write_bytes(b"old")

    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted", "another name")

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(PermissionError) as caught:
        write_bytes(target, b"new")
    assert caught.value.filename == str(target)
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o000])
def test_the_mask_of_the_process_is_kept(tmp_path: Path, mask: int) -> None:
    """It can only be read by setting it, and then it has to be as before."""
    before = os.umask(mask)
    try:
        write_bytes(tmp_path / "a", b"1")
    finally:
        after = os.umask(before)
    assert after == mask
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o666 & ~mask


def test_interrupted_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "a.npz", b"new")
    assert not list(tmp_path.iterdir())


def test_permissions_and_links_are_kept(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    write_bytes(plain, b"1")
    (tmp_path / "usual").touch()
    assert plain.stat().st_mode == (tmp_path / "usual").stat().st_mode
    plain.chmod(0o640)
    (tmp_path / "link").symlink_to(plain)
    write_bytes(tmp_path / "link", b"2")
    assert (tmp_path / "link").is_symlink()
    assert plain.read_bytes() == b"2"
    assert stat.S_IMODE(plain.stat().st_mode) == 0o640


def test_devices_are_not_replaced() -> None:
    check_target("/dev/null")
    write_bytes("/dev/null", b"gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_targets_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(IsADirectoryError):
        check_target(tmp_path)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        check_target(tmp_path / "missing" / "a.npz")
    with pytest.raises(NotADirectoryError):
        check_target(tmp_path / "file" / "a.npz")
    check_target(tmp_path / "new.npz")
    # The superuser may write everywhere, so the answer of the system is put into its mouth.
    for closed in (tmp_path, tmp_path / "file"):
        monkeypatch.setattr(os, "access", lambda path, _, closed=closed: Path(path) != closed)
        with pytest.raises(PermissionError):
            check_target(tmp_path / "file")


@pytest.mark.parametrize("lacking", [os.W_OK, os.X_OK])
def test_folders_that_cannot_be_written_or_entered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacking: int
) -> None:
    """Without the right to enter a folder nothing can be made in it, even with that to write."""
    monkeypatch.setattr(os, "access", lambda path, mode: not (Path(path) == tmp_path and mode & lacking))
    with pytest.raises(PermissionError) as caught:
        check_target(tmp_path / "new")
    assert caught.value.filename == str(tmp_path / "new")
