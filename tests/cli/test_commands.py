"""The command line as tables over its own tree: limits, exit codes, options with every kind of file, its page."""

from __future__ import annotations

import importlib
import json
import pkgutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from home import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import isocodec
import isocodec.api
from commands import BALL, HILLS, run
from commands_page import PAGE, page
from isocodec.cli import main
from isocodec.cli.parameters import HEADINGS
from isocodec.cli.report import EXIT_CODES
from isocodec.errors import FormatError, InputError, KernelError, LimitError, MissingExtraError, OptionError
from isocodec.field.placement import Placement
from tables import looped

POINTS = np.random.default_rng(7).random((60, 2)) * 10
KINDS: dict[str, Callable[[], Any]] = {
    "grid": lambda: (HILLS, 80.5),
    "series": lambda: (isocodec.Frames([HILLS, HILLS // 2]), 80.5),
    "mesh": lambda: (isocodec.Mesh(POINTS, None, np.hypot(*(POINTS - 5).T)), 3.1),
    "surface": lambda: (isocodec.thin(HILLS.astype(float), to=40), None),
    "tiles": lambda: (HILLS, 80.5),
}
OUTPUTS = {"decode": "o.npz", "edit": "o.iso", "plot": "o.png"}
"""Commands that open a file and write one."""
VALUES = {
    "isovalues": "80.5", "frame": "0", "layers": "1", "max_bytes": "1M", "window": "4:20,4:20",
    "within": "2", "what": "mesh", "to": "npz", "size": "1M", "profile": "main", "precision": "signs",
    "steps": "2", "title": "t", "view": "top", "every": "20", "capped": "below",
    "limits": "memory=900M,work=100000000,samples=100000", "mesh": "known.npz",
    "key": "a", "nodata": "1", "metadata": "a=b", "layer": "a", "attribute": "a", "simplify": "0.5",
    "band": "1", "bbox": "0,0,9,9", "threads": "2", "sample": "hills.npy", "like": "grid.iso",
}
"""A value for each option that takes one."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of each kind, a field and a mesh."""
    folder = tmp_path_factory.mktemp("kinds")
    for kind, made in KINDS.items():
        what, isovalue = made()
        isocodec.save(folder / f"{kind}.iso", what, isovalue, **({"tile": 32} if kind == "tiles" else {}))
    np.save(folder / "hills.npy", HILLS)
    np.savez(folder / "known.npz", points=POINTS, cells=np.array([[0, 1, 2]]))
    return folder


def options_of(command: click.Command) -> Iterator[click.Option]:
    for each in command.params:
        if isinstance(each, click.Option) and not each.required and each.name not in ("help", "plan_help"):
            yield each


OPENING = [(name, each) for name in (*OUTPUTS, "info") for each in options_of(main.commands[name])]


@looped("kind", KINDS)
@pytest.mark.parametrize(("name", "option"), OPENING, ids=[f"{name}{each.opts[-1]}" for name, each in OPENING])
def test_each_option_works_with_each_kind_or_is_refused_by_name(
    files: Path, tmp_path: Path, kind: str, name: str, option: click.Option
) -> None:
    """One line says why not; never an internal error."""
    words = [name, files / f"{kind}.iso"]
    words += ["-o", tmp_path / OUTPUTS[name]] if name in OUTPUTS else []
    words += ["--layers", 1] if name == "edit" and option.name not in ("layers", "size") else []
    if option.name == "what":
        words[-1] = tmp_path / "o.ply"
    words.append(option.opts[-1])
    if not option.is_flag:
        value = VALUES[str(option.name)]
        words.append({"mesh": files / value, "sample": f"a={files / value}"}.get(str(option.name), value))
    result = run(*words)
    assert result.exit_code in (0, 2, 3), result.output
    if result.exit_code:
        (line,) = result.stderr.splitlines()
        assert line.startswith("isocodec: ") and "internal" not in line and result.stdout == ""


def test_every_option_has_a_value_here() -> None:
    missing = {option.name for _, option in OPENING if not option.is_flag} - set(VALUES)
    assert not missing


DECODING = [name for name in main.commands if any(each.name == "limits" for each in main.commands[name].params)]


def test_commands_that_decode_have_the_limits() -> None:
    assert set(DECODING) == {"decode", "edit", "info", "verify", "plot"}


@looped("name", DECODING)
def test_the_limit_of_memory_holds_for_each_command(files: Path, tmp_path: Path, name: str) -> None:
    words = [name, files / "grid.iso", *([files / "hills.npy"] if name == "verify" else []), "--limits", "memory=100"]
    words += ["-o", tmp_path / OUTPUTS[name]] if name in OUTPUTS else []
    words += {"edit": ["--precision", "signs"], "info": ["--statistics"]}.get(name, [])
    result = run(*words)
    assert result.exit_code == 6, result.output
    assert "--limits" in result.stderr and not list(tmp_path.iterdir())
    words[words.index("memory=100")] = "memory=much,work=0"
    result = run(*words)
    assert result.exit_code == 2 and "'much' is not a size" in result.stderr


ERRORS = [
    (OptionError("a", code="a"), 2), (InputError("a", code="a"), 3), (FormatError("a", code="a"), 4),
    (LimitError("a", code="a"), 6), (MissingExtraError("a", code="a"), 7), (KernelError("a", code="a"), 8),
    (OSError(5, "a"), 3), (MemoryError(), 6), (ZeroDivisionError("a"), 1), (KeyboardInterrupt(), 130),
]


@looped("as_json", [False, True])
@looped("name", [name for name in main.commands if name not in ("encode", "thin", "serve", "plugins")])
@pytest.mark.parametrize(("raised", "code"), ERRORS, ids=[type(error).__name__ for error, _ in ERRORS])
def test_each_class_of_error_has_its_exit_code(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, raised: BaseException, code: int, name: str,
    as_json: bool,
) -> None:
    """And one line on the error stream, nothing on the other, no file."""
    # what is loaded meanwhile would keep what raises
    for module in pkgutil.iter_modules(isocodec.api.__path__, "isocodec.api."):
        importlib.import_module(module.name)
    assert isocodec.open

    def end(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr("isocodec.api.opening.open", end)
    words = [name, files / "grid.iso", *([files / "hills.npy"] if name == "verify" else [])]
    words += ["-o", tmp_path / OUTPUTS[name]] if name in OUTPUTS else []
    words += (["--layers", 1] if name == "edit" else []) + ["--json"] * as_json
    result = run(*words)
    assert result.exit_code == code and result.stdout == ""
    (line,) = [line for line in result.stderr.splitlines() if line]
    assert line.startswith("isocodec: ") and not list(tmp_path.iterdir())
    assert f"  {code}" in EXIT_CODES or code == 130


def test_every_command_has_json(files: Path, tmp_path: Path) -> None:
    out = tmp_path / "o.iso"
    for words in (
        ["encode", files / "hills.npy", "-o", out, "--isovalue", 80.5],
        ["decode", out, "-o", tmp_path / "o.npz"], ["edit", out, "-o", tmp_path / "p.iso", "--layers", 2],
        ["info", out], ["verify", out, files / "hills.npy"], ["plot", out, "-o", tmp_path / "o.png"],
        ["thin", files / "hills.npy", "-o", tmp_path / "t.ply", "--points", 30],
    ):
        result = run(*words, "--json")
        assert result.exit_code == 0, result.output
        assert isinstance(json.loads(result.stdout), dict)


def test_options_are_records_under_headings() -> None:
    for command in main.commands.values():
        for each in command.params:
            if isinstance(each, click.Option):
                assert each.heading in HEADINGS and each.help, (command.name, each.opts)


def test_the_page_is_made_from_the_command_line() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run tools/commands_page.py"


# -- options have an effect, or are refused --------------------------------------------------------------------------

ROUND = np.hypot(*(np.mgrid[:33, :41] - np.array([12.0, 0.0])[:, None, None])) * 8
PLACED = Placement([[0, 30, 500015], [-20, 3, 4e6]], crs="EPSG:32631")
EFFECTS: dict[str, Callable[[], Any]] = {
    "grid": lambda: (isocodec.Field(ROUND, mask=ROUND % 29 < 0.6, placement=PLACED), [80.5, 120.5]),
    "series": lambda: (isocodec.Frames([isocodec.Field(each, mask=ROUND % 29 < 0.6, placement=PLACED)
                                        for each in (ROUND, ROUND[:, ::-1])]), [80.5, 120.5]),
    "mesh": lambda: (isocodec.Mesh(POINTS + [5e5, 4e6], None, np.hypot(*(POINTS - 5).T), crs="EPSG:32631"), [2.1, 3.1]),
    "surface": lambda: (isocodec.thin(isocodec.Field(ROUND, placement=PLACED), to=200, layers=3), None),
    "tiles": lambda: (isocodec.Field(ROUND, mask=ROUND % 29 < 0.6, placement=PLACED), [80.5, 120.5]),
    "labels": lambda: (isocodec.Field((ROUND // 90 % 3).astype(np.uint8), labels=(1, 2), placement=PLACED), None),
    "volume": lambda: (BALL[::2, ::2, ::2], [85.5, 65.5]),
}
"""Fields, so that each option changes something of what is decoded."""
EFFECTIVE = {
    "frame": 1, "layers": 1, "max_bytes": 0, "window": "4:20,4:20", "within": 16, "smooth": None,
    "bbox": "500135,3999650,500615,3999960", "through_holes": None, "capped": "below", "isovalues": 120.5,
    "in_samples": None, "partial": None, "layer": "mine", "attribute": "height", "simplify": 2, "sample": "plane.npy",
}
"""Values that change what is decoded of these; ``max_bytes`` is a quarter of the file."""
OF_KIND = {
    ("mesh", "window"): "500002:500005,4000002:4000005", ("volume", "window"): "1:4,1:4,1:4",
    ("mesh", "bbox"): "500002,4000002,500005,4000005", ("mesh", "isovalues"): 3.1,
    ("labels", "isovalues"): 2, ("volume", "isovalues"): 65.5, ("surface", "isovalues"): 120.5,
    ("volume", "sample"): "space.npy", ("mesh", "sample"): "mesh.npz",
}
NO_EFFECT = {
    ("any", "partial"), ("volume", "in_samples"), ("mesh", "in_samples"),
    ("labels", "through_holes"), ("volume", "through_holes"), ("mesh", "layers"),
}
"""Of whole files, of files without a placement, holes or more than one layer."""
WITHOUT = ("output", "what", "to", "mesh", "as_json", "limits", "threads", "like")
"""Options that choose what is decoded, or have tests of their own."""
(WHAT,) = (each for each in main.commands["decode"].params if each.name == "what")


@pytest.fixture(scope="module")
def effects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("effects")
    for kind, made in EFFECTS.items():
        what, isovalue = made()
        more: dict[str, Any] = {"tile": 32} if kind == "tiles" else {}
        more |= {"precision": "signs"} if kind in ("grid", "series", "tiles", "volume") else {}
        isocodec.save(folder / f"{kind}.iso", what, isovalue, **more)
    np.save(folder / "plane.npy", ROUND % 7)
    np.save(folder / "space.npy", BALL[::2, ::2, ::2] % 7)
    corners = np.array([[0, 0], [10, 0], [0, 10], [10, 10.0]]) + [5e5, 4e6]
    np.savez(folder / "mesh.npz", points=corners, cells=[[0, 1, 2], [1, 3, 2]], values=[1, 2, 3, 5.0])
    return folder


def written(path: Path, folder: Path, *words: object) -> tuple[Any, bytes]:
    """The result, and what was written in the first of these formats that can hold it."""
    for name in ("o.geojson", "o.nrrd", "o.ply"):
        (folder / name).unlink(missing_ok=True)
        result = run("decode", path, "-o", folder / name, *words)
        if "cannot hold" not in result.stderr:
            break
    return result, (folder / name).read_bytes() if result.exit_code == 0 else b""


def test_every_option_of_decode_is_here() -> None:
    assert {each.name for each in options_of(main.commands["decode"])} == {*EFFECTIVE, *WITHOUT} - {"output"}


@pytest.mark.parametrize("what", WHAT.type.choices)
@pytest.mark.parametrize("kind", EFFECTS)
def test_options_of_decode_change_what_is_written_or_are_refused(
    effects: Path, tmp_path: Path, kind: str, what: str
) -> None:
    """An option that changes nothing, and is not refused, has been lost on the way."""
    path = effects / f"{kind}.iso"
    asked: list[object] = ["--what", what]
    if kind == "surface" and what in ("curve", "areas", "bands", "above"):
        asked += ["--isovalue", 90]
    _, plain = written(path, tmp_path, *asked)
    lost = []
    for name, usual in EFFECTIVE.items():
        (option,) = (each for each in main.commands["decode"].params if each.name == name)
        value = OF_KIND.get((kind, name), path.stat().st_size // 4 if name == "max_bytes" else usual)
        value = f"a={effects / str(value)}" if name == "sample" else value
        result, after = written(path, tmp_path, *asked, option.opts[-1], *([] if value is None else [value]))
        assert result.exit_code in (0, 2, 5), result.output
        if result.exit_code == 0 and after == plain and not {(kind, name), (what, name), ("any", name)} & NO_EFFECT:
            lost.append(name)
    assert not lost


# -- standard output -------------------------------------------------------------------------------------------------

WRITING = [name for name, each in main.commands.items() if any(one.name == "output" for one in each.params)]
WORDS: dict[str, list[object]] = {
    "encode": ["hills.npy", "--isovalue", 80.5], "decode": ["grid.iso"], "edit": ["grid.iso", "--layers", 2],
    "plot": ["grid.iso"], "thin": ["hills.npy", "--points", 30],
}
_CURVES = [".geojson", ".svg", ".npz"]
FORMATS = {"encode": [".iso"], "decode": _CURVES, "plot": [".png"], "thin": [".ply"]}


@looped("as_json", [False, True])
@pytest.mark.parametrize(("name", "to"), [(name, to) for name in WRITING for to in FORMATS.get(name, [".iso"])])
def test_standard_output_has_the_file_and_nothing_else(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, to: str, as_json: bool
) -> None:
    """What is said, also as JSON, goes to the other stream; if the file has a name, JSON goes to standard output."""
    monkeypatch.chdir(files)
    words = [name, *WORDS[name], *["--json"] * as_json]
    has_to = any("--to" in each.opts for each in main.commands[name].params)
    result = run(*words, "-o", "-", *(["--to", to] if has_to else []))
    if result.exit_code:
        assert result.exit_code == 2 and "-: a name without a suffix" in result.stderr and not has_to
        return
    named = run(*words, "-o", tmp_path / f"o{to}")
    assert named.exit_code == 0, named.output
    assert result.stdout_bytes == (tmp_path / f"o{to}").read_bytes()
    if as_json:
        told, other = json.loads(result.stderr.splitlines()[-1]), json.loads(named.stdout)
        assert told["output"] == "-" and told.keys() == other.keys() and told.get("bytes") == other.get("bytes")
    else:
        assert named.stdout.split(":", 1)[1].split(", ")[0] in result.stderr


MERGING = [each for each in options_of(main.commands["edit"]) if each.heading.startswith(("Part", "Precision"))]


@looped("option", MERGING, ids=lambda each: each.name)
def test_options_of_edit_hold_for_several_files_or_are_refused(
    files: Path, tmp_path: Path, option: click.Option
) -> None:
    isocodec.save(files / "more.iso", HILLS, 120.5)
    value = [] if option.is_flag else ["baseline" if option.name == "profile" else VALUES[str(option.name)]]
    plain, result = (
        run("edit", files / "grid.iso", files / "more.iso", "-o", tmp_path / name, *words)
        for name, words in (("a.iso", []), ("b.iso", [option.opts[-1], *value]))
    )
    assert plain.exit_code == 0
    if result.exit_code == 0:
        assert (tmp_path / "a.iso").read_bytes() != (tmp_path / "b.iso").read_bytes()
        assert option.name != "profile" or isocodec.open(tmp_path / "b.iso").info.profile == "baseline"
    else:
        assert result.exit_code == 2 and option.opts[-1] in result.stderr
