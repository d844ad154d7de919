"""The conformance vectors against the reference decoder, and their runner against decoders that are wrong."""

from __future__ import annotations

import os
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from brute import INTERPRETED
from files import fed
from isocodec import Limits
from isocodec.errors import LimitError
from isocodec.grid.models.trained import shipped_models
from isocodec.limits import TIERS
from isoconform import runner
from isoconform.__main__ import main
from isoconform.circle import CENTRE, RADIUS
from isoconform.dump import CUT_OFF, OTHER_MESH, REFUSED
from isoconform.dump_file import dump_file
from isoconform.generate import generate
from isoconform.manifest import (
    ERROR,
    LIMIT,
    NAME,
    NO_MESH,
    OK,
    TRUNCATED,
    default_directory,
    digest,
    read_manifest,
)
from isospec.elements import ELEMENTS
from tables import looped

HOME = default_directory()
VECTORS = read_manifest(HOME)
BY_NAME = {v.name: v for v in VECTORS}
each_vector = looped("vector", VECTORS)
LIGHT = [v for v in VECTORS if v.expected.status != LIMIT]
SHARE, SMALL = 8, 300
each_light_vector = looped("vector", [
    pytest.param(v, marks=[pytest.mark.heavy] if i % SHARE or v.bytes > SMALL else []) for i, v in enumerate(LIGHT)
])
"""All but those that take a decoder to its limits, which takes seconds; most, and large ones, among heavy tests."""


@pytest.fixture
def importable(monkeypatch):
    """Processes started by a test import what it does."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))


# --- the vectors ----------------------------------------------------------------------------------------------------


@pytest.mark.heavy  # `make test` runs all vectors by the runner
@each_vector
def test_reference_decoder_agrees(vector):
    """File, exit status, final state, and the states after each layer where they are stated."""
    (result,) = runner.run([vector], HOME, runner.reference, layers=True)
    assert result.passed, result.reason


@each_light_vector
def test_byte_by_byte_is_the_same(vector):
    """How the bytes were cut changes nothing: state, symbols, events with their offsets, error."""
    path = HOME / vector.file
    whole, bytewise = dump_file(path), dump_file(path, piece=1)
    assert (bytewise.exit_code, bytewise.text, bytewise.symbols) == (whole.exit_code, whole.text, whole.symbols)
    assert bytewise.events == whole.events
    if whole.error is not None:
        assert type(bytewise.error) is type(whole.error)
        assert bytewise.error.code == whole.error.code
        assert bytewise.error.clause == whole.error.clause


@each_light_vector
def test_manifest_entry_is_right(vector):
    """Counts, symbols and stored texts belong to the digest that they stand next to."""
    output = dump_file(HOME / vector.file)
    expected = vector.expected
    assert vector.bytes == (HOME / vector.file).stat().st_size
    if expected.status == ERROR:
        assert output.exit_code in REFUSED
        assert output.error.clause == expected.clause
        assert not output.text
        return
    if expected.status == NO_MESH:
        assert (output.exit_code, output.text) == (OTHER_MESH, "")
        return
    assert expected.symbols == {name: count for name, count in output.symbols.items() if count}
    assert set(vector.elements) == {name for name, count in output.symbols.items() if count}
    kinds = Counter(line.split()[0] for line in output.text.splitlines())
    assert (expected.vertices, expected.edges) == (kinds["v"], kinds["e"])
    stored = (HOME / vector.file).with_suffix(".txt")
    if stored.exists():
        assert stored.read_bytes().decode("ascii") == output.text
    if vector.layers and expected.status == OK:
        assert vector.layers[-1].state == expected.state


@pytest.mark.heavy
def test_manifest_covers_the_format():
    """At least 25 vectors; every syntax element, residue of levels and outcome in both dimensions."""
    assert len(VECTORS) >= 25
    assert len(BY_NAME) == len(VECTORS)
    for n in (2, 3):
        of_n = [v for v in VECTORS if v.dimension == n]
        whole = [v for v in of_n if v.expected.status == OK]
        assert {name for v in whole for name in v.elements} == set(ELEMENTS)
        assert {v.expected.status for v in of_n} - {LIMIT, NO_MESH} == {OK, TRUNCATED, ERROR}
        features = {f for v in whole for f in v.features}
        for residue in range(n):
            for kind in ("base", "refinement", "new components"):
                assert f"{kind}, level {residue} mod {n}" in features
            assert f"adaptive base, uniform level {residue} mod {n}" in features
        for feature in (
            "leaf base", "adaptive refinement, with births", "adaptive refinement, without births", "several isovalues",
            "isovalue that leans on none", "isovalue that leans on an earlier one",
        ):
            assert feature in features
        layers = {layer.kind for v in whole for layer in v.layers}
        assert layers == {
            "base", "adaptive_base", "leaf_base", "refine", "adapt", "values", "offsets", "signs", "levels", "cut",
        }
        assert {layer.unit for v in whole for layer in v.layers} >= {0, 1, 3}
        lines = Counter(line.split()[0] for v in whole for line in dump_file(HOME / v.file).text.splitlines())
        assert set(lines) - {"s"} == {
            "shape", "level", "m", "v", "e", "isovalue", "mask", "frame", "domain", "nodes", "p", "t", "surface",
            "tiles", "tile",
        } - ({"surface"} if n == 3 else set())


@pytest.mark.parametrize("n", [2, 3])
def test_vectors_of_the_main_profile_use_every_kind_of_symbols(n):
    """Those that adapt their weights, over all vectors; kinds of a third phase only in space."""
    weights = shipped_models(n)[2].mix
    used = np.zeros(len(weights), np.bool_)
    for v in VECTORS:
        if v.dimension == n and "main profile" in v.features and v.expected.status == OK:
            decoder = fed((HOME / v.file).read_bytes())
            for tube in decoder.grid.tubes:
                used |= (tube.coder.blend.mix != weights).any(axis=1)
    assert set(np.flatnonzero(~used)) == ({4, 5, 10, 11, 42, 45} if n == 2 else set())


@pytest.mark.heavy
@pytest.mark.parametrize("tier", TIERS)
def test_tiers_of_conformance(tier):
    """Within the counts of its tier every vector decodes; some beyond tier 0 do not, and exit with 6 then."""
    limits = Limits.tier(tier)
    refused = 0
    for vector in LIGHT:
        if vector.expected.state is None or (INTERPRETED and vector.tier):
            continue
        output = dump_file(HOME / vector.file, limits=limits)
        if vector.tier <= tier:
            assert digest(output.text) == vector.expected.state, vector.name
        refused += output.exit_code == LimitError.exit_code
    assert (refused >= 3) == (tier == 0) or INTERPRETED


@pytest.mark.parametrize("tier, code, passes", [(0, 6, True), (1, 6, False), (1, 0, False), (0, 4, False)])
def test_a_decoder_may_refuse_what_its_tier_does_not_ask_for(tier, code, passes):
    vector = next(v for v in VECTORS if v.tier == 1 and v.expected.status == OK)
    (result,) = runner.run([vector], HOME, lambda path, layers: (code, ""), tier=tier)
    assert result.passed == passes


@looped("code, passes", [(6, True), (4, True), (0, False), (5, False), (-9, False)])
def test_nobody_has_to_decode_what_is_beyond_all_tiers(code, passes):
    """A decoder that goes on finds a violation only where the vector states one."""
    beyond = [v for v in VECTORS if v.expected.status == LIMIT]
    results = runner.run(beyond, HOME, lambda path, layers: (code, ""))
    assert {v.expected.clause is None for v in beyond} == {True, False}
    assert [r.passed for r in results] == [passes and (code == 6 or v.expected.clause is not None) for v in beyond]


def test_a_file_on_another_mesh_has_an_exit_code_of_its_own():
    """That of annex B.3, whether the mesh is missing or another one."""
    on_others = [v for v in VECTORS if v.expected.status == NO_MESH]
    for code in (0, 3, 4, 5, 6):
        results = runner.run(on_others, HOME, lambda path, layers, code=code: (code, ""))
        assert [result.passed for result in results] == [code == 3] * len(on_others)
    assert len(on_others) > 1


@pytest.mark.heavy
def test_generation_gives_the_same_bytes(tmp_path):
    """``generate`` makes the committed files, all of them; what the old manifest lists besides goes, the rest stays."""
    manifest = (HOME / NAME).read_text().replace('"plane_flat.iso"', '"plane_old.iso"')
    (tmp_path / NAME).write_text(manifest)
    for name in ("plane_old.iso", "plane_old.txt", "other.iso"):
        (tmp_path / name).write_bytes(b"")
    generate(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in HOME.iterdir()}
    assert made.keys() == kept.keys() | {"other.iso"}
    assert [name for name in kept if made[name] != kept[name]] == []


# --- the circle -----------------------------------------------------------------------------------------------------


CIRCLE_MEMORY = 64 << 20
"""For a circle of 200 cells in a domain of 100,000 x 100,000, at most."""


@pytest.mark.parametrize("name", ["circle_100000", "circle_100000_rounds"])
def test_circle_is_the_circle(name):
    """In little memory; signs are the field's, and both ends of every grid edge that is crossed are known."""
    decoder = fed((HOME / f"{name}.iso").read_bytes())
    assert decoder.budget.peak < CIRCLE_MEMORY
    state = decoder.grid.state()
    away = state.position - np.array(CENTRE)
    assert np.array_equal(state.above, (away**2).sum(axis=1) < RADIUS**2)
    known = set(map(tuple, away.tolist()))
    axis = np.arange(-RADIUS - 2, RADIUS + 3)
    inside = axis[:, None] ** 2 + axis**2 < RADIUS**2
    for a in (0, 1):
        low = np.argwhere(np.diff(inside, axis=a)) - RADIUS - 2
        high = low + np.eye(2, dtype=np.int64)[a]
        assert set(map(tuple, np.concatenate([low, high]).tolist())) <= known


# --- the runner -----------------------------------------------------------------------------------------------------

WITH_TEXT = {"plane_values_8_bit", "space_noise_5x6x7", "plane_ends_in_values"}
WITHOUT_TEXT = {"plane_ends_in_header", "bad_trailing"}
SOME = sorted(WITH_TEXT | WITHOUT_TEXT)


def run_some(capsys, *arguments, names=SOME):
    """Exit code and lines of the runner over some vectors."""
    code = main([*arguments, *(word for name in names for word in ("--only", name))])
    return code, capsys.readouterr().out.splitlines()


def decoder_of(tmp_path: Path, body: str) -> str:
    """Command of a decoder that knows the answers, its exit code and text changed by ``body``."""
    answers = {str(HOME / BY_NAME[name].file): BY_NAME[name].expected.status for name in SOME}
    script = tmp_path / "decoder.py"
    script.write_text(
        "import pathlib, sys\n"
        f"code = {{'ok': 0, 'truncated': 5, 'error': 4}}[{answers!r}[sys.argv[1]]]\n"
        "stored = pathlib.Path(sys.argv[1]).with_suffix('.txt')\n"
        "text = stored.read_text() if stored.exists() else ''\n"
        f"{body}\n"
        "sys.stdout.write(text)\n"
        "sys.exit(code)\n"
    )
    return f"{{python}} '{script}' {{file}} {{layers}}"


@pytest.mark.heavy
def test_runner_with_the_reference_as_a_command(capsys, importable):
    """The same through a process and its text."""
    command = "{python} -m isoconform dump {file} --layers {layers}"
    names = ["space_base_9", "plane_ends_in_values", "bad_trailing"]
    code, lines = run_some(capsys, "run", "--layers", "--decoder", command, names=names)
    assert (code, lines[-1]) == (0, "3 passed, 0 failed")


@pytest.mark.parametrize(
    ("body", "wrong"),
    [
        ("", set()),
        ("text = text[:-1] + '0\\n' if text else text", WITH_TEXT),
        ("text = text.replace('v ', 'v  ', 1)", WITH_TEXT),
        ("text = text.rsplit('\\n', 2)[0] + '\\n' if text else text", WITH_TEXT),
        ("code = 0", {"plane_ends_in_values", "plane_ends_in_header", "bad_trailing"}),
        ("code = 1 if code == 4 else code", {"bad_trailing"}),
        ("text = text or 'shape 2 2'", WITHOUT_TEXT),
    ],
)
def test_wrong_decoders_fail(capsys, tmp_path, body, wrong):
    """A changed number, another layout, a lost line, files accepted that are not whole or not right, crashes."""
    code, lines = run_some(capsys, "--decoder", decoder_of(tmp_path, body))
    assert code == (1 if wrong else 0)
    assert {line.split()[1].rstrip(":") for line in lines if line.startswith("FAIL")} == wrong
    assert lines[-1] == f"{len(SOME) - len(wrong)} passed, {len(wrong)} failed"


def test_a_wrong_layer_fails(capsys, tmp_path):
    """Right at the end, wrong on the way: only ``--layers`` sees that."""
    command = decoder_of(tmp_path, "")
    names = ["plane_values_8_bit"]
    assert run_some(capsys, "--decoder", command, names=names)[0] == 0
    code, lines = run_some(capsys, "--layers", "--decoder", command, names=names)
    assert code == 1
    assert "after layer 1" in lines[0]


def test_damaged_vectors_fail(capsys, tmp_path):
    """A file that is not the manifest's, or missing."""
    (tmp_path / NAME).write_bytes((HOME / NAME).read_bytes())
    (tmp_path / "bad_text.iso").write_bytes(b"another text")
    code, lines = run_some(capsys, "--vectors", str(tmp_path), names=["bad_text", "plane_flat"])
    assert (code, lines[-1]) == (1, "0 passed, 2 failed")


@pytest.mark.parametrize(
    "arguments",
    [
        ["--only", "no_such_vector"],
        ["--vectors", "/no/such/directory"],
        ["--decoder", "cat"],
        ["--decoder", "/no/such/decoder {file}"],
        ["--layers", "--decoder", "cat {file}"],
        ["dump", "/no/such/file.iso"],
    ],
)
def test_usage_errors(capsys, arguments):
    """Said in one line, exit code 2."""
    assert main(arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_dump(capfdbinary):
    """Text on standard output, errors elsewhere, exit codes by outcome."""
    for name, code in (("plane_values_8_bit", 0), ("plane_ends_in_values", CUT_OFF), ("bad_trailing", REFUSED[0])):
        vector = BY_NAME[name]
        assert main(["dump", str(HOME / vector.file)]) == code
        sys.stdout.flush()
        captured = capfdbinary.readouterr()
        if code in REFUSED:
            assert not captured.out
        else:
            assert digest(captured.out.decode("ascii")) == vector.expected.state
        assert bool(captured.err) == (code != 0)
