"""Drawing: polylines and surfaces out of the mixed leaves of a decoded state (spec clause 9).

Arrays in, arrays out; numpy is all it needs.
"""

from __future__ import annotations

from isocodec.contour.drawing import draw
from isocodec.contour.leaves import Leaves
from isocodec.contour.result import Contour

__all__ = ["Contour", "Leaves", "draw"]
