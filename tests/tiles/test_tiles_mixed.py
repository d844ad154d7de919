"""Windows whose tiles stand at different layers: gaps are closed in the faces between them (spec clause 12.7)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_tiles import random_field

import isocodec
from brute import INTERPRETED
from commands import fails, ok
from isocodec.drawing.gaps import filled
from isocodec.tiles.tiled import TiledFile
from libraries import Late
from tables import heavy, looped
from tiled import encoded, pieces, tiled_of

maximum_filter = Late("scipy.ndimage.maximum_filter")

pytestmark = pytest.mark.skipif(INTERPRETED, reason="many tiles would be slow")

COUNT = {2: 2, 3: 1}
MANY = {2: 150, 3: 40}


def mixed(file: TiledFile, seed: int) -> isocodec.Contour:
    """Each tile as finely as dice say."""
    return file.window(within=lambda box: within(seed, [low for low, _ in box]))


def within(seed: int, corner: Sequence[float]) -> float:
    """Dice for the tile with this corner."""
    return float(np.random.default_rng([seed, *map(int, corner)]).choice([16, 4, 1, 0]))


def check_closed(contour: isocodec.Contour) -> None:
    """What ends, ends at the border of the field; all else has something on its other side, turned the same way."""
    last = np.array(contour.shape) - 1
    if contour.n == 2:
        balance = np.zeros(len(contour.points), int)
        np.add.at(balance, contour.cells[:, 0], 1)
        np.add.at(balance, contour.cells[:, 1], -1)
        assert np.bincount(contour.cells.ravel(), minlength=1).max(initial=0) <= 2
        ends = contour.points[balance != 0]
        assert ((ends == 0) | (ends == last)).any(axis=1).all()
        return
    edges = Counter((a, b) for p, q, r in contour.cells.tolist() for a, b in ((p, q), (q, r), (r, p)))
    assert max(edges.values(), default=0) <= 1
    for a, b in edges:
        if (b, a) not in edges:
            both = contour.points[[a, b]]
            assert ((both == 0) | (both == last)).all(axis=0).any(), both


def check_in_faces(contour: isocodec.Contour, file: TiledFile, plain: int) -> None:
    """The cells behind those of tiles lie in planes that tiles share."""
    corners = contour.points[contour.cells[plain:]]
    tile = 1 << file.head.grid.exponent
    flat = (corners == corners[:, :1]) & (corners % tile == 0) & (corners > 0)
    assert flat.all(axis=1).any(axis=1).all()


@looped("n, options", [(2, {}), (2, {"precision": "signs"}), (3, {}), (3, {"precision": "exact"})])
def test_no_gaps(tmp_path: Path, n: int, options: dict[str, object]) -> None:
    check_no_gaps(tmp_path, n, options, COUNT[n])


@pytest.mark.heavy
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize(
    "options", [{}, {"precision": "signs"}, {"precision": "exact"}], ids=["default", "signs", "exact"],
)
def test_no_gaps_in_many(tmp_path: Path, n: int, options: dict[str, object]) -> None:
    check_no_gaps(tmp_path, n, options, MANY[n])


def check_no_gaps(tmp_path: Path, n: int, options: dict[str, object], count: int) -> None:
    for seed in range(count):
        field = random_field(n, seed, True)
        # where samples are as large as the isovalue, points of several edges fall together
        file = tiled_of(encoded(tmp_path, field, 0.5 if seed % 2 else 0, **options))
        contour = mixed(file, seed)
        check_closed(contour)
        tile = 1 << file.head.grid.exponent
        corners = {index: [tile * place for place in index] for index in np.ndindex(*file.head.grid.counts)}
        layers = {index: file.stage_of(within(seed, corner)) for index, corner in corners.items()}
        alone = [isocodec.decode(file.plain(index, layer=layer)) for index, layer in layers.items()]
        check_in_faces(contour, file, sum(len(each.cells) for each in alone))


@pytest.mark.parametrize("n", [2, 3])
def test_a_download_that_ends_early(tmp_path: Path, n: int) -> None:
    """Cut anywhere in the segments: closed as well, no worse than the last layer that is there of all tiles."""
    field = random_field(n, 5, True)
    data = encoded(tmp_path, field, 0.5, precision="exact")
    file = tiled_of(data)
    begin = int(file.root.leaves[-1])
    first = begin + int(file.root.sizes[:, 0].sum())
    dice = np.random.default_rng(1)
    for end in [first, len(data) - 1, *dice.integers(first, len(data), 12).tolist()]:
        short = tiled_of(data[:end])
        contour = short.window(partial=True)
        assert not contour.complete
        check_closed(contour)
    assert pieces(tiled_of(data[:first]).window(partial=True)) == pieces(file.window(layer=0))
    assert tiled_of(data).window(partial=True).complete
    # less than the first layer: some tiles are not there at all
    assert not tiled_of(data[: begin + 9]).window(partial=True).complete
    if n == 2:
        (tmp_path / "cut.iso").write_bytes(data[: first + 99])
        fails(5, "decode", tmp_path / "cut.iso", "-o", tmp_path / "c.npz")
        told = json.loads(ok("decode", tmp_path / "cut.iso", "-o", tmp_path / "c.npz", "--partial", "--json"))
        assert told["complete"] is False and told["cells"]
    with pytest.raises(isocodec.errors.TruncatedError):
        tiled_of(data[: begin - 9]).window(partial=True)


@looped(("shape", "holes"), [((150, 210), 6), ((70, 72, 68), 3)])
@looped("options", [{}, *heavy({"precision": "exact"}, {"precision": "signs"})])
def test_gaps_stay_beside_missing_samples_only(
    tmp_path: Path, shape: tuple[int, ...], holes: int, options: dict[str, object]
) -> None:
    """Of a field with holes nothing is drawn that is turned wrong, and farther than a cube from holes nothing ends."""
    dice, widest = np.random.default_rng(3), 16
    field = np.rint(100 * np.sin(np.indices(shape) / 11).prod(axis=0)).astype(np.int16)
    # where the curve passes near a face
    around = np.argwhere((np.abs(field - 30) < 20) & ((np.indices(shape) % 32 < 3).any(axis=0)))
    gone = np.zeros(shape, bool)
    for at in dice.choice(around, holes):
        gone[tuple(slice(max(x - 1, 0), x + 2) for x in at)] = True
    near = maximum_filter(gone, 2 * widest + 3)
    file = tiled_of(encoded(tmp_path, np.ma.masked_array(field, mask=gone), 30.5, **options))
    last, ended = np.array(shape) - 1, 0
    for seed in range(2):
        contour = mixed(file, seed)
        if contour.n == 2:
            sides = Counter(tuple(segment) for segment in contour.cells.tolist())
            balance = np.zeros(len(contour.points), int)
            np.add.at(balance, contour.cells[:, 0], 1)
            np.add.at(balance, contour.cells[:, 1], -1)
            ends = contour.points[balance != 0][:, None]
        else:
            sides = Counter((a, b) for p, q, r in contour.cells.tolist() for a, b in ((p, q), (q, r), (r, p)))
            ends = contour.points[np.array([(a, b) for a, b in sides if (b, a) not in sides], int).reshape(-1, 2)]
        assert max(sides.values()) == 1
        inside = ~((ends == 0) | (ends == last)).all(axis=1).any(axis=1)
        place = np.rint(ends[inside]).astype(int).reshape(-1, len(shape))
        assert near[tuple(place.T)].all()
        ended += len(place)
    assert ended


def test_by_hand(tmp_path: Path) -> None:
    """A straight line that crosses a face at 20.25: the coarse tile has it in the middle of 16 and 32."""
    x, y = np.meshgrid(np.arange(65.0), np.arange(65.0), indexing="ij")
    file = tiled_of(encoded(tmp_path, np.rint(4 * x - 81 + 0 * y).astype(np.int16), 0, precision="exact"))
    contour = file.window([(0, 32), (0, 64)], within=lambda box: 16 if box[1][0] == 0 else 0)
    there = contour.points[contour.cells]
    closing = there[(there[:, :, 1] == 32).all(axis=1)]
    assert sorted(closing[0].tolist()) == [[20.25, 32.0], [24.0, 32.0]] and len(closing) == 1
    # the higher values are on the left: the way along the line keeps its direction
    assert len(contour.lines) == 1


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=12, unique=True))
def test_fillings(corners: list[tuple[int, int]]) -> None:
    """Any loop, crossing itself or not: the edges of what fills it are its own, and pairs; areas add up to its own."""
    points = np.insert(np.array(corners, float), 1, 3.0, axis=1)
    loop = list(range(len(corners)))
    triangles, more = filled(loop, points, 1, set(), len(corners))
    all_points = np.concatenate([points, np.array(more).reshape(-1, 3)])
    assert (all_points[:, 1] == 3).all()
    edges = Counter((a, b) for t in triangles for a, b in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])))
    alone = Counter(edges)
    for a, b in edges:
        alone[a, b] -= edges[b, a]
    wanted = set(zip(loop, [*loop[1:], 0], strict=True))
    assert {edge for edge, count in alone.items() if count > 0} == wanted
    flat = all_points[:, [0, 2]]

    def area(numbers: tuple[int, ...] | list[int]) -> float:
        p, q = flat[list(numbers)], flat[[*numbers[1:], numbers[0]]]
        return float((p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]).sum())

    assert sum(map(area, triangles)) == pytest.approx(area(loop))
