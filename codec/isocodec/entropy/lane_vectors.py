"""Functions of ``lanes`` for the compiler, which would go from lane to lane."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

_INT = ir.IntType(32)


class Rules(NamedTuple):
    """Layout of lanes, and what bounds probabilities and weights: see `lanes` and `range_coder`."""

    lanes: int
    model: int
    logit: int
    step: int
    seen: int
    one: int
    floor: int
    most_mix: int
    rate: int
    shift: int


def instead_of(learn: Callable[..., None], adapt: Callable[..., None], rules: Rules) -> None:
    """Kernels that call functions of ``lanes`` get these."""
    places = types.Array(types.int32, 1, "C")
    learns, adapts = _made(_learn, rules, places), _made(_adapt, rules, types.int64)
    overload(learn)(lambda lane, mix, error: lambda lane, mix, error: learns(lane, mix, error))
    overload(adapt)(lambda lane, bit, most: lambda lane, bit, most: adapts(lane, bit, most))


class _Lanes:
    """Arithmetic with all lanes."""

    def __init__(self, rules: Rules, context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> None:
        self.rules, self.builder, self.arguments = rules, builder, arguments
        self._context, self._kinds = context, signature.args
        self._vector = ir.VectorType(_INT, rules.lanes)

    def _place(self, argument: int, first: int) -> ir.Value:
        array = self._context.make_array(self._kinds[argument])
        data = array(self._context, self.builder, self.arguments[argument]).data
        return self.builder.bitcast(self.builder.gep(data, [ir.IntType(64)(first)]), self._vector.as_pointer())

    def load(self, argument: int, first: int = 0) -> ir.Value:
        """Lanes of an array that is an argument."""
        return self.builder.load(self._place(argument, first), align=4)

    def store(self, vector: ir.Value, argument: int, first: int = 0) -> None:
        """Set lanes of an array that is an argument."""
        self.builder.store(vector, self._place(argument, first), align=4)

    def same(self, number: ir.Value | int) -> ir.Value:
        """One number in all lanes."""
        if isinstance(number, int):
            return ir.Constant(self._vector, [number] * self.rules.lanes)
        alone = ir.Constant(self._vector, ir.Undefined)
        single = self.builder.insert_element(alone, self.builder.trunc(number, _INT), _INT(0))
        return self.builder.shuffle_vector(single, single, ir.Constant(self._vector, [0] * self.rules.lanes))

    def least(self, a: ir.Value, b: ir.Value) -> ir.Value:
        """The smaller of two numbers, in each lane."""
        return self.builder.select(self.builder.icmp_signed("<", a, b), a, b)

    def most(self, a: ir.Value, b: ir.Value) -> ir.Value:
        """The greater of two numbers, in each lane."""
        return self.builder.select(self.builder.icmp_signed(">", a, b), a, b)

    def done(self) -> ir.Value:
        """Result of a function without one."""
        return self._context.get_dummy_value()


def _made(build: Callable[[_Lanes], ir.Value], rules: Rules, second: types.Type) -> Any:
    """An intrinsic of an array, an argument of another type, and a number."""

    def write(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return build(_Lanes(rules, context, builder, signature, arguments))

    def of_three(_typing: Any, lane: Any, argument: Any, number: Any) -> Any:
        return types.none(lane, second, types.int64), write

    return intrinsic(of_three)


def _learn(lanes: _Lanes) -> ir.Value:
    rules, builder = lanes.rules, lanes.builder
    error = builder.mul(lanes.arguments[2], lanes.arguments[2].type(rules.rate))
    product = builder.mul(lanes.load(0, rules.logit), lanes.same(error))
    weight = builder.add(lanes.load(1), builder.ashr(product, lanes.same(rules.shift)))
    lanes.store(lanes.least(lanes.most(weight, lanes.same(-rules.most_mix)), lanes.same(rules.most_mix)), 1)
    return lanes.done()


def _adapt(lanes: _Lanes) -> ir.Value:
    rules, builder, same = lanes.rules, lanes.builder, lanes.same
    model, step = lanes.load(0, rules.model), lanes.load(0, rules.step)
    p, seen = builder.and_(model, same(rules.one - 1)), builder.lshr(model, same(rules.seen))
    # the probability of the other symbol becomes less
    above = builder.icmp_signed("!=", same(lanes.arguments[1]), same(0))
    other = builder.select(above, builder.sub(same(rules.one), p), p)
    other = builder.sub(other, builder.lshr(builder.mul(other, step), same(16)))
    p = builder.select(above, builder.sub(same(rules.one), other), other)
    p = lanes.least(lanes.most(p, same(rules.floor)), same(rules.one - rules.floor))
    seen = lanes.least(builder.add(seen, same(1)), same(lanes.arguments[2]))
    lanes.store(builder.or_(p, builder.shl(seen, same(rules.seen))), 0, rules.model)
    return lanes.done()
