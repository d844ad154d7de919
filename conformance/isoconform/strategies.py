"""Strategies of hypothesis for whoever tests an encoder, a decoder, or what stands around them.

=================== ==========================================================================================
``fields()``        arrays of 2 or 3 axes with an isovalue: ties, constants, single cells, odd shapes, extremes
``options(field)``  options of ``isocodec.encode`` that fit it
``files()``         files made from the syntax, not by an encoder: valid, cut off, or with a run that is an error
``damaged_files()`` files with something changed and their checksums repaired
``cuts(data)``      the start of a file
``pieces(data)``    a file in pieces
=================== ==========================================================================================

They need hypothesis, which the extra ``dev`` brings; nothing else here imports them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .damage import damaged
from .fields import checkers
from .meshes import exponent
from .syntax import any_file

try:
    from hypothesis import strategies as st
except ImportError:
    raise ImportError("isoconform.strategies needs hypothesis: pip install '.[dev]'") from None

ISOVALUES = (0, 0.5, -0.5, 1, 2, -1.5, 0.1, 7)
EXTREMES = {"uint8": (0, 255), "int8": (-128, 127), "int16": (-32768, 32767), "int64": (-(2**50), 2**50)}
"""Least and greatest samples of types, as far as they can be exact."""


@st.composite
def shapes(draw: st.DrawFn, most: int = 12) -> tuple[int, ...]:
    """Samples along 2 or 3 axes, at least 2 along each; some next to powers of two, where borders come to lie."""
    n = draw(st.sampled_from((2, 2, 3)))
    side = st.one_of(st.integers(2, most if n == 2 else most // 2), st.sampled_from((2, 3, 4, 5, 6, 8, 9)))
    return tuple(draw(st.lists(side, min_size=n, max_size=n)))


@st.composite
def fields(draw: st.DrawFn, most: int = 12) -> tuple[NDArray[Any], float]:
    """A field and an isovalue.

    Samples are often equal to the isovalue, or next to it, or all the same, or all but one.
    """
    shape = draw(shapes(most))
    isovalue = draw(st.sampled_from(ISOVALUES))
    kind = draw(st.sampled_from(("int8", "int16", "int64", "uint8", "float32", "float64")))
    floor = int(np.floor(isovalue))
    ties = [floor, floor + 1, floor - 1]
    if kind == "uint8":
        ties = [max(tie, 0) for tie in ties]
    sample: st.SearchStrategy[float]
    if kind in EXTREMES:
        sample = st.sampled_from([*ties, *ties, *EXTREMES[kind]]) | st.integers(max(EXTREMES[kind][0], -20), 20)
    else:
        sample = st.sampled_from([*map(float, ties), float(isovalue), -0.0, 5e-324]) | st.floats(-9, 9, width=32)
    one = draw(sample)
    out = np.full(shape, one, kind)
    match draw(st.sampled_from(("any", "any", "two", "single", "constant", "checkers"))):
        case "any":
            count = out.size
            out.flat[:] = draw(st.lists(sample, min_size=count, max_size=count))
        case "two":
            other, bits = draw(sample), draw(st.integers(0, 2**out.size - 1))
            out.flat[[i for i in range(out.size) if bits >> i & 1]] = other
        case "single":
            out[tuple(draw(st.integers(0, side - 1)) for side in shape)] = draw(sample)
        case "checkers":
            out[checkers(shape) > 0] = draw(sample)
    return out, isovalue


@st.composite
def options(draw: st.DrawFn, field: NDArray[Any]) -> dict[str, Any]:
    """Options of ``isocodec.encode`` for a field of few samples; but for the slow search for meshes."""
    full = field.ndim * exponent(field.shape)
    integer = field.dtype.kind in "iu"
    found: dict[str, Any] = {"profile": draw(st.sampled_from(("baseline", "main")))}
    kind = draw(st.sampled_from(("default", "signs", "exact" if integer else "step", "criterion", "plan")))
    if kind == "signs":
        found["precision"] = "signs"
    elif kind == "exact":
        found["precision"] = "exact"
    elif kind == "step":
        found["precision"] = draw(st.sampled_from(("step=0.25", "step=0.1", "step=1.0")))
    elif kind == "criterion":
        found |= {"precision": "signs", "layers": draw(st.sampled_from(("crossing", "topology")))}
    elif kind == "plan":
        found["layers"] = draw(plans(full))
    if kind not in ("criterion", "plan") and draw(st.booleans()):
        found["layers"] = draw(st.integers(0, full))
    return found


@st.composite
def plans(draw: st.DrawFn, full: int) -> list[tuple[Any, ...]]:
    """Plans of signs and offsets on uniform meshes up to level ``full``."""
    level = draw(st.integers(0, full))
    plan: list[tuple[Any, ...]] = [("base", level)]
    for _ in range(draw(st.integers(0, 4))):
        rounds = draw(st.integers(0, full - level))
        level += rounds
        offsets = ("offsets", draw(st.sampled_from((2, 3, 10, 63))))
        plan += [("refine", rounds)] * (rounds > 0)
        plan += [offsets if level == full else (*offsets, draw(st.integers(0, 2)))] * draw(st.integers(0, 1))
    return plan


def files() -> st.SearchStrategy[bytes]:
    """Files made from the syntax (`isoconform.syntax`): some tens of bytes."""
    return st.randoms(use_true_random=False).map(any_file)


@st.composite
def damaged_files(draw: st.DrawFn) -> bytes:
    """Files from the syntax with something changed (`isoconform.damage`)."""
    random = draw(st.randoms(use_true_random=False))
    return damaged(draw(files()), random)


def cuts(data: bytes) -> st.SearchStrategy[bytes]:
    """Starts of a file, the empty one and the whole one included."""
    return st.integers(0, len(data)).map(lambda size: data[:size])


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """A file in pieces of any sizes, some of them empty."""
    places = sorted(draw(st.lists(st.integers(0, len(data)), max_size=8)))
    return [data[i:j] for i, j in zip([0, *places], [*places, len(data)], strict=True)]
