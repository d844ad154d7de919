"""Any decoder against the reference, on files that the syntax makes, whole, in pieces and cut (README of this folder).

A number stands for a case: the same seed gives the same cases, and how many there are depends on the time alone.
"""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from random import Random

from isocodec.errors import LimitError
from isocodec.format.events import LayerComplete

from .damage import damaged
from .decoders import Answer, Decoder, Request
from .dump import REFUSED, Output, parted
from .dump_file import dump_any
from .growing import MOST_SYMBOLS, SMALL, ReferenceBroke, probe
from .runner import difference
from .shrink import shrunk
from .syntax import any_file, bare_file
from .tiled_damage import any_tiled, tiles_of
from .tiled_dump import is_tiled

AHEAD = 4
"""Questions that may be open: the next files are made while a decoder is busy."""
HEADER = 16
"""Bytes within which most headers end."""
MOST_TILES = 64
STATE = "another state"
BROKEN = -1
"""In place of an exit code: the reference decoder itself failed."""


@dataclass(frozen=True)
class Trial:
    """A file, or the start of one, and how a decoder is to take it.

    Attributes
    ----------
    case : int
        Number of the case.
    data : bytes
    size : int or None
        Bytes that are all there is of it.
    piece, layers : int
        As `Request`.
    """

    case: int
    data: bytes
    size: int | None = None
    piece: int = 0
    layers: int = 0

    @property
    def there(self) -> bytes:
        """The bytes that a decoder gets to see."""
        return self.data[: self.size]

    @property
    def kind(self) -> str:
        """What is asked for, in a word."""
        if self.size is not None:
            return "cut"
        return "in pieces" if self.piece else "some layers" if self.layers else "whole"


@dataclass(frozen=True)
class Finding:
    """A disagreement.

    Attributes
    ----------
    sort : str
        Two of the same sort are probably of the same cause.
    reason : str
        The first difference.
    trial : Trial
        As it was found.
    data : bytes
        The same, shrunk.
    seconds : float
        After which it was found.
    expected : Output
    answer : Answer
        To the shrunk file.
    """

    sort: str
    reason: str
    trial: Trial
    data: bytes
    seconds: float
    expected: Output
    answer: Answer


@dataclass
class Report:
    """What came of a campaign.

    Attributes
    ----------
    files, questions : int
        Files made, and questions that the decoder has answered.
    seconds : float
    unknown : set of str
        Kinds of questions that the decoder does not know.
    findings : list of Finding
    """

    files: int = 0
    questions: int = 0
    seconds: float = 0.0
    unknown: set[str] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)


def trials_of(seed: int, number: int, tiles: bool = False) -> list[Trial]:
    """A case: a file, perhaps a damaged one, and how a decoder is to take it; empty if it asks for too much.

    With ``tiles`` it is a file in tiles.
    """
    random = Random(f"{seed} {number}")
    if tiles:
        data = any_tiled(random)
        cut = [Trial(number, data, random.randrange(len(data)))] if random.randrange(3) == 0 else []
        return [Trial(number, data), *cut] if _small(data) else []
    # bare ones take next to no time
    bare = random.randrange(2) == 0
    data = bare_file(random) if bare else any_file(random)
    for _ in range(random.choice((1, 1, 2) if bare else (0, 0, 0, 0, 0, 1))):
        data = damaged(data, random)
    if not _small(data):
        return []
    trials = [Trial(number, data)]
    if random.randrange(3) == 0:
        # mostly behind the header, at the end of which there is always a run or a checksum
        trials.append(Trial(number, data, random.randint(0 if random.randrange(6) == 0 else len(data) // 3, len(data))))
    if bare and random.randrange(3) == 0:
        # what is wrong with a header is wrong as soon as its bytes are there
        trials.append(Trial(number, data, random.randint(1, min(len(data), HEADER))))
    if random.randrange(8) == 0:
        trials.append(Trial(number, data, piece=random.choice((1, 1, 2, 3, 7))))
    layers = sum(isinstance(event, LayerComplete) for event in _expected(trials[0]).events)
    if layers > 1 and random.randrange(8) == 0:
        trials.append(Trial(number, data, layers=random.randint(1, layers)))
    return trials


def _small(data: bytes) -> bool:
    """Whether slow decoders can be asked to decode that."""
    if is_tiled(data):
        try:
            return tiles_of(data) <= MOST_TILES and not isinstance(dump_any(data, limits=SMALL).error, LimitError)
        except Exception as bug:
            raise ReferenceBroke(data) from bug
    try:
        found = probe(data)
    except ReferenceBroke:
        return True
    return not isinstance(found.error, LimitError) and found.symbols <= MOST_SYMBOLS


def verdict(expected: Output, answer: Answer) -> str:
    """What sort of disagreement an answer is; empty if it is none."""
    if answer.trouble:
        return answer.trouble.partition(":")[0]
    if expected.exit_code in REFUSED and answer.code in REFUSED:
        return "refused with a text" if answer.text else ""
    if answer.code != expected.exit_code:
        return f"exit code {answer.code} instead of {expected.exit_code}"
    state, coordinates = parted(answer.text)
    return STATE if state != expected.text or coordinates not in ("", expected.coordinates) else ""


def reason_of(expected: Output, answer: Answer) -> str:
    """The first difference, in words."""
    if answer.trouble:
        return answer.trouble
    if answer.code != expected.exit_code:
        error = f" ({expected.error})" if expected.error is not None else ""
        return f"exit code {answer.code}, expected {expected.exit_code}{error}"
    return difference(expected.text, answer.text)


class Campaign:
    """Fuzzing of one decoder.

    Parameters
    ----------
    decoder : Decoder
    seed : int
    minutes : float
        After which no further case is begun.
    files : int, optional
        After how many cases none is begun.
    most : int
        After how many sorts of findings it ends.
    shrinking : float
        Seconds that each finding may be shrunk for.
    tiles : bool
        Files in tiles instead of others.
    """

    def __init__(
        self, decoder: Decoder, *, seed: int = 0, minutes: float = 1.0, files: int | None = None, most: int = 5,
        shrinking: float = 30.0, tiles: bool = False,
    ) -> None:
        self._decoder, self._seed, self._most, self._shrinking = decoder, seed, most, shrinking
        self._tiles = tiles
        self._seconds, self._files = 60 * minutes, files
        self._open: deque[tuple[Trial, Path]] = deque()
        self._causes: set[str] = set()
        self.report = Report()

    def run(self) -> Iterator[Finding]:
        """Go through the cases; findings as they come, each sort once."""
        start = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="isoconform") as name:
            folder = Path(name)
            for trial in self._trials(start):
                path = folder / f"{trial.case}.iso"
                if trial.kind == "whole":
                    path.write_bytes(trial.data)
                self._ask(trial, path)
                while len(self._open) > AHEAD:
                    yield from self._next(folder, start)
                if len(self._causes) >= self._most:
                    break
            while self._open:
                yield from self._next(folder, start)
        self.report.seconds = time.monotonic() - start

    def close(self) -> None:
        """End the decoder's processes."""
        self._decoder.close()

    def _trials(self, start: float) -> Iterator[Trial]:
        for number in count():
            self.report.seconds = time.monotonic() - start
            if self.report.seconds >= self._seconds or number == self._files:
                return
            try:
                trials = trials_of(self._seed, number, self._tiles)
            except ReferenceBroke as broken:
                trials = [Trial(number, broken.data)]
            self.report.files += bool(trials)
            yield from (trial for trial in trials if trial.kind not in self.report.unknown)

    def _ask(self, trial: Trial, path: Path) -> None:
        self._open.append((trial, path))
        self._decoder.ask(Request(path, trial.layers, trial.size, trial.piece))

    def _next(self, folder: Path, start: float) -> Iterator[Finding]:
        """Take the oldest open question's answer."""
        trial, path = self._open.popleft()
        answer = self._decoder.answer()
        if all(other != path for _, other in self._open):
            path.unlink()
        yield from self._judged(trial, answer, folder, start)

    def _judged(self, trial: Trial, answer: Answer | None, folder: Path, start: float) -> Iterator[Finding]:
        if answer is None:
            self.report.unknown.add(trial.kind)
            return
        self.report.questions += 1
        expected = _expected(trial)
        sort = verdict(expected, answer)
        if not sort or _cause(sort, expected, answer) in self._causes or len(self._causes) >= self._most:
            return
        self._causes.add(_cause(sort, expected, answer))
        seconds = time.monotonic() - start
        # the decoder answers in order: what is open comes first
        waiting, self._open = self._open, deque()
        later = [(other, self._decoder.answer()) for other, _ in waiting]
        finding = self._shrunk(trial, sort, folder, seconds)
        self.report.findings.append(finding)
        yield finding
        for other, told in later:
            yield from self._judged(other, told, folder, start)

    def _shrunk(self, trial: Trial, sort: str, folder: Path, seconds: float) -> Finding:
        path = folder / "smaller.iso"

        def ask(data: bytes) -> tuple[Output, Answer | None]:
            path.write_bytes(data)
            self._decoder.ask(Request(path, trial.layers, None, trial.piece))
            return _expected(Trial(0, data, None, trial.piece, trial.layers)), self._decoder.answer()

        def holds(data: bytes) -> bool:
            if not _small(data):
                return False
            expected, answer = ask(data)
            return answer is not None and verdict(expected, answer) == sort

        data = trial.there
        if holds(data):
            data = shrunk(data, holds, seconds=self._shrinking)
        expected, answer = ask(data)
        assert answer is not None
        return Finding(sort, reason_of(expected, answer), trial, data, seconds, expected, answer)


def _expected(trial: Trial) -> Output:
    """What the reference says, fed all at once."""
    try:
        return dump_any(trial.there, layers=trial.layers)
    except Exception as bug:
        return Output(BROKEN, f"{type(bug).__name__}: {bug}")


def _cause(sort: str, expected: Output, answer: Answer) -> str:
    """Findings are kept apart by what differs first, too: a vertex, an edge, the mesh."""
    if sort != STATE:
        return sort
    for wanted, found in zip(expected.text.splitlines(), answer.text.splitlines(), strict=False):
        if wanted != found:
            return f"{sort}: {wanted.split(' ')[0]}, {found.split(' ')[0]}"
    return sort
