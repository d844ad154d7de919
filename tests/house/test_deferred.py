"""Dataclasses whose methods come later behave like those of the standard library."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys

import pytest

from isocodec import deferred
from isocodec.deferred import dataclass
from isocodec.verbs import Choice
from tables import looped


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


@looped("parameters", [
    {}, {"frozen": True}, {"eq": False}, {"repr": False}, {"frozen": True, "eq": False}, {"kw_only": True},
])
def test_methods_do_what_those_of_the_standard_library_do(parameters):
    def made(decorate):
        @decorate(**parameters)
        class Each:
            size: int = 1
            note: str = dataclasses.field(default="", repr=False, compare=False)
            key: int = dataclasses.field(default=0, hash=False)

        return Each

    one, other = made(dataclass), made(dataclasses.dataclass)
    values = [{}, {"size": 2}, {"note": "x"}, {"key": 3}, {"size": 2, "key": 3}]

    def seen(cls):
        """What objects are told apart by, and their texts but for addresses."""
        objects = [cls(**some) for some in values]
        texts = [repr(each) if "repr" not in parameters else "" for each in objects]
        pairs = [(a == b, a != b) for a in objects for b in objects]
        hashable = cls.__hash__ is not None
        alike = [hash(a) == hash(b) for a in objects for b in objects] if hashable else []
        return texts, pairs, hashable, alike, objects[0] == 1, repr(objects[0]).startswith("<")

    assert seen(one) == seen(other)


def test_pickled_objects_are_whole_in_another_process():
    code = (
        "import pickle, sys; one = pickle.loads(bytes.fromhex(sys.argv[1]));"
        "print(repr(one) == sys.argv[2], one == type(one)(1, 2))"
    )
    one = Choice(1, 2)
    command = [sys.executable, "-c", code, pickle.dumps(one).hex(), repr(one)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "True True\n", done.stderr
