"""Write the formats of other tools: one call for contours, areas, masks, meshes, surfaces and pictures.

Coordinates are those of the file's placement (`Contour.placed`); for GeoJSON, longitude and latitude if the reference
system is known. Without a placement, and always in an SVG, the unit is the cell: in the plane x runs along axis 1 of
the array and y along axis 0, sample (i, j) at x = j, y = i; in space x, y, z are the axes 0, 1, 2.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...deferred import dataclass
from ...drawing.contour import Contour
from ...drawing.tessellation import Tessellation
from ...errors import OptionError, one_line
from ...field.labelling import is_of_labels
from ...field.placement import Placement, unplaced
from ...storage.atomic import check_target, writing
from .losses import Losses
from .output_formats import COLUMNS, Output, OutputOptions
from .registry import find
from .things import Areas, Each, PlacedTin, Pyramid, SampleMask, Thing, thing_of

USUAL = OutputOptions()
_SHOWN = 3
"""Largest number of library messages that a warning repeats."""


@dataclass(frozen=True)
class Written:
    """Result of writing.

    Attributes
    ----------
    suffix : str
        Suffix of the format.
    bytes : int
    above : int or None
        For a mask, how many samples are True.
    remarks : tuple of str
        What the format loses of placement and precision.
    """

    suffix: str
    bytes: int
    above: int | None = None
    remarks: tuple[str, ...] = ()


def check(
    path: str | os.PathLike[str], thing: Thing, *, options: OutputOptions = USUAL
) -> tuple[str, Output]:
    """Check, before the work begins, that content can be written to a path.

    Parameters
    ----------
    path : path
        The file to be written later.
    thing : Thing
        As far as it is known.
    options : OutputOptions
        ``to`` is the format, if given.

    Returns
    -------
    str
        The suffix.
    Output
        What the format can hold, and the memory that writing takes.

    Raises
    ------
    OptionError
        If the format cannot hold the content; names the formats that can.
    MissingExtraError
        If a library is missing.
    """
    suffix, output = find(path if options.to is None else f"_.{options.to.lstrip('.')}", thing)
    lines = thing.kind in ("contour", "pyramid") and thing.n in (None, 2)
    refused = {
        "layer": options.layer is not None and not output.layer,
        "precision": options.decimals is not None and not output.decimal,
        "higher-on": options.higher_on != USUAL.higher_on and not lines,
        "attribute": options.attribute != USUAL.attribute and not output.attributed,
        "index": options.index is not None and not output.attributed,
        "3d": options.raised and (thing.kind != "contour" or output.coordinates == "samples" or not output.heights),
    }
    for name in (name for name, wrong in refused.items() if wrong):
        raise OptionError(f"--{name} does not apply to {thing.text} in {suffix}", code=name, remedy="leave it out")
    if options.attribute is not None and options.attribute.lower() in ("", *COLUMNS):
        raise OptionError(f"isovalues cannot have the name {options.attribute!r} (--attribute), which files have for "
                          "something else", code="attribute", remedy=f"choose a name other than {', '.join(COLUMNS)}")
    return suffix, output


def write(path: str | os.PathLike[str] | BinaryIO, what: Any, *, options: OutputOptions = USUAL) -> Written:
    """Write content in the format that the suffix of ``path`` chooses, completely or not at all.

    Parameters
    ----------
    path : path or binary file
        An open file (standard output) needs ``options.to``.
    what : Contour, collection of Contour, Areas, bool array, SampleMask, Tessellation, Tin, Pyramid or Picture
        Several contours are iterated over once, so that each can be drawn when it is needed and released afterwards;
        such a collection has an attribute ``n``, the number of axes of the field. A bool array has no placement.
    options : OutputOptions

    Returns
    -------
    Written

    Raises
    ------
    OptionError
        If the format cannot hold the content; raised before the work begins.
    TruncatedError
        If areas are asked for, but the curve ends inside the field.
    MissingExtraError
        If a library is missing.
    OSError
        If the file cannot be written; an existing file is kept.

    Warns
    -----
    UserWarning
        With the warnings of libraries, combined into one.
    """
    target = None if hasattr(path, "write") else Path(path)
    made = _Rendering(what, "" if target is None else target, options)
    if target is not None:
        check_target(target)
    with _one_warning():
        if target is None:
            for piece in made:
                path.write(piece)  # type: ignore[union-attr]
        elif made.output.parts is None:
            with writing(target) as file:
                for piece in made:
                    file.write(piece)
        else:
            _put_parts(made.output.parts(target, b"".join(made)))
    return made.written


def render(what: Any, *, options: OutputOptions) -> bytes:
    """Return the complete file of some content, in the format ``options.to``; for a Shapefile, an archive of its files.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `write`.
    """
    with _one_warning():
        return b"".join(_Rendering(what, "", options))


class _Rendering:
    """Make the file of some content, in pieces; raises before the work begins if it cannot be made."""

    def __init__(self, what: Any, path: str | Path, options: OutputOptions) -> None:
        if path == "" and options.to is None:
            raise OptionError("an open file has no suffix that names the format", code="suffix",
                              remedy="name it: OutputOptions(to='.geojson')")
        self.suffix, self.output = check(path, thing_of(what), options=options)
        kept = self.output.keeps and path != "" and Path(path).is_file() and os.path.getsize(path) > 0
        self._options = options = replace(options, onto=Path(path) if kept else None)
        self._losses = Losses(self.output, self.suffix, options)
        self._what = _located(what, self.output, options, self._losses)
        self._bytes = 0

    def __iter__(self) -> Iterator[bytes]:
        pieces = self.output.render(self._what, self.suffix, self._options)
        for piece in [pieces] if isinstance(pieces, bytes) else pieces:
            self._bytes += len(piece)
            yield piece

    @property
    def written(self) -> Written:
        """Result once all pieces have been taken."""
        above = self._what.ones if self.output.kind == "mask" else None
        return Written(self.suffix, self._bytes, above, self._losses.remarks)


def _located(what: Any, output: Output, options: OutputOptions, losses: Losses) -> Any:
    """Convert content to what writers take, without its placement if coordinates are to be in samples."""

    def change(one: Any) -> Any:
        if options.in_samples and one.placement is not None:
            one = replace(one, placement=None)
        if options.raised:
            one = _raised(one)
        losses.see(one)
        return one

    def turn(contour: Contour) -> Contour:
        contour = change(contour)
        right = contour.mirrored and output.coordinates != "samples"
        if contour.n == 2 and right != (options.higher_on == "right"):
            contour = replace(contour, cells=contour.cells[:, ::-1].copy())
        return contour

    def turned(at: Callable[[float], Contour]) -> Callable[[float], Contour]:
        return lambda width: turn(at(width))

    if isinstance(what, Pyramid):
        return Pyramid(map(turned, what.isovalues))
    if isinstance(what, Contour):
        return Each([what], turn)
    if isinstance(what, Areas):
        return replace(what, contours=Each(what.contours, change))
    if output.kind == "tin" and not isinstance(what, PlacedTin):
        what = PlacedTin.of(what, options.in_samples)
        losses.see(what)
        return what
    if isinstance(what, np.ndarray):
        what = SampleMask(what)
    if isinstance(what, SampleMask | Tessellation):
        return change(what)
    return Each(what, turn) if isinstance(what, Collection) else what


def _raised(contour: Contour) -> Contour:
    """Place a curve at the height of its isovalue: on a plane in space."""
    placement = contour.placement or Placement(unplaced(2))
    matrix = placement.matrix
    if contour.n != 2 or not contour.shape or matrix is None or placement.in_space:
        raise OptionError("--3d needs curves of a plane field whose samples are evenly spaced", code="3d",
                          remedy="leave it out")
    if is_of_labels(contour.metadata):
        raise OptionError("--3d does not apply to labels, which are no heights", code="3d", remedy="leave it out")
    height = 0.0 if np.isnan(contour.isovalue) else float(contour.isovalue)
    return replace(contour, placement=replace(placement, matrix=np.vstack([matrix, [0, 0, height]])))


@contextmanager
def _one_warning() -> Iterator[None]:
    """Combine the warnings of libraries into one, unless an error is raised."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    lines = [*dict.fromkeys(one_line(str(one.message)) for one in caught)]
    if lines:
        more = f", and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
        warnings.warn("; ".join(lines[:_SHOWN]) + more, stacklevel=4)


def _put_parts(parts: Collection[tuple[Path, bytes]]) -> None:
    """Write the several files of one format; no file is replaced before all are complete."""
    for part, _ in parts:
        check_target(part)
    with ExitStack() as stack:
        # exited in reverse order, so that the named file is replaced last
        for part, content in reversed([*parts]):
            stack.enter_context(writing(part)).write(content)
