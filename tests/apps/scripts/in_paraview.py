"""Points of all cells of files, time step by time step and with fewer layers, by ParaView; an image's isosurface."""

import inspect
import json
import sys

inspect.getargspec = inspect.getfullargspec  # of Python up to 3.10, which ParaView 5.11 wants

import numpy as np  # noqa: E402
from paraview import servermanager, simple  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

asked = json.loads(sys.argv[-1])
simple.LoadPlugin(asked["plugin"], remote=False, ns=globals())
out = {}


def keep(key, data):
    points = vtk_to_numpy(data.GetPoints().GetData())
    cells = data.GetPolys() if data.GetNumberOfPolys() else data.GetLines()
    out[f"{key} points"] = points[vtk_to_numpy(cells.GetConnectivityArray())]
    out[f"{key} counts"] = np.diff(vtk_to_numpy(cells.GetOffsetsArray()))
    out[f"{key} values"] = vtk_to_numpy(data.GetCellData().GetArray(0))


for key, (path, layers) in asked["files"].items():
    reader = simple.OpenDataFile(path)
    reader.Layers = layers
    reader.UpdatePipelineInformation()
    times = [*reader.TimestepValues] or [0.0]
    out[f"{key} times"] = np.array(times)
    for frame, time in enumerate(times):
        reader.UpdatePipeline(time)
        keep(f"{key} {frame}", servermanager.Fetch(reader))
for source, path, isovalue in asked["images"]:
    simple.SaveData(path, proxy=simple.OpenDataFile(source), Isovalue=isovalue)
np.savez(asked["out"], **out)
