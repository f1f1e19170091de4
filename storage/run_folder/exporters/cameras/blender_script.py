"""A Python script for Blender that makes the cameras: one a shot, bound to a marker at its cut, zooms included.

Blender's frame 1 is the first one of the excerpt, as in its importers of BVH and films; the scene gets the video's
frame rate and size.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.models.motion.excerpt import Excerpt, continuous_quaternions

_SENSOR_MM = 36.0

_SCRIPT = '''"""The cameras of a video (humanmm): run in Blender's text editor, or `blender --python FILE`."""

import json

import bpy

VIDEO = ""  # for a background picture in every camera, the path of {film}
SCENE = json.loads(r"""{scene}""")

scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = SCENE["size_px"]
scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = SCENE["pixel_aspect"]
scene.render.fps = max(1, round(SCENE["fps"]))
scene.render.fps_base = scene.render.fps / SCENE["fps"]
scene.frame_start, scene.frame_end = 1, SCENE["num_frames"]
for shot in SCENE["shots"]:
    lens = bpy.data.cameras.new(shot["name"])
    camera = bpy.data.objects.new(shot["name"], lens)
    scene.collection.objects.link(camera)
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", SCENE["sensor_mm"]
    camera.rotation_mode = "QUATERNION"
    for frame, values in enumerate(shot["frames"], shot["first"]):
        camera.location, camera.rotation_quaternion = values[:3], values[3:7]
        lens.lens, lens.shift_x, lens.shift_y = values[7:]
        for owner, names in ((camera, ("location", "rotation_quaternion")), (lens, ("lens", "shift_x", "shift_y"))):
            for name in names:
                owner.keyframe_insert(name, frame=frame)
    if VIDEO:
        film = bpy.data.movieclips.load(VIDEO)
        film.frame_start = SCENE["film_start"]
        picture = lens.background_images.new()
        picture.source, picture.clip = "MOVIE_CLIP", film
        lens.show_background_images = True
    scene.timeline_markers.new(shot["name"], frame=shot["first"]).camera = camera
    scene.camera = scene.camera if shot["first"] > 1 else camera
'''


def write_blender_script(excerpt: Excerpt, path: Path) -> None:
    """The script, with the numbers in it: z up, metres.

    Blender plays a film frame by frame: behind frames at another rate it needs a copy that has these frames.
    """
    recording, first = excerpt.recording, int(excerpt.source_frame[0])
    copied = f"trim=start_frame={first},setpts=PTS-STARTPTS,fps={excerpt.fps:.8g}"
    film = f"a copy with these frames: ffmpeg -i VIDEO -vf {copied} COPY" if excerpt.resampled else "the video"
    fx, fy = (float(np.median(recording.K[:, axis, axis])) for axis in (0, 1))
    scene: dict[str, Any] = {
        "fps": excerpt.fps,
        "num_frames": recording.num_frames,
        "size_px": [recording.width, recording.height],
        "pixel_aspect": [max(1.0, fy / fx), max(1.0, fx / fy)],
        "sensor_mm": _SENSOR_MM,
        "film_start": 1 if excerpt.resampled else 1 - first,
        "shots": [_shot(excerpt, frames) for frames in excerpt.shots()],
    }
    path.write_text(_SCRIPT.replace("{film}", film).replace("{scene}", json.dumps(scene)), encoding="utf-8")


def _shot(excerpt: Excerpt, frames: slice) -> dict[str, Any]:
    """Name, first frame, and a row for each: centre, quaternion w x y z, lens in mm, shift in widths of the picture."""
    recording = excerpt.recording
    K, width = recording.K[frames].astype(np.float64), recording.width
    R, t = excerpt.cameras(frames)
    lens = K[:, 0, 0] / width * _SENSOR_MM
    shift_x = 0.5 - K[:, 0, 2] / width
    shift_y = (K[:, 1, 2] - recording.height / 2) / width * K[:, 0, 0] / K[:, 1, 1]
    rows = np.column_stack(
        [
            t,
            continuous_quaternions(R),
            np.stack([lens, shift_x, shift_y], axis=1),
        ]
    )
    name = f"camera_shot_{int(recording.shot_index[frames.start]):03d}"
    return {"name": name, "first": frames.start + 1, "frames": rows.round(8).tolist()}
