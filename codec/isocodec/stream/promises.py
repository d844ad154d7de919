"""Promises of files about their curves, in words: of chunks, notes and layers (spec clauses 3.7.2, 3.7.3)."""

from __future__ import annotations

from collections.abc import Mapping

from ..field.placement import COORDINATE_UNIT
from ..field.sampled import UNIT
from ..field.units import distance_of
from ..format.kinds import LayerKind
from ..grid.lattice.tables import cube_exponent
from .inspect import FileInfo
from .promise_note import PROMISE, STEP, noted, noted_exact

SIGNS, EXACT = "all signs", "all values exactly"


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
    cut = any(chunk.type == "cut_layers" for chunk in info.chunks)
    coarser = any(layer.kind == "cut" for layer in layers)
    if not whole or coarser or (cut and last.bytes is None):
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
    # behind a promise that is not the last layer's the curve may be farther away
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
