"""What encoders are asked for: isovalues and plans of any kind of number, and where edges are crossed."""

from __future__ import annotations

import math
from dataclasses import fields
from decimal import Decimal
from fractions import Fraction
from inspect import Parameter, signature
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from isocodec.errors import InputError, OptionError
from isocodec.field.samples import check_field, isovalue_of
from isocodec.stream.options import DEFAULT_TOLERANCE, EncodeOptions, Options
from tables import looped

FIELD = np.add.outer(np.arange(6), np.arange(7)).astype(np.uint8)

# --- isovalues ------------------------------------------------------------------------------------------------------


@looped(
    "given, expected",
    [
        (5, 5.0), (2**60, 2.0**60), (np.int8(-5), -5.0), (np.uint64(2**63), 2.0**63),
        (np.float32(0.1), 0.10000000149011612),
        (Fraction(1, 3), 1 / 3), (Decimal("0.1"), 0.1), (np.array(2.5), 2.5), (np.longdouble(0.5), 0.5),
    ],
)
def test_isovalues_of_any_kind_of_number(given, expected):
    found = isovalue_of(given)
    assert type(found) is float and found == expected


@looped(
    "given",
    [
        "5", b"5", None, True, np.bool_(True), 1j, np.datetime64("2020-01-01"), [5], {5}, np.array([1.5]),
        math.nan, -math.inf, np.float32("inf"), Decimal("NaN"), Decimal("sNaN"), Decimal("1e999"), 10**400, -(10**400),
        2**53 + 1, np.int64(2**62 + 1), Fraction(2**53 + 1), Decimal(2**53 + 1),
        # these would move past a whole number, and samples of integers with them
        Fraction(2**60 - 1, 2**60), Decimal("-1.00000000000000000001"),
        *([np.longdouble(2**53) + 1] if np.finfo(np.longdouble).nmant > 52 else []),
    ],
)
def test_isovalues_that_are_none(given):
    with pytest.raises(InputError) as caught:
        isovalue_of(given)
    assert caught.value.code == "isovalue"
    if not isinstance(given, np.ndarray | list):
        with pytest.raises(InputError):
            isocodec.encode(FIELD, [1.5, given])


def test_several_isovalues_of_several_kinds():
    """Differences of small types would wrap or overflow: each file is that of floats."""
    expected = isocodec.encode(FIELD, [5.0, 200.0, 3.0])
    for isovalues in (np.array([5, 200, 3], np.uint8), [np.uint8(5), 200, Fraction(3)], (5, Decimal(200), np.int8(3))):
        assert isocodec.encode(FIELD, isovalues) == expected
    far = isocodec.encode(FIELD, [np.int8(5), 2**40])
    assert isocodec.open(far).info.isovalues == [5, 2**40]
    for twice in ([3, np.float32(3)], [Fraction(3), 3.0], [0.0, -0.0]):
        with pytest.raises(OptionError, match="twice"):
            isocodec.encode(FIELD, twice)


# --- plans ----------------------------------------------------------------------------------------------------------


@looped(
    "plan",
    [
        {5}, "bas", "base x", [], ["base"], [5], [()], [None], [("walk", 1)], {1.5: [("base", None)]}, {5.5: None},
        {5.5: 5}, {5.5: "base"},
        [("base", -1)], [("base", 1e300)], [("base", 2.0)], [("base", "2")], [("base", None, 2)], [("base", 99)],
        [("base", None), ("values", "x")], [("base", None), ("values", 1e300)], [("base", None), ("values", 10**300)],
        [("base", None), ("offsets", 1e300)], [("base", None), ("offsets", 10**300 + 1)],
        [("base", None), ("offsets", 1)], [("base", 2), ("offsets", 3, -1)], [("base", None), ("promise", 1e300)],
        [("base", None), ("promise", "1")], [("leaf_base", 1)], [("adaptive_base", 0)], [("adaptive_base", 0, "mesh")],
    ],
    ids=str,
)
def test_plans_that_are_none(plan):
    with pytest.raises(OptionError) as caught:
        isocodec.encode(FIELD, 5.5, layers=plan)
    assert caught.value.code == "plan"


def test_plans_with_numbers_of_numpys():
    plan = [("base", 2), ("refine", 1), ("refine", None), ("offsets", 5, 0)]
    same = [("base", np.int8(2)), ["refine", np.uint8(1)], ("refine", None), ("offsets", np.int64(5), np.int8(0))]
    assert isocodec.encode(FIELD, 5.5, layers=same) == isocodec.encode(FIELD, 5.5, layers=plan)
    by_isovalue = {Fraction(11, 2): plan, 3: plan}
    assert isocodec.encode(FIELD, [5.5, 3], layers=by_isovalue) == isocodec.encode(FIELD, [5.5, 3], layers=plan)


@pytest.mark.parametrize("field", [np.where(FIELD > 5, 1e300, 0.0), np.where(FIELD > 5, np.inf, 0.0), FIELD / 3])
def test_values_of_floats_need_a_step(field):
    """Without one they would be taken for whole numbers."""
    plan = [("base", None), ("values", None)]
    with pytest.raises(OptionError, match="step"):
        isocodec.encode(field, 0.5, layers=plan)
    if field.max() < 10:
        points = isocodec.decode(isocodec.encode(field, 0.5, layers=plan, precision="step=1e-6")).points
        assert np.abs(points.sum(axis=1) - 1.5).max() < 1e-5  # the field is (i + j) / 3
    else:
        with pytest.raises(InputError, match="next to the curve"):
            isocodec.encode(field, 0.5, layers=plan, precision="step=1.0")


# --- crossings ------------------------------------------------------------------------------------------------------

finite = st.floats(allow_nan=False, allow_infinity=False)
tiny = st.integers(-50, 50).map(lambda k: k * 5e-324)
huge = st.floats(0.9, 1.0).map(lambda x: x * np.finfo(float).max) | st.floats(-1.0, -0.9).map(
    lambda x: x * np.finfo(float).max
)


@examples(600)
@given(st.lists(finite | tiny | huge, min_size=3, max_size=3) | st.lists(tiny, min_size=3, max_size=3))
def test_crossings_of_all_finite_floats(numbers):
    """Against fractions: between the ends of an edge, to a part in 2**30, in either direction."""
    low, isovalue, high = sorted(numbers)
    if not low <= isovalue < high:
        return
    field = check_field(np.array([[low, low], [high, high]]), isovalue)
    ends = np.array([[0, 0]]), np.array([[1, 0]])
    share = (Fraction(isovalue) - Fraction(low)) / (Fraction(high) - Fraction(low))
    assert abs(int(field.crossings(*ends)[0]) - math.floor(share * 2**30)) <= 1
    field = check_field(np.array([[high, high], [low, low]]), isovalue)
    assert abs(int(field.crossings(*ends)[0]) - min(math.floor((1 - share) * 2**30), 2**30 - 1)) <= 1
    for values in ([[low, low], [high, high]], [[high, low], [high, low]]):
        axis = int(values[0][0] != values[0][1])
        expected = 1 - share if axis else share
        points = isocodec.decode(isocodec.encode(np.array(values), isovalue)).points
        assert len(points) == 2
        assert np.abs(points[:, axis] - float(expected)).max() <= DEFAULT_TOLERANCE + 2.0**-30


# --- options --------------------------------------------------------------------------------------------------------


def test_encode_and_encoder_take_the_options_by_name():
    """Editors and type checkers see them, each with the default that `Options` has."""
    taken = [p for p in signature(isocodec.encode).parameters.values() if p.kind == Parameter.KEYWORD_ONLY]
    defaults = {p.name: p.default for p in taken}
    assert defaults.pop("progress") is None
    assert set(defaults) == {f.name for f in fields(Options)} == get_type_hints(EncodeOptions).keys()
    assert Options.of(**defaults) == Options() == Options.of()
    unpacked = signature(isocodec.Encoder).parameters["options"]
    assert unpacked.kind == Parameter.VAR_KEYWORD and unpacked.annotation == "Unpack[EncodeOptions]"


def test_an_unknown_option_is_refused():
    with pytest.raises(TypeError, match=r"^encode\(\) got an unexpected keyword argument 'exact'"):
        isocodec.encode(FIELD, 5, exact=True)
    with pytest.raises(OptionError, match="unknown option 'exact'"):
        isocodec.Encoder(5, exact=True)
