"""Points, their number, and the columns of all features of layers, by QGIS with its plugin; contours of a raster."""

import json
import os
import sys

import numpy as np
from qgis.core import QgsApplication, QgsProcessingContext, QgsProcessingFeedback, QgsVectorLayer

asked = json.loads(sys.argv[-1])
sys.path.insert(0, asked["plugins"])
program = QgsApplication([], False)
program.initQgis()
import isocontours  # noqa: E402

plugin = isocontours.classFactory(None)
plugin.initGui()
out = {}
for key, (path, layer) in asked["layers"].items():
    found = QgsVectorLayer(f"{path}|layername={layer}", key, "ogr")
    assert found.isValid(), path
    features = [*found.getFeatures()]
    places = [[(p.x(), p.y(), p.z()) for p in each.geometry().constGet().vertices()] for each in features]
    names = found.fields().names()
    out[f"{key} points"] = np.array([place for each in places for place in each])
    out[f"{key} counts"] = np.array([len(each) for each in places])
    out[f"{key} values"] = np.array([each.attribute(asked["nouns"][key]) for each in features])
    if "frame" in names:
        out[f"{key} frames"] = np.array([each.attribute("frame") for each in features])
algorithm = QgsApplication.processingRegistry().createAlgorithmById("isocodec:toiso")
_, done = algorithm.run(asked["contours"], QgsProcessingContext(), QgsProcessingFeedback())
assert done
plugin.unload()
np.savez(asked["out"], **out)
os._exit(0)  # QGIS without a window does not always end in order
