"""Binary heap of numbered items with changing keys: the least key first, the lower number of equal ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inlined, inner, record
from ..kernel.types import FloatVector, Int32Vector, IntVector

ABSENT = -1


@record
class Heap(NamedTuple):
    """``key`` and ``next_key`` (which decides between equal keys) by item; ``item`` in the heap's order, ``place`` of
    each item in it or -1; ``size`` has one entry."""

    key: FloatVector
    next_key: FloatVector
    item: Int32Vector
    place: Int32Vector
    size: IntVector


def new_heap(count: int) -> Heap:
    """Make an empty heap with room for ``count`` items."""
    return Heap(
        np.zeros(count), np.zeros(count), np.zeros(count, np.int32), np.full(count, ABSENT, np.int32),
        np.zeros(1, np.int64),
    )


@inlined
def precedes(heap, a, b):
    """Whether item ``a`` comes out before item ``b``."""
    if heap.key[a] != heap.key[b]:
        return heap.key[a] < heap.key[b]
    if heap.next_key[a] != heap.next_key[b]:
        return heap.next_key[a] < heap.next_key[b]
    return a < b


@inner
def _settle(heap, at):
    """Move an item up or down to its place."""
    item = np.int64(heap.item[at])
    while at > 0:
        above = (at - 1) >> 1
        other = np.int64(heap.item[above])
        if not precedes(heap, item, other):
            break
        heap.item[at] = other
        heap.place[other] = at
        at = above
    size = heap.size[0]
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and precedes(heap, np.int64(heap.item[below + 1]), np.int64(heap.item[below])):
            below += 1
        other = np.int64(heap.item[below])
        if not precedes(heap, other, item):
            break
        heap.item[at] = other
        heap.place[other] = at
        at = below
    heap.item[at] = item
    heap.place[item] = at


@inner
def set_key(heap, item, key, next_key):
    """Set the key of an item, adding it to the heap if necessary."""
    heap.key[item] = key
    heap.next_key[item] = next_key
    at = np.int64(heap.place[item])
    if at < 0:
        at = heap.size[0]
        heap.size[0] = at + 1
        heap.item[at] = item
    _settle(heap, at)


@inner
def take_out(heap, item):
    """Remove an item, if it is in the heap."""
    at = np.int64(heap.place[item])
    if at < 0:
        return
    heap.place[item] = ABSENT
    last = heap.size[0] - 1
    heap.size[0] = last
    if at < last:
        heap.item[at] = heap.item[last]
        _settle(heap, at)
