"""Outputs of programs: checks before the work begins."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OptionError
from ..storage.atomic import check_target, undoing, write_bytes

if TYPE_CHECKING:
    from ..io.formats import Kind
    from .isofile import IsoFile

__all__ = [
    "STANDARD", "check_output", "formats", "other_format", "read_of", "undoing", "write_bytes",
]

STANDARD = "-"
"""Name of standard input and output."""


def read_of(file: IsoFile) -> tuple[str, dict[str, int]]:
    """Bytes read from a tiled file, as text and for programs; empty for other files."""
    from .files import TileFile

    if not isinstance(file, TileFile):
        return "", {}
    tiled = file.tiled
    pieces = "piece" if tiled.requests == 1 else "pieces"
    text = f", {tiled.received:,} bytes read in {tiled.requests} {pieces} of a file of {file.size:,}"
    return text, {"read": tiled.received, "pieces": tiled.requests}


def check_output(output: str | os.PathLike[str], source: str, *, iso: bool = False) -> None:
    """Check, before the work begins, that an output can be written and is not the input.

    ``-`` is standard output. With ``iso``, the output is an .iso file, and its name must have that suffix or none.
    """
    target = Path(output)
    if str(output) == STANDARD:
        if sys.stdout is None:
            raise OSError(errno.EBADF, "standard output is closed")
        return
    check_target(output)
    if target.exists() and os.path.exists(source) and target.samefile(source):
        raise OptionError("the output is the input file itself", code="same-file", remedy="choose another name")
    _, dot, ending = target.name.lower().rpartition(".")
    if iso and dot and ending != "iso":
        from ..io.formats import Thing, suffixes_of

        raise OptionError(
            f"the output is an .iso file, not .{ending}", code="suffix", remedy="choose a name that ends in .iso; "
            f"encode and decode also write {', '.join(suffixes_of(Thing('contour')))}",
        )


def other_format(name: str) -> str | None:
    """The suffix of a name, if it is that of another format."""
    from ..io.formats import SUFFIXES
    from ..io.opener import SUFFIXES as FIELD_SUFFIXES

    return next((suffix for suffix in (*SUFFIXES, *FIELD_SUFFIXES) if name.endswith(suffix)), None)


def formats() -> dict[str, str]:
    """Lists of suffixes for help texts, by the names that help texts have in braces."""
    from ..io.formats import PICTURES, Thing, suffixes_of

    def listed(kind: Kind, n: int | None = None, several: bool = False) -> str:
        return ", ".join(suffixes_of(Thing(kind, n, several)))

    rows = {
        "Curves": listed("contour", 2), "Surfaces": listed("contour", 3), "Areas and bands": listed("areas"),
        "Above and valid": f"{listed('mask', 2)}; of three axes {listed('mask', 3)}", "Labels": listed("labels"),
        "Meshes": f"{listed('mesh', 2)}; of three axes {listed('mesh', 3)}", "Triangulations": listed("tin"),
    }
    many = suffixes_of(Thing("contour", several=True))
    return {
        "formats": "\n".join(f"{name:16} {suffixes}" for name, suffixes in rows.items()), "surfaces": listed("tin"),
        "pictures": ", ".join(PICTURES),
        "single": ", ".join(one for one in suffixes_of(Thing("contour")) if one not in many),
    }
