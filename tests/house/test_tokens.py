"""Size of the package: a room may only grow if its number is raised here, in the commit that says what for."""

from __future__ import annotations

import json
import tokenize
from collections import Counter
from pathlib import Path

from home import ROOT

COUNTED = {tokenize.NAME, tokenize.NUMBER, tokenize.STRING, tokenize.OP}
ROOMS = Path(__file__).with_name("tokens.json")
PACKAGE = ROOT / "codec" / "isocodec"
ABOVE = "."
"""Name of the modules that are in no room."""


def test_tokens_of_rooms():
    found: Counter[str] = Counter()
    for path in PACKAGE.rglob("*.py"):
        room = path.relative_to(PACKAGE).parts[:-1]
        with path.open("rb") as file:
            found[room[0] if room else ABOVE] += sum(one.type in COUNTED for one in tokenize.tokenize(file.readline))
    most = json.loads(ROOMS.read_text())
    assert found.keys() == most.keys()
    grown = {room: f"{count:,} of {most[room]:,}" for room, count in found.items() if count > most[room]}
    assert not grown, f"rooms have grown: {grown}; take something away, or say in the commit what went where"
