"""FBX, whose format is Autodesk's secret: Blender reads our glTF scene and writes it, without a window.

`$HUMANMM_BLENDER` names Blender, or a Python that has the package bpy; otherwise `blender` on the path is taken.
"""

import dataclasses
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from humanmm.errors import InputError
from humanmm.models.motion.excerpt import Excerpt
from humanmm.storage.run_folder.exporters.gltf_scene import write_glb

VARIABLE = "HUMANMM_BLENDER"
_LIMIT_S = 1800

_CONVERT = """
import sys
import bpy
source, target, fps, width, height = sys.argv[-5:]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = max(1, round(float(fps)))
scene.render.resolution_x, scene.render.resolution_y = int(width), int(height)
bpy.ops.import_scene.gltf(filepath=source)
collection = bpy.data.collections.get("glTF_not_exported")  # Blender's own shapes of bones
for shape in list(collection.objects if collection else ()):
    bpy.data.objects.remove(shape)
for lens in bpy.data.cameras:  # the writer of fbx knows the width of a film alone
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", lens.sensor_height * int(width) / int(height)
def curves(action):
    if not hasattr(action, "layers"):
        return list(action.fcurves)
    strips = [strip for layer in action.layers for strip in layer.strips]
    return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]
for action in bpy.data.actions:  # a skeleton of no size breaks readers
    for curve in curves(action):
        if curve.data_path == "scale":
            for key in curve.keyframe_points:
                key.co.y = max(key.co.y, 1e-3)
scene.render.fps_base = scene.render.fps / float(fps)
ends = [one.frame_range for one in bpy.data.actions]
scene.frame_start = int(min((a for a, _ in ends), default=0))
scene.frame_end = round(max((b for _, b in ends), default=1))
bpy.ops.export_scene.fbx(
    filepath=target, object_types={"ARMATURE", "MESH", "CAMERA", "EMPTY"}, add_leaf_bones=False, bake_anim=True,
    bake_anim_use_all_actions=False, bake_anim_use_nla_strips=False, bake_anim_simplify_factor=0.0,
)
"""


def write_fbx(excerpt: Excerpt, path: Path) -> None:
    """The scene as fbx: what the glb holds, at a constant rate. InputError if there is no Blender or it fails.

    Blender's reader of glTF lays a rate such as 29.97 between its frames (it multiplies by fps_base): it gets the
    frames at a whole rate, and the scene its own rate afterwards.
    """
    command = _blender()
    whole_rate = max(1, round(excerpt.fps))
    times = np.arange(excerpt.recording.num_frames) / whole_rate
    counted = dataclasses.replace(excerpt, recording=dataclasses.replace(excerpt.recording, time_s=times))
    with tempfile.TemporaryDirectory() as folder:
        source, target, script = (Path(folder) / name for name in ("scene.glb", "scene.fbx", "convert.py"))
        write_glb(counted, source)
        script.write_text(_CONVERT, encoding="utf-8")
        settings = (repr(excerpt.fps), str(excerpt.recording.width), str(excerpt.recording.height))
        called = [*command, str(script), "--", str(source), str(target), *settings]
        try:
            done = subprocess.run(called, capture_output=True, text=True, check=False, timeout=_LIMIT_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(f"{command[0]} could not write the fbx: {error}") from error
        if done.returncode or not target.is_file():
            last = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["it said nothing"]
            raise InputError(f"{command[0]} could not write the fbx: {last[0]}")
        shutil.copyfile(target, path)


def _blender() -> list[str]:
    """How a script is run in Blender."""
    named = os.environ.get(VARIABLE)
    found = shutil.which(named or "blender")
    if found is None:
        reason = f"${VARIABLE} names {named}, which is no program" if named else "there is no `blender` on the path"
        raise InputError(f"fbx is written by Blender, but {reason}; install Blender, or name one in ${VARIABLE}")
    if Path(found).name.startswith("python"):
        return [found]
    return [found, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]
