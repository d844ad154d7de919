"""Optional libraries, imported when they are first needed."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from typing import Any

from .errors import MissingExtraError


def optional(module: str, *, extra: str, purpose: str) -> Any:
    """Import ``module``; raises `MissingExtraError`, naming the extra that installs it, if that fails.

    The ``purpose`` starts the message: ``"writing .ply"``.
    """
    try:
        return importlib.import_module(module)
    except ImportError as exc:
        # an installed but broken library fails in the same way: its own words are added
        library = module.partition(".")[0]
        absent = isinstance(exc, ModuleNotFoundError) and exc.name in (library, module)
        reason = "" if absent else f", which fails to load ({exc})"
        raise MissingExtraError(
            f"{purpose} needs {library}{reason}",
            code="missing-extra",
            remedy=f"pip install 'isocodec[{extra}]'",  # beside an installed isocodec: it is on no index
        ) from exc


@cache
def without(module: str, heavy: tuple[str, ...], *, extra: str, purpose: str) -> Any:
    """Import ``module`` as `optional` does, but without other libraries that it loads only to offer more functions.

    Importing pyogrio takes ten times as long with geopandas, pandas and pyarrow as without. What this returns is
    private: the next ``import`` of the same library finds all of it. Libraries that are already loaded are kept.
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
