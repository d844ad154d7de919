"""Explicit domains (meshes) in a file, and the heads of their layers (spec clauses 3.5.8 and 10.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from isospec.container import DomainKind, MeshLayer, unzigzag, write_varint, zigzag

from ..errors import FormatError, OptionError
from .header import varint

DIGEST = 16
"""Number of bytes of the hash of a known mesh."""
MOST_EXPONENT = 1100
MOST_BITS = 52
MOST_STEP = 1 << 40
MOST_MULTIPLE, MOST_PLACE, MOST_EXTENT = 1 << 20, 1 << 40, 1 << 24
MOST_OF_BYTE = 512
"""Largest number of vertices and cells of a coded mesh per byte of its payload."""


@dataclass(frozen=True)
class DomainHead:
    """The head of a domain chunk.

    Attributes
    ----------
    kind : DomainKind
    d : int
        Dimension of the positions.
    exponent : int
        Positions are multiples of ``2**exponent`` in the unit of the coordinates.
    vertices, cells : int
    digest : bytes
        For a known mesh, the first 16 bytes of the SHA-256 of its canonical form; otherwise empty.
    multiple : int
        For a mesh in the file: positions are multiples of this many times ``2**exponent``.
    origin, extent : tuple of int
        For a mesh in the file, for each coordinate: where positions begin, and the number of possible ones from there
        on. Of scattered points, these may be those of more points than the file stores.
    """

    kind: DomainKind
    d: int
    exponent: int
    vertices: int
    cells: int
    digest: bytes = b""
    multiple: int = 1
    origin: tuple[int, ...] = ()
    extent: tuple[int, ...] = ()

    @property
    def unit(self) -> float:
        """Unit of positions and promises, in that of the coordinates: infinite or 0 if that is beyond all floats."""
        with np.errstate(all="ignore"):
            return float(np.ldexp(float(self.multiple), self.exponent))


def write_domain(head: DomainHead, n: int) -> bytes:
    """Write the payload of a domain chunk, without the coded mesh that follows."""
    out = bytes([head.kind << 4 | (head.d - n)]) + write_varint(zigzag(head.exponent))
    out += write_varint(head.vertices) + write_varint(head.cells) + head.digest
    if head.kind != DomainKind.KNOWN:
        numbers = (head.multiple, *map(zigzag, head.origin), *head.extent)
        out += b"".join(map(write_varint, numbers))
    return out


def read_domain(payload: bytes, n: int, start: int) -> tuple[DomainHead, int]:
    """Inverse of ``write_domain``: the head, and the place after it in the payload, which begins at ``start``.

    Raises
    ------
    FormatError
        If it is malformed.
    """

    def wrong(what: str) -> FormatError:
        return FormatError(what, code="domain", offset=start, clause="3.5.8")

    if not payload:
        raise wrong("an empty domain chunk")
    kind, higher = payload[0] >> 4, payload[0] & 15
    if kind == DomainKind.POINTS and n == 2:
        raise OptionError("the file holds a triangulated surface, not a mesh", code="domain", remedy="open it, and "
                                                                                                     "ask for its "
                                                                                                     "surface")
    if kind == DomainKind.POINTS or kind not in DomainKind.__members__.values():
        raise wrong(f"unknown kind of domain {kind}")
    if kind == DomainKind.DELAUNAY and (n, higher) != (2, 0):
        raise wrong("only triangles in the plane can be a Delaunay triangulation")
    if higher > 3 - n:
        raise wrong("cells have more dimensions than the coordinates of their vertices, or reserved bits are set")
    numbers = []
    at = 1
    for _ in range(3):
        found = varint(payload, at, len(payload), "3.5.8")
        if found is None:
            raise wrong("the domain chunk is incomplete")
        numbers.append(found[0])
        at = found[1]
    exponent, vertices, cells = unzigzag(numbers[0]), numbers[1], numbers[2]
    if abs(exponent) > MOST_EXPONENT:
        raise wrong("the unit of positions is out of range")
    if not n < vertices < 1 << 31 or not 0 < cells < 1 << 31:
        raise wrong("the mesh has no cells, or too many vertices or cells")
    digest = payload[at : at + DIGEST] if kind == DomainKind.KNOWN else b""
    if kind == DomainKind.KNOWN and len(payload) != at + DIGEST:
        raise wrong("the hash of the mesh has the wrong length")
    head = DomainHead(DomainKind(kind), n + higher, exponent, vertices, cells, digest)
    at += len(digest)
    return (head, at) if kind == DomainKind.KNOWN else _read_box(head, payload, at, wrong)


def _read_box(
    head: DomainHead, payload: bytes, at: int, wrong: Callable[[str], FormatError]
) -> tuple[DomainHead, int]:
    """Read the rest of the head of a coded mesh: the unit of its positions, and where they lie."""
    numbers = []
    for _ in range(1 + 2 * head.d):
        found = varint(payload, at, len(payload), "3.5.8")
        if found is None:
            raise wrong("the domain chunk is incomplete")
        numbers.append(found[0])
        at = found[1]
    origin, extent = tuple(map(unzigzag, numbers[1 : 1 + head.d])), tuple(numbers[1 + head.d :])
    if not 0 < numbers[0] <= MOST_MULTIPLE or max(map(abs, origin)) > MOST_PLACE:
        raise wrong("the unit or origin of positions is out of range")
    if not all(0 < each <= MOST_EXTENT for each in extent):
        raise wrong("the extent of positions is out of range")
    if head.vertices + head.cells > MOST_OF_BYTE * len(payload):
        raise wrong("the chunk is too short for its number of vertices and cells")
    return replace(head, multiple=numbers[0], origin=origin, extent=extent), at


@dataclass(frozen=True)
class MeshLayerHead:
    """The head of a layer of an explicit domain.

    Attributes
    ----------
    kind : MeshLayer
    step : int
        For offsets: the longest part of an edge, in 1/256 of a unit of positions.
    bits : (int, int)
        For values: bits of the numbers below and above the isovalue.
    rounds : int
        For levels: rounds of removal that remain to be undone.
    """

    kind: MeshLayer
    step: int = 0
    bits: tuple[int, int] = (0, 0)
    rounds: int = 0


def write_mesh_layer(head: MeshLayerHead) -> bytes:
    """Write the bytes before the run."""
    out = bytes([head.kind])
    if head.kind == MeshLayer.OFFSETS:
        out += write_varint(head.step)
    if head.kind == MeshLayer.LEVELS:
        out += write_varint(head.rounds)
    if head.kind == MeshLayer.VALUES:
        out += bytes(head.bits)
    return out


def read_mesh_layer(payload: bytes, start: int) -> tuple[MeshLayerHead, int]:
    """Inverse of ``write_mesh_layer``: the head, and where the run begins in the payload, which begins at ``start``.

    Raises
    ------
    FormatError
        If it is malformed.
    """

    def wrong(what: str) -> FormatError:
        return FormatError(what, code="layer", offset=start, clause="10.1.3")

    if not payload or payload[0] not in MeshLayer.__members__.values():
        raise wrong("unknown kind of layer")
    kind = MeshLayer(payload[0])
    if kind == MeshLayer.OFFSETS:
        found = varint(payload, 1, len(payload), "10.1.3")
        if found is None or not 1 <= found[0] <= MOST_STEP:
            raise wrong("the step of offsets is missing or out of range")
        return MeshLayerHead(kind, step=found[0]), found[1]
    if kind == MeshLayer.LEVELS:
        found = varint(payload, 1, len(payload), "10.1.3")
        if found is None:
            raise wrong("the number of rounds is missing")
        return MeshLayerHead(kind, rounds=found[0]), found[1]
    if kind == MeshLayer.VALUES:
        if len(payload) < 3 or max(payload[1:3]) > MOST_BITS:
            raise wrong("the numbers of bits are missing or too large")
        return MeshLayerHead(kind, bits=(payload[1], payload[2])), 3
    return MeshLayerHead(kind), 1
