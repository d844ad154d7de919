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
    from .api.editing import merge
    from .api.files import save
    from .api.isofile import IsoFile, decode, open
    from .api.whole import encode
    from .drawing.bands import bands
    from .drawing.contour import Contour
    from .errors import IsoError
    from .field.sampled import Field
    from .io.readers.anything import read
    from .kernel import kernels
    from .limits import Limits
    from .stream.decoder import Decoder
    from .stream.encoder import Encoder
    from .tin.thinned import thin
    from .tin.tin import Tin

__version__ = "0.1.0"

_HOME = {
    "Contour": "drawing.contour", "Decoder": "stream.decoder", "Encoder": "stream.encoder", "Field": "field.sampled",
    "IsoError": "errors", "IsoFile": "api.isofile", "Limits": "limits", "Tin": "tin.tin", "bands": "drawing.bands",
    "decode": "api.isofile", "encode": "api.whole", "kernels": "kernel", "merge": "api.editing", "open": "api.isofile",
    "read": "io.readers.anything", "save": "api.files", "thin": "tin.thinned",
}

__all__ = [
    "Contour", "Decoder", "Encoder", "Field", "IsoError", "IsoFile", "Limits", "Tin", "bands", "decode", "encode",
    "kernels", "merge", "open", "read", "save", "thin",
]


if not TYPE_CHECKING:  # or type checkers would take any name for one that is there

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
