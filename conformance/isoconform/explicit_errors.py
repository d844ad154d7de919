"""Vectors of files that violate clause 10, one for each way to do so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isocodec.entropy.range_coder import code
from isocodec.entropy.run import WritingRun
from isocodec.format.domain import DomainHead, MeshLayerHead, write_domain
from isocodec.format.header import Header, write_header
from isocodec.mesh import walk
from isocodec.mesh.before import spread_signs
from isocodec.mesh.coded_mesh import Original, code_mesh
from isocodec.mesh.complex import complex_of
from isocodec.mesh.mesh_run import encoded_mesh
from isocodec.mesh.models import COMPONENT, coder_of_meshes
from isocodec.mesh.room import whole_growth
from isocodec.tin.models import new_coder
from isocodec.tin.point_tree import code_positions
from isospec.container import ChunkType, DomainKind, MeshLayer, Profile

from .draft import Draft
from .explicit import EXPLICIT, VALUE, hills, plane
from .explicit_dump import written
from .fields import Integers
from .mesh_layers import BITS, Layers
from .streams import Chunk, File

Wrong = Iterator[tuple[str, str, str, bytes]]
"""Names, clauses, what is wrong, and files."""
_HEADS = {
    "signs": MeshLayerHead(MeshLayer.SIGNS), "offsets": MeshLayerHead(MeshLayer.OFFSETS, step=64),
    "values": MeshLayerHead(MeshLayer.VALUES, bits=(BITS, BITS)), "cut": MeshLayerHead(MeshLayer.CUT),
    "levels": MeshLayerHead(MeshLayer.LEVELS), "some_levels": MeshLayerHead(MeshLayer.LEVELS, rounds=1),
}
_MAY_FOLLOW = {
    "": {"signs", "levels", "cut"}, "signs": {"offsets", "values"}, "some_levels": {"levels"},
    "levels": {"offsets", "values"}, "cut": {"cut", "offsets", "values"},
}
"""What may follow layers of signs, by the last of these (10.1.3(2))."""


def _orders() -> Wrong:
    """Layers that may not follow those before: all pairs, and each kind of geometry twice."""
    for last, allowed in _MAY_FOLLOW.items():
        before = (last,) if last else ()
        for kind in ("signs", "levels", "cut", "offsets", "values"):
            if kind not in allowed:
                yield _in_order(*before, kind)
            elif kind in ("offsets", "values"):
                yield _in_order(*before, kind, kind)


def _in_order(*kinds: str) -> tuple[str, str, str, bytes]:
    """A file of layers of these kinds, coded as if they could follow one another."""
    mesh = plane(150, 400, 0)
    layers = Layers(mesh, VALUE)
    one = layers.isovalue(VALUE)
    chunks = [layers.layer(one, _HEADS[kind], hills(mesh) > VALUE) for kind in kinds]
    about = f"{kinds[-1]} after {kinds[-2] if len(kinds) > 1 else 'nothing'}"
    return "_".join(("order", *kinds)), "10.1.3", about, layers.file(*chunks)


def _numbers() -> Wrong:
    """Numbers of layers that are out of range, or not there."""
    mesh = plane()
    layers, above = Layers(mesh, VALUE), hills(mesh) > VALUE

    def behind(kind: str, head: MeshLayerHead | None, *, payload: bytes = b"") -> bytes:
        one = layers.isovalue(VALUE)
        chunks = [layers.layer(one, _HEADS[kind], above)] if kind else []
        more = Chunk(ChunkType.LAYERS, payload) if head is None else layers.layer(one, head, above)
        return layers.file(*chunks, more)

    offsets, values, levels = (bytes([kind]) for kind in (MeshLayer.OFFSETS, MeshLayer.VALUES, MeshLayer.LEVELS))
    far = MeshLayerHead(MeshLayer.OFFSETS, step=(1 << 40) + 1)
    yield "step_far", "10.1.3", "a step beyond 2**40", behind("signs", far)
    for side, bits in (("below", (53, BITS)), ("above", (BITS, 53))):
        head = MeshLayerHead(MeshLayer.VALUES, bits=bits)
        yield f"bits_{side}", "10.1.3", f"53 bits of the numbers {side}", behind("signs", head)
    for name, kind, payload in (
        ("step_none", "signs", offsets), ("step_short", "signs", offsets + b"\x81"), ("bits_none", "signs", values),
        ("bits_one", "signs", values + b"\x08"), ("rounds_none", "", levels), ("rounds_short", "", levels + b"\x81"),
    ):
        yield name, "10.1.3", "a layer that ends within its numbers", behind(kind, None, payload=payload)


def _components() -> Wrong:
    """Components that begin where none may."""
    mesh = plane()
    layers, above = Layers(mesh, VALUE), hills(mesh) > VALUE
    one = layers.isovalue(VALUE)
    run = one.write()
    one.code_signs(above)
    run.end()
    first, visited = one.leaves[0], one.strand.visited
    known = (one.strand.sign[layers.domain.mesh.cell] >= 0).all(axis=1)
    behind = np.arange(len(visited)) > first
    yield "visited", "10.3.1", "a component that begins in a cell that was visited", _with_component(
        layers, above, int(np.flatnonzero(visited & behind)[0])
    )
    yield "not_mixed", "10.3.1", "a component that begins in a cell that is not mixed", _with_component(
        layers, above, int(np.flatnonzero(known & ~visited & behind)[0])
    )


def _with_component(layers: Layers, above: NDArray[np.bool_], wrong: int) -> bytes:
    """A file with one component of a curve, and another one that begins in a stated cell."""
    one = layers.isovalue(VALUE)
    mesh, st = layers.domain.mesh, one.strand
    run = one.write()
    run.room(4 * len(above))
    coder = run.coder
    st.truth[:] = above
    code(coder, COMPONENT, np.int64(1))
    start = walk._next_start(mesh, st, 0)
    walk.uniform(coder, np.int64(0), np.int64(len(mesh.cell)), np.int64(start))
    walk._first_signs(mesh, st, coder, start)
    walk._visit(mesh, st, start)
    walk._walk(mesh, st, coder)
    code(coder, COMPONENT, np.int64(1))
    walk.uniform(coder, np.int64(start + 1), np.int64(len(mesh.cell)), np.int64(wrong))
    # who looks at neither goes on as if nothing began there
    code(coder, COMPONENT, np.int64(0))
    sign = st.sign.copy()
    queue = np.zeros(len(sign), np.int64)
    spread_signs(mesh, sign, queue)
    walk.code_parts(mesh, st, coder, sign, queue)
    return layers.file(Chunk(ChunkType.LAYERS, bytes([MeshLayer.SIGNS]) + run.end()))


def _file(head: DomainHead, n: int, run: bytes) -> bytes:
    """A file of a mesh that it holds, without layers."""
    header = write_header(Header((), VALUE, None, Profile.MAIN, cells=n))
    return bytes(File(header, (Chunk(ChunkType.DOMAIN, write_domain(head, n) + run),)))


SQUARE = np.array([[0, 0], [9, 1], [1, 8], [9, 9]], np.int64)
"""Points of the smallest meshes."""
EDGES = ((0, 1, 2), (2, 1, 3))
"""Two triangles of them."""


def coded(
    extent: tuple[int, int] = (10, 10), exponent: int = 0, multiple: int = 1, origin: tuple[int, int] = (0, 0)
) -> bytes:
    """A file with two triangles of a stated unit and place."""
    domain = complex_of(SQUARE, np.array(EDGES), 0)[0]
    run, _, _ = encoded_mesh(domain, extent, 1.0)
    return _file(DomainHead(DomainKind.CODED, 2, exponent, 4, 2, b"", multiple, origin, extent), 2, run)


def _heads() -> Wrong:
    """Heads of meshes with numbers that are out of range, and with what belongs there behind."""
    for name, about, data in (
        ("multiple_far", "a unit beyond 2**20", coded(multiple=(1 << 20) + 1)),
        ("exponent_far", "an exponent of 1101", coded(exponent=1101)),
        ("exponent_low", "an exponent of -1101", coded(exponent=-1101)),
        ("extent_far_0", "an extent beyond 2**24", coded(extent=((1 << 24) + 1, 10))),
        ("extent_far_1", "an extent beyond 2**24", coded(extent=(10, (1 << 24) + 1))),
        ("origin_far_0", "an origin beyond 2**40", coded(origin=((1 << 40) + 1, 0))),
        ("origin_far_1", "an origin beyond 2**40", coded(origin=(0, -(1 << 40) - 1))),
    ):
        yield name, "3.5.8", about, data
    known = DomainHead(DomainKind.KNOWN, 2, 0, 4, 2, bytes(16))
    box = DomainHead(DomainKind.CODED, 2, 0, 4, 2, b"", 1, (0, 0), (10, 10))
    solid = replace(box, d=3, origin=(0, 0, 0), extent=(10, 10, 10))
    surface = bytes([DomainKind.POINTS << 4]) + write_domain(solid, 3)[1:]
    for name, about, data in (
        ("few_vertices", "as many vertices as dimensions", _file(replace(known, vertices=2), 2, b"")),
        ("many_vertices", "2**31 vertices", _file(replace(known, vertices=1 << 31), 2, b"")),
        ("many_cells", "2**31 cells", _file(replace(known, cells=1 << 31), 2, b"")),
        ("short_head", "a head that ends within the extent", _payload(write_domain(box, 2)[:-1], 2)),
        ("points_in_space", "a surface of tetrahedra", _payload(surface, 3)),
    ):
        yield name, "3.5.8", about, data


def _payload(payload: bytes, n: int) -> bytes:
    header = write_header(Header((), VALUE, None, Profile.MAIN, cells=n))
    return bytes(File(header, (Chunk(ChunkType.DOMAIN, payload),)))


def _growing() -> Wrong:
    """Meshes in the file whose cells form no complex, or have more vertices than stated."""
    # the cells, and the cells across their faces, as the encoder is made to believe
    alone = [-1, -1, -1]
    for name, about, cells, across in (
        ("vertex_twice", "a cell with a vertex twice", [[0, 1, 2], [3, 3, 0]], [alone, alone]),
        ("face_closed", "a cell at a face on the border", [[0, 1, 2], [0, 1, 3]], [alone, alone]),
        (
            "face_of_three", "a third cell at a face", [[0, 1, 2], [3, 0, 1], [0, 1, 4]],
            [[-1, -1, 1], [0, -1, -1], alone],
        ),
        ("cell_twice", "two cells of the same vertices", [[0, 1, 2], [0, 1, 2]], [[1, -1, -1], [0, -1, -1]]),
    ):
        cell, neighbour = np.array(cells), np.array(across)
        vertices, extent = int(cell.max()) + 1, np.array([10, 10])
        points = np.concatenate([SQUARE, SQUARE[1:3] // 2])[:vertices]
        run = WritingRun(coder_of_meshes())
        run.room(256)
        origin = Original(
            points, cell, neighbour, np.full(vertices, -1), np.full(len(cell), -1), np.full(len(cell), -1)
        )
        g = whole_growth(vertices, len(cell), 3, extent)
        g.reg.most = run.left()
        code_mesh(g, origin, run.coder)
        head = DomainHead(DomainKind.CODED, 2, 0, vertices, len(cell), b"", 1, (0, 0), (10, 10))
        yield name, "10.10.2", about, _file(head, 2, run.end())


def _points(position: Integers, vertices: int, cells: int) -> bytes:
    """A file with points of a Delaunay triangulation, of which the head says that they are so many."""
    run = WritingRun(new_coder())
    run.room(4096)
    code_positions(run, (10, 10), vertices, position, len(position))
    return _file(DomainHead(DomainKind.DELAUNAY, 2, 0, vertices, cells, b"", 1, (0, 0), (10, 10)), 2, run.end())


def _delaunay() -> Wrong:
    """Points of which no triangulation of the stated size can be made."""
    line = np.array([[1, 1], [3, 3], [7, 7]])
    yield "line", "10.11", "points on a line", _points(line, 3, 1)
    yield "more_points", "10.11", "more points than stated", _points(SQUARE, 3, 2)
    yield "fewer_points", "10.11", "fewer points than stated", _points(SQUARE, 5, 2)
    yield "fewer_triangles", "10.11", "fewer triangles than stated", _points(SQUARE, 4, 3)


def refused() -> Iterator[Draft]:
    """Files that violate clauses 3.5.8 and 10."""
    larger, usual = written(plane(150, 400, 0)), written(plane())
    for prefix, group, text in (
        ("mesh", _orders, larger), ("mesh_layer", _numbers, usual), ("mesh_component", _components, usual),
        ("mesh_head", _heads, ""), ("mesh_coded", _growing, ""), ("mesh_delaunay", _delaunay, ""),
    ):
        for name, clause, about, data in group():
            n = 3 if name.endswith("space") else 2
            yield Draft(f"{prefix}_{name}", data, n, (EXPLICIT, f"error: {about}"), clause, mesh=text)


def early() -> Iterator[Draft]:
    """Files that end early, with something wrong that is found only behind their end."""
    mesh = plane()
    layers = Layers(mesh, VALUE)
    signs = layers.layer(layers.isovalue(VALUE), _HEADS["signs"], hills(mesh) > VALUE)
    data = layers.file(signs, Chunk(ChunkType.LAYERS, b"\x05" + bytes(8)))
    features = (EXPLICIT, "truncated", "an unknown kind of layer, whose chunk has not arrived")
    yield Draft("mesh_truncated_kind", data[:-8], 2, features, mesh=written(mesh))


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    yield from refused()
    yield from early()
    features = (EXPLICIT, "unit, origin and extent as large as they may be")
    yield Draft("mesh_coded_largest", coded(((1 << 24), 1 << 24), 1100, 1 << 20, (1 << 40, -(1 << 40))), 2, features)
    yield Draft("mesh_coded_least", coded(exponent=-1100), 2, (EXPLICIT, "the least exponent"))
