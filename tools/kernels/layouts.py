"""What a module of WebAssembly says of itself, for those who call its kernels: what each takes, slot by slot.

It stands in two sections of the module. ``isocodec`` is JSON, a list of three: by entry the types of its arguments and
whether it returns a number; by record the types of its members; by sort of registers their names. A type is a number
(``int64``, ``float64``, ``bool``), an array (``int32[2d]``: address, entries, entries along each axis, bytes from one
to the next along each axis) or one of those. ``isocodec.mesh`` is the tables of the mesh for two axes, then for three,
as numbers of two bytes.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import sys
from collections.abc import Iterator

import front

LAYOUTS, MESH = "isocodec", "isocodec.mesh"


def sections(entries: set[str]) -> bytes:
    """Both sections, for a module with these entries."""
    with front._environment(ISOCODEC_KERNELS="python"), multiprocessing.get_context("spawn").Pool(1) as pool:
        layouts, mesh = pool.apply(_described, ([found for found in front.kernels() if found.symbol in entries],))
    return _section(LAYOUTS, layouts) + _section(MESH, mesh)


def _described(kernels: list[front.Found]) -> tuple[bytes, bytes]:
    """The contents of both sections."""
    sys.path[:0] = map(str, front.SOURCES)
    from isocodec.grid.lattice.tables import mesh_tables
    from isocodec.kernel.types import Kind, Named, Record, Signature

    records: dict[str, list[str]] = {}
    registers: dict[str, list[str]] = {}

    def named(kinds: Iterator[Kind]) -> list[str]:
        out = []
        for kind in kinds:
            if isinstance(kind, Record):
                records[str(kind)] = named(member for _, member in kind.members)
            elif isinstance(kind, Named):
                registers[str(kind)] = list(kind.members)
            out.append(str(kind))
        return out

    taken = {}
    for found in sorted(kernels):
        signature = Signature.of(getattr(importlib.import_module(found.module), found.name))
        taken[found.symbol] = [named(kind for _, kind in signature.arguments), signature.result is not None]
    mesh = b""
    for n in (2, 3):
        tables = mesh_tables(n).astype("<i2")
        if (tables != mesh_tables(n)).any():
            raise ValueError("a number of the tables of the mesh takes more than two bytes")
        mesh += tables.tobytes()
    return json.dumps([taken, records, registers], separators=(",", ":")).encode(), mesh


def _section(name: str, content: bytes) -> bytes:
    """A section of a module that whoever runs it passes over."""
    whole = _size(len(name)) + name.encode() + content
    return b"\0" + _size(len(whole)) + whole


def _size(number: int) -> bytes:
    """A number by seven bits a byte, the last ones first."""
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])
