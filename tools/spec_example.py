"""Write annex C's examples (``spec/example.md``) anew: ``ISOCODEC_KERNELS=python python tools/spec_example.py``."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "conformance"))

import isocodec
from isocodec.entropy import guesses, mixer, range_coder
from isocodec.grid.models.trained import members
from isocodec.mesh import walk
from isocodec.mesh.models import CONTEXT, MIX_SIGN, MIX_VALUE
from isocodec.stream.mesh_contents import MeshContents
from isoconform.explicit_dump import dump_explicit
from isoconform.trace import Symbol, Tracer, replaced
from isospec.tables import HIDDEN, KINDS, MOST_LOGIT, STARTS

SPEC = Path(__file__).resolve().parent.parent / "spec" / "example.md"
BEGIN, END = "<!-- {}: tools/spec_example.py -->\n", "<!-- end of {} -->\n"
FIELD = np.array([[1, 2, 2, 1], [2, 6, 7, 2], [1, 5, 8, 3], [0, 2, 3, 1]])
ISOVALUE = 4.5
RUN = 13
"""Byte at which the run begins."""
SHOWN = (7, 15, 26)
"""Mixed symbols of the main profile: behind a gate, of a refinement, of a value."""
SUMS = 8
"""Sums of rows that are shown of each."""
POINTS = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [1, 2]])
CELLS = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
VALUES = np.array([1, 4, 9, 2, 6])


def example() -> bytes:
    """The file that annex C explains."""
    return isocodec.encode(FIELD, ISOVALUE, precision="exact", layers=2, profile="baseline")


def main_example() -> bytes:
    """The same in the main profile."""
    return isocodec.encode(FIELD, ISOVALUE, precision="exact", layers=2, profile="main")


def mesh_example() -> bytes:
    """Signs and values at the vertices of four triangles, which decoders have."""
    mesh = isocodec.Mesh(POINTS, CELLS, VALUES, stored="known", progressive=False)
    return isocodec.encode(mesh, ISOVALUE, precision="exact")


def table(heads: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


# --- baseline -------------------------------------------------------------------------------------------------------


def rows(run: bytes, symbols: list[Symbol]) -> Iterator[Sequence[object]]:
    """A row of the table for each symbol, with the state of the range coder before it (clause 6.2)."""
    width, code, shifts = 1 << 32, int.from_bytes(run[:4], "big"), 0
    for number, symbol in enumerate(symbols, 1):
        bound = width * symbol.probability >> 16
        assert (width, int(code < bound)) == (symbol.width, symbol.bit)
        says = "; ".join(symbol.says).replace(", 1 bits missing", ", 1 bit missing")
        state = (f"{x:08x}" for x in (width, code, bound))
        yield number, symbol.element, symbol.context, symbol.probability, *state, symbol.bit, says
        width, code = (bound, code) if symbol.bit else (width - bound, code - bound)
        while width < 1 << 24:
            code = code << 8 | (run[shifts + 4] if shifts + 4 < len(run) else 0)
            width, shifts = width << 8, shifts + 1


def text() -> str:
    """Bytes and symbols, as the annex shows them."""
    data = example()
    heads = ("no.", "element", "context", "p", "range", "code", "bound", "bit", "what it says")
    return f"{_bytes(data)}\n{table(heads, rows(data[RUN:-4], Tracer(data).symbols))}"


def _bytes(data: bytes) -> str:
    return f"{len(data)} bytes: `{data.hex(' ')}`\n"


# --- mixed symbols --------------------------------------------------------------------------------------------------


@dataclass
class Mixed:
    """A symbol as it is coded (clause 7.11).

    ``network`` is None and ``listed`` empty where there is none; ``listed`` are the rows of ``weight``, in ascending
    order. ``models`` are p and seen before and after the symbol, of each of the ``contexts``; ``weights`` and
    ``after`` those before and after it.
    """

    p: int
    bit: int
    network: int | None = None
    flip: bool = False
    kind: int = -1
    listed: list[int] = field(default_factory=list)
    sums: list[int] = field(default_factory=list)
    total: int = 0
    contexts: list[int] = field(default_factory=list)
    models: list[tuple[int, int, int, int]] = field(default_factory=list)
    opinions: list[int] = field(default_factory=list)
    weights: list[int] = field(default_factory=list)
    after: list[int] = field(default_factory=list)
    says: list[str] = field(default_factory=list)


@contextmanager
def heard(symbols: list[Mixed]) -> Iterator[None]:
    """Enter every symbol that is decoded into a list."""
    emit, code, blended, decided = range_coder.emit, range_coder.code, mixer.blended, guesses.decided
    learn, uniform, near_guess = walk._learn, walk.uniform, guesses.near_guess
    rows_of = members(2)

    def emitted(cd: Any, p: int, bit: int) -> int:
        bit = emit(cd, p, bit)
        if bit >= 0:
            symbols.append(Mixed(int(p), int(bit)))
        return bit

    def states(cd: Any, contexts: Sequence[int]) -> list[tuple[int, int]]:
        return [(int(cd.prob[c]), int(cd.seen[c])) for c in contexts]

    def follow(cd: Any, kind: int, contexts: list[int], opinions: list[int], decode: Any) -> tuple[int, Mixed | None]:
        weights, models = cd.blend.mix[kind].tolist(), states(cd, contexts)
        bit = decode()
        if bit < 0:
            return bit, None
        mixed, count = symbols[-1], len(opinions)
        mixed.kind, mixed.contexts, mixed.opinions = int(kind), contexts, opinions
        mixed.weights, mixed.after = weights[:count], cd.blend.mix[kind].tolist()[:count]
        mixed.models = [(*old, *new) for old, new in zip(models, states(cd, contexts), strict=True)]
        return bit, mixed

    def by_context(cd: Any, context: int, bit: int) -> int:
        before = states(cd, [context])[0]
        bit = code(cd, context, bit)
        if bit >= 0:
            symbols[-1].contexts, symbols[-1].models = [int(context)], [(*before, *states(cd, [context])[0])]
        return bit

    def by_network(cd: Any, net: int, flip: bool, kind: int, context: int, bit: int) -> int:
        bl = cd.blend
        listed = rows_of[bl.row[1 : bl.row[0] + 1]]
        listed = np.sort(listed[listed >= 0])
        sums = bl.weight[listed].astype(np.int64).sum(axis=0)
        total = int(bl.out[net, HIDDEN] + np.maximum(sums, 0) @ bl.out[net, :HIDDEN].astype(np.int64))
        said = min(max(total >> mixer.OUT_SHIFT, -MOST_LOGIT), MOST_LOGIT) * (-1 if flip else 1)
        place = STARTS + (kind - KINDS) * mixer.BUCKETS + ((said + MOST_LOGIT) >> mixer.BUCKET)
        opinions = [said, int(mixer.stretched(cd, context)), int(mixer.stretched(cd, place)), 256]
        contexts = [int(context), int(place)]
        bit, mixed = follow(cd, kind, contexts, opinions, lambda: blended(cd, net, flip, kind, context, bit))
        if mixed:
            mixed.network, mixed.flip, mixed.listed, mixed.sums = int(net), bool(flip), listed.tolist(), sums.tolist()
            mixed.total = total
        return bit

    def by_opinions(cd: Any, kind: int, bit: int) -> int:
        row = cd.blend.row[1 : 2 * cd.blend.row[0] + 1].reshape(-1, 2).tolist()
        contexts = [context for context, _ in row if context >= 0]
        return follow(cd, kind, contexts, [logit for _, logit in row], lambda: decided(cd, kind, bit))[0]

    def learned(st: Any, v: int, sign: int, estimate: int) -> None:
        learn(st, v, sign, estimate)
        symbols[-1].says.append(f"{v} {'above' if sign else 'below'}, estimate {st.estimate[v]}")

    def chosen(cd: Any, low: int, high: int, number: int) -> int:
        number = uniform(cd, low, high, number)
        symbols[-1].says.append(f"cell {number}")
        return number

    def guessed(cd: Any, kind: int, context: int, count: int, bells: Any, number: int) -> int:
        guess, width = bells[:2].tolist()
        number = near_guess(cd, kind, context, count, bells, number)
        symbols[-1].says.append(f"N = {number}; guess {guess}, width {width}")
        return number

    with replaced([
        (emit, emitted), (code, by_context), (blended, by_network), (decided, by_opinions), (learn, learned),
        (uniform, chosen), (near_guess, guessed),
    ]):
        yield


def main_text() -> str:
    """Bytes, and all numbers of a few mixed symbols of the main profile."""
    data, symbols = main_example(), list[Mixed]()
    with heard(symbols):
        traced = Tracer(data).symbols
    baseline = Tracer(example()).symbols
    assert [(s.element, s.bit) for s in traced] == [(s.element, s.bit) for s in baseline]
    shown = [symbols[number - 1] for number in SHOWN]
    columns = [dict(_numbers(mixed)) for mixed in shown]
    names = list(dict.fromkeys(name for column in columns for name in column))
    heads = ["", *(f"{n}: {traced[n - 1].element} of {_subject(traced[n - 1])}" for n in SHOWN)]
    body = [[name, *(column.get(name, "-") for column in columns)] for name in names]
    probabilities = ", ".join(str(s.p) for s in symbols)
    return f"{_bytes(data)}\n{table(heads, body)}\n`p` of all symbols in turn: {probabilities}.\n"


def _subject(symbol: Symbol) -> str:
    """The vertex that a symbol is about."""
    return symbol.says[0].partition(")")[0] + ")"


def _numbers(mixed: Mixed) -> Iterator[tuple[str, str]]:
    def several(numbers: Iterable[int]) -> str:
        return ", ".join(map(str, numbers))

    if mixed.network is not None:
        yield "network, kind, flip", f"{mixed.network}, {mixed.kind}, {'yes' if mixed.flip else 'no'}"
        yield "rows", several(mixed.listed)
        yield f"`sum`, first {SUMS}", several(mixed.sums[:SUMS])
        yield "`total`", str(mixed.total)
    else:
        yield "network, kind, flip", f"none (7.15), set {mixed.kind - KINDS}"
    yield "contexts", several(mixed.contexts)
    yield "their `p` and `seen`", "; ".join(f"{p}, {seen}" for p, seen, _, _ in mixed.models)
    yield "opinions", several(mixed.opinions)
    yield "weights", several(mixed.weights)
    product = sum(w * o for w, o in zip(mixed.weights, mixed.opinions, strict=True))
    yield "`x`", str(min(max(product >> mixer.MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT))
    yield "`p`", str(mixed.p)
    yield "bit, `error`", f"{mixed.bit}, {mixer.RATE * (65536 * mixed.bit - mixed.p)}"
    yield "weights after", several(mixed.after)
    yield "`p` and `seen` after", "; ".join(f"{p}, {seen}" for _, _, p, seen in mixed.models)


# --- a mesh ---------------------------------------------------------------------------------------------------------

MESH_BYTES = (
    (4, "signature (3.3.1)"),
    (1, "versions (3.3.1)"),
    (1, "explicit, isovalue in halves, two axes, profile 1 (3.3.2)"),
    (1, "isovalue 9/2 (3.3.4)"),
    (1, "head of a chunk: critical, type 10 (3.4.1)"),
    (1, "length of the payload"),
    (1, "kind 0, known; `d = n` (3.5.8)"),
    (1, "zigzag: `e = -17`"),
    (2, "5 vertices, 4 cells"),
    (16, "beginning of the SHA-256 (10.1.2(1))"),
    (2, "head of a chunk of type 1, length"),
    (1, "kind 0, signs (10.1.3)"),
    (2, "run"),
    (2, "head of the last chunk, of type 1; length"),
    (1, "kind 2, values"),
    (2, "2 bits below, 3 bits above"),
    (2, "run"),
    (4, "CRC-32 (3.4.4)"),
)
"""Parts of the file of a mesh: bytes, and what they are."""

MESH_CONTEXTS = ("COMPONENT", "FIRST", "SIGN_SURE", "SIGN_RING", "SIGN_PAST", "SIGN_BOTH", "VALUE")
"""Elements that its symbols have contexts of."""


def mesh_text() -> str:
    """Bytes, symbols and state of the file of a mesh."""
    data, symbols, at, parts = mesh_example(), list[Mixed](), 0, []
    for size, meaning in MESH_BYTES:
        parts.append((at, data[at : at + size].hex(" "), meaning))
        at += size
    assert at == len(data)
    decoder = isocodec.Decoder(mesh=(POINTS, CELLS))
    with heard(symbols):
        decoder.feed(data)
        for _ in decoder:
            pass
        decoder.close()
    assert isinstance(decoder.contents, MeshContents)
    active = decoder.contents.strand(0).active
    assert active is not None
    vertices = iter(active[:, 0].tolist())
    body = [(number, *_mesh_symbol(symbol, vertices)) for number, symbol in enumerate(symbols, 1)]
    heads = ("no.", "contexts", "opinions", "p", "bit", "what it says")
    state = "".join(f"    {line}\n" for line in dump_explicit(data, (POINTS, CELLS)).text.splitlines())
    return f"{_bytes(data)}\n{table(('offset', 'bytes', 'meaning'), parts)}\n{table(heads, body)}\n{state}"


def _mesh_symbol(symbol: Mixed, vertices: Iterator[int]) -> tuple[str, str, int, int, str]:
    contexts = []
    for context in symbol.contexts:
        name = max((name for name in MESH_CONTEXTS if CONTEXT[name] <= context), key=lambda name: CONTEXT[name])
        contexts.append(f"{name}+{context - CONTEXT[name]}")
    weights = ""
    if symbol.kind >= 0:
        name, first = ("MIX_VALUE", MIX_VALUE) if symbol.kind >= MIX_VALUE else ("MIX_SIGN", MIX_SIGN)
        weights = f"; {name}+{symbol.kind - first}"
    says = "; ".join(f"vertex {next(vertices)}: {each}" if each.startswith("N") else each for each in symbol.says)
    opinions = ", ".join(map(str, symbol.opinions)) + weights
    return ", ".join(contexts) or "none", opinions, symbol.p, symbol.bit, says


def main() -> None:
    spec = SPEC.read_text(encoding="utf-8")
    for name, made in (("example", text), ("main", main_text), ("mesh", mesh_text)):
        before, rest = spec.split(BEGIN.format(name))
        spec = before + BEGIN.format(name) + "\n" + made() + "\n" + END.format(name) + rest.split(END.format(name))[1]
    SPEC.write_text(spec, encoding="utf-8")


if __name__ == "__main__":
    main()
