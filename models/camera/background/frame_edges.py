"""Relative pose of two key frames that show the same background.

The paper joins shots by the human body alone (section 3.3.1). Where two shots also show the same background, it gives
their relative camera rotation far more exactly, and a recurring camera gives it without error. SIFT features with the
Hellinger kernel (Arandjelović and Zisserman 2012), mutual nearest neighbours with the ratio test (Lowe 2004), then
pycolmap's two-view geometry, which also handles planes and pure rotations.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.odometry.colmap import pycolmap

RATIO = 0.8
"""Lowe's ratio test."""
MIN_MATCHES = 12
MIN_INLIERS = 15
"""Below this, wrong poses are as frequent as right ones (docs/method.md, "Background links")."""
MAX_ERROR_SHARE = 2.0 / 1280
"""Largest reprojection error of an inlier, as a fraction of the picture's longer side (2 px at 1280)."""
MAX_TRIALS = 1000
"""Samples of the robust estimator: enough where a third of the matches is right, and fewer make no edge to be
trusted."""
SAME_CAMERA_SHARE = 1.0 / 640
"""Features that moved less than this fraction of the longer side count as unmoved: one static camera."""


@dataclass(frozen=True)
class FrameEdge:
    """Relative pose of the cameras of two frames that show one scene."""

    frame_a: int
    frame_b: int
    R_a_b: Float[np.ndarray, "3 3"]
    """Camera axes at frame_b to those at frame_a."""
    num_inliers: int
    same_camera: bool
    """One static camera: it neither moved nor rotated between the two frames."""


def match_features(a: FrameFeatures, b: FrameFeatures) -> tuple[np.ndarray, np.ndarray]:
    """Indices into a and b of mutual nearest neighbours that pass the ratio test."""
    nothing = np.zeros(0, np.int64)
    if len(a.xy) < 2 or len(b.xy) < 2:
        return nothing, nothing
    similarity = _hellinger(a.descriptors) @ _hellinger(b.descriptors).T
    nearest = np.argpartition(-similarity, 1, axis=1)[:, :2]
    best = np.sort(np.take_along_axis(similarity, nearest, axis=1), axis=1)[:, ::-1]
    nearest_b = similarity.argmax(axis=1)
    distance = np.sqrt(np.maximum(2 - 2 * best, 0))
    mutual = similarity.argmax(axis=0)[nearest_b] == np.arange(len(a.xy))
    index_a = np.flatnonzero(mutual & (distance[:, 0] < RATIO * distance[:, 1]))
    return index_a, nearest_b[index_a]


def find_frame_edge(a: FrameFeatures, b: FrameFeatures, K: Float[np.ndarray, "3 3"]) -> FrameEdge | None:
    """Relative pose of two frames taken with the same lens K, or None where the background does not tell."""
    index_a, index_b = match_features(a, b)
    if len(index_a) < MIN_MATCHES:
        return None
    xy_a, xy_b = a.xy[index_a].astype(np.float64), b.xy[index_b].astype(np.float64)
    longer_side = 2 * max(K[0, 2], K[1, 2])
    moved = np.linalg.norm(xy_a - xy_b, axis=1)
    still = moved < SAME_CAMERA_SHARE * longer_side
    if still.sum() >= 2 * MIN_INLIERS and still.mean() > 0.6:
        return FrameEdge(a.frame, b.frame, np.eye(3), int(still.sum()), same_camera=True)

    camera = pycolmap.Camera(
        model="PINHOLE",
        width=round(2 * K[0, 2]),
        height=round(2 * K[1, 2]),
        params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]],
        camera_id=1,
    )
    options = pycolmap.TwoViewGeometryOptions()
    options.compute_relative_pose = True
    options.min_num_inliers = MIN_INLIERS
    options.ransac.max_error = MAX_ERROR_SHARE * longer_side
    options.ransac.random_seed = 0
    options.ransac.max_num_trials = MAX_TRIALS
    pairs = np.repeat(np.arange(len(xy_a), dtype=np.uint32)[:, None], 2, axis=1)
    geometry = pycolmap.estimate_calibrated_two_view_geometry(camera, xy_a, camera, xy_b, pairs, options)
    b_from_a = geometry.cam2_from_cam1
    num_inliers = len(geometry.inlier_matches)
    if b_from_a is None or num_inliers < MIN_INLIERS:
        return None
    R_b_a: np.ndarray = b_from_a.rotation.matrix()
    return FrameEdge(a.frame, b.frame, R_b_a.T, num_inliers, same_camera=False)


def _hellinger(descriptors: UInt8[np.ndarray, "features 128"]) -> Float[np.ndarray, "features 128"]:
    values = descriptors.astype(np.float32)
    roots: np.ndarray = np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9))
    return roots
