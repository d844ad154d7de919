"""Pictures of files and fields: the steps of a progressive file side by side, and contour maps."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..drawing.pictures.map_picture import DARK, LIGHT, map_picture
from ..drawing.pictures.map_picture import MapLook as Drawing
from ..drawing.pictures.picture import Step, check_picture, steps_picture
from ..drawing.pictures.view import USUAL, View, read_view
from ..errors import InputError, OptionError, TruncatedError
from ..field.sampled import Field
from ..format.events import LayerComplete, MeshLayerComplete
from ..format.kinds import GEOMETRY
from ..io.writers.to_pictures import PICTURE
from ..limits import Budget, Limits
from ..stream.decoder import Decoder
from ..stream.isovalues import isovalues_of
from .encoding import encode
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
        If not given, the first of the file; for a surface, the middle of its values.
    frame : int, optional
    smooth : bool
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
    smooth: bool = False
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
        drawn, isovalue = _by_layers(file, steps, progress)
    else:
        drawn, isovalue = _as_decoded(file, steps, progress, remarks)
    if steps.isovalue is None and (others := [repr(value) for value in file.isovalues if value != isovalue]):
        remarks.append(f"only isovalue {isovalue!r} is drawn; choose another with --isovalue: {' or '.join(others[:5])}"
                       + ", .." * (len(others) > 5))
    if steps.frame is None and file.frames > 1:
        remarks.append(
            f"only frame 0 of {file.frames} is drawn; choose another with --frame, from 1 to {file.frames - 1}"
        )
    seen: View = USUAL if steps.view is None else read_view(steps.view)
    suffix = check_picture(Path(path))
    count = len(drawn)
    return Plotted(
        lambda: steps_picture(drawn, suffix, seen),
        {"steps": [step.bytes for step in drawn], "isovalue": float(isovalue)},
        f"{count} step{'s' * (count != 1)} of {file.size:,} bytes", remarks,
    )


def _by_layers(file: IsoFile, steps: Steps, progress: Any) -> tuple[list[Step], float]:
    """Steps of a file that is decoded anew for each step: tiled files and surfaces."""
    isovalue = steps.isovalue
    if isovalue is None:
        isovalue = file.isovalues[0] if file.isovalues else _middle(file)
    number = file.isovalues.index(isovalue) if isovalue in file.isovalues else 0
    sizes = [layer.bytes or 0 for layer in file.info.layers if layer.isovalue == number] or [file.size]
    overhead = max(file.size - sum(sizes), 0)
    drawn: list[Step] = []
    panels = Panels([""] * len(sizes), steps.count)
    view: dict[str, Any] = {"partial": steps.partial, "frame": steps.frame}
    if steps.smooth:
        view["smooth"] = True
    for layer in range(1, len(sizes) + 1):
        contour = file.contour(isovalue, layers=layer, **view)
        if panels.draws(layer, lambda contour=contour: len(contour.cells) > 0):  # type: ignore[misc]
            mesh = file.mesh(isovalue, layers=layer) if steps.mesh else None
            under = None if mesh is None else (mesh.points, mesh.cells)
            _add(drawn, Step(contour, overhead + sum(sizes[:layer]), file.size, under), file.limits)
            if progress is not None:
                progress(len(drawn), len(panels.chosen))
    return drawn, isovalue


def _middle(file: IsoFile) -> float:
    values = file.surface().values
    return float((values.min() + values.max()) / 2)


def _as_decoded(file: IsoFile, steps: Steps, progress: Any, remarks: list[str]) -> tuple[list[Step], float]:
    """Steps of a file that is decoded once, drawn while it is decoded."""
    info, total = file.info, file.size
    number, wanted = info.number_of(steps.isovalue), steps.frame or 0
    layers = [layer for layer in info.layers if (layer.frame, layer.isovalue) == (wanted, number)]
    decoder = Decoder(file.limits, only=info.chain(number), frame=wanted, mesh=file.mesh_given)
    panels = Panels([layer.kind for layer in layers], steps.count, [i for i, one in enumerate(layers, 1) if one.within])
    drawn: list[Step] = []

    def draw(offset: int, within: float | None) -> None:
        mesh = decoder.contents.mesh(number, False) if steps.mesh else None  # type: ignore[union-attr]
        contour = decoder.contour(number, smooth=steps.smooth) if steps.smooth else decoder.contour(number)
        under = None if mesh is None else (mesh.points, mesh.cells)
        _add(drawn, Step(contour, offset, total, under, within), file.limits, decoder)
        if progress is not None:
            progress(len(drawn), max(len(panels.chosen), len(drawn)))

    own = 0
    decoder.feed(file.data)
    for event in decoder:
        if isinstance(event, LayerComplete | MeshLayerComplete) and decoder.present == (wanted, number):
            own += 1
            if panels.draws(own, lambda: len(decoder.contour(number).cells) > 0):
                draw(event.offset, layers[own - 1].within or None)
    try:
        decoder.close()
    except TruncatedError as exc:
        if not (steps.partial and number < len(decoder.isovalues) and (own or _begun(decoder))):
            raise
        remarks.append(f"{exc.message}; drawn as far as possible")
    if decoder.frame < wanted:
        raise OptionError(f"the file has no frame {wanted}", code="frame",
                          remedy=f"its frames are 0 to {file.frames - 1}")
    if own < len(layers) or not drawn:
        draw(total, None)  # the file ends within a layer
    return drawn, info.isovalues[number]


def _begun(decoder: Decoder) -> bool:
    """Whether a part of a layer has been decoded."""
    symbols = getattr(decoder.contents, "symbols", None)
    return symbols is None or any(symbols.values())


def _add(drawn: list[Step], step: Step, limits: Limits | None, decoder: Decoder | None = None) -> None:
    """Add a step, if the memory limit allows it and the picture."""
    drawn.append(step)
    cost = PICTURE[len(step.contour.shape) or 2]
    sizes = [(len(one.contour.points), len(one.contour.cells)) for one in drawn]
    arrays = [a for one in drawn for a in (one.contour.points, one.contour.cells, *(one.mesh or ()))]
    held = sum(array.nbytes for array in arrays)
    # three sides for each cell or simplex
    held += sum(MESH * max(len(one.mesh[1]), len(one.contour.cells)) for one in drawn if one.mesh is not None)
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

    Attributes
    ----------
    chosen : list of int
        Numbers of the layers after which to draw, as far as they are already known.
    """

    def __init__(self, kinds: Sequence[str], steps: int, promised: Sequence[int] = ()) -> None:
        self._kinds, self._steps, self._promised = [*kinds], steps, promised
        self._seen = False
        self.chosen: list[int] = []

    def draws(self, layer: int, seen: Callable[[], bool]) -> bool:
        """Whether to draw after this layer (always after the last); ``seen`` checks if any of the curve is visible."""
        if not self._seen:
            before = layer - 1
            promised = [number - before for number in self._promised if number > before]
            self.chosen = [before + number for number in shown(self._kinds[before:], self._steps, promised)]
        if layer not in self.chosen:
            return False
        self._seen = self._seen or layer >= len(self._kinds) or seen()
        return self._seen


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
    plotted = Plotted(lambda: b"", facts, f"{count} isovalue{'s' * (count != 1)}", remarks)

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
