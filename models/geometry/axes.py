"""World axes and camera conventions of other data sets in ours: world z up, camera to world, pixel centres at .5."""

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.projection import inverse_pose

R_ZUP_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""World axes of data with y up to ours with z up."""


def zup_camera_pose(
    R_cam_world: Float[np.ndarray, "*n 3 3"], t_cam_world: Float[np.ndarray, "*n 3"]
) -> tuple[Float[np.ndarray, "*n 3 3"], Float[np.ndarray, "*n 3"]]:
    """R_world_cam and t_world_cam with z up, from extrinsics x_cam = R_cam_world x_world + t_cam_world with y up."""
    R_world_cam, t_world_cam = inverse_pose(R_cam_world, t_cam_world)
    return R_ZUP_YUP @ R_world_cam, t_world_cam @ R_ZUP_YUP.T


def centred_pixels(K: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """K for pixel centres at .5, from a calibration with pixel centres at integers (OpenCV)."""
    return np.asarray(K + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]))
