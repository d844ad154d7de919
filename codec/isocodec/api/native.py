"""Objects of other libraries that users hand over as input, made fields and meshes before the stream sees them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.sampled import Field
from ..verbs import Choice

_OWN = (np.ndarray, Field, Mesh, bytes, str, int, float, type(None))


def native(what: Any) -> Any:
    """Input as it is, or what `isocodec.read` makes of an object of another library that states more than an array.

    Fields of a series are converted when their turn comes. Raises `InputError` or `MissingExtraError` as
    `isocodec.read` does.
    """
    if isinstance(what, Frames):
        fields = what.fields
        if isinstance(fields, list | tuple):
            return replace(what, fields=[native(field) for field in fields])
        return replace(what, fields=map(native, fields)) if isinstance(fields, Iterator) else what
    if isinstance(what, _OWN) or not described(what):
        return what
    from ..io.opener import load

    found = load(what, Choice())
    for remark in getattr(found, "remarks", ()):
        warnings.warn(remark, stacklevel=3)
    return found


def described(what: Any) -> bool:
    """Whether this is an object of another library that states more than an array does."""
    if isinstance(what, (*_OWN, list, tuple)) or type(what).__module__.startswith("isocodec."):
        return False
    from ..io.opener import is_described

    return is_described(what)
