"""Pieces of a file that have been fetched: bytes are counted once, up to the limit and no further."""

import pytest

from isocodec.errors import LimitError
from isocodec.storage.ranges import Pieces


def test_as_many_bytes_as_are_allowed():
    file = bytes(range(100))
    asked = []

    def fetch(ranges):
        asked.extend(ranges)
        return [file[start:end] for start, end in ranges]

    pieces = Pieces(file[:10])
    pieces.begin(20, 0)
    pieces.fetch(fetch, [(0, 10), (40, 60)])  # the beginning is there
    assert asked == [(40, 60)] and pieces.get(45, 50) == file[45:50] and pieces.has(0, 10)
    with pytest.raises(LimitError, match="1 bytes more"):
        pieces.fetch(fetch, [(70, 71)])
    pieces.begin(1, 100)
    pieces.fetch(fetch, [(70, 71), (41, 59)])
    assert asked == [(40, 60), (70, 71)] and not pieces.has(69, 71)
