"""Tables of tests: a few rows that have all pairs of values, and rows that are run one after the other in one test."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from typing import Any

import pytest

from brute import HEAVY


def covering(rows: Sequence[Sequence[object]], strength: int = 2) -> list[int]:
    """Choose rows so that all that ``strength`` columns have together in any row, they have in one of these.

    Parameters
    ----------
    rows : sequence of rows
        Of a table, each with a value in every column, or what stands for it.
    strength : int
        1: each value; 2: each pair of values of two columns.

    Returns
    -------
    list of int
        Numbers of the rows, rising; the same ones each time.
    """
    parts = [frozenset(combinations(enumerate(row), min(strength, len(row)))) for row in rows]
    left = set().union(*parts)
    chosen = []
    while left:
        best = max(range(len(rows)), key=lambda i: len(parts[i] & left))
        chosen.append(best)
        left -= parts[best]
    return sorted(chosen)


def heavy(*values: Any) -> list[Any]:
    """Values of a parameter that only heavy tests have."""
    return [pytest.param(value, marks=pytest.mark.heavy) for value in values]


def looped(
    names: str | Sequence[str], rows: Iterable[Any], ids: object = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """`pytest.mark.parametrize` within one test: to collect thousands of small ones takes longer than to run them.

    Cases share the fixtures of the test, but each has its own folder; an error has a note with its case.
    """
    columns = names.replace(" ", "").split(",") if isinstance(names, str) else [*names]
    table = list(rows)

    def wrap(test: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(test)

        def run(**fixtures: Any) -> None:
            for number, row in enumerate(table):
                marks = {mark.name for mark in getattr(row, "marks", ())}
                values = row.values if hasattr(row, "marks") else (row,) if len(columns) == 1 else row
                case = dict(zip(columns, values, strict=True))
                if "heavy" in marks and not HEAVY:
                    continue
                if "tmp_path" in fixtures:
                    case["tmp_path"] = fixtures["tmp_path"] / f"case{number}"
                    case["tmp_path"].mkdir()
                try:
                    test(**{**fixtures, **case})
                except pytest.skip.Exception:
                    continue
                except BaseException as error:
                    error.add_note(f"in the case of {case}")
                    raise

        functools.update_wrapper(run, test)
        del run.__wrapped__  # type: ignore[attr-defined]
        rest = [each for name, each in signature.parameters.items() if name not in columns]
        run.__signature__ = signature.replace(parameters=rest)  # type: ignore[attr-defined]
        return run

    return wrap
