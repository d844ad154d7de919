"""Promises of files about their curves: of chunks, notes and layers, and in words (spec clauses 3.7.2, 3.7.3)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from isospec.container import DomainKind

from ..errors import OptionError
from ..field.placement import COORDINATE_UNIT
from ..field.sampled import UNIT
from ..field.units import distance_of
from ..format.chunks import Promises
from ..format.header import Header
from ..format.kinds import LayerKind
from ..grid.lattice.tables import cube_exponent
from .file_info import FileInfo, LayerInfo
from .outline import Outline

PROMISE = "promise"
"""Name of the note with the distances that a file promises as they were asked for: ``4m,1m``."""
STEP = "step="
"""Prefix of a precision that is a step of values."""
AT = " at "
"""Precedes, in the note of a surface, the isovalues whose contours it was made for."""
SIGNS, EXACT = "all signs", "all values exactly"
CUT, LEVELS = "cut", "levels"
"""Kinds of layers on a mesh: the last one of each cut is to keep a distance; those of levels are measured."""


def noted(metadata: Mapping[str, str]) -> tuple[list[str], list[float]]:
    """Distances in the note of a file, as they were asked for, and the isovalues that it is about, of a surface.

    Empty without a note, or with one that is something else.
    """
    text, at, values = metadata.get(PROMISE, "").partition(AT)
    parts = [part for part in text.split(",") if part and not part.startswith(("exact", STEP))]
    try:
        for part in parts:
            distance_of(part)
        return parts, [float(value) for value in values.split()] if at else []
    except (OptionError, ValueError):
        return [], []


def noted_values(metadata: Mapping[str, str]) -> bool:
    """Whether the note of a file states distances and, after them, values, exact or in steps."""
    _, comma, last = metadata.get(PROMISE, "").rpartition(",")
    return bool(comma) and last.startswith(("exact", STEP))


def of_values(scale: float | None) -> str:
    """Name what a file states of values beside its curve, with the step of its header."""
    return EXACT if scale is None else f"values to within {scale / 2:g}"


def last_promise(metadata: dict[str, str], keep: bool = False) -> dict[str, str]:
    """The notes without that of promises; or, if it is to be kept, with the last distance alone."""
    parts, _ = noted(metadata)
    out = {name: text for name, text in metadata.items() if name != PROMISE}
    return {**out, PROMISE: parts[-1]} if keep and parts else out


def promised(
    layers: Sequence[LayerInfo], promises: Mapping[tuple[int, int], Promises], outline: Outline, header: Header,
    uncertain: Collection[int] = (),
) -> list[LayerInfo]:
    """The layers with what is promised of each, but for those that may not be complete."""
    domain, counts, cut = outline.domain, Counter[tuple[int, int]](), set[tuple[int, int]]()
    unit = 1.0 if domain is None else domain.unit
    out = []
    for number, layer in enumerate(layers):
        strand = layer.frame, layer.isovalue
        counts[strand] += 1
        cut |= {strand} if layer.kind == CUT else set()
        within = promises[strand].within.get(counts[strand], 0.0) * unit if strand in promises else 0.0
        if domain is None:
            whole = (layer.level, layer.plane) == (outline.full_level, 0)
        else:
            whole = domain.kind == DomainKind.KNOWN and (noted_values(outline.metadata) or strand not in cut)
        exact = layer.kind == LayerKind.VALUES and whole and header.scale is None
        stated = within if 0 < within < math.inf else 0.0 if exact else None
        out.append(replace(layer, within=None if number in uncertain else stated))
    return out


def cells_in_words(number: float | str) -> str:
    """A number of cells in words."""
    text = number if isinstance(number, str) else f"{number:.4g}"
    return f"{text} cell{'' if text == '1' else 's'}"


def on_mesh_in_words(distances: Sequence[float | str], notes: Mapping[str, str]) -> str:
    """Distances on a mesh in words."""
    texts = [one if isinstance(one, str) else f"{one:.4g}" for one in distances]
    unit = "" if distance_of(texts[-1])[1] else notes.get(COORDINATE_UNIT) or "in the unit of its points"
    return f"within {', '.join(texts)} {unit}".rstrip()


def asked(info: FileInfo, within: float | None, frame: int = 0, number: int = 0) -> str:
    """Find the text that asked for a distance in cells that a file promises, if that was in the world, or not in whole
    thousandths, to which a chunk rounds up; else nothing.
    """
    parts, _ = noted(info.metadata)
    own = [layer.within for layer in info.layers
           if (layer.frame, layer.isovalue) == (frame, number) and layer.within and layer.kind != LEVELS]
    if within is None or within not in own or own.index(within) >= len(parts):
        return ""
    return parts[own.index(within)]


def promised_at_last(info: FileInfo, number: int) -> float | None:
    """The distance that the last layers of an isovalue promise, of all frames the largest; None without a promise."""
    last = {layer.frame: layer.within for layer in info.layers if layer.isovalue == number}
    found = [within for within in last.values() if within is not None]
    return max(found) if found and len(found) == len(last) else None


def of_samples(info: FileInfo) -> str | None:
    """Name the samples or vertices that a file states: all signs, or all values beside its curve; None of others."""
    layers = [layer for layer in info.layers if (layer.frame, layer.isovalue) == (0, 0)]
    known = info.domain is None or info.domain.digest != b""
    if not layers or info.surface is not None or not known or info.tile is not None:
        return None
    last = layers[-1]
    whole = info.domain is not None or last.level == len(info.shape) * cube_exponent(info.shape)
    geometry = {LayerKind.VALUES, LayerKind.OFFSETS} & {layer.kind for layer in layers}
    coarser = last.within != 0.0 and any(layer.kind == CUT for layer in layers)
    if not whole or coarser:
        return None
    if last.kind == LayerKind.VALUES and last.plane == 0:
        return of_values(info.scale)
    return None if geometry or last.plane or any(layer.within for layer in layers) else SIGNS


def of_tiles(metadata: Mapping[str, str]) -> str | None:
    """Name what the note of a file in tiles states of samples: all signs or values; None if it is a distance."""
    text = metadata.get(PROMISE, "")
    if text.startswith(STEP):
        return of_values(float(text.removeprefix(STEP)))
    return {"exact": EXACT, "signs": SIGNS}.get(text)


def promise_of(info: FileInfo) -> str | None:
    """Put into words the precision that a complete file promises: ``within 1m (0.034 cells)``; None if it is none."""
    parts, contours = noted(info.metadata)
    if info.kind == "tiles" and (samples := of_tiles(info.metadata)):
        return samples
    if info.kind in ("surface", "mesh", "tiles") and parts:
        last = parts[-1]
        if info.kind == "surface" and contours:
            far = last if distance_of(last)[1] else cells_in_words(last)
            return f"contours of {', '.join(f'{value:g}' for value in contours)} within {far}"
        if info.kind == "tiles":
            return f"within {last if distance_of(last)[1] else cells_in_words(last)}"
        if info.kind == "surface":
            unit = "" if distance_of(last)[1] else info.metadata.get(UNIT, "")
            return f"values within {last} {unit}".rstrip()
        last = f", then {of_values(info.scale)}" if noted_values(info.metadata) else ""
        return on_mesh_in_words(parts, info.metadata) + last
    samples = of_samples(info)
    strands: dict[tuple[int, int], list[LayerInfo]] = {}
    for layer in info.layers:
        strands.setdefault((layer.frame, layer.isovalue), []).append(layer)
    # after a promise that is not the last layer's the curve may be farther away
    steps = {
        tuple(layer.within for layer in own if layer.within and (layer.kind != LEVELS or layer is own[-1]))
        if samples or own[-1].within is not None else () for own in strands.values()
    }
    if len(steps) != 1:
        return "differs between isovalues or frames: see the layers" if steps else None
    texts, distances = [], steps.pop()
    for within in distances:
        text = asked(info, within)
        in_world = text and distance_of(text)[1]
        texts.append(f"{text} ({cells_in_words(within)})" if in_world else cells_in_words(text or within))
    found = f"within {', '.join(texts)}" if texts else ""
    if texts and info.kind == "mesh":
        found = on_mesh_in_words(distances, info.metadata)
    return ", then ".join(filter(None, [found, samples])) or None
