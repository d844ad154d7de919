"""The mesh's tables against recursive bisection of a whole cube, clamped boxes, and the paged store."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brute import examples, simplices, volumes
from isocodec.entropy.context_layout import no_blend
from isocodec.entropy.range_coder import Coder
from isocodec.grid.lattice import access
from isocodec.grid.lattice.depth import levels_of
from isocodec.grid.lattice.simplex import exists
from isocodec.grid.lattice.store import full, get, grown, new_store, page_of, put
from isocodec.grid.lattice.tables import PAGE_SHIFT, mesh_tables
from isocodec.grid.passes.runner import Tube
from isocodec.limits import Limits
from isoconform.meshes import exponent
from tables import looped

# A root of edge 8 has two whole periods of the second finest cubes along each axis.
CASES = [(n, 3, level) for n in (2, 3) for level in range(3 * n + 1)]
NO_CODER = Coder(*(np.zeros(0, np.int64) for _ in Coder._fields[:-1]), no_blend())


class Uniform:
    """A uniform level of the root cube twice: by bisection, and numbered by class and block as the tables do."""

    def __init__(self, n, k, level):
        self.n, self.k, self.level = n, k, level
        self.t, self.r = mesh_tables(n), level % n
        self.edge = 1 << (k - level // n)
        self.brute = [tuple(map(tuple, s)) for s in simplices(n, k, level).tolist()]
        self.name = {}
        # Blocks have an edge of two cubes; a coarse cube is less than one block.
        blocks = -(-(1 << k) // (2 * self.edge))
        classes = 2**n * [1, 2, 4][self.r] * (2 if n == 2 else 6)  # cubes of a block, bisections, orders of axes
        for block in product(range(blocks), repeat=n):
            for cls in range(classes):
                s = self.vertices(cls, block)
                assert s not in self.name
                self.name[s] = (cls, block)

    def vertices(self, cls, block):
        found = [access.vertex(self.t, self.r, cls, j) for j in range(self.n + 1)]
        return tuple(tuple((4 * b + v) * self.edge >> 1 for b, v in zip(block, p, strict=False)) for p in found)

    def lattice(self, w):
        """Units of g, half the edge of a cube, padded to three axes."""
        return [2 * x // self.edge for x in w] + [0] * (3 - self.n)

    def middle(self, s):
        tag = self.n - self.r
        return tuple((x + y) // 2 for x, y in zip(s[0], s[tag], strict=True))


@pytest.fixture(scope="module")
def uniform():
    made = {}

    def get_level(n, k, level):
        if (n, k, level) not in made:
            made[n, k, level] = Uniform(n, k, level)
        return made[n, k, level]

    return get_level


@pytest.mark.parametrize(("n", "k"), [(2, 1), (2, 4), (3, 1), (3, 3)])
def test_levels_are_those_at_which_bisection_makes_vertices(n, k):
    """A middle of level l is a vertex of level l + 1, and of none before; corners of the root cube always are."""
    there = {tuple(p) for p in simplices(n, k, 0).reshape(-1, n).tolist()}
    assert (levels_of(np.array(sorted(there)), k) == -1).all()
    for level in range(n * k):
        fresh = {tuple(p) for p in simplices(n, k, level + 1).reshape(-1, n).tolist()} - there
        assert fresh and (levels_of(np.array(sorted(fresh)), k) == level).all()
        there |= fresh
    assert levels_of(np.zeros((0, n), np.int64), k).shape == (0,)


@looped("n, k, level", [c for c in CASES if c[2] < c[0] * c[1]])
def test_diamonds(uniform, n, k, level):
    """C2-mesh: around each middle the members, their corners and children; 4 corners, or 8, 6, 10 by level mod 3."""
    mesh = uniform(n, k, level)
    below = uniform(n, k, level + 1)
    factor = 2 if mesh.r == n - 1 else 1
    around = defaultdict(list)
    for s in mesh.brute:
        around[mesh.middle(s)].append(s)
    for w, members in around.items():
        if min(w) == 0 or max(w) == 1 << k:
            continue
        # Inside the cube all simplices at the edge are there.
        lattice = mesh.lattice(w)
        d = access.kind(mesh.t, mesh.r, *lattice)
        home = [x >> 2 for x in lattice]
        corners = [
            tuple((4 * home[a] + access.corner(mesh.t, d, i)[a]) * mesh.edge >> 1 for a in range(n))
            for i in range(access.corners(mesh.t, d))
        ]
        assert len(corners) == len(set(corners)) == {2: (4, 4), 3: (8, 6, 10)}[n][mesh.r]
        assert set(corners) == {v for s in members for v in s}
        assert access.members(mesh.t, d) == len(members)
        bit = {c: 1 << i for i, c in enumerate([*corners, w])}
        found = set()
        for m in range(len(members)):
            cls, *rest = access.member(mesh.t, d, m)
            s = mesh.vertices(cls, tuple(home[a] + rest[a] for a in range(n)))
            assert s in members
            found.add(s)
            assert rest[3] == sum(bit[v] for v in s)
            # Corners 0 and 1 are the subdivision edge, which all members share.
            assert {s[0], s[n - mesh.r]} == set(corners[:2])
            for side in (0, 1):
                q, *rest = access.grandchild(mesh.t, d, m, side)
                child = below.vertices(q, tuple(home[a] * factor + rest[a] for a in range(n)))
                assert child == below.brute[2 * mesh.brute.index(s) + side]
                assert rest[3] == sum(bit[v] for v in child)
        assert len(found) == len(members)


def _boundary(face, shape):
    return any(all(v[a] == end for v in face) for a, s in enumerate(shape) for end in (0, s - 1))


def _conforming(found, shape):
    """Faces are shared by two simplices, or lie on the border of the box and belong to one."""
    faces = Counter(frozenset(s) - {v} for s in found for v in s)
    return all(count == (1 if _boundary(face, shape) else 2) for face, count in faces.items())


BOXES = [(5, 3), (3, 6), (2, 2), (2, 3), (9, 9), (2, 40), (7, 4, 2), (3, 3, 3), (2, 2, 2), (2, 9, 3), (5, 6, 4)]


@looped("shape", BOXES)
def test_clamped_simplices_tile_the_box(shape):
    """C2-mesh: after clamping, simplices with a volume fill any box, none flipped, and the mesh conforms."""
    n, k = len(shape), exponent(shape)
    tube = Tube(shape, NO_CODER, Limits())
    assert tube.full_level == n * k
    whole = np.prod(np.array(shape) - 1) * (1 if n == 2 else 3) * 2  # n! times the volume of the box
    for level in range(n * k + 1):
        before = simplices(n, k, level)
        after = np.minimum(before, np.array(shape) - 1)
        volume = volumes(after)
        there = volume != 0
        assert np.abs(volume).sum() == whole
        assert (np.sign(volume) == np.sign(volumes(before)))[there].all()
        assert _conforming([tuple(map(tuple, s)) for s in after[there].tolist()], shape)
        # The codec's own test of existence, for all simplices that the tables can name.
        edge, r = 1 << (k - level // n), level % n
        mesh = Uniform(n, k, level)
        for s, exp in zip(before.tolist(), there, strict=True):
            cls, block = mesh.name[tuple(map(tuple, s))]
            assert exists(tube.state.grid, edge, r, cls, *block, *(0,) * (3 - n)) == exp


# --- the paged store ------------------------------------------------------------------------------------------------


@examples(100)
@given(st.data(), st.sampled_from([2, 3]))
def test_store_is_a_dictionary(data, n):
    """Any sequence of puts and gets; far apart, and side by side within a page."""
    side = data.draw(st.sampled_from([20, 1 << 10, 1 << 20 if n == 3 else 1 << 24]))
    key = st.tuples(*[st.integers(0, side - 1)] * n, *[st.just(0)] * (3 - n))
    keys = data.draw(st.lists(key, min_size=1, max_size=60))
    store, model = new_store(n), {}
    for place in keys:
        assert get(store, *place) == model.get(place, 0)
        if full(store, 1):
            store = grown(store, 1)
            assert not full(store, 1)
        value = data.draw(st.integers(-(1 << 31), (1 << 31) - 1))
        put(store, *place, value)
        model[place] = value
    for place in data.draw(st.lists(key, max_size=20)) + list(model):
        assert get(store, *place) == model.get(place, 0)


@pytest.mark.parametrize(("n", "k"), [(2, 24), (3, 20)])
def test_cells_of_the_largest_crowd_lie_apart(n, k):
    """Four times as far along the first axis as the largest domain: no two places share a page."""
    store, page = new_store(n), 1 << PAGE_SHIFT[n]
    places = {}
    for x in (4, (4 << k - 1) + 4, (4 << k) + 4, 5 << k):
        for y in range(0, 6 * page, page):
            places[x, y, 0] = len(places) + 1
    for place, number in places.items():
        if full(store, 1):
            store = grown(store, 1)
        put(store, *map(np.int64, place), number)
    assert all(get(store, *map(np.int64, place)) == number for place, number in places.items())
    pages = {tuple(int(c) for c in page_of(key)) for key in store.table[store.table[:, 0] >= 0, 0]}
    assert pages == {(x // page, y // page, z) for x, y, z in places}
