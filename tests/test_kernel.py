"""Kernels as they are called: types and how values lie in memory, the library and what may be wrong with it."""

from __future__ import annotations

import ctypes
import inspect
import json
import os
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

import isocodec
from commands import HILLS, ok
from isocodec import KernelError
from isocodec.kernel import EXECUTION, Execution, record
from isocodec.kernel.call import FINE, Kernel
from isocodec.kernel.execution import SETTING
from isocodec.kernel.types import (
    BOOL,
    FLOAT,
    INT,
    Array,
    FloatMatrix,
    IntVector,
    Member,
    Record,
    Signature,
    UInt8Vector,
    kind_of,
)  # fmt: skip
from isocodec.mesh.store import new_store
from isocodec.passes.carriers import entries

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools" / "kernels"))

import front

ROOT = front.ROOT
IN_LIBRARY = EXECUTION in (Execution.LIBRARY, Execution.CHECKED)


@record
class Inner(NamedTuple):
    flags: UInt8Vector


@record
class Outer(NamedTuple):
    numbers: IntVector
    inner: Inner
    places: FloatMatrix


def slots(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}q", *values)


# --- values in slots ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (INT, 258, b"\x02\x01" + bytes(6)), (INT, -2, b"\xfe" + b"\xff" * 7), (INT, np.uint8(7), slots(7)),
        (INT, np.int64(-(1 << 63)), bytes(7) + b"\x80"), (FLOAT, -2.0, bytes(7) + b"\xc0"),
        (FLOAT, np.float32(0.5), bytes(6) + b"\xe0\x3f"), (FLOAT, np.nan, bytes(6) + b"\xf8\x7f"),
        (BOOL, True, slots(1)), (BOOL, np.False_, slots(0)),
    ],
)  # fmt: skip
def test_numbers(kind, value, expected):
    assert kind.pack(value) == expected


@pytest.mark.parametrize(
    ("kind", "value"),
    [(INT, 1.0), (INT, True), (INT, np.True_), (INT, None), (INT, "1"), (INT, np.array(1)), (FLOAT, 1), (FLOAT, True),
     (FLOAT, np.int64(1)), (BOOL, 1), (BOOL, 0.0), (BOOL, None)],
)  # fmt: skip
def test_what_is_no_such_number(kind, value):
    with pytest.raises(TypeError, match=f"{type(value).__name__} instead of {kind}"):
        kind.pack(value)


@pytest.mark.parametrize("value", [1 << 63, -(1 << 63) - 1, np.uint64((1 << 64) - 1)])
def test_integers_of_more_than_64_bits(value):
    with pytest.raises(OverflowError):
        INT.pack(value)


def test_arrays():
    """Address, size, shape and strides."""
    values = np.arange(6, dtype=np.int16).reshape(2, 3)
    assert Array("int16", 2).pack(values) == slots(values.ctypes.data, 6, 2, 3, 6, 2)
    assert Array("int16", 1).pack(values[1]) == slots(values.ctypes.data + 6, 3, 3, 2)
    assert Array("uint8", 1).pack(np.frombuffer(b"abc", np.uint8))[8:] == slots(3, 3, 1)


def test_arrays_that_are_not_to_be_written():
    """Kernels that only read take them, from where they are."""
    values = np.arange(4.0)
    values.flags.writeable = False
    assert Array("float64", 1).pack(values) == slots(values.ctypes.data, 4, 4, 8)


def test_empty_arrays():
    for shape in ((0,), (0, 4), (3, 0)):
        empty = np.zeros(shape, np.int32)
        assert Array("int32", len(shape)).pack(empty) == slots(0, 0, *shape, *empty.strides)


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (np.zeros(3, np.int32), "int32, 1d"), (np.zeros((3, 1), np.int64), "int64, 2d"), ([1, 2], "list"),
        (np.zeros(3, ">i8"), ">i8, 1d"), (np.zeros(6, np.int64)[::2], "an array with gaps"),
        (np.zeros(3, np.int64)[::-1], "an array with gaps"), (None, "NoneType"), (np.int64(3), "int64"),
        (np.ma.zeros(3, np.int64), "int64, 1d"),
    ],
)  # fmt: skip
def test_what_is_no_such_array(value, found):
    with pytest.raises(TypeError, match=f"{found} instead of int64\\[1d\\]"):
        Array("int64", 1).pack(value)


def outer() -> Outer:
    return Outer(np.arange(3), Inner(np.arange(2, dtype=np.uint8)), np.zeros((2, 2)))


def test_records():
    """What their members take, one after the other."""
    kind, value = kind_of(Outer), outer()
    assert isinstance(kind, Record) and kind.slots == 4 + 4 + 6 and str(kind) == "Outer"
    numbers, (flags,), places = value
    assert kind.pack(value) == (
        slots(numbers.ctypes.data, 3, 3, 8) + slots(flags.ctypes.data, 2, 2, 1)
        + slots(places.ctypes.data, 4, 2, 2, 16, 8)
    )  # fmt: skip


def test_records_with_another_type_of_a_member():
    kind = kind_of(Annotated[Inner, Member("flags", IntVector)])
    assert str(kind) == "Inner<flags: int64[1d]>" != str(kind_of(Inner))
    value = Inner(np.arange(2))  # type: ignore[arg-type]
    assert kind.pack(value) == slots(value.flags.ctypes.data, 2, 2, 8)
    with pytest.raises(TypeError, match="flags: int64, 1d instead of uint8"):
        kind_of(Inner).pack(value)


@pytest.mark.parametrize(
    ("value", "match"),
    [
        ((1, 2), "tuple instead of Outer"), (None, "NoneType instead of Outer"),
        (outer()._replace(numbers=[1]), "numbers: list"),
        (outer()._replace(inner=Inner(np.zeros(2))), "inner: flags: float64, 1d"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_what_is_no_such_record(value, match):
    with pytest.raises(TypeError, match=match):
        kind_of(Outer).pack(value)


def test_changed_records_are_noted_anew():
    """Whichever member changes, before or after the first call; the one that it was made from stays."""
    kind = kind_of(Outer)

    def plain(value: Outer) -> bytes:
        return kind.pack(Outer(value.numbers, Inner(value.inner.flags), value.places))

    value = outer()
    early = value._replace(numbers=np.arange(7))
    first = kind.pack(value)
    changed = [
        value._replace(numbers=np.arange(5)), value._replace(inner=Inner(np.zeros(9, np.uint8))),
        value._replace(places=np.zeros((3, 1)), numbers=np.arange(6)), value._replace(), early,
    ]  # fmt: skip
    again = [each._replace(places=np.ones((1, 1))) for each in changed]
    for each in (*changed, *again):
        assert kind.pack(each) == plain(each) == kind.pack(each)
    assert len({kind.pack(each) for each in (value, *changed)}) == len(changed)  # one is the same
    assert kind.pack(value) == first == plain(value)


def test_a_kernel_reads_the_array_that_took_the_place_of_another():
    encoder = isocodec.Encoder(HILLS, 80.5, signs_only=True)
    assert b"".join(encoder)
    state = encoder._strands[0].tube.state
    position = state.vertex[:5, :3].astype(np.int64)
    out = np.zeros(5, np.int64)
    for known, expected in ((state.known, [*range(5)]), (new_store(2), [-1] * 5), (state.known, [*range(5)])):
        entries(state._replace(known=known), position, out)
        assert out.tolist() == expected
    entries(state, position, out)
    assert out.tolist() == [*range(5)]


# --- calls ----------------------------------------------------------------------------------------------------------


def returning(function: Callable[..., Any], content: bytes, status: int = FINE[0]) -> Kernel:
    """A kernel whose entry writes some bytes where the results go."""

    def entry(results: Any, fault: Any, frame: bytes) -> int:
        ctypes.memmove(results, content, len(content))
        return status

    return Kernel(function, lambda _: entry)


def whole() -> int: ...
def fraction() -> float: ...
def truth() -> bool: ...
def nothing() -> None: ...
def several() -> tuple[int, int, int]: ...


@pytest.mark.parametrize(
    ("function", "content", "expected"),
    [
        (whole, slots(-3), -3), (fraction, struct.pack("<d", 0.1), 0.1), (truth, slots(1), True),
        # of a truth value one bit is stated
        (truth, slots(0x7E), False), (nothing, slots(5), None), (several, slots(1, -2, 3, 4), (1, -2, 3)),
    ],
)  # fmt: skip
def test_results(function, content, expected):
    found = returning(function, content)()
    assert found == expected and type(found) is type(expected)


def test_a_status_of_a_fault_is_an_index_error():
    for status in (1, -1, 7):
        with pytest.raises(IndexError, match=r"kernel .*nothing: an index out of bounds"):
            returning(nothing, b"", status)()
    assert returning(nothing, b"", FINE[1])() is None


def weighed(values: IntVector, weight: float, turned: bool) -> float: ...


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((np.zeros(2), 1.0, True), r"weighed, argument values: float64, 1d instead of int64\[1d\]"),
        ((np.zeros(4, np.int64)[::2], 1.0, True), "weighed, argument values: an array with gaps"),
        ((np.zeros(2, np.int64), 1, True), "weighed, argument weight: int instead of float64"),
        ((np.zeros(2, np.int64), 1.0, 1), "weighed, argument turned: int instead of bool"),
        ((np.zeros(2, np.int64), 1.0), r"weighed\(values: int64\[1d\], .*\) -> float64 called with 2 arguments"),
        ((np.zeros(2, np.int64), 1.0, True, 0), "called with 4 arguments"),
    ],
)  # fmt: skip
def test_arguments_of_other_types(arguments, match):
    """Never is anything else compiled, or run as plain Python instead."""
    with pytest.raises(KernelError, match=match) as caught:
        returning(weighed, slots(0))(*arguments)
    assert caught.value.code == "kernel-signature" and caught.value.exit_code == 8


@pytest.mark.skipif(not IN_LIBRARY, reason="no kernel is called there")
def test_a_real_kernel_refuses_what_does_not_fit():
    with pytest.raises(KernelError, match=r"passes\.carriers\.entries, argument st: tuple instead of State"):
        entries((1, 2), np.zeros((1, 3), np.int64), np.zeros(1, np.int64))


def test_signatures():
    assert str(Signature.of(weighed)) == "(values: int64[1d], weight: float64, turned: bool) -> float64"
    assert str(Signature.of(several)) == "() -> (int64, int64, int64)"

    def wrong(values: list) -> None: ...

    with pytest.raises(KernelError, match="no type of a kernel"):
        Signature.of(wrong)


# --- what the source says -------------------------------------------------------------------------------------------


def test_every_kernel_in_the_source_is_found():
    """By the build, which reads the source, as by Python."""
    lines = sum(
        len(re.findall(r"^ *@kernel\b", path.read_text(), re.M)) for path in (ROOT / "codec").rglob("*.py")
    )  # fmt: skip
    assert len(front.kernels()) == lines > 40


@pytest.mark.parametrize("found", front.kernels(), ids=lambda found: f"{found.module}.{found.name}")
def test_kernels_have_signatures_and_entries(found):
    """Of the types that there are for every argument and for the result; the library has it as the source states it."""
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


# --- executions -----------------------------------------------------------------------------------------------------


def test_the_execution_is_told():
    assert isocodec.kernels().execution == EXECUTION.value == (os.environ.get(SETTING) or "library")
    assert f"(kernels: {EXECUTION.value}" in ok("--version")


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
    folder, source = copied / "isocodec" / "kernel" / "built", copied / "isocodec" / "mesh" / "store.py"
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
    )  # fmt: skip


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


def no_library_at_all(folder: Path) -> None:
    import hashlib

    path = library_in(folder)
    path.unlink()
    path.write_bytes(b"nothing")
    changed_note(sha256=hashlib.sha256(b"nothing").hexdigest())(folder)


def another_source(folder: Path) -> None:
    with (folder.parents[1] / "mesh" / "store.py").open("a") as file:
        file.write("\n# changed\n")


FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "gone": (lambda folder: library_in(folder).unlink(), "No such file"),
    "a bit changed": (flipped, "damaged, its SHA-256 is"),
    "cut off": (lambda folder: os.truncate(library_in(folder), 1000), "damaged, its SHA-256 is"),
    "another digest": (changed_note(sha256="0" * 64), "instead of 000000000000"),
    "not a library": (no_library_at_all, "kernels"),
    "a note cut off": (lambda folder: os.truncate(folder / "kernels.json", 99), "kernels.json: "),
    "a note of something else": (lambda folder: (folder / "kernels.json").write_text("{}"), "kernels.json: "),
    "other sources": (another_source, "sources have changed since it was built: python tools/kernels"),
    "without a kernel": (
        signatures(lambda found: found.pop("iso_passes_base_base")), "kernel passes.base.base: not in the library",
    ),
    "with another kernel": (
        signatures(lambda found: found.update(iso_passes_base_base="() -> int64")),
        "kernel passes.base.base: compiled as () -> int64, its source says (st: State, ",
    ),
}  # fmt: skip


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="there is no library")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_library_that_is_not_what_it_should_be(copied: Path, built: Path, fault: str) -> None:
    """One line and an exit code of its own, and no file is blamed."""
    damage, expected = FAULTS[fault]
    damage(built)
    line = refused(in_copy(copied, *ENCODE, without="numba"))
    assert expected in line and "hills" not in line and "out.iso" not in line
    assert not (copied / "out.iso").exists()


@pytest.mark.skipif(EXECUTION is not Execution.LIBRARY, reason="there is no library")
def test_isoconform_says_it_once(copied: Path, built: Path) -> None:
    flipped(built)
    line = refused(in_copy(copied, "isoconform", "fuzz", "--files", "3"), "isoconform")
    assert "damaged" in line


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


@pytest.mark.parametrize("words", [ENCODE, ("isocodec", "--version"), ("isoconform", "run")], ids=" ".join)
def test_executions_that_there_are_not(copied: Path, words: tuple[str, ...]) -> None:
    line = refused(in_copy(copied, *words, execution="nonsense"), words[0])
    assert "ISOCODEC_KERNELS=nonsense: choose one of library, " in line
    line = refused(in_copy(copied, *words, execution="numba", without="numba"), words[0])
    assert line.endswith("numba is not installed: pip install numba")


COMPILED = """
import numpy as np
from isocodec import KernelError
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


def test_numba_keeps_to_the_annotations() -> None:
    """Nothing else is compiled; what is returned is what is stated; indices are checked if that is asked for."""
    environment = {
        **os.environ, SETTING: "numba", "NUMBA_BOUNDSCHECK": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }  # fmt: skip
    done = subprocess.run([sys.executable, "-c", COMPILED], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "7 1",
        "kernel __main__.right, argument values: float64, 1d instead of int64[1d]",
        "kernel __main__.wrong returns float64, its annotation says int64",
        "kernel __main__.right: an index out of bounds, or another fault",
    ]
