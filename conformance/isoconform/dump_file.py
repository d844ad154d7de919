"""The decoded state of any file, of grids, of explicit domains and in tiles (spec annex B)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from isocodec.format.events import LayerComplete, MeshLayerComplete
from isocodec.limits import Limits

from .dump import Output, canonical_layers, dump
from .explicit_dump import Mesh, beside, dump_explicit, explicit_layers, is_explicit
from .tiled_dump import dump_tiled, is_tiled


def dump_any(
    data: bytes, mesh: Mesh | None = None, *, layers: int = 0, piece: int = 0, limits: Limits | None = None
) -> Output:
    """As `dump`; ``mesh`` is what the file was made on, if it does not hold it."""
    if is_tiled(data):
        return dump_tiled(data, limits)
    if is_explicit(data):
        return dump_explicit(data, mesh, layers=layers, piece=piece, limits=limits)
    return dump(data, layers=layers, piece=piece, limits=limits)


def dump_file(
    path: Path, size: int | None = None, *, layers: int = 0, piece: int = 0, limits: Limits | None = None
) -> Output:
    """The same of a file, or of its first ``size`` bytes; its mesh stands beside it."""
    return dump_any(path.read_bytes()[:size], beside(path), layers=layers, piece=piece, limits=limits)


def layers_of(data: bytes, mesh: Mesh | None) -> Iterator[tuple[LayerComplete | MeshLayerComplete, int, str]]:
    """Every layer of a file, the number of its isovalue, and the canonical text after it."""
    return explicit_layers(data, mesh) if is_explicit(data) else canonical_layers(data)
