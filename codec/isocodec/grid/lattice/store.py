"""Paged store of integers on the lattice: pages come into being when first touched.

Memory follows the curve, not the domain. An open-addressing hash table maps a page's coordinates to its
number; the pages last asked for are remembered, since neighbouring vertices are asked for together. Indices are
unsigned where their sign is not plain: no test whether they count from the end.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, inner, kernel, record
from ...kernel.types import Array, Int8Matrix, IntMatrix, IntVector, Member, UInt8Matrix
from .tables import PAGE_SHIFT

PAGES, SHIFT, RECENT = 0, 1, 4
"""Places in ``Store.head``: number of pages, the page's edge along the axes (log2), pages remembered."""
PAGES_AROUND = 11
"""Numbers that ``pages_around`` enters."""
_WAYS = 64
_Y, _Z = 23, 44
"""Bits of a page's key at which its second and third coordinate begin."""
_FIRST = 64
"""Pages that a store begins with: small files need no more."""
_LARGE = 1 << 24
"""Bytes from which on an array grows by half of what it has."""


Pages = NDArray[np.int32] | NDArray[np.int8] | NDArray[np.uint8]


@record
class Store(NamedTuple):
    """``table`` holds a key and a page number a row. Pages not yet begun hold arbitrary numbers."""

    head: IntVector
    table: IntMatrix
    pages: Annotated[Pages, Array("int32", 2)]


Flags = Annotated[Store, Member("pages", UInt8Matrix)]
Bytes = Annotated[Store, Member("pages", Int8Matrix)]


def new_store(n: int) -> Store:
    """An empty store for n axes: pages of 32 x 32 or 8 x 8 x 8 entries."""
    edge = PAGE_SHIFT[n]
    return _empty(n, edge, 0, np.int32)


def new_counts(n: int) -> Store:
    """A store for cells of all sizes, which may lie apart from each other: pages of 8 x 8 or 4 x 4 x 4 entries."""
    edge = 3 if n == 2 else 2
    return _empty(n, edge, 0, np.int32)


def new_flags(n: int) -> Store:
    """Make a store of entries that take a byte."""
    return _empty(n, PAGE_SHIFT[n], 0, np.uint8)


def new_board(n: int) -> Store:
    """A store whose entries take a byte: pages of 32 x 32 or 16 x 16 x 16. The first one stays empty."""
    edge = 5 if n == 2 else 4
    return _empty(n, edge, 1, np.int8)


def _empty(n: int, edge: int, used: int, dtype: type[np.integer]) -> Store:
    pages = np.empty((_FIRST, 1 << n * edge), dtype)
    pages[:used] = 0
    head = np.full(RECENT + 2 * _WAYS, -1, np.int64)
    head[:RECENT] = (used, edge, edge, edge if n == 3 else 0)
    return Store(head, np.full((4 * _FIRST, 2), -1, np.int64), pages)


class Size(NamedTuple):
    """Number of pages and of rows of the table that a store has, or is to have."""

    pages: int
    rows: int

    def bytes(self, store: Store) -> int:
        """Bytes of a store of this size, with pages as in ``store``."""
        return self.pages * store.pages.shape[1] * store.pages.itemsize + self.rows * 16


def size_of(store: Store) -> Size:
    """The size of a store."""
    return Size(len(store.pages), len(store.table))


def bytes_of(store: Store) -> int:
    """Bytes of a store."""
    return int(store.pages.nbytes) + int(store.table.nbytes)


def size_for(store: Store, room: int, factor: int = 4) -> Size:
    """The size at which a store has place for at least ``room`` more pages: its own, or a good deal more.

    With ``factor`` 1 there is place for these only.
    """
    used = int(store.head[PAGES])
    pages, rows = size_of(store)
    if used + room > pages:
        more = spare(used * store.pages.shape[1] * store.pages.itemsize, used) if factor > 1 else 0
        pages = used + max(more, factor * room)
    if 2 * (used + room) > rows:
        rows = 1 << (2 * (used + room)).bit_length()
    return Size(pages, rows)


def spare(size: int, count: int) -> int:
    """Number of entries by which an array of ``count``, ``size`` bytes in all, grows.

    Small ones grow by a large factor, since that is fast; large ones by a small one, since memory is limited.
    """
    return 3 * count if size < _LARGE else count // 2


def grown(store: Store, room: int, factor: int = 4) -> Store:
    """Enlarge a store by at least ``room`` more pages."""
    return resized(store, size_for(store, room, factor))


def resized(store: Store, size: Size) -> Store:
    """Resize a store to so many pages and rows of the table, at least as many as it has."""
    used = int(store.head[PAGES])
    table, pages = store.table, store.pages
    if size.pages <= len(pages) and size.rows <= len(table):
        return store
    if size.pages > len(pages):
        pages = np.empty((size.pages, pages.shape[1]), pages.dtype)
        pages[:used] = store.pages[:used]
    if size.rows > len(table):
        table = np.full((size.rows, 2), -1, np.int64)
        _rehash(store.table, table)
    return store._replace(table=table, pages=pages)


def copied(store: Store, bits: int) -> Store:
    """Copy the store, with these bits of its entries only."""
    used = int(store.head[PAGES])
    pages = np.empty_like(store.pages)
    np.bitwise_and(store.pages[:used], bits, out=pages[:used])
    return Store(store.head.copy(), store.table.copy(), pages)


def keys_of(store: Store) -> NDArray[np.int64]:
    """The keys of all pages, by their numbers."""
    used = store.table[store.table[:, 0] >= 0]
    keys = np.empty(len(used), np.int64)
    keys[used[:, 1]] = used[:, 0]
    return keys


def page_of(key):
    """Coordinates of a page, in pages, of its key."""
    return key & ((1 << _Y) - 1), (key >> _Y) & ((1 << _Z - _Y) - 1), key >> _Z


key_page = inlined(page_of)
"""`page_of` in kernels."""


@inlined
def _hash(key, size):
    x, y, z = key_page(key)
    h = (x * 73856093) ^ (y * 19349663) ^ (z * 83492791)
    # pages of coarse levels lie far apart, at multiples of powers of two: their low bits are all alike
    h ^= h >> 24 ^ h >> 37
    return (h ^ h >> 12) & (size - 1)


@kernel
def _rehash(old: IntMatrix, table: IntMatrix) -> None:
    for i in range(len(old)):
        if old[i, 0] >= 0:
            h = _hash(old[i, 0], len(table))
            while table[h, 0] >= 0:
                h = (h + 1) & (len(table) - 1)
            table[h, 0] = old[i, 0]
            table[h, 1] = old[i, 1]


@inlined
def full(store, room):
    """Whether fewer than ``room`` more pages fit."""
    used = store.head[PAGES]
    return used + room > len(store.pages) or 2 * (used + room) > len(store.table)


@inlined
def _page(store, x, y, z):
    """Number of the page of (x, y, z), or, if it is missing, -1 less the place in the table where it belongs."""
    head = store.head
    x >>= head[SHIFT]
    y >>= head[SHIFT + 1]
    z >>= head[SHIFT + 2]
    key = x | y << _Y | z << _Z
    # remembered by the low bits of the page's coordinates: a neighbourhood of pages fits
    way = RECENT + 2 * ((x & 3) | (y & 3) << 2 | (z & 3) << 4)
    if key == head[np.uint64(way)]:
        return head[np.uint64(way + 1)]
    table = store.table
    h = _hash(key, len(table))
    while table[np.uint64(h), 0] != key:
        if table[np.uint64(h), 0] < 0:
            return -1 - h
        h = (h + 1) & (len(table) - 1)
    head[np.uint64(way)] = key
    head[np.uint64(way + 1)] = table[np.uint64(h), 1]
    return table[np.uint64(h), 1]


@inlined
def page_or_first(store, x, y, z):
    """Number of the page of (x, y, z), or 0 if it is missing."""
    return max(_page(store, x, y, z), 0)


@inlined
def wipe(store):
    """Forget all entries but the first page's."""
    store.table[:] = -1
    store.head[RECENT:] = -1
    store.head[PAGES] = 1


@inlined
def _cell(store, x, y, z):
    a, b, c = store.head[SHIFT], store.head[SHIFT + 1], store.head[SHIFT + 2]
    return (((x & ((1 << a) - 1)) << b | (y & ((1 << b) - 1))) << c) | (z & ((1 << c) - 1))


@inlined
def get(store, x, y, z):
    """Entry at (x, y, z); 0 if never set."""
    page = _page(store, x, y, z)
    if page < 0:
        return np.int64(0)
    return np.int64(store.pages[np.uint64(page), np.uint64(_cell(store, x, y, z))])


@inlined
def pages_around(store, x, y, z, far, deep, near):
    """Enter the pages within ``far`` of (x, y, z) along the first two axes, and ``deep`` along the third.

    At most two along each axis, the last axis the fastest; -1 for a missing one. Behind the eight of them the
    place of the first: ``PAGES_AROUND`` numbers.
    """
    a, b, c = store.head[SHIFT], store.head[SHIFT + 1], store.head[SHIFT + 2]
    x0, y0, z0 = (x - far) >> a, (y - far) >> b, (z - deep) >> c
    for i in range(x0, (x + far >> a) + 1):
        for j in range(y0, (y + far >> b) + 1):
            for k in range(z0, (z + deep >> c) + 1):
                page = np.int64(-1)
                if min(i, j, k) >= 0:
                    page = max(_page(store, i << a, j << b, k << c), np.int64(-1))
                near[np.uint64((i - x0) << 2 | (j - y0) << 1 | (k - z0))] = page
    near[8], near[9], near[10] = x0, y0, z0


@inlined
def reaches_two(store, far):
    """Whether what is within ``far`` of a place lies in two pages along each axis at most."""
    a, b, c = store.head[SHIFT], store.head[SHIFT + 1], store.head[SHIFT + 2]
    return 2 * far <= np.int64(1) << (min(a, b, c) if c > 0 else min(a, b))


@inlined
def get_around(store, near, x, y, z):
    """Entry at (x, y, z), which is not farther than ``pages_around`` has looked; 0 if never set."""
    a, b, c = store.head[SHIFT], store.head[SHIFT + 1], store.head[SHIFT + 2]
    page = near[np.uint64(((x >> a) - near[8]) << 2 | ((y >> b) - near[9]) << 1 | ((z >> c) - near[10]))]
    if page < 0:
        return np.int64(0)
    return np.int64(store.pages[np.uint64(page), np.uint64(_cell(store, x, y, z))])


@inlined
def page_with(store, x, y, z, g):
    """Page and cell of (x, y, z) if the page has all within ``g`` along each axis, else -1."""
    a, b, c = store.head[SHIFT], store.head[SHIFT + 1], store.head[SHIFT + 2]
    if (x - g) >> a != (x + g) >> a or (y - g) >> b != (y + g) >> b or (c > 0 and (z - g) >> c != (z + g) >> c):
        return np.int64(-1), np.int64(0)
    return np.int64(_page(store, x, y, z)), _cell(store, x, y, z)


@inlined
def spot(store, x, y, z):
    """Page and cell of (x, y, z), to be read and set; the caller has made sure of room for a page."""
    page = _page(store, x, y, z)
    if page < 0:
        page = _new_page(store, -1 - page, x, y, z)
    return page, _cell(store, x, y, z)


@inner
def _new_page(store, h, x, y, z):
    """Begin the page of (x, y, z), which belongs at a place of the table, with no entry set."""
    page = store.head[PAGES]
    entry = store.table[np.uint64(h)]
    entry[0] = x >> store.head[SHIFT] | (y >> store.head[SHIFT + 1]) << _Y | (z >> store.head[SHIFT + 2]) << _Z
    entry[1] = page
    store.head[PAGES] = page + 1
    entries = store.pages[np.uint64(page)]
    entries[:] = 0
    return page


@inlined
def put(store, x, y, z, value):
    """Set the entry at (x, y, z); the caller has made sure of room for a page."""
    page, cell = spot(store, x, y, z)
    store.pages[np.uint64(page), np.uint64(cell)] = value
