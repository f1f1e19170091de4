"""The relative rotations that two key frames allow which show the same background.

The paper joins shots by the human body alone (section 3.3.1). Where two shots also show the same background, it gives
their relative camera rotation far more exactly, and a recurring camera gives it without error. SIFT features with the
Hellinger kernel (Arandjelović and Zisserman 2012), mutual nearest neighbours with the ratio test (Lowe 2004), then
pycolmap's two-view geometry and the homographies of the dominant planes. None of them is an answer: tiles, bricks,
lettering and posters that occur twice give wrong geometries with a hundred inliers, and a plane has a twin. Each is a
hypothesis with a probability, and `motion.rotations.shot_rotations` decides.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, Int

from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.odometry.colmap import pycolmap
from humanmm.models.geometry.rotations import nearest_rotation

RATIO = 0.8
"""Lowe's ratio test."""
MIN_MATCHES = 12
MIN_INLIERS = 15
"""Below this nearly all poses are wrong (docs/method.md, "Background edges")."""
MAX_ERROR_FRACTION = 2.0 / 1280
"""Largest reprojection error of an inlier, as a fraction of the picture's longer side (2 px at 1280)."""
MAX_TRIALS = 1000
"""Samples of the robust estimator: enough where a third of the matches is right, and fewer make no edge to be
trusted."""
SAME_CAMERA_FRACTION = 1.0 / 640
"""Features that moved less than this fraction of the longer side count as unmoved: one static camera."""
SAME_CAMERA_PROBABILITY = 0.97
MAX_PLANES, MIN_PLANE_INLIERS, PLANE_TRIALS = 3, 10, 3000


@dataclass(frozen=True)
class ViewHypothesis:
    """One rotation between the cameras of two frames that their common background allows."""

    R_a_b: Float[np.ndarray, "3 3"]
    """Camera axes at frame_b to those at frame_a."""
    num_inliers: int
    probability: float
    source: Literal["essential matrix", "plane", "same camera"]


@dataclass(frozen=True)
class FrameEdge:
    """What the background says of the cameras of two frames."""

    frame_a: int
    frame_b: int
    hypotheses: tuple[ViewHypothesis, ...]

    @property
    def same_camera(self) -> bool:
        """One static camera: it neither moved nor rotated between the two frames."""
        return self.hypotheses[0].source == "same camera"

    @property
    def probability(self) -> float:
        """That one of the hypotheses is true."""
        return 1.0 - float(np.prod([1.0 - one.probability for one in self.hypotheses]))


def match_features(
    a: Float[np.ndarray, "m 128"], b: Float[np.ndarray, "n 128"], *, ratio: float = RATIO
) -> tuple[Int[np.ndarray, " matches"], Int[np.ndarray, " matches"]]:
    """Indices into a and b (`roots_of`) of mutual nearest neighbours that pass the ratio test."""
    nothing = np.zeros(0, np.int64)
    if len(a) < 2 or len(b) < 2:
        return nothing, nothing
    similarity = a @ b.T
    every = np.arange(len(similarity))
    nearest = similarity.argmax(axis=1)
    best = similarity[every, nearest]
    similarity[every, nearest] = -1.0  # less than any: the largest is now the second
    second = similarity.max(axis=1)
    similarity[every, nearest] = best
    distinct = np.flatnonzero(np.sqrt(np.maximum(2 - 2 * best, 0)) < ratio * np.sqrt(np.maximum(2 - 2 * second, 0)))
    mutual = similarity[:, nearest[distinct]].argmax(axis=0) == distinct
    return distinct[mutual], nearest[distinct[mutual]]


def find_frame_edge(a: FrameFeatures, b: FrameFeatures, K: Float[np.ndarray, "3 3"]) -> FrameEdge | None:
    """The rotations that two frames taken with the same lens K allow, or None where the background determines none."""
    index_a, index_b = match_features(a.roots, b.roots)
    if len(index_a) < MIN_MATCHES:
        return None
    xy_a, xy_b = a.xy[index_a].astype(np.float64), b.xy[index_b].astype(np.float64)
    longer_side = 2 * max(K[0, 2], K[1, 2])
    moved = np.linalg.norm(xy_a - xy_b, axis=1)
    still = moved < SAME_CAMERA_FRACTION * longer_side
    if still.sum() >= 2 * MIN_INLIERS and still.mean() > 0.6:
        same = ViewHypothesis(np.eye(3), int(still.sum()), SAME_CAMERA_PROBABILITY, "same camera")
        return FrameEdge(a.frame, b.frame, (same,))
    max_error_px = MAX_ERROR_FRACTION * longer_side
    found = (*_of_essential_matrix(xy_a, xy_b, K, max_error_px), *_of_planes(xy_a, xy_b, K, max_error_px))
    return FrameEdge(a.frame, b.frame, found) if found else None


def _of_essential_matrix(
    xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], K: Float[np.ndarray, "3 3"], max_error_px: float
) -> tuple[ViewHypothesis, ...]:
    """The rotation of pycolmap's two-view geometry, which also handles a scene that is one plane, if it finds one."""
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
    options.ransac.max_error = max_error_px
    options.ransac.random_seed = 0
    options.ransac.max_num_trials = MAX_TRIALS
    # An essential matrix is a fundamental matrix too, which takes a quarter of the time to look for.
    fundamental = pycolmap.estimate_fundamental_matrix(xy_a, xy_b, options.ransac)
    if fundamental is None or fundamental["num_inliers"] < MIN_INLIERS:
        return ()
    pairs = np.repeat(np.arange(len(xy_a), dtype=np.uint32)[:, None], 2, axis=1)
    geometry = pycolmap.estimate_calibrated_two_view_geometry(camera, xy_a, camera, xy_b, pairs, options)
    b_from_a = geometry.cam2_from_cam1
    num_inliers = len(geometry.inlier_matches)
    if b_from_a is None or num_inliers < MIN_INLIERS:
        return ()
    R_b_a: np.ndarray = b_from_a.rotation.matrix()
    return (ViewHypothesis(R_b_a.T, num_inliers, essential_probability(num_inliers), "essential matrix"),)


def _of_planes(
    xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], K: Float[np.ndarray, "3 3"], max_error_px: float
) -> tuple[ViewHypothesis, ...]:
    """Both rotations that each dominant plane allows (decomposition of its homography: Malis and Vargas 2007).

    A plane's pattern that repeats shifts the plane, but not its rotation: where the essential matrix mixes several such
    shifts, one of these is still true.
    """
    found: list[ViewHypothesis] = []
    left = np.arange(len(xy_a))
    for _ in range(MAX_PLANES):
        if len(left) < MIN_PLANE_INLIERS:
            break
        cv2.setRNGSeed(0)
        H, mask = cv2.findHomography(
            xy_a[left], xy_b[left], cv2.USAC_MAGSAC, max_error_px, maxIters=PLANE_TRIALS, confidence=0.999
        )
        inlier = np.zeros(len(left), bool) if H is None else mask.ravel() > 0
        if inlier.sum() < MIN_PLANE_INLIERS:
            break
        num_inliers = int(inlier.sum())
        rays = np.concatenate([xy_a[left][inlier], np.ones((num_inliers, 1))], axis=1) @ np.linalg.inv(K).T
        _, rotations, _, normals = cv2.decomposeHomographyMat(H, K)
        possible = [
            np.asarray(R).T
            for R, normal in zip(rotations, normals, strict=True)
            if len(rotations) == 1 or (rays @ np.asarray(normal).ravel() > 0).mean() > 0.9  # one: a pure rotation
        ]
        for R_a_b in possible:
            share = plane_probability(num_inliers) / len(possible)
            found.append(ViewHypothesis(nearest_rotation(R_a_b), num_inliers, share, "plane"))
        left = left[~inlier]
    return tuple(found)


def essential_probability(num_inliers: int) -> float:
    """That the essential matrix gives the true rotation (249 pairs of key frames of 14 rendered clips, within 10°: 6 %
    with fewer than 26 inliers, 27 % with 26 to 34, 53 % with 35 to 49, 73 % with more)."""
    return float(0.03 + 0.80 / (1 + np.exp(-(num_inliers - 40) / 8)))


def plane_probability(num_inliers: int) -> float:
    """That one of a plane's rotations is true (216 planes of the same pairs, within 20°: 8 % with fewer than 10
    inliers, 35 % with 10 to 12, 59 % with 13 to 15, 78 % with 16 to 25, 94 % with more)."""
    return float(0.85 / (1 + np.exp(-(num_inliers - 15.5) / 2.5)))
