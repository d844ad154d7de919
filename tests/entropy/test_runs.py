"""Runs of symbols of every kind: the limits of symbols and of work bound each, and nothing is held after that."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import isocodec
from explicit_meshes import plane, space
from isocodec import Decoder, Limits
from isocodec.entropy import run as module
from isocodec.entropy.context_layout import Layout, context_coder
from isocodec.entropy.range_coder import code
from isocodec.entropy.run import Account, ReadingRun, WritingRun, whole_run
from isocodec.errors import FormatError, LimitError
from isocodec.field.placement import Placement
from isocodec.format.events import CoordinatesRead, DomainRead, LayerComplete, MaskComplete, MeshLayerComplete
from isocodec.format.kinds import LayerKind
from isocodec.kernel import BAD, DONE, NEED
from isocodec.limits import WORK_STEPS
from isocodec.stream.grid_contents import GridContents
from isoconform.explicit import some_nodes, with_cuts
from isospec.container import ChunkType, DomainKind, MeshLayer
from planned import plan
from tables import looped

# --- runs by themselves -----------------------------------------------------------------------------------------------

LAYOUT = Layout({"one": (2, 0.5, 0), "other": (3, 0.25, 4)})
BITS = np.random.default_rng(1).integers(0, 2, 400).tolist()


def coder(room: int = 0):
    return context_coder(*LAYOUT.begun(), room)


def coded(bits: list[int]) -> bytes:
    run = WritingRun(coder())
    run.room(10)
    for i, bit in enumerate(bits):
        while code(run.coder, i % LAYOUT.count, bit) == NEED:
            run.widen()
    run.check(DONE)
    return run.end()


def decoded(run: ReadingRun, count: int) -> list[int]:
    """Symbols up to what is none."""
    out: list[int] = []
    while len(out) < count and (bit := code(run.coder, len(out) % LAYOUT.count, 0)) >= 0:
        out.append(int(bit))
    return out


def test_blocks_of_contexts_lie_one_behind_the_other():
    assert (LAYOUT["one"], LAYOUT["other"], LAYOUT.count) == (0, 2, 5)
    assert list(LAYOUT.firsts("other", "one")) == [2, 0]
    prob, seen = LAYOUT.begun()
    assert prob.tolist() == [1 << 15, 1 << 15, 1 << 14, 1 << 14, 1 << 14] and seen.tolist() == [0, 0, 4, 4, 4]


@pytest.mark.parametrize("step", [1, 7, 1000])
def test_a_run_comes_back_however_its_bytes_come(step: int):
    data = coded(BITS)
    run, out = ReadingRun(coder(), Account(), 100), []
    run.grant()
    for at in range(0, len(data), step):
        run.feed(data[at : at + step], at + step >= len(data))
        while len(out) < len(BITS) and (bit := code(run.coder, len(out) % LAYOUT.count, 0)) >= 0:
            out.append(int(bit))
    run.end()
    assert out == BITS and run.symbols == len(BITS) and len(data) - 4 <= run.place - 100 <= len(data)


def test_bytes_left_over_and_too_few():
    data = coded(BITS)
    run = whole_run(coder(), data + bytes(5), Account(), 7)
    assert decoded(run, len(BITS)) == BITS
    with pytest.raises(FormatError) as caught:
        run.end()
    assert (caught.value.code, caught.value.offset, caught.value.clause) == ("leftover", 12 + len(data), "6.3")
    run = whole_run(coder(), data[: len(data) // 2], Account())
    assert len(decoded(run, len(BITS))) < len(BITS)
    with pytest.raises(FormatError) as caught:
        run.check(NEED)
    assert caught.value.code == "overrun"
    with pytest.raises(FormatError) as caught:
        run.check(BAD, {3: ("wrong", "1.2")}, 3, "value")
    assert (caught.value.code, caught.value.clause, caught.value.message) == ("value", "1.2", "wrong")


def test_runs_of_a_file_share_an_account(monkeypatch):
    data, account = coded(BITS), Account(symbols=1000, work=80)
    monkeypatch.setattr(module, "WORK_PER_BYTE", 0)
    run = whole_run(coder(), data, account)
    assert decoded(run, len(BITS)) == BITS
    run.end()
    assert (account.symbols, account.units, account.left()) == (400, 50, 30)
    account.spend(10)
    run = whole_run(coder(), data, account, 50)
    assert decoded(run, len(BITS)) == BITS[:160]
    with pytest.raises(LimitError) as caught:
        run.check(code(run.coder, 0, 0))
    assert caught.value.code == "limit-work" and 50 < caught.value.offset < 50 + len(data)
    with pytest.raises(LimitError):
        account.spend(1)
    with pytest.raises(LimitError):
        whole_run(coder(), data, account)
    few = Account(symbols=10)
    run = whole_run(coder(), data, few)
    assert decoded(run, len(BITS)) == BITS[:10]
    with pytest.raises(LimitError) as caught:
        run.check(code(run.coder, 0, 0))
    assert caught.value.code == "limit-symbols"


# --- runs of files ----------------------------------------------------------------------------------------------------

Mesh = tuple[np.ndarray, np.ndarray | None]
PLANE, SPACE = plane(3, 200, 1.0), space(4, 60, 1.0)


def wavy(points: np.ndarray) -> np.ndarray:
    """Integers at points."""
    return np.rint(40 * np.sin(points * 0.07).sum(axis=1) + 20 * np.cos(points[:, 0] * 0.19)).astype(np.int64)


Y, X = np.indices((40, 40))
HILLS = np.rint(40 * np.sin(X / 5) * np.cos(Y / 7) + 6 * np.random.default_rng(2).normal(size=X.shape)).astype(np.int64)


def in_layers() -> bytes:
    return isocodec.encode(HILLS, [0, 10], precision="exact")


def masked() -> bytes:
    return isocodec.encode(isocodec.Field(HILLS, np.hypot(Y - 20, X - 11) < 6), 0)


def with_coordinates() -> bytes:
    y, x = np.indices((60, 50)).astype(float)
    spot = (np.hypot(x - 20, y - 30) < 3).astype(np.uint8)
    where = Placement(coordinates=[x + 0.01 * y**2, y + 0.3 * np.sin(x / 3)])
    return isocodec.encode(isocodec.Field(spot, placement=where), 0.5, precision="signs")


def on_mesh(base: Mesh = PLANE, precision: str | None = None, **options) -> bytes:
    return isocodec.encode(isocodec.Mesh(*base, wavy(base[0]), **options), 3, precision=precision)


def planned(text: str) -> bytes:
    return isocodec.encode(HILLS, 0, layers=plan(text))


def on_cuts() -> bytes:
    return with_cuts(isocodec.Mesh(*PLANE, wavy(PLANE[0])), 3, some_nodes(5), precision="signs")


def surface() -> bytes:
    return isocodec.encode(isocodec.thin(HILLS.astype(float), error=3.0, layers=3))


KINDS: dict[str, tuple[Callable[[], bytes], int]] = {
    "layers": (in_layers, 2),
    "mask": (masked, 2),
    "coordinates": (with_coordinates, 2),
    "signs, offsets": (partial(on_mesh, progressive=False), 2),
    "levels, values": (partial(on_mesh, precision="exact", progressive=True), 3),
    "coded mesh": (partial(on_mesh, stored="whole"), 3),
    "coded mesh of space": (partial(on_mesh, SPACE, stored="whole"), 3),
    "coded points": (partial(on_mesh, (PLANE[0], None)), 3),
    "surface": (surface, 1),
    "adaptive base": (partial(planned, "adaptive-base distortion=2\nadapt distortion=0.5"), 1),
    "offsets": (partial(isocodec.encode, HILLS, 0, precision=0.05, layers=3), 1),
    "cuts": (on_cuts, 1),
}
"""Files, and how many runs they have at least."""


KNOWN = ("signs, offsets", "levels, values", "cuts")
"""Files that do not hold their mesh."""


def kinds_of_runs(kind: str) -> set[object]:
    """What the runs of a file hold: layers of a grid or of a mesh, meshes, a surface, a mask or coordinates."""
    decoder, out = Decoder(mesh=PLANE if kind in KNOWN else None), set[object]()
    decoder.feed(KINDS[kind][0]())
    for event in decoder:
        match event:
            case LayerComplete():
                out.add(event.layer.kind)
            case MeshLayerComplete():
                out.add(MeshLayer[event.kind.upper()])
            case MaskComplete():
                out.add(ChunkType.MASK)
            case CoordinatesRead():
                out.add(ChunkType.COORDINATES)
            case DomainRead():
                out.add(DomainKind.POINTS if decoder.outline.domain is None else decoder.outline.domain.kind)
    return out


def test_every_kind_of_run_is_here():
    """Each one is bounded by the tests below."""
    of_meshes = {*MeshLayer, *DomainKind} - {DomainKind.KNOWN}
    found = set[object]().union(*map(kinds_of_runs, KINDS))
    assert found - {DomainKind.KNOWN} == {*LayerKind, *of_meshes, ChunkType.MASK, ChunkType.COORDINATES}


def decode(kind: str, data: bytes, limits: Limits | None = None) -> None:
    """Decode all runs of a file; where a limit is met, nothing is held of what went beyond it."""
    known = PLANE if kind in KNOWN else None
    decoder = Decoder(limits, mesh=known)
    decoder.feed(data)
    try:
        decoder.close()
    except LimitError:
        assert decoder.memory == 0
        raise
    if kind == "coordinates":
        assert isinstance(decoder.contents, GridContents)
        held = decoder.memory
        try:
            assert decoder.contents.mapped() is not None
        except LimitError:
            assert decoder.memory == held
            raise
        assert decoder.memory > held


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Symbols and units of work of the account at the end of each run."""
    monkeypatch.setattr(module, "WORK_PER_BYTE", 0)
    monkeypatch.setattr(module, "SLICE", 16)
    out: list[tuple[int, int]] = []
    end = ReadingRun.end

    def noted(run: ReadingRun) -> None:
        end(run)
        account = run._account
        out.append((account.symbols, account.units + account.steps // WORK_STEPS))

    monkeypatch.setattr(ReadingRun, "end", noted)
    return out


@pytest.mark.parametrize("kind", KINDS)
def test_symbols_and_work_bound_every_run(kind: str, ended: list[tuple[int, int]]):
    """With one symbol less than a run needs, or half of its work, it is refused; what all need together is enough."""
    make, least = KINDS[kind]
    data = make()
    decode(kind, data)
    needed = list(ended)
    assert len(needed) >= least and all(symbols > 0 for symbols, _ in needed)
    most = max(symbols for symbols, _ in needed)
    ended.clear()
    decode(kind, data, Limits(symbols=most + 1))
    assert ended == needed
    before = 0
    for number, (symbols, units) in enumerate(needed):
        ended.clear()
        with pytest.raises(LimitError) as caught:
            decode(kind, data, Limits(symbols=symbols - 1))
        assert caught.value.code == "limit-symbols" and caught.value.clause == "11.2"
        assert kind == "coordinates" or len(ended) == number
        ended.clear()
        with pytest.raises(LimitError) as caught:
            decode(kind, data, Limits(work=(before + units) // 2))
        assert caught.value.code == "limit-work" and "--limits work=" in str(caught.value)
        assert kind == "coordinates" or len(ended) == number
        before = 0 if kind == "coordinates" else units


@looped("kind", KINDS)
def test_work_grows_with_the_bytes(kind: str):
    """What real files take is allowed for each byte."""
    decode(kind, KINDS[kind][0](), Limits(work=1 if kind == "layers" else 1 << 12))
