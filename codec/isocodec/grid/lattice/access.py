"""Reading the flat mesh tables in kernels: one function a table (layout in ``lattice.tables``)."""

from __future__ import annotations

import numpy as np

from ...kernel import inlined
from .tables import MOST_CLASSES, MOST_CORNERS, MOST_MEMBERS, START

_ROOT = START["ROOT"]
_VERTEX = START["VERTEX"]
_MIDDLE = START["MIDDLE"]
_CHILD = START["CHILD"]
_NEIGHBOUR = START["NEIGHBOUR"]
_CUBE = START["CUBE"]
_KIND = START["KIND"]
_CORNERS = START["CORNERS"]
_CORNER = START["CORNER"]
_MEMBERS = START["MEMBERS"]
_MEMBER = START["MEMBER"]
_GRANDCHILD = START["GRANDCHILD"]
_DELTA = START["DELTA"]
_FACTOR = START["FACTOR"]
_BITS = START["BITS"]
_PLACE = START["PLACE"]
_BELOW = START["BELOW"]
_TWIN = START["TWIN"]


@inlined
def _at(t, i):
    """Entry i: unsigned, no test whether it counts from the end."""
    return np.int64(t[np.uint64(i)])


@inlined
def dimension(t):
    return _at(t, 0)


@inlined
def roots(t):
    return _at(t, _ROOT)


@inlined
def root(t, i):
    return _at(t, _ROOT + 1 + i)


@inlined
def vertex(t, r, cls, j):
    """Vertex j in units of g, relative to the block."""
    i = _VERTEX + ((r * MOST_CLASSES + cls) * 4 + j) * 3
    return _at(t, i), _at(t, i + 1), _at(t, i + 2)


@inlined
def middle(t, r, cls, b0, b1, b2):
    """Middle of the subdivision edge of a simplex, in units of g."""
    i = _MIDDLE + (r * MOST_CLASSES + cls) * 3
    return 4 * b0 + _at(t, i), 4 * b1 + _at(t, i + 1), 4 * b2 + _at(t, i + 2)


@inlined
def child(t, r, cls, side):
    """Class and block delta."""
    i = _CHILD + ((r * MOST_CLASSES + cls) * 2 + side) * 4
    return _at(t, i), _at(t, i + 1), _at(t, i + 2), _at(t, i + 3)


@inlined
def neighbour(t, r, cls, face):
    """Class, the vertex opposite, block delta."""
    i = _NEIGHBOUR + ((r * MOST_CLASSES + cls) * 4 + face) * 5
    return _at(t, i), _at(t, i + 1), _at(t, i + 2), _at(t, i + 3), _at(t, i + 4)


@inlined
def cube(t, r, cls):
    """Number within the cube, parity of the cube."""
    i = _CUBE + (r * MOST_CLASSES + cls) * 4
    return _at(t, i), _at(t, i + 1), _at(t, i + 2), _at(t, i + 3)


@inlined
def kind(t, r, w0, w1, w2):
    """Kind of the diamond around the lattice point w (units of g), or -1 if w is not a middle of this level."""
    return _at(t, _KIND + r * 64 + ((w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4))


@inlined
def corners(t, d):
    return _at(t, _CORNERS + d)


@inlined
def corner(t, d, i):
    i = _CORNER + (d * MOST_CORNERS + i) * 3
    return _at(t, i), _at(t, i + 1), _at(t, i + 2)


@inlined
def delta(t, d, i):
    """Distance of the cell of corner i behind that of the middle in a page that has both, in units of g."""
    return _at(t, _DELTA + d * MOST_CORNERS + i)


@inlined
def members(t, d):
    return _at(t, _MEMBERS + d)


@inlined
def member(t, d, m):
    """Class, block delta, bits of the corners."""
    i = _MEMBER + (d * MOST_MEMBERS + m) * 5
    return _at(t, i), _at(t, i + 1), _at(t, i + 2), _at(t, i + 3), _at(t, i + 4)


@inlined
def grandchild(t, d, m, side):
    """Class, block delta, bits of the corners of a member's child; the bit after the last corner is the middle."""
    i = _GRANDCHILD + ((d * MOST_MEMBERS + m) * 2 + side) * 5
    return _at(t, i), _at(t, i + 1), _at(t, i + 2), _at(t, i + 3), _at(t, i + 4)


@inlined
def factor(t, d):
    """Factor for the block of a diamond's member, before the block delta of its child is added."""
    return _at(t, _FACTOR + d)


@inlined
def child_bits(t, d, c):
    """Bits of the corners of child c, 2 m + s."""
    return _at(t, _BITS + d * MOST_MEMBERS * 2 + c)


@inlined
def place(t, d, c, j):
    """Corner of a diamond that is vertex j of child c, 2 m + s; the number after the last corner's is the middle."""
    return _at(t, _PLACE + (d * MOST_MEMBERS * 2 + c) * 4 + j)


@inlined
def below(t, d, c, b0, b1, b2):
    """Middle of child c, 2 m + s, of a diamond with its middle in block b, in units of the child's g."""
    i = _BELOW + (d * MOST_MEMBERS * 2 + c) * 3
    f = 4 * factor(t, d)
    return f * b0 + _at(t, i), f * b1 + _at(t, i + 1), f * b2 + _at(t, i + 2)


@inlined
def twins(t, d, c):
    """Bits of the children before child c that have the same middle."""
    return _at(t, _TWIN + d * MOST_MEMBERS * 2 + c)
