"""Drawing: polylines and surfaces out of the mixed leaves of a decoded state (spec clause 9).

Arrays in, arrays out; numpy is all it needs.
"""

from __future__ import annotations

from .drawing import draw
from .leaves import Leaves
from .result import Contour

__all__ = ["Contour", "Leaves", "draw"]
