"""Records as numba sees them: an address, and members that are read from there when they are looked at.

numba hands over a named tuple member by member, every array as seven numbers and more. A state has fifty arrays: each
call of a function would move four hundred numbers, which only inlining everything into everything could avoid.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_setattr_generic
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic

from .types import SLOT, Array, Kind, Named, Number, Record

_INT = ir.IntType(64)
_ADDRESS = ir.IntType(8).as_pointer()


class RecordType(types.Type):
    """numba's type of a record."""

    def __init__(self, record: Record) -> None:
        self.record = record
        super().__init__(name=f"{record.name}#{_numbers.setdefault(record, len(_numbers))}")


class RegistersType(types.Type):
    """numba's type of registers: the address of the first."""

    def __init__(self, named: Named) -> None:
        self.named = named
        super().__init__(name=f"{named.name}#registers")


_numbers: dict[Record, int] = {}
"""A number for each record: it distinguishes the names of types, which members would make long."""


@cache
def type_of(kind: Kind) -> types.Type:
    """numba's type."""
    match kind:
        case Number(name):
            return {"int64": types.int64, "float64": types.float64, "bool": types.boolean}[name]
        case Array(dtype, ndim):
            return types.Array(getattr(types, "boolean" if dtype == "bool" else dtype), ndim, "C")
        case Named():
            return RegistersType(kind)
    return RecordType(kind)


@register_default(RegistersType)
@register_default(RecordType)
class _Address(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: RecordType) -> None:
        super().__init__(manager, kind, _ADDRESS)


@infer_getattr
class _Members(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        return next((type_of(member) for found, member in value.record.members if found == attr), None)


@infer_getattr
class _Registers(AttributeTemplate):
    key = RegistersType

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        return types.int64 if attr in value.named.members else None


def _register(builder: ir.IRBuilder, kind: RegistersType, address: ir.Value, name: str) -> ir.Value:
    """Address of a register."""
    place = builder.gep(address, [_INT(SLOT * kind.named.members.index(name))], inbounds=True)
    return builder.bitcast(place, _INT.as_pointer())


@lower_getattr_generic(RegistersType)
def _read_register(context: Any, builder: ir.IRBuilder, kind: Any, address: ir.Value, name: str) -> ir.Value:
    return builder.load(_register(builder, kind, address, name), align=SLOT)


@lower_setattr_generic(RegistersType)
def _write_register(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any, name: str) -> None:
    address, value = arguments
    builder.store(value, _register(builder, signature.args[0], address, name), align=SLOT)


@lower_getattr_generic(RecordType)
def _member(context: Any, builder: ir.IRBuilder, kind: RecordType, address: ir.Value, name: str) -> ir.Value:
    slot = 0
    for found, member in kind.record.members:
        if found == name:
            return _read(context, builder, builder.gep(address, [_INT(SLOT * slot)], inbounds=True), member)
        slot += member.slots
    raise AttributeError(name)


def _read(context: Any, builder: ir.IRBuilder, address: ir.Value, kind: Kind) -> ir.Value:
    """The member at an address."""

    def slot(number: int, as_type: ir.Type) -> ir.Value:
        place = builder.gep(address, [_INT(SLOT * number)], inbounds=True)
        value = builder.load(builder.bitcast(place, as_type.as_pointer()), align=SLOT)
        # what a kernel is handed over stays while it runs
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value

    kind_type: Any = type_of(kind)
    match kind:
        case Record():
            return address
        case Named():
            return slot(0, _ADDRESS)
        case Number("bool"):
            return builder.trunc(slot(0, _INT), ir.IntType(1))
        case Number():
            return slot(0, context.get_value_type(kind_type))
    array = context.make_array(kind_type)(context, builder)
    entry = context.get_data_type(kind_type.dtype)
    shape = [slot(2 + axis, _INT) for axis in range(kind.ndim)]
    strides = [slot(2 + kind.ndim + axis, _INT) for axis in range(kind.ndim)]
    array.meminfo = array.parent = ir.Constant(_ADDRESS, None)
    array.data = slot(0, entry.as_pointer())
    array.nitems = slot(1, _INT)
    array.itemsize = _INT(context.get_abi_sizeof(entry))
    array.shape = cgutils.pack_array(builder, shape)
    array.strides = cgutils.pack_array(builder, strides)
    return array._getvalue()
