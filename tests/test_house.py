"""The house: who may import whom, what is written once, how functions and words look."""

from __future__ import annotations

import ast
import inspect
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import isocodec

HOME = Path(inspect.getfile(isocodec)).parent
FLOORS = (
    "errors", "limits", "extras", "kernel", "field", "entropy", "format", "storage", "grid", "tin", "mesh", "drawing",
    "search", "io", "stream", "tiles", "api", "isocodec", "cli", "__main__",
)
"""Rooms from the ground up: each imports from those below it only. ``isocodec`` is the root itself."""
LOOSE = {"__init__", "__main__", "errors", "limits", "extras"}
"""Modules that lie at the root."""
KERNELS = {"kernel", "inner", "inlined"}
MODULES = {
    ".".join(("isocodec", *path.relative_to(HOME).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(HOME.rglob("*.py")) if path.parent.name != "built"
}
MOST_TAKEN, MOST_LINES = 8, 80
"""Parameters and lines of a compiled function at most; a record is one parameter."""
NOT_YET = {
    "reduction._parents", "distance._exceed", "distance._nearest", "distortion._clamped_simplex_at",
    "distortion._crossing", "distortion._implied", "distortion.too_far", "topology.safe",
}
"""Functions of ``search`` that are longer or take more."""
GEOMETRY = ("vertex", "simplex", "gate", "diamond", "dimension", "middle")
"""What entropy coding knows nothing of."""
MOST_NAMES = 20


def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(name: str) -> Iterator[str]:
    """Modules that a module imports: at its head, within functions, for type checkers, and by name."""
    path = MODULES[name]
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            base = node.module or ""
            if node.level:
                base = ".".join([*parts[: len(parts) - node.level + 1], *([base] if base else [])])
            for alias in node.names:
                yield f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) == "import_module":
            first = node.args[0]
            if isinstance(first, ast.Constant):
                yield str(first.value)


@cache
def arrows() -> dict[str, set[str]]:
    """What each module imports of the package."""
    out = {name: {one for one in imports(name) if one in MODULES and one != name} for name in MODULES}
    # the root loads what it exports by name
    out["isocodec"] |= {f"isocodec.{home}" for home in isocodec._HOME.values()}
    return out


def room(name: str) -> str:
    return (name.split(".")[1:] or ["isocodec"])[0]


def kernels(path: Path) -> Iterator[ast.FunctionDef]:
    """Functions of a module that are compiled."""
    for node in tree(path).body:
        decorators = node.decorator_list if isinstance(node, ast.FunctionDef) else []
        if any(isinstance(each, ast.Name) and each.id in KERNELS for each in decorators):
            yield node


def mentions(pattern: str, folder: Path = HOME) -> set[str]:
    """Modules below a folder whose code has a pattern."""
    return {
        path.relative_to(HOME).as_posix() for path in folder.rglob("*.py")
        if re.search(pattern, path.read_text(encoding="utf-8"))
    }


def test_every_module_is_on_a_floor():
    assert {room(name) for name in MODULES} == set(FLOORS)
    assert {path.stem for path in HOME.glob("*.py")} == LOOSE


def test_imports_go_down():
    up = [
        f"{name} -> {other}" for name, others in arrows().items() for other in others
        if FLOORS.index(room(other)) > FLOORS.index(room(name))
    ]
    assert up == []


def test_no_circles():
    """Nor within a room: what can be taken away because it imports nothing that is left, is; nothing must be left."""
    left = {name: set(others) for name, others in arrows().items()}
    while done := [name for name, others in left.items() if not others & left.keys()]:
        for name in done:
            del left[name]
    assert sorted(left) == []


def test_kinds_of_domains_do_not_know_one_another():
    """But a mesh may be the Delaunay triangulation of points."""
    kinds = {"grid", "tin", "mesh"}
    other = [
        f"{name} -> {one}" for name, others in arrows().items() if room(name) in kinds
        for one in others if room(one) in kinds - {room(name)} and (room(name), room(one)) != ("mesh", "tin")
    ]
    assert other == []


def test_envelopes_and_runs_are_read_in_one_place():
    assert mentions(r"\bread_envelope\(") == {"format/chunks.py", "stream/session.py"}
    assert mentions("bytes left over in a run") == {"entropy/run.py"}


def suffixes(path: Path) -> set[str]:
    """Suffixes of formats among the texts of a module's code."""
    strings = {node.value for node in ast.walk(tree(path)) if isinstance(node, ast.Constant) and
               isinstance(node.value, str)}
    return {text for text in strings if re.fullmatch(r"\.(?![0-9]+g)[a-z0-9]{2,7}(\.gz)?", text)}


@pytest.mark.parametrize("side", ["readers", "writers"])
def test_a_suffix_stands_in_one_module(side: str):
    homes = defaultdict(set)
    for path in (HOME / "io" / side).glob("*.py"):
        for suffix in suffixes(path):
            homes[suffix].add(path.name)
    assert {suffix: names for suffix, names in homes.items() if len(names) > 1} == {}


def test_the_command_line_knows_the_api_alone():
    allowed = {"api", "errors", "limits", "cli"}
    found = {name: {room(one) for one in others} - allowed for name, others in arrows().items() if room(name) == "cli"}
    assert {name: rooms for name, rooms in found.items() if rooms} == {}


def test_names_are_used_once():
    stems = Counter(path.stem for path in MODULES.values() if path.stem not in ("__init__", "__main__", "models"))
    assert [stem for stem, count in stems.items() if count > 1] == []
    classes = Counter(
        node.name for path in MODULES.values() for node in tree(path).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in classes.items() if count > 1] == []


def test_few_names_are_public():
    assert len(isocodec.__all__) <= MOST_NAMES and sorted(isocodec.__all__) == isocodec.__all__
    assert set(isocodec.__all__) == set(isocodec._HOME)
    taken = inspect.signature(isocodec.encode).parameters
    assert len(taken) <= 10


def test_the_mesh_takes_a_grid():
    """Not the coder, nor the state of a tube."""
    for path in (HOME / "grid" / "lattice").glob("*.py"):
        taken = {argument.arg for found in kernels(path) for argument in found.args.args}
        assert not taken & {"st", "cd", "state", "coder"}, path.name


def test_entropy_coding_knows_no_geometry():
    for path in (HOME / "entropy").glob("*.py"):
        text = path.read_text(encoding="utf-8").lower()
        assert not [word for word in GEOMETRY if word in text], path.name


def test_modules_say_what_they_are():
    assert [name for name, path in MODULES.items() if not ast.get_docstring(tree(path))] == []


def test_compiled_functions_are_short_and_take_few():
    found = {
        f"{path.stem}.{node.name}"
        for path in MODULES.values()
        for node in kernels(path)
        if len(node.args.args) > MOST_TAKEN or node.end_lineno - node.lineno >= MOST_LINES
    }
    assert found <= NOT_YET
