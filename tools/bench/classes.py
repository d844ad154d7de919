"""What is compared: for each class the file of ours, the peers, and the error that both have to keep to."""

from __future__ import annotations

from dataclasses import dataclass

CURVE_PEER = "twkb-1/16px+brotli11"
SIMPLIFIED_PEER = "dp0.25px+twkb-1/16px+brotli11"
LARGEST = 0.25
SURFACE_MEAN = 0.1
PICTURE_MEAN = 0.5
"""Errors in cells that classes ask for."""


@dataclass(frozen=True)
class Class:
    """One line of the comparison.

    Attributes
    ----------
    key : str
    title : str
    n : int
        Axes of its items; 0 for both.
    ours : str
        Name of our row.
    group : str
        Group of rows in which the peers are; empty if the class has no peers of other makers.
    named : str
        The peer that sets the error. All of the group with no larger one count as peers.
    alone : bool
        The named peer is the only one that counts.
    progressive : bool
        Progressive peers alone count.
    bound : str
        Which error must not be exceeded: ``err_mean`` or ``err_max``; empty if the class is exact.
    limit : float or None
        The error in cells, where no peer sets it.
    """

    key: str
    title: str
    n: int
    ours: str
    group: str = ""
    named: str = ""
    alone: bool = False
    progressive: bool = False
    bound: str = ""
    limit: float | None = None


def _surface(bits: int, bound: str = "err_mean") -> Class:
    mean = bound == "err_mean"
    key = f"surface-qp{bits}" + ("" if mean else "-largest")
    title = f"3-D surface, {'mean' if mean else 'largest'} error at most that of Draco qp{bits}"
    return Class(key, title, 3, f"ours-{key}", "mesh3d", f"draco-eb-qp{bits}-cl10", bound=bound)


CLASSES = (
    Class("signs2", "2-D inside/outside exact, progressive", 2, "ours-signs", "mask2d"),
    Class("signs2-progressive", "2-D inside/outside exact, progressive, against progressive peers alone", 2,
          "ours-signs", "mask2d", progressive=True),
    Class("signs2-single", "2-D inside/outside exact, single rate", 2, "ours-signs-single", "mask2d"),
    Class("curve2-mean", "2-D curve, mean error at most that of TWKB 1/16 + brotli", 2, "ours-mean", "contour2d",
          CURVE_PEER, bound="err_mean"),
    Class("curve2-largest", f"2-D curve, largest distance {LARGEST:g} both ways, against simplified {LARGEST:g} + "
          "TWKB + brotli", 2, "ours-largest", "contour2d", SIMPLIFIED_PEER, True, bound="err_max"),
    Class("picture2", f"2-D curve, mean error {PICTURE_MEAN:g}, against the whole picture", 2, "ours-half", "image2d",
          bound="err_mean", limit=PICTURE_MEAN),
    Class("signs3", "3-D inside/outside exact, progressive", 3, "ours-signs", "mask3d"),
    _surface(8), _surface(10), _surface(14), _surface(10, "err_max"),
    Class("surface-0.1", f"3-D surface, mean error {SURFACE_MEAN:g} cell, against the whole volume", 3, "ours-0.1",
          "volume3d", bound="err_mean", limit=SURFACE_MEAN),
    Class("connectivity", "bits of the signs' file per marching-cubes vertex", 3, "ours-connectivity"),
    Class("progressive", "progressive against single rate, the same final curve within 0.05", 0, "ours-progressive"),
)
BY_KEY = {c.key: c for c in CLASSES}
