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
    from .api.files import IsoFile, open, save
    from .api.frames import decode_frames
    from .api.labels import decode_labels, encode_labels
    from .api.mesh_api import encode_mesh
    from .api.recoding import merge, transcode
    from .api.tiled_api import TiledIsoFile, encode_tiles
    from .api.tin_api import decode_tin, encode_tin
    from .api.verification import Kept, verify
    from .api.whole import decode, decode_all, decode_mask, decode_valid, encode
    from .drawing.bands import Band, bands
    from .drawing.contour import Contour
    from .errors import (
        FormatError,
        InputError,
        IsoError,
        KernelError,
        LimitError,
        MissingExtraError,
        OptionError,
        TruncatedError,
    )
    from .field.sampled import Field
    from .format.events import (
        BaseComplete,
        ChunkSkipped,
        CoordinatesRead,
        DomainRead,
        End,
        Event,
        FrameRead,
        GeometryRefined,
        HeaderRead,
        IsovalueRead,
        LayerComplete,
        LevelComplete,
        MaskComplete,
        MeshLayerComplete,
        MetadataRead,
        PromisesRead,
        SeriesRead,
    )
    from .io.readers.reader import read
    from .kernel import kernels
    from .limits import Limits
    from .stream.decoder import Decoder
    from .stream.encoder import Encoder
    from .stream.inspect import FileInfo, inspect
    from .stream.mesh_decoder import MeshDecoder
    from .stream.mesh_encoder import MeshEncoder
    from .stream.options import EncodeOptions
    from .stream.plan_file import read_plan
    from .stream.series import SeriesEncoder, encode_frames
    from .stream.statistics import FileStatistics, statistics
    from .stream.truncate import truncate
    from .tin.thinned import Thinned, thin
    from .tin.tin import Tin

__version__ = "0.1.0"

_HOMES = {
    "api.whole": ("decode", "decode_all", "decode_mask", "decode_valid", "encode"),
    "tin.thinned": ("Thinned", "thin"),
    "tin.tin": ("Tin",),
    "drawing.contour": ("Contour",),
    "errors": (
        "FormatError", "InputError", "IsoError", "KernelError", "LimitError", "MissingExtraError", "OptionError",
        "TruncatedError",
    ),
    "field.sampled": ("Field",),
    "api.files": ("IsoFile", "open", "save"),
    "api.frames": ("decode_frames",),
    "drawing.bands": ("Band", "bands"),
    "io.readers.reader": ("read",),
    "kernel": ("kernels",),
    "limits": ("Limits",),
    "api.mesh_api": ("encode_mesh",),
    "api.labels": ("decode_labels", "encode_labels"),
    "api.recoding": ("merge", "transcode"),
    "stream.decoder": ("Decoder",),
    "format.events": (
        "BaseComplete", "ChunkSkipped", "CoordinatesRead", "DomainRead", "End", "Event", "FrameRead", "GeometryRefined",
        "HeaderRead", "IsovalueRead", "LayerComplete", "LevelComplete", "MaskComplete", "MeshLayerComplete",
        "MetadataRead", "PromisesRead", "SeriesRead",
    ),
    "stream.encoder": ("Encoder",),
    "stream.inspect": ("FileInfo", "inspect"),
    "stream.mesh_decoder": ("MeshDecoder",),
    "stream.mesh_encoder": ("MeshEncoder",),
    "stream.options": ("EncodeOptions",),
    "stream.plan_file": ("read_plan",),
    "stream.series": ("SeriesEncoder", "encode_frames"),
    "stream.statistics": ("FileStatistics", "statistics"),
    "stream.truncate": ("truncate",),
    "api.tiled_api": ("TiledIsoFile", "encode_tiles"),
    "api.verification": ("Kept", "verify"),
    "api.tin_api": ("decode_tin", "encode_tin"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Band",
    "BaseComplete",
    "ChunkSkipped",
    "Contour",
    "CoordinatesRead",
    "Decoder",
    "DomainRead",
    "EncodeOptions",
    "Encoder",
    "End",
    "Event",
    "Field",
    "FileInfo",
    "FileStatistics",
    "FormatError",
    "FrameRead",
    "GeometryRefined",
    "HeaderRead",
    "InputError",
    "IsoError",
    "IsoFile",
    "IsovalueRead",
    "Kept",
    "KernelError",
    "LayerComplete",
    "LevelComplete",
    "LimitError",
    "Limits",
    "MaskComplete",
    "MeshDecoder",
    "MeshEncoder",
    "MeshLayerComplete",
    "MetadataRead",
    "MissingExtraError",
    "OptionError",
    "PromisesRead",
    "SeriesEncoder",
    "SeriesRead",
    "Thinned",
    "TiledIsoFile",
    "Tin",
    "TruncatedError",
    "bands",
    "decode",
    "decode_all",
    "decode_frames",
    "decode_labels",
    "decode_mask",
    "decode_tin",
    "decode_valid",
    "encode",
    "encode_frames",
    "encode_labels",
    "encode_mesh",
    "encode_tiles",
    "encode_tin",
    "inspect",
    "kernels",
    "merge",
    "open",
    "read",
    "read_plan",
    "save",
    "statistics",
    "thin",
    "transcode",
    "truncate",
    "verify",
]


if not TYPE_CHECKING:  # or type checkers would take any name for one that is there

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
