"""The library of kernels: what the source says of it, what may be wrong with it, and what runs in its place."""

from __future__ import annotations

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS
from home import ROOT
from isocodec.errors import KernelError
from isocodec.grid.tube.ranks import enter_numbers_at
from isocodec.kernel import EXECUTION, Execution
from isocodec.kernel.call import Kernel
from isocodec.kernel.execution import SETTING
from isocodec.kernel.sources import needed
from isocodec.kernel.types import Signature
from tables import heavy

sys.path.insert(0, str(ROOT / "tools" / "kernels"))

import front

IN_LIBRARY = EXECUTION in (Execution.LIBRARY, Execution.CHECKED)


# --- what the source says -------------------------------------------------------------------------------------------


def test_every_kernel_in_the_source_is_found():
    """By the build, which reads the source, as by Python."""
    lines = sum(
        len(re.findall(r"^ *@kernel\b", path.read_text(), re.M)) for path in (ROOT / "codec").rglob("*.py")
    )
    assert len(front.kernels()) == lines > 40


def test_kernels_have_signatures_and_entries():
    """Of the types that there are for every argument and for the result; the library has it as the source states it."""
    for found in front.kernels():
        check_kernel(found)


def check_kernel(found):
    kernel = getattr(import_module(found.module), found.name)
    function = kernel.function if isinstance(kernel, Kernel) else kernel
    signature = Signature.of(function)
    assert [name for name, _ in signature.arguments] == list(inspect.signature(function).parameters)
    if IN_LIBRARY:
        from isocodec.kernel.library import library, symbol

        assert symbol(kernel.name) == found.symbol
        assert library().note.signatures[found.symbol] == str(signature)
        assert kernel.entry


@pytest.mark.skipif(not IN_LIBRARY, reason="there is none")
def test_the_library_has_no_other_entries():
    from isocodec.kernel.library import library

    assert library().note.signatures.keys() == {found.symbol for found in front.kernels()}


@pytest.mark.skipif(not IN_LIBRARY, reason="no kernel is called there")
def test_a_real_kernel_refuses_what_does_not_fit():
    with pytest.raises(KernelError, match=r"tube\.ranks\.enter_numbers_at, argument numbers: tuple instead of Ranks"):
        enter_numbers_at((1, 2), np.zeros((1, 3), np.int64), np.zeros(1, np.int64))


# --- executions -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages, to be damaged."""
    home = tmp_path_factory.mktemp("copied")
    for source in ("codec/isocodec", "spec/isospec", "conformance/isoconform"):
        shutil.copytree(
            ROOT / source, home / Path(source).name, ignore=shutil.ignore_patterns("__pycache__", "checked")
        )
    np.save(home / "hills.npy", HILLS)
    return home


@pytest.fixture
def built(copied: Path) -> Iterator[Path]:
    """The folder of the copy's library, which is made whole again, as is a source."""
    folder, source = copied / "isocodec" / "kernel" / "built", copied / "isocodec" / "grid" / "lattice" / "store.py"
    before = {path: path.read_bytes() for path in (*folder.iterdir(), source)}
    yield folder
    for path, content in before.items():
        path.write_bytes(content)


def in_copy(home: Path, *words: str, execution: str = "", without: str = "") -> subprocess.CompletedProcess[str]:
    """A process that uses the copy; if need be without a library of Python's."""
    program = (
        f"import sys; sys.argv[0] = 'x'; sys.modules.update(dict.fromkeys({without.split()!r}))\n"
        f"from {words[0]}.__main__ import main; sys.exit(main())"
    )
    environment = {**os.environ, SETTING: execution, "PYTHONPATH": str(home), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-c", program, *words[1:]], env=environment, cwd=home, capture_output=True, text=True,
    )


ENCODE = ("isocodec", "encode", "hills.npy", "-o", "out.iso", "--isovalue", "80.5")


def refused(done: subprocess.CompletedProcess[str], program: str = "isocodec") -> str:
    """The one line that is said."""
    assert (done.returncode, done.stdout) == (8, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{program}: ")
    return line


def changed_note(**changes: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        note = json.loads((folder / "kernels.json").read_text())
        (folder / "kernels.json").write_text(json.dumps(note | changes))

    return change


def signatures(change: Callable[[dict[str, str]], object]) -> Callable[[Path], None]:
    def changed(folder: Path) -> None:
        found = json.loads((folder / "kernels.json").read_text())["signatures"]
        change(found)
        changed_note(signatures=found)(folder)

    return changed


def library_in(folder: Path) -> Path:
    return folder / json.loads((folder / "kernels.json").read_text())["file"]


def flipped(folder: Path) -> None:
    path = library_in(folder)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.unlink()
    path.write_bytes(data)


def another_source(folder: Path) -> None:
    with (folder.parents[1] / "grid" / "lattice" / "store.py").open("a") as file:
        file.write("\n# changed\n")


FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "gone": (lambda folder: library_in(folder).unlink(), "No such file"),
    "a bit changed": (flipped, "damaged, its SHA-256 is"),
    "a note cut off": (lambda folder: os.truncate(folder / "kernels.json", 99), "kernels.json: "),
    "other sources": (another_source, "sources have changed since it was built: python tools/kernels"),
    "without a kernel": (
        signatures(lambda found: found.pop("iso_passes_base_base")), "kernel passes.base.base: not in the library",
    ),
    "with another kernel": (
        signatures(lambda found: found.update(iso_passes_base_base="() -> int64")),
        "kernel passes.base.base: compiled as () -> int64, the source declares (st: State, ",
    ),
}


USUAL = ("a bit changed", "a note cut off", "other sources", "with another kernel")


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="there is no library")
@pytest.mark.parametrize("fault", [*USUAL, *heavy(*sorted({*FAULTS} - {*USUAL}))])
def test_a_library_that_is_not_what_it_should_be(copied: Path, built: Path, fault: str) -> None:
    """One line and an exit code of its own, and no file is blamed."""
    damage, expected = FAULTS[fault]
    damage(built)
    line = refused(in_copy(copied, *ENCODE, without="numba"))
    assert expected in line and "hills" not in line and "out.iso" not in line
    assert not (copied / "out.iso").exists()


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="there is no library")
def test_a_library_needs_no_compiler(copied: Path, built: Path) -> None:
    """And is loaded from the package."""
    done = in_copy(copied, *ENCODE, without="numba llvmlite")
    assert (done.returncode, done.stderr) == (0, "")
    assert (copied / "out.iso").read_bytes() == isocodec.encode(HILLS, 80.5)
    (copied / "out.iso").unlink()


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="there is no library")
def test_without_a_library(copied: Path, built: Path) -> None:
    """Where nothing is asked for, something else takes its place and says so; where it is asked for, it is missed."""
    shutil.rmtree(built)
    built.mkdir()
    done = in_copy(copied, "isocodec", "--version", without="numba")
    assert done.returncode == 0 and "(kernels: python)" in done.stdout and "plain Python" in done.stderr
    done = in_copy(copied, "isocodec", "--version")
    assert done.returncode == 0 and "(kernels: numba)" in done.stdout and "numba compiles them" in done.stderr
    for execution in ("library", "checked"):
        assert "kernels.json" in refused(in_copy(copied, *ENCODE, execution=execution))


@pytest.mark.parametrize("words", [("isoconform", "run"), *heavy(ENCODE)])
def test_executions_that_there_are_not(copied: Path, words: tuple[str, ...]) -> None:
    line = refused(in_copy(copied, *words, execution="nonsense"), words[0])
    assert "ISOCODEC_KERNELS=nonsense: choose one of library, " in line
    line = refused(in_copy(copied, *words, execution="numba", without="numba"), words[0])
    assert line.endswith("numba is not installed: pip install numba")


COMPILED = """
import numpy as np
from isocodec.errors import KernelError
from isocodec.kernel import inner, kernel
from isocodec.kernel.types import FloatVector, IntVector

@inner
def at(values, i):
    return values[i]

@kernel
def right(values: IntVector, i: int) -> int:
    return at(values, i)

@kernel
def wrong(values: FloatVector, i: int) -> int:
    return at(values, i)

print(right(np.arange(9), 7), at([1], 0))
for call in (lambda: right(np.arange(9.0), 7), lambda: wrong(np.arange(9.0), 7), lambda: right(np.arange(9), 9)):
    try:
        call()
    except (KernelError, IndexError) as error:
        print(error)
"""


@pytest.mark.heavy  # which compiles
def test_numba_keeps_to_the_annotations() -> None:
    """Nothing else is compiled; what is returned is what is stated; indices are checked if that is asked for."""
    environment = {
        **os.environ, SETTING: "numba", "NUMBA_BOUNDSCHECK": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    done = subprocess.run([sys.executable, "-c", COMPILED], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "7 1",
        "kernel __main__.right, argument values: float64, 1d instead of int64[1d]",
        "kernel __main__.wrong returns float64, but is annotated with int64",
        "kernel __main__.right: an index out of bounds, or another fault",
    ]


@pytest.mark.skipif(not IN_LIBRARY, reason="there is none")
def test_sources_are_all_that_kernels_import():
    """Modules of functions and of packages: a change in any of them is noticed."""
    from isocodec.kernel.library import _homes, note

    found = needed(_homes())
    assert "isocodec/kernel/__init__.py" in found and "isospec/tables.py" in found
    sources = note().sources
    assert sources is None or sources["files"] == found
