"""The pinhole camera: poses, projection, viewing rays.

Pixels have their centres at .5: the centre of the top left pixel is (0.5, 0.5), and a principal point in the middle of
the picture is (width / 2, height / 2). Camera axes: x right, y down, z forward. R_a_b and t_a_b map b to a:
x_a = R_a_b x_b + t_a_b, so that t_world_cam is the camera's centre. Hartley and Zisserman 2004, chapter 6.
"""

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.rotations import swing

Array = np.ndarray


def world_to_camera(
    points_world: Float[Array, "*batch points 3"],
    R_world_cam: Float[Array, "*#batch 3 3"],
    t_world_cam: Float[Array, "*#batch 3"],
) -> Float[Array, "*batch points 3"]:
    """Points in camera axes: R_world_camᵀ (x − t_world_cam) (Hartley and Zisserman 2004, eq. 6.6)."""
    return np.asarray((points_world - t_world_cam[..., None, :]) @ R_world_cam)


def camera_to_world(
    points_cam: Float[Array, "*batch points 3"],
    R_world_cam: Float[Array, "*#batch 3 3"],
    t_world_cam: Float[Array, "*#batch 3"],
) -> Float[Array, "*batch points 3"]:
    """Points in world axes: R_world_cam x + t_world_cam, the inverse of `world_to_camera`."""
    return np.asarray(points_cam @ np.swapaxes(R_world_cam, -1, -2) + t_world_cam[..., None, :])


def inverse_pose(
    R_a_b: Float[Array, "*batch 3 3"], t_a_b: Float[Array, "*batch 3"]
) -> tuple[Float[Array, "*batch 3 3"], Float[Array, "*batch 3"]]:
    """R_b_a = R_a_bᵀ and t_b_a = −R_a_bᵀ t_a_b."""
    R_b_a = np.swapaxes(R_a_b, -1, -2)
    return R_b_a, -(R_b_a @ t_a_b[..., None])[..., 0]


def project(
    points_cam: Float[Array, "*batch points 3"], K: Float[Array, "*#batch 3 3"], *, near_m: float
) -> Float[Array, "*batch points 2"]:
    """Pixels of points in camera axes, K x / z (Hartley and Zisserman 2004, eq. 6.5).

    A point nearer to the camera's plane than `near_m`, or behind it, is projected as if it were `near_m` away: the
    result is finite, and `in_front` says where it means something.
    """
    projected = points_cam @ np.swapaxes(K, -1, -2)
    return np.asarray(projected[..., :2] / np.maximum(projected[..., 2:], near_m))


def in_front(points_cam: Float[Array, "*batch 3"], near_m: float) -> Bool[Array, "*batch"]:
    """True where a point is finite and further than `near_m` in front of the camera's plane."""
    return np.asarray(np.isfinite(points_cam).all(axis=-1) & (points_cam[..., 2] > near_m))


def viewing_rays(
    xy: Float[Array, "*batch points 2"], K: Float[Array, "*#batch 3 3"]
) -> Float[Array, "*batch points 3"]:
    """K⁻¹ (x, y, 1): directions through pixels in camera axes, z = 1; times a depth, the points there."""
    K = K[..., None, :, :]
    y = (xy[..., 1] - K[..., 1, 2]) / K[..., 1, 1]
    x = (xy[..., 0] - K[..., 0, 2] - K[..., 0, 1] * y) / K[..., 0, 0]
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def ray_axes(ray: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """R_cam_ray: from axes whose z is the viewing ray to camera axes, by the smallest rotation.

    In these axes the pose network gives its landmarks: orthographic about the crop's centre.
    """
    return swing(np.broadcast_to([0.0, 0.0, 1.0], ray.shape), ray)


def start_position(
    points: Float[Array, "N K 3"], rays: Float[Array, "N K 2"], weight: Float[Array, "N K"]
) -> Float[Array, "N 3"]:
    """Translation that brings points (camera axes) onto their viewing rays (x/z, y/z): linear least squares.

    (p_x + t_x) − u (p_z + t_z) = 0, and the same for y.
    """
    n, k = weight.shape
    A = np.zeros((n, k, 2, 3))
    A[..., 0, 0] = A[..., 1, 1] = 1
    A[..., 2] = -rays
    b = rays * points[..., 2:] - points[..., :2]
    rows, right = A.reshape(n, 2 * k, 3), b.reshape(n, 2 * k, 1)
    weighted = np.swapaxes(rows * np.repeat(weight, 2, axis=1)[..., None], -1, -2)
    return np.asarray(np.linalg.solve(weighted @ rows + 1e-9 * np.eye(3), weighted @ right)[..., 0])
