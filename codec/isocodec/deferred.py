"""Dataclasses whose methods are made when the first object is: making them takes longer than importing a module.

A command uses a third of the dataclasses that it imports.
"""

from __future__ import annotations

import dataclasses
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

_WAITING: dict[type, dict[str, Any]] = {}
"""Classes without their methods so far, with the parameters of `dataclasses.dataclass`."""


class _Shared:
    """Methods as `dataclasses.dataclass` makes them, but the same for all classes."""

    @recursive_repr()
    def __repr__(self: Any) -> str:
        shown = (each.name for each in dataclasses.fields(self) if each.repr)
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    def __eq__(self: Any, other: Any) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        compared = [each.name for each in dataclasses.fields(self) if each.compare]
        return tuple(getattr(self, name) for name in compared) == tuple(getattr(other, name) for name in compared)

    def __hash__(self: Any) -> int:
        hashed = (each for each in dataclasses.fields(self) if (each.compare if each.hash is None else each.hash))
        return hash(tuple(getattr(self, each.name) for each in hashed))


def _make(cls: type, parameters: dict[str, Any]) -> None:
    """Make a dataclass; methods that can be the same for all classes are not compiled for this one."""
    own, rest = vars(cls), dict(parameters)
    shown, compared = rest.pop("repr", True), rest.pop("eq", True)
    hash_is_own = own.get("__hash__") is not None or ("__hash__" in own and "__eq__" not in own)
    methods: dict[str, Any] = {}
    if shown and "__repr__" not in own:
        methods["__repr__"] = _Shared.__repr__
    if compared and not hash_is_own:
        methods["__hash__"] = _Shared.__hash__ if rest.get("frozen") else None
    if compared and "__eq__" not in own:
        methods["__eq__"] = _Shared.__eq__
    for name, method in methods.items():
        setattr(cls, name, method)
    dataclasses.dataclass(**rest, repr=False, eq=False)(cls)


def _complete(cls: type) -> None:
    """Make the methods of a class and of those that it is derived from."""
    for each in reversed(cls.__mro__):
        parameters = _WAITING.pop(each, None)
        if parameters is not None:
            for name in _PLACES:
                delattr(each, name)
            _make(each, parameters)


def _begin(self: Any, *values: Any, **named: Any) -> None:
    _complete(type(self))
    type(self).__init__(self, *values, **named)


def _restore(self: Any, state: dict[str, Any]) -> None:
    """Take the state of a pickled object, which is made without ``__init__``."""
    _complete(type(self))
    self.__dict__.update(state)


class _Fields:
    """Placeholder for the fields of a class, which the functions of `dataclasses` look up."""

    def __get__(self, _: object, owner: type) -> Any:
        _complete(owner)
        return owner.__dataclass_fields__  # type: ignore[attr-defined]


_PLACES = {"__init__": _begin, "__setstate__": _restore, "__dataclass_fields__": _Fields()}


def _deferred(cls: type | None = None, /, **parameters: Any) -> Any:
    """Take the place of `dataclasses.dataclass`, with its parameters ``repr``, ``eq``, ``frozen`` and ``kw_only``."""
    if cls is None:
        return lambda decorated: _deferred(decorated, **parameters)
    if "__init__" in vars(cls):
        return dataclasses.dataclass(**parameters)(cls)
    _WAITING[cls] = parameters
    for name, place in _PLACES.items():
        setattr(cls, name, place)
    return cls


if TYPE_CHECKING:  # to type checkers they are plain dataclasses
    from dataclasses import dataclass
else:
    dataclass = _deferred
