"""Pictures of files and fields: the steps of a progressive file side by side, and contour maps."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import lru_cache
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..drawing.pictures.map_picture import DARK, LIGHT, map_picture
from ..drawing.pictures.map_picture import MapLook as Drawing
from ..drawing.pictures.picture import Step, check_picture, steps_picture
from ..drawing.pictures.view import USUAL, View, read_view
from ..errors import InputError, OptionError, TruncatedError
from ..field.labelling import noun_of
from ..field.sampled import Field
from ..format.events import LayerComplete, MeshLayerComplete
from ..format.kinds import GEOMETRY
from ..io.writers.to_pictures import PICTURE
from ..limits import Budget, Limits
from ..stream.decoder import Decoder
from ..stream.isovalues import isovalues_of
from .encoding import encode
from .export import counted
from .isofile import IsoFile, open

MESH = 600
"""Most memory, in bytes, that drawing the mesh takes for each simplex."""
TOLERANCE = 0.005
"""In cells: even if a cell is drawn 2 cm wide, lines are correct to a tenth of a millimetre."""
LINES = 25
"""Largest number of lines on a map, if no interval is given."""


@dataclass
class Plotted:
    """A picture to be drawn.

    Attributes
    ----------
    render : callable
        Returns the bytes of the picture's file.
    facts : dict
        Counts, for programs.
    text : str
        The same counts, for people.
    remarks : list of str
        What of the file is not drawn.
    """

    render: Callable[[], bytes]
    facts: dict[str, Any]
    text: str
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Look:
    """Appearance of a map: every ``index``-th line is thick and labelled; longest side in cm, pixels per inch."""

    index: int = 5
    title: str = ""
    size: float = 20.0
    dpi: int = 200
    dark: bool = False
    relief: bool = True


def check_plot(path: str | os.PathLike[str], view: str | None = None) -> str:
    """Check the name of a picture and the view, before the work begins; returns the suffix.

    Raises
    ------
    OptionError
        If the suffix is not that of a picture, or the view is not valid.
    MissingExtraError
    """
    if view is not None:
        read_view(view)
    return check_picture(Path(path))


# ---- Steps ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Choice of the steps of a file to draw, and how to draw them.

    Attributes
    ----------
    count : int
        Largest number of panels.
    isovalue : float, optional
        Draw this one alone; all if not given, and of a surface of points evenly spaced ones.
    frame : int, optional
    smooth : bool, optional
        As of `IsoFile.contour`.
    mesh : bool
        Also draw the cells that the curve crosses.
    partial : bool
        Draw what is there of a truncated file.
    view : str, optional
        Direction from which a surface is seen.
    """

    count: int = 5
    isovalue: float | None = None
    frame: int | None = None
    smooth: bool | None = None
    mesh: bool = False
    partial: bool = False
    view: str | None = None


def steps_of(file: IsoFile, path: str | os.PathLike[str], steps: Steps, progress: Any = None) -> Plotted:
    """Draw prefixes of a file side by side, starting with the first one that shows any of the curve.

    Raises
    ------
    OptionError
        If a view is given for curves, or the file does not have the isovalue or the frame.
    FormatError, LimitError
    """
    if steps.view is not None and len(file.shape) != 3:
        raise OptionError("--view applies to surfaces only", code="view", remedy="leave it out")
    remarks: list[str] = []
    if file.kind in ("tiles", "surface"):
        drawn, isovalues = _by_layers(file, steps, progress, remarks)
    else:
        drawn, isovalues = _as_decoded(file, steps, progress, remarks)
    if steps.frame is None and file.frames > 1:
        remarks.append(
            f"only frame 0 of {file.frames} is drawn; choose another with --frame, from 1 to {file.frames - 1}"
        )
    seen: View = USUAL if steps.view is None else read_view(steps.view)
    suffix = check_picture(Path(path))
    count = len(drawn)
    return Plotted(
        lambda: steps_picture(drawn, suffix, seen, isovalues),
        {"steps": [step.bytes for step in drawn], "isovalues": [float(value) for value in isovalues]},
        f"{count} step{'s' * (count != 1)} of {file.size:,} bytes", remarks,
    )


def _by_layers(
    file: IsoFile, steps: Steps, progress: Any, remarks: list[str]
) -> tuple[list[Step], list[float]]:
    """Steps of a file that is decoded anew for each step: tiled files and surfaces."""
    isovalues: list[float] = [*file.isovalues]
    if steps.isovalue is not None:
        isovalues = [steps.isovalue]
    elif not isovalues:
        isovalues = _isovalues_on(file.surface(max_bytes=file.size if steps.partial else None).values, None)
    numbers = [file.isovalues.index(one) for one in isovalues if one in file.isovalues] or [0]
    info = counted(file)
    whole = [layer for layer in info.layers if layer.bytes is not None]
    each = [[layer.bytes or 0 for layer in whole if layer.isovalue == number] for number in numbers]
    sizes = [sum(layers) for layers in zip_longest(*each, fillvalue=0)]
    if len(whole) < len(info.layers):
        sizes.append(0)  # the file ends within a layer
    overhead = max(file.size - sum(sizes), 0)
    if steps.partial and not file.complete:
        remarks.append("the file is not complete; drawn as far as possible")
    drawn: list[Step] = []
    panels = Panels([""] * len(sizes), steps.count)
    view: dict[str, Any] = {"partial": steps.partial, "frame": steps.frame}

    @lru_cache(maxsize=1)
    def contours(layer: int) -> list[Contour]:
        return [file.contour(isovalue, layers=layer, smooth=steps.smooth, **view) for isovalue in isovalues]

    for layer in range(1, len(sizes) + 1):
        if panels.draws(layer, lambda layer=layer: any(len(one.cells) for one in contours(layer))):  # type: ignore[misc]
            meshes = [file.mesh(isovalue, layers=layer, **view) for isovalue in isovalues] if steps.mesh else []
            under = [(mesh.points, mesh.cells) for mesh in meshes]
            _add(drawn, Step(contours(layer), overhead + sum(sizes[:layer]), file.size, under), file.limits)
            if progress is not None:
                progress(len(drawn), len(panels.chosen))
    return drawn, isovalues


def _as_decoded(
    file: IsoFile, steps: Steps, progress: Any, remarks: list[str]
) -> tuple[list[Step], list[float]]:
    """Steps of a file that is decoded once, drawn while it is decoded."""
    info, total, wanted = file.info, file.size, steps.frame or 0
    alone = None if steps.isovalue is None else info.number_of(steps.isovalue)
    numbers = range(len(info.isovalues)) if alone is None else [alone]
    layers = [layer for layer in info.layers if layer.frame == wanted and layer.isovalue in numbers]
    only = None if alone is None else info.chain(alone)
    decoder = Decoder(file.limits, only=only, frame=wanted, mesh=file.mesh_given)
    panels = Panels([layer.kind for layer in layers], steps.count, [i for i, one in enumerate(layers, 1) if one.within],
                    [layer.isovalue for layer in layers])
    drawn: list[Step] = []

    def begun() -> Sequence[int]:
        """Numbers of the isovalues of the frame of which anything has come."""
        at, last = decoder.present
        return [number for number in numbers if at > wanted or number <= last]

    def contours() -> list[Contour]:
        return [decoder.contour(n, smooth=steps.smooth) for n in begun()]

    def draw(offset: int, within: float | None) -> None:
        meshes = [decoder.contents.mesh(n, False) for n in begun()] if steps.mesh else []  # type: ignore[union-attr]
        under = [(mesh.points, mesh.cells) for mesh in meshes if mesh is not None]
        _add(drawn, Step(contours(), offset, total, under, within), file.limits, decoder)
        if progress is not None:
            progress(len(drawn), max(len(panels.chosen), len(drawn)))

    own = 0
    decoder.feed(file.data)
    for event in decoder:
        frame, number = decoder.present
        if isinstance(event, LayerComplete | MeshLayerComplete) and frame == wanted and number in numbers:
            own += 1
            if panels.draws(own, lambda: any(len(one.cells) for one in contours())):
                draw(event.offset, layers[own - 1].within or None)
    try:
        if decoder.frames <= wanted:
            decoder.close()
    except TruncatedError as exc:
        if not (steps.partial and numbers[0] < len(decoder.isovalues) and (own or _begun(decoder))):
            raise
        remarks.append(f"{exc.message}; drawn as far as possible")
    if decoder.frame < wanted:
        raise OptionError(f"the file has no frame {wanted}", code="frame",
                          remedy=f"its frames are 0 to {file.frames - 1}")
    if own < len(layers) or not drawn:
        draw(total, None)  # the file ends within a layer
    return drawn, [info.isovalues[number] for number in numbers]


def _begun(decoder: Decoder) -> bool:
    """Whether a part of a layer has been decoded."""
    symbols = getattr(decoder.contents, "symbols", None)
    return symbols is None or any(symbols.values())


def _add(drawn: list[Step], step: Step, limits: Limits | None, decoder: Decoder | None = None) -> None:
    """Add a step, if the memory limit allows it and the picture."""
    drawn.append(step)
    cost = PICTURE[len(step.contours[0].shape) or 2]
    sizes = [(len(one.points), len(one.cells)) for each in drawn for one in each.contours]
    arrays = [a for each in drawn for one in each.contours for a in (one.points, one.cells)]
    held = sum(array.nbytes for array in arrays)
    for each in drawn:
        for one, mesh in zip(each.contours, each.meshes, strict=False):
            # three sides for each cell or simplex
            held += sum(array.nbytes for array in mesh) + MESH * max(len(mesh[1]), len(one.cells))
    held += sum(cost.after(*size) for size in sizes) + max(cost.peak(*size) for size in sizes)
    if decoder is None:
        Budget((limits or Limits()).memory).check(held)
    else:
        decoder.hold(held)


class Panels:
    """Chooses layers while they are decoded, starting with the first after which any of the curve is visible.

    Parameters
    ----------
    kinds : sequence of str
        Kinds of the layers, in order.
    steps : int
        Largest number of panels.
    promised : sequence of int
        Numbers, from 1, of the layers that complete a promise.
    isovalues : sequence of int
        Numbers of the isovalues of the layers; they are of one if not given.

    Attributes
    ----------
    chosen : list of int
        Numbers of the layers after which to draw, as far as they are already known.
    """

    def __init__(
        self, kinds: Sequence[str], steps: int, promised: Sequence[int] = (), isovalues: Sequence[int] = ()
    ) -> None:
        self._kinds, self._steps, self._promised = [*kinds], steps, promised
        self._runs = runs_of(isovalues)
        self._seen = False
        self.chosen: list[int] = []

    def draws(self, layer: int, seen: Callable[[], bool]) -> bool:
        """Whether to draw after this layer (always after the last); ``seen`` checks if any of the curve is visible."""
        if not self._seen:
            self.chosen = self._from(layer) if len(self._runs) < 2 else self._over()
        if layer not in self.chosen:
            return False
        self._seen = self._seen or layer >= len(self._kinds) or seen()
        return self._seen

    def _from(self, layer: int) -> list[int]:
        """Layers of one isovalue, starting with this one."""
        before = layer - 1
        promised = [number - before for number in self._promised if number > before]
        return [before + number for number in shown(self._kinds[before:], self._steps, promised)]

    def _over(self) -> list[int]:
        """Layers spread over several isovalues: ends of these, or some layers of each if there are fewer than steps."""
        runs, count = self._runs, len(self._runs)
        if count >= self._steps:
            return [runs[-(-count * k // self._steps) - 1][-1] for k in range(1, self._steps + 1)]
        each = self._steps // count
        chosen = []
        for run in runs:
            before = run[0] - 1
            promised = [number - before for number in self._promised if number in run]
            chosen += [before + number for number in shown(self._kinds[before : run[-1]], each, promised)]
        return chosen


def runs_of(isovalues: Sequence[int]) -> list[list[int]]:
    """Numbers, from 1, of layers of the same isovalue, in the order of the file."""
    return [[number for number, _ in run] for _, run in groupby(enumerate(isovalues, 1), lambda pair: pair[1])]


def shown(kinds: list[str], steps: int, promised: Sequence[int] = ()) -> list[int]:
    """Layers after which to draw: those with promises, those with geometry before a finer mesh, or any."""
    geometry = [kind in GEOMETRY for kind in kinds]
    ends = [i + 1 for i, here in enumerate(geometry) if here and not (i + 1 < len(kinds) and geometry[i + 1])]
    if promised and min(promised) < len(kinds):
        # what comes behind the last promise is more precise: all values
        ends = sorted({*promised, len(kinds)})
    if len(ends) < 2:
        return spread(len(kinds), steps)
    return [ends[k - 1] for k in spread(len(ends), steps)]


def spread(layers: int, steps: int) -> list[int]:
    """At most ``steps`` numbers, evenly spread over 1 .. ``layers`` and including ``layers``."""
    if steps == 1 or layers <= 1:
        return [max(layers, 1)]
    count = min(steps, layers)
    return [1 + round(k * (layers - 1) / (count - 1)) for k in range(count)]


# ---- Maps -----------------------------------------------------------------------------------------------------------


def map_of(
    what: IsoFile | Field, path: str | os.PathLike[str], look: Look, isovalues: Any = None, *,
    frame: int | None = None, metadata: dict[str, str] | None = None, progress: Any = None,
) -> Plotted:
    """Draw the contour map of a file, or of a field with the lines that a precise file of it would have.

    Raises
    ------
    OptionError
        If the file or field does not have two axes.
    InputError, FormatError, LimitError
    """
    samples = valid = None
    remarks: list[str] = []
    if isinstance(what, IsoFile):
        if len(what.shape) != 2:
            raise OptionError("this file cannot be drawn as a map, which needs a grid with two axes", code="dimension",
                              remedy="decode it instead")
        view = {"frame": frame, "progress": progress}
        if isinstance(isovalues, str) and what.isovalues:
            raise OptionError("an interval does not apply to a file that holds isovalues", code="interval",
                              remedy="choose some of them with --isovalue")
        if not what.isovalues:
            isovalues = _isovalues_on(what.surface().values, isovalues)
        contours = [what.contour(v, **view) for v in isovalues] if isovalues else what.contours(**view)
        valid = what.valid() if contours[0].masked else None
        if frame is None and what.frames > 1:
            remarks.append(
                f"only frame 0 of {what.frames} is drawn; choose another with --frame, from 1 to {what.frames - 1}"
            )
    else:
        contours, samples, valid = _lines(what, isovalues, metadata or {}, progress)
    suffix = check_picture(Path(path))
    drawing = Drawing(look.index, look.title, look.size, look.dpi, DARK if look.dark else LIGHT)
    facts: dict[str, Any] = {"isovalues": [float(one.isovalue) for one in contours]}
    count = len(contours)
    plotted = Plotted(lambda: b"", facts, f"{count} {noun_of(contours[0].metadata)}{'s' * (count != 1)}", remarks)

    def render() -> bytes:
        data, labels = map_picture(contours, suffix, drawing, samples if look.relief else None, valid)
        facts["labels"] = labels
        plotted.text += f", {labels} labels"
        return data

    plotted.render = render
    return plotted


def _lines(field: Field, isovalues: Any, metadata: dict[str, str], progress: Any) -> tuple[Any, Any, Any]:
    """The curves that a file of a field would hold, the samples, and which of them are valid (None if all are)."""
    if not isinstance(field, Field) or field.values.ndim != 2:
        raise InputError(f"a map needs a field with two axes; this one has {np.ndim(getattr(field, 'values', 0))}",
                         code="dimension")
    gone = _missing(field)
    valid = field.values[~gone]
    if not valid.size:
        raise InputError("all samples are missing", code="empty")
    given = f"every {usual_interval(valid)!r}" if isovalues is None else isovalues
    data = encode(field, given, precision=TOLERANCE, metadata=metadata, progress=progress)
    contours = open(data).contours()
    return contours, field.values, ~gone if gone.any() else None


def _isovalues_on(values: np.ndarray, given: Any) -> list[float]:
    """Isovalues of a surface: those given, or evenly spaced ones within its values."""
    text = f"every {usual_interval(values)!r}" if given is None else given
    return isovalues_of(text, lambda: (float(values.min()), float(values.max())))


def _missing(field: Field) -> np.ndarray:
    values = field.values
    gone = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, np.bool_)
    return gone if field.mask is None else gone | field.mask


def usual_interval(samples: np.ndarray) -> float:
    """Choose a round interval with about twenty multiples within the range of the data; for integer data, an integer.

    Raises
    ------
    InputError
        If the data hold infinite values.
    """
    low, high = float(samples.min()), float(samples.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        raise InputError("the data hold infinite values", code="interval", remedy="use --isovalue")
    least = max((high - low) / LINES, 1e-300)
    power = 10.0 ** np.floor(np.log10(least))
    interval = float(next(k * power for k in (1, 2, 5, 10) if k * power >= least))
    return max(interval, 1) if samples.dtype.kind in "biu" else interval
