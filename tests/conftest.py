"""Set-up of the whole suite: how hard it tries, tests that take long, and files for the command line."""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from brute import HEAVY, INTERPRETED
from commands import BALL, HILLS
from encoded import encoded
from tables import covering

# Here alone is said how hypothesis chooses: the same examples each time where CI is set (.ci/run) or kernels are
# interpreted, others each time elsewhere; many of them only where tests are heavy.
EXAMPLES = 100 if HEAVY else 20
settings.register_profile("default", deadline=None, max_examples=EXAMPLES)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True, max_examples=EXAMPLES)
settings.register_profile("interpreted", deadline=None, derandomize=True, database=None, max_examples=3)
LONG = 8.0
"""Seconds above which a test is named at the end. It should be heavy from 2 on, on a quiet machine; a busy one, or the
first test of a process, which loads libraries, takes several times as long, and nobody shall be told so in vain."""
if INTERPRETED:
    settings.load_profile("interpreted")
else:
    settings.load_profile("ci" if os.environ.get("CI") else "default")


_long: dict[str, float] = {}


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even read modules that are heavy or of programs as a whole, unless such tests are asked for."""
    left_out = {part.removeprefix("not ") for part in config.option.markexpr.split(" and ") if part.startswith("not ")}
    if collection_path.suffix != ".py" or not left_out:
        return None
    mark = re.search(r"^pytestmark = \[?\s*pytest\.mark\.(\w+)", collection_path.read_text(), re.M)
    return True if mark and mark[1] in left_out else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the full product of tables that are marked ``cover`` to heavy runs."""
    tables: dict[tuple[object, int], list[pytest.Function]] = defaultdict(list)
    for item in items:
        if isinstance(item, pytest.Function) and (mark := item.get_closest_marker("cover")):
            tables[(item.function, *mark.args)].append(item)
    for (_, strength), table in tables.items():
        kept = covering([_columns(item.callspec.params.values()) for item in table], strength)
        for number in {*range(len(table))}.difference(kept):
            table[number].add_marker("heavy")


def _columns(values: Iterable[object]) -> list[object]:
    """What tells values of a row from others: of arrays and the like, which object it is; ``a, b`` are two values."""
    found: list[object] = []
    for value in values:
        if isinstance(value, str):
            found += value.split(", ")
        else:
            found.append(repr(value) if isinstance(value, int | float | None) else id(value))
    return found


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if not {"heavy", "apps"}.intersection(report.keywords) and not INTERPRETED:
        _long[report.nodeid] = _long.get(report.nodeid, 0.0) + report.duration


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that make everybody wait."""
    for name, seconds in _long.items():
        if seconds > LONG:
            terminalreporter.write_line(f"{name} takes {seconds:.0f} s: split it, or mark it heavy", yellow=True)


@pytest.fixture(scope="module")
def curve_data() -> bytes:
    return encoded(HILLS, 80.5, precision="exact")


@pytest.fixture(scope="module")
def surface_data() -> bytes:
    return encoded(BALL, 55.5, precision="exact")


@pytest.fixture
def curve(tmp_path: Path, curve_data: bytes) -> Path:
    path = tmp_path / "curve.iso"
    path.write_bytes(curve_data)
    return path


@pytest.fixture
def surface(tmp_path: Path, surface_data: bytes) -> Path:
    path = tmp_path / "surface.iso"
    path.write_bytes(surface_data)
    return path


@pytest.fixture
def hills(tmp_path: Path) -> Path:
    path = tmp_path / "hills.npy"
    np.save(path, HILLS)
    return path
