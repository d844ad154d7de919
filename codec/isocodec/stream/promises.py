"""Promises of files about their curves: of chunks, notes and layers, and in words (spec clauses 3.7.2, 3.7.3)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from isospec.container import DomainKind

from ..errors import OptionError
from ..field.placement import COORDINATE_UNIT
from ..field.sampled import UNIT
from ..field.units import distance_of, unit_of
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


def noted(metadata: Mapping[str, str]) -> tuple[list[str], list[float]]:
    """Distances in the note of a file, as they were asked for, and the isovalues that it is about, of a surface.

    Empty without a note, or with one that is something else.
    """
    text, at, values = metadata.get(PROMISE, "").partition(AT)
    parts = [part for part in text.split(",") if part and part != "exact"]
    try:
        for part in parts:
            distance_of(part)
        return parts, [float(value) for value in values.split()] if at else []
    except (OptionError, ValueError):
        return [], []


def noted_exact(metadata: Mapping[str, str]) -> bool:
    """Whether the note of a file states distances and, after them, exact values."""
    return metadata.get(PROMISE, "").endswith(",exact")


def noted_at_last(metadata: Mapping[str, str]) -> float | None:
    """The last distance in the note of a file on a mesh, in the unit of its points; None without a note, or if it has
    another unit.
    """
    parts, _ = noted(metadata)
    number, unit = distance_of(parts[-1]) if parts else (None, "")
    return number if unit in ("", unit_of(metadata.get(COORDINATE_UNIT))) else None


def last_promise(metadata: dict[str, str], keep: bool = False) -> dict[str, str]:
    """The notes without that of promises; or, if it is to be kept, with the last distance alone."""
    parts, _ = noted(metadata)
    out = {name: text for name, text in metadata.items() if name != PROMISE}
    return {**out, PROMISE: parts[-1]} if keep and parts else out


def promised_on_grid(
    layers: Sequence[LayerInfo], promises: Mapping[tuple[int, int], Promises], outline: Outline, header: Header,
    uncertain: set[int],
) -> list[LayerInfo]:
    """The layers with what is promised of each, but for those that may not be complete."""
    counts: Counter[tuple[int, int]] = Counter()
    out = []
    for number, layer in enumerate(layers):
        strand = layer.frame, layer.isovalue
        counts[strand] += 1
        within = promises[strand].within.get(counts[strand]) if strand in promises else None
        if within is None and (layer.kind, layer.level, layer.plane) == (LayerKind.VALUES, outline.full_level, 0):
            within = 0.0 if header.scale is None else None
        out.append(replace(layer, within=None if number in uncertain else within))
    return out


def promised_on_mesh(
    layers: Sequence[LayerInfo], outline: Outline, header: Header, complete: bool
) -> list[LayerInfo]:
    """The layers of a file on a mesh, the last one of each isovalue that is complete with the distance of the note."""
    last, cut = {}, set()
    for number, layer in enumerate(layers):
        strand = layer.frame, layer.isovalue
        last[strand] = number
        cut |= {strand} if layer.kind == "cut" else set()
    if not complete:
        last.pop((outline.frame, outline.number), None)
    known = outline.domain is not None and outline.domain.kind == DomainKind.KNOWN
    distance, exact = noted_at_last(outline.metadata), noted_exact(outline.metadata)
    out = list(layers)
    for strand, number in last.items():
        values = layers[number].kind == "values" and header.scale is None
        zero = values and known and (exact or strand not in cut)
        out[number] = replace(layers[number], within=0.0 if zero else None if exact else distance)
    return out


def cells_in_words(number: float | str) -> str:
    """A number of cells in words."""
    text = number if isinstance(number, str) else f"{number:.4g}"
    return f"{text} cell{'' if text == '1' else 's'}"


def asked(info: FileInfo, within: float | None, frame: int = 0, number: int = 0) -> str:
    """Find the text that asked for a distance in cells that a file promises, if that was in the world, or not in whole
    thousandths, to which a chunk rounds up; else nothing.
    """
    parts, _ = noted(info.metadata)
    own = [layer.within for layer in info.layers if (layer.frame, layer.isovalue) == (frame, number) and layer.within]
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
    coarser = any(layer.kind == "cut" for layer in layers)
    if not whole or coarser:
        return None
    if last.kind == LayerKind.VALUES and last.plane == 0:
        return EXACT if info.scale is None else f"values to within {info.scale / 2:g}"
    return None if geometry or last.plane or any(layer.within for layer in layers) else SIGNS


def of_tiles(metadata: Mapping[str, str]) -> str | None:
    """Name what the note of a file in tiles states of samples: all signs or values; None if it is a distance."""
    text = metadata.get(PROMISE, "")
    if text.startswith(STEP):
        return f"values to within {float(text.removeprefix(STEP)) / 2:g}"
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
        what = "values within " if info.kind == "surface" else "within "
        unit = info.metadata.get(UNIT if info.kind == "surface" else COORDINATE_UNIT) or ""
        missing = "" if info.kind == "surface" else "in the unit of its points"
        then = f", then {EXACT}" if noted_exact(info.metadata) else ""
        return (what + last if distance_of(last)[1] else f"{what}{last} {unit or missing}".rstrip()) + then
    samples = of_samples(info)
    strands: dict[tuple[int, int], list[float | None]] = {}
    for layer in info.layers:
        strands.setdefault((layer.frame, layer.isovalue), []).append(layer.within)
    # after a promise that is not the last layer's the curve may be farther away
    steps = {tuple(filter(None, own)) if samples or own[-1] is not None else () for own in strands.values()}
    if len(steps) != 1:
        return "differs between isovalues or frames: see the layers" if steps else None
    texts = []
    for within in steps.pop():
        text = asked(info, within)
        in_world = text and distance_of(text)[1]
        texts.append(f"{text} ({cells_in_words(within)})" if in_world else cells_in_words(text or within))
    found = f"within {', '.join(texts)}" if texts else ""
    return ", then ".join(filter(None, [found, samples])) or None
