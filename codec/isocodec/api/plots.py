"""Pictures of files and fields: the steps of a progressive file side by side, and contour maps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from ..errors import InputError, OptionError
from ..field.isovalues import isovalues_of, range_of
from ..field.labelling import noun_of
from ..field.sampled import Field
from ..field.samples import missing_of
from ..plotting.map import map_figure
from ..plotting.panels import StepPanel, check_picture, panels_picture, picture_file
from ..plotting.scene import USUAL, drawing
from ..verbs import Plot, Progress
from .export import counted, cut_short, other_frames
from .isofile import IsoFile
from .opening import open
from .tracing import Traced

__all__ = ["Plotted", "check_picture", "plot_map", "plot_steps"]


@dataclass
class Plotted:
    """A picture.

    Attributes
    ----------
    data : bytes
        The picture's file.
    text : str
        Counts, for people.
    facts : dict
        The same counts, for programs.
    remarks : list of str
        What of the file is not drawn.
    """

    data: bytes
    text: str
    facts: dict[str, Any]
    remarks: list[str]


def plot_steps(file: IsoFile, suffix: str, options: Plot, progress: Progress | None = None) -> Plotted:
    """Draw prefixes of a file side by side, beginning with the first one that shows any of the curve.

    Of a truncated file, the last one shows as much as there is. Prefixes end with layers that complete a promise, or
    are evenly spaced. Raises `OptionError` if the file does not have the isovalue or the frame, and `FormatError` or
    `LimitError`.
    """
    isovalue, frame = next(iter(options.isovalues), None), options.frame
    tin = file.kind == "surface"
    number = None if isovalue is None or tin else file.info.number_of(isovalue)
    values = [*file.isovalues] if isovalue is None else [isovalue]
    values = values or _isovalues(file.surface(max_bytes=file.size).values)
    known = file.info if file.mesh_given is not None else counted(file)
    layers = [one for one in known.layers if one.bytes is not None]
    cut = len(layers) < len(file.info.layers) or not file.complete
    own = [k for k, one in enumerate(layers, 1) if one.frame == (frame or 0) and number in (None, one.isovalue)]
    if file.kind == "tiles":
        layers = layers[: len(layers) // len(file.isovalues)]
        own = [*range(1, len(layers) + 1)] if not cut else []
    within = {k: layers[k - 1].within for k in own if layers[k - 1].within}
    whole = len(layers)
    if cut or not own:
        whole += 1  # a step for what comes after the last layer
        own.append(whole)

    @cache
    def panel(layer: int) -> StepPanel:
        part = file if layer == whole else open(file.edited(layers=layer), mesh=file.mesh_given, limits=file.limits)
        how: Any = {"frame": frame, "partial": True}
        found = [part.contour(one, **how) for one in values] if tin else part.contours(**how)
        held = [one for one in found if one.isovalue in values]
        meshes = [part.mesh(one.isovalue, **how) for one in held if options.draw_mesh and len(one.cells)]
        title = f"{part.size:,} bytes" + (f", within {within[layer]:g}" if layer in within else "")
        title += f", {len(held)} {noun_of(file.metadata)}{'s' * (len(held) > 1)}" * (len(values) > 1)
        under = [(one.points, one.cells) for one in meshes]
        return StepPanel(held, f"{title}\n{part.size / file.size:.1%} of the file", under)

    ends = sorted({*within, own[-1]}) if within else own
    while len(ends) > 1 and not any(len(one.cells) for one in panel(ends[0]).contours):
        del ends[0]
    # of several isovalues the first says little alone
    start = max(len(ends) / options.steps - 1, 0) * (len(values) > 1)
    chosen = sorted({ends[round(at)] for at in np.linspace(len(ends) - 1, start, options.steps)})
    panels = []
    for layer in chosen:
        panels.append(panel(layer))
        if progress is not None:
            progress(len(panels), len(chosen))
    data = panels_picture(panels, suffix, options.view or USUAL, values)
    text = f"{len(panels)} step{'s' * (len(panels) > 1)} of {file.size:,} bytes"
    remarks = [*cut_short(file, "drawn"), *other_frames(file, frame, "drawn")]
    return Plotted(data, text, {"layers": chosen, "isovalues": values}, remarks)


def plot_map(what: IsoFile | Field, suffix: str, options: Plot, progress: Progress | None = None) -> Plotted:
    """Draw the contour map of a file, or of a field with the lines of an exact file of it.

    Raises `OptionError` if the file or field does not have two axes, and `InputError`, `FormatError` or `LimitError`.
    """
    isovalues: Any = options.every or [*options.isovalues] or None
    frame = options.frame
    if len(getattr(what, "shape", ())) != 2:
        raise OptionError("a map needs a grid with two axes", code="dimension", remedy="encode and decode it instead")
    if isinstance(what, IsoFile):
        file, samples = what, None
        if file.kind == "surface":
            tin = file.surface()
            samples, isovalues = tin.raster(), _isovalues(tin.values, isovalues)
        how: Any = {"frame": frame, "progress": progress}
        contours = [file.contour(one, **how) for one in isovalues] if isovalues else file.contours(**how)
        valid, remarks = file.valid() if contours[0].masked else None, other_frames(file, frame, "drawn")
    else:
        gone, placement, notes = what.combined(metadata=dict(options.metadata))
        samples, remarks = what.values, []
        if isovalues is None and what.labels is None:
            isovalues = _isovalues(samples[~missing_of(samples, gone)])
        traced = Traced(replace(what, mask=gone, placement=placement, notes=notes), isovalues, progress=progress)
        contours, valid = [*traced], traced.valid
    figure = map_figure(contours, samples, valid, options.title, options.size)
    data = picture_file(figure, suffix, bbox_inches="tight", pad_inches=0.2)
    values = [float(one.isovalue) for one in contours]
    text = f"{len(values)} {noun_of(contours[0].metadata)}{'s' * (len(values) > 1)}"
    return Plotted(data, text, {"isovalues": values}, remarks)


def _isovalues(values: np.ndarray, given: Any = None) -> list[float]:
    """Isovalues that are given, or about 20 multiples of a round interval, a whole one of integers."""
    low, high = range_of(values)
    if given is not None:
        return isovalues_of(given, lambda: (low, high))
    if not np.isfinite(high - low):
        raise InputError("the data hold infinite values", code="interval", remedy="use --isovalue")
    found = drawing("ticker").MaxNLocator(25, steps=[1, 2, 5, 10], integer=values.dtype.kind in "biu")
    return isovalues_of([one for one in found.tick_values(low, high) if low <= one < high] or [low])
