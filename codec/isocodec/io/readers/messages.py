"""Messages between this process and one that reads for it: a line of JSON, then the arrays that it names, as they are.

Nothing is unpickled. Only the records below are rebuilt, and only arrays of numbers, texts and dates.
"""

from __future__ import annotations

import json
import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import InputError
from ...field.placement import Placement
from .mesh_formats import MeshRead
from .opened import Choice
from .source import InputFile

_RECORDS: dict[str, Any] = {each.__name__: each for each in (Choice, InputFile, MeshRead, Placement)}
_LONGEST = 1 << 26
"""Bytes of a message without its arrays."""
_KINDS = "biufcSUmM"


def send(file: IO[bytes], message: Any) -> None:
    """Write a message.

    Parameters
    ----------
    file : binary file
    message : object
        Of None, numbers, texts, paths, lists, tuples, dictionaries with names as keys, types and arrays of numpy, and
        the records of readers.

    Raises
    ------
    InputError
        If an array holds objects.
    """
    arrays: list[np.ndarray[Any, Any]] = []
    line = json.dumps(_packed(message, arrays)).encode()
    file.write(line + b"\n")
    for array in arrays:
        file.write(array.reshape(-1).view(np.uint8).data)
    file.flush()


def receive(file: IO[bytes], most: int | None = None) -> Any:
    """Read a message whose arrays take at most so many bytes; raises `EOFError` if it ends early."""
    line = file.readline(_LONGEST)
    if not line.endswith(b"\n"):
        raise EOFError
    return _unpacked(json.loads(line), file, [math.inf if most is None else most])


def _packed(thing: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if isinstance(thing, np.ma.MaskedArray):
        return {"masked": [_packed(np.asarray(thing.data), arrays), _packed(np.ma.getmaskarray(thing), arrays)]}
    if isinstance(thing, np.ndarray):
        if thing.dtype.kind not in _KINDS:
            raise InputError(f"holds values of the type {thing.dtype}, not numbers", code="dtype")
        arrays.append(np.ascontiguousarray(thing))
        return {"array": [thing.dtype.str, list(thing.shape)]}
    if isinstance(thing, np.generic):
        return thing.item()
    if isinstance(thing, np.dtype):
        return {"dtype": thing.str}
    if isinstance(thing, Path):
        return {"path": str(thing)}
    if isinstance(thing, tuple):
        return {"tuple": [_packed(each, arrays) for each in thing]}
    if isinstance(thing, list):
        return [_packed(each, arrays) for each in thing]
    if isinstance(thing, dict):
        return {"dict": [[str(name), _packed(each, arrays)] for name, each in thing.items()]}
    if is_dataclass(thing):
        held = {each.name: getattr(thing, each.name) for each in fields(thing)}
        return {type(thing).__name__: _packed(held, arrays)}
    return thing


def _unpacked(thing: Any, file: IO[bytes], left: list[float]) -> Any:
    """Rebuild what was packed; arrays follow in the order in which they are named."""
    if isinstance(thing, list):
        return [_unpacked(each, file, left) for each in thing]
    if not isinstance(thing, dict):
        return thing
    ((kind, held),) = thing.items()
    if kind == "array":
        return _array(np.dtype(held[0]), held[1], file, left)
    if kind == "dtype":
        return np.dtype(held)
    if kind == "path":
        return Path(held)
    if kind == "dict":
        return {name: _unpacked(each, file, left) for name, each in held}
    inner = _unpacked(held, file, left)
    if kind == "tuple":
        return tuple(inner)
    return np.ma.MaskedArray(*inner) if kind == "masked" else _RECORDS[kind](**inner)


def _array(dtype: np.dtype[Any], shape: list[int], file: IO[bytes], left: list[float]) -> np.ndarray[Any, Any]:
    size = math.prod(shape) * dtype.itemsize
    left[0] -= size
    if dtype.kind not in _KINDS or min(shape, default=0) < 0 or left[0] < 0:
        raise EOFError
    array = np.empty(shape, dtype)
    view, at = array.reshape(-1).view(np.uint8).data, 0
    while at < size:
        got = file.readinto(view[at:])  # type: ignore[attr-defined]
        if not got:
            raise EOFError
        at += got
    return array
