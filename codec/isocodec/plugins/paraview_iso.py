"""Plugin for ParaView 5.9 or later: reads ``.iso`` files, and writes isosurfaces of image data to them.

Load it with Tools, Manage Plugins, or by ``LoadPlugin(.., remote=False)``. A series has its frames as time steps, at
their times, or the days since the first. ``Layers`` decodes only the first layers of each isovalue, 0 all. Several
isovalues make one data set, with the array ``isovalue`` (or ``label``) at its cells. Coordinates are those of the file.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.numpy_interface import dataset_adapter
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

import isocodec


def filled(out: vtkPolyData, contours: list[isocodec.Contour], noun: str) -> None:
    """Put curves or surfaces into a data set."""
    wholes = [contour.joined for contour in contours]
    places = [np.pad(each.placed, ((0, 0), (0, 3 - each.placed.shape[1]))) for each in wholes]
    first = np.cumsum([0, *map(len, places)])
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(np.concatenate(places)), deep=True))
    out.SetPoints(points)
    if contours[0].n == 3:
        cells = np.concatenate([each.placed_cells + start for each, start in zip(wholes, first, strict=False)])
        counts, indices = np.full(len(cells), 3), cells.ravel()
        owner = np.repeat(np.arange(len(wholes)), [len(each.cells) for each in wholes])
    else:
        walks = [np.asarray(walk) + start for each, start in zip(wholes, first, strict=False) for walk in each.walks]
        counts, indices = np.array([len(walk) for walk in walks], int), np.concatenate([[], *walks])
        owner = np.repeat(np.arange(len(wholes)), [len(each.walks) for each in wholes])
    array = vtkCellArray()
    array.SetData(numpy_to_vtkIdTypeArray(np.cumsum([0, *counts]).astype(np.int64), deep=True),
                  numpy_to_vtkIdTypeArray(indices.astype(np.int64), deep=True))
    (out.SetPolys if contours[0].n == 3 else out.SetLines)(array)
    values = dataset_adapter.WrapDataObject(out).CellData
    values.append(np.array([contour.isovalue for contour in contours], float)[owner], noun)


@smproxy.reader(name="IsoReader", label="Isocontours", extensions="iso", file_description="Isocontours (isocodec)")
class IsoReader(VTKPythonAlgorithmBase):
    """Reads curves or surfaces."""

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")
        self._path, self._layers = "", 0
        self._file: Any = None

    def _opened(self) -> Any:
        if self._file is None:
            self._file = isocodec.open(self._path)
        return self._file

    @smproperty.stringvector(name="FileName")
    @smdomain.filelist()
    @smhint.filechooser(extensions="iso", file_description="Isocontours (isocodec)")
    def SetFileName(self, name: str) -> None:
        if name != self._path:
            self._path, self._file = name, None
            self.Modified()

    @smproperty.intvector(name="Layers", default_values=0)
    @smdomain.intrange(min=0, max=40)
    def SetLayers(self, count: int) -> None:
        self._layers = max(count, 0)
        self.Modified()

    @smproperty.doublevector(name="TimestepValues", information_only="1", si_class="vtkSITimeStepsProperty")
    def GetTimestepValues(self) -> Any:
        file = self._opened()
        times = file.times
        if times is None:
            times = np.arange(file.frames, dtype=float)
        elif times.dtype.kind == "M":
            times = (times - times[0]) / np.timedelta64(1, "D")
        return None if file.frames < 2 else times.tolist()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        about = outputs.GetInformationObject(0)
        times = self.GetTimestepValues() or []
        for key, some in ((Pipeline.TIME_STEPS(), times), (Pipeline.TIME_RANGE(), times[:1] + times[-1:])):
            about.Remove(key)
            for time in some:
                about.Append(key, time)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        file, about, key = self._opened(), outputs.GetInformationObject(0), Pipeline.UPDATE_TIME_STEP()
        view = {"layers": self._layers} if self._layers else {}
        if file.frames > 1:
            time = about.Get(key) if about.Has(key) else 0.0
            view["frame"] = int(np.abs(np.array(self.GetTimestepValues()) - time).argmin())
        filled(vtkPolyData.GetData(outputs, 0), file.contours(**view), file.info.noun)
        return 1


@smproxy.writer(extensions="iso", file_description="Isocontours (isocodec)", support_reload=False)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class IsoWriter(VTKPythonAlgorithmBase):
    """Writes the isosurface, or in the plane the isocontour, of the point array that is active in image data."""

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, nOutputPorts=0, inputType="vtkImageData")
        self._path, self._isovalue, self._precision = "", 0.0, ""

    @smproperty.stringvector(name="FileName", panel_visibility="never")
    @smdomain.filelist()
    def SetFileName(self, name: str) -> None:
        self._path = name
        self.Modified()

    @smproperty.doublevector(name="Isovalue", default_values=0.0)
    def SetIsovalue(self, isovalue: float) -> None:
        self._isovalue = isovalue
        self.Modified()

    @smproperty.stringvector(name="Precision", default_values="")
    def SetPrecision(self, precision: str) -> None:
        self._precision = precision
        self.Modified()

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        arrays = (image := self.GetInputDataObject(0, 0)).GetPointData()
        scalars = arrays.GetScalars() or (arrays.GetArray(0) if arrays.GetNumberOfArrays() == 1 else None)
        if scalars is None:
            raise ValueError("no point array is active: pass on the one, or use Cell Data to Point Data")
        values = np.asarray(dataset_adapter.vtkDataArrayToVTKArray(scalars)).reshape(image.GetDimensions(), order="F")
        turn, extent = image.GetDirectionMatrix(), image.GetExtent()
        steps = np.array([[turn.GetElement(i, j) for j in range(3)] for i in range(3)]) * image.GetSpacing()
        origin = image.GetOrigin() + steps @ np.array(extent[::2], float)
        kept = [axis for axis in range(3) if values.shape[axis] > 1]
        if steps[2, kept].any() and len(kept) == 2:
            raise ValueError("contours of flat images keep no z: the image has to lie across it")
        if not values.min() <= self._isovalue < values.max():
            raise ValueError(f"nothing at {self._isovalue:g}: values are from {values.min():g} to {values.max():g}")
        field = isocodec.Field(values.squeeze(), placement=np.column_stack([steps[:, kept], origin])[: len(kept)])
        isocodec.save(self._path, field, self._isovalue, precision=self._precision or None)
        return 1

    def Write(self) -> None:
        self.Modified()
        self.Update()
