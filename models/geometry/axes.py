"""World axes and camera conventions of other data sets in ours: world z up, camera to world, pixel centres at .5."""

import numpy as np
from jaxtyping import Float

R_ZUP_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""World axes of data with y up to ours with z up."""


def camera_to_world(
    R_cam_world: Float[np.ndarray, "*n 3 3"],
    t_cam_world: Float[np.ndarray, "*n 3"],
    R_ours_theirs: Float[np.ndarray, "3 3"] = R_ZUP_YUP,
) -> tuple[Float[np.ndarray, "*n 3 3"], Float[np.ndarray, "*n 3"]]:
    """R_world_cam and t_world_cam in our axes, from extrinsics x_cam = R_cam_world x_world + t_cam_world in theirs."""
    R_world_cam = R_ours_theirs @ np.swapaxes(R_cam_world, -1, -2)
    return R_world_cam, -(R_world_cam @ t_cam_world[..., None])[..., 0]


def centred_pixels(K: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """K for pixel centres at .5, from a calibration with pixel centres at integers (OpenCV)."""
    return np.asarray(K + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]))
