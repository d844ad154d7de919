"""Series of values on meshes: each frame decodes to its own curve, alone or in turn (spec clauses 3.5.7, 10.1.5)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import INTERPRETED, examples
from explicit_meshes import plane, space, torus
from isocodec.api.files import frames_of
from isocodec.errors import FormatError, InputError, IsoError, OptionError, TruncatedError
from isocodec.format.chunks import write_chunk
from isospec.container import ChunkType

ISOVALUES = [20.5, 31.5]
KINDS = {"plane": plane, "space": space, "surface": lambda seed: torus()}


def moving(mesh, frames=4, seed=0, steps=6):
    """Integers that change from frame to frame, here and there by a jump: (F, V)."""
    rng = np.random.default_rng(seed)
    slope = rng.normal(size=mesh[0].shape[1])
    first = np.rint(mesh[0] @ slope * 50 / np.ptp(mesh[0] @ slope)).astype(np.int64) % 60
    out = [first]
    for _ in range(frames - 1):
        jump = np.where(rng.random(len(first)) < 0.05, rng.integers(-40, 40, len(first)), 0)
        out.append(out[-1] + rng.integers(-1, steps, len(first)) + jump)
    return np.array(out)


def pieces(contour):
    """Segments or triangles by their points, in an order that no numbering of the points changes."""
    return sorted(sorted(cell) for cell in contour.points[contour.cells].tolist())


@pytest.mark.cover(2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("options", [{"precision": "signs"}, {"precision": "exact"}, {"precision": 0.5}])
def test_frames_are_those_of_single_files(kind, progressive, options):
    """Whatever they lean on, and whether they are taken in turn or alone."""
    mesh = KINDS[kind](3)
    values = moving(mesh)
    alone = [
        isocodec.open(
            isocodec.encode(isocodec.Mesh(*mesh, each, progressive=progressive), ISOVALUES, **options), mesh=mesh,
        ).contours() for each in values
    ]
    for interval, leaning in ((0, True), (2, True), (0, False)):
        data = isocodec.encode(
            isocodec.Mesh(*mesh, values, progressive=progressive), ISOVALUES, interval=interval,
            order=None if leaning else "independent", **options,
        )
        for found, wanted in zip(isocodec.open(data, mesh=mesh).each_frame(), alone, strict=True):
            assert list(map(pieces, found)) == list(map(pieces, wanted))
        for number, wanted in enumerate(alone):
            one = isocodec.decode(data, frame=number, isovalue=ISOVALUES[1], mesh=mesh)
            assert pieces(one) == pieces(wanted[1])
            assert pieces(isocodec.open(data, mesh=mesh).contours(frame=number)[0]) == pieces(wanted[0])


@examples(40)
@given(
    seed=st.integers(0, 999), kind=st.sampled_from(sorted(KINDS)), progressive=st.booleans(),
    options=st.sampled_from([{"precision": "signs"}, {"precision": "exact"}, {"precision": 2.0}]),
    values=st.sampled_from(["noise", "still", "opposite", "empty"]),
)
def test_any_frames(seed, kind, progressive, options, values):
    """Noise, frames that do not change, that change all signs, and frames without a curve among others."""
    mesh = KINDS[kind](seed)
    rng = np.random.default_rng(seed)
    first = rng.integers(0, 40, len(mesh[0]))
    frames = {
        "noise": rng.integers(0, 40, (3, len(first))), "still": np.array([first, first, first]),
        "opposite": np.array([first, 41 - first, first]), "empty": np.array([first, 0 * first, first]),
    }[values]
    data = isocodec.encode(isocodec.Mesh(*mesh, frames, progressive=progressive), 20.5, **options)
    for each, found in zip(frames, isocodec.open(data, mesh=mesh).each_frame(), strict=True):
        one = isocodec.encode(isocodec.Mesh(*mesh, each, progressive=progressive), 20.5, **options)
        assert pieces(found[0]) == pieces(isocodec.decode(one, mesh=mesh))


def test_a_mesh_in_the_file_is_there_once():
    """It has the cells that any frame crosses."""
    mesh = plane(5, 60, kept=1)
    values = moving(mesh)
    data = isocodec.encode(isocodec.Mesh(*mesh, values, stored="coded"), 20.5, precision="signs")
    for each, found in zip(values, isocodec.open(data).each_frame(), strict=True):
        assert len(found[0].cells) == len(
            isocodec.decode(isocodec.encode(isocodec.Mesh(*mesh, each), 20.5), mesh=mesh).cells
        )
    assert isocodec.open(data).info.interval == 16 and len(isocodec.open(data).info.frames) == 4


def test_any_piece_of_a_file():
    """Fed in pieces, cut anywhere, or begun at a key frame."""
    mesh = plane(2)
    values = moving(mesh)
    data = isocodec.encode(isocodec.Mesh(*mesh, values), ISOVALUES, interval=2)
    whole = [list(map(pieces, each)) for each in isocodec.open(data, mesh=mesh).each_frame()]
    fed = frames_of([data[i : i + 7] for i in range(0, len(data), 7)], mesh=mesh)
    assert [list(map(pieces, each)) for each in fed] == whole
    for cut in range(20, len(data), 11):
        decoder = isocodec.Decoder(mesh=mesh)
        decoder.feed(data[:cut])
        with pytest.raises(TruncatedError):
            decoder.close()
    for at in range(0, len(data) - 4):
        damaged = bytearray(data)
        damaged[at] ^= 0x10
        with pytest.raises(IsoError):
            isocodec.open(bytes(damaged), mesh=mesh).contours(frame=3)


def test_wrong_series():
    mesh = plane(2)
    values = moving(mesh)
    data = isocodec.encode(isocodec.Mesh(*mesh, values), 20.5)
    with pytest.raises(OptionError, match="0 to 3"):
        isocodec.decode(data, frame=4, mesh=mesh)
    with pytest.raises(OptionError, match="interval"):
        isocodec.encode(isocodec.Mesh(*mesh, values), 20.5, interval=-1)
    with pytest.raises(InputError, match="without frames"):
        isocodec.encode(isocodec.Mesh(*mesh, values[:0]), 20.5)
    with pytest.raises(InputError, match="shape"):
        isocodec.encode(isocodec.Mesh(*mesh, values[:, 1:]), 20.5)
    # a chunk that begins a series behind the layers of the first frame, and a frame of no series
    one = isocodec.encode(isocodec.Mesh(*mesh, values[0]), 20.5)
    last = isocodec.open(one).info.chunks[-1]
    for chunk in ((ChunkType.SERIES, b"\0"), (ChunkType.FRAME, b"")):
        decoder = isocodec.Decoder(mesh=mesh)
        decoder.feed(one[: last.offset] + write_chunk(*chunk))
        with pytest.raises(FormatError) as error:
            for _ in decoder:
                pass
        assert error.value.clause == "3.5.7"


@pytest.mark.skipif(INTERPRETED, reason="a large mesh")
def test_frames_of_nothing_are_work():
    """Two bytes begin a frame, for which the whole mesh is looked at."""
    mesh = plane(3, 40_000, 1.0)
    data = isocodec.encode(
        isocodec.Mesh(*mesh, np.stack([mesh[0][:, 0]] * 2), progressive=False), 50.5, precision="signs",
    )
    first = next(
        event.offset for event in _events(data, mesh) if isinstance(event, isocodec.format.events.MeshLayerComplete)
    )
    decoder = isocodec.Decoder(isocodec.Limits(work=10_000), mesh=mesh)
    decoder.feed(data[:first])
    assert len(list(decoder)) == 4
    decoder.feed(write_chunk(ChunkType.FRAME, b"") * 20_000)
    with pytest.raises(isocodec.errors.LimitError) as caught:
        list(decoder)
    assert caught.value.code == "limit-work"


def _events(data, mesh):
    decoder = isocodec.Decoder(mesh=mesh)
    decoder.feed(data)
    return list(decoder)
