"""Tables of the regular binary multi-triangulation, generated from Maubach's rule (spec clauses 4.1 to 4.5).

Everything is written for any dimension n. Uniform level ``l`` has cubes of edge ``c = 2**(k - l // n)``;
lengths are given in units of ``g = c / 2``, and the pattern of the mesh repeats with period ``4 g``. A simplex
is a *block* (the index of its period cell, n integers) and a *class* (its number within the block), so that the
position of its vertex j is ``(4 * block + vertex[r, class, j]) * c >> 1`` with ``r = l % n``.

Coordinates are padded with zeros to three axes, so that one set of kernels serves n = 2 and n = 3.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations, product
from operator import add

import numpy as np
from numpy.typing import NDArray

Point = tuple[int, ...]
Simplex = tuple[Point, ...]

AXES = 3
"""Axes that the kernels carry; n = 2 leaves the last one at zero."""
PAGE_SHIFT = {2: 5, 3: 3}
"""Log2 of the edge of the pages that vertices are kept in (``lattice.store``), by dimension."""


MOST_CLASSES = 192
MOST_CORNERS = 10
MOST_MEMBERS = 8
MOST_KINDS = 56

# Where each table starts in the flat array; sizes are those of n = 3, so that one layout serves both dimensions.
# r is the level mod n, q a class, i a face or corner, j a vertex, a an axis, s a side, d a diamond kind, m a member.
_SIZES = {
    "DIMENSION": 1,
    "ROOT": 7,  # number of root simplices, then their classes
    "VERTEX": AXES * MOST_CLASSES * 12,  # [r, q, j, a] vertices in units of g, relative to the block
    "MIDDLE": AXES * MOST_CLASSES * 3,  # [r, q, a] middle of the subdivision edge, in the same way
    "CHILD": AXES * MOST_CLASSES * 8,  # [r, q, s] class, then block = block * (2 if r == n - 1 else 1) + delta
    "NEIGHBOUR": AXES * MOST_CLASSES * 20,  # [r, q, i] class, opposite vertex there, block delta
    "CUBE": AXES * MOST_CLASSES * 4,  # [r, q] number within its cube, then the cube's parity in the block
    "KIND": AXES * 64,  # [r, residues mod 4] diamond kind of a middle, or -1
    "CORNERS": MOST_KINDS,  # [d] number of corners; 0 and 1 are the ends of the subdivision edge
    "CORNER": MOST_KINDS * MOST_CORNERS * 3,  # [d, i, a] in units of g, relative to the block of the middle
    "DELTA": MOST_KINDS * MOST_CORNERS,  # [d, i] distance of its cell in a page behind the middle's, in units of g
    "MEMBERS": MOST_KINDS,  # [d] number of simplices in the diamond
    "MEMBER": MOST_KINDS * MOST_MEMBERS * 5,  # [d, m] class and block delta of a member, the bits of its corners
    "GRANDCHILD": MOST_KINDS * MOST_MEMBERS * 10,  # [d, m, s] the same for its children (block as in CHILD)
    "FACTOR": MOST_KINDS,  # [d] factor of the block of a member for its children
    "BITS": MOST_KINDS * MOST_MEMBERS * 2,  # [d, m, s] bits of a child's corners, as in GRANDCHILD
    "PLACE": MOST_KINDS * MOST_MEMBERS * 8,  # [d, m, s, j] corner that vertex j of a child is
    "BELOW": MOST_KINDS * MOST_MEMBERS * 6,  # [d, m, s, a] middle of a child in units of its g, relative to the block
    "TWIN": MOST_KINDS * MOST_MEMBERS * 2,  # [d, m, s] bits of the children before it that have its middle
}
START = {name: sum(list(_SIZES.values())[:i]) for i, name in enumerate(_SIZES)}


def cube_exponent(shape: tuple[int, ...]) -> int:
    """Exponent k of the root cube: the smallest power of two that covers the longest axis (spec clause 4.1)."""
    return max(max(shape) - 2, 0).bit_length()


def _add(a: Point, b: Point) -> Point:
    return tuple(map(add, a, b))


def _scaled(a: Point, factor: int) -> Point:
    return tuple([x * factor for x in a])


def _moved(s: Simplex, by: Point) -> Simplex:
    return tuple([tuple(map(add, v, by)) for v in s])


def _middle(s: Simplex, tag: int) -> Point:
    return tuple((x + y) // 2 for x, y in zip(s[0], s[tag], strict=True))


def bisect(s: Simplex, tag: int) -> tuple[Simplex, Simplex]:
    """Maubach's rule: the two children of simplex ``s`` with tag ``tag`` (spec clause 4.2)."""
    z = _middle(s, tag)
    return s[:tag] + (z,) + s[tag + 1 :], s[1 : tag + 1] + (z,) + s[tag + 1 :]


def kuhn(n: int, parity: Point, order: Point) -> Simplex:
    """Path simplex of a cube of the period block: from the corner at multiples of 4 to the one at 2 (clause 4.1)."""
    point = [4 * p for p in parity]
    path = [tuple(point)]
    for axis in order:
        point[axis] = 2
        path.append(tuple(point))
    return tuple(path)


def _home(s: Simplex) -> tuple[Point, Simplex]:
    """Block of a simplex and the simplex relative to it: the block holds the barycentre."""
    n = len(s) - 1
    block = tuple([sum(axis) // (4 * (n + 1)) for axis in zip(*s, strict=True)])
    return block, _moved(s, _scaled(block, -4))


def _at_home(face: Simplex) -> tuple[Point, frozenset[Point]]:
    """Block of the least coordinates of a face, and the face moved from there to block 0."""
    block = tuple([min(axis) // 4 for axis in zip(*face, strict=True)])
    return block, frozenset(_moved(face, _scaled(block, -4)))


def _classes(n: int) -> list[list[Simplex]]:
    """Simplices of one period block for each level mod n, in the order of their generation."""
    levels = [[kuhn(n, p, o) for p in product((0, 1), repeat=n) for o in permutations(range(n))]]
    for r in range(1, n):
        levels.append([c for s in levels[-1] for c in bisect(s, n - r + 1)])
    return levels


def _pad(p: Point) -> list[int]:
    return list(p) + [0] * (AXES - len(p))


class _Builder:
    """Looks simplices up by their vertices, whatever block they are in."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.classes = _classes(n)
        self.number = [{s: q for q, s in enumerate(level)} for level in self.classes]

    def find(self, r: int, s: Simplex) -> tuple[int, Point]:
        block, rel = _home(s)
        return self.number[r][rel], block

    def child(self, r: int, q: int, side: int, shift: Point) -> tuple[int, Point]:
        """Class and block delta of a child; the units halve when a cycle of n levels is complete."""
        c = bisect(_moved(self.classes[r][q], _scaled(shift, 4)), self.n - r)[side]
        if r == self.n - 1:
            c = tuple([_scaled(v, 2) for v in c])
        return self.find((r + 1) % self.n, c)

    def around(self, r: int) -> dict[frozenset[Point], list[tuple[int, Point]]]:
        """Both simplices at each face, by the face moved to block 0; with each the block that it then has."""
        faces: dict[frozenset[Point], list[tuple[int, Point]]] = {}
        for q, s in enumerate(self.classes[r]):
            for i in range(self.n + 1):
                block, face = _at_home(s[:i] + s[i + 1 :])
                faces.setdefault(face, []).append((q, _scaled(block, -1)))
        return faces

    def diamonds(self, r: int) -> dict[Point, list[tuple[int, Point]]]:
        """Simplices around each middle of block 0 (residues mod 4)."""
        out: dict[Point, list[tuple[int, Point]]] = {}
        for q, s in enumerate(self.classes[r]):
            w = _middle(s, self.n - r)
            shift = tuple(-(x // 4) for x in w)
            out.setdefault(_add(w, _scaled(shift, 4)), []).append((q, shift))
        return out


def _barycentre(s: Simplex) -> Point:
    return tuple(map(sum, zip(*s, strict=True)))


@cache
def mesh_tables(n: int) -> NDArray[np.int16]:
    """The tables of dimension ``n`` (2 or 3) in one flat array; ``lattice.access`` reads them."""
    b = _Builder(n)
    flat = np.zeros(sum(_SIZES.values()), np.int16)

    def table(name: str, *shape: int) -> NDArray[np.int16]:
        return flat[START[name] : START[name] + _SIZES[name]].reshape(shape)

    vertex = table("VERTEX", AXES, MOST_CLASSES, 4, 3)
    middle = table("MIDDLE", AXES, MOST_CLASSES, 3)
    child = table("CHILD", AXES, MOST_CLASSES, 2, 4)
    neighbour = table("NEIGHBOUR", AXES, MOST_CLASSES, 4, 5)
    cube = table("CUBE", AXES, MOST_CLASSES, 4)
    kind = table("KIND", AXES, 64)
    kind[:] = -1
    origin = (0,) * n
    diamonds: list[tuple[int, Point, list[tuple[int, Point]]]] = []
    for r in range(n):
        faces = b.around(r)
        for q, s in enumerate(b.classes[r]):
            vertex[r, q, : n + 1] = [_pad(v) for v in s]
            middle[r, q] = _pad(_middle(s, n - r))
            for side in (0, 1):
                cls, delta = b.child(r, q, side, origin)
                child[r, q, side] = [cls, *_pad(delta)]
            for i in range(n + 1):
                face = s[:i] + s[i + 1 :]
                block, moved = _at_home(face)
                this = q, _scaled(block, -1)
                cls, home = next(x for x in faces[moved] if x != this)
                shift = _add(home, block)
                other = _moved(b.classes[r][cls], _scaled(shift, 4))
                opposite = next(j for j, v in enumerate(other) if v not in face)
                neighbour[r, q, i] = [cls, opposite, *_pad(shift)]
            parity = tuple(x // (2 * (n + 1)) for x in _barycentre(s))
            cube[r, q] = [q % (len(b.classes[r]) >> n), *_pad(parity)]
        for w, members in sorted(b.diamonds(r).items()):
            kind[r, sum(x << 2 * a for a, x in enumerate(w))] = len(diamonds)
            diamonds.append((r, w, members))

    corners = table("CORNERS", MOST_KINDS)
    corner = table("CORNER", MOST_KINDS, MOST_CORNERS, 3)
    deltas = table("DELTA", MOST_KINDS, MOST_CORNERS)
    strides = (PAGE_SHIFT[n], 0) if n == 2 else (2 * PAGE_SHIFT[n], PAGE_SHIFT[n], 0)
    members_ = table("MEMBERS", MOST_KINDS)
    member = table("MEMBER", MOST_KINDS, MOST_MEMBERS, 5)
    grandchild = table("GRANDCHILD", MOST_KINDS, MOST_MEMBERS, 2, 5)
    factor, bits = table("FACTOR", MOST_KINDS), table("BITS", MOST_KINDS, MOST_MEMBERS * 2)
    place = table("PLACE", MOST_KINDS, MOST_MEMBERS * 2, 4)
    middles = table("BELOW", MOST_KINDS, MOST_MEMBERS * 2, 3)
    twin = table("TWIN", MOST_KINDS, MOST_MEMBERS * 2)
    for d, (r, w, found) in enumerate(diamonds):
        points, inside, below, children = _diamond(b, r, found)
        corners[d] = len(points)
        members_[d] = len(inside)
        corner[d, : len(points)] = [_pad(p) for p in points]
        deltas[d, : len(points)] = [sum((x - y) << s for x, y, s in zip(p, w, strides, strict=True)) for p in points]
        member[d, : len(inside)] = inside
        grandchild[d, : len(inside)] = below
        factor[d] = 2 if r == n - 1 else 1
        bits[d, : len(children)] = [child[-1] for pair in below for child in pair]
        for i, (vertices, doubled) in enumerate(children):
            place[d, i, : n + 1] = vertices
            middles[d, i] = _pad(tuple(x * factor[d] // 2 for x in doubled))
            twin[d, i] = sum(1 << j for j, (_, other) in enumerate(children[:i]) if other == doubled)
    root = [b.number[0][kuhn(n, origin, o)] for o in permutations(range(n))]
    table("DIMENSION", 1)[0] = n
    table("ROOT", 7)[: len(root) + 1] = [len(root), *root]
    return flat


def _diamond(
    b: _Builder, r: int, members: list[tuple[int, Point]]
) -> tuple[list[Point], list[list[int]], list[list[list[int]]], list[tuple[list[int], Point]]]:
    """Corners, members and their children of one diamond, in canonical order (spec clause 4.4).

    Of the children also which corners their vertices are, the middle following on the last, and twice their own middle.
    """
    tag = b.n - r
    moved = [(_moved(b.classes[r][q], _scaled(shift, 4)), q, shift) for q, shift in members]
    moved.sort(key=lambda x: _barycentre(x[0]))
    first = moved[0][0]
    ends = sorted((first[0], first[tag]))
    ring = sorted({v for s, _, _ in moved for v in s} - set(ends))
    points = ends + ring
    number = {p: i for i, p in enumerate([*points, _middle(first, tag)])}
    inside = [[q, *_pad(shift), sum(1 << number[v] for v in s)] for s, q, shift in moved]
    below = []
    children = []
    after = tag - 1 or b.n
    for s, q, shift in moved:
        row = []
        for side in (0, 1):
            cls, delta = b.child(r, q, side, shift)
            c = bisect(s, tag)[side]
            row.append([cls, *_pad(delta), sum(1 << number[v] for v in c)])
            children.append(([number[v] for v in c], _add(c[0], c[after])))
        below.append(row)
    return points, inside, below, children
