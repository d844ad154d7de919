"""Scattered points: their Delaunay triangulation as the domain, in the file by its points alone (spec clause 10.11)."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from isocodec.errors import FormatError, InputError, IsoError, OptionError
from libraries import Late
from tables import looped

Delaunay = Late("scipy.spatial.Delaunay")


def scattered(seed, count=80, side=1000):
    """Points of a fine grid without four on a circle, mostly, and values."""
    rng = np.random.default_rng(seed)
    points = np.unique(rng.integers(0, side, (count, 2)), axis=0)
    return rng.permutation(points).astype(np.float64), rng.integers(0, 60, len(points))


def test_grids_and_duplicates():
    """Four points on a circle everywhere; points that coincide become one with the mean of their values."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(7.0))
    points, values = np.column_stack([x.ravel(), y.ravel()]), (x + 10 * y).ravel()
    data = isocodec.encode(isocodec.Mesh(points, None, values, stored="whole"), 33.3)
    assert isocodec.open(data).info.domain.cells == 2 * 8 * 6
    again = np.concatenate([points, points[:5]]), np.concatenate([values, values[:5] + 2])
    found = isocodec.decode(isocodec.encode(isocodec.Mesh(again[0], None, again[1]), 1.5))
    merged = values.copy()
    merged[:5] += 1
    assert np.array_equal(
        found.points, isocodec.decode(isocodec.encode(isocodec.Mesh(points, None, merged), 1.5)).points,
    )
    with pytest.raises(InputError, match="coincide"):
        isocodec.encode(isocodec.Mesh(again[0], None, again[1].astype(int)), 1.5)
    frames = np.array([values, values + 1])
    assert isocodec.open(isocodec.encode(isocodec.Mesh(points, None, frames), 33.3)).info.interval == 16


@looped(
    ("points", "cells", "options", "error"),
    [
        (np.zeros((5, 3)), None, {}, InputError),
        ([[0, 0], [1, 1], [2, 2]], None, {}, InputError),
        ([[0, 0], [1, 1], [2, np.nan]], None, {}, InputError),
        ([[0, 0], [1, 0]], None, {}, InputError),
        ([[0, 0], [1, 0], [0, 1]], None, {"stored": "known"}, OptionError),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], {"stored": "delaunay"}, OptionError),
    ],
)
def test_what_is_no_triangulation(points, cells, options, error):
    with pytest.raises(error):
        isocodec.encode(isocodec.Mesh(points, cells, np.arange(len(points)), **options), 0.5)


def test_hostile_points():
    """Every flipped byte is found, by a checksum or, with that mended, by what it says or by the drawing's end."""
    import zlib

    points, values = scattered(3, 60)
    data = isocodec.encode(isocodec.Mesh(points, None, values), 20.5)
    domain = isocodec.open(data).info.chunks[0]
    for at in range(domain.offset + 2, domain.offset + domain.bytes):
        bad = bytearray(data)
        bad[at] ^= 0x40
        head = bytes(bad[domain.offset : domain.offset + domain.bytes - 4])
        bad[domain.offset + domain.bytes - 4 : domain.offset + domain.bytes] = zlib.crc32(head).to_bytes(4, "big")
        bad[-4:] = zlib.crc32(bytes(bad[:-4])).to_bytes(4, "big")
        try:
            isocodec.decode(bytes(bad))
        except IsoError as error:
            assert isinstance(error, FormatError) and error.clause
