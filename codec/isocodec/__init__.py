"""isocodec: the tubular neighbourhood of an isocontour or isosurface in a small, progressive file.

>>> import isocodec
>>> data = isocodec.encode(field, 500.5)          # doctest: +SKIP
>>> contour = isocodec.decode(data)               # doctest: +SKIP
>>> contour.points, contour.cells, contour.lines  # doctest: +SKIP

Importing this package is light; what needs the compiled kernels is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api.encoding import encode
    from .api.isofile import IsoFile
    from .api.merging import merge
    from .api.opening import decode, open
    from .api.saving import save
    from .api.thinned import thin
    from .drawing.bands import bands
    from .drawing.contour import Contour
    from .errors import IsoError
    from .field.framed import Frames
    from .field.meshed import Mesh
    from .field.sampled import Field
    from .io.opener import read
    from .kernel import kernels
    from .limits import Limits
    from .stream.decoder import Decoder
    from .stream.encoder import Encoder
    from .tin.tin import Tin

__version__ = "0.1.0"

_HOME = {
    "Contour": "drawing.contour", "Decoder": "stream.decoder", "Encoder": "stream.encoder", "Field": "field.sampled",
    "Frames": "field.framed", "IsoError": "errors", "IsoFile": "api.isofile", "Limits": "limits",
    "Mesh": "field.meshed", "Tin": "tin.tin", "bands": "drawing.bands", "decode": "api.opening",
    "encode": "api.encoding", "kernels": "kernel", "merge": "api.merging", "open": "api.opening",
    "read": "io.opener", "save": "api.saving", "thin": "api.thinned",
}

__all__ = [
    "Contour", "Decoder", "Encoder", "Field", "Frames", "IsoError", "IsoFile", "Limits", "Mesh", "Tin", "bands",
    "decode", "encode", "kernels", "merge", "open", "read", "save", "thin",
]


if not TYPE_CHECKING:  # or type checkers would take any name for one that is there

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
