"""What a build says while it goes on, on the error stream."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """One line."""
    print(f"kernels: {text}", file=sys.stderr, flush=True)


def progress(done: int, count: int) -> None:
    """How many kernels have been compiled, in place on a terminal, else at every quarter."""
    if sys.stderr.isatty():
        print(f"\rkernels: {done} of {count} compiled", end="\n" if done == count else "", file=sys.stderr, flush=True)
    elif done == count or 4 * done // count > 4 * (done - 1) // count:
        say(f"{done} of {count} compiled")
