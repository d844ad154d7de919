"""Isovalues of a file in tiles that lean on one another in each tile: the same curves, in fewer bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
from isocodec.stream.options import DEFAULT_TOLERANCE
from isocodec.tiles.first_stages import first_stages
from libraries import Late
from tiled import encoded, hilly, holed, pieces, tiled_of

KDTree = Late("scipy.spatial.KDTree")

ISOVALUES = [30.5, 32.5, 1e6, 28.5, 60.5, -20.5, 31.5, 33.5, 34.5, 36.5]
"""In no order, one without a curve, and more than a group has."""
HEAVIER = [pytest.param("signs", True, None, marks=pytest.mark.heavy),
           pytest.param("exact", True, "independent", marks=pytest.mark.heavy)]


def same(ours: isocodec.Contour, theirs: isocodec.Contour) -> None:
    """The same cells, wherever they stand."""
    assert len(ours.cells) == len(theirs.cells)
    assert np.allclose(*(np.array(pieces(one)).ravel() for one in (ours, theirs)), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("precision", "masked", "order"),
    [("exact", False, None), ("step=0.3", True, None), *HEAVIER],
)
def test_each_is_that_of_the_whole_field(tmp_path: Path, precision: str, masked: bool, order: str | None) -> None:
    """Of each isovalue, alone and among others, in windows, at every stage, and of the first stages alone."""
    field = hilly((49, 52)).astype(float if "step" in precision else np.int16)
    field = holed(field, 1) if masked else field
    data = encoded(tmp_path, field, ISOVALUES, precision=precision, order=order)
    file = tiled_of(data)
    assert file.head.together == (1 if order else 8)
    for isovalue, drawn in zip(ISOVALUES, file.windows(), strict=True):
        same(drawn, isocodec.decode(isocodec.encode(field, isovalue, precision=precision)))
        assert pieces(tiled_of(data).window(isovalue=isovalue)) == pieces(drawn)
    box = [(10, 40), (25, 50)]
    for number, drawn in zip((6, 1, 9), file.windows(box, [6, 1, 9]), strict=True):
        assert pieces(drawn) == pieces(file.window(box, isovalue=ISOVALUES[number]))
    alone = tiled_of(encoded(tmp_path, field, ISOVALUES, precision="signs", order="independent"))
    short = tiled_of(b"".join(first_stages(file, 2)))
    for isovalue in ISOVALUES[::3]:
        for layer in (0, 1, 2):
            assert pieces(file.window(isovalue=isovalue, layer=layer)) == pieces(
                alone.window(isovalue=isovalue, layer=layer)
            )
        assert pieces(short.window(isovalue=isovalue)) == pieces(file.window(isovalue=isovalue, layer=1))


def test_slack_needs_an_order(tmp_path: Path) -> None:
    """Crossings that may move a little must not pass those of the isovalue leaned on: only in order they lean."""
    field = hilly((70, 100))
    for precision, wanted in ((0.1, [3, 3, 1]), (0.05, [3, 3, 3])):  # 0.05 takes two digits, without slack
        assert wanted == [
            tiled_of(encoded(tmp_path, field, some, precision=precision)).head.together
            for some in ([1, 2, 3], [3, 2, 1], [1, 3, 2])
        ]
    file = tiled_of(encoded(tmp_path, field, [30.5, 31.5, 34.5]))
    for isovalue in file.isovalues:
        ours = file.window(isovalue=isovalue)
        exact = isocodec.decode(isocodec.encode(field, isovalue, precision="exact"))
        assert len(ours.points) == len(exact.points)
        assert KDTree(exact.points).query(ours.points)[0].max() <= DEFAULT_TOLERANCE + 1e-9


def test_one_tile_as_it_is_and_a_part(tmp_path: Path) -> None:
    """All isovalues of a tile keep their bytes; some of them, or a window, are coded anew, with the same curves."""
    field = hilly()
    data = encoded(tmp_path, field, ISOVALUES[:4], precision="exact")
    file, whole = tiled_of(data), isocodec.open(data)
    coded = [30.5, 32.5, 28.5]
    tile = file.tiles([(2, 3)], 0, 3)[0]
    assert [file.isovalues[number] for number in tile.numbers] == coded
    window = [(64, 96), (96, 128)]
    for some, kept in ((coded, True), (coded[1:], False)):
        made = whole.edited(window=window, isovalues=some)
        assert all(segment in made for segment in tile.segments if segment) == kept
        for isovalue in some:
            ours = isocodec.decode(made, isovalue=isovalue)
            same(ours, isocodec.decode(isocodec.encode(field[64:97, 96:129], isovalue, precision="exact")))


def test_cut_anywhere(tmp_path: Path) -> None:
    """A download that ends early has of each isovalue what has come, and what is missing is said so."""
    data = encoded(tmp_path, hilly((70, 100)), [30.5, 32.5], precision="exact")
    file = tiled_of(data)
    begin = int(file.root.leaves[-1])
    areas = [begin + int(n) for n in np.cumsum(file.root.sizes.sum(axis=0))]
    for area in range(2, len(areas)):
        short = tiled_of(data[: areas[area]])
        for number in (0, 1):
            (drawn,) = short.windows(None, [number], partial=True)
            stage = (area - number) // 2
            assert pieces(drawn) == pieces(file.window(isovalue=file.isovalues[number], layer=stage))
            assert drawn.complete == (stage == len(file.head.stages) - 1)
