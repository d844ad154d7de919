"""Bytes of a file from one place up to another, here or elsewhere."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..extras import optional
from .fetching import Fetch
from .remote import is_url


class NoRangesError(InputError):
    """A server that gives the whole file where a part of it is asked for."""


BEHIND = 416
"""What a server answers if a range begins behind the end of the file."""
PATIENCE = 60.0
"""Seconds that a server may take to answer."""


def ranges_of(source: str | os.PathLike[str]) -> Fetch:
    """A function that gives the bytes of a file, or of what a URL names, from one place up to another.

    At the end of the file there are fewer.

    Raises
    ------
    OSError, MissingExtraError
        From the function, too: ``NoRangesError`` if a server gives all of a file where a part is asked for.
    """
    if is_url(source):
        return _remote(str(source))
    path = Path(source)
    # found out now if it cannot be opened
    path.open("rb").close()

    def fetch(start: int, end: int) -> bytes:
        with path.open("rb") as file:
            file.seek(start)
            return file.read(end - start)

    return fetch


def _remote(url: str) -> Fetch:
    fsspec = optional("fsspec", extra="remote", purpose="reading URLs")
    options: dict[str, Any] = {}
    if url.startswith(("http:", "https:")):
        aiohttp = optional("aiohttp", extra="remote", purpose="reading URLs")
        options["client_kwargs"] = {"timeout": aiohttp.ClientTimeout(total=PATIENCE)}
    try:
        system, path = fsspec.core.url_to_fs(url, **options)
    except (ImportError, ValueError) as exc:
        raise InputError(f"cannot be opened ({exc})", code="url") from exc

    def fetch(start: int, end: int) -> bytes:
        try:
            data: bytes = system.cat_file(path, start=start, end=end)
        except TimeoutError as exc:
            # those of libraries say nothing
            raise InputError(
                f"the server has not answered within {PATIENCE:g} seconds", code="timeout", remedy="try again later"
            ) from exc
        except OSError:
            raise
        except Exception as exc:
            if getattr(exc, "status", None) == BEHIND:
                return b""
            raise InputError(f"cannot be read ({type(exc).__name__}: {exc})", code="url") from exc
        if len(data) > end - start:
            raise NoRangesError(
                "the server gives the whole file where a part of it is asked for", code="ranges",
                remedy="download the file first, or use a server that answers range requests",
            )
        return data

    return fetch
