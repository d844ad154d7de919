"""Runs of symbols, in and out, and the account of what decoding a file takes (spec clauses 6.1, 6.3, 11.2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import FormatError, LimitError
from ..kernel import BAD, DONE, SPENT
from ..limits import WORK_PER_BYTE, WORK_STEPS
from .range_coder import DECODE, ENCODE, UNLIMITED, Coder, finish, start

SLICE = 1 << 16
"""Symbols that a run is granted at once where it can go on from any of them."""
SYMBOLS_PER_UNIT = 8
"""Symbols without networks that count as a unit of work."""
_SPARE = 64
"""Bytes of a run that is written, beside those of its symbols."""
Reasons = Mapping[int, tuple[str, str]]
"""Message and clause of each error of a pass, by its number."""


class Account:
    """Symbols and work that decoding a file has taken, shared by all of its runs, and the most that it may take.

    Parameters
    ----------
    symbols : int
        Symbols that may be decoded.
    work : int
        Units of work, beside those for each byte that was read.

    Attributes
    ----------
    symbols : int
        Symbols decoded so far, those of a run up to its last grant.
    units : int
        Units of work so far.
    steps : int
        Steps of inference so far; several count as a unit.
    read : int
        Where the last byte that was read lies in the file.
    """

    def __init__(self, symbols: int = UNLIMITED, work: int = UNLIMITED) -> None:
        self.symbols = self.units = self.steps = self.read = 0
        self._most_symbols, self._most_work = symbols, work

    def left(self, per_unit: int = 1) -> int:
        """Units of work that are left, times ``per_unit``; below 0 if there were more than allowed."""
        left = self._most_work + WORK_PER_BYTE * self.read - self.units - self.steps // WORK_STEPS
        return min(per_unit * left, UNLIMITED)

    def spend(self, units: int) -> None:
        """Count units of work.

        Raises
        ------
        LimitError
            If they are more than the file may take.
        """
        self.units += units
        if self.left() < 0:
            raise self._too_much_work()

    def room(self, per_unit: int = 1) -> int:
        """Symbols that may be decoded next, if so many count as a unit of work.

        Raises
        ------
        LimitError
            If the symbols allowed are used up.
        """
        if self.symbols >= self._most_symbols:
            raise LimitError(f"more than {self._most_symbols} symbols", code="limit-symbols", clause="11.2")
        if self.left() <= 0:
            raise self._too_much_work()
        return min(self.left(per_unit), self._most_symbols - self.symbols)

    def _too_much_work(self) -> LimitError:
        return LimitError(
            f"takes more time than {self._most_work:,} units of work", code="limit-work", clause="11.2",
            remedy="raise Limits.work (--limits work=..) if the file is trusted",
        )


class Run:
    """A run of symbols in either direction: what codes takes its coder, makes room, and checks how that ended.

    Attributes
    ----------
    coder : Coder
    """

    def __init__(self, coder: Coder, mode: int) -> None:
        self.coder = coder
        start(coder.reg, mode)

    def room(self, symbols: int) -> None:
        """Make room for bytes of so many more symbols, if they are written."""

    def left(self, per_unit: int = SYMBOLS_PER_UNIT) -> int:
        """Steps that may be taken beside symbols, if so many count as a unit of work."""
        return UNLIMITED

    def spend(self, steps: int, per_unit: int = 1) -> None:
        """Count steps taken beside symbols, of which so many count as a unit of work.

        Raises
        ------
        LimitError
            If it is more than the run may take.
        """

    def check(self, status: int, reasons: Reasons | None = None, error: int = 0, code: str = "domain") -> None:
        """Raise what a kernel came back with, unless it is done.

        Parameters
        ----------
        status : int
        reasons : mapping of int to (str, str), optional
            Message and clause by number, for ``BAD``.
        error : int
            Its number.
        code : str
            Code of that error.

        Raises
        ------
        FormatError
            If the run violates the specification.
        LimitError
            If it takes more than it may.
        """
        assert status == DONE, "a kernel that writes did not end"

    def _wider(self, size: int) -> None:
        """Give the coder a buffer of at least so many bytes."""
        buf = self.coder.buf
        if size > len(buf):
            wider = np.zeros(max(2 * len(buf), size), np.uint8)
            wider[: len(buf)] = buf
            self.coder = self.coder._replace(buf=wider)


class WritingRun(Run):
    """A run that is encoded.

    Parameters
    ----------
    coder : Coder
        With models as the run begins with them; they are changed.
    """

    def __init__(self, coder: Coder) -> None:
        super().__init__(coder, ENCODE)

    def room(self, symbols: int) -> None:
        """Make room for bytes of so many more symbols."""
        # a symbol takes 11 bits at most
        self._wider(self.coder.reg.pos + 2 * symbols + _SPARE)

    def widen(self) -> None:
        """Make more room, for kernels that go on where they stopped."""
        self._wider(2 * len(self.coder.buf))

    def end(self) -> bytes:
        """Bytes of the run, if nothing follows."""
        return finish(self.coder)


class ReadingRun(Run):
    """A run that is decoded, as far as its bytes have come.

    Parameters
    ----------
    coder : Coder
        With models as the run begins with them; they are changed.
    account : Account
        The file's.
    at : int
        Where the run begins in the file.
    per_unit : int
        Symbols that count as a unit of work.

    Attributes
    ----------
    at : int
    read : int
        Bytes that have come.
    """

    def __init__(self, coder: Coder, account: Account, at: int = 0, *, per_unit: int = 1) -> None:
        super().__init__(coder, DECODE)
        self.at, self.read = at, 0
        self._account, self._per_unit = account, per_unit
        self._granted = self._counted = 0
        coder.reg.left = 0

    @property
    def symbols(self) -> int:
        """Symbols decoded so far."""
        return self._granted - self.coder.reg.left

    @property
    def passed(self) -> int:
        """Bytes that the coder has moved past; the same however the bytes came in."""
        return self.coder.reg.pos + self.coder.reg.unknown // 8 - 4

    @property
    def place(self) -> int:
        """Place in the file up to which its bytes have been decoded."""
        return self.at + min(self.passed, self.read)

    def feed(self, data: bytes | bytearray | memoryview, last: bool) -> None:
        """Take bytes that have come since; ``last`` if no more of the run can come."""
        count = self.read + len(data)
        self._wider(count)
        self.coder.buf[self.read : count] = np.frombuffer(data, np.uint8)
        self.read = self.coder.reg.end = count
        self.coder.reg.final = last

    def grant(self) -> None:
        """Allow some more symbols, where the limits do, to kernels that go on where they stopped.

        This is asked for when a layer begins and when those granted are used up, never when bytes are: that would
        depend on how they come in.

        Raises
        ------
        LimitError
            If there may be no more.
        """
        self._account.read = self.at + self.passed
        self._grant(SLICE)

    def grant_all(self) -> None:
        """Allow all symbols that the limits do, at once, to kernels that cannot stop; all bytes have been fed."""
        self._account.read = self.at + self.read
        self._grant(UNLIMITED)

    def _grant(self, most: int) -> None:
        self.count()
        left, room = self.coder.reg.left, self._account.room(self._per_unit)
        self.coder.reg.left = max(left, min(most, room))
        self._granted += self.coder.reg.left - left

    def left(self, per_unit: int = SYMBOLS_PER_UNIT) -> int:
        """Steps that may be taken beside symbols, if so many count as a unit of work."""
        self.count()
        return self._account.left(per_unit)

    def spend(self, steps: int, per_unit: int = 1) -> None:
        """Count steps taken beside symbols, of which so many count as a unit of work; as `Run.spend`."""
        try:
            self._account.spend(-(-steps // per_unit))
        except LimitError as limit:
            limit.offset = self.place
            raise

    def count(self) -> None:
        """Put the symbols decoded since the last time down to the account."""
        symbols, per_unit = self.symbols, self._per_unit
        self._account.symbols += symbols - self._counted
        self._account.units += symbols // per_unit - self._counted // per_unit
        self._counted = symbols

    def check(self, status: int, reasons: Reasons | None = None, error: int = 0, code: str = "domain") -> None:
        """Raise what a kernel came back with, unless it is done; as `Run.check`."""
        if status == DONE:
            return
        if status == SPENT:
            self.count()
            try:
                self._account.room(self._per_unit)
            except LimitError as limit:
                limit.offset = self.place
                raise
            raise AssertionError("a run stopped within its limits")
        if status == BAD:
            what, clause = (reasons or {})[error]
            raise FormatError(what, code=code, offset=self.at, clause=clause)
        raise FormatError("a run is too short", code="overrun", offset=self.at, clause="6.3")

    def end(self) -> None:
        """Count what the run took, and check that all of its bytes were needed.

        Raises
        ------
        FormatError
            If some were not.
        """
        self.count()
        if self.passed + 4 < self.read:
            raise FormatError("bytes left over in a run", code="leftover", offset=self.at + self.read, clause="6.3")


def whole_run(coder: Coder, data: bytes, account: Account, at: int = 0, *, last: bool = True) -> ReadingRun:
    """A run of symbols without networks whose bytes are all there, for kernels that cannot stop in it.

    Parameters
    ----------
    coder, account, at
        As of `ReadingRun`.
    data : bytes
    last : bool
        Whether these are all of its bytes; if not, kernels stop where they need more.

    Raises
    ------
    LimitError
        If the account allows no symbols.
    """
    run = ReadingRun(coder, account, at, per_unit=SYMBOLS_PER_UNIT)
    run.feed(data, last)
    run.grant_all()
    return run
