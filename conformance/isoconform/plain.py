"""Processes in which kernels run as plain Python."""

from __future__ import annotations

import os
import sys

from isocodec.kernel import EXECUTION, Execution
from isocodec.kernel.execution import SETTING


def interpreted() -> bool:
    """Whether this process is one."""
    return EXECUTION is Execution.PYTHON


def environment() -> dict[str, str]:
    """Environment of another one, which finds the packages that this one does."""
    return {**os.environ, SETTING: Execution.PYTHON.value, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
