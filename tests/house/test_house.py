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
    "errors", "limits", "verbs", "extras", "kernel", "field", "entropy", "format", "storage", "grid", "tin",
    "mesh", "plotting", "drawing", "search", "io", "stream", "tiles", "api", "isocodec", "plugins", "cli",
    "__main__",
)
"""Rooms from the ground up: each imports from those below it only. ``isocodec`` is the root itself."""
LOOSE = {"__init__", "__main__", "errors", "limits", "verbs", "extras"}
"""Modules that lie at the root."""
MODULES = {
    ".".join(("isocodec", *path.relative_to(HOME).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(HOME.rglob("*.py")) if path.parent.name != "built"
}
AVOIDED = re.compile(
    r"\b(tell|tells|told|say|says|said|stands?|needed (is|are)|means? nothing|contradict\w*|of its own|"
    r"there is none|there are none|there are not)\b", re.IGNORECASE,
)
"""Words that messages and docstrings do not use."""
OPENERS = re.compile(r"(What|Where|How|Which|By|Of|Likewise|The same|That|As)\b")
"""Words that no docstring opens with: it opens with a verb or a noun."""
NAMES = re.compile(r"``[^`]*``|`[^`]*`|^ *\w+(, \w+)* : [^\n]*$", re.MULTILINE)
"""Names in docstrings: code, and heads of parameters with their types."""
MOST_NAMES = 20


@cache
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


WRITING = [HOME / "io" / f"{name}.py" for name in ("formats", "map_tables", "surfaces", "masks")]


@pytest.mark.parametrize("paths", [[*(HOME / "io" / "readers").glob("*.py")], WRITING], ids=["read", "written"])
def test_a_suffix_stands_in_one_module(paths: list[Path]):
    homes = defaultdict(set)
    for path in paths:
        for suffix in suffixes(path):
            homes[suffix].add(path.name)
    assert {suffix: names for suffix, names in homes.items() if len(names) > 1} == {}


def test_the_command_line_knows_the_api_alone():
    # of the root, the version
    allowed = {"api", "errors", "limits", "verbs", "isocodec", "cli"}
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
    assert len(taken) <= 11


def test_modules_say_what_they_are():
    assert [name for name, path in MODULES.items() if not ast.get_docstring(tree(path))] == []


def texts(path: Path) -> tuple[list[ast.Constant], list[ast.Constant]]:
    """Docstrings of a module, those of attributes included, and all its other strings."""
    nodes = list(ast.walk(tree(path)))
    described = {
        id(each.value) for node in nodes if isinstance(getattr(node, "body", None), list)
        for each in node.body if isinstance(each, ast.Expr)
    }
    strings = [node for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    docstrings = [node for node in strings if id(node) in described]
    return docstrings, [node for node in strings if id(node) not in described]


def test_messages_and_docstrings_use_plain_words():
    found = []
    for name, path in MODULES.items():
        docstrings, others = texts(path)
        found += [f"{name}:{node.lineno}" for node in docstrings if AVOIDED.search(NAMES.sub("", node.value))]
        found += [f"{name}:{node.lineno}" for node in others if AVOIDED.search(node.value)]
    assert found == []


def test_docstrings_open_with_a_verb_or_a_noun():
    found = [
        f"{name}:{node.lineno}" for name, path in MODULES.items()
        for node in texts(path)[0] if OPENERS.match(node.value)
    ]
    assert found == []
