"""Kernels as WebAssembly, under node: files, states and curves are those of this platform's kernels, bit by bit."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from home import ROOT
from isocodec import Field, encode
from isocodec.kernel import EXECUTION, Execution
from isoconform import runner
from isoconform.explicit_dump import is_explicit
from isoconform.manifest import default_directory, read_manifest
from isoconform.tiled_dump import is_tiled
from make_goldens import CASES, PATH, digests, hill, noise
from tables import looped
from wasm.runner import Failed, Runner

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.skipif(EXECUTION is Execution.PYTHON, reason="kernels run as plain Python"),
    pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed"),
]
BUILDER = ROOT / "tools" / "kernels"


def of_grids(data: bytes) -> bool:
    """Whether a file is of grids, whole."""
    return not is_explicit(data) and not is_tiled(data)


VECTORS = [
    vector
    for vector in read_manifest(default_directory())
    if vector.tier < 2 and of_grids((default_directory() / vector.file).read_bytes())
]
"""All of grids but those that copy hundreds of megabytes back and forth."""
PARTS = 4
"""Vectors are run in so many tests, which may go side by side."""
LARGEST = 92_000
"""Bytes that a decoder's module takes on its way, at most."""
PLANE = hill((45, 60), 900) + noise((45, 60), 1, 40)
SPACE = hill((12, 14, 13), 150) + noise((12, 14, 13), 2, 9)
FILES: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "search": (PLANE, 300.5, {"precision": 1}),
    "search in space": (SPACE, 60.5, {"precision": 0.5}),
    "map": (PLANE, [280.5, 300.5, 320.5], {"precision": 1}),
    "topology": (PLANE, 300.5, {"precision": 0.7, "keep_topology": True}),
    "steps": (SPACE, 60.5, {"precision": [2, 0.5, "exact"]}),
    "isovalues": (PLANE, [300.5, 310.5, 100.5], {"precision": "exact"}),
    "floats": (PLANE / 7, 43.2, {"precision": "step=0.01"}),
    "curvature": (SPACE, 60.5, {"layers": "curvature=0.3"}),
    "same mesh": (PLANE, [300.5, 310.5], {"layers": {
        300.5: [("base", 2), ("refine", None), ("values", None)], 310.5: [("leaf_base",), ("values", None)],
    }}),
    "holes": (Field(PLANE, mask=np.hypot(*np.indices(PLANE.shape)) < 9), 300.5, {"precision": 0.2}),
    "points in cells": (np.indices((9, 8, 10)).sum(axis=0) % 2 * 10 - 5, 0.5, {}),
    "holes in space": (Field(SPACE, mask=np.indices(SPACE.shape).sum(axis=0) < 5), 60.5, {}),
}
"""Between them, they need every kernel."""
MASKED = ("isovalues", "floats")
"""Some on the full grid, of which there are masks."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with both modules."""
    out = tmp_path_factory.mktemp("wasm")
    done = subprocess.run([sys.executable, BUILDER, "--target", "wasm32", "--out", out], capture_output=True, text=True)
    if "cannot be installed" in done.stderr:
        pytest.skip("the modules are not built, and what their build needs cannot be installed")
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def whole(built: Path) -> Iterator[Runner]:
    """All kernels."""
    out = Runner(built / "kernels.wasm")
    yield out
    out.close()


@pytest.fixture(scope="module")
def decoder(built: Path) -> Iterator[Runner]:
    """Those of a decoder."""
    out = Runner(built / "decoder.wasm")
    yield out
    out.close()


def drawn(data: bytes, masked: bool) -> list[bytes]:
    """All that can be made of a file."""
    curves = [*isocodec.open(data).contours(), *isocodec.open(data).contours(smooth=True)]
    decoder = isocodec.Decoder()
    for start in range(0, len(data), 50):
        # in the middle of a round, too
        decoder.feed(data[start : start + 50])
        if decoder.take().header is not None:
            curves.append(decoder.contour())
    out = [array.tobytes() for curve in curves for array in (curve.points, curve.cells)]
    return [*out, isocodec.open(data).above().tobytes()] if masked else out


def test_the_decoder_is_small(built: Path):
    """As servers send it; with brotli, which not everybody has, by a tenth less still."""
    assert len(zlib.compress((built / "decoder.wasm").read_bytes(), 9)) <= LARGEST


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.heavy) for part in range(1, PARTS))])
def test_vectors(decoder: Runner, part: int):
    """Every vector is decoded, or refused, as it has to be."""
    with decoder.at_work():
        results = list(runner.run(VECTORS[part::PARTS], default_directory(), runner.reference))
    assert [result for result in results if not result.passed] == []
    assert "iso_passes_base_base" in decoder.called


@looped("name", CASES)
def test_goldens(whole: Runner, name: str):
    """Files and states are those of every platform."""
    with whole.at_work():
        assert digests(name) == json.loads(PATH.read_text())[name]


def test_files_and_curves(whole: Runner, decoder: Runner):
    """Files, points, smooth ones and masks are this platform's, bit by bit; every kernel of grids has been called."""
    for name, (field, isovalue, options) in FILES.items():
        data = encode(field, isovalue, **options)
        expected = drawn(data, name in MASKED)
        with whole.at_work():
            assert encode(field, isovalue, **options) == data, name
        with decoder.at_work():
            assert drawn(data, name in MASKED) == expected, name
    left_out = ("iso_mesh_", "iso_search_mesh_", "iso_tin_", "iso_passes_nodes_", "iso_tube_softened_")
    assert {entry for entry in whole.entries - whole.called if not entry.startswith(left_out)} <= decoder.called
    assert {entry for entry in decoder.entries if entry.startswith("iso_drawing_")} <= decoder.called


def test_a_decoder_does_not_encode(decoder: Runner):
    """What the module does not have does not run elsewhere instead."""
    with decoder.at_work(), pytest.raises(Failed, match=r"iso_search_.* is not in the module"):
        encode(PLANE, 300.5, precision=1)
