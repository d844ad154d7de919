"""Dataclasses whose methods are made when the first object is: making them takes longer than importing a module.

A command uses a third of the dataclasses that it imports.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

_WAITING: dict[type, dict[str, Any]] = {}
"""Classes without their methods so far, with the parameters of `dataclasses.dataclass`."""


def _complete(cls: type) -> None:
    """Make the methods of a class and of those that it is derived from."""
    for each in reversed(cls.__mro__):
        parameters = _WAITING.pop(each, None)
        if parameters is not None:
            for name in _PLACES:
                delattr(each, name)
            dataclasses.dataclass(**parameters)(each)


def _begin(self: Any, *values: Any, **named: Any) -> None:
    _complete(type(self))
    type(self).__init__(self, *values, **named)


def _restore(self: Any, state: dict[str, Any]) -> None:
    """Take the state of a pickled object, which is made without ``__init__``."""
    _complete(type(self))
    self.__dict__.update(state)


class _Fields:
    """The fields of a class, by which the functions of `dataclasses` know it."""

    def __get__(self, _: object, owner: type) -> Any:
        _complete(owner)
        return owner.__dataclass_fields__  # type: ignore[attr-defined]


_PLACES = {"__init__": _begin, "__setstate__": _restore, "__dataclass_fields__": _Fields()}


def _deferred(cls: type | None = None, /, **parameters: Any) -> Any:
    """Take the place of `dataclasses.dataclass`, with the same parameters but ``slots``."""
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
