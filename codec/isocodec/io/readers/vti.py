"""VTK's image data (.vti): the values of its points on a regular grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from .reading import check_frame, reading
from .source import Source

VTI_SUFFIXES = (".vti",)


def read_vti(source: Source, key: str | None, frame: int | None) -> NDArray[Any]:
    """Samples, axes i, j, k; axes of one sample are left out.

    Raises
    ------
    InputError
        If it has several arrays, of which ``key`` names one, or values of cells only.
    LimitError, MissingExtraError
    """
    if frame is not None:
        check_frame(frame, 0)
    with reading("VTK image data"):
        reader, size, name = _opened(source, key)
        reader.Update()
        _check(reader)
        array = reader.GetOutput().GetPointData().GetArray(name)
        support = optional("vtkmodules.util.numpy_support", extra="vtk", purpose="reading .vti")
        values = None if array is None else support.vtk_to_numpy(array)
        if values is None or values.size != math.prod(size):
            raise InputError(f"holds no single number for each point in '{plain(name)}'", code="unreadable")
        return np.array(values.reshape(size[::-1]).T).squeeze()


def vti_matrix(source: Source) -> NDArray[np.float64]:
    """Where the samples lie, (n, n + 1), of the axes that are kept."""
    with reading("VTK image data"):
        reader, size, _ = _opened(source, None, False)
        about = reader.GetOutputInformation(0)
        image = optional("vtkmodules.vtkCommonDataModel", extra="vtk", purpose="reading .vti").vtkDataObject
        spacing, origin = np.array(about.Get(image.SPACING())), np.array(about.Get(image.ORIGIN()))
        turned = about.Get(image.DIRECTION()) if about.Has(image.DIRECTION()) else np.eye(3).ravel()
        directions = np.reshape(turned, (3, 3)) * spacing
        first = np.array(_extent(reader)[::2])
        matrix = np.column_stack([directions, origin + directions @ first])
        kept = [axis for axis in range(3) if size[axis] > 1]
        return matrix[np.ix_(kept, [*kept, 3])]


def _opened(source: Source, key: str | None, choose: bool = True) -> tuple[Any, tuple[int, ...], str]:
    """A reader that knows the header, the samples along each axis, and the name of the array."""
    xml = optional("vtkmodules.vtkIOXML", extra="vtk", purpose="reading .vti")
    with source.path.open("rb") as file:
        if b"ImageData" not in file.read(4096):
            raise InputError("is no image data of VTK", code="unreadable")
    reader = xml.vtkXMLImageDataReader()
    said: list[str] = []
    reader.AddObserver("ErrorEvent", lambda *_: said.append("it is damaged"))
    reader.said = said
    reader.SetFileName(str(source.path))
    reader.UpdateInformation()
    _check(reader)
    extent = _extent(reader)
    size = tuple(max(0, high - low + 1) for low, high in zip(extent[::2], extent[1::2], strict=True))
    if sum(count > 1 for count in size) not in (2, 3):
        raise InputError(f"has a grid of {' x '.join(map(str, size))} points", code="shape")
    selection = reader.GetPointDataArraySelection()
    names = [selection.GetArrayName(i) for i in range(selection.GetNumberOfArrays())]
    if not choose:
        return reader, size, ""
    if key is None and len(names) != 1:
        listed = ", ".join(plain(name) for name in names[:20]) or "no values at its points"
        raise InputError(f"holds {listed}", code="key", remedy="choose one with --key" if names else None)
    if key is not None and key not in names:
        raise InputError(f"holds no array '{plain(key)}', but: {', '.join(plain(n) for n in names[:20])}", code="key")
    for name in names:
        selection.SetArraySetting(name, int(name == (key or names[0])))
    reader.GetCellDataArraySelection().DisableAllArrays()
    source.check_count(math.prod(size))
    return reader, size, key or names[0]


def _extent(reader: Any) -> tuple[int, ...]:
    pipeline = optional("vtkmodules.vtkCommonExecutionModel", extra="vtk", purpose="reading .vti")
    executive = pipeline.vtkStreamingDemandDrivenPipeline
    return tuple(reader.GetOutputInformation(0).Get(executive.WHOLE_EXTENT()))


def _check(reader: Any) -> None:
    if reader.said or reader.GetErrorCode():
        raise InputError(f"cannot be read as VTK image data ({one_line('; '.join(reader.said[:1]) or 'damaged')})",
                         code="unreadable")
