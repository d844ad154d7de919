"""The registry of formats that are read: which library reads which, and how a file is opened.

Each module ``from_..`` belongs to one library; its records list the suffixes. A new format is a record there.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

from ...errors import InputError, OptionError, plain
from . import (
    from_geopandas,
    from_laspy,
    from_meshio,
    from_nibabel,
    from_numpy,
    from_pillow,
    from_pydicom,
    from_rasterio,
    from_simpleitk,
    from_tifffile,
    from_vtk,
    from_xarray,
    from_zarr,
)
from .confined import ConfinedOpened, mesh_by
from .mesh_formats import MeshFormat, MeshRead
from .opened import Choice, Format, Opened
from .reading import about
from .source import InputFile, is_dicom, source_of

FORMATS: tuple[Format, ...] = (
    *from_numpy.FORMATS, *from_vtk.FORMATS, *from_simpleitk.FORMATS, *from_pydicom.FORMATS, *from_pillow.FORMATS,
    *from_tifffile.FORMATS, *from_nibabel.FORMATS, *from_xarray.FORMATS, *from_rasterio.FORMATS,
)
"""Formats of fields."""
MESH_FORMATS: tuple[MeshFormat, ...] = (
    *from_vtk.MESHES, *from_meshio.MESHES, *from_numpy.MESHES, *from_laspy.MESHES, *from_geopandas.MESHES,
)
"""Formats of meshes and of scattered points."""
FIELD_SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.suffixes)
MESH_SUFFIXES = tuple(suffix for each in MESH_FORMATS if not each.scattered for suffix in each.suffixes)
POINT_SUFFIXES = tuple(suffix for each in MESH_FORMATS if each.scattered for suffix in each.suffixes)


def recognised(name: str, first: bytes) -> str | None:
    """Find the suffix of a format of fields: the one that a name ends in, or else that of the first 512 bytes."""
    lower = PurePosixPath(name).name.lower()
    named = [suffix for suffix in FIELD_SUFFIXES if lower.endswith(suffix)]
    if named:
        return max(named, key=len)
    signatures = (each for format in FORMATS for each in format.signatures)
    return next((suffix for at, sign, suffix in signatures if first[at : at + len(sign)] == sign), None)


def holds_mesh(path: str | os.PathLike[str], key: str | None = None, follow: bool = False) -> bool:
    """Whether a file, or what a key names of it, is a mesh or points, by its name and if need be by what is in it."""
    source = InputFile(Path(path), follow=follow)
    found = mesh_format_of(source)
    return found is not None and (found.holds is None or found.holds(source, key))


def open_file(
    path: str | os.PathLike[str], choice: Choice | None = None, *, samples: int | None = None, follow: bool = False,
    label: str | None = None,
) -> Opened:
    """Open a file of a field; its header is read, its samples are not.

    Parameters
    ----------
    path : path
    choice : Choice, optional
    samples : int, optional
        Most samples that may be read; `isocodec.limits.FIELD_SAMPLES` if not given.
    follow : bool
        Read other files that this one names by a path, or HDF5 keeps samples in. Without, only this file is read, and
        files in the same directory that the header of a MetaImage or NRRD or the notes of an OME-TIFF name.
    label : str, optional
        How errors name the file, instead of its path; empty: not at all.

    Raises
    ------
    OSError, InputError, LimitError, OptionError, MissingExtraError
        As `isocodec.read`.
    """
    named, path = path, Path(path)
    choice = choice or Choice()
    label = plain(os.fspath(path)) if label is None else label
    with about(label):
        found = format_of(path)
        source = source_of(named, samples, follow, found is not None and found.folder)
        if found is None and mesh_format_of(source) is not None:
            raise InputError(f"{plain(path.suffix)} files hold meshes or points, which are read whole and from files",
                             code="suffix", remedy="encode it with --values NAME, without --tile")
        if found is None:
            raise InputError(
                f"{plain(path.suffix) or 'a name without a suffix'} is not a supported format of fields",
                code="suffix", remedy="one of " + ", ".join(FIELD_SUFFIXES),
            )
        _check_choice(choice, found, plain(path.suffix))
        opened = ConfinedOpened(found, source, choice) if found.confined else found.open(source, choice)
    opened.label = label
    return opened


def _check_choice(choice: Choice, found: Format, suffix: str) -> None:
    """Check that what is chosen applies to a format."""
    for given, applies, code, error in (
        (choice.slice_tolerance, found.extra == "dicom", "slice-tolerance",
         f"--slice-tolerance is for slices of DICOM, not for {suffix}"),
        (choice.key, found.keyed, "key", f"a key names an array of a file that holds several, not of {suffix}"),
        (choice.channel, found.channels, "channel", f"a channel or band is part of a picture, not of {suffix}"),
        (choice.average or None, found.averages, "average", f"{suffix} has no values of cells to average"),
    ):
        if given is not None and not applies:
            raise OptionError(error, code=code)


def mesh_format_of(source: InputFile) -> MeshFormat | None:
    """Find the format of a file of a mesh, or of points, by its name."""
    return next((each for each in MESH_FORMATS if source.named(*each.suffixes)), None)


def format_of(path: Path) -> Format | None:
    """Find the format of a file or folder of a field, by its name and if need be by what is in it."""
    named = next((each for each in FORMATS if path.name.lower().endswith(each.suffixes)), None)
    if (named is None or path.suffix.lower() in from_nibabel.PAIRED) and path.is_file():
        by_content = ((is_dicom, from_pydicom.FORMATS[0]), (from_nibabel.is_pair, from_nibabel.PAIR),
                      (from_rasterio.has_header, from_rasterio.HEADED))
        named = next((format for holds, format in by_content if holds(path)), named)
    if (named is None or not named.folder) and path.is_dir():
        if from_pydicom.is_dicom_series(path):
            return from_pydicom.DICOM_FOLDER
        if from_zarr.is_store(path):
            return from_xarray.ZARR
    return named


def read_mesh(
    path: str | os.PathLike[str], samples: int | None = None, choice: Choice | None = None, *, follow: bool = False
) -> MeshRead:
    """Read a mesh, or scattered points, of one of ``MESH_SUFFIXES`` or ``POINT_SUFFIXES``.

    An .npz file has the arrays ``points``, ``cells``, and values at points, of one frame or of several, under other
    names; points with a ``placement`` are in samples, as ``decode`` and ``thin`` write them. Of files of VTK with times
    all are read. A table has a line for each point, with x, y and values, divided by commas, semicolons, tabs or
    spaces; its first line may name the columns. Columns of x and y are those that are named so (or lon, lat, easting,
    northing), else the first two; without names, the third is ``z``.

    Raises
    ------
    OSError, InputError, LimitError, OptionError, MissingExtraError
        As `isocodec.read`; there is an InputError for cells that cannot be cut into triangles or tetrahedra, too.
    """
    source, choice = source_of(path, samples, follow), choice or Choice()
    with about(plain(os.fspath(path))):
        found = mesh_format_of(source)
        if found is None:
            raise InputError(
                f"the suffix {plain(source.path.suffix)!r} names no format of meshes or points", code="suffix",
                remedy=f"known are {', '.join(MESH_SUFFIXES + POINT_SUFFIXES)}",
            )
        for name in ("frame", "average", "classes"):
            if getattr(choice, name) not in (None, False, ()) and name not in found.options:
                raise OptionError(f"{name} does not apply to {plain(source.path.suffix)}", code=name)
        mesh = mesh_by(found, source, choice)
        points, cells = mesh.points, mesh.cells
        source.check_count(len(points) + (0 if cells is None else len(cells)))
    if cells is not None and cells.shape[1] == 3 and points.shape[1] == 3 and (points[:, 2] == points[:1, 2]).all():
        points = np.ascontiguousarray(points[:, :2])
    return replace(mesh, points=points)
