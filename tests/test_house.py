"""The house: who may import whom, what a kernel may take, how long things may be."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import isocodec

HOME = Path(inspect.getfile(isocodec)).parent
FLOORS = (
    "kernel", "field", "mesh", "entropy", "tube", "models", "domain", "drawing", "passes", "format", "layers", "search",
    "stream", "tiles", "io", "cli",
)
"""Packages, from the ground up: each imports from those below it only."""
KERNELS = {"kernel", "inner", "inlined"}
MODULES = sorted(path for path in HOME.rglob("*.py") if path.parent.name != "built")
MOST_TAKEN, MOST_LINES = 8, 80
"""Parameters and lines of a compiled function at most; a record is one parameter."""
NOT_YET = {
    "reduction._parents", "distance._exceed", "distance._nearest", "distortion._clamped_simplex_at",
    "distortion._crossing", "distortion._implied", "distortion.too_far", "topology.safe",
}
"""Functions of ``search`` that are longer or take more."""
WORDS = ("vertex", "simplex", "gate", "diamond", "dimension", "middle")
"""What entropy coding knows nothing of."""


def imports(path: Path) -> Iterator[str]:
    """Packages of ours that a module imports from, by their first name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == len(path.relative_to(HOME).parts):
            yield from [node.module.split(".")[0]] if node.module else [name.name for name in node.names]


def kernels(path: Path) -> Iterator[ast.FunctionDef]:
    """Functions of a module that are compiled."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        decorators = node.decorator_list if isinstance(node, ast.FunctionDef) else []
        if any(isinstance(each, ast.Name) and each.id in KERNELS for each in decorators):
            yield node


def test_every_package_has_its_floor():
    assert {path.parent.name for path in MODULES} - {HOME.name} == set(FLOORS)


@pytest.mark.parametrize("floor", FLOORS)
def test_imports_go_down(floor: str):
    above = set(FLOORS[FLOORS.index(floor) + 1 :])
    found = {path.name: sorted(above & set(imports(path))) for path in MODULES if path.parent.name == floor}
    assert {name: names for name, names in found.items() if names} == {}


def test_the_mesh_takes_a_grid():
    """Not the coder, nor the state of a tube."""
    for path in (HOME / "mesh").glob("*.py"):
        taken = {argument.arg for found in kernels(path) for argument in found.args.args}
        assert not taken & {"st", "cd", "state", "coder"}, path.name


def test_entropy_coding_knows_no_mesh():
    for path in (HOME / "entropy").glob("*.py"):
        text = path.read_text(encoding="utf-8").lower()
        assert not [word for word in WORDS if word in text], path.name


def test_modules_are_short_and_named():
    for path in MODULES:
        text = path.read_text(encoding="utf-8")
        assert ast.get_docstring(ast.parse(text)), path
        assert len(text.splitlines()) <= 400, path


def test_compiled_functions_are_short_and_take_few():
    found = {
        f"{path.stem}.{node.name}"
        for path in MODULES
        for node in kernels(path)
        if len(node.args.args) > MOST_TAKEN or node.end_lineno - node.lineno >= MOST_LINES
    }
    assert found <= NOT_YET
