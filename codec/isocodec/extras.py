"""Optional libraries, imported when they are first needed."""

from __future__ import annotations

import importlib
from typing import Any

from .errors import MissingExtraError


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


def remedy_of(extra: str) -> str:
    """The command that installs an extra: the package is on no index."""
    return f"pip install '.[{extra}]' in a checkout of isocodec"
