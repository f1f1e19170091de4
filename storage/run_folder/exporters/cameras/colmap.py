"""A COLMAP model as text: every frame an image, its K a PINHOLE camera (equal ones are one), points of the background.

Pixels have their centres at .5 in both. Points are grey and have no track (nobody keeps their sightings), and the error
-1, which COLMAP itself writes of points that it has not measured. Images are named as `ffmpeg -i film.mp4 -fps_mode
passthrough -start_number 0 frame_%06d.png` names them: by the frame of the video.
"""

import itertools
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.geometry.rotations import rotmat_to_unitquat_wxyz
from humanmm.models.motion.excerpt import Excerpt


def colmap_files(excerpt: Excerpt) -> Mapping[str, Callable[[Path], None]]:
    """colmap/cameras.txt, images.txt and points3D.txt, and what writes each."""
    K = excerpt.recording.K.astype(np.float64)
    parameters = np.stack([K[:, 0, 0], K[:, 1, 1], K[:, 0, 2], K[:, 1, 2]], axis=1)
    cameras, camera_of = np.unique(parameters, axis=0, return_inverse=True)
    return {
        "colmap/cameras.txt": partial(_write_cameras, excerpt, cameras),
        "colmap/images.txt": partial(_write_images, excerpt, camera_of.reshape(-1)),
        "colmap/points3D.txt": partial(_write_points, excerpt),
    }


def _write_cameras(excerpt: Excerpt, cameras: np.ndarray, path: Path) -> None:
    size = f"{excerpt.recording.width} {excerpt.recording.height}"
    lines = [f"{n} PINHOLE {size} " + " ".join(f"{value:.9g}" for value in row) for n, row in enumerate(cameras, 1)]
    _write(path, "# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy", *lines)


def _write_images(excerpt: Excerpt, camera_of: np.ndarray, path: Path) -> None:
    recording = excerpt.recording
    R_file_cam = excerpt.R_file_world @ recording.R_world_cam.astype(np.float64)
    R, t = inverse_pose(R_file_cam, excerpt.points(recording.t_world_cam))
    lines = []
    for index, values in enumerate(np.concatenate([rotmat_to_unitquat_wxyz(R), t], axis=1)):
        pose = " ".join(f"{value:.9f}" for value in values)
        lines += [f"{index + 1} {pose} {camera_of[index] + 1} frame_{excerpt.source_frame[index]:06d}.png", ""]
    _write(path, "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; an empty line for its points", *lines)


def _write_points(excerpt: Excerpt, path: Path) -> None:
    """The points of the shots of which some frame is written."""
    shown = np.unique(excerpt.recording.shot_index).tolist()
    points = [excerpt.points(excerpt.scenery[shot]) for shot in shown if shot in excerpt.scenery]
    lines = [
        f"{number} " + " ".join(f"{value:.6g}" for value in point) + " 128 128 128 -1"
        for number, point in enumerate(itertools.chain(*points), 1)
    ]
    _write(path, "# POINT3D_ID, X, Y, Z, R, G, B, ERROR; no TRACK[]" if lines else "# no points", *lines)


def _write(path: Path, *lines: str) -> None:
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
