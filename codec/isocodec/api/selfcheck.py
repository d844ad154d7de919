"""Check that kernels give the same results here as where they were tested.

Needed for libraries that could not be run when they were built."""

from __future__ import annotations

import warnings
from functools import cache

from ..kernel import kernels, untested

__all__ = ["check_kernels", "digest", "kernels"]

DIGEST = "97c4cbcfe2830ce1bae13e316ad05fa6f98b28a631d08c4223d2eab01dd7880f"
"""Result of `digest` on every machine where the kernels are correct."""


def digest() -> str:
    """Compute a SHA-256 of files and curves of small fields that exercise everything that depends on floating point."""
    import hashlib

    import numpy as np

    from ..stream.decoder import Decoder
    from ..stream.encoder import encoder_of

    out = hashlib.sha256()
    y, x = np.mgrid[:12, :13]
    hill = 3 * (y - 6) ** 2 + 2 * (x - 5) ** 2 + x * y % 5
    z, y, x = np.mgrid[:9, :8, :10]
    ball = 9 * (z - 4) ** 2 + 7 * (y - 3) ** 2 + 8 * (x - 5) ** 2 + x * y % 5
    for field, isovalue in ((hill, 40.5), (ball, 70.5)):
        for encoder in (
            encoder_of(field, isovalue, precision="exact"), encoder_of(field, isovalue, profile="baseline"),
            encoder_of(field, isovalue, layers="distortion=1"),
        ):
            data = b"".join(encoder)
            out.update(data)
            decoder = Decoder()
            decoder.feed(data)
            decoder.close()
            for smooth in (False, True):
                curve = decoder.contour(smooth=smooth)
                out.update(curve.points.astype("<f8").tobytes() + curve.cells.astype("<i8").tobytes())
    return out.hexdigest()


@cache
def check_kernels() -> None:
    """Warn, once, if kernels from a library that was never run where it was built give different results here."""
    if not untested():
        return
    found = digest()
    if found != DIGEST:
        warnings.warn(
            f"the compiled kernels give different results on this platform ({found[:12]}) than where they were tested "
            f"({DIGEST[:12]}): please report it; ISOCODEC_KERNELS=python does without them, slowly", stacklevel=2,
        )
