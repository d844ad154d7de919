"""The same bytes everywhere: frozen digests, and kernels from the library, compiled by numba, or as plain Python."""

from __future__ import annotations

import copy
import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED, smooth
from explicit_meshes import plane, space, torus
from home import ROOT
from isocodec.field.placement import Placement
from isocodec.kernel import EXECUTION, Execution
from isocodec.kernel.call import Kernel
from isocodec.kernel.execution import SETTING
from isocodec.kernel.types import Registers
from isocodec.tin.delaunay import delaunay, remove
from isocodec.tin.rank import by_rank
from make_goldens import CASES, PATH, SMALL, digests

sys.path.insert(0, str(ROOT / "tools" / "kernels"))

from front import kernels

from tables import looped


@looped("name", SMALL if INTERPRETED else list(CASES))
def test_goldens(name):
    """Files and decoded states are those of ``goldens.json``, which only ``make_goldens.py`` writes."""
    goldens = json.loads(PATH.read_text())
    assert set(goldens) == set(CASES)
    assert digests(name) == goldens[name]


@pytest.mark.cover(2)
@pytest.mark.parametrize("name", SMALL if INTERPRETED else list(CASES))
@pytest.mark.parametrize("byte", [0x55, 0xFF])
def test_goldens_whatever_memory_held(name, byte, monkeypatch):
    """What new arrays hold before they are written is never read: not in room to grow, not in pages not yet begun."""
    soiled = []

    def soil(make):
        def made(*arguments, **options):
            out = make(*arguments, **options)
            if out.dtype.kind in "iubf" and out.flags.c_contiguous:
                out.reshape(-1).view(np.uint8)[:] = byte & 1 if out.dtype.kind == "b" else byte
                soiled.append(out.nbytes)
            return out
        return made

    for name_of in ("empty", "empty_like"):
        monkeypatch.setattr(np, name_of, soil(getattr(np, name_of)))
    assert digests(name) == json.loads(PATH.read_text())[name]
    assert sum(soiled) > 0


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="tried from there")
@pytest.mark.parametrize("execution", ["python", pytest.param("numba", marks=pytest.mark.heavy)])
def test_other_executions_give_the_same(execution):
    """In another process: the same bytes and the same decoded state, n = 2 and 3."""
    assert {CASES[name][0].ndim for name in SMALL} == {2, 3}
    environment = {**os.environ, SETTING: execution, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    script = str(PATH.with_name("make_goldens.py"))
    done = subprocess.run(
        [sys.executable, script, "--print", *SMALL], env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {name: digests(name) for name in SMALL}


def doubled(value: Any, copies: dict[int, Any]) -> Any:
    """An argument of a kernel, its arrays copied; one that comes again is the same copy again."""
    if isinstance(value, tuple):
        return type(value)._make(doubled(member, copies) for member in value)  # type: ignore[attr-defined]
    return copies.setdefault(id(value), copy.copy(value))


def contents(value: Any) -> Any:
    """What can be compared of an argument of a kernel, or of what it returned, to the last bit."""
    if isinstance(value, tuple):
        return tuple(map(contents, value))
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, Registers):
        return value.values.tobytes()
    return np.float64(value).tobytes() if isinstance(value, float) else value


@pytest.fixture
def twice(monkeypatch):
    """Each call of a kernel is made twice, to what is compiled and to its source; names of those that were called."""
    compiled, called = Kernel.__call__, set()

    def both(kernel: Kernel, *arguments: Any) -> Any:
        copies: dict[int, Any] = {}
        others = [doubled(argument, copies) for argument in arguments]
        result = compiled(kernel, *arguments)
        assert contents(result) == contents(kernel.function(*others)), kernel.name
        for (name, _), mine, other in zip(kernel.signature.arguments, arguments, others, strict=True):
            assert contents(mine) == contents(other), f"{kernel.name}: {name}"
        called.add(f"{kernel.function.__module__}.{kernel.function.__name__}")
        return result

    monkeypatch.setattr(Kernel, "__call__", both)
    return called


@pytest.mark.heavy
@pytest.mark.skipif(INTERPRETED, reason="nothing is compiled")
def test_compiled_kernels_do_what_their_source_says(twice):
    """All of them: to the last bit, what they return and what becomes of arrays."""
    leaves = {0.5: [("base", 3)], 5.5: [("leaf_base",), ("refine", None)]}
    for shape in ((7, 9), (3, 4, 5)):
        field = np.rint(100 * smooth(shape, 3)).astype(np.int64)
        for options in (
            {"precision": "exact", "layers": 2}, {"layers": "curvature=0.5", "precision": 0.2},
            {"layers": "distortion=0.5", "precision": 0.2, "keep_topology": True},
            {"layers": leaves}, {
                "precision": "signs", "profile": "baseline",
            }, {"precision": 0.2, "profile": "baseline"},
        ):
            isocodec.open(isocodec.encode(field, [0.5, 5.5], **options)).contours(smooth=True)
    for shape in ((6, 7), (3, 4, 4)):
        field = np.rint(100 * smooth(shape, 3)).astype(np.int64)
        data = isocodec.encode(field, 0.5, precision=0.05)
        assert np.array_equal(isocodec.open(data).above(), field > 0.5)
        decoder = isocodec.Decoder()
        for start in range(0, len(data), 4):
            decoder.feed(data[start : start + 4])
            if decoder.take().header is not None:
                decoder.contour()
        isocodec.encode(field, 0.5, precision=1.0)
        isocodec.encode(field, [0.5, 20.5], precision=1.0)
        gone = np.random.default_rng(4).random(shape) < 0.1
        for more in ({"precision": "exact"}, {"precision": 0.05}, {"precision": "exact", "profile": "baseline"}):
            isocodec.decode(isocodec.encode(isocodec.Field(field, mask=gone), 0.5, **more))
    for mesh in (plane(1, 30), space(1, 12), torus(5, 4)):
        values = np.rint(mesh[0].sum(axis=1) * 7).astype(np.int64) % 50
        for precision, progressive in (("exact", None), (1.0, None), ("signs", mesh[0].shape[1] == 2)):
            given = isocodec.Mesh(*mesh, values, progressive=progressive)
            isocodec.open(isocodec.encode(given, [20.5, 30.5], precision=precision), mesh=mesh).contours()
        isocodec.encode(isocodec.Mesh(*mesh, values), 20.5, precision=2.0, keep_topology=True)
        isocodec.decode(isocodec.encode(isocodec.Mesh(*mesh, values, stored="coded"), 20.5))
        isocodec.encode(isocodec.Mesh(*mesh, np.array([values, values + 3])), 20.5, precision="exact")
    isocodec.decode(isocodec.encode(isocodec.Mesh(plane(1, 30)[0], None, np.arange(30)), 14.5))
    hills = np.rint(100 * smooth((9, 9, 8), 3)).astype(np.int64)
    for options in ({"precision": "signs"}, {"precision": "exact", "profile": "baseline"}):
        isocodec.decode(isocodec.encode(isocodec.Frames(hills[:3]), 0.5, **options), frame=2)
    coordinates = np.arange(9.0)[:, None] + np.zeros(8), np.arange(8.0) + np.arange(9.0)[:, None] / 9
    isocodec.decode(isocodec.encode(isocodec.Field(hills[0], placement=Placement(coordinates=coordinates)), 0.5))
    points = np.random.default_rng(5).integers(0, 1 << 20, (30, 2))
    for criterion in ("inf", "AT3", "l2", "NAT"):
        isocodec.thin(isocodec.Mesh(points, None, points[:, 0] % 7), criterion=criterion, to=8)
        isocodec.thin(points[:, 0].reshape(5, 6) % 7, criterion=criterion, error=2.5)
    for options in ({"to": 12}, {"error": 1.0, "layers": 2}):
        isocodec.open(isocodec.encode(isocodec.thin(points[:, 0].reshape(5, 6) % 7, **options))).surface().raster()
    triangulation, _ = delaunay(*np.ascontiguousarray(points[by_rank(*points.T)].T))
    assert sum(remove(triangulation, v) for v in range(30)) > 10
    assert twice == {f"{found.module}.{found.name}" for found in kernels()}


@looped("name", SMALL)
def test_nothing_is_left_behind(name):
    """The second file of a process is the first one's: no state outlives an encoder."""
    field, isovalue, options = CASES[name]
    first = isocodec.encode(field, isovalue, **options)
    isocodec.encode(field.T, isovalue + 1, precision="signs")
    assert isocodec.encode(field, isovalue, **options) == first
