"""Runs a decoder over vectors and says where it disagrees."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from isocodec.errors import FormatError, LimitError
from isocodec.limits import TIERS

from .decoders import Decoder, Request
from .dump import COMPLETE, CUT_OFF, NO_COORDINATES, OTHER_MESH, REFUSED, parted
from .dump_file import dump_file
from .manifest import ERROR, LIMIT, NO_MESH, OK, Vector, digest

REFUSALS = {LIMIT: LimitError.exit_code, NO_MESH: OTHER_MESH}
"""Exit code, by status, of files that are neither decoded nor malformed as far as a decoder has to look."""
Decode = Callable[[Path, int], tuple[int, str]]
"""A decoder: a file and the layers to decode (0: all) in; exit code and canonical text out."""


@dataclass(frozen=True)
class Result:
    """What became of a vector; ``reason`` is empty if all is well."""

    name: str
    reason: str = ""

    @property
    def passed(self) -> bool:
        """Whether the decoder agrees."""
        return not self.reason


def reference(path: Path, layers: int) -> tuple[int, str]:
    """The reference decoder, in this process."""
    output = dump_file(path, layers=layers)
    return output.exit_code, output.text + output.coordinates * bool(output.text)


class DecoderFailed(Exception):
    """The decoder did not come to an answer."""


def asked(decoder: Decoder) -> Decode:
    """A decoder under test, one question after the other.

    Raises
    ------
    DecoderFailed
        From what is returned: the decoder died, took too long, or does not take numbers of layers.
    """

    def decode(path: Path, layers: int) -> tuple[int, str]:
        decoder.ask(Request(path, layers))
        answer = decoder.answer()
        if answer is None:
            raise DecoderFailed("it does not take a number of layers")
        if answer.trouble:
            raise DecoderFailed(answer.trouble)
        return answer.code, answer.text

    return decode


def run(
    vectors: Sequence[Vector], directory: Path, decode: Decode, *, layers: bool = False, tier: int = max(TIERS)
) -> Iterator[Result]:
    """Run a decoder over vectors, one result each.

    Parameters
    ----------
    layers : bool
        Also compare the states after each layer, where the manifest states them.
    tier : int
        Level of conformance that the decoder is to have: what needs a higher one it may refuse with exit code 6.
    """
    for vector in vectors:
        try:
            reason = _check(vector, directory, decode, layers, tier)
        except DecoderFailed as failed:
            reason = str(failed)
        yield Result(vector.name, reason)


def _check(vector: Vector, directory: Path, decode: Decode, layers: bool, tier: int) -> str:
    path = directory / vector.file
    if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != vector.sha256:
        return "the file is missing or is not the one of the manifest"
    code, text = decode(path, 0)
    if vector.expected.status == ERROR:
        if code not in REFUSED:
            return f"exit code {code}, expected {REFUSED[0]}: the file violates clause {vector.expected.clause}"
        return "refused, but with a text" if text else ""
    if vector.tier > tier and code == LimitError.exit_code:
        return "over the limits, but with a text" if text else ""
    if vector.expected.status in REFUSALS:
        codes = [REFUSALS[vector.expected.status]]
        if vector.expected.clause:
            # that of a decoder that goes on
            codes.append(FormatError.exit_code)
        if code not in codes:
            return f"exit code {code}, expected {' or '.join(map(str, codes))}"
        return "refused, but with a text" if text else ""
    wanted = COMPLETE if vector.expected.status == OK else CUT_OFF
    if code != wanted:
        return f"exit code {code}, expected {wanted}"
    text, coordinates = parted(text)
    if digest(text) != vector.expected.state:
        return difference(_stored(path), text) or _counts(vector, text)
    if coordinates and digest(coordinates) != (vector.expected.coordinates or digest(NO_COORDINATES)):
        return "other coordinates"
    for number, layer in enumerate(vector.layers if layers else [], 1):
        code, text = decode(path, number)
        text = parted(text)[0]
        name = f"after layer {number} ({layer.kind}, level {layer.level}): "
        if code != COMPLETE:
            return f"{name}exit code {code}, expected {COMPLETE}"
        if digest(text) != layer.state:
            return f"{name}another state"
    return ""


def _stored(path: Path) -> str | None:
    text = path.with_suffix(".txt")
    return text.read_bytes().decode("ascii") if text.is_file() else None


def difference(expected: str | None, text: str) -> str:
    """The first number in which two texts differ; empty if that cannot be said."""
    if expected is None:
        return ""
    pairs = zip_longest(expected.splitlines(), text.splitlines())
    for number, (wanted, found) in enumerate(pairs, 1):
        if wanted == found:
            continue
        if found is None:
            return f"line {number} is missing: {wanted!r}"
        if wanted is None:
            return f"line {number} is one too many: {found!r}"
        for place, (a, b) in enumerate(zip_longest(wanted.split(" "), found.split(" ")), 1):
            if a != b:
                return f"line {number}, word {place}: {b or 'nothing'}, expected {a or 'nothing'} (in {wanted!r})"
    return "the last line has no newline, or lines end otherwise" if expected != text else ""


def _counts(vector: Vector, text: str) -> str:
    lines = text.splitlines()
    found = [sum(line.startswith(f"{kind} ") for line in lines) for kind in "ve"]
    expected = vector.expected
    return (
        f"another state: {found[0]} vertices and {found[1]} edges, "
        f"expected {expected.vertices} and {expected.edges}"
    )
