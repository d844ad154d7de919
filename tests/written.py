"""What tests of writers share."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from isocodec.io.formats import OutputOptions, SampleMask, write

Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From coordinates to those of GLB."""


def rendered(what: Any, suffix: str, **options: Any) -> bytes:
    """The file of something in a format."""
    out = io.BytesIO()
    write(out, SampleMask(what) if isinstance(what, np.ndarray) else what, OutputOptions(to=suffix, **options))
    return out.getvalue()
