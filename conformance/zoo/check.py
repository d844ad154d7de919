"""Whether the vectors catch a planted decoder, and the table of which one does."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from .misreadings import HOME, Misreading, environment, load, plant

VECTORS = HOME.parent / "vectors"
TABLE = HOME.parent / "misreadings.md"
TIMEOUT = 300.0
"""Seconds that a planted decoder has for its vector; one that is compiled takes a minute to begin."""

_INTRODUCTION = """\
# Misreadings, and the vectors that catch them

Each row is a way to misread the specification, a decoder that does so, and a vector whose decoded state or exit code
is then another one. The decoders are ours with a few lines changed; `zoo/` plants them, one at a time, in copies of our
sources in plain Python, and checks every row. {count} misreadings, {vectors} vectors.

    python conformance/zoo                       # plants them all: are they caught?
    python conformance/zoo --only NAME
    python conformance/zoo plant NAME DIRECTORY  # writes the wrong decoder
    python conformance/zoo decoder NAME {{file}}   # runs it as `isoconform dump`
    python conformance/zoo table                 # writes this file

What `plant` writes runs as `ISOCODEC_KERNELS=python PYTHONPATH=DIRECTORY python -m isoconform dump`.

What clause 9 says of drawings is not part of the decoded state, and neither are the isovalue and the scale but for what
they do to isovalues that lean on another one: no vector can tell how they were read. Of files in tiles the same holds
for where tiles begin, for which of the two kinds a tile without a curve has, and for what the head says of stages.

| clause | the decoder believes | vector | name |
| --- | --- | --- | --- |
"""


@dataclass(frozen=True)
class Finding:
    """What became of a planted decoder; ``reason`` is that of the disagreement, or of why there was none."""

    misreading: Misreading
    caught: bool
    reason: str


def check(misreading: Misreading) -> Finding:
    """Plant a misreading and run it over its vector."""
    with tempfile.TemporaryDirectory(prefix="zoo-") as name:
        home = Path(name)
        plant(misreading, home)
        command = [sys.executable, "-m", "isoconform", "run", "--layers", "--json"]
        command += ["--vectors", str(VECTORS), "--only", misreading.vector]
        try:
            done = subprocess.run(
                command, env=environment(home, misreading), cwd=home, stdin=subprocess.DEVNULL, capture_output=True,
                text=True, timeout=TIMEOUT, check=False,
            )
        except subprocess.TimeoutExpired:
            return Finding(misreading, False, f"no answer within {TIMEOUT:.0f} s")
        try:
            (result,) = json.loads(done.stdout)["vectors"]
        except ValueError:
            return Finding(misreading, False, f"it fell over: {done.stderr.strip().splitlines()[-1:]}")
    if result["reason"].startswith("crash"):
        # that shows that it was planted badly, not that it was caught
        return Finding(misreading, False, f"it fell over: {result['reason']}")
    return Finding(misreading, bool(result["reason"]), result["reason"] or "it agrees with the vector")


def check_all(misreadings: Sequence[Misreading], jobs: int) -> Iterator[Finding]:
    """Check misreadings, several at a time, in their order."""
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(check, misreadings)


def search(misreading: Misreading) -> Iterator[str]:
    """Names of all vectors that catch a misreading, the shortest first."""
    manifest = json.loads((VECTORS / "manifest.json").read_bytes())["vectors"]
    names = [entry["name"] for entry in sorted(manifest, key=lambda entry: entry["bytes"])]
    with tempfile.TemporaryDirectory(prefix="zoo-") as name:
        home = Path(name)
        plant(misreading, home)
        for vector in names:
            command = [sys.executable, "-m", "isoconform", "run", "--vectors", str(VECTORS), "--only", vector]
            done = subprocess.run(
                command, env=environment(home, misreading), cwd=home, stdin=subprocess.DEVNULL, capture_output=True,
                check=False,
            )
            if done.stdout.startswith(b"FAIL"):
                yield vector


def table() -> str:
    """The text of ``misreadings.md``."""
    found = load()
    rows = [f"| {m.clause} | {m.says} | {m.vector} | {m.name} |\n" for m in found]
    return _INTRODUCTION.format(count=len(found), vectors=len({m.vector for m in found})) + "".join(rows)
