"""The command ``isoconform``, also as ``python -m isoconform``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from isocodec.errors import KernelError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    try:
        from isocodec.kernel import kernels

        from .command import main as program

        # otherwise every file would fail for this
        kernels()
    except KernelError as error:
        print(f"isoconform: {error}", file=sys.stderr)
        return error.exit_code
    return program(arguments)


if __name__ == "__main__":
    sys.exit(main())
