"""Points, their number, and the columns of all features of layers, by GDAL in pyogrio."""

import json
import sys

import geopandas
import numpy as np
import shapely

asked = json.loads(sys.argv[-1])
out = {}
for key, (path, layer) in asked["layers"].items():
    table = geopandas.read_file(path, layer=layer)
    shapes = table.geometry.values
    out[f"{key} points"] = shapely.get_coordinates(shapes, include_z=True)
    out[f"{key} counts"] = shapely.get_num_coordinates(shapes)
    out[f"{key} values"] = table.iloc[:, 0].to_numpy(float)
    if "frame" in table:
        out[f"{key} frames"] = table["frame"].to_numpy(int)
np.savez(asked["out"], **out)
