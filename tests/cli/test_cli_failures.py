"""The command line: what it says and leaves behind when it cannot go on, and how a process ends."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, process, run
from isocodec.api.export import counted
from isocodec.cli import main
from isocodec.cli import report as progress_module
from isocodec.cli.parameters import HEADINGS
from tables import looped

# ---- Where the output goes ------------------------------------------------------------------------------------------


def test_outputs_that_cannot_be_written(hills: Path, tmp_path: Path) -> None:
    for out, words in (
        (tmp_path, "Is a directory"),
        (tmp_path / "missing" / "out.iso", "does not exist"),
        (hills / "out.iso", "Not a directory"),
    ):
        line = fails(3, "encode", hills, "-o", out, "--isovalue", 80.5)
        assert line.startswith(f"isocodec: {out}: ")
        assert words in line


def test_links_to_nowhere_are_found_out_before_the_work(hills: Path, tmp_path: Path) -> None:
    dangling, coming = tmp_path / "dangling.iso", tmp_path / "coming.iso"
    dangling.symlink_to(tmp_path / "missing" / "out.iso")
    coming.symlink_to(tmp_path / "file.iso")
    assert "does not exist" in fails(3, "encode", hills, "-o", dangling, "--isovalue", 80.5)
    ok("encode", hills, "-o", coming, "--isovalue", 80.5)
    assert coming.is_symlink() and (tmp_path / "file.iso").exists()


def test_the_input_is_never_overwritten(hills: Path, curve: Path, tmp_path: Path, curve_data: bytes) -> None:
    before = hills.read_bytes()
    assert "the input file itself" in fails(2, "encode", hills, "-o", hills, "--isovalue", 80.5)
    (tmp_path / "other.iso").hardlink_to(curve)
    assert "the input file itself" in fails(2, "edit", curve, "-o", tmp_path / "other.iso", "--layers", 1)
    assert hills.read_bytes() == before
    assert curve.read_bytes() == curve_data


def test_an_older_output_is_replaced_and_survives_errors(hills: Path, curve: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.iso"
    out.write_bytes(b"older")
    fails(3, "encode", hills, "-o", out, "--isovalue", "nan")
    assert out.read_bytes() == b"older"
    ok("edit", curve, "-o", out, "--layers", 1)
    assert out.read_bytes() != b"older"


def test_full_disk(curve: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    line = fails(3, "decode", curve, "-o", tmp_path / "c.npz")
    assert line == f"isocodec: {tmp_path / 'c.npz'}: No space left on device"
    assert [path.name for path in tmp_path.iterdir()] == ["curve.iso"]


# ---- Bad .iso files -------------------------------------------------------------------------------------------------

VERBS: tuple[tuple[tuple[str, ...], str | None], ...] = (
    (("decode",), "out.npz"), (("decode", "--what", "above"), "out.npy"), (("info",), None),
    (("edit", "--layers", "1"), "out.iso"), (("plot",), "out.png"),
)


def each_verb(source: Path, folder: Path) -> list[list[object]]:
    """A command line of each verb that reads ``source``, its output in ``folder``."""
    commands: list[list[object]] = []
    for verb, out in VERBS:
        commands.append([*verb, source, *([] if out is None else ["-o", folder / out])])
    return commands


def test_files_that_are_no_iso(tmp_path: Path, hills: Path) -> None:
    (tmp_path / "text.iso").write_text("this is no contour\n" * 20)
    for name in ("text.iso", hills.name):
        for command in each_verb(tmp_path / name, tmp_path):
            assert fails(4, *command).startswith(f"isocodec: {tmp_path / name}: ")


def test_missing_iso_and_directory(tmp_path: Path) -> None:
    (tmp_path / "directory.iso").mkdir()
    for name, words in (("missing.iso", "No such file"), ("directory.iso", "Is a directory")):
        for command in each_verb(tmp_path / name, tmp_path):
            assert words in fails(3, *command)


def test_permission_denied(curve: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(self: Path, _: str) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", closed)
    assert fails(3, "info", curve) == f"isocodec: {curve}: Permission denied"


@pytest.fixture
def cut(tmp_path: Path, curve_data: bytes) -> Path:
    """A file that ends too early."""
    path = tmp_path / "cut.iso"
    path.write_bytes(curve_data[: len(curve_data) * 2 // 3])
    return path


def only_partial(verb: str, cut: Path, out: Path) -> None:
    """A verb takes what was received, with a warning, if it is told so, and nothing otherwise."""
    assert fails(5, verb, cut, "-o", out).endswith(": use --partial to decode as much as there is")
    assert not out.exists()
    result = run(verb, cut, "-o", out, "--partial")
    assert result.exit_code == 0
    assert result.stderr.startswith(f"isocodec: {cut}: warning: ")
    assert "as far as possible" in result.stderr
    assert out.stat().st_size


def test_truncated_iso(cut: Path, tmp_path: Path, curve_data: bytes) -> None:
    out = tmp_path / "c.npz"
    only_partial("decode", cut, out)
    decoder = isocodec.Decoder()
    decoder.feed(cut.read_bytes())
    for _ in decoder:
        pass
    with np.load(out) as arrays:
        assert len(arrays["points"])
        assert np.array_equal(arrays["points"], decoder.contour().points)
    ok("decode", cut, "-o", out, "--partial", "--layers", 1)
    with np.load(out) as arrays:
        assert np.array_equal(arrays["points"], isocodec.decode(curve_data, layers=1).points)


def test_a_truncated_file_is_drawn_and_said_to_be_one(cut: Path, tmp_path: Path, curve_data: bytes) -> None:
    out = tmp_path / "c.png"
    result = run("plot", cut, "-o", out)
    assert result.exit_code == 0 and "drawn as far as possible" in result.stderr
    begin = isocodec.open(curve_data).info.layers[0].offset
    cut.write_bytes(curve_data[:begin])
    assert "drawn as far as possible" in run("plot", cut, "-o", out).stderr
    result = run("info", cut)
    assert result.exit_code == 0 and f"the file ends after {begin} bytes, before it is complete" in result.stderr


@pytest.mark.parametrize("mesh", [False, True])
def test_a_file_that_ends_within_its_first_layer_is_drawn(tmp_path: Path, mesh: bool) -> None:
    """The one step there is shows what was told."""
    data = isocodec.encode(HILLS, 100.5, layers=10)
    first = counted(isocodec.open(data)).layers[0]
    assert first.offset is not None and first.bytes is not None
    (tmp_path / "off.iso").write_bytes(data[: first.offset + first.bytes // 2])
    options = ["--draw-mesh"] if mesh else []
    result = run("plot", tmp_path / "off.iso", "-o", tmp_path / "b.png", *options)
    assert result.exit_code == 0 and (tmp_path / "b.png").stat().st_size


def test_truncate_what_ends_before_its_curve(tmp_path: Path, curve_data: bytes) -> None:
    (tmp_path / "begin.iso").write_bytes(curve_data[: isocodec.open(curve_data).info.chunks[0].offset + 2])
    line = fails(5, "edit", tmp_path / "begin.iso", "-o", tmp_path / "t.iso", "--size", 1000)
    assert "before its first layer does" in line


def test_truncation_says_which_isovalues_it_drops(two: Path, tmp_path: Path) -> None:
    result = run("edit", two, "-o", tmp_path / "one.iso", "--layers", 2)
    assert result.exit_code == 0 and "does not reach isovalue 40.25" in result.stderr
    assert run("edit", two, "-o", tmp_path / "all.iso", "--size", 10**6).stderr == ""


def test_names_that_the_output_cannot_encode(curve: Path, tmp_path: Path) -> None:
    named = tmp_path / "küste.iso"
    named.write_bytes(curve.read_bytes())
    done = process("info", named, environment={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0 and "k\\xfcste.iso" in done.stdout.replace("\n", ""), done


def test_nothing_received(tmp_path: Path, curve_data: bytes) -> None:
    for length in (0, 3):
        (tmp_path / "cut.iso").write_bytes(curve_data[:length])
        for command in each_verb(tmp_path / "cut.iso", tmp_path):
            fails(5, *command)
        fails(5, "decode", tmp_path / "cut.iso", "-o", tmp_path / "c.npz", "--partial")


# ---- How a process ends ---------------------------------------------------------------------------------------------


def test_help_lists_the_exit_codes() -> None:
    shown = ok("--help")
    for line in ("0  done", "3  the input", "4  not a valid .iso", "5  the .iso file is truncated", "7  an optional"):
        assert line in shown
    for verb in main.commands:
        assert "Usage: isocodec" in ok(verb, "--help")
    assert ok("--version").startswith("isocodec")


def test_the_options_of_encode_fit_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under headings, in one column, on 110 lines of 80 characters."""
    monkeypatch.setenv("COLUMNS", "80")
    lines = ok("encode", "--help").splitlines()
    assert len(lines) <= 110 and max(map(len, lines)) <= 80
    headings = [line.split("(")[0].strip(" :") for line in lines[1:] if line.endswith(":") and not line.startswith(" ")]
    assert headings == [heading for heading in HEADINGS if heading in headings] and len(headings) == 7


def test_options_that_contradict_one_another_are_named_as_on_the_command_line(hills: Path, tmp_path: Path) -> None:
    encode = ("encode", hills, "-o", tmp_path / "o.iso", "--isovalue", 40)
    assert "--isovalue and --label cannot be combined" in fails(2, *encode, "--label", 1)


def test_internal_errors_are_one_line(curve: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a bug\nof two lines")

    monkeypatch.setattr("isocodec.api.opening.open", broken)
    line = fails(1, "info", curve)
    assert "ZeroDivisionError: a bug of two lines" in line
    assert "ISOCODEC_DEBUG=1" in line
    monkeypatch.setenv("ISOCODEC_DEBUG", "1")
    assert "Traceback" in run("info", curve).stderr


def complaints(done: subprocess.CompletedProcess[str]) -> list[str]:
    """Lines on the error stream, but for the notice that a first or slow start gives."""
    return [line for line in done.stderr.splitlines() if "kernels" not in line]


def test_process(hills: Path, tmp_path: Path) -> None:
    iso, out = tmp_path / "a.iso", tmp_path / "a.geojson"
    done = process("encode", hills, "-o", iso, "--isovalue", "80.5", "--precision", "exact", "--json")
    assert (done.returncode, complaints(done), json.loads(done.stdout)["shape"]) == (0, [], [33, 41])
    done = process("decode", tmp_path / "none.iso", "-o", out)
    assert done.returncode == 3
    assert done.stderr == f"isocodec: {tmp_path / 'none.iso'}: No such file or directory\n"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_only_on_a_terminal_and_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress_module.progress_bar("working") as report:
        assert report is None
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress_module.progress_bar("working") as report:
        assert report is not None
        report(1, 2)
    assert terminal.getvalue() == ""
    monkeypatch.setattr(progress_module, "PATIENCE", 0.0)
    with progress_module.progress_bar("working") as report:
        assert report is not None
        report(1, 2)
        report(2, 2)
    assert "working" in terminal.getvalue() and "searching" not in terminal.getvalue()


@pytest.mark.parametrize(("last", "said"), [((17, 0), "searching (17 tried)"), ((1, 2), "working")])
def test_progress_of_a_search(monkeypatch: pytest.MonkeyPatch, last: tuple[int, int], said: str) -> None:
    """Nobody knows how long one takes; what comes after it has a bar as always."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress_module, "PATIENCE", 0.0)
    with progress_module.progress_bar("working") as report:
        assert report is not None
        report(16, 0)
        report(*last)
    assert said in terminal.getvalue()


# ---- Several isovalues, damage and short prefixes -------------------------------------------------------------------


@pytest.fixture
def two(hills: Path, tmp_path: Path) -> Path:
    out = tmp_path / "two.iso"
    ok("encode", hills, "-o", out, "--isovalue", 80.5, "--isovalue", 40.25, "--order", "independent")
    return out


def test_what_was_received_of_another_isovalue(two: Path, tmp_path: Path) -> None:
    data, whole = two.read_bytes(), isocodec.decode(two.read_bytes(), isovalue=40.25)
    part = tmp_path / "part.iso"
    part.write_bytes(data[:-10])
    out = tmp_path / "part.npz"
    for more in ((), ("--layers", 2)):
        report = json.loads(ok("decode", part, "-o", out, "--isovalue", 40.25, "--partial", "--json", *more))
        assert report["isovalues"] == [40.25]
        assert 0 < report["points"] <= len(whole.points)
    part.write_bytes(data[:40])
    for more in ((), ("--partial",)):
        assert "before isovalue 40.25 begins" in fails(5, "decode", part, "-o", out, "--isovalue", 40.25, *more)


def test_isovalues_are_said_in_full(hills: Path, tmp_path: Path) -> None:
    out = tmp_path / "fine.iso"
    ok("encode", hills, "-o", out, "--isovalue", 80.5, "--isovalue", 40.123456789)
    assert "choose another with --isovalue: 40.123456789" in run("decode", out, "-o", tmp_path / "a.npz").stderr
    assert "40.123456789" in fails(2, "decode", out, "-o", tmp_path / "a.npz", "--isovalue", 40.1235)


@pytest.mark.parametrize("how", [("--layers", 3), ("--size", 100)])
def test_damage_is_not_sealed_by_truncation(curve: Path, tmp_path: Path, how: tuple[str, int]) -> None:
    data = bytearray(curve.read_bytes())
    data[len(data) // 2] ^= 16
    damaged = tmp_path / "damaged.iso"
    for broken in (bytes(data), curve.read_bytes() + b"more"):
        damaged.write_bytes(broken)
        fails(4, "edit", damaged, "-o", tmp_path / "out.iso", *how)
        assert not (tmp_path / "out.iso").exists()


def test_output_to_a_pipe_without_a_path(curve: Path) -> None:
    command = f"{sys.executable} -m isocodec edit {curve} -o /dev/stdout --size 100 | wc -c"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True, timeout=120)
    assert int(done.stdout) <= 250, done


# ---- Isovalues at and beyond the ends of the data -------------------------------------------------------------------


def warnings_of(source: Path, out: Path, *options: object) -> list[str]:
    result = run("encode", source, "-o", out, *options)
    assert result.exit_code == 0, result.output
    return [line.removeprefix(f"isocodec: {source}: warning: ") for line in result.stderr.splitlines()]


def test_isovalues_outside_the_data_are_said_one_by_one(tmp_path: Path) -> None:
    """Above the lowest of several, not below the highest: the curve of each of these alone is empty."""
    field = HILLS.astype(np.float64) + 10
    np.save(tmp_path / "a.npy", field)
    low, high = field.min(), field.max()
    lowest = f"the isovalue 5 lies outside the data ({low:g} to {high:g}): the curve is empty"
    highest = f"the isovalue {high:g} lies outside the data ({low:g} to {high:g}): the curve is empty"
    out = tmp_path / "a.iso"
    for isovalues, said in (
        ((5, 80.5), [lowest]),
        ((80.5, 5), [lowest]),
        ((80.5, 40.5), []),
        ((low, 80.5), []),  # samples that equal the least value lie below it, the others above
        ((80.5, high), [highest]),
        ((5, high), [lowest, highest]),
    ):
        options = [word for isovalue in isovalues for word in ("--isovalue", isovalue)]
        assert warnings_of(tmp_path / "a.npy", out, *options) == said
        for contour in isocodec.open(out.read_bytes()).contours():
            assert (len(contour.points) == 0) == (not low <= contour.isovalue < high)
    (many,) = warnings_of(tmp_path / "a.npy", out, "--isovalue", "1000:1900:100")
    assert many == f"10 isovalues (1000, ..) lie outside the data ({low:g} to {high:g}): their curves are empty"


def test_nothing_is_closed_along_a_window(curve: Path, tmp_path: Path) -> None:
    for what in "areas", "areas-below", "bands":
        line = fails(2, "decode", curve, "-o", tmp_path / "a.gpkg", "--what", what, "--window", "4:20,4:20")
        assert "crop the file first: isocodec edit --window" in line
        assert not (tmp_path / "a.gpkg").exists()


def test_distances_of_a_sequence_are_refused_in_cells(hills: Path, tmp_path: Path) -> None:
    line = fails(2, "encode", hills, "-o", tmp_path / "a.iso", "--isovalue", 80.5, "--precision", "4,0.0625,exact")
    assert "a distance of 0.0625 cells; each must be at least 0.1 cells" in line


def test_an_isovalue_equal_to_the_maximum(hills: Path, tmp_path: Path) -> None:
    """Nothing lies above it, so the curve is empty, and of integers those that are equal to it are counted."""
    most = int(HILLS.max())
    outside, tied = warnings_of(hills, tmp_path / "a.iso", "--isovalue", most)
    assert outside == f"the isovalue {most} lies outside the data ({HILLS.min()} to {most}): the curve is empty"
    assert tied.startswith(f"{(most == HILLS).sum()} samples equal the isovalue {most}: they count as below")
    assert not isocodec.open(tmp_path / "a.iso").above().any()
    assert warnings_of(hills, tmp_path / "a.iso", "--isovalue", most - 1, "--precision", "signs") == []
    assert np.array_equal(isocodec.open(tmp_path / "a.iso").above(), most == HILLS)


# ---- Names of outputs ------------------------------------------------------------------------------------------------


WRITING = {
    "encode": ["hills.npy", "--isovalue", 80.5], "decode": ["hills.iso"], "edit": ["hills.iso", "--layers", 1],
    "plot": ["hills.iso"], "thin": ["hills.npy", "--points", 20],
}


def test_verbs_that_write() -> None:
    assert set(WRITING) == {
        name for name in main.commands if any(each.name == "output" for each in main.commands[name].params)
    }


@looped("suffix", [".json", ".iso9660", ".iso.gz", ".5"])
@looped("verb", WRITING)
def test_names_with_other_suffixes_are_refused(tmp_path: Path, verb: str, suffix: str) -> None:
    """A file of one format under the name of another helps nobody; formats that can be written are listed."""
    np.save(tmp_path / "hills.npy", HILLS)
    isocodec.save(tmp_path / "hills.iso", HILLS, 80.5)
    source, *options = WRITING[verb]
    line = fails(2, verb, tmp_path / str(source), "-o", tmp_path / f"out{suffix}", *options)
    assert ".svg" in line or ".ply" in line, line
    assert not list(tmp_path.glob("out*"))


@looped("name", ["out", "out.iso", "OUT.ISO"])
@looped("verb", ["encode", "edit"])
def test_names_of_iso_files(tmp_path: Path, verb: str, name: str) -> None:
    np.save(tmp_path / "hills.npy", HILLS)
    isocodec.save(tmp_path / "hills.iso", HILLS, 80.5)
    source, *options = WRITING[verb]
    ok(verb, tmp_path / str(source), "-o", tmp_path / name, *options)
    assert isocodec.open(tmp_path / name).isovalues == (80.5,)
