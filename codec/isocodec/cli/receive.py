"""What ``decode`` and ``mask`` take of a file: one isovalue, all of it or what was received."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import TruncatedError
from .progress import progress_bar
from .report import PARTIAL, concerning, warn

if TYPE_CHECKING:
    from ..stream.decoder import Decoder


def receive(
    source: Path, data: bytes, isovalue: float | None, partial: bool, layers: int | None = None,
    max_bytes: int | None = None,
) -> tuple[Decoder, int]:  # fmt: skip
    """A decoder that has taken what was asked for, and the number of the isovalue; a warning if it is a part."""
    from ..api import decoded

    with concerning(source), progress_bar("decoding") as progress:
        try:
            return decoded(data, isovalue, layers, max_bytes, progress=progress)
        except TruncatedError as exc:
            if max_bytes is not None:
                raise
            if not partial:
                exc.remedy = PARTIAL
                raise
            taken = decoded(data, isovalue, layers, len(data) or 1, progress=progress)
            warn(source, f"{exc.message}; only what was received is decoded")
            return taken


def warn_of_others(source: Path, isovalue: float, isovalues: Sequence[float]) -> None:
    """Say that a file holds further isovalues, where none was asked for."""
    others = [repr(v) for v in isovalues if v != isovalue]
    if others:
        warn(source, f"only isovalue {isovalue!r} is written; --isovalue chooses {' or '.join(others)}")
