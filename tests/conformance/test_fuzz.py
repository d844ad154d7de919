"""Fuzzing of decoders: files from the syntax, damage, the batch protocol, what is found, and the annotated dump."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from random import Random

import numpy as np
import pytest

from home import ROOT
from isocodec import encode
from isocodec.errors import KernelError
from isoconform import strategies
from isoconform.__main__ import main
from isoconform.damage import damaged
from isoconform.decoders import Answer, Batch, Reference, Request
from isoconform.dump import COMPLETE, CUT_OFF, REFUSED, dump
from isoconform.fuzz import STATE, Campaign
from isoconform.growing import probe
from isoconform.manifest import default_directory
from isoconform.properties import check
from isoconform.syntax import any_file, bare_file
from isospec.elements import ELEMENTS
from tables import heavy

VECTORS = default_directory()
SPEC = ROOT / "spec" / "example.md"
ANNEX_C = bytes.fromhex("8949534f11400412210ac22f22aee379e8a4ea7d6a8f5898")
"""The file that annex C of the specification explains byte by byte."""


@pytest.fixture
def importable(monkeypatch):
    """Processes started by a test import what it does."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))


@pytest.fixture
def annex(tmp_path):
    path = tmp_path / "annex c.iso"
    path.write_bytes(ANNEX_C)
    return path


# --- files from the syntax ------------------------------------------------------------------------------------------


@pytest.mark.heavy  # hundreds of files by plain Python
def test_files_reach_what_encoders_do_not_write():
    """Of 120 files many are whole and valid, many end early, a few are an error; all kinds of layers come in them."""
    outputs = [dump(any_file(Random(seed))) for seed in range(120)]
    codes = [output.exit_code for output in outputs]
    assert codes.count(COMPLETE) > 45 and codes.count(CUT_OFF) > 8 and 2 < codes.count(REFUSED[0]) < 30
    assert {name for output in outputs for name, count in output.symbols.items() if count} == set(ELEMENTS)
    kinds = {event.layer.kind for output in outputs for event in output.events if hasattr(event, "layer")}
    assert kinds == {"base", "adaptive_base", "leaf_base", "refine", "adapt", "values", "offsets"}
    assert any("isovalue 1" in output.text for output in outputs)


# --- damage ---------------------------------------------------------------------------------------------------------


def test_damage_reaches_many_clauses():
    """Checksums are repaired: it is the damage that a decoder sees."""
    clauses = {probe(damaged(bare_file(Random(seed)), Random(seed))).error for seed in range(300)}
    found = {error.clause for error in clauses if error is not None}
    assert found >= {"3.3.3", "3.3.4", "3.4.2", "3.4.4", "3.5.2", "3.5.5", "3.6", "6.3"}


# --- decoders under test --------------------------------------------------------------------------------------------


def test_batch_protocol_of_the_reference(annex, importable):
    """A line with code and length, then the text; a start of the file; a field, and a kind of it, that is not known."""
    asked = f"{annex}\n{annex}\tbytes=9\n{annex}\tlayers=1\tpiece=1\n{annex}\tcolour=3\n{annex}\tlayers=x\n"
    done = subprocess.run(
        [sys.executable, "-m", "isoconform", "dump", "--batch"], input=asked.encode(), capture_output=True, check=True
    )
    expected = b""
    for output in (dump(ANNEX_C), dump(ANNEX_C[:9]), dump(ANNEX_C, layers=1)):
        expected += f"{output.exit_code} {len(output.text)}\n{output.text}".encode()
    assert done.stdout == expected + b"-\n-\n"


def script(tmp_path: Path, body: str) -> str:
    """Command of a batch decoder: ``body`` answers ``data``, ``asked`` by ``say(code, text)``."""
    path = tmp_path / "decoder.py"
    path.write_text(
        "import os, sys, time\n"
        "from isoconform.dump import dump\n"
        "def say(code, text):\n"
        "    sys.stdout.write(f'{code} {len(text)}\\n{text}')\n"
        "    sys.stdout.flush()\n"
        "for line in sys.stdin:\n"
        "    name, *fields = line.rstrip('\\n').split('\\t')\n"
        "    asked = {key: int(number) for key, number in (field.split('=') for field in fields)}\n"
        "    data = open(name, 'rb').read()[: asked.get('bytes')]\n" + textwrap.indent(textwrap.dedent(body), "    ")
    )
    return f"{{python}} '{path}'"


def test_a_decoder_that_dies_is_started_again(tmp_path, importable):
    """The file that killed it counts as a crash, those behind it are answered."""
    body = """
        if len(data) == 3:
            os._exit(4)
        say(0, 'x' * len(data))
    """
    decoder = Batch(script(tmp_path, body))
    for size in (1, 3, 2, 3):
        path = tmp_path / f"{size}.iso"
        path.write_bytes(bytes(size))
        decoder.ask(Request(path))
    answers = [decoder.answer() for _ in range(4)]
    decoder.close()
    assert [answer.trouble.partition(":")[0] for answer in answers] == ["", "crash", "", "crash"]
    assert (answers[0], answers[2]) == (Answer(0, "x"), Answer(0, "xx"))


# --- campaigns ------------------------------------------------------------------------------------------------------


@pytest.mark.heavy
def test_our_own_decoder_has_no_findings():
    """Whole, in pieces, cut, some layers."""
    campaign = Campaign(Reference(), seed=1, files=100, minutes=5)
    assert list(campaign.run()) == []
    assert campaign.report.files > 90 and campaign.report.questions > campaign.report.files


@pytest.mark.parametrize(
    "fault", [KernelError("an array with gaps", code="x"), *heavy(IndexError("an index out of bounds"))]
)
def test_faults_of_our_own_kernels_are_findings(tmp_path, monkeypatch, capsys, importable, fault):
    """They are no verdict on a file that both of two decoders agree on."""

    def broken(*_):
        raise fault

    monkeypatch.setattr("isocodec.grid.passes.base.base", broken)
    code = main(["fuzz", "--files", "30", "--shrink", "1", "--most", "3", "--json", "--out", str(tmp_path)])
    (finding,) = json.loads(capsys.readouterr().out)["findings"]
    assert (code, finding["sort"]) == (1, "crash")
    assert f"{type(fault).__name__}: {fault}" in finding["reason"]
    assert finding["reason"] in (tmp_path / "finding_01.md").read_text()
    with pytest.raises(type(fault)):
        dump(ANNEX_C)


FAULTS = {
    "a sign": "say(output.exit_code, output.text.replace('v 1 1 1', 'v 1 1 0'))",
    "exit code": "say(0 if output.exit_code == 5 else output.exit_code, output.text)",
    "crash": "os._exit(3) if output.symbols.get('offset_bit') else say(output.exit_code, output.text)",
}


@pytest.mark.parametrize("fault", ["exit code", *heavy("a sign", "crash")])
def test_planted_faults_are_found(tmp_path, capsys, importable, fault):
    """And saved: the file, shrunk, the expected text, and a report with an annotated dump."""
    command = script(tmp_path, f"output = dump(data, layers=asked.get('layers', 0))\n{FAULTS[fault]}")
    code = main(["fuzz", "--batch", "--decoder", command, "--files", "400", "--most", "1", "--json",
                 "--shrink", "4", "--out", str(tmp_path / "out")])
    report = json.loads(capsys.readouterr().out)
    (finding,) = report["findings"]
    assert code == 1
    # a process that dies takes its time to start again
    assert finding["bytes"] <= (finding["bytes_before"] if fault == "crash" else 80)
    assert finding["sort"] == {"a sign": STATE, "exit code": "exit code 0 instead of 5", "crash": "crash"}[fault]
    data = (tmp_path / "out" / "finding_01.iso").read_bytes()
    assert data.hex() == finding["hex"]
    assert (tmp_path / "out" / "finding_01.txt").read_text() == dump(data).text
    text = (tmp_path / "out" / "finding_01.md").read_text()
    assert finding["reason"] in text and "exit code" in text.splitlines()[-1]
    if len(data) >= 4:
        assert "signature (3.3.1)" in text


@pytest.mark.parametrize("arguments", [["--batch"], ["--encoder", "--decoder", "x {file}"], ["--decoder", "cat"]])
def test_usage_errors(capsys, arguments):
    assert main(["fuzz", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# --- explaining -----------------------------------------------------------------------------------------------------


def explained(path: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "isoconform", "explain", str(path)], capture_output=True, check=True, text=True
    )
    return done.stdout


def test_annex_c_is_what_the_encoder_writes():
    field = np.array([[1, 2, 2, 1], [2, 6, 7, 2], [1, 5, 8, 3], [0, 2, 3, 1]])
    assert encode(field, 4.5, precision="exact", layers=2, profile="baseline") == ANNEX_C


def test_annex_c_is_explained_as_in_the_specification(annex, importable):
    """Offsets and bytes of its table; for each of 46 symbols element, probability, range and bit."""
    text, spec = explained(annex), SPEC.read_text(encoding="utf-8")
    annex_c = spec[spec.index("### C.1") : spec.index("### C.3")]
    rows = re.findall(r"^\| (\d+) \| ((?:[0-9a-f]{2} ?)+) \| \w", annex_c, re.MULTILINE)
    expected = [(int(offset), part.strip()) for offset, part in rows]
    # the bits of values stand with the operation that they belong to
    expected = [(11, "2f 22") if offset == 11 else (offset, part) for offset, part in expected if offset != 12]
    found = re.findall(r"^ +(\d+)  ((?:[0-9a-f]{2} ?)+)  ", text, re.MULTILINE)
    assert [(int(offset), part.strip()) for offset, part in found] == expected
    pattern = r"^\| \d+ \| ([\w ]+) \| (\w+)[^|]* \| (\d+) \| ([0-9a-f]+) \| [0-9a-f]+ \| [0-9a-f]+ \| ([01]) \|"
    symbols = re.findall(pattern, annex_c, re.MULTILINE)
    assert len(symbols) == 46
    pattern = r"^ +\d+  ([\w ]+), (\w+)[^:]*: p = (\d+)/65536, range ([0-9a-f]+), bit ([01])"
    spoken = re.findall(pattern, text, re.MULTILINE)
    assert [(*s[:3], int(s[3], 16), s[4]) for s in spoken] == [(*s[:3], int(s[3], 16), s[4]) for s in symbols]
    assert "CURVE(0, 3, 1, 0, 2, 0)" in text and "VALUE_NEAR(0, 1, 2)" in text
    assert "(2, 0) below; (2, 2) above" in text and "(2, 2) number 3, 0 bits missing" in text
    state = spec[spec.index("### C.4") : spec.index("### C.5")].split("\n    ")[1:]
    assert [line.strip() for line in state] == dump(ANNEX_C).text.splitlines()
    assert text.splitlines()[-1] == "exit code 0, profile baseline, 46 symbols: complete"


EXPLAINED = [
    ("plane_main_vertex_2x9", ["profile main", "[network 5, kind ", "offsets, 9 parts of 2 samples", "part "]),
    ("bad_chunk_checksum", ["wrong, it is", "exit code 4", "[spec 3.5.3]"]),
    ("plane_ends_in_header", ["not read", "no symbols", "exit code 5"]),
    ("plane_isovalues_random_leaf_base", ["leans on isovalue 0", "leaf base at level", "adapt at level"]),
    ("bad_further_digits_long", ["[spec 3.3.4]"]),
]
"""Vectors, and what is found in the explanation of each."""


@pytest.mark.parametrize(("name", "parts"), [
    pytest.param(*one, marks=[pytest.mark.heavy] if number > 1 else []) for number, one in enumerate(EXPLAINED)
])
def test_any_file_is_explained(importable, name, parts):
    """All of its bytes, and as many symbols as the reference counts."""
    path = VECTORS / f"{name}.iso"
    text = explained(path)
    assert [part for part in parts if part not in text] == []
    rows = re.findall(r"^ +\d+  ((?:[0-9a-f]{2} ?)+)(?:  |$)", text.split("\n\n")[1], re.MULTILINE)
    assert bytes.fromhex("".join(rows)) == path.read_bytes()
    output = dump(path.read_bytes())
    if output.symbols:
        assert f", {sum(output.symbols.values())} symbols: " in text


# --- strategies and properties --------------------------------------------------------------------------------------


def test_wrong_signs_are_noticed():
    """A file of another field, and one whose start is another file's."""
    field = strategies.checkers((4, 4))
    data, other = encode(field, 0.5), encode(1 - field, 0.5)
    check(field, 0.5, data, [data], data[:9])
    with pytest.raises(AssertionError, match="sign"):
        check(field, 0.5, other, [other], b"")
    with pytest.raises(AssertionError, match="pieces"):
        check(field, 0.5, data, [other], b"")
