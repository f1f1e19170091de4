"""A track of a detector that names COCO's 17 keypoints and no depth (ViTPose, HRNet, OpenPose's COCO model, …).

The rest of a `PersonTrack` is made up for from them: 3D landmarks by a lifter, landmarks that COCO does not name by
projecting those (visibility 0: no evidence), a mask drawn about the bones. Colours stay unknown.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.geometry.projection import project, ray_axes, start_position, viewing_rays
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.interfaces import SEEN, KeypointLifter
from humanmm.models.perception.lifting.lifted import with_root_rotated
from humanmm.models.perception.silhouettes import silhouettes
from humanmm.models.records.landmarks import COCO_LANDMARKS, LIMBS
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack

Array = np.ndarray

FEWEST = 6
"""Frames with fewer keypoints than this show nobody."""
FLESH = 0.05
"""How far a body reaches beyond its keypoints, fraction of their box."""
NEAREST_M = 0.3


def coco_track(
    frame: Int[Array, " n"],
    keypoints: Float[Array, "n 17 3"],
    *,
    time_s: Float[Array, " n"],
    K: Float[Array, "3 3"],
    size: tuple[int, int],
    lifter: KeypointLifter,
) -> PersonTrack:
    """One person's keypoints (source pixels, score 0..1) in some frames of a scene, in order; K may be rough.

    Frames with hardly a keypoint are left out.
    """
    usable = (keypoints[..., 2] >= SEEN).sum(axis=1) >= FEWEST
    frame, keypoints, time_s = frame[usable], keypoints[usable].astype(np.float64), time_s[usable]
    seen = keypoints[..., 2] >= SEEN
    found = lifter(keypoints, time_s, K)
    landmarks_cam = found.landmarks3d.astype(np.float64)
    points = _all_points(landmarks_cam, keypoints, seen, K)
    masks, affine = silhouettes(points)
    centre = affine.astype(np.float64) @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
    R_cam_ray = ray_axes(viewing_rays(centre, K))
    return PersonTrack(
        frame=frame.astype(np.int32),
        keypoints2d=points.astype(np.float32),
        landmarks3d=(landmarks_cam @ R_cam_ray).astype(np.float32),
        bbox=boxes_about(keypoints[..., :2], seen, size).astype(np.float32),
        confidence=np.clip(points[:, list(LIMBS), 2].mean(axis=1), 0, 1).astype(np.float32),
        masks=masks,
        mask_affine=affine,
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, HISTOGRAM_BINS), np.float32),
        lifted=True,
        pose=None if found.pose is None else with_root_rotated(found.pose, np.swapaxes(R_cam_ray, -1, -2)),
    )


def _all_points(
    landmarks_cam: Float[Array, "n 33 3"], keypoints: Float[Array, "n 17 3"], seen: Array, K: Float[Array, "3 3"]
) -> Float[Array, "n 33 3"]:
    """Pixels and visibility of all 33: the detector's where it saw something, else the projected landmark's."""
    named = list(COCO_LANDMARKS)
    rays = viewing_rays(keypoints[..., :2], K)[..., :2]
    origin = start_position(landmarks_cam[:, named], rays, seen.astype(np.float64))
    pixels = project(landmarks_cam + origin[:, None], K, near_m=NEAREST_M)
    points = np.concatenate([pixels, np.zeros((*pixels.shape[:2], 1))], axis=-1)
    points[:, named] = np.where(seen[..., None], keypoints, points[:, named])
    points[..., 2] = np.clip(points[..., 2], 0.0, 1.0)
    return points


def boxes_about(pixels: Float[Array, "n k 2"], seen: Bool[Array, "n k"], size: tuple[int, int]) -> Float[Array, "n 4"]:
    """Boxes (xyxy) about the points seen in each frame and the flesh about them, inside a picture of this size."""
    low = np.where(seen[..., None], pixels, np.inf).min(axis=1)
    high = np.where(seen[..., None], pixels, -np.inf).max(axis=1)
    margin = FLESH * (high - low)
    return np.concatenate([np.clip(low - margin, 0, size), np.clip(high + margin, 0, size)], axis=1)
