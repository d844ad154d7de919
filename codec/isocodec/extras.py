"""Optional libraries, imported when they are first needed."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from importlib.util import find_spec
from typing import Any

from .errors import MissingExtraError


def check_installed(module: str, *, extra: str, purpose: str) -> None:
    """Check, without loading it, that a library is installed; parameters and errors as of `optional`."""
    if find_spec(module) is None:
        optional(module, extra=extra, purpose=purpose)


def optional(module: str, *, extra: str, purpose: str) -> Any:
    """Import ``module``; if it is missing, raise an error that names the extra that installs it.

    Parameters
    ----------
    module : str
        Dotted name.
    extra : str
        Name of the extra in ``pyproject.toml``.
    purpose : str
        What it is needed for, as the start of a sentence: ``"writing .ply"``.

    Raises
    ------
    MissingExtraError
        If the import fails.
    """
    try:
        return importlib.import_module(module)
    except ImportError as exc:
        # A library that is there but broken fails in the same way; its own words then explain more than "needs" alone.
        library = module.partition(".")[0]
        absent = isinstance(exc, ModuleNotFoundError) and exc.name in (library, module)
        reason = "" if absent else f", which fails to load ({exc})"
        raise MissingExtraError(
            f"{purpose} needs {library}{reason}",
            code="missing-extra",
            remedy=remedy_of(extra),
        ) from exc


@cache
def without(module: str, heavy: tuple[str, ...], *, extra: str, purpose: str) -> Any:
    """Import ``module`` as `optional` does, but without other libraries that it loads only to offer more functions.

    Importing pyogrio takes ten times as long with geopandas, pandas and pyarrow as without. What this returns is
    private: the next ``import`` of the same library finds all of it.

    Parameters
    ----------
    module : str
    heavy : tuple of str
        Names of libraries; those that are loaded already are not left out.
    extra, purpose
        As of `optional`.

    Raises
    ------
    MissingExtraError
    """
    if module in sys.modules:
        return optional(module, extra=extra, purpose=purpose)
    hidden = [name for name in heavy if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    try:
        return optional(module, extra=extra, purpose=purpose)
    finally:
        for name in hidden:
            del sys.modules[name]
        # compiled modules, and errors that these raise, can be loaded only once
        for name, each in list(sys.modules.items()):
            python = str(getattr(each, "__file__", "")).endswith(".py")
            if name.partition(".")[0] == module and python and not name.endswith(".errors"):
                del sys.modules[name]


def remedy_of(extra: str) -> str:
    """The command that installs an extra: the package is on no index."""
    return f"pip install '.[{extra}]' in a checkout of isocodec"
