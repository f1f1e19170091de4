"""Everybody in one scene from the bodies that another system found: its motion, in the axes of its camera.

Its rotations are put on body24 and shown to the later stages as if our networks had seen them: landmarks in the picture
by its own camera, landmarks in space, joint rotations. So identities, joining and refinement work as always. SMPL's
shape basis is not here: bodies are of average build, unless their height or body24's own shape is given. How large they
are in the picture is what the fit has of their distance: a body of another height than the system's own at the same
place is later found nearer or farther.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.body.body24 import FREE_JOINTS, NUM_JOINTS, ROTATED_JOINTS, load_body
from humanmm.models.body.kinematics import compose, local_rotations
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.body.proportions import resized
from humanmm.models.geometry.projection import in_front, project, ray_axes, viewing_rays
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.lifting.coco import FEWEST, NEAREST_M, boxes_about
from humanmm.models.perception.silhouettes import silhouettes
from humanmm.models.perception.tracking.overlooked import crowded_out, followed
from humanmm.models.perception.tracking.track_builder import largest_first, shortest_track_s
from humanmm.models.records.landmarks import HIPS, LIMBS, NUM_LANDMARKS
from humanmm.models.records.tracks import MASK_SIDE, UNKNOWN_RAD, PersonTrack, PoseEstimates, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frame_times import shown_s

Array = np.ndarray

GIVEN_RAD = 0.03
"""Expected error of a given joint rotation: less than any network's, so that the fit keeps to it."""
SQUEEZED = 0.02
"""By how much a system may take people for narrower or wider than they are before a warning says so."""


@dataclass(frozen=True, eq=False)
class GivenBody:
    """One person in n frames of a video, as another system has him; camera axes x right, y down, z forward, metres."""

    frame: Int[Array, " n"]
    """Rising strictly."""
    landmarks_cam: Float[Array, "n 33 3"]
    known: Bool[Array, " 33"]
    """The landmarks that the system gives; the others are anything finite."""
    K: Float[Array, "n 3 3"]
    """The system's own camera, pixels of the video."""
    R_local: Float[Array, "n 24 3 3"] | None = None
    """The root's rotation to camera axes, the joints' to their parents; None where only joints' places are known."""


def smpl_body(
    frame: Int[Array, " n"],
    R_cam_root: Float[Array, "n 3 3"],
    body_pose: Float[Array, "n j 3"],
    pelvis_cam: Float[Array, "n 3"],
    K: Float[Array, "n 3 3"],
    *,
    betas: Float[Array, " 10"] | None = None,
    height_m: float | None = None,
) -> GivenBody:
    """SMPL's rotations (axis-angle, the first j of its 23 joints) on body24; `betas` are body24's, if known, else
    `height_m` that of the system's own body as it stands in its rest pose."""
    body, model = load_body(), load_landmarks()
    shape = np.zeros(body.num_betas) if betas is None else betas
    if betas is None and height_m is not None:
        shape = resized(shape, body, height_m / body.standing_height(shape))
    pose = np.zeros((len(frame), NUM_JOINTS - 1, 3))
    given = body_pose[:, : NUM_JOINTS - 1]
    pose[:, : given.shape[1]] = given
    R_local = local_rotations(R_cam_root, pose)
    joints, R = compose(body.rest_joints(shape), R_local, pelvis_cam)
    return GivenBody(frame, model.place(shape, joints, R), np.ones(NUM_LANDMARKS, bool), K, R_local)


def people_of_bodies(
    bodies: Sequence[GivenBody], facts: VideoFacts, span: tuple[int, int], *, max_people: int
) -> ScenePeople:
    """The tracks of one scene's frames [start, end), largest first; of more than `max_people` at a time the largest.

    Masks are drawn about the bones; colours are unknown.
    """
    shortest_s = shortest_track_s(facts.time_s, span)
    found = [_track(body, slice(*np.searchsorted(body.frame, span)), (facts.width, facts.height)) for body in bodies]
    tracks = largest_first(one for one in found if float(shown_s(facts.time_s, one.frame).sum()) >= shortest_s)
    kept = followed([one.frame for one in tracks], np.arange(len(tracks), 0, -1).tolist(), max_people)
    others = tuple(crowded_out(one.frame, one.bbox, 1.0) for k, one in enumerate(tracks) if k not in kept)
    return ScenePeople(*span, tuple(tracks[k] for k in kept), _squeezed(bodies), others)


def _squeezed(bodies: Sequence[GivenBody]) -> tuple[str, ...]:
    """A warning if the system saw pixels that are not square, which it takes for square: fx and fy tell, brought into
    square pixels."""
    ratio = np.concatenate([body.K[:, 0, 0] / body.K[:, 1, 1] for body in bodies])
    worst = max(ratio.tolist(), key=lambda one: abs(np.log(one)), default=1.0)
    if abs(np.log(worst)) < SQUEEZED:
        return ()
    seen = f"{worst:.2f} times narrower" if worst > 1 else f"{1 / worst:.2f} times wider"
    return (
        f"the given bodies were found in pixels that are not square, in which people look {seen}: their limbs are as "
        "wrong; give that system, and this program, the video in square pixels",
    )


def _track(body: GivenBody, rows: slice, size: tuple[int, int]) -> PersonTrack:
    """A person in some rows, without the frames in which hardly a landmark of his is in the picture."""
    pixels = project(body.landmarks_cam[rows], body.K[rows], near_m=NEAREST_M)
    inside = ((pixels >= 0) & (pixels <= np.array(size))).all(axis=-1)
    seen = inside & in_front(body.landmarks_cam[rows], NEAREST_M) & body.known
    chosen = np.arange(rows.start, rows.stop)[seen.sum(axis=1) >= FEWEST]
    pixels, seen = pixels[chosen - rows.start], seen[chosen - rows.start]
    points = np.concatenate([pixels, seen[..., None]], axis=-1)
    masks, affine = silhouettes(points)
    centre = affine.astype(np.float64) @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
    R_cam_ray = ray_axes(viewing_rays(centre[:, None], body.K[chosen])[:, 0])
    landmarks_cam = body.landmarks_cam[chosen]
    about_hips = landmarks_cam - landmarks_cam[:, list(HIPS)].mean(axis=1, keepdims=True)
    return PersonTrack(
        frame=body.frame[chosen].astype(np.int32),
        keypoints2d=points.astype(np.float32),
        landmarks3d=(about_hips @ R_cam_ray).astype(np.float32),
        bbox=boxes_about(pixels, seen, size).astype(np.float32),
        confidence=seen[:, list(LIMBS)].mean(axis=1, dtype=np.float32),
        masks=masks,
        mask_affine=affine,
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, HISTOGRAM_BINS), np.float32),
        lifted=True,
        pose=_pose(None if body.R_local is None else body.R_local[chosen], R_cam_ray),
    )


def _pose(R_local: Float[Array, "n 24 3 3"] | None, R_cam_ray: Float[Array, "n 3 3"]) -> PoseEstimates:
    """The rotations, as sure as given ones are; none that says anything where only places are known."""
    count = len(R_cam_ray)
    vectors = np.zeros((count, len(ROTATED_JOINTS), 3))
    if R_local is not None:
        vectors[:, 0] = rotmat_to_rotvec(np.swapaxes(R_cam_ray, -1, -2) @ R_local[:, 0])
        vectors[:, 1:] = rotmat_to_rotvec(R_local[:, list(FREE_JOINTS)])
    sigma = np.full(vectors.shape[:2], UNKNOWN_RAD if R_local is None else GIVEN_RAD, np.float32)
    return PoseEstimates(vectors.astype(np.float32), sigma, np.zeros(count, np.float32))
