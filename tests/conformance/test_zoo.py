"""The zoo of wrong decoders: its changes fit the sources, its table is up to date, and its vectors catch what they say.

The whole zoo runs with ``make zoo``; here a few of it.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from isoconform.manifest import read_manifest
from tables import heavy, looped
from zoo.check import TABLE, VECTORS, check, table
from zoo.misreadings import Change, RottenError, changed, load

MISREADINGS = load()
BY_NAME = {m.name: m for m in MISREADINGS}
PLANTED = ("varint-10-bytes", "gap-of-any-size")
"""Of different themes, with vectors that plain Python decodes in no time."""


@looped("misreading", MISREADINGS, ids=list(BY_NAME))
def test_changes_fit_the_sources(misreading):
    """Each old text stands there exactly once, and what becomes of the file is Python."""
    for file, text in changed(misreading).items():
        compile(text, file, "exec")


def test_vectors_and_table_are_those_of_the_manifest():
    """``python conformance/zoo table`` writes the table anew."""
    names = {v.name for v in read_manifest(VECTORS)}
    assert [m.name for m in MISREADINGS if m.vector not in names] == []
    assert TABLE.read_text(encoding="utf-8") == table()


@pytest.mark.parametrize("name", [PLANTED[0], *heavy(*PLANTED[1:])])
def test_planted_decoder_is_caught(name):
    finding = check(BY_NAME[name])
    assert finding.caught, finding.reason


def test_decoder_that_agrees_is_not_caught():
    """A vector that has nothing to do with the misreading."""
    finding = check(replace(BY_NAME["gap-of-any-size"], vector="plane_noise_5x3"))
    assert not finding.caught
    assert finding.reason == "it agrees with the vector"


@pytest.mark.parametrize(("old", "new", "what"), [
    ("no such text", "another", "stands 0 times"),
    ("import", "export", "times"),
    ("MAX_VARINT = 9", "MAX_VARINT = 9", "nothing changes"),
])
def test_change_that_does_not_fit_is_refused(old, new, what):
    misreading = replace(MISREADINGS[0], changes=(Change("spec/isospec/container.py", old, new),))
    with pytest.raises(RottenError, match=what):
        changed(misreading)
