"""Points and cells of the objects of files, frame by frame, by Blender with its add-on."""

import json
import sys

import bpy
import numpy as np

asked = json.loads(sys.argv[-1])
bpy.ops.preferences.addon_install(filepath=asked["plugin"])
bpy.ops.preferences.addon_enable(module="blender_iso")
out = {}
for key, (path, detail) in asked["files"].items():
    bpy.ops.wm.read_homefile(use_empty=True)
    assert bpy.ops.import_mesh.iso(filepath=path, detail=detail) == {"FINISHED"}
    scene = bpy.context.scene
    (collection,) = scene.collection.children
    for number, made in enumerate(collection.objects):
        mesh = made.data
        places = np.empty(3 * len(mesh.vertices))
        mesh.vertices.foreach_get("co", places)
        cells = [[*each.vertices] for each in (mesh.polygons if len(mesh.polygons) else mesh.edges)]
        out[f"{key} {number} points"], out[f"{key} {number} cells"] = places.reshape(-1, 3), np.array(cells)
        out[f"{key} {number} value"] = made["label" if key == "labels" else "isovalue"]
    view = bpy.context.view_layer
    view.update()
    out[f"{key} seen"] = np.array([i for i, each in enumerate(collection.objects) if each.visible_get()])
    out[f"{key} names"] = np.array([each.name for each in collection.objects])
    out[f"{key} frames"] = np.array([scene.frame_start, scene.frame_end])
    for frame in range(scene.frame_start, min(scene.frame_end, 10) + 1):
        scene.frame_set(frame)
        out[f"{key} shown {frame}"] = np.array([i for i, each in enumerate(collection.objects) if not each.hide_render])
np.savez(asked["out"], **out)
