"""Types of kernels' parameters and results: numbers, arrays, records of arrays, and how values lie in memory.

A kernel's signature is its annotations, and the only types there are those named here. Values are handed over in slots
of eight bytes, in any machine's order of least significant byte first: a number takes one; an array its address, its
size, its shape and its strides; a record what its members take, one after the other.
"""

from __future__ import annotations

import ctypes
import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Annotated, Any, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from ..errors import KernelError

SLOT = 8
"""Bytes of a slot."""
PACKED = "packed"
"""Attribute of a record's value with its slots, by the name of the type that it was taken for."""
FORMER = "former"
"""Attribute of a value that was made of another one: the slots of that, and the names of the members that differ."""


@dataclass(frozen=True)
class Number:
    """``int64``, ``float64`` or ``bool``."""

    name: str
    slots = 1

    def pack(self, value: Any) -> bytes:
        """The slot of a value; TypeError or OverflowError if it is not of this type."""
        match self.name:
            case "int64" if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
                return int(value).to_bytes(SLOT, "little", signed=True)
            case "float64" if isinstance(value, (float, np.floating)):
                return struct.pack("<d", value)
            case "bool" if isinstance(value, (bool, np.bool_)):
                return int(value).to_bytes(SLOT, "little")
        raise TypeError(f"{type(value).__name__} instead of {self}")

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Array:
    """A contiguous array, its last axis the fastest."""

    dtype: str
    ndim: int

    @property
    def slots(self) -> int:
        return 2 + 2 * self.ndim

    @cached_property
    def pack(self) -> Callable[[Any], bytes]:
        """Packer from an array to its slots; TypeError if it is another sort of array."""
        dtype, ndim, slots = np.dtype(self.dtype), self.ndim, struct.Struct(f"<{self.slots}q").pack
        address, one = ctypes.addressof, ctypes.c_char.from_buffer

        def pack(value: Any) -> bytes:
            # numpy has one object for each of these types, nearly always
            if type(value) is not np.ndarray or (value.dtype is not dtype and value.dtype != dtype) or (
                value.ndim != ndim
            ):
                found = f"{value.dtype}, {value.ndim}d" if isinstance(value, np.ndarray) else type(value).__name__
                raise TypeError(f"{found} instead of {self}")
            if not value.flags.c_contiguous:
                raise TypeError(f"an array with gaps instead of {self}")
            size = value.size
            try:  # the address as of array.ctypes.data, in a third of its time
                place = address(one(value)) if size else 0  # type: ignore[arg-type]
            except TypeError:  # not to be written
                place = value.ctypes.data
            return slots(place, size, *value.shape, *value.strides)

        return pack

    def __str__(self) -> str:
        return f"{self.dtype}[{self.ndim}d]"


@dataclass(frozen=True)
class Record:
    """A named tuple of arrays and other records, which kernels get by address."""

    name: str
    members: tuple[tuple[str, Kind], ...]

    @cached_property
    def slots(self) -> int:
        return sum(kind.slots for _, kind in self.members)

    @cached_property
    def _places(self) -> dict[str, tuple[int, int, Kind]]:
        """Number, first byte and type of each member."""
        out, start = {}, 0
        for number, (name, kind) in enumerate(self.members):
            out[name] = number, start, kind
            start += SLOT * kind.slots
        return out

    def pack(self, value: Any) -> bytes:
        """Its slots; TypeError if a member is of another sort.

        They are noted with the value: it holds its arrays, which do not move. Of a value that was made by replacing
        members of another, only those are packed.
        """
        notes = getattr(value, "__dict__", {})
        packed = notes.get(PACKED)
        if packed is not None and self.name in packed:
            return packed[self.name]
        if not isinstance(value, tuple) or len(value) != len(self.members):
            raise TypeError(f"{type(value).__name__} instead of {self}")
        former: dict[str, bytes]
        former, changed = notes.get(FORMER, ({}, ()))
        if self.name in former:
            whole = bytearray(former[self.name])
            for name in changed:
                number, start, kind = self._places[name]
                piece = self._piece(name, kind, value[number])
                whole[start : start + len(piece)] = piece
            out = bytes(whole)
        else:
            out = b"".join([
                self._piece(name, kind, member) for (name, kind), member in zip(self.members, value, strict=True)
            ])
        notes.setdefault(PACKED, {})[self.name] = out
        return out

    @staticmethod
    def _piece(name: str, kind: Kind, member: Any) -> bytes:
        try:
            return kind.pack(member)
        except TypeError as error:
            raise TypeError(f"{name}: {error}") from None

    def __str__(self) -> str:
        return self.name


class Registers:
    """Integers that kernels read and change by name; a subclass annotates each with ``int``. All begin with 0.

    Attributes
    ----------
    values : (R,) int64
        Where they are kept: this array stays the same.
    packed : bytes
        Its slots.
    """

    names: tuple[str, ...] = ()

    def __init_subclass__(cls) -> None:
        cls.names = tuple(cls.__annotations__)
        for number, name in enumerate(cls.names):
            setattr(cls, name, _register(number))

    def __init__(self) -> None:
        self.values = np.zeros(len(self.names), np.int64)
        # reads and writes single numbers in a third of the time
        self._view = memoryview(self.values)  # type: ignore[arg-type]  # ndarray is a buffer
        self.packed = struct.pack("<2q", self.values.ctypes.data, len(self.names))

    def __copy__(self) -> Registers:
        out = type(self)()
        out.values[:] = self.values
        return out

    def clear(self) -> None:
        """All 0."""
        self.values[:] = 0


def _register(number: int) -> property:
    def read(self: Registers) -> int:
        return self._view[number]

    def write(self: Registers, value: int) -> None:
        self._view[number] = value

    return property(read, write)


@dataclass(frozen=True)
class Named:
    """A sort of registers: their address and number."""

    name: str
    members: tuple[str, ...]
    slots = 2

    def pack(self, value: Any) -> bytes:
        """Their slots; TypeError if it is another sort."""
        if type(value).__name__ != self.name or not isinstance(value, Registers):
            raise TypeError(f"{type(value).__name__} instead of {self}")
        return value.packed

    def __str__(self) -> str:
        return self.name


Kind = Number | Array | Named | Record

Integer = int | np.integer[Any]
"""In named tuples of numbers, which compiled functions hand to one another: compiled, they are int64."""

INT, FLOAT, BOOL = Number("int64"), Number("float64"), Number("bool")

BoolVector = Annotated[NDArray[np.bool_], Array("bool", 1)]
BoolVolume = Annotated[NDArray[np.bool_], Array("bool", 3)]
Int8Vector = Annotated[NDArray[np.int8], Array("int8", 1)]
Int8Matrix = Annotated[NDArray[np.int8], Array("int8", 2)]
UInt8Vector = Annotated[NDArray[np.uint8], Array("uint8", 1)]
UInt8Matrix = Annotated[NDArray[np.uint8], Array("uint8", 2)]
UInt8Volume = Annotated[NDArray[np.uint8], Array("uint8", 3)]
Int16Vector = Annotated[NDArray[np.int16], Array("int16", 1)]
Int16Matrix = Annotated[NDArray[np.int16], Array("int16", 2)]
Int32Vector = Annotated[NDArray[np.int32], Array("int32", 1)]
Int32Matrix = Annotated[NDArray[np.int32], Array("int32", 2)]
IntVector = Annotated[NDArray[np.int64], Array("int64", 1)]
IntMatrix = Annotated[NDArray[np.int64], Array("int64", 2)]
IntVolume = Annotated[NDArray[np.int64], Array("int64", 3)]
Float32Matrix = Annotated[NDArray[np.float32], Array("float32", 2)]
Float32Volume = Annotated[NDArray[np.float32], Array("float32", 3)]
FloatVector = Annotated[NDArray[np.float64], Array("float64", 1)]
FloatMatrix = Annotated[NDArray[np.float64], Array("float64", 2)]


@dataclass(frozen=True)
class Member:
    """In an annotation, another type of a record's member: ``Annotated[Store, Member("pages", Int8Matrix)]``."""

    name: str
    annotation: Any


T = TypeVar("T", bound=type)


def record(cls: T) -> T:
    """Decorator of named tuples that kernels take: their values carry a note of their slots."""

    def _replace(self: Any, **changes: Any) -> Any:
        out = cls._replace(self, **changes)  # type: ignore[attr-defined]
        notes = self.__dict__
        if PACKED in notes:
            out.__dict__[FORMER] = notes[PACKED], frozenset(changes)
        elif FORMER in notes:
            former, changed = notes[FORMER]
            out.__dict__[FORMER] = former, changed.union(changes)
        return out

    made = type(cls.__name__, (cls,), {"__doc__": cls.__doc__, "__module__": cls.__module__, "_replace": _replace})
    made.__qualname__ = cls.__qualname__
    return made  # type: ignore[return-value]


@cache
def members_of(cls: type) -> dict[str, Any]:
    """Names and annotations of a named tuple's members."""
    scope = vars(sys.modules[cls.__module__])
    found: dict[str, Any] = {}
    for each in reversed(cls.__mro__):
        found |= vars(each).get("__annotations__", {})
    return {name: _evaluated(found[name], scope) for name in cls._fields}  # type: ignore[attr-defined]


def _evaluated(annotation: Any, scope: dict[str, Any]) -> Any:
    """Evaluate an annotation that may be text, in a fraction of the time of `typing.get_type_hints`."""
    text = getattr(annotation, "__forward_arg__", annotation)
    if not isinstance(text, str):
        return text
    # most are names, which need not be compiled
    return scope[text] if text in scope else eval(text, scope)


@cache
def kind_of(annotation: Any) -> Kind:
    """The type that an annotation denotes."""
    if annotation in _NUMBERS:
        return _NUMBERS[annotation]
    if isinstance(annotation, type) and issubclass(annotation, Registers):
        return Named(annotation.__name__, annotation.names)
    if get_origin(annotation) is not Annotated:
        return _record(annotation, ())
    base, *notes = get_args(annotation)
    if isinstance(notes[0], Array):
        return notes[0]
    return _record(base, tuple(notes))


def _record(cls: Any, changes: tuple[Member, ...]) -> Record:
    if not hasattr(cls, "_fields"):
        raise KernelError(f"no type of a kernel: {cls}", code="kernel-type")
    members = members_of(cls) | {change.name: change.annotation for change in changes}
    kinds = tuple((name, kind_of(annotation)) for name, annotation in members.items())
    name = cls.__name__ + "".join(f"<{change.name}: {kind_of(change.annotation)}>" for change in changes)
    return Record(name, kinds)


_NUMBERS = {int: INT, float: FLOAT, bool: BOOL}


@dataclass(frozen=True)
class Signature:
    """Types that a kernel takes, by name, and what it returns: a number, nothing, or several integers."""

    arguments: tuple[tuple[str, Kind], ...]
    result: tuple[Number, ...] | Number | None

    @classmethod
    def of(cls, function: Callable[..., Any]) -> Signature:
        """The signature that a function's annotations state."""
        hints = {name: _evaluated(each, function.__globals__) for name, each in function.__annotations__.items()}
        result = hints.pop("return")
        kinds = tuple((name, kind_of(annotation)) for name, annotation in hints.items())
        if get_origin(result) is tuple:
            return cls(kinds, tuple(_NUMBERS[each] for each in get_args(result)))
        return cls(kinds, None if result is None else _NUMBERS[result])

    @property
    def frame(self) -> Record:
        """Pack all arguments into one record."""
        return Record("arguments", self.arguments)

    def __str__(self) -> str:
        taken = ", ".join(f"{name}: {kind}" for name, kind in self.arguments)
        if isinstance(self.result, tuple):
            return f"({taken}) -> ({', '.join(map(str, self.result))})"
        return f"({taken}) -> {self.result}"


assert sys.byteorder == "little"
