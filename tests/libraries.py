"""Other libraries, loaded when a test first uses them: heads of modules are read in every process of every run."""

from __future__ import annotations

from functools import cached_property
from pkgutil import resolve_name
from typing import Any


class Late:
    """A module of another library, or something in one, by its whole name."""

    def __init__(self, name: str) -> None:
        self._name = name

    @cached_property
    def _found(self) -> Any:
        return resolve_name(self._name)

    def __getattr__(self, name: str) -> Any:
        # pytest looks at everything in a module to see whether it is a test
        if name.startswith(("_", "pytest")):
            raise AttributeError(name)
        return getattr(self._found, name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._found(*arguments, **options)

    def __instancecheck__(self, thing: object) -> bool:
        return isinstance(thing, self._found)
