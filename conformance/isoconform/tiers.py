"""What decoding a file needs, in the counts of the tiers of conformance (spec clause 11.3)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import astuple, dataclass

from isocodec import Decoder
from isocodec.errors import TruncatedError
from isocodec.format.events import End, FrameRead, LayerComplete
from isocodec.grid.lattice.store import PAGES
from isocodec.grid.passes.runner import Tube
from isocodec.limits import BLOCKS, TIERS

BEYOND = max(TIERS) + 1
"""In place of a tier, of files that no tier has to decode."""


@dataclass(frozen=True)
class Needs:
    """The counts of a file."""

    vertices: int
    simplices: int
    symbols: int
    steps: int
    isovalues: int
    blocks: int

    @property
    def tier(self) -> int:
        """The lowest tier whose decoders have to decode the file, or ``BEYOND``."""
        for tier, counts in sorted(TIERS.items()):
            if all(need <= most for need, most in zip(astuple(self), (*counts, BLOCKS[tier]), strict=True)):
                return tier
        return BEYOND


def needs(data: bytes) -> Needs:
    """The counts of a file that the reference decoder decodes, or of what there is of one that is cut off."""
    decoder = Decoder()
    decoder.feed(data)
    leaves = vertices = blocks = steps = 0
    for event in decoder:
        if isinstance(event, FrameRead) and event.number == 0:
            steps += sum(tube.steps for tube in decoder.grid.tubes_before if tube)
        if isinstance(event, (LayerComplete, End)):
            tubes = [tube for tube in (*decoder.grid.tubes_before, *decoder.grid.tubes) if tube]
            leaves = max(leaves, sum(tube.simplices for tube in tubes))
            vertices = max(vertices, sum(tube.vertices for tube in tubes))
            blocks = max(blocks, sum(map(_blocks, tubes)))
    if not decoder.complete:
        with suppress(TruncatedError):
            decoder.close()
    if decoder.header is None:
        return Needs(0, 0, 0, 0, 0, 0)
    tubes = [tube for tube in (*decoder.grid.tubes_before, *decoder.grid.tubes) if tube]
    steps += sum(tube.steps for tube in decoder.grid.tubes if tube)
    return Needs(
        vertices=max(vertices, sum(tube.vertices for tube in tubes)),
        simplices=max(leaves, sum(tube.simplices for tube in tubes)),
        symbols=sum(decoder.grid.symbols.values()),
        steps=steps,
        isovalues=len(decoder.isovalues),
        blocks=max(blocks, sum(map(_blocks, tubes))),
    )


def _blocks(tube: Tube) -> int:
    """Blocks that hold a vertex of an isovalue."""
    return sum(int(store.head[PAGES]) for store in (tube.state.known, tube.state.mesh))
