"""Fuzzing of decoders of files in tiles, and the annotated dump of such a file."""

from __future__ import annotations

import ctypes
import re
import resource
import sys
import time
from collections import Counter
from copy import deepcopy
from random import Random

import pytest

import isocodec
from brute import INTERPRETED
from isoconform.decoders import Answer, Reference
from isoconform.dump import COMPLETE, CUT_OFF, REFUSED
from isoconform.dump_file import dump_any
from isoconform.fuzz import Campaign
from isoconform.manifest import default_directory
from isoconform.tiled_damage import any_tiled, damaged, encoded, tiles_of
from isoconform.tiled_explain import explained_tiled

pytestmark = pytest.mark.skipif(INTERPRETED, reason="many files would be slow")
VECTORS = default_directory()
CODES = {COMPLETE, CUT_OFF, *REFUSED}


FILES, MANY = 40, 20_000
"""Damaged files, and those of a long run."""
MEMORY, SECONDS = 128 << 20, 10


def rows(lines: list[str]) -> list[tuple[int, bytes]]:
    """Offsets and bytes of an annotated dump."""
    found = [re.match(r" *([0-9]+)  ((?:[0-9a-f]{2} ?)+)", line) for line in lines]
    return [(int(each[1]), bytes.fromhex(each[2])) for each in found if each]


def test_files_are_refused_or_decoded_and_explained() -> None:
    codes = set()
    for number in range(16):
        data = any_tiled(Random(number))
        if tiles_of(data) > 64:
            continue
        output = dump_any(data)
        codes.add(output.exit_code)
        lines = list(explained_tiled(data))
        assert lines[-1].startswith(f"exit code {output.exit_code},")
        # every byte once, in its place
        there = rows(lines[3:-1])
        assert b"".join(part for _, part in there) == data
        assert [at for at, _ in there] == [sum(len(part) for _, part in there[:i]) for i in range(len(there))]
    assert codes >= {COMPLETE, 4, CUT_OFF} and codes <= CODES


def test_names_of_parts() -> None:
    lines = list(explained_tiled((VECTORS / "tiled_plane_missing.iso").read_bytes()))
    wanted = (
        "signature (12.3)", "shape 70 x 101", "stage 1: cubes of 4 samples", "stage 3: cubes of 1 samples, geometry",
        "block (0, 0): leaf directory of", "CRC-32 of a group: mask, tiles (0, 0) to",
        "mask, tile (0, 1): chunk mask,", "stage 2, isovalue 0, tile (1, 2): chunk layers,", "CRC-32 of the head",
    )
    for each in wanted:
        assert any(each in line for line in lines), each
    wrong = list(explained_tiled((VECTORS / "bad_tiled_group_checksum.iso").read_bytes()))
    assert any("the CRC-32 of its group is" in line for line in wrong)


class Careless(Reference):
    """Takes checksums and directories for granted: what is wrong is an empty file."""

    def answer(self) -> Answer:
        found = super().answer()
        assert found is not None
        return Answer(COMPLETE, "tiles 1 1\n") if found.code == 4 else found


def test_a_campaign() -> None:
    fine = Campaign(Reference(), files=30, tiles=True)
    assert not list(fine.run()) and fine.report.files > 10
    found = list(Campaign(Careless(), files=60, tiles=True, shrinking=1.0, most=1).run())
    assert [each.sort for each in found] == ["exit code 0 instead of 4"]


def test_damaged_files_take_little() -> None:
    check_damaged(range(FILES))


@pytest.mark.heavy
def test_many_damaged_files_take_little() -> None:
    check_damaged(range(FILES, MANY))


def check_damaged(numbers: range) -> None:
    """All windows of all isovalues, or an error of ours, within time and memory."""
    whole = [encoded(Random(number)) for number in range(24)]
    for file in whole:
        drawn(bytes(file))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcomes: Counter[str] = Counter()
    for number in numbers:
        if number % 500 == 0 and sys.platform == "linux":
            # what was freed in small pieces stays with the process otherwise
            getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
        data = damaged(Random(number), deepcopy(whole[number % len(whole)]))
        started = time.monotonic()
        outcomes[drawn(data)] += 1
        assert time.monotonic() - started < SECONDS, number
        assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10 < MEMORY, number
    assert {"FormatError", ""} <= {*outcomes}, outcomes


def drawn(data: bytes) -> str:
    """What ends the decoding of all isovalues of a file, if it does not come to an end."""
    try:
        file = isocodec.open(data, limits=isocodec.Limits(memory=64 << 20))
        for isovalue in file.isovalues:
            file.contour(isovalue)
        file.contours(within=4)
    except isocodec.IsoError as error:
        return type(error).__name__
    return ""
