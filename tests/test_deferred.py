"""Dataclasses whose methods come later behave like those of the standard library."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys

import pytest

from isocodec import deferred
from isocodec.deferred import dataclass
from isocodec.io.writers.output_formats import Cost


@dataclass(frozen=True)
class Base:
    size: int


@dataclass(frozen=True)
class Derived(Base):
    names: list[str] = dataclasses.field(default_factory=list)


class Plain(Derived):
    pass


def test_methods_are_made_with_the_first_object():
    assert {Base, Derived} <= set(deferred._WAITING)
    one = Plain(1)
    assert not {Base, Derived} & set(deferred._WAITING)
    assert one == Plain(1, []) != Plain(2) and repr(one) == "Plain(size=1, names=[])"
    assert dataclasses.asdict(dataclasses.replace(one, size=3)) == {"size": 3, "names": []}
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.size = 2  # type: ignore[misc]


def test_fields_are_known_before():
    @dataclass(kw_only=True)
    class Late:
        """Has a default."""

        size: int = 4

    assert [each.default for each in dataclasses.fields(Late)] == [4] and dataclasses.is_dataclass(Late)
    assert Late(size=5).size == 5
    with pytest.raises(TypeError):
        Late(5)  # type: ignore[misc]


def test_pickled_objects_are_whole_in_another_process():
    code = (
        "import pickle, sys; one = pickle.loads(bytes.fromhex(sys.argv[1]));"
        "print(repr(one) == sys.argv[2], one == type(one)(1, 2))"
    )
    one = Cost(1, 2)
    command = [sys.executable, "-c", code, pickle.dumps(one).hex(), repr(one)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "True True\n", done.stderr
