"""Plugins for other programs, a file each: ``isocodec plugins`` lists them. Each imports `isocodec` and its program."""

from __future__ import annotations

import os
import sys


def has_polygons() -> bool:
    """Import shapely, which areas and bands need, with its own GEOS: GDAL has loaded another one."""
    flags = sys.getdlopenflags() if hasattr(os, "RTLD_DEEPBIND") else None
    try:
        if flags is not None:
            sys.setdlopenflags(flags | os.RTLD_DEEPBIND)
        import shapely
        return hasattr(shapely, "orient_polygons")  # as of version 2.1
    except ImportError:
        return False
    finally:
        if flags is not None:
            sys.setdlopenflags(flags)
