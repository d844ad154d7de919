"""Exponents of growth in tools/."""

from __future__ import annotations

import math
import sys

import pytest

from home import ROOT

sys.path.insert(0, str(ROOT / "tools"))

from growth import exponent, tables, waves

pytestmark = pytest.mark.heavy

SIZES = [10.0, 100.0, 1000.0, 10000.0]


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_exponents_of_powers(power: float):
    assert exponent(SIZES, [0.001 * size**power for size in SIZES]) == pytest.approx(power)


def test_constant_costs_are_not_fitted():
    """Below four times the least, what grows is hidden by what does not."""
    assert math.isnan(exponent(SIZES, [1.0, 1.1, 1.0, 1.2]))
    assert exponent(SIZES, [0.5, 0.5, 5.0, 50.0]) == pytest.approx(1)


def test_tables_reach_what_they_state():
    known = tables(1e7)
    assert known["length"].sizes[0] == 1000 and known["length"].sizes[-1] == 10**7
    assert known["boxes"].sizes[-1] == 1 << 20 and known["isovalues"].sizes[-1] == 4096
    crossed = ((waves(64)[:, 1:] > 0) != (waves(64)[:, :-1] > 0)).sum()
    assert crossed > 300
