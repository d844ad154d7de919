"""Make files from other files without the field: shorter, cropped, in another profile or precision, or merged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..drawing.smoothing import SMOOTHING
from ..errors import OptionError
from ..field.placement import read_placement
from ..limits import Limits
from ..stream.cropped_source import box_of, cropped, moved_notes
from ..stream.given import in_cells
from ..stream.inspect import inspect
from ..stream.options import Options, Precision
from ..stream.promises import PROMISE, last_promise
from ..stream.recoder import recoded_frames
from ..stream.splicing import chosen, signs_of
from ..stream.truncation import truncate
from ..verbs import Edit
from .operations import IMPOSSIBLE, impossible
from .recoding import extracted, held_by, same_again

if TYPE_CHECKING:
    from ..tiles.tiled import TiledFile


def edited(data: bytes, kind: str, limits: Limits | None, edit: Edit) -> bytes:
    """Apply the changes to a file of a kind in this order: window, isovalues, profile and precision, layers or size."""
    if edit.window is not None:
        data = _cropped(data, kind, limits, edit.window)
    if edit.isovalues is not None:
        data = _with_isovalues(data, kind, limits, edit.isovalues)
    if edit.profile is not None or edit.precision is not None:
        data = _recoded_as(data, kind, limits, edit)
    if edit.layers is not None or edit.size is not None:
        data = truncate(data, layers=edit.layers, max_bytes=edit.size, limits=limits)
    return data


def edited_tiles(tiled: TiledFile, limits: Limits | None, edit: Edit) -> bytes:
    """Apply the changes to a tiled file, which stays one if only layers or a size are asked for."""
    recoded = edit.profile is not None or edit.precision is not None
    if edit.window is None and not recoded and edit.isovalues is None:
        return _shorter_tiles(tiled, edit.layers, edit.size)
    data = extracted(tiled, edit.window, edit.isovalues)
    if not (recoded or edit.layers or edit.size):
        return data
    return edited(data, "grid", limits, replace(edit, window=None, isovalues=None))


def _shorter_tiles(tiled: TiledFile, layers: int | None, size: int | None) -> bytes:
    """Keep the first stages of a tiled file, as many as asked for or as fit into ``size`` bytes."""
    from ..tiles.first_stages import first_stages

    if layers is not None:
        return b"".join(first_stages(tiled, layers))
    assert size is not None
    for count in range(len(tiled.head.stages), 0, -1):
        data = b"".join(first_stages(tiled, count))
        if len(data) <= size:
            return data
    raise OptionError(f"{size} bytes are too few for the first layer of all tiles", code="max-bytes",
                      remedy="allow more bytes")


def _cropped(data: bytes, kind: str, limits: Limits | None, window: Sequence[Sequence[float]]) -> bytes:
    """Crop all frames of a grid's file to a window of samples."""
    if ("window", kind) in IMPOSSIBLE:
        raise impossible("window", kind)
    held = held_by(data, limits)
    low, size = box_of(held.header.shape, window, limits or Limits())
    frames = [[cropped(one, low, size) for one in sources] for sources in held.frames]
    # ends of curves at the border of a box may be farther away than a promise about the whole
    held = replace(held, frames=frames, metadata=moved_notes(held.metadata, low), promised=[None] * len(held.promised))
    return same_again(held, Options(profile=held.profile, metadata=held.kept_notes), expected=False)


def _with_isovalues(data: bytes, kind: str, limits: Limits | None, isovalues: Sequence[float]) -> bytes:
    """Keep some isovalues of a file: copy their chunks, or re-encode if one is predicted from one that is dropped."""
    if kind == "surface":
        raise impossible("isovalues", "surface")
    if not len(isovalues):
        raise OptionError("no isovalue is given", code="isovalue", remedy="give one")
    info = inspect(data, limits=limits)
    numbers = sorted({info.number_of(one) for one in isovalues})
    try:
        return chosen(data, numbers)
    except OptionError as error:
        if error.code != "lean" or kind == "mesh":
            raise
    held = held_by(data, limits)
    held = replace(
        held, frames=[[one[number] for number in numbers] for one in held.frames],
        contours=[[one[number] for number in numbers] for one in held.contours],
        promised=[held.promised[number] for number in numbers],
    )
    return same_again(held, Options(profile=held.profile, metadata=held.kept_notes))


def _recoded_as(data: bytes, kind: str, limits: Limits | None, edit: Edit) -> bytes:
    """Re-encode the curves of a file in another profile, or less precisely; raises `OptionError` where `held_by` does.
    """
    profile, precision = edit.profile, edit.precision
    wanted = Precision.of(precision)
    single = wanted.default or wanted.signs or wanted.world or wanted.tolerance is not None
    if "," in wanted.world or wanted.smooth or not single:
        raise OptionError(f"precision {precision!r} does not apply to edits", code="precision",
                          remedy='give "signs", or a distance')
    if kind in ("mesh", "surface"):
        if profile not in (None, "main"):
            raise OptionError(f"profile {profile!r} does not apply to meshes and surfaces, which have the profile main",
                              code="profile")
        if wanted.default:
            return data
        if kind == "mesh" and wanted.signs:
            return signs_of(data)
    held = held_by(data, limits)
    notes = held.kept_notes if wanted.default else last_promise(held.metadata)
    if not wanted.default:
        notes.pop(SMOOTHING, None)
    if wanted.world:
        placement = read_placement(held.metadata, len(held.header.shape))
        if set(held.promised) == {0.0}:
            notes[PROMISE] = wanted.world
        wanted = in_cells(wanted, placement, held.metadata, {}, held.header.shape)
    options = Options(
        precision=wanted, profile=profile or held.profile, metadata=notes, keep_topology=edit.keep_topology,
        order=held.order,
    )
    if wanted.default:
        return same_again(held, options)
    off = [None if one is None or wanted.tolerance is None else one + wanted.tolerance for one in held.promised]
    return recoded_frames(held.frames, held.interval, options, promised=off, times=held.times)
