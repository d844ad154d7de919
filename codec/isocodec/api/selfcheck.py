"""Whether kernels do here what they do where they were tested: for libraries that could not be run when built."""

from __future__ import annotations

import hashlib
import warnings

import numpy as np

DIGEST = "97c4cbcfe2830ce1bae13e316ad05fa6f98b28a631d08c4223d2eab01dd7880f"
"""What `digest` gives wherever it is right."""


def digest() -> str:
    """SHA-256 of files and curves of small fields, with everything in them that floating point decides."""
    from .encoding import encode
    from .isofile import decode

    out = hashlib.sha256()
    y, x = np.mgrid[:12, :13]
    hill = 3 * (y - 6) ** 2 + 2 * (x - 5) ** 2 + x * y % 5
    z, y, x = np.mgrid[:9, :8, :10]
    ball = 9 * (z - 4) ** 2 + 7 * (y - 3) ** 2 + 8 * (x - 5) ** 2 + x * y % 5
    exact, baseline, reduced = {"precision": "exact"}, {"profile": "baseline"}, {"layers": "distortion=1"}
    for field, isovalue in ((hill, 40.5), (ball, 70.5)):
        for options in (exact, baseline, reduced):
            data = encode(field, isovalue, **options)
            out.update(data)
            for smooth in (False, True):
                curve = decode(data, smooth=smooth)
                out.update(curve.points.astype("<f8").tobytes() + curve.cells.astype("<i8").tobytes())
    return out.hexdigest()


def check() -> None:
    """Warn if kernels do something else."""
    found = digest()
    if found != DIGEST:
        warnings.warn(
            f"the compiled kernels give other results on this platform ({found[:12]}) than where they were tested "
            f"({DIGEST[:12]}): please report it; ISOCODEC_KERNELS=python does without them, slowly", stacklevel=2,
        )
