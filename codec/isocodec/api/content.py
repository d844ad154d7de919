"""What a user hands over, as what the codec takes: fields as arrays with options, files as their bytes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Protocol, TypeAlias

from numpy.typing import ArrayLike

from ..errors import LimitError, OptionError
from ..field.placement import Placement
from ..field.sampled import Field
from ..limits import Limits

Readable: TypeAlias = bytes | bytearray | memoryview | str | os.PathLike[str] | BinaryIO
"""An ``.iso`` file: its bytes, or where they are."""
_PIECE = 1 << 20


class SpatialImage(Protocol):
    """An image of nibabel."""

    @property
    def affine(self) -> Any:
        """Where the samples lie."""

    @property
    def dataobj(self) -> Any:
        """The samples."""


def content(data: Readable, limits: Limits | None = None) -> bytes:
    """The bytes of a file; what is not a path, a URL or a file object stays as it is.

    Raises
    ------
    OSError
        If it cannot be opened.
    LimitError
        If there are more bytes than the limits allow.
    """
    if isinstance(data, str):
        from ..storage.remote import is_url, opened

        if is_url(data):
            with opened(data) as file:
                return _read(file, limits)
    if isinstance(data, str | os.PathLike):
        with Path(data).open("rb") as file:
            return _read(file, limits)
    return _read(data, limits) if hasattr(data, "read") else data  # type: ignore[return-value]


def _read(file: Any, limits: Limits | None) -> bytes:
    most = (limits or Limits()).bytes
    pieces: list[bytes] = []
    while piece := file.read(_PIECE):
        if isinstance(piece, str):
            raise OptionError("the file was opened as text", code="data", remedy="open it in binary mode: 'rb'")
        pieces.append(piece)
        most -= len(piece)
        if most < 0:
            raise LimitError(
                f"more than {(limits or Limits()).bytes:,} bytes", code="limit-bytes", clause="11.2"
            )
    return b"".join(pieces)


def described(
    field: ArrayLike | Field | SpatialImage, mask: ArrayLike | None = None,
    placement: Placement | ArrayLike | None = None, metadata: Mapping[str, str] | None = None,
) -> tuple[ArrayLike, dict[str, Any]]:
    """The samples of a field, and these options with what it says itself.

    Raises
    ------
    InputError
        As `isocodec.read`.
    """
    from ..io.readers.reader import is_described, read

    if not is_described(field):
        return field, {"mask": mask, "placement": placement, "metadata": metadata}  # type: ignore[return-value]
    known = read(field)
    mask, placement, metadata = known.combined(mask, placement, metadata)
    return known.values, {"mask": mask, "placement": placement, "metadata": metadata}
