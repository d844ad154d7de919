"""What ``decode`` and ``mask`` take of a file: one isovalue or all of them, the whole or what was received."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import TruncatedError
from .progress import progress_bar
from .report import PARTIAL, concerning, warn

if TYPE_CHECKING:
    from ..stream.decoder import Decoder

Taken = TypeVar("Taken")


def receive(
    source: Path, data: bytes, isovalue: float | None, partial: bool, layers: int | None = None,
    max_bytes: int | None = None,
) -> tuple[Decoder, int]:  # fmt: skip
    """A decoder that has taken what was asked for, and the number of the isovalue; a warning if it is a part."""
    from ..api import decoded

    def take(most: int | None, progress: Any) -> tuple[Decoder, int]:
        return decoded(data, isovalue, layers, most, progress=progress)

    return _taken(take, source, data, partial, max_bytes)


def receive_all(source: Path, data: bytes, partial: bool, max_bytes: int | None) -> Decoder:
    """Likewise a decoder that has taken all isovalues."""
    from ..api import received

    def take(most: int | None, progress: Any) -> Decoder:
        return received(data, None, most, progress=progress)

    return _taken(take, source, data, partial, max_bytes)


def _taken(
    take: Callable[[int | None, Any], Taken], source: Path, data: bytes, partial: bool, max_bytes: int | None
) -> Taken:
    with concerning(source), progress_bar("decoding") as progress:
        try:
            return take(max_bytes, progress)
        except TruncatedError as exc:
            if max_bytes is not None:
                raise
            if not partial:
                exc.remedy = PARTIAL
                raise
            taken = take(len(data) or 1, progress)
            warn(source, f"{exc.message}; only what was received is decoded")
            return taken


def warn_of_others(source: Path, isovalue: float, isovalues: Sequence[float]) -> None:
    """Say that a file holds further isovalues, where none was asked for."""
    others = [repr(v) for v in isovalues if v != isovalue]
    if others:
        warn(source, f"only isovalue {isovalue!r} is written; --isovalue chooses {' or '.join(others)}")
