"""Writes all vectors and their manifest; the same bytes every time, on every platform."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from isocodec.errors import LimitError
from isocodec.format.events import Event, FrameRead, IsovalueRead, LayerComplete, MeshLayerComplete
from isocodec.limits import TIERS, Limits

from . import (
    adaptive,
    circle,
    explicit,
    explicit_errors,
    explicit_rules,
    frames,
    geometry,
    hostile,
    isovalues,
    mapped,
    misplaced,
    missing,
    mixed,
    rules,
    special,
    surface_errors,
    surfaces,
    tiled,
    valid,
)
from .draft import Draft
from .dump import COMPLETE, CUT_OFF, NO_COORDINATES, OTHER_MESH, Output
from .dump_file import dump_any, layers_of
from .explicit_dump import MESH, Mesh, is_explicit, read_mesh
from .manifest import (
    ERROR,
    LIMIT,
    NAME,
    NO_MESH,
    OK,
    TRUNCATED,
    Expected,
    LayerState,
    Vector,
    digest,
    read_manifest,
    write_manifest,
)
from .tiers import BEYOND, needs
from .tiled_dump import dump_tiled, is_tiled

_MODULES = (
    valid, special, adaptive, geometry, isovalues, mixed, rules, hostile, circle, missing, mapped, frames, explicit,
    explicit_rules, explicit_errors, surfaces, surface_errors, tiled, misplaced,
)
TEXT_LIMIT = 2200
"""Longest canonical text, in bytes, that is kept next to its vector for the runner to show differences."""


def generate(directory: Path) -> list[Vector]:
    """Write all vectors into a directory, replacing those that its manifest lists."""
    files: dict[str, bytes] = {}
    vectors = []
    for draft in all_drafts():
        mesh = None
        if draft.mesh:
            files[f"{draft.name}{MESH}"] = draft.mesh.encode("ascii")
            mesh = read_mesh(draft.mesh)
        output = dump_any(draft.data, mesh)
        vectors.append(_described(draft, output, mesh))
        files[f"{draft.name}.iso"] = draft.data
        if output.text and len(output.text) <= TEXT_LIMIT:
            files[f"{draft.name}.txt"] = output.text.encode("ascii")
    names = [v.name for v in vectors]
    if twice := {name for name in names if names.count(name) > 1}:
        raise AssertionError(f"two vectors are called {', '.join(sorted(twice))}")
    directory.mkdir(parents=True, exist_ok=True)
    _clear(directory)
    for name, content in files.items():
        (directory / name).write_bytes(content)
    write_manifest(directory, vectors)
    return vectors


def all_drafts() -> Iterator[Draft]:
    """All vectors, in the order of the manifest."""
    return chain(*(module.drafts() for module in _MODULES))


def _clear(directory: Path) -> None:
    if (directory / NAME).exists():
        for vector in read_manifest(directory):
            for suffix in (".iso", ".txt", MESH):
                (directory / vector.file).with_suffix(suffix).unlink(missing_ok=True)


def _described(draft: Draft, output: Output, mesh: Mesh | None) -> Vector:
    """The manifest's entry; what the author of the vector says of it is checked."""
    clause = output.error.clause if output.error else None
    if output.exit_code in (COMPLETE, CUT_OFF):
        if draft.clause is not None:
            raise AssertionError(f"{draft.name} is decoded, but violates clause {draft.clause}")
        lines = output.text.splitlines()
        expected = Expected(
            OK if output.exit_code == COMPLETE else TRUNCATED, None, digest(output.text),
            sum(line.startswith("v ") for line in lines), sum(line.startswith("e ") for line in lines),
            {name: count for name, count in output.symbols.items() if count},
            digest(output.coordinates) if output.coordinates != NO_COORDINATES else None,
        )
    elif isinstance(output.error, LimitError):
        if draft.clause != clause:
            raise AssertionError(f"{draft.name} needs more than the limits allow: {output.error}")
        expected = Expected(LIMIT, draft.beyond)
    elif draft.beyond is not None and draft.beyond == clause:  # this decoder's limits let it go on
        expected = Expected(LIMIT, draft.beyond)
    elif output.exit_code == OTHER_MESH:
        expected = Expected(NO_MESH)
    else:
        if draft.clause != clause:
            raise AssertionError(f"{draft.name} violates clause {clause}, not {draft.clause}: {output.error}")
        expected = Expected(ERROR, clause)
    layers = []
    if draft.layers:
        several = any(isinstance(event, (IsovalueRead, FrameRead)) for event in output.events)
        for event, isovalue, text in layers_of(draft.data, mesh):
            number = isovalue if several else None
            if isinstance(event, MeshLayerComplete):
                layers.append(LayerState(event.kind, -1, 0, 0, digest(text), isovalue=number))
                continue
            layer = event.layer
            layers.append(
                LayerState(layer.kind, layer.level, layer.plane, layer.parts, digest(text), layer.unit, number)
            )
    features = list(draft.features)
    if draft.clause is None:
        features += sorted(set(_features(output.events, draft.dimension)))
    return Vector(
        name=draft.name,
        file=f"{draft.name}.iso",
        bytes=len(draft.data),
        sha256=hashlib.sha256(draft.data).hexdigest(),
        dimension=draft.dimension,
        elements=[name for name, count in output.symbols.items() if count],
        features=features,
        expected=expected,
        layers=layers,
        tier=_tier(draft.data, expected),
    )


def _tier(data: bytes, expected: Expected) -> int:
    if expected.status == LIMIT:
        return BEYOND
    if is_tiled(data) and expected.status != ERROR:
        codes = ((tier, dump_tiled(data, Limits.tier(tier)).exit_code) for tier in sorted(TIERS))
        return next((tier for tier, code in codes if code != LimitError.exit_code), BEYOND)
    return 0 if expected.status == ERROR or is_explicit(data) else needs(data).tier


def _features(events: list[Event], n: int) -> Iterator[str]:
    """What the layers exercise, in terms of the levels modulo the dimension."""
    for event in events:
        if isinstance(event, IsovalueRead):
            yield "several isovalues"
            yield "isovalue that leans on none" if event.lean is None else "isovalue that leans on an earlier one"
        if isinstance(event, FrameRead):
            yield "frames"
            if not event.before:
                yield "isovalue of a further frame that leans on one of its own" if event.lean else "key frame"
        if not isinstance(event, LayerComplete):
            continue
        kind, level = event.layer.kind, event.layer.level
        if kind == "base":
            yield f"base, level {level % n} mod {n}"
        elif kind == "adaptive_base":
            yield f"adaptive base, uniform level {level % n} mod {n}"
        elif kind == "leaf_base":
            yield "leaf base"
        elif kind == "adapt":
            yield f"adaptive refinement, {'with' if event.layer.births else 'without'} births"
        elif kind == "refine":
            yield f"refinement, level {(level - 1) % n} mod {n}"
            # more than the root of the tree was coded
            if event.symbols["significance"] > 1:
                yield f"new components, level {(level - 1) % n} mod {n}"
