"""Files by their names: opened once and asked for what is in them; fields, contours and bytes saved."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..drawing.contour import Contour
from ..errors import InputError, OptionError
from ..field.sampled import Field
from ..stream.names import Isovalues
from .content import SpatialImage
from .isofile import IsoFile

if TYPE_CHECKING:
    from typing import Unpack

    from ..stream.options import EncodeOptions


_DRAWN = 16
"""Most isovalues that a notebook shows."""


def save(
    path: str | os.PathLike[str],
    what: bytes | Contour | Collection[Contour] | IsoFile | ArrayLike | Field | SpatialImage,
    isovalue: Isovalues | None = None,
    **options: Unpack[EncodeOptions],
) -> None:
    """Write a field as ``.iso`` file, an ``.iso`` file that was encoded before, or contours in another format.

    Parameters
    ----------
    path : path
        Written whole, or not at all.
    what : bytes, IsoFile, Contour, several Contours, or a field
        Bytes are written as they are; contours in the format that the suffix of ``path`` names (see ``isocodec decode
        --help``); fields are encoded.
    isovalue, options
        Of a field, as of `isocodec.encode`.

    Raises
    ------
    OSError
        If the file cannot be written.
    OptionError
        If the format cannot hold this, or options are given where nothing is encoded.
    InputError, MissingExtraError
        As `isocodec.encode` and the writers.
    """
    from ..io.writers.write import check_suffix, write_contour
    from ..storage.atomic import check_target, write_bytes

    if isinstance(what, IsoFile):
        what = what.data
    contours = _contours(what)
    if (contours is not None or isinstance(what, bytes)) and (isovalue is not None or options):
        raise OptionError("isovalue and options are for fields, and this is encoded already", code="options")
    if contours is not None:
        check_suffix(path, contours[0].n)
        write_contour(contours if len(contours) > 1 else contours[0], path)
        return
    suffix = Path(path).suffix.lower()
    if suffix != ".iso":
        raise OptionError(f"{suffix or 'a name without a suffix'} for an .iso file", code="suffix",
                          remedy="choose a name that ends in .iso; decode first to write another format")
    check_target(path)
    if isinstance(what, bytes):
        write_bytes(path, what)
        return
    from .whole import encode

    write_bytes(path, encode(what, isovalue, **options))  # type: ignore[arg-type]


def _contours(what: Any) -> list[Contour] | None:
    """The contours that something is, or nothing if it is something else."""
    if isinstance(what, Contour):
        return [what]
    if isinstance(what, list | tuple) and any(isinstance(one, Contour) for one in what):
        if not all(isinstance(one, Contour) for one in what):
            raise InputError("contours and other things together", code="contours")
        return list(what)
    return None
