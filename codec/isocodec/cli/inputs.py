"""Inputs of ``encode`` and ``verify`` that are no files here: standard input and URLs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from .report import STANDARD, url_of


@contextmanager
def local_input(source: Path, kind: str | None, samples: int | None) -> Iterator[Path]:
    """A file with what ``-`` or a URL names, for as long as it is needed; a file's own name as it is."""
    url = url_of(source)
    if str(source) != STANDARD and url is None:
        if kind is not None:
            raise click.UsageError("--kind is for standard input and URLs; the suffix of a file tells its format")
        yield source
        return
    from ..io.readers.recognition import of_kind
    from ..storage.content import local

    suffix = None if kind is None else f".{kind.lstrip('.')}"
    with local(sys.stdin.buffer if url is None else url, of_kind(suffix), samples) as path:
        yield path
