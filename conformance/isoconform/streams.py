"""Files taken apart and put together again: runs coded in any order of layers, chunks of any kind."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isocodec.entropy.context_layout import context_coder
from isocodec.entropy.range_coder import Coder
from isocodec.entropy.run import WritingRun
from isocodec.field.samples import Samples
from isocodec.format.chunks import CHECKSUM_BYTES, read_envelope, read_metadata, write_metadata
from isocodec.format.header import Header, read_header, write_header
from isocodec.format.program import Layer, Progress, read_program, write_program
from isocodec.grid.lattice.vertex_set import Chosen
from isocodec.grid.layers.beginning import begin_layer
from isocodec.grid.models.contexts import models
from isocodec.grid.passes.runner import Tube
from isocodec.kernel import DONE
from isocodec.limits import Limits
from isocodec.search.ground_truth import GroundTruth
from isocodec.stream.decoder import Decoder
from isocodec.stream.promises import PROMISE
from isospec.container import Checksum, ChunkHead, ChunkType, OperationByte, write_varint


@dataclass(frozen=True)
class Chunk:
    """A chunk before its envelope."""

    type: int
    payload: bytes
    ancillary: bool = False
    checked: bool = False

    def enveloped(self, *, last: bool = False) -> bytes:
        """With head, length and, where it has one, its own checksum."""
        head = {"ancillary": self.ancillary, "checked": self.checked, "last": last, "type": self.type}
        whole = ChunkHead.build(head) + write_varint(len(self.payload)) + self.payload
        return whole + (Checksum.build(zlib.crc32(whole)) if self.checked else b"")


@dataclass(frozen=True)
class File:
    """A file in parts; ``bytes(file)`` puts them together, with right lengths, flags and checksums.

    With ``ends_early`` the last chunk states a byte more than it has, and nothing follows.
    """

    header: bytes
    chunks: tuple[Chunk, ...]
    ends_early: bool = False

    def __bytes__(self) -> bytes:
        last = len(self.chunks) - 1
        if self.ends_early:
            *whole, short = self.chunks
            begun = replace(short, payload=short.payload + b"\0", checked=False).enveloped(last=True)
            return self.header + b"".join(c.enveloped() for c in whole) + begun[:-1]
        return closed(self.header + b"".join(c.enveloped(last=i == last) for i, c in enumerate(self.chunks)))

    def with_header(self, at: int, value: int) -> File:
        """The same with one byte of the header replaced."""
        return replace(self, header=self.header[:at] + bytes([value]) + self.header[at + 1 :])

    def with_chunks(self, *chunks: Chunk) -> File:
        """The same with other chunks."""
        return replace(self, chunks=chunks, ends_early=False)


def bare(data: bytes) -> bytes:
    """A file without what it promises: a chunk, and a note."""
    file, kept = split(data), []
    for chunk in file.chunks:
        if chunk.type == ChunkType.METADATA:
            notes = {name: text for name, text in read_metadata(chunk.payload).items() if name != PROMISE}
            kept += [replace(chunk, payload=write_metadata(notes))] if notes else []
        elif chunk.type != ChunkType.PROMISES:
            kept.append(chunk)
    return bytes(file.with_chunks(*kept))


def closed(data: bytes) -> bytes:
    """Append the checksum of a file."""
    return data + Checksum.build(zlib.crc32(data))


def reopened(data: bytes) -> bytes:
    """A file without its checksum."""
    return data[:-CHECKSUM_BYTES]


def split(data: bytes) -> File:
    """A valid file in parts."""
    found = read_header(data)
    assert found is not None
    at = found[1]
    header, chunks, last = data[:at], [], False
    while not last:
        envelope = read_envelope(data, at)
        assert envelope is not None
        payload = data[envelope.start : envelope.end]
        chunks.append(Chunk(envelope.type, payload, envelope.ancillary, envelope.checked))
        at, last = envelope.end + CHECKSUM_BYTES * envelope.checked, envelope.last
    return File(header, tuple(chunks))


def program_length(data: bytes) -> int:
    """Bytes of the layer program of a file's first run."""
    decoder = Decoder()
    decoder.feed(data)
    for _ in decoder:
        pass
    return decoder.grid.runs[0].start - decoder.grid.runs[0].program_start


Step = tuple[int, int] | bytes


def steps_of(*steps: Step) -> bytes:
    """A program of operations; bytes stand for numbers that follow the operation before."""
    places = [i for i, step in enumerate(steps) if isinstance(step, tuple)]
    return b"".join(
        step if isinstance(step, bytes)
        else OperationByte.build({"more": i != places[-1], "operation": step[0], "argument": step[1]})
        for i, step in enumerate(steps)
    )


def layers(program: bytes, run: bytes) -> Chunk:
    """A chunk of layers."""
    return Chunk(ChunkType.LAYERS, program + run)


def encoding_tube(field: Samples) -> Tube:
    """A tube that encodes a field."""
    return Tube(field.values.shape, _coder(), Limits(), GroundTruth(field.signs, field.numbers, field.crossings))


def sign_tube(shape: tuple[int, ...], signs: NDArray[np.bool_]) -> Tube:
    """A tube that encodes signs alone; interpreted kernels take any object that answers to ``signs[x, y, z]``."""
    return Tube(shape, _coder(), Limits(), GroundTruth(signs, _none, _none))


def _coder() -> Coder:
    return context_coder(*models(), 1 << 16)


def _none(*_: object) -> NDArray[np.int64]:
    raise AssertionError("a vector of signs alone has no geometry")


def planned(
    header: Header, tube: Tube, plan: Sequence[Sequence[Layer]], bits: tuple[int, int] = (0, 0),
    meshes: Iterable[Chosen] = (),
) -> File:
    """A file with any layers in any order that the format allows.

    Parameters
    ----------
    header : Header
    tube : Tube
        Fresh, of the header's shape.
    plan : sequence of sequences of Layer
        Layers by run, each run a chunk of its own.
    bits : tuple of int
        Bits of the numbers above and below the isovalue, for layers of values; all samples' numbers must fit.
    meshes : iterable of Chosen
        Those that the adaptive layers lead to, in their order.
    """
    ahead = iter(meshes)
    progress = Progress(tube.full_level)
    tube.estimates.bits = bits
    chunks = []
    for run in plan:
        coded = WritingRun(tube.coder)
        for layer in run:
            if layer.kind in ("adaptive_base", "adapt"):
                tube.choose(next(ahead))
            begin_layer(tube, layer)
            # the buffer holds any run of a vector
            assert tube.advance() == DONE
        before = Progress(**vars(progress))
        program = write_program(run, progress, bits)
        found = read_program(program, 0, len(program), before)
        assert found is not None and found[0] == list(run), "no program says this"
        chunks.append(layers(program, coded.end()))
    return File(write_header(header), tuple(chunks))


def rounds(first: int, last: int) -> list[Layer]:
    """Rounds of refinement that lead to the levels ``first`` to ``last``."""
    return [Layer("refine", level) for level in range(first, last + 1)]
