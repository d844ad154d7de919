"""All formats that are written: what each can hold, by suffix; the table for the documentation."""

from __future__ import annotations

import os
from pathlib import Path

from ...errors import OptionError
from . import (
    to_ezdxf,
    to_json,
    to_meshio,
    to_nibabel,
    to_numpy,
    to_pictures,
    to_pmtiles,
    to_pyogrio,
    to_simpleitk,
    to_trimesh,
)
from .output_formats import Kind, Output
from .things import Thing

OUTPUTS: tuple[Output, ...] = tuple(
    output
    for module in (
        to_numpy, to_pictures, to_json, to_pyogrio, to_pmtiles, to_ezdxf, to_meshio, to_trimesh, to_nibabel,
        to_simpleitk,
    )
    for output in module.OUTPUTS
)
SUFFIXES: tuple[str, ...] = tuple(dict.fromkeys(suffix for output in OUTPUTS for suffix in output.suffixes))
_KINDS: dict[Kind, str] = {
    "contour": "curves, surfaces", "areas": "areas, bands", "mask": "masks", "labels": "labels", "mesh": "meshes",
    "tin": "triangulated surfaces", "picture": "steps, contour maps",
}
"""Names of contents in the table; pyramids are listed as curves."""


def suffixes_of(kind: Kind, n: int | None = None, *, several: bool = False, sampled: bool = True) -> list[str]:
    """Suffixes of the formats that can hold a kind of content (of a field with ``n`` axes), for help and messages."""
    fitting = [output for output in OUTPUTS if output.kind == kind and output.fits(n, several, sampled)]
    return list(dict.fromkeys(suffix for output in fitting for suffix in output.suffixes))


def suffix_of(path: str | os.PathLike[str]) -> str | None:
    """The longest suffix of a name that belongs to a format; None without one."""
    name = Path(path).name.lower()
    found = [suffix for suffix in SUFFIXES if name.endswith(suffix) and len(name) > len(suffix)]
    return max(found, key=len, default=None)


def find(path: str | os.PathLike[str], thing: Thing) -> tuple[str, Output]:
    """Choose a format by a file's name, and check that it can hold the content and that its libraries are installed.

    Parameters
    ----------
    path : path
        Only the suffix is used.
    thing : Thing
        As far as it is known; before anything is decoded, for example ``Thing("contour", None)``.

    Returns
    -------
    str
        The suffix, in lower case.
    Output

    Raises
    ------
    OptionError
        Naming the formats that can be used.
    MissingExtraError
    """
    suffix = suffix_of(path)
    for output in OUTPUTS:
        if suffix in output.suffixes and output.kind == thing.kind and output.fits(
            thing.n, thing.several, thing.sampled
        ):
            output.check_libraries(suffix)
            return suffix, output
    fitting = suffixes_of(thing.kind, thing.n, several=thing.several, sampled=thing.sampled)
    remedy = f"one of {', '.join(fitting)}" if fitting else "no format can"
    if suffix is None:
        given = Path(path).suffix.lower() or "a name without a suffix"
        message = f"{given} is not a supported output format"
    elif thing.several and suffix in suffixes_of(thing.kind, thing.n, sampled=thing.sampled):
        message = f"{suffix} cannot hold several contours"
        remedy += ", or write one after the other"
    else:
        message = f"{suffix} cannot hold {thing.text}"
    raise OptionError(message, code="suffix", remedy=remedy)


def table() -> str:
    """Make the table of formats for the documentation (``docs/formats.md``)."""
    rows = ["| format | suffixes | holds | isovalues | coordinates | extra |", "| --- | --- | --- | --- | --- | --- |"]
    where = {"samples": "samples", "placement": "placement", "degrees": "longitude, latitude"}
    for output in OUTPUTS:
        if output.kind not in _KINDS:
            continue
        what = _KINDS[output.kind]
        if output.kind == "contour" and len(output.dimensions) == 1:
            what = what.split(", ")[output.dimensions[0] - 2]
        if output.kind in ("mask", "labels") and len(output.dimensions) == 1:
            what = f"{what} with {output.dimensions[0]} axes"
        suffixes = ", ".join(f"`{suffix}`" for suffix in output.suffixes)
        isovalues = output.holds or ("-" if output.kind == "tin" else "one")
        extra = f"`{output.extra}`" if output.extra else ""
        rows.append(f"| {output.title} | {suffixes} | {what} | {isovalues} | {where[output.coordinates]} | {extra} |")
    return "\n".join(rows) + "\n"
