"""Pictures of the same place in different shots: features of a few key views and the relative pose between two views.

The paper joins shots by the human body alone (section 3.3.1). Where two shots also show the same background, it gives
their relative camera rotation far more exactly, and a recurring camera gives it without error. SIFT (Lowe 2004) with
the Hellinger kernel (Arandjelović and Zisserman 2012), mutual nearest neighbours with the ratio test, then pycolmap's
two-view geometry, which also handles planes and pure rotations.

A shot is represented by its first, middle and last frame: neighbouring shots meet in the outer ones, and a camera that
moves shows most in all three. Pixels have their centres at (0.5, 0.5).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.camera.odometry.colmap import pycolmap
from humanmm.models.records.shots import Shot

MAX_FEATURES = 2500
MAX_SIDE_PX = 1280
"""Reduce larger pictures before features are taken: detail beyond this does not repeat between cameras."""
RATIO = 0.8
"""Lowe's ratio test."""
MIN_MATCHES = 12
MIN_INLIERS = 15
"""Below this, wrong poses are as frequent as right ones (docs/method.md, "Background links")."""
MAX_ERROR_SHARE = 2.0 / 1280
"""Largest reprojection error of an inlier, as a share of the picture's longer side (2 px at 1280)."""
MAX_TRIALS = 1000
"""Samples of the robust estimator: enough where a third of the matches is right, and fewer make no link to be
trusted."""
SAME_CAMERA_SHARE = 1.0 / 640
"""Features that moved less than this share of the longer side count as unmoved: one standing camera."""


@dataclass(frozen=True)
class ViewFeatures:
    """Features of one frame, strongest first."""

    frame: int
    xy: Float[np.ndarray, "features 2"]
    """float32, source pixels."""
    descriptors: UInt8[np.ndarray, "features 128"]


@dataclass(frozen=True)
class KeyViews:
    """What the shots of a video look like without their people."""

    of_shot: tuple[tuple[ViewFeatures, ...], ...]
    """By shot, in order of time; empty where a shot failed, shows nothing clearly, or is the only one."""


@dataclass(frozen=True)
class ViewLink:
    """Relative pose of two views of one place."""

    frame_a: int
    frame_b: int
    R_a_b: Float[np.ndarray, "3 3"]
    """Camera axes at frame_b to those at frame_a."""
    num_inliers: int
    same_camera: bool
    """One standing camera: neither moved nor turned between the two views."""


def describe_view(frame: int, gray: UInt8[np.ndarray, "height width"]) -> ViewFeatures:
    """SIFT features of a grey picture of at most MAX_SIDE_PX, in its own pixels; no more than MAX_FEATURES."""
    # A contrast threshold of half the default keeps features on the plain walls that film sets are made of.
    keypoints, descriptors = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=0.02).detectAndCompute(gray, None)
    if descriptors is None:
        return ViewFeatures(frame, np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8))
    order = np.argsort([-k.response for k in keypoints], kind="stable")[:MAX_FEATURES]
    xy = np.array([keypoints[i].pt for i in order], np.float32) + 0.5
    return ViewFeatures(frame, xy, descriptors[order].astype(np.uint8))


def in_source_pixels(view: ViewFeatures, scale: float) -> ViewFeatures:
    """The view with its places multiplied by `scale`, for a picture that was reduced before."""
    return ViewFeatures(view.frame, view.xy * np.float32(scale), view.descriptors)


def key_frames(shot: Shot) -> tuple[int, ...]:
    """The first, the middle and the last frame of a shot outside transitions; none where they leave nothing of it."""
    first, end = shot.outside_transitions
    return tuple(sorted({first, (first + end) // 2, end - 1})) if first < end else ()


def drop_features(view: ViewFeatures, hidden: Bool[np.ndarray, "features"]) -> ViewFeatures:
    """The view without the features that `hidden` marks (people move between shots; the place does not)."""
    return ViewFeatures(view.frame, view.xy[~hidden], view.descriptors[~hidden])


def match_features(a: ViewFeatures, b: ViewFeatures) -> tuple[np.ndarray, np.ndarray]:
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


def link_views(a: ViewFeatures, b: ViewFeatures, K: Float[np.ndarray, "3 3"]) -> ViewLink | None:
    """Relative pose of two views with the same pinhole camera, or None where the background does not tell."""
    index_a, index_b = match_features(a, b)
    if len(index_a) < MIN_MATCHES:
        return None
    xy_a, xy_b = a.xy[index_a].astype(np.float64), b.xy[index_b].astype(np.float64)
    longer_side = 2 * max(K[0, 2], K[1, 2])
    moved = np.linalg.norm(xy_a - xy_b, axis=1)
    still = moved < SAME_CAMERA_SHARE * longer_side
    if still.sum() >= 2 * MIN_INLIERS and still.mean() > 0.6:
        return ViewLink(a.frame, b.frame, np.eye(3), int(still.sum()), same_camera=True)

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
    return ViewLink(a.frame, b.frame, R_b_a.T, num_inliers, same_camera=False)


def _hellinger(descriptors: UInt8[np.ndarray, "features 128"]) -> Float[np.ndarray, "features 128"]:
    values = descriptors.astype(np.float32)
    roots: np.ndarray = np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9))
    return roots
