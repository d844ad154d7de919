"""Vectors of isovalues on explicit domains (clause 10): known meshes, meshes in the file, levels, frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec.drawing.explicit import crossed_edges
from isocodec.errors import FormatError
from isocodec.field.meshed import StoredName
from isocodec.field.samples import Samples
from isocodec.mesh.complex import complex_of
from isocodec.mesh.cut import CellHistory
from isocodec.search.mesh_cuts import KeptCut
from isocodec.stream.cut_plan import Cut
from isocodec.stream.encoder import encoder_of
from isocodec.stream.mesh_encoder import Cuts, MeshEncoder
from isocodec.tin.delaunay import triangulate
from isospec.container import ChunkType, read_varint, write_varint

from .draft import Draft
from .explicit_dump import Mesh, written
from .fields import Integers, random_numbers
from .streams import Chunk, File, bare, split

EXPLICIT = "explicit domain"
VALUE = 100.5
VALUES = (VALUE, 140.5, 60.5)
CLOSE = (VALUE, 97.75, 94.3125, 103.0)
"""Isovalues whose curves cross many edges in common."""


def plane(count: int = 36, side: int = 64, left_out: int = 6) -> Mesh:
    """Delaunay triangles of random points, one of ``left_out`` of them left out: borders, holes, lone vertices."""
    numbers = np.array(random_numbers(5, 2 * count, 16)).reshape(-1, 2) % side
    points = np.unique(numbers, axis=0)
    cells = triangulate(points)
    kept = [t for t, number in enumerate(random_numbers(6, len(cells), 16)) if not left_out or number % left_out]
    return points, cells[kept]


def tetrahedra(side: int = 4) -> Mesh:
    """Cubes cut into six, in two pieces that have nothing in common, with a lone vertex."""
    points: list[list[int]] = []
    cells: list[list[int]] = []
    place: dict[tuple[int, ...], int] = {}
    for p in product(range(side), repeat=3):
        place[p] = len(points)
        points.append([3 * c + (7 * p[0] + 5 * p[1] + 3 * p[2]) % 2 for c in p])
    for p in product(range(side - 1), repeat=3):
        if p[0] == 1:
            continue
        for order in permutations(range(3)):
            corner = list(p)
            cell = [place[p]]
            for axis in order:
                corner[axis] += 1
                cell.append(place[tuple(corner)])
            cells.append(cell)
    return np.array(points, np.int64), np.array(cells, np.int64)


def ring(around: int = 7, across: int = 4) -> Mesh:
    """Triangles of a ring with a handle in space: a surface without a border."""
    wide = [(10, 0), (7, 7), (0, 10), (-7, 7), (-10, 0), (-7, -7), (3, -9)]
    high = [(6, 0), (4, 2), (2, 0), (4, -2)]
    points = [[wide[i][0] * high[j][0], wide[i][1] * high[j][0], 10 * high[j][1]] for i in range(around)
              for j in range(across)]
    cells = []
    for i, j in product(range(around), range(across)):
        a, b = i * across + j, (i + 1) % around * across + j
        c, d = i * across + (j + 1) % across, (i + 1) % around * across + (j + 1) % across
        cells += [[a, b, d], [a, d, c]]
    return np.array(points, np.int64), np.array(cells, np.int64)


def larger_ring(times: int = 2) -> Mesh:
    """A ring of more triangles with a hole, so that the surface has a border; bent, and dented."""
    points, cells = ring()
    for _ in range(times):
        points, cells = _halved(2 * points, cells)
    dents = np.array(random_numbers(41, points.size, 16)).reshape(points.shape) % 9
    return points + dents, cells[: -len(cells) // 8]


def _halved(points: Integers, cells: NDArray[np.int64]) -> Mesh:
    """Triangles cut into four at the middles of their sides."""
    sides = np.sort(cells[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    found, number = np.unique(sides, axis=0, return_inverse=True)
    middle = len(points) + number.reshape(-1, 3)
    a, b, c = cells.T
    d, e, f = middle.T
    four = np.concatenate([np.stack(part, axis=1) for part in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])
    return np.concatenate([points, points[found].sum(axis=1) // 2]), four


def far_apart() -> Mesh:
    """Tetrahedra across so many units that their determinants go far beyond 64 bits."""
    points, cells = tetrahedra(6)
    return points * 500_009, cells


MESHES: dict[str, Callable[[], Mesh]] = {"plane": plane, "space": tetrahedra, "surface": ring}


def hills(mesh: Mesh, step: int = 0, rough: int = 30) -> Integers:
    """Values at the vertices: slopes that meet, moved by ``step``, with some noise."""
    points = mesh[0]
    along = 9 * points[:, 0] + 5 * points[:, 1] + (4 * points[:, 2] if points.shape[1] == 3 else 0) + 17 * step
    noise = np.array(random_numbers(11 + step, len(points), 16), np.int64) % rough
    return np.abs((along - along.min()) % 400 - 200) + noise


def _draft(
    name: str, mesh: Mesh, values: NDArray[Any], isovalue: float | tuple[float, ...], *features: str,
    kind: StoredName = "known", states: bool = False, mesh_error: float | None = None, progressive: bool | None = None,
    scattered: bool = False, **options: Any,
) -> Draft:
    """A vector as the reference encoder writes it; ``scattered``: of the points without the cells."""
    cells = None if scattered else mesh[1]
    data = isocodec.encode(
        isocodec.Mesh(mesh[0], cells, values, stored=kind, error=mesh_error, progressive=progressive), isovalue,
        **{"interval": 0, **options},
    )
    data = bare(data) if isinstance(options.get("precision"), float) else data
    n = mesh[1].shape[1] - 1
    return Draft(name, data, n, (EXPLICIT, *features), None, states, written(mesh) if kind == "known" else "")


def whole() -> Iterator[Draft]:
    """As the reference encoder's options give them."""
    for kind, make in MESHES.items():
        mesh = make()
        values = hills(mesh)
        for name, options in (
            ("signs", {"precision": "signs"}), ("values", {"precision": "exact"}), ("offsets", {"precision": 0.5}),
            ("fine_offsets", {"precision": 0.001}),
        ):
            yield _draft(
                f"mesh_{kind}_levels_{name}", mesh, values, VALUE, "levels", name, states=name == "values",
                progressive=True, **options,
            )
            yield _draft(
                f"mesh_{kind}_{name}", mesh, values, VALUE, name, states=name == "offsets", progressive=False,
                **options,
            )
        yield _draft(
            f"mesh_{kind}_isovalues", mesh, values, VALUES, "several isovalues", precision="exact", progressive=False,
            states=True,
        )
        yield _draft(
            f"mesh_{kind}_independent", mesh, values, VALUES, "isovalues that lean on none", order="independent",
            precision="signs", progressive=False,
        )
        noise = np.array(random_numbers(23, len(mesh[0]), 8), np.int64)
        yield _draft(f"mesh_{kind}_noise", mesh, noise, 128.5, "noise", precision="exact", progressive=False)
        yield _draft(
            f"mesh_{kind}_step", mesh, values / 8, 12.4, "values in steps", precision="step=0.25", progressive=False,
        )
        for name, precision in (("step", "step=0.75"), ("offsets", 0.2)):
            yield _draft(
                f"mesh_{kind}_isovalues_{name}", mesh, values * 1.0, CLOSE, "several isovalues", name,
                precision=precision, progressive=False, states=True,
            )
        yield _draft(f"mesh_{kind}_empty", mesh, values, 1e6, "no curve", progressive=False)
        yield _draft(f"mesh_{kind}_above", mesh, values, -1e6, "no curve", "all above", progressive=False)
        yield _parts(kind, mesh, values)
        yield _draft(
            f"mesh_{kind}_coded", mesh, values, VALUE, "the mesh in the file, as far as it is crossed", kind="coded",
            precision="exact", mesh_error=0.3,
        )
        yield _draft(
            f"mesh_{kind}_whole", mesh, values, VALUES, "the whole mesh in the file", kind="whole", precision="signs",
            mesh_error=0.3,
        )
        yield _draft(
            f"mesh_{kind}_levels_whole", mesh, values, VALUES, "the whole mesh in the file", "levels", kind="whole",
            precision="signs", mesh_error=0.3, progressive=True,
        )
        yield from _frames(kind, mesh)
    mesh = plane(60, 200, 0)
    for name, precision in (("signs", "signs"), ("values", "exact")):
        yield _draft(
            f"mesh_plane_delaunay_{name}", mesh, hills(mesh), VALUE, "points in the file, Delaunay triangulation",
            kind="whole", scattered=True, mesh_error=0.71, precision=precision,
        )
    dents = np.array(random_numbers(29, mesh[0].size, 8), np.int64).reshape(mesh[0].shape)
    yield _draft(
        "mesh_plane_wide", (800 * mesh[0] + dents, mesh[1]), hills(mesh), VALUE, "the whole mesh in the file",
        "sides of triangles beyond 2**13", kind="whole", mesh_error=0.71, precision="signs", progressive=False,
    )
    yield from _scattered()
    for kind, mesh in {
        "plane": plane(150, 400, 0), "space": tetrahedra(7), "surface": larger_ring(),
    }.items():
        yield from _many_rounds(kind, mesh)
    for kind, mesh in {"plane": plane(110, 400, 9), "space": tetrahedra(5), "surface": larger_ring(1)}.items():
        yield from _cuts(kind, mesh)
        yield _draft(
            f"mesh_{kind}_cut_whole_steps", mesh, hills(mesh), VALUES[:2], "cuts", "the whole mesh in the file",
            "distances and topology that layers keep", kind="whole", states=True, precision=[60.0, 20.0, 5.0],
            keep_topology=True, mesh_error=0.3,
        )
    for kind, mesh in {"plane": plane(150, 400, 9), "space": tetrahedra(6)}.items():
        yield _random_runs(kind, mesh)
    mesh = far_apart()
    yield _draft(
        "mesh_far_levels", mesh, hills(tetrahedra(6), 0, 5), VALUE, "the whole mesh in the file", "levels",
        "determinants beyond 64 bits", kind="whole", mesh_error=0.6, precision="signs", states=True, progressive=True,
    )


def _parts(kind: str, mesh: Mesh, values: Integers) -> Draft:
    """Four copies of a mesh beside one another, of which a curve crosses the second alone."""
    points, cells = mesh
    apart = np.zeros(points.shape[1], np.int64)
    apart[0] = 2 * int(np.ptp(points[:, 0])) + 1
    copies = np.concatenate([points + i * apart for i in range(4)]), np.concatenate(
        [cells + i * len(points) for i in range(4)]
    )
    given = np.concatenate([values + 10_000, values, values - 10_000, values + 10_000])
    return _draft(
        f"mesh_{kind}_parts", copies, given, (VALUE, VALUE + 40), "parts of the mesh that no curve enters",
        precision="exact", progressive=False, states=True,
    )


def _many_rounds(kind: str, mesh: Mesh) -> Iterator[Draft]:
    """Many rounds, and candidates for new components."""
    salt = np.array([int(number % 9 == 0) for number in random_numbers(31, len(mesh[0]), 16)])
    for name, values, isovalues in (
        ("hills", hills(mesh, 0, 5), (VALUE,)), ("isovalues", hills(mesh), VALUES), ("salt", salt, (0.5,)),
    ):
        yield _draft(
            f"mesh_{kind}_levels_many_{name}", mesh, values, isovalues, "levels", "many rounds", precision="signs",
            states=True, progressive=True,
        )


def with_cuts(mesh: isocodec.Mesh, isovalue: float | tuple[float, ...], cuts: Cuts, **options: Any) -> bytes:
    """A file with isovalues on cuts of a mesh."""
    found = encoder_of(mesh, isovalue, **options)
    assert isinstance(found, MeshEncoder)
    found.frames.cuts = cuts
    return b"".join(found)


def nodes(history: CellHistory, *shares: int, seed: int = 51) -> list[NDArray[np.bool_]]:
    """Cuts, each with one node of so many, and all that they need."""
    count = len(history.vertex)
    return [
        history.closure(np.array(random_numbers(seed + i, count, 16)) % share == 0) for i, share in enumerate(shares)
    ]


def some_nodes(*shares: int) -> Cuts:
    """Layers of cuts with some nodes."""
    return lambda history, field: nodes(history, *shares)


def with_offsets_between(history: CellHistory, field: Samples) -> Sequence[Cut]:
    """Layers of a cut, of which the first two have offsets, and the last one has other geometry."""
    first, second, third = nodes(history, 30, 9, 3)
    real = history.cell[(history.cell < len(field.signs)).all(axis=1)]
    edges = crossed_edges(real, field.signs)
    curve = np.zeros((0, 2)), np.zeros((0, 2), np.int64)
    return [*(KeptCut(inside, 700, edges, np.full(len(edges), 0.25), curve) for inside in (first, second)), third]


def first_isovalue(history: CellHistory, field: Samples) -> Sequence[Cut]:
    """A cut for one isovalue alone."""
    return nodes(history, 4) if field.isovalue == VALUE else []


def other_nodes(history: CellHistory, field: Samples) -> Sequence[Cut]:
    """Other nodes for each frame, and for some none."""
    number = int(field.values.sum()) % 5
    return nodes(history, 7, 3, seed=51 + number) if number else []


def _cuts(kind: str, mesh: Mesh) -> Iterator[Draft]:
    """Isovalues on cuts of a mesh."""
    values, salt = hills(mesh, 0, 5), np.array([int(n % 9 == 0) for n in random_numbers(31, len(mesh[0]), 16)])
    frames = np.array([hills(mesh, step, 9) for step in range(4)])
    kinds: tuple[tuple[str, NDArray[Any], float | tuple[float, ...], Cuts, dict[str, Any]], ...] = (
        ("signs", values, VALUE, some_nodes(3), {"precision": "signs"}),
        ("offsets", values, VALUE, some_nodes(5), {"precision": 0.5}),
        ("values", values, VALUE, some_nodes(5), {"precision": "exact"}),
        ("layers", hills(mesh), VALUE, some_nodes(40, 8, 2), {"precision": 2.0}),
        ("all", hills(mesh), VALUE, some_nodes(1), {"precision": "signs"}),
        ("new", salt, 0.5, some_nodes(12, 3), {"precision": "signs"}),
        ("isovalues", hills(mesh), VALUES, some_nodes(9, 3), {"precision": "exact"}),
        ("isovalues_step", hills(mesh) * 1.0, CLOSE, some_nodes(9, 3), {"precision": "step=0.75"}),
        ("isovalues_offsets", hills(mesh), CLOSE, some_nodes(9, 3), {"precision": 0.2}),
        ("then_levels", hills(mesh), VALUES, first_isovalue, {"precision": "exact", "progressive": True}),
        ("then_signs", hills(mesh), VALUES, first_isovalue, {"precision": "signs", "progressive": False}),
        ("frames", frames, VALUES[:2], other_nodes, {"precision": 0.5, "interval": 3}),
        ("frames_values", frames, VALUE, other_nodes, {"precision": "exact", "interval": 0}),
        ("empty", values, 1e6, some_nodes(3), {"precision": "exact"}),
        ("geometry", values, VALUE, with_offsets_between, {"precision": "exact"}),
    )
    for name, field, isovalue, cuts, options in kinds:
        progressive = options.pop("progressive", None)
        data = with_cuts(isocodec.Mesh(*mesh, field, progressive=progressive), isovalue, cuts, **options)
        data = bare(data) if isinstance(options["precision"], float) else data
        yield Draft(
            f"mesh_{kind}_cut_{name}", data, mesh[1].shape[1] - 1, (EXPLICIT, "cuts", name), None,
            name in ("signs", "new", "layers", "frames"), written(mesh),
        )


def _random_runs(kind: str, mesh: Mesh) -> Draft:
    """Cuts that no encoder asks for: what runs of random bytes hold, each as long as it takes."""
    file = split(with_cuts(isocodec.Mesh(*mesh, hills(mesh)), VALUE, some_nodes(5), precision="signs"))
    chunks = file.chunks[:1]
    for seed in (61, 62):
        noise = b"\x04" + bytes(number >> 8 for number in random_numbers(seed, 400, 16))
        every = [(*chunks, replace(file.chunks[1], payload=noise[:size])) for size in range(1, len(noise))]
        chunks = next(each for each in reversed(every) if _decodes(bytes(file.with_chunks(*each)), mesh))
    features = (EXPLICIT, "cuts", "random runs")
    data = bytes(file.with_chunks(*chunks))
    return Draft(f"mesh_{kind}_cut_random", data, mesh[1].shape[1] - 1, features, None, True, written(mesh))


def _decodes(data: bytes, mesh: Mesh) -> bool:
    """Whether a file has no error."""
    try:
        isocodec.decode(data, mesh=mesh)
    except FormatError:
        return False
    return True


def lattice() -> tuple[Mesh, Integers]:
    """Points with four on each circle, and a hill far from where they begin."""
    points = np.array([[3 * x - 40, 3 * y + 70] for x in range(11) for y in range(9)], np.int64)
    off = points - np.array([-17, 85])
    return (points, triangulate(points - points.min(axis=0))), 150 - np.abs(off).sum(axis=1) * 4


def _scattered() -> Iterator[Draft]:
    """Scattered points of which only those next to contours are in the file, in a box of all of them."""
    mesh, values = lattice()
    about = "points next to the contour alone"
    kinds: tuple[tuple[str, StoredName], ...] = (("needed", "delaunay"), ("all", "whole"))
    for name, kind in kinds:
        yield _draft(
            f"mesh_plane_delaunay_{name}_ties", mesh, values, VALUE, about if name == "needed" else "all points",
            kind=kind, scattered=True, states=True, precision="exact",
        )
    mesh = plane(150, 400, 0)
    yield _draft(
        "mesh_plane_delaunay_needed_isovalues", mesh, hills(mesh, 0, 5), VALUES, about, kind="delaunay", scattered=True,
        precision=0.5,
    )
    frames = np.array([hills(mesh, step, 5) for step in range(3)])
    yield _draft(
        "mesh_plane_delaunay_needed_frames", mesh, frames, VALUE, about, "series of frames", kind="delaunay",
        scattered=True, precision="signs",
    )


def _frames(kind: str, mesh: Mesh) -> Iterator[Draft]:
    """Series."""
    frames = np.array([hills(mesh, step) for step in range(4)])
    for name, options in (
        ("signs", {"precision": "signs"}), (
            "values", {"precision": "exact", "interval": 2},
        ), ("offsets", {"precision": 0.5}),
        ("step", {"precision": "step=3.0"}),
    ):
        values = frames * 1.0 if name == "step" else frames
        for progressive in (False, True):
            yield _draft(
                f"mesh_{kind}_frames_{'levels_' * progressive}{name}", mesh, values, VALUES[:2], "series of frames",
                name, progressive=progressive, **options,
            )
    yield _draft(
        f"mesh_{kind}_frames_independent", mesh, frames, VALUES[:2], "series of frames", "frames that lean on none",
        order="independent", precision="exact", progressive=False,
    )
    gaps = frames.copy()
    gaps[1] = 0
    yield _draft(
        f"mesh_{kind}_frames_empty", mesh, gaps, VALUE, "series of frames", "a frame without a curve",
        progressive=False, precision=0.5,
    )


def elsewhere() -> Iterator[Draft]:
    """Files without the mesh that they were made on, and with another one beside them (clause 10.1.2(1))."""
    mesh = plane(12, 20, 0)
    moved = mesh[0].copy()
    moved[0, 0] += 1
    about = "the mesh that the file was made on"
    whole = _draft("", mesh, hills(mesh), VALUE, precision="signs", progressive=False)
    for name, what, beside in (
        ("missing", "is missing", ""), ("moved", "has a vertex elsewhere", written((moved, mesh[1]))),
        ("smaller", "has a cell more", written((mesh[0], mesh[1][1:]))),
    ):
        yield replace(whole, name=f"mesh_{name}", features=(EXPLICIT, f"{about} {what}"), mesh=beside)


def parts() -> Iterator[Draft]:
    """Files that end early."""
    mesh = plane()
    data = isocodec.encode(isocodec.Mesh(*mesh, hills(mesh)), VALUES[:2], precision="exact")
    file = split(data)
    places, at = [], len(file.header)
    for chunk in file.chunks:
        places.append(at)
        at += len(chunk.enveloped())
    for name, size in (
        ("header", 6), ("domain", places[0] + 5), ("layer", places[2] + 2), ("geometry", places[-1] + 3),
        ("checksum", len(data) - 2),
    ):
        yield Draft(f"mesh_truncated_{name}", data[:size], 2, (EXPLICIT, "truncated"), mesh=written(mesh))
    coded = isocodec.encode(isocodec.Mesh(*mesh, hills(mesh), stored="coded", error=0.3), VALUE)
    yield Draft("mesh_truncated_mesh", coded[:30], 2, (EXPLICIT, "truncated"))


def _changed(file: File, number: int, payload: bytes) -> bytes:
    chunks = tuple(replace(c, payload=payload) if i == number else c for i, c in enumerate(file.chunks))
    return bytes(file.with_chunks(*chunks))


def _wrong_chunks() -> Iterator[tuple[str, str, str, bytes]]:
    """Names, clauses, what is wrong and files: chunks and layers."""
    mesh = plane()
    known = split(isocodec.encode(isocodec.Mesh(*mesh, hills(mesh), progressive=False), VALUE, precision="exact"))
    larger = plane(150, 400, 0)
    levels = split(isocodec.encode(isocodec.Mesh(*larger, hills(larger), progressive=True), VALUE, precision="signs"))
    domain, signs, values = (chunk.payload for chunk in known.chunks)
    first, second, _ = known.chunks

    def payload(number: int, found: bytes) -> bytes:
        return _changed(known, number, found)

    yield "domain_empty", "3.5.8", "an empty domain", payload(0, b"")
    yield "domain_short", "3.5.8", "a hash that is too short", payload(0, domain[:-1])
    yield "domain_long", "3.5.8", "a hash that is too long", payload(0, domain + b"\0")
    yield "domain_kind", "3.5.8", "an unknown kind of domain", payload(0, bytes([0x40]) + domain[1:])
    yield "domain_dimension", "3.5.8", "more coordinates than 3", payload(0, b"\2" + domain[1:])
    yield "domain_exponent", "3.5.8", "a unit beyond all coordinates", payload(0, _varint_changed(domain, 0, 2202))
    yield "domain_no_cells", "3.5.8", "no cells", payload(0, _varint_changed(domain, 2, 0))
    yield "domain_twice", "3.5.8", "a second domain", bytes(known.with_chunks(first, first, second))
    yield "domain_late", "3.5.8", "layers before the domain", bytes(known.with_chunks(second, first))
    masked = known.with_chunks(*known.chunks, Chunk(ChunkType.MASK, b"\1"))
    yield "mask", "10.1.1", "a mask", bytes(masked)
    yield "layer_kind", "10.1.3", "an unknown kind of layer", payload(1, b"\x05" + signs[1:])
    yield "layer_empty", "10.1.3", "an empty layer", payload(1, b"")
    yield "layer_bits", "10.1.3", "more bits than 52", payload(2, values[:1] + b"\x35" + values[2:])
    yield "step_zero", "10.1.3", "a step of 0", payload(2, b"\1\0")
    again = levels.with_chunks(*levels.chunks[:2], levels.chunks[1])
    yield "levels_rise", "10.1.3", "as many rounds again", bytes(again)
    many = b"\x03\x7f" + levels.chunks[1].payload[2:]
    yield "levels_many", "10.1.3", "more rounds than there are", _changed(levels, 1, many)
    # a unit of 2**-24: positions of 31 bits
    fine = levels.chunks[0].payload
    fine = _varint_changed(fine, 0, 47)[:-16] + complex_of(*larger, -24)[0].digest
    yield "levels_far", "10.8.1", "levels of a mesh too large for its unit", _changed(levels, 0, fine)
    yield from _wrong_cuts(larger)
    yield "run_short", "6.3", "a run that is too short", payload(1, signs[:2])
    yield "run_long", "6.3", "bytes left over", payload(1, signs + bytes(5))
    late = Chunk(ChunkType.SERIES, b"\0")
    yield "frames_late", "3.5.7", "a series behind layers", bytes(known.with_chunks(first, second, late))
    frame = Chunk(ChunkType.FRAME, b"")
    yield "frames_no_series", "3.5.7", "a frame without a series", bytes(known.with_chunks(first, second, frame))
    other = Chunk(ChunkType.ISOVALUE, b"\0\1")
    yield (
        "frames_late_isovalue", "3.5.7", "a series behind layers and another isovalue",
        bytes(known.with_chunks(first, second, other, late)),
    )


def _wrong_cuts(mesh: Mesh) -> Iterator[tuple[str, str, str, bytes]]:
    """The same: layers of cuts."""
    given = isocodec.Mesh(*mesh, hills(mesh), progressive=False)
    cut = split(with_cuts(given, VALUE, some_nodes(5), precision="exact"))
    first, layer, _ = cut.chunks
    fine = _varint_changed(first.payload, 0, 47)[:-16] + complex_of(*mesh, -24)[0].digest
    yield "cuts_far", "10.8.1", "a cut of a mesh too large for its unit", _changed(cut, 0, fine)
    yield "cuts_long", "6.3", "bytes left over", _changed(cut, 1, layer.payload + bytes(5))


def _wrong_meshes() -> Iterator[tuple[str, str, str, bytes]]:
    """The same: meshes in the file."""
    mesh = plane()
    coded = split(
        isocodec.encode(isocodec.Mesh(*mesh, hills(mesh), stored="coded", error=0.3), VALUE, precision="signs")
    )
    scattered = isocodec.Mesh(mesh[0], None, hills(mesh), stored="whole", error=0.71)
    points = split(isocodec.encode(scattered, VALUE, precision="signs"))
    solid = split(isocodec.encode(isocodec.Mesh(*tetrahedra(), hills(tetrahedra())), VALUE, precision="signs"))
    inside, at = coded.chunks[0].payload, points.chunks[0].payload

    def number(place: int, value: int) -> bytes:
        return _changed(coded, 0, _varint_changed(inside, place, value))

    def of_points(place: int, value: int) -> bytes:
        return _changed(points, 0, _varint_changed(at, place, value))

    yield "coded_multiple", "3.5.8", "a unit of 0", number(3, 0)
    yield "coded_extent", "3.5.8", "an extent of 0", number(6, 0)
    yield "coded_numbers", "3.5.8", "more cells than bytes can tell", number(2, 1 << 20)
    yield "coded_more_vertices", "10.10.1", "more vertices than stated", number(1, 5)
    yield "coded_fewer_vertices", "10.10.1", "fewer vertices than stated", number(1, 99)
    yield "coded_long", "6.3", "bytes left over", _changed(coded, 0, inside + bytes(5))
    yield "delaunay_triangles", "10.11", "another number of triangles", of_points(2, 30)
    yield "delaunay_space", "3.5.8", "Delaunay triangles of tetrahedra", _changed(solid, 0, at)
    yield "delaunay_long", "6.3", "bytes left over", _changed(points, 0, at + bytes(5))


def refused() -> Iterator[Draft]:
    """Files that violate clauses 3.5.7, 3.5.8 and 10."""
    for name, clause, about, data in (*_wrong_chunks(), *_wrong_meshes()):
        space = name.endswith("space")
        in_file = name.startswith(("coded", "delaunay")) and not space
        larger = name.startswith(("levels", "cuts"))
        text = written(tetrahedra() if space else plane(150, 400, 0) if larger else plane())
        text = "" if in_file else text
        yield Draft(f"mesh_{name}", data, 3 if space else 2, (EXPLICIT, f"error: {about}"), clause, mesh=text)


def _varint_changed(payload: bytes, number: int, value: int) -> bytes:
    """A payload with another number: 0 the exponent, 1 vertices, 2 cells, 3 the multiple, 4, 5 origin, 6, 7 extent."""
    at = 1
    for _ in range(number):
        found = read_varint(payload, at, len(payload))
        assert found is not None
        at = found[1]
    found = read_varint(payload, at, len(payload))
    assert found is not None
    return payload[:at] + write_varint(value) + payload[found[1] :]


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (whole, elsewhere, parts, refused):
        yield from group()
