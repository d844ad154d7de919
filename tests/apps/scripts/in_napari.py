"""Data of the layers of files, by napari; layers that it writes."""

import json
import sys

import napari
import numpy as np

asked = json.loads(sys.argv[-1])
out = {}
for key, path in asked["files"].items():
    viewer = napari.Viewer(show=False)
    for number, layer in enumerate(viewer.open(path, plugin="isocodec")):
        kind = type(layer).__name__
        out[f"{key} {number} {kind}"] = np.array(layer.metadata.get("isovalue", 0.0))
        parts = layer.data if kind != "Labels" else [layer.data]
        for place, part in enumerate(parts):
            out[f"{key} {number} {place}"] = np.asarray(part)
    viewer.close()
viewer = napari.Viewer(show=False)
for source, path, kind in asked["written"]:
    data = np.load(source)
    if kind == "labels":
        layer = viewer.add_labels(data)
    else:
        layer = viewer.add_image(
            data, contrast_limits=(-2, 3), scale=(2, 3, 4), translate=(30, -20, 10), shear=(0.1, 0.2, 0.3),
            rotate=(10, 20, 30), affine=[[0, 1, 0, 5], [2, 0, 0, 6], [0, 0, -1, 7], [0, 0, 0, 1]],
        )
        corners = out["image corners"] = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [4, 5, 6]])
        out["image places"] = np.array([layer.data_to_world(corner) for corner in corners])
    assert layer.save(path, plugin="isocodec") == [path]
np.savez(asked["out"], **out)
