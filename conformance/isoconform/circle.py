"""A circle of 200 cells in a domain of 100,000 x 100,000: decoding must follow the curve, not the domain.

Nobody holds ten thousand million samples: the encoder is given an object that works out a sign when asked for it, by
integers. Compiled kernels take arrays only, so this module runs them as plain Python, in a process of its own
(``python -m isoconform.circle``, see ``drafts``). There, and only there, ``main`` replaces what looks at the field
as a whole by what knows where the circle is: the blocks that the curve passes, the cubes that see both signs, the
search for new components. The symbols coded are those of the ordinary encoder.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from isocodec.format.header import Header
from isocodec.format.program import Layer
from isocodec.grid.passes import new_components
from isocodec.search import component_search, ground_truth, mixed_leaves

from .draft import Draft
from .plain import environment
from .streams import planned, rounds, sign_tube

SIDE = 100_000
CENTRE = (61803, 38197)
"""In samples."""
RADIUS = 100
FULL = 34
COARSE = 22
"""Level of cubes of 64 samples: fine enough to see the circle, coarse enough to leave twelve rounds."""
PLANS = {
    "circle_100000": [Layer("base", FULL)],
    "circle_100000_rounds": [Layer("base", COARSE), *rounds(COARSE + 1, FULL)],
}


class Circle:
    """Signs of a field that is positive within the circle, as the encoder asks for them."""

    shape = (SIDE, SIDE, 1)

    def reshape(self, *_: object) -> Circle:
        """The same; it has three axes already."""
        return self

    def __getitem__(self, place: tuple[int, int, int]) -> bool:
        x, y = int(place[0]) - CENTRE[0], int(place[1]) - CENTRE[1]
        return x * x + y * y < RADIUS * RADIUS


def passes(low: tuple[int, int], high: tuple[int, int]) -> bool:
    """Whether the circle may pass a box of samples, its ends included."""
    near = far = 0
    for a in range(2):
        before, behind = low[a] - CENTRE[a], high[a] - CENTRE[a]
        near += max(before, -behind, 0) ** 2
        far += max(abs(before), abs(behind)) ** 2
    return near < RADIUS * RADIUS <= far


def _mixed_cube(pyramid: object, levels: object, m: int, x: int, y: int, z: int) -> bool:
    """For ``mixed_leaves``: whether a cube, of the size that m halvings of the root's leave, may hold both signs."""
    edge = (1 << FULL // 2) >> m
    return passes((x * edge, y * edge), (x * edge + edge, y * edge + edge))


def _find(st, busy: object, found: NDArray[np.int64]) -> int:
    """Like ``component_search.find``, which fills ``found`` as far as it goes, but around the circle only.

    A middle differs from all corners of its diamond only if the circle passes the square of two cubes around it.
    """
    r, edge = int(st.counters.level) % 2, int(st.counters.edge)
    first = [(c - RADIUS) // edge - 2 for c in CENTRE]
    last = [(c + RADIUS) // edge + 2 for c in CENTRE]
    count = 0
    for x in range(first[0], last[0] + 1):
        for y in range(first[1], last[1] + 1):
            if not passes(((x - 1) * edge, (y - 1) * edge), ((x + 2) * edge, (y + 2) * edge)):
                continue
            for slot in range(new_components.slots(2, r)):
                if component_search._alone(st, r, *new_components.middle_of(2, r, x, y, 0, slot)):
                    if count < len(found):
                        found[count] = component_search._morton(2, x, y, 0) << new_components.SLOT_BITS | slot
                    count += 1
    return count


def main(name: str) -> bytes:
    """A file of the circle; to be called in a process that runs kernels as plain Python."""
    ground_truth.GroundTruth.busy = np.zeros((1, 1, 1), np.bool_)  # type: ignore[assignment]
    ground_truth.GroundTruth.pyramid = lambda *_: (np.zeros(1, np.uint8), np.zeros((1, 4), np.int64))  # type: ignore[method-assign]
    mixed_leaves._mixed_cube = _mixed_cube
    ground_truth.find = _find
    signs: NDArray[np.bool_] = Circle()  # type: ignore[assignment]
    return bytes(planned(Header((SIDE, SIDE), 0.5), sign_tube((SIDE, SIDE), signs), [PLANS[name]]))


def drafts() -> Iterator[Draft]:
    """All vectors of this module, each made by a process of its own."""
    for name, plan in PLANS.items():
        command = [sys.executable, "-m", f"{__package__}.circle", name]
        data = subprocess.run(command, env=environment(), stdout=subprocess.PIPE, check=True).stdout
        about = ("a small circle in a domain of 100,000 x 100,000", "single rate" if len(plan) == 1 else "12 rounds")
        yield Draft(name, data, 2, about, layers=len(plan) > 1)


if __name__ == "__main__":
    sys.stdout.buffer.write(main(sys.argv[1]))
