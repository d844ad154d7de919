"""Files by their names: opened once and asked for what is in them; fields, contours and bytes saved."""

from __future__ import annotations

import os
from collections.abc import Collection
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..drawing.contour import Contour
from ..errors import InputError, IsoError, OptionError
from ..field.placement import Noted
from ..field.sampled import Field
from ..io.readers.described import SpatialImage
from ..limits import Limits
from ..storage.content import Readable, content
from ..stream.names import Isovalues
from ..tiles.structure import is_tiled

if TYPE_CHECKING:
    from typing import Unpack

    from ..stream.inspect import FileInfo
    from ..stream.options import EncodeOptions
    from .tiled_api import TiledIsoFile


_DRAWN = 16
"""Most isovalues that a notebook shows."""


class IsoFile(Noted):
    """An ``.iso`` file that has been read, to be asked for its curves and for what it says of itself.

    Attributes
    ----------
    data : bytes
        The whole file.
    limits : Limits or None
        What decoding it may need at most.
    """

    def __init__(self, data: bytes, limits: Limits | None = None) -> None:
        self.data = data
        self.limits = limits

    def __repr__(self) -> str:
        info = self.info
        values = ", ".join(f"{value:g}" for value in info.isovalues[:5]) + ", .." * (len(info.isovalues) > 5)
        return f"IsoFile({len(self.data):,} bytes, shape={self.shape}, isovalues {values})"

    def _repr_html_(self) -> str:
        """A drawing for notebooks of the first isovalues, with size, layers and promises; without it, if it takes more
        than the limits allow or a mesh that the file does not hold."""
        from ..io.writers.inline import page_of
        from .whole import decode

        info = self.info
        try:
            contours = [decode(self.data, isovalue=value, limits=self.limits) for value in self.isovalues[:_DRAWN]]
        except IsoError:
            contours = []
        within = [f"{layer.within:g}" for layer in info.layers if layer.within]
        facts = {
            "bytes": f"{len(self.data):,}", "layers": f"{len(info.layers):,}", "profile": info.profile,
            "samples": " x ".join(map(str, self.shape)), "frames": f"{len(info.frames):,}" if info.frames else "",
            "isovalues": ", ".join(f"{value:g}" for value in self.isovalues),
            "promises": ", ".join(within) + " cells" if within else "", **self.metadata,
        }
        return page_of(contours, {name: fact for name, fact in facts.items() if fact})

    @cached_property
    def info(self) -> FileInfo:
        """What `isocodec.inspect` finds: layers, offsets, promises."""
        from ..stream.inspect import inspect

        return inspect(self.data)

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis of the field."""
        return tuple(self.info.shape)

    @property
    def isovalues(self) -> tuple[float, ...]:
        """Isovalues, in the order of the file."""
        return tuple(self.info.isovalues)

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file."""
        return dict(self.info.metadata)

    def contour(self, isovalue: float | None = None, *, layers: int | None = None, smooth: bool = False) -> Contour:
        """The curve or surface of an isovalue, the first if none is given; see `isocodec.decode`."""
        from .whole import decode

        return decode(self.data, isovalue=isovalue, layers=layers, smooth=smooth, limits=self.limits)

    def contours(self, *, smooth: bool = False) -> list[Contour]:
        """The curves or surfaces of all isovalues; see `isocodec.decode_all`."""
        from .whole import decode_all

        return decode_all(self.data, smooth=smooth, limits=self.limits)

    def mask(self, isovalue: float | None = None) -> NDArray[np.bool_]:
        """Which samples lie above an isovalue; see `isocodec.decode_mask`."""
        from .whole import decode_mask

        return decode_mask(self.data, isovalue=isovalue, limits=self.limits)

    def valid(self) -> NDArray[np.bool_]:
        """Which samples are not missing; see `isocodec.decode_valid`."""
        from .whole import decode_valid

        return decode_valid(self.data, limits=self.limits)


def open(source: Readable, *, limits: Limits | None = None) -> IsoFile | TiledIsoFile:
    """Open an ``.iso`` file.

    Parameters
    ----------
    source : path, URL, file object or bytes
    limits : Limits, optional
        What decoding it may need at most, where it comes from strangers.

    Returns
    -------
    IsoFile, or TiledIsoFile
        Its header and notes have been looked at; curves are decoded when they are asked for. Of a file in tiles only
        what is needed is read.

    Raises
    ------
    OSError
        If it cannot be opened.
    FormatError
        If it is not an ``.iso`` file.
    LimitError
        If it has more bytes than the limits allow.

    Examples
    --------
    >>> import isocodec
    >>> file = isocodec.open("terrain.iso")      # doctest: +SKIP
    >>> file.isovalues, file.contour().points    # doctest: +SKIP
    """
    from .tiled_api import tiled_at, tiled_of

    if isinstance(source, str | os.PathLike) and (tiled := tiled_at(source, limits)) is not None:
        return tiled
    data = bytes(content(source, limits))
    if is_tiled(data):
        return tiled_of(data, limits)
    file = IsoFile(data, limits)
    file.info  # noqa: B018 - a file that is none fails here
    return file


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
    from ..io.writers.write import write
    from ..storage.atomic import check_target, write_bytes

    if isinstance(what, IsoFile):
        what = what.data
    contours = _contours(what)
    if (contours is not None or isinstance(what, bytes)) and (isovalue is not None or options):
        raise OptionError("isovalue and options are for fields, and this is encoded already", code="options")
    if contours is not None:
        write(path, contours)
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
