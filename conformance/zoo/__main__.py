"""Run the zoo: ``python conformance/zoo``."""

from __future__ import annotations

import sys
from pathlib import Path

if not __package__:
    # run as a folder: the modules next to this one are found by the name of the package
    sys.path[0] = str(Path(__file__).resolve().parent.parent)

from zoo.command import main

if __name__ == "__main__":
    sys.exit(main())
