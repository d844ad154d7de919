"""Writers and pictures: each against what another library reads; files whole or not at all."""

from __future__ import annotations

import io
import os
import stat
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from PIL import Image

from files import same
from isocodec.drawing.contour import Contour
from isocodec.drawing.pictures.picture import Step, contour_picture, steps_picture
from isocodec.drawing.pictures.shading import Solid, shade
from isocodec.drawing.pictures.view import USUAL, upright
from isocodec.errors import MissingExtraError
from isocodec.io.formats import write
from isocodec.storage.atomic import check_target, write_bytes
from written import rendered

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
WORLD = upright(SURFACE).T
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


def test_svg_out(tmp_path: Path) -> None:
    write(tmp_path / "c.svg", CURVE)
    root = ElementTree.parse(tmp_path / "c.svg").getroot()
    assert root.get("viewBox") == "-0.5 -0.5 7 5"
    paths = [path.get("d") for path in root.iter("{http://www.w3.org/2000/svg}path")]
    assert paths == ["M0.5,0 0,0.5", "M3,1 2,2 3,3 4.25,2Z"]


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


# ---- Pictures -------------------------------------------------------------------------------------------------------


def ink(picture: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(picture)).convert("L")) < 200


def test_picture_of_a_curve_has_the_grid_upright() -> None:
    # Row 1 of 21 is in the upper tenth of a picture of 6 inches at 150 dots.
    top = Contour(np.array([(1.0, 2.0), (1.0, 8.0)]), np.array([(0, 1)]), 0.0, (21, 21))
    inked = ink(contour_picture([top]))
    assert inked.shape == (900, 900)
    rows = np.flatnonzero(inked[50:800, 300:350].any(axis=1)) + 50  # without title, frame and ticks
    assert len(rows)
    assert rows.max() < 130


def test_shading_fills_the_silhouette() -> None:
    # A unit square, facing axis 0, in two triangles; its image is a parallelogram without holes.
    points = np.array([(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (0.0, 0.0, 1.0)])
    # Off the middle, so that no edge lies just between two columns of pixels.
    whole = shade([Solid(points @ WORLD, np.array([(0, 1, 2), (0, 2, 3)]))], USUAL, np.array([0.013, 0.007]), 4.0, 100)
    # Viewed along (-0.42, -0.75, -0.55) / 1.0203 it shrinks to 0.412 of its area: 625 pixels of area 1.
    assert whole[..., 3].sum() == pytest.approx(625 * 0.412, rel=0.08)
    opaque = whole[..., 3] > 0
    for line in (*opaque, *opaque.T):
        filled = np.flatnonzero(line)
        assert len(filled) == 0 or len(filled) == filled[-1] - filled[0] + 1


def test_shading_hides_what_lies_behind() -> None:
    front = np.array([(0.5, 0.0, 0.0), (0.5, 1.0, 0.0), (0.5, 0.0, 1.0)])
    behind = front * 1.0 - np.array([-0.42, -0.75, -0.55])
    behind[2, 0] += 0.4  # tilted, so that its shade is another
    both = np.concatenate([front, behind])
    alone = shade([Solid(front @ WORLD, np.array([(0, 1, 2)]))], USUAL, np.zeros(2), 4.0, 60)
    for cells in ([(0, 1, 2), (3, 4, 5)], [(3, 4, 5), (0, 1, 2)]):
        seen = shade([Solid(both @ WORLD, np.array(cells))], USUAL, np.zeros(2), 4.0, 60)
        inner = alone[..., 3] == 1.0
        assert inner.any()
        assert np.array_equal(seen[inner], alone[inner])


@pytest.mark.parametrize(("contour", "empty"), [(CURVE, NO_CURVE), (SURFACE, NO_SURFACE)])
def test_steps_side_by_side(contour: Contour, empty: Contour) -> None:
    steps = [Step([empty], 10, 100), Step([contour], 50, 100), Step([contour], 100, 100)]
    one = Image.open(io.BytesIO(steps_picture(steps[:1])))
    three = Image.open(io.BytesIO(steps_picture(steps)))
    assert three.width == 3 * one.width
    assert three.height == one.height
    nine = Image.open(io.BytesIO(steps_picture(steps * 3)))
    assert nine.width == 6 * one.width
    assert nine.height == pytest.approx(2 * one.height, abs=1)


@pytest.mark.parametrize(("suffix", "magic"), [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_picture_formats(suffix: str, magic: bytes) -> None:
    assert steps_picture([Step([CURVE], 1, 1)], suffix).startswith(magic)


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
