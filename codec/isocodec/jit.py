"""The one way in which kernels are compiled."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, typeof
from numba.core.options import DefaultOptions

from .kept import SealedCache
from .unfinished import new_file_mode, replace_file

_HOME = Path(__file__).parent
_WITHOUT_KERNELS = ("cli", "io")


@cache
def sources() -> str:
    """Digest of all that compiled kernels depend on: the sources, and whether indices are checked."""
    digest = hashlib.sha256(os.environ.get("NUMBA_BOUNDSCHECK", "").encode())
    spec = find_spec("isospec")
    homes = [_HOME] + [Path(place) for place in spec.submodule_search_locations or ()] if spec else [_HOME]
    for home in homes:
        for path in sorted(home.rglob("*.py")):
            name = path.relative_to(home)
            if name.parts[0] not in _WITHOUT_KERNELS:
                text = path.read_bytes()
                digest.update(f"{name.as_posix()}\0{len(text)}\0".encode() + text)
    return digest.hexdigest()


@cache
def drop_stale_kernels(folder: Path, stamp: str) -> None:
    """Empty a folder of cached kernels unless it is noted there that they were compiled from the sources of ``stamp``.

    numba sees a change in a kernel's own file, but not in one that it imports; what would run then is an old kernel on
    new data.
    """
    note = folder / "sources.txt"
    with suppress(OSError):
        if note.is_file() and note.read_bytes() == stamp.encode():
            return
        for cached in folder.glob("*.nb[ic]*"):
            cached.unlink(missing_ok=True)  # another process may be at it, too
        folder.mkdir(parents=True, exist_ok=True)
        replace_file(note, stamp.encode(), new_file_mode())


_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
if hasattr(DefaultOptions, "_nrt"):
    # Kernels allocate nothing, so their arrays need no reference counts: these atomics cost ten times the work
    # itself. The option is numba's own for its device targets; without it kernels are slower, not different.
    _OPTIONS["_nrt"] = False


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator of every kernel: compiled on first use and cached on disk; plain Python with ``NUMBA_DISABLE_JIT=1``.

    Where neither the package's directory nor the user's can be written, kernels are compiled by every process.
    """
    try:
        made = njit(**_OPTIONS)(function)
    except RuntimeError:
        return njit(**(_OPTIONS | {"cache": False}))(function)
    if hasattr(made, "stats"):  # without NUMBA_DISABLE_JIT
        drop_stale_kernels(Path(made.stats.cache_path), sources())
        made._cache = SealedCache(function)
    return made


def compiled(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """A kernel for arguments of these types and no others, which it does not look at again.

    Looking at the types of a state, some fifty arrays, takes longer than a kernel on a small file.
    """
    if not hasattr(function, "compile"):  # with NUMBA_DISABLE_JIT
        return function
    key = function, _kinds(arguments)
    if key not in _compiled:
        _compiled[key] = function.compile(tuple(typeof(argument) for argument in arguments))
    return _compiled[key]


_compiled: dict[Any, Callable[..., Any]] = {}


def _kinds(argument: Any) -> Any:
    """What the compiler distinguishes of arrays, in tuples as they come, and of numbers."""
    if isinstance(argument, tuple):
        return tuple(map(_kinds, argument))
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    return type(argument)


_INNER = {"cache": False, "no_cpython_wrapper": True}
if hasattr(DefaultOptions, "forceinline"):
    # A call hands over every array of a state by itself, some hundred numbers: inlining is worth a factor of five.
    _INNER["forceinline"] = True
inner: Any = njit(**(_OPTIONS | _INNER))
"""Decorator of functions that only kernels call: no entry from Python, and no call in the end.

numba compiles what is called anew for each literal number that it is called with. Constants that are handed on to large
functions are therefore of numpy's types.
"""

# What a kernel returns: why it came back. What it calls returns the same instead of a symbol, if there is none.
DONE = 0  # the pass is complete
NEED = -1  # the coder needs bytes (decoding) or room for them (encoding)
CUT = -2  # the stated number of symbols of a cut run has been coded
GROW = -3  # an array is nearly full
BAD = -4  # the stream violates the specification; the clause is in the state
