"""Add-on for Blender 3.4 or later: File, Import, Isocontours (.iso).

Each isovalue becomes a mesh: triangles of a surface, edges of curves. With levels of detail, each layer that leads to
it becomes a further object, hidden. Frames of a series are shown one by one on the time line.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from bpy_extras.io_utils import ImportHelper

bl_info = {
    "name": "Isocontours (.iso)", "author": "isocodec", "version": (1, 0, 0), "blender": (3, 4, 0),
    "location": "File > Import", "category": "Import-Export",
    "description": "Import isocontours and isosurfaces of .iso files",
}


def object_of(contour: Any, noun: str, name: str, collection: Any) -> Any:
    """Add an object with the mesh of a curve or surface, in the coordinates of the file; its property is the noun."""
    whole = contour.joined
    points = np.pad(whole.placed, ((0, 0), (0, 3 - whole.placed.shape[1])))
    cells = whole.placed_cells.tolist()
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), cells if contour.n == 2 else [], cells if contour.n == 3 else [])
    mesh.update()
    made = bpy.data.objects.new(name, mesh)
    made[noun] = contour.isovalue
    if (time := contour.metadata.get("time")) is not None:
        made["time"] = time
    collection.objects.link(made)
    return made


def shown_at(made: Any, frame: int | None) -> None:
    """Show an object at one frame of the time line alone; never, without one."""
    if frame is None:
        made.hide_viewport = made.hide_render = True
        return
    for at, hidden in ((frame - 1, True), (frame, False), (frame + 1, True)):
        made.hide_viewport = made.hide_render = hidden
        made.keyframe_insert("hide_viewport", frame=at)
        made.keyframe_insert("hide_render", frame=at)


class ImportIso(bpy.types.Operator, ImportHelper):
    """Import an .iso file"""

    bl_idname = "import_mesh.iso"
    bl_label = "Import isocontours"
    filename_ext = ".iso"
    filter_glob: bpy.props.StringProperty(default="*.iso", options={"HIDDEN"})  # type: ignore[valid-type]
    detail: bpy.props.BoolProperty(name="Levels of detail", description="Import each layer, too")  # type: ignore[valid-type]

    def execute(self, context: Any) -> set[str]:
        try:
            import isocodec
        except ImportError as error:
            self.report({"ERROR"}, f"{error}: unpack isocodec's bundle into Blender's folder of modules")
            return {"CANCELLED"}
        try:
            file = isocodec.open(self.filepath)
            collection = bpy.data.collections.new(bpy.path.display_name_from_filepath(self.filepath))
            noun = file.info.noun
            for frame, contours in enumerate(file.each_frame(partial=True), 1):
                for contour in contours:
                    name = file.info.caption(contour.isovalue) + f", frame {frame - 1}" * (file.frames > 1)
                    made = object_of(contour, noun, name, collection)
                    if file.frames > 1:
                        shown_at(made, frame)
            layers = len(file.info.layers) // max(len(file.isovalues), 1)
            for count in range(1, layers) if self.detail and file.frames == 1 else ():
                for contour in file.contours(layers=count):
                    if len(contour.points):
                        name = f"{file.info.caption(contour.isovalue)}, {count:02} layers"
                        shown_at(object_of(contour, noun, name, collection), None)
        except (isocodec.IsoError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.scene.collection.children.link(collection)
        if file.frames > 1:
            context.scene.frame_start, context.scene.frame_end = 1, file.frames
            context.scene.frame_set(1)
        return {"FINISHED"}


def entry(menu: Any, context: Any) -> None:
    menu.layout.operator(ImportIso.bl_idname, text="Isocontours (.iso)")


def register() -> None:
    bpy.utils.register_class(ImportIso)
    bpy.types.TOPBAR_MT_file_import.append(entry)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_import.remove(entry)
    bpy.utils.unregister_class(ImportIso)
