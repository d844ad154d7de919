"""Worked examples of annex C: of the main profile, and of a mesh; ``test_fuzz`` has that of the baseline profile."""

import hashlib
import math
import re
import struct
import subprocess
import sys

import numpy as np

from home import ROOT
from isocodec.entropy.context_layout import shipped_tables
from isoconform.plain import environment

sys.path.insert(0, str(ROOT / "tools"))

import spec_example


def _example(name: str) -> str:
    text = spec_example.SPEC.read_text(encoding="utf-8")
    return text.partition(f"<!-- {name}: ")[2].partition(f"<!-- end of {name} -->")[0]


def _rows_of_text(text: str) -> dict[str, list[list[int]]]:
    """Rows of the table, by their first cell: the numbers in each of the further ones."""
    rows = [line.strip("| \n").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {row[0]: [[int(x) for x in re.findall(r"-?\d+", cell)] for cell in row[1:]] for row in rows}


def test_further_examples_are_what_the_reference_decodes():
    code = "import spec_example as s; print(s.main_text(), s.mesh_text(), sep='<>', end='')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True, env=environment())
    assert done.stdout.split("<>") == [_example(name).partition("\n\n")[2][:-1] for name in ("main", "mesh")]


def test_example_of_mixing_is_arithmetic():
    """Numbers of the text follow from one another by clauses 6.5, 7.10 and 7.11."""
    rows, tables = _rows_of_text(_example("main")), shipped_tables()[1][2]
    for i, opinions in enumerate(rows["opinions"]):
        weights, (x,), (p,), (bit, error) = (rows[name][i] for name in ("weights", "`x`", "`p`", "bit, `error`"))
        if total := rows["`total`"][i]:
            network, kind = rows["network, kind, flip"][i]
            sums = tables.weight[rows["rows"][i]].astype(np.int64).sum(axis=0)
            assert sums[:8].tolist() == rows["`sum`, first 8"][i]
            assert total == [int(tables.out[network] @ [*np.maximum(sums, 0), 1])]
            assert (opinions[0], opinions[3]) == (total[0] >> 8, 256)
            assert rows["contexts"][i][1] == 3800 + 32 * kind + ((opinions[0] + 2047) >> 7)
        assert x == sum(w * o for w, o in zip(weights, opinions, strict=True)) >> 16
        assert p == round(65536 / (1 + math.exp(-x / 256))) and error == 40 * (65536 * bit - p)
        assert rows["weights after"][i] == [w + (error * o >> 20) for w, o in zip(weights, opinions, strict=True)]
        before, after = (rows[name][i] for name in ("their `p` and `seen`", "`p` and `seen` after"))
        for at in range(0, len(before), 2):
            old, seen = before[at : at + 2]
            step = 65536 // (seen + 2)
            moved = old + ((65536 - old) * step >> 16) if bit else old - (old * step >> 16)
            assert after[at : at + 2] == [moved, seen + 1]


def test_example_of_a_mesh_by_other_means():
    """The hash of the canonical form by struct and hashlib, the state by comparing the values with the isovalue."""
    text = _example("mesh")
    points, cells, values = spec_example.POINTS, spec_example.CELLS, spec_example.VALUES
    numbers = [2, 2, 5, 4, *(points * 2**17).ravel().tolist(), *cells.ravel().tolist()]
    assert hashlib.sha256(struct.pack("<26q", *numbers)).digest()[:16].hex(" ") in text
    state = [f"v {i} {v > 4.5:d} {v - 5 if v > 4.5 else 4 - v}" for i, v in enumerate(values.tolist())]
    assert [line.strip() for line in text.splitlines() if line.startswith("    v")] == state
