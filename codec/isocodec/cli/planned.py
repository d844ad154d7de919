"""A plan out of a file: read before the work, held against the field when that is there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OptionError
from .report import Failure, concerning

if TYPE_CHECKING:
    from ..stream.plan_file import Plan

MOST = 1 << 20
"""Bytes that a plan has at most."""


@dataclass(frozen=True)
class Planned:
    """A plan and the file that it came from."""

    path: Path
    plan: Plan | dict[float, Plan]

    @classmethod
    def read(cls, path: Path) -> Planned:
        """Read a plan.

        Raises
        ------
        Failure
            With an OptionError that names the line, or an OSError.
        """
        from ..stream.plan_file import read_plan

        with concerning(path):
            with path.open("rb") as file:
                data = file.read(MOST + 1)
            try:
                text = data.decode("utf-8-sig")
            except UnicodeDecodeError:
                text = "\0"
            if len(data) > MOST or "\0" in text:
                raise OptionError("not a plan, which is a short text", code="plan", remedy="see encode --plan-help")
            return cls(path, read_plan(text))

    def isovalues(self, given: Sequence[float], shape: tuple[int, ...], leaning: bool) -> tuple[float, ...]:
        """The isovalues to encode; a plan that cannot be carried out for them is refused."""
        from ..grid.lattice.tables import cube_exponent
        from ..stream.plan_file import check_plan, isovalues_in

        with self.blamed():
            isovalues = isovalues_in(self.plan, given)
            if 2 <= len(shape) <= 3 and min(shape) >= 2:
                # of other fields it is not the plan that is wrong
                check_plan(self.plan, isovalues, len(shape) * cube_exponent(shape), leaning)
        return isovalues

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """What is wrong with the plan is reported as being about its file."""
        try:
            yield
        except OptionError as error:
            if error.code != "plan":
                raise
            raise Failure(self.path, error) from error
