"""The background that a travelling camera has placed in space, in the finished world."""

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.projection import camera_to_world, in_front, project, world_to_camera
from humanmm.models.motion.world.scale import USABLE_STD
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.recording import Recording

Array = np.ndarray

_NEAR = 1e-6
"""In units of the path."""
_NONE = np.zeros((0, 3))


def scenery_in_world(camera: ShotCamera, recording: Recording) -> Float[Array, "p 3"]:
    """The points of a shot's `Scenery`, metres, as the cameras of the recording see them; none of most cameras.

    Left out are points whose distance is hardly known, and those in no picture. The shot's frame goes where its cameras
    are now. Where their focal length is not the one that they were tracked with, a point is farther away by that factor
    (as people are, see `refocused`) from the middle one of the frames that show it: its pixel stays the same there, and
    nearly the same in the others.
    """
    if camera.scenery is None or not camera.travels:
        return _NONE
    points = camera.scenery.positions[camera.scenery.relative_std < USABLE_STD].astype(np.float64)
    shown = _shown(points, camera, recording.width, recording.height)
    points, shown = points[shown.any(axis=1)], shown[shown.any(axis=1)]
    if not len(points):
        return _NONE
    middle = np.array([np.flatnonzero(row)[row.sum() // 2] for row in shown])
    path = camera.t_shot_cam
    in_camera = world_to_camera(points[:, None], camera.R_shot_cam[middle], path[middle])

    frames = slice(camera.start, camera.end)
    R_world_cam, t_world_cam = (
        array[frames].astype(np.float64) for array in (recording.R_world_cam, recording.t_world_cam)
    )
    turned = path @ R_world_cam[0].T
    scale = float((turned * (t_world_cam - t_world_cam[0])).sum() / (turned**2).sum())
    farther = float(recording.K[camera.start, 0, 0] / camera.K[0, 0, 0])
    return camera_to_world(scale * in_camera * [1.0, 1.0, farther], R_world_cam[middle], t_world_cam[middle])[:, 0]


def _shown(points: Float[Array, "p 3"], camera: ShotCamera, width: int, height: int) -> Bool[Array, "p frames"]:
    """In which frames of the shot each point (shot frame) lies inside the picture."""
    shown = np.zeros((len(points), len(camera.K)), bool)
    for k, (R, t, K) in enumerate(zip(camera.R_shot_cam, camera.t_shot_cam, camera.K, strict=True)):
        in_camera = world_to_camera(points, R, t)
        pixels = project(in_camera, K, near_m=_NEAR)
        shown[:, k] = in_front(in_camera, near_m=_NEAR) & ((pixels >= 0) & (pixels <= [width, height])).all(axis=1)
    return shown
