"""The library of compiled kernels: found in this package and nowhere else, loaded only if it is what was built."""

from __future__ import annotations

import ctypes
import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import KernelError
from .execution import BUILT, NOTE, content_of
from .sources import PACKAGES, digest_of

if TYPE_CHECKING:
    from .call import Entry, Kernel

_REMEDY = "install isocodec again; ISOCODEC_KERNELS=python does without the library, slowly"


class Note(NamedTuple):
    """Note of a library, written when it is built.

    Attributes
    ----------
    file : str
    sha256 : str
        The file's.
    platform : str
    variants : list of str
        Appended to the names of entries: those for the processors that ``iso_variant`` numbers.
    signatures : dict
        Those of the entries.
    ran : bool
        Whether it has been run on its platform.
    sources : dict or None
        For a checkout, whose sources may change: the files that kernels are compiled from, and their digest.
    """

    file: str
    sha256: str
    platform: str
    variants: list[str]
    signatures: dict[str, str]
    ran: bool
    sources: dict[str, Any] | None


class Library(NamedTuple):
    """A loaded library."""

    note: Note
    loaded: ctypes.CDLL
    suffix: str

    @property
    def detail(self) -> str:
        """Its platform, and the instructions beyond those of every processor that are used."""
        return " ".join([self.note.platform, *filter(None, [self.suffix.removeprefix("_").upper()])])


def symbol(name: str) -> str:
    """The name of a kernel's entry."""
    return "iso_" + name.replace(".", "_")


@cache
def note() -> Note:
    """Read the note of this package's library."""
    try:
        return Note(**json.loads(content_of(BUILT / NOTE.name)))
    except (OSError, ValueError, TypeError) as error:
        raise KernelError(f"{BUILT / NOTE.name}: {error}", code="kernel-library", remedy=_REMEDY) from None


def _check_sources(noted: Note) -> None:
    """Check that a library is of the present sources, unless they lie in an archive, where they do not change."""
    sources = noted.sources if BUILT.is_dir() else None
    if sources is not None and digest_of(sources["files"], _homes()) != sources["sha256"]:
        raise KernelError(
            f"{BUILT / noted.file}: the kernels' sources have changed since it was built",
            code="kernel-library", remedy="python tools/kernels",
        )


def _homes() -> dict[str, Path]:
    """The folders of the packages that kernels are compiled from."""
    specs = ((name, find_spec(name)) for name in PACKAGES)
    return {name: Path(spec.origin).parent for name, spec in specs if spec and spec.origin}


@cache
def library() -> Library:
    """The library of this package, once it is known to be what was built."""
    import hashlib

    noted = note()
    _check_sources(noted)
    path = BUILT / noted.file
    try:
        content = content_of(path)
        found = hashlib.sha256(content).hexdigest()
        if found != noted.sha256:
            raise KernelError(
                f"{path}: damaged, its SHA-256 is {found[:12]}… instead of {noted.sha256[:12]}…",
                code="kernel-library", remedy=_REMEDY,
            )
        loaded = ctypes.CDLL(str(path)) if path.is_file() else _out_of_archive(path, content)
    except OSError as error:
        raise KernelError(f"{path}: {error}", code="kernel-library", remedy=_REMEDY) from None
    suffix = noted.variants[loaded.iso_variant()] if len(noted.variants) > 1 else noted.variants[0]
    return Library(noted, loaded, suffix)


def _out_of_archive(path: Path, content: bytes) -> ctypes.CDLL:
    """Load a library from a copy, since systems load files only; the copy goes at once, but on Windows."""
    import tempfile
    from contextlib import suppress

    with tempfile.NamedTemporaryFile(prefix="isocodec-", suffix=path.suffix, delete=False) as copy:
        copy.write(content)
    try:
        return ctypes.CDLL(copy.name)
    finally:
        with suppress(OSError):  # Windows keeps files that are loaded
            Path(copy.name).unlink()


def entry(kernel: Kernel) -> Entry:
    """A kernel's entry in the library."""
    from .call import PROTOTYPE

    whole = library()
    name = symbol(kernel.name)
    stated, built = str(kernel.signature), whole.note.signatures.get(name)
    if built != stated:
        raise KernelError(
            f"kernel {kernel.name}: {'not in the library' if built is None else f'compiled as {built}'}, "
            f"the source declares {stated}",
            code="kernel-library", remedy=_REMEDY,
        )
    return PROTOTYPE((name + whole.suffix, whole.loaded))
