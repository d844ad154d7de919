"""VTK reads its image data (.vti): values at the points of a regular grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from .opened import Choice, Format, Opened
from .place_of_samples import placed
from .reading import check_frame, reading
from .source import InputFile


class _ImageData(Opened):
    """Values at points, axes i, j, k; axes of one sample are left out."""

    def _open(self, choice: Choice) -> None:
        with reading("VTK image data"):
            self._reader, self._size, self._name = _header_of(self._source, choice.key)
            self.dtype = _dtype_of(self._reader, self._name)
        self.shape = tuple(count for count in self._size if count > 1)

    def _values(self, frame: int | None) -> NDArray[Any]:
        if frame is not None:
            check_frame(frame, 0)
        with reading("VTK image data"):
            self._reader.Update()
            _check(self._reader)
            array = self._reader.GetOutput().GetPointData().GetArray(self._name)
            support = optional("vtkmodules.util.numpy_support", extra="vtk", purpose="reading .vti")
            values = None if array is None else support.vtk_to_numpy(array)
            if values is None or values.size != math.prod(self._size):
                raise InputError(f"holds no single number for each point in '{plain(self._name)}'", code="unreadable")
            return np.array(values.reshape(self._size[::-1]).T).squeeze()

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("VTK image data"):
            about = self._reader.GetOutputInformation(0)
            image = optional("vtkmodules.vtkCommonDataModel", extra="vtk", purpose="reading .vti").vtkDataObject
            spacing, origin = np.array(about.Get(image.SPACING())), np.array(about.Get(image.ORIGIN()))
            turned = about.Get(image.DIRECTION()) if about.Has(image.DIRECTION()) else np.eye(3).ravel()
            directions = np.reshape(turned, (3, 3)) * spacing
            first = np.array(_extent(self._reader)[::2])
            matrix = np.column_stack([directions, origin + directions @ first])
            kept = [axis for axis in range(3) if self._size[axis] > 1]
            return placed(matrix[np.ix_(kept, [*kept, 3])], n)


def _header_of(source: InputFile, key: str | None) -> tuple[Any, tuple[int, ...], str]:
    """A reader that knows the header, the samples along each axis, and the name of the array."""
    xml = optional("vtkmodules.vtkIOXML", extra="vtk", purpose="reading .vti")
    with source.path.open("rb") as file:
        if b"ImageData" not in file.read(4096):
            raise InputError("is not VTK image data", code="unreadable")
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


def _dtype_of(reader: Any, name: str) -> np.dtype[Any]:
    """Type of the values of a name, as the header states it."""
    model = optional("vtkmodules.vtkCommonDataModel", extra="vtk", purpose="reading .vti").vtkDataObject
    support = optional("vtkmodules.util.numpy_support", extra="vtk", purpose="reading .vti")
    fields = reader.GetOutputInformation(0).Get(model.POINT_DATA_VECTOR())
    each = [fields.GetInformationObject(i) for i in range(fields.GetNumberOfInformationObjects())] if fields else []
    kinds = {one.Get(model.FIELD_NAME()): one.Get(model.FIELD_ARRAY_TYPE()) for one in each}
    return np.dtype(support.get_vtk_to_numpy_typemap().get(kinds.get(name), np.void))


def _extent(reader: Any) -> tuple[int, ...]:
    pipeline = optional("vtkmodules.vtkCommonExecutionModel", extra="vtk", purpose="reading .vti")
    executive = pipeline.vtkStreamingDemandDrivenPipeline
    return tuple(reader.GetOutputInformation(0).Get(executive.WHOLE_EXTENT()))


def _check(reader: Any) -> None:
    if reader.said or reader.GetErrorCode():
        raise InputError(f"cannot be read as VTK image data ({one_line('; '.join(reader.said[:1]) or 'damaged')})",
                         code="unreadable")


FORMATS = (
    Format(
        "VTK image data", (".vti",), _ImageData, extra="vtk", keyed=True, confined="vtkmodules.vtkIOXML",
        signatures=((0, b"<VTKFile", ".vti"), (0, b"<?xml", ".vti")),
    ),
)
