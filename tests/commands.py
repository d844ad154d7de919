"""What tests of the command line share: inputs, and ways to run it."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
from click.testing import CliRunner, Result

from isocodec.cli import main

# Two hills in 33 x 41 samples, and a ball in 17^3: small, but of several layers.
ROWS, COLUMNS = np.mgrid[:33, :41]
HILLS = np.rint(
    200 * np.exp(-((ROWS - 12) ** 2 + (COLUMNS - 12) ** 2) / 60)
    + 150 * np.exp(-((ROWS - 20) ** 2 + (COLUMNS - 29) ** 2) / 40)
).astype(np.uint8)
BALL = np.rint(10 * np.sqrt(((np.mgrid[:17, :17, :17] - 8.0) ** 2).sum(axis=0))).astype(np.int16)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def ok(*arguments: object) -> str:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def fails(code: int, *arguments: object) -> str:
    """The one line that is left on the error stream."""
    result = run(*arguments)
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("isocodec: ")
    assert "Traceback" not in line
    return line


def process(*arguments: object, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "isocodec", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **(environment or {})},
    )
