"""The first half of a build: LLVM code of every kernel, as numba makes it, before it is optimised for any processor.

The result is one module with a function for each kernel, named as in ``symbol``, which takes the addresses of its
results, of a fault and of its arguments' slots. Functions that several kernels call are in it once.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import importlib
import multiprocessing
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [ROOT / "codec", ROOT / "spec"]
PROCESSES = 2
"""That compile kernels in turn, on any machine: what numba makes of one depends on those that its process compiled
before, and builds are to be the same. More of them take no less time: each compiles anew what kernels share."""


class Found(NamedTuple):
    """A kernel in the source."""

    module: str
    name: str
    lines: int

    @property
    def symbol(self) -> str:
        """Its name in a library."""
        return symbol(".".join([*self.module.split(".")[-2:], self.name]))

    @property
    def path(self) -> Path:
        """The file that it stands in."""
        return SOURCES[0].joinpath(*self.module.split(".")).with_suffix(".py")


def symbol(name: str) -> str:
    """The name of a kernel's entry in a library."""
    return "iso_" + name.replace(".", "_")


def kernels() -> list[Found]:
    """All functions in the source that are decorated as kernels; those that take longest to compile first."""
    out = []
    for path in sorted((SOURCES[0] / "isocodec").rglob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef) and any(_is(d, "kernel") for d in node.decorator_list):
                module = ".".join(path.relative_to(SOURCES[0]).with_suffix("").parts)
                out.append(Found(module, node.name, node.end_lineno - node.lineno))
    return sorted(out, key=lambda found: (-found.lines, found.symbol))


def _is(decorator: ast.expr, name: str) -> bool:
    return isinstance(decorator, ast.Name) and decorator.id == name


def compiled(checked: bool, progress: Callable[[int, int], object]) -> tuple[bytes, dict[str, str]]:
    """The bitcode of all kernels, and the signature of each.

    Parameters
    ----------
    checked : bool
        Whether indices are checked.
    progress : callable
        Called with how many kernels are done, and of how many.
    """
    found = kernels()
    pieces, signatures = {}, {}
    settings = _environment(
        ISOCODEC_KERNELS="numba", NUMBA_BOUNDSCHECK=str(int(checked)), NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="",
        PYTHONHASHSEED="0",
    )
    with ExitStack() as stack:
        stack.enter_context(settings)
        spawn = multiprocessing.get_context("spawn")
        processes = [stack.enter_context(spawn.Pool(1, _prepare)) for _ in range(PROCESSES)]
        begun = [process.apply_async(_compile, (kernel,)) for kernel, process in zip(found, cycle(processes))]
        for done, one in enumerate(begun, 1):
            name, signature, code = one.get()
            signatures[name], pieces[name] = signature, code
            progress(done, len(found))
    return _linked(pieces[name] for name in sorted(pieces)), dict(sorted(signatures.items()))


class _environment:
    """Variables of the environment, for a while."""

    def __init__(self, **values: str) -> None:
        self._values = values

    def __enter__(self) -> None:
        self._before = {name: os.environ.get(name) for name in self._values}
        os.environ.update(self._values)

    def __exit__(self, *_: object) -> None:
        for name, value in self._before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _prepare() -> None:
    """In each process: numba makes code, but neither optimises nor loads it."""
    from numba.core import codegen

    gc.disable()  # a fifth of the time, for nothing
    sys.path[:0] = map(str, SOURCES)

    class Library(codegen.CPUCodeLibrary):
        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            self._finalized = True

        def _finalize_specific(self) -> None:
            pass

        def get_pointer_to_function(self, name: str) -> int:
            return 0

    codegen.JITCPUCodegen._library_class = Library
    codegen.JITCPUCodegen.set_env = lambda *_: None
    _promise_records()


def _promise_records() -> None:
    """Functions say of the addresses of records that there is something to read: it may be read ahead of its use."""
    from numba.core.callconv import CPUCallConv

    from isocodec.kernel.records import RecordType
    from isocodec.kernel.types import SLOT

    decorate = CPUCallConv.decorate_function

    def decorated(self, function, names, types, noalias=False):  # type: ignore[no-untyped-def]
        decorate(self, function, names, types, noalias)
        arguments = iter(self.get_arguments(function))
        for kind in types:
            for _ in self._get_arg_packer([kind])._be_args:
                argument = next(arguments)
                if isinstance(kind, RecordType):
                    for attribute in ("noalias", "captures(none)"):
                        argument.add_attribute(attribute)
                    argument.attributes.dereferenceable = SLOT * kind.record.slots
                    argument.attributes.align = SLOT

    CPUCallConv.decorate_function = decorated


def _compile(found: Found) -> tuple[str, str, bytes]:
    """A kernel's symbol, its signature, and its bitcode with all that it calls."""
    from isocodec.kernel.compiler import compiled

    kernel = getattr(importlib.import_module(found.module), found.name)
    try:
        result = compiled(kernel)
    except Exception as error:
        # one of the package would not come through to a process that has not loaded it, and nothing would end then
        raise RuntimeError(f"kernel {found.module}.{found.name}: {error}") from None
    module = result.library._final_module
    for function in module.functions:
        if function.name == result.fndesc.llvm_func_name:
            function.name = found.symbol
        elif not function.is_declaration:
            function.linkage = "linkonce_odr"
    _name_by_content(module)
    return found.symbol, str(kernel.signature), module.as_bitcode()


def _name_by_content(module) -> None:  # type: ignore[no-untyped-def]
    """Name the functions that kernels share by what they do.

    numba numbers names as a process goes on, and which kernels it compiles is left to chance: the same function would
    have several names, and, what is worse, two functions could have the same.
    """
    functions = {each.name: str(each) for each in module.functions if not each.is_declaration}
    noted = dict(re.findall(r"^(?:attributes )?([#!@]\S+) = (.*)", str(module), re.M))
    digests: dict[str, str] = {}

    def digest(name: str, callers: tuple[str, ...] = ()) -> str:
        if name in callers:
            if name != callers[-1]:
                raise RuntimeError(f"functions call one another in a circle: {', '.join(callers)}")
            return "itself"
        if name not in digests:
            text = _REFERENCE.sub(lambda found: meaning(found[0], (*callers, name)), functions[name])
            digests[name] = hashlib.sha256(text.encode()).hexdigest()[:32]
        return digests[name]

    def meaning(reference: str, callers: tuple[str, ...]) -> str:
        if reference[1:].strip('"') in functions:
            return digest(reference[1:].strip('"'), callers)
        said = noted.get(reference, reference)
        if reference.startswith("@") and said != reference:  # data, which may hold the addresses of other data
            return re.sub(_DATA, lambda found: meaning(found[0], callers), said)
        return re.sub(r"!\d+", "!", said)

    for name in functions:
        digest(name)
    for function in module.functions:
        if function.linkage == function.linkage.linkonce_odr:
            function.name = f"shared_{digests[function.name]}"


_DATA = r'@"[^"]+"|@[\w.$-]+'
_REFERENCE = re.compile(rf"{_DATA}|[#!]\d+")
"""In the text of a function: another one or data, attributes, metadata."""


def _linked(pieces: Iterable[bytes]) -> bytes:
    from llvmlite import binding

    def modules() -> Iterator[binding.ModuleRef]:
        yield from map(binding.parse_bitcode, pieces)

    rest = modules()
    whole = next(rest)
    for module in rest:
        whole.link_in(module)
    return whole.as_bitcode()
