"""An independent answer for the rotations inside a shot: pycolmap's two-view geometry between distant keyframes."""

from collections.abc import Iterator

import numpy as np
import pycolmap
from jaxtyping import Float

from humanmm.models import rotations
from humanmm.models.camera.bundle import Views
from humanmm.models.camera.odometry import Track
from humanmm.models.camera.tracked import TrackedShot
from humanmm.models.camera.two_view import relative_pose

NUM_PAIRS = 4
MIN_SHARED = 40
MAX_DISAGREEMENT_DEG = 3.0
"""Above this the disagreement is worth a warning."""


def disagreement_deg(shot: TrackedShot, track: Track, *, translating: bool) -> float:
    """Median angle between our relative rotations and pycolmap's for distant keyframes; nan where it has no answer.

    A moving camera is compared with the five-point essential matrix, one that only turns with the homography K R K⁻¹.
    """
    angles = []
    tolerance = 0.002 * shot.diagonal_px
    for a, b in _distant_pairs(shot, track):
        _, xy_a, xy_b = shot.shared(int(track.keyframes[a]), int(track.keyframes[b]))
        if translating:
            pose = relative_pose(xy_a, xy_b, track.views.focal_px, max_error_px=tolerance)
            theirs = None if pose is None else pose[0]
        else:
            theirs = _turn_from_homography(xy_a, xy_b, track.views, a, b, tolerance)
        if theirs is not None:
            ours = track.views.R_shot_cam[a].T @ track.views.R_shot_cam[b]
            angles.append(float(np.degrees(rotations.rotation_angle(ours.T @ theirs))))
    return float(np.median(angles)) if angles else float("nan")


def _distant_pairs(shot: TrackedShot, track: Track) -> Iterator[tuple[int, int]]:
    """Keyframe pairs as far apart as shared points allow, starting at places spread over the shot."""
    num_keyframes = len(track.keyframes)
    for a in np.unique(np.linspace(0, num_keyframes - 2, NUM_PAIRS).astype(int)):
        for b in range(num_keyframes - 1, a, -1):
            if len(shot.shared(int(track.keyframes[a]), int(track.keyframes[b]))[0]) >= MIN_SHARED:
                yield int(a), b
                break


def _turn_from_homography(
    xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], views: Views, a: int, b: int, tolerance: float
) -> np.ndarray | None:
    options = pycolmap.RANSACOptions(random_seed=0, max_error=tolerance)
    found = pycolmap.estimate_homography_matrix(xy_a, xy_b, options)
    if found is None:
        return None
    K_a = np.diag([views.focals_px[a], views.focals_px[a], 1.0])
    K_b = np.diag([views.focals_px[b], views.focals_px[b], 1.0])
    R_b_a = np.linalg.inv(K_b) @ found["H"] @ K_a
    R_b_a = R_b_a / np.cbrt(np.linalg.det(R_b_a))
    return rotations.nearest_rotation(R_b_a).T
