"""Plant slips in a copy of the package, one after the other, and see which of them the tests catch.

``python tools/slips.py`` runs, for each slip of ``slips.toml``, the tests that could see it: those of the files that it
names, and then the conformance vectors. The sources here are never touched. What survives is a table that nobody wrote.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import tomllib

ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix(".toml")
COMPILED = {"kernel", "inner", "inlined", "record"}
"""Decorators of what is compiled: with a slip there, kernels run as plain Python."""
SMALL, SHARE = 400, 4
"""Bytes of the vectors that plain Python decodes, hundreds of times as slow; and of all, one of so many is decoded."""
CAUGHT = ("tests", "vectors")
DECODED = {"entropy", "format", "grid", "kernel", "mesh", "stream", "tiles", "tin"}
"""Rooms that vectors tell something about."""


@dataclass(frozen=True)
class Slip:
    """A slip.

    Attributes
    ----------
    place : str
        The module, from the package on.
    kind : str
        ``off by one``, ``sign`` and others.
    old, new : str
        Text that occurs once in the module, and what a tired engineer writes.
    tests : list of str
        Names of test files, without ``test_`` and suffix; or with ``::`` and a test in it.
    """

    place: str
    kind: str
    old: str
    new: str
    tests: list[str]

    @property
    def room(self) -> str:
        """The package of the module; that of a module beside the packages is its name."""
        return self.place.split("/")[0].removesuffix(".py")


def slips_of(path: Path, package: Path) -> list[Slip]:
    """Read slips, each of which has to fit the sources: one that does not is out of date."""
    found = [Slip(**each) for each in tomllib.loads(path.read_text())["slips"]]
    stale = [f"{one.place}: {one.old!r} occurs {count} times" for one in found
             if (count := (package / one.place).read_text().count(one.old)) != 1]
    if stale:
        sys.exit("slips that do not fit the sources:\n" + "\n".join(stale))
    return found


def tests_of(slip: Slip, root: Path) -> list[str]:
    """What pytest is given for a slip: each of its tests has to be there."""
    out = []
    for name, _, one in (each.partition("::") for each in slip.tests):
        found = [path for path in (root / "tests").rglob(f"test_{name}.py") if f"def {one}" in path.read_text()]
        if not found:
            sys.exit(f"{slip.place}: no tests {name} {one}")
        out += [f"{path}::{one}".removesuffix("::") for path in found]
    return out


def is_compiled(text: str, at: int) -> bool:
    """Whether the compiler sees what stands at a place of a module with kernels: its functions and its constants."""
    line = text.count("\n", 0, at) + 1
    for node in ast.parse(text).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.lineno <= line <= (node.end_lineno or 0):
            names = {each.id for each in node.decorator_list if isinstance(each, ast.Name)}
            return bool(names & COMPILED)
    return True


@contextmanager
def planted(slip: Slip, copy: Path) -> Iterator[dict[str, str]]:
    """Plant a slip in a copy of the package; yields what the environment needs for it."""
    module, note = copy / slip.place, copy / "kernel" / "built" / "kernels.json"
    text, noted = module.read_text(), note.read_text()
    environment = {}
    module.write_text(text.replace(slip.old, slip.new))
    sources = json.loads(noted)["sources"]
    if f"isocodec/{slip.place}" in sources["files"]:
        if is_compiled(text, text.index(slip.old)):
            environment["ISOCODEC_KERNELS"] = "python"
        else:
            # what is compiled has not changed: the library still fits
            sys.path.insert(0, str(ROOT / "codec"))
            from isocodec.kernel.sources import digest_of

            homes = {"isocodec": copy, "isospec": ROOT / "spec" / "isospec"}
            new = digest_of(sources["files"], homes)
            note.write_text(noted.replace(sources["sha256"], new))
    try:
        yield environment
    finally:
        module.write_text(text)
        note.write_text(noted)


def run(words: list[str], root: Path, environment: dict[str, str], seconds: float) -> int | None:
    """Run Python with low priority; its exit code, or None if it takes too long."""
    process = subprocess.Popen(
        [sys.executable, *words], cwd=root, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True, preexec_fn=lambda: os.nice(5),
    )
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        return None
    finally:
        # with all processes that it has started
        if process.poll() is None:
            os.killpg(process.pid, 9)
            process.wait()


def verdict(slip: Slip, copy: Path, root: Path, seconds: float) -> str:
    """What catches a slip: ``tests`` or ``vectors``; else ``survived``, or ``time`` if it was not settled."""
    folders = [str(copy.parent), *(str(root / name) for name in ("spec", "conformance", "tests"))]
    tests = tests_of(slip, root)
    with planted(slip, copy) as more:
        environment = {**os.environ, "CI": "1", "PYTHONPATH": os.pathsep.join(folders),
                       "PYTHONDONTWRITEBYTECODE": "1", **more}
        code = run(["-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests], root, environment, seconds)
        if code not in (0, None):
            return "tests"
        if slip.room not in DECODED:
            return "time" if code is None else "survived"
        vectors = root / "conformance" / "vectors"
        words = ["-m", "isoconform", "run", "--vectors", str(vectors)]
        few = sorted(path.stem for path in vectors.rglob("*.iso") if not more or path.stat().st_size <= SMALL)
        words += [word for name in few[::SHARE] for word in ("--only", name)]
        if run(words, root, environment, seconds) not in (0, None):
            return "vectors"
    return "time" if code is None else "survived"


def table(found: list[tuple[Slip, str]], name: str) -> str:
    """Caught of all, by kind or by room."""
    every = Counter(getattr(slip, name) for slip, _ in found)
    caught = Counter(getattr(slip, name) for slip, how in found if how in CAUGHT)
    return "\n".join(f"{what:18} {caught[what]:3} of {count:3}" for what, count in sorted(every.items()))


def main() -> None:
    """Run slips, and print what caught each, then tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", type=Path, default=LIST, help="the slips; default: %(default)s")
    parser.add_argument("--root", type=Path, default=ROOT, help="folder with the tests; default: %(default)s")
    parser.add_argument("--rooms", nargs="*", help="of these only")
    parser.add_argument("--part", default="0/1", help="every N-th slip from the K-th on: K/N")
    parser.add_argument("--seconds", type=float, default=300.0, help="for each run; default: %(default)s")
    parser.add_argument("--check", action="store_true", help="see that all slips fit the sources, no more")
    given = parser.parse_args()
    slips = slips_of(given.list, ROOT / "codec" / "isocodec")
    if given.check:
        for slip in slips:
            tests_of(slip, given.root.resolve())
        return
    first, step = map(int, given.part.split("/"))
    slips = [one for one in slips if not given.rooms or one.room in given.rooms][first::step]
    found: list[tuple[Slip, str]] = []
    with TemporaryDirectory(prefix="slips-") as folder:
        copy = Path(folder) / "isocodec"
        shutil.copytree(ROOT / "codec" / "isocodec", copy, ignore=shutil.ignore_patterns("__pycache__"))
        for slip in slips:
            found.append((slip, verdict(slip, copy, given.root.resolve(), given.seconds)))
            shown = " ".join(slip.new.split())[:60]
            print(f"{found[-1][1]:8} {slip.place}: {slip.kind}: {shown}", flush=True)
    print("", table(found, "kind"), "", table(found, "room"), sep="\n")
    print(f"\n{sum(how in CAUGHT for _, how in found)} of {len(found)} caught")


if __name__ == "__main__":
    main()
