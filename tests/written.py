"""What tests of writers share."""

from __future__ import annotations

from typing import Any

import numpy as np

from isocodec.io.writers.output_formats import OutputOptions
from isocodec.io.writers.write import render

Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From coordinates to those of GLB."""


def rendered(what: Any, suffix: str, **options: Any) -> bytes:
    """The file of something in a format."""
    return render(what, options=OutputOptions(to=suffix, **options))
