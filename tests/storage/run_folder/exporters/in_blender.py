"""Run by a Python with bpy: imports one exported file and writes where Blender has the joints and the camera's view.

    python in_blender.py FILE fps width height frame,frame,… OUT.json

Frames are Blender's and may lie between two: a glTF or USD scene begins at 0, BVH and FBX at 1.
"""

import json
import sys
from pathlib import Path

import bpy

# Blender's reader of glTF takes a scene of fps / fps_base for one of fps x fps_base: scenes here have whole rates
file, fps, width, height, frames, out = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = max(1, round(float(fps)))
scene.render.resolution_x, scene.render.resolution_y = int(width), int(height)
suffix = Path(file).suffix
if suffix == ".glb":
    bpy.ops.import_scene.gltf(filepath=file)
elif suffix == ".fbx":
    bpy.ops.import_scene.fbx(filepath=file)
    for lens in bpy.data.cameras:
        lens.sensor_fit = "HORIZONTAL"  # docs/export.md: Blender takes the width of an upright film for its height
elif suffix == ".bvh":
    bpy.ops.import_anim.bvh(filepath=file, global_scale=0.01)
elif suffix == ".usdc":
    bpy.ops.wm.usd_import(filepath=file)
elif suffix == ".py":
    exec(compile(Path(file).read_text(), file, "exec"))


def owner(armature):
    """person_00 … of an armature: its own name, or that of what it hangs in."""
    while armature.parent is not None and not armature.name.startswith("person"):
        armature = armature.parent
    return armature.name


found = {"people": {}, "cameras": {}, "markers": [[m.name, m.frame, m.camera.name] for m in scene.timeline_markers]}
graph = bpy.context.evaluated_depsgraph_get()
for text in frames.split(","):
    scene.frame_set(int(float(text)), subframe=float(text) % 1)
    graph.update()
    for thing in bpy.data.objects:
        if thing.type == "ARMATURE":
            joints = {b.name: list(thing.matrix_world @ b.head) for b in thing.pose.bones}
            found["people"].setdefault(owner(thing), {})[text] = joints
        if thing.type == "CAMERA":
            view = thing.calc_matrix_camera(graph, x=int(width), y=int(height)) @ thing.matrix_world.inverted()
            found["cameras"].setdefault(thing.name, {})[text] = [list(row) for row in view]
Path(out).write_text(json.dumps(found))
