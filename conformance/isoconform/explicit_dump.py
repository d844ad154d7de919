"""The decoded state of files of explicit domains as canonical text (spec annex B.1(10)), and meshes beside files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isocodec import Decoder
from isocodec.errors import FormatError, IsoError, TruncatedError
from isocodec.format.events import Event, FrameRead, MeshLayerComplete
from isocodec.format.header import read_header
from isocodec.limits import Limits
from isocodec.mesh.isovalue import MeshIsovalue
from isocodec.stream.mesh_contents import MeshContents
from isocodec.tin.rank import by_rank
from isospec.container import DomainKind

from .dump import COMPLETE, Output

MESH = ".mesh"
"""Suffix of the file with the mesh that a file was made on."""
Mesh = tuple[NDArray[np.int64], NDArray[np.int64]]


def is_explicit(data: bytes) -> bool:
    """Whether a file is of an explicit domain."""
    try:
        found = read_header(data)
    except FormatError:
        return False
    return found is not None and found[0].cells is not None


def written(mesh: Mesh) -> str:
    """A mesh as text: ``d n V T``, a line of coordinates for each vertex, one of vertices for each cell."""
    points, cells = mesh
    lines = [[points.shape[1], cells.shape[1] - 1, len(points), len(cells)], *points.tolist(), *cells.tolist()]
    return "".join(" ".join(map(str, line)) + "\n" for line in lines)


def beside(path: Path) -> Mesh | None:
    """The mesh that a vector was made on, if there is one."""
    place = path.with_suffix(MESH)
    return read_mesh(place.read_text()) if place.is_file() else None


def read_mesh(text: str) -> Mesh:
    """Inverse of ``written``."""
    first, *lines = text.splitlines()
    vertices = int(first.split()[2])
    rows = [list(map(int, line.split())) for line in lines]
    return np.array(rows[:vertices], np.int64), np.array(rows[vertices:], np.int64)


def _isovalue(strand: MeshIsovalue) -> Iterator[str]:
    number: dict[int, int] = {}
    if strand.active is not None and strand.steps is not None:
        number = dict(zip(strand.active[:, 0].tolist(), strand.steps.tolist(), strict=True))
    for v, sign in enumerate(strand.strand.sign.tolist()):
        if sign >= 0:
            yield f"v {v} {sign} {number[v]}" if v in number else f"v {v} {sign}"
    if strand.edges is not None and strand.parts is not None and strand.number is not None:
        rows = np.column_stack([strand.edges[:, :2], strand.parts, strand.number])
        for row in rows[np.lexsort((rows[:, 1], rows[:, 0]))].tolist():
            yield "e " + " ".join(map(str, row))


def _strand(decoder: Decoder, number: int, before: bool) -> MeshIsovalue | None:
    contents = decoder.contents
    return contents.strand(number, before=before) if isinstance(contents, MeshContents) else None


def _frame(decoder: Decoder, frame: int, before: bool = False) -> Iterator[str]:
    if frame:
        yield f"frame {frame}"
    number = 0
    while (strand := _strand(decoder, number, before)) is not None:
        if number:
            yield f"isovalue {number}"
        yield from _isovalue(strand)
        number += 1


def _domain(decoder: Decoder) -> Iterator[str]:
    contents = decoder.contents
    if not isinstance(contents, MeshContents) or contents.head is None or contents.domain is None:
        return
    head, domain = contents.head, contents.domain
    corners = domain.mesh.cell.shape[1]
    yield f"domain {head.d} {corners - 1} {head.vertices} {head.cells}"
    if contents.hierarchy is not None:
        yield f"nodes {contents.hierarchy.digest.hex()} {len(contents.hierarchy.rounds)}"
    if head.kind != DomainKind.KNOWN:
        for word, rows in (("p", domain.mesh.position), ("t", domain.mesh.cell)):
            yield from (f"{word} " + " ".join(map(str, row)) for row in rows.tolist())


def _text(decoder: Decoder, past: list[str]) -> str:
    lines = [*_domain(decoder), *past, *_frame(decoder, decoder.present[0])]
    return "".join(f"{line}\n" for line in lines)


def _surface(data: bytes, limits: Limits | None) -> Output:
    """The text of a file that holds a surface."""
    decoder = Decoder(limits)
    try:
        decoder.feed(data)
        head, parts = decoder.take().surface.received()
    except TruncatedError as cut:
        return Output(cut.exit_code, "", cut)
    except IsoError as wrong:
        return Output(wrong.exit_code, "", wrong)
    order = by_rank(parts.points[:, 0], parts.points[:, 1])
    lines = [f"surface {head.extent[0]} {head.extent[1]} {len(order)}"]
    rows = np.column_stack([parts.points, parts.numbers])[order]
    lines += ["s " + " ".join(map(str, row)) for row in rows.tolist()]
    error = None if decoder.complete else TruncatedError("the file ends before it is complete", code="truncated")
    return Output(error.exit_code if error else COMPLETE, "".join(f"{line}\n" for line in lines), error)


def _taken(
    data: bytes, mesh: Mesh | None, piece: int, limits: Limits | None
) -> Iterator[tuple[Event, Decoder, list[str]]]:
    """Events, the decoder, and the text of the frames that are over."""
    decoder = Decoder(limits, mesh=mesh)
    past: list[str] = []
    step = piece or max(len(data), 1)
    for at in range(0, len(data), step):
        decoder.feed(data[at : at + step])
        for event in decoder:
            if isinstance(event, FrameRead) and event.number == 0:
                past += _frame(decoder, event.frame - 1, before=True)
            yield event, decoder, past
    decoder.close()


def _is_surface(data: bytes) -> bool:
    """Whether the domain of a file is points, as far as its first bytes show."""
    decoder = Decoder()
    decoder.feed(data)
    try:
        for _ in decoder:
            if decoder.contents is not None and decoder.contents.kind != "domain":
                break
    except IsoError:
        pass
    return decoder.contents is not None and decoder.contents.kind == "surface"


def dump_explicit(
    data: bytes, mesh: Mesh | None = None, *, layers: int = 0, piece: int = 0, limits: Limits | None = None
) -> Output:
    """Decode a file of an explicit domain with the reference decoder; parameters as of `dump`."""
    if _is_surface(data):
        return _surface(data, limits)
    events: list[Event] = []
    text = ""
    try:
        for event, decoder, past in _taken(data, mesh, piece, limits):
            events.append(event)
            text = _text(decoder, past)
            if layers and sum(isinstance(each, MeshLayerComplete) for each in events) == layers:
                break
    except TruncatedError as cut:
        return Output(cut.exit_code, text, cut, {}, events)
    except IsoError as wrong:
        return Output(wrong.exit_code, "", wrong, {}, events)
    return Output(COMPLETE, text, None, {}, events)


def explicit_layers(data: bytes, mesh: Mesh | None) -> Iterator[tuple[MeshLayerComplete, int, str]]:
    """Every layer of a file, the number of its isovalue, and the canonical text after it."""
    for event, decoder, past in _taken(data, mesh, 0, None):
        if isinstance(event, MeshLayerComplete):
            yield event, decoder.present[1], _text(decoder, past)
