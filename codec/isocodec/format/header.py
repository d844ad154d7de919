"""The fixed head of a file: version, profile, shape, isovalue, scale (spec clause 3.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from isospec import container as spec
from isospec.container import Double, IsovalueKind, Prefix, Profile, Single, VarintError, read_varint

from ..errors import FormatError

PREFIX_BYTES = 6
LARGEST_SINGLE = (2 - 2.0**-23) * 2.0**127
HEAD_BYTES = 1 << 14
"""Largest size, in bytes, of head and root directory of a tiled file together."""
_EXPONENT_ESCAPE = 0x80


@dataclass(frozen=True)
class Header:
    """Contents of a file's header.

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis, in the order of the encoded array; empty for a file on a mesh.
    isovalue : float
    scale : float or None
        Step to which values are rounded; None for integer data (step 1).
    profile : Profile
    writer_version, read_version : int
        Version that wrote the file, and the oldest one that can read it.
    cells : int or None
        Dimension of the cells of an explicit domain (clause 10); None if the domain is a grid.
    """

    shape: tuple[int, ...]
    isovalue: float
    scale: float | None = None
    profile: Profile = Profile.BASELINE
    writer_version: int = spec.WRITER_VERSION
    read_version: int = spec.READ_VERSION
    cells: int | None = None

    @property
    def n(self) -> int:
        """Dimension of the domain."""
        return self.cells or len(self.shape)


def write_header(header: Header) -> bytes:
    """Write a header, with the shortest form of its isovalue."""
    kind, isovalue = write_isovalue(header.isovalue)
    equal = len(set(header.shape)) == 1
    out = Prefix.build(
        {
            "signature": spec.SIGNATURE,
            "version": {"writer": header.writer_version, "read": header.read_version},
            "flags": {
                "explicit": header.cells is not None,
                "equal": equal,
                "scaled": header.scale is not None,
                "isovalue": kind,
                "axes": header.n - 2,
                "profile": header.profile,
            },
        }
    )
    out += b"".join(spec.write_varint(s) for s in header.shape[: 1 if equal else None]) + isovalue
    if header.scale is not None:
        out += _write_scale(header.scale)
    return bytes(out)


def write_isovalue(value: float) -> tuple[IsovalueKind, bytes]:
    """Choose the shortest form of an isovalue (clause 3.3.4)."""
    value = float(value)
    if (2 * value).is_integer() and abs(value) < 1 << 50:
        return IsovalueKind.HALVES, spec.write_varint(spec.zigzag(int(2 * value)))
    forms = {IsovalueKind.FLOAT64: Double.build(value), IsovalueKind.DECIMAL: _decimal(value)}
    if abs(value) <= LARGEST_SINGLE and Single.parse(Single.build(value)) == value:
        forms[IsovalueKind.FLOAT32] = Single.build(value)
    kind = min((kind for kind, form in forms.items() if form), key=lambda kind: (len(forms[kind]), kind))
    return kind, forms[kind]


def _decimal(value: float) -> bytes:
    """Write a number as a decimal with as few places as possible; nothing if it needs too many."""
    from decimal import Decimal

    # the shortest digits that give the number back
    digits = Decimal(repr(value))
    exponent = digits.as_tuple().exponent
    assert isinstance(exponent, int)
    unit = int(digits.scaleb(-exponent))
    if not 1 <= -exponent <= spec.MAX_PLACES or abs(unit) >= spec.MAX_DECIMAL:
        return b""
    return bytes([-exponent]) + spec.write_varint(spec.zigzag(unit))


def _write_scale(scale: float) -> bytes:
    mantissa, exponent = math.frexp(scale)
    if mantissa == 0.5 and -127 <= exponent - 1 <= 127:
        return bytes([(exponent - 1) & 0xFF])
    return bytes([_EXPONENT_ESCAPE]) + Double.build(scale)


def check_version(read: int) -> None:
    """Refuse the read version of a file in another version of the format (spec clause 3.3.1)."""
    if read != spec.READ_VERSION:
        raise FormatError(
            f"the file has version {read} of the format, but this decoder reads version {spec.READ_VERSION}",
            code="version", offset=4, clause="3.3.1",
            remedy="update isocodec" if read > spec.READ_VERSION else "encode the field again: a draft wrote it",
        )



def read_header(data: bytes | bytearray) -> tuple[Header, int] | None:
    """Read the header at the start of ``data``, and its length; None if it has not arrived completely.

    Raises
    ------
    FormatError
        If the bytes cannot be the start of a file that this version reads.
    """
    seen = bytes(data[:4])
    if seen == spec.TILED_SIGNATURE:
        raise FormatError(
            "a tiled file, which cannot be decoded as a stream", code="tiled", offset=0, clause="3.3.1",
            remedy="open it with isocodec.open; to turn a part of it into an ordinary file, use edit --window",
        )
    if seen != spec.SIGNATURE[: len(seen)]:
        raise FormatError("not a file of isocontours: the signature is missing", code="signature", offset=0,
                          clause="3.3.1", remedy="disc images have the suffix .iso, too")
    if len(data) < PREFIX_BYTES:
        return None
    prefix = Prefix.parse(bytes(data[:PREFIX_BYTES]))
    check_version(prefix.version.read)
    flags = prefix.flags
    if flags.profile not in Profile.__members__.values():
        raise FormatError(f"unknown profile {flags.profile}", code="profile", offset=5, clause="3.3.2")
    if flags.explicit and (flags.equal or flags.profile != Profile.MAIN):
        raise FormatError("a file on a mesh must not state a grid size, and must have the profile main",
                          code="domain", offset=5, clause="3.3.2")
    return _read_rest(data, prefix, 2 + flags.axes)


def _read_rest(data: bytes | bytearray, prefix: object, n: int) -> tuple[Header, int] | None:
    flags, version = prefix.flags, prefix.version  # type: ignore[attr-defined]
    at = PREFIX_BYTES
    shape = []
    for _ in range(0 if flags.explicit else 1 if flags.equal else n):
        number = varint(data, at, len(data), "3.3.3")
        if number is None:
            return None
        if not 1 <= number[0] <= spec.MAX_SIDE[n]:
            raise FormatError(
                f"{number[0]} samples along an axis are not between 1 and {spec.MAX_SIDE[n]}",
                code="shape", offset=at, clause="3.3.3",
            )
        shape.append(number[0])
        at = number[1]
    if flags.equal:
        shape *= n
    found = read_isovalue(data, at, len(data), flags.isovalue)
    if found is None:
        return None
    isovalue, at = found
    scale = None
    if flags.scaled:
        if len(data) < at + 1:
            return None
        if data[at] != _EXPONENT_ESCAPE:
            scale = math.ldexp(1.0, data[at] - 256 if data[at] > 127 else data[at])
            at += 1
        else:
            if len(data) < at + 9:
                return None
            scale = Double.parse(bytes(data[at + 1 : at + 9]))
            if not (math.isfinite(scale) and scale > 0):
                raise FormatError("the scale is not a positive number", code="scale", offset=at, clause="3.3.5")
            at += 9
    cells = n if flags.explicit else None
    header = Header(tuple(shape), isovalue, scale, Profile(flags.profile), version.writer, version.read, cells)
    return header, at


def read_isovalue(data: bytes | bytearray, at: int, end: int, kind: int) -> tuple[float, int] | None:
    """Read the isovalue at ``at``, and the place after it; None if ``end`` comes first (clause 3.3.4)."""
    if kind == IsovalueKind.HALVES:
        number = varint(data, at, end, "3.3.4")
        return None if number is None else (spec.unzigzag(number[0]) / 2, number[1])
    if kind == IsovalueKind.DECIMAL:
        return _read_decimal(data, at, end)
    form = Single if kind == IsovalueKind.FLOAT32 else Double
    behind = at + form.sizeof()
    if end < behind:
        return None
    isovalue = form.parse(bytes(data[at:behind]))
    if not math.isfinite(isovalue):
        raise FormatError("the isovalue is not finite", code="isovalue", offset=at, clause="3.3.4")
    return isovalue, behind


def _read_decimal(data: bytes | bytearray, at: int, end: int) -> tuple[float, int] | None:
    number = varint(data, at + 1, end, "3.3.4") if at < end else None
    if number is None:
        return None
    unit = spec.unzigzag(number[0])
    if not 1 <= data[at] <= spec.MAX_PLACES or abs(unit) >= spec.MAX_DECIMAL:
        raise FormatError("the decimal places or digits of an isovalue are out of range", code="isovalue", offset=at,
                          clause="3.3.4")
    # both are exact: the quotient is rounded once
    return unit / 10 ** data[at], number[1]


def varint(data: bytes | bytearray, at: int, end: int, clause: str) -> tuple[int, int] | None:
    """Call ``read_varint``, adding the place and the clause to its error."""
    try:
        return read_varint(data, at, end)
    except VarintError as error:
        raise FormatError(str(error), code="varint", offset=at, clause=clause) from None


def is_tiled(data: object) -> bool:
    """Whether these are the first bytes of a tiled file."""
    signature = spec.TILED_SIGNATURE
    return isinstance(data, bytes | bytearray | memoryview) and bytes(data[: len(signature)]) == signature
