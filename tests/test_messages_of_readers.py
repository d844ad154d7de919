"""What a reading process may send: data, and nothing that runs."""

from __future__ import annotations

import io
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isocodec import Field
from isocodec.errors import InputError
from isocodec.io.readers.mesh_formats import MeshRead
from isocodec.io.readers.messages import receive, send


def sent(message: Any) -> Any:
    file = io.BytesIO()
    send(file, message)
    file.seek(0)
    return receive(file)


class Runs:
    def __init__(self, function: Any, *arguments: Any) -> None:
        self.made = function, arguments

    def __reduce__(self) -> Any:
        return self.made


@pytest.mark.parametrize(
    "function, arguments",
    [(os.system, ("true",)), (eval, ("1",)), (exec, ("",)), (getattr, (1, "real")), (np.load, ("a",)), (open, ("a",)),
     (__import__, ("os",)), (np.testing.measure, ("1",))],
)
def test_nothing_runs(function: Any, arguments: tuple[Any, ...]) -> None:
    with pytest.raises(pickle.UnpicklingError):
        sent([Runs(function, *arguments)])


@pytest.mark.parametrize("name", ["loads.__self__.ValueError", "__loader__.load_module.__func__.__class__.TypeError"])
def test_no_attributes_of_what_is_known(name: str) -> None:
    with pytest.raises((pickle.UnpicklingError, AttributeError)):
        receive(io.BytesIO(b"\x80\x04\x8c\x08builtins\x8c" + bytes([len(name)]) + name.encode() + b"\x93."))


@pytest.mark.parametrize("kind", ["b1", "u1", "<i2", ">i4", "<f4", ">f8"])
def test_arrays(kind: str) -> None:
    values = np.arange(24).reshape(2, 3, 4).astype(kind)
    for each in (values, values.T, values[:, ::2], np.ma.masked_equal(values, 1)):
        found = sent(each)
        assert found.dtype.newbyteorder("=") == each.dtype.newbyteorder("=")
        assert np.array_equal(np.ma.getdata(found), np.ma.getdata(each))
        assert np.array_equal(np.ma.getmaskarray(found), np.ma.getmaskarray(each))


def test_records() -> None:
    field = sent(Field(np.ones((3, 4)), placement=np.eye(2, 3), unit="m", remarks=["one"]))
    assert field.unit == "m" and field.remarks == ("one",) and np.array_equal(field.placement.matrix, np.eye(2, 3))
    mesh = sent(MeshRead(np.zeros((3, 2)), None, {"z": np.ones(3)}, remarks=["two"]))
    assert list(mesh.values) == ["z"] and mesh.remarks == ["two"]
    error = sent(InputError("is damaged", code="unreadable", remedy="mend it"))
    assert isinstance(error, InputError) and (error.code, error.remedy) == ("unreadable", "mend it")
    assert sent(Path("a")) == Path("a")
