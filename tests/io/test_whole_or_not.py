"""Files whole or not at all, and what is beside them."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from isocodec.io.formats import OutputOptions, write
from isocodec.storage.atomic import check_target, write_bytes
from written_contents import content


@pytest.mark.parametrize(("where", "error"), [
    ("fsync", OSError(28, "No space left on device")), ("replace", PermissionError(1, "not permitted", "another name")),
    ("replace", KeyboardInterrupt()),
])
def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, error: BaseException
) -> None:
    target = tmp_path / "a.npz"
    target.write_bytes(b"old")

    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(os, where, fails)
    with pytest.raises(type(error)) as caught:
        write_bytes(target, b"new")
    assert getattr(caught.value, "filename", str(target)) == str(target)
    assert target.read_bytes() == b"old" and [*tmp_path.iterdir()] == [target]


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


def test_permissions_and_links_are_kept(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    write_bytes(plain, b"1")
    plain.chmod(0o640)
    (tmp_path / "link").symlink_to(plain)
    write_bytes(tmp_path / "link", b"2")
    assert (tmp_path / "link").is_symlink() and plain.read_bytes() == b"2"
    assert stat.S_IMODE(plain.stat().st_mode) == 0o640


def test_devices_are_not_replaced() -> None:
    check_target("/dev/null")
    write_bytes("/dev/null", b"gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_targets_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    check_target(tmp_path / "new.npz")
    for path, error in ((tmp_path, IsADirectoryError), (tmp_path / "missing" / "a.npz", FileNotFoundError),
                        (tmp_path / "file" / "a.npz", NotADirectoryError)):
        with pytest.raises(error) as caught:
            check_target(path)
        assert caught.value.filename == str(path)
        with pytest.raises(error):
            write(path, content("curve"), OutputOptions(to="npz"))
    # The superuser may write everywhere, so the answer of the system is put into its mouth.
    for closed, lacking in ((tmp_path, os.W_OK), (tmp_path, os.X_OK), (tmp_path / "file", os.W_OK)):
        monkeypatch.setattr(os, "access", lambda path, mode, closed=closed, lacking=lacking: not (
            Path(path) == closed and mode & lacking))
        with pytest.raises(PermissionError) as caught:
            check_target(tmp_path / "file")
        assert caught.value.filename == str(tmp_path / "file")
