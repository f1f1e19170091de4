"""θ, β, Γ, τ of one person in one shot (paper section 3.3): body24 fitted to 2D keypoints and 3D landmarks at once.

The whole shot is one problem: reprojection of the visible keypoints, the network's 3D landmarks (rotated by the viewing
ray, for they are orthographic about the crop's centre), how people hold and move their joints, and one shape for the
whole video. Bone lengths give the metric depth. It starts from closed-form inverse kinematics (`initial.start_pose`)
and is solved in the shot's own axes, so that a rotating camera does not count as motion of the person.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from humanmm.machine import single_threaded
from humanmm.models.body.kinematics import chunks
from humanmm.models.body.pose_statistics import load_pose_statistics
from humanmm.models.geometry.projection import inverse_pose, ray_axes, start_position, viewing_rays, world_to_camera
from humanmm.models.motion.fit.equations import Term, frame_weights
from humanmm.models.motion.fit.evidence import (
    BONE_END,
    BONE_START,
    BONES,
    Evidence,
    LongEvidence,
    bone_lengths,
    gather,
    person_skeleton,
)
from humanmm.models.motion.fit.initial import InitialPose, interpolated, start_pose
from humanmm.models.motion.fit.orientation_doubt import misoriented
from humanmm.models.motion.fit.pose_error import expected_error_m
from humanmm.models.motion.fit.solver import SolverSettings, solve_windows
from humanmm.models.motion.fit.state import NUM_PARAMETERS, PELVIS, CameraPath, LongMotion, Motion, Skeleton
from humanmm.models.motion.fit.terms import (
    Anchor,
    Bones,
    EstimatedRotations,
    PosePrior,
    Reprojection,
    Smoothness,
)
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.motion import PersonShotMotion, ShotMotion
from humanmm.models.records.shots import Person, Shot
from humanmm.models.records.tracks import UNKNOWN_RAD, ScenePeople
from humanmm.models.video.progress import Progress, parts_of, silent

Array = np.ndarray

_KEYPOINT_SIGMA_M = np.array(
    [0.02] * 11  # face
    + [0.027, 0.027, 0.028, 0.028, 0.02, 0.02]  # shoulders, elbows, wrists
    + [0.025] * 6  # knuckles
    + [0.024, 0.024, 0.029, 0.029, 0.022, 0.022, 0.029, 0.029, 0.036, 0.036]  # hips, knees, ankles, heels, toes
)
"""Expected error of fully visible keypoints, metres at the person's depth, per axis (measured: `body.landmarks`)."""

_HIDDEN = 2.2
"""How much larger that error is for keypoints of visibility 0.5 or less (measured in the same way)."""
_BODY_SIGMA_M = 0.008
"""How far a body's own keypoints lie from where a network sees them at best. With 4, 12 and 20 mm poses of eleven
development clips are within 2 %, those of clip A 46.6, 47.7 and 49.0 mm off (PA-MPJPE; with 8 47.0)."""


LIFTED_TRUST, LIFTED_PRIOR = 2.0, 0.3
"""Where landmarks are a lifter's, weight of their bones against a pose network's own, and of the pose prior: what a
lifter knows of poses is nearly what the prior knows, and counts once.

With the lifter of keypoints alone, on four videos of subjects that neither has seen (cmu_val), trust of 0.5, 1 and 2
gives 57, 55 and 53 mm after a similarity; the prior's weight, from 1 to 0.1, changes it by less than 1 mm there.

With the lifter of whole tracks (its correction made in full) trust of 2 and 4 gives 56.7 and 56.6 mm on eleven rendered
development clips, 59 and 62 on the real clip A; a prior's weight of 0.15 gives 56.8 and 58.5."""


@dataclass(frozen=True)
class NoiseModel:
    """Expected errors of the evidence; everything in the fit is measured in these units."""

    rotation_rad: tuple[float, float, float] = (0.14, 0.17, 0.05)
    """Tilt of all 3D landmarks together, about the view's x, y and z axes (measured: 8, 10 and 3 degrees)."""
    bones: float = 1.0
    """Trust in the network's 3D landmarks, against what was measured."""
    prior: float = 1.0
    """Weight of the pose prior against one frame's evidence."""
    prior_lifted: float = LIFTED_PRIOR
    """Its part where landmarks are a lifter's."""
    prior_unseen: float = 0.01
    """The same in frames without any evidence, where the neighbours should decide."""
    anchor_m: float = 0.3
    """Anchor prior: how far the pelvis of an unseen frame lies from the straight line across the hole, standard
    deviation, metres."""
    anchor_rad: float = 0.5
    """The same for rotations."""
    joint_limit_rad: float = 0.1
    """Softness of the ends of joint ranges."""
    rotations: float = 0.1
    """Weight of the lifter's rotations: their errors last for a second, and count once, not in each frame."""
    smoothness: float = 1.0
    """Expected accelerations, in units of the motion-capture statistic."""


@single_threaded
def fit_shot(
    scene: ScenePeople,
    shot: Shot,
    people: tuple[Person, ...],
    time_s: Float[Array, " F"],
    camera: ShotCamera,
    *,
    noise: NoiseModel | None = None,
    initial_pose: InitialPose = start_pose,
    progress: Progress = silent,
) -> ShotMotion:
    """Everybody in one shot, where no transition mixes it with another; people who are not seen there are left out.

    `people` holds everybody's shape, `time_s` the times of all frames of the video, seconds. The motion is in the axes
    of each frame's camera, metres.
    """
    betas = {person.person: person.betas for person in people}
    motions = []
    parts = parts_of(progress, shot.end - shot.start, [1.0] * len(shot.people))
    for appearance, part in zip(shot.people, parts, strict=True):
        first, last = span = shot.clear
        K = camera.K[first - camera.start : last - camera.start]
        track = scene.track_of(appearance)
        evidence = gather(track, span, time_s, K, tracking_failures=appearance.tracking_failures)
        if evidence is not None:
            path = camera_path(camera, evidence.frame)
            person, shape = appearance.person, betas[appearance.person]
            fitted = fit_person(person, evidence, shape, path, noise=noise, initial_pose=initial_pose, progress=part)
            if track.lifted:  # what foretells errors was measured of people in pictures, not of other programs' results
                fitted = replace(fitted, pose_error_m=np.full_like(fitted.pose_error_m, np.nan))
            motions.append(fitted)
    return ShotMotion(shot.start, shot.end, tuple(motions))


def camera_path(camera: ShotCamera, frame: Array) -> CameraPath:
    """The shot's camera seen from its own axes; only its rotation where the translation has no scale."""
    rows = frame - camera.start
    t_shot_cam = camera.t_shot_cam[rows] if camera.metric else np.zeros((len(rows), 3))
    return CameraPath(*inverse_pose(camera.R_shot_cam[rows], t_shot_cam), camera.K[rows])


def fit_person(
    person: int,
    evidence: LongEvidence,
    betas: Float[Array, " 10"],
    camera: CameraPath,
    *,
    noise: NoiseModel | None = None,
    initial_pose: InitialPose = start_pose,
    progress: Progress = silent,
) -> PersonShotMotion:
    """θ, Γ and τ of every frame, in the axes of its camera."""
    motion = _start(betas, evidence, camera, initial_pose)
    terms = EvidenceTerms(evidence, betas, camera, pelvis_depths(motion, camera), noise or NoiseModel(), anchor=motion)
    motion = solve_windows(motion, terms, SolverSettings().lasting(evidence.time_s), progress=progress)
    return _result(person, evidence, betas, camera, motion, terms)


def _start(
    betas: Float[Array, " 10"], evidence: LongEvidence, camera: CameraPath, initial_pose: InitialPose
) -> LongMotion:
    """The initial pose of the seen frames, placed on their rays; the others between them."""
    n = len(evidence.frame)
    skeleton, of_keypoints = person_skeleton(betas), evidence.keypoint_skeleton(betas)
    start, depth = LongMotion.empty(skeleton, n), np.empty(n)
    for frames in chunks(n):
        R_cam_ref, e = camera.R_cam_ref[frames], evidence.frames(frames)
        R_local = initial_pose(skeleton, e.landmarks_cam @ R_cam_ref)
        posed = Motion.of(of_keypoints, R_local, np.zeros((len(R_local), 3))).points @ np.swapaxes(R_cam_ref, -1, -2)
        rays = viewing_rays(e.keypoints.astype(np.float64), camera.K[frames])[..., :2]
        pelvis_cam = start_position(posed, rays, e.visibility**2 + 1e-3)
        pelvis_ref = world_to_camera(pelvis_cam[:, None], R_cam_ref, camera.t_cam_ref[frames])[:, 0]
        start.put(frames, Motion.of(skeleton, R_local, pelvis_ref))
        depth[frames] = pelvis_cam[:, 2]
    known = evidence.seen & (depth > 0.3)
    if not known.any():
        known = evidence.seen
    return interpolated(start, known, evidence.time_s)


def pelvis_depths(motion: LongMotion, camera: CameraPath) -> Float[Array, " N"]:
    """Depth of the pelvis in each camera, metres."""
    return np.asarray(np.maximum(camera.to_camera(motion.pelvis_ref[:, None])[:, 0, 2], 0.3))


@dataclass(frozen=True, eq=False)
class EvidenceTerms:
    """Builds the terms of a window of frames."""

    evidence: LongEvidence
    betas: Float[Array, " 10"]
    camera: CameraPath
    depth: Float[Array, " N"]
    noise: NoiseModel
    anchor: LongMotion | None = None
    """What unseen frames stay near, if anything."""

    @cached_property
    def bone_lengths(self) -> Float[Array, " B"]:
        """The body's own, to which the network's bones are brought."""
        return bone_lengths(person_skeleton(self.betas))

    @cached_property
    def keypoint_skeleton(self) -> Skeleton:
        return self.evidence.keypoint_skeleton(self.betas)

    def reprojection(self, e: Evidence, frames: slice) -> Reprojection:
        camera = self.camera.frames(frames)
        px_per_m = camera.K[:, 0, 0] / self.depth[frames]
        is_known = np.isfinite(e.keypoint_sigma_px)
        trust = np.where(is_known, e.trust[:, None], _trust(e.visibility))
        weight = trust * frame_weights(self.evidence.time_s)[frames][:, None]
        at_best = px_per_m[:, None] * np.where(is_known, _BODY_SIGMA_M, _KEYPOINT_SIGMA_M)
        sigma_px = np.hypot(at_best, np.nan_to_num(e.keypoint_sigma_px))
        return Reprojection(self.keypoint_skeleton, camera, e.keypoints, sigma_px, weight)

    def lifted(self, e: Evidence, frames: slice) -> Bones:
        camera = self.camera.frames(frames)
        R_cam_view = ray_axes(e.ray)
        trust, time = _trust(e.visibility), frame_weights(self.evidence.time_s)[frames]
        of_ends = np.minimum(trust[:, BONE_START], trust[:, BONE_END])
        weight = time[:, None] * np.where(e.lifted[:, None], LIFTED_TRUST * e.trust[:, None], of_ends)
        return Bones(
            start=BONE_START,
            end=BONE_END,
            vectors=e.bones * self.bone_lengths[:, None] @ camera.R_cam_ref,
            R_ref_view=np.swapaxes(camera.R_cam_ref, -1, -2) @ R_cam_view,
            sigma=np.array([(bone.across_m, bone.across_m, bone.along_m) for bone in BONES]) / self.noise.bones,
            tilt_std=np.array(self.noise.rotation_rad),
            weight=weight,
            time_weight=time,
        )

    def __call__(self, frames: slice) -> list[Term]:
        e, noise, statistics = self.evidence.frames(frames), self.noise, load_pose_statistics()
        time_s = self.evidence.time_s
        time = frame_weights(time_s)[frames]
        fraction = np.where(e.lifted, noise.prior_lifted, 1.0)
        prior = PosePrior(
            means=statistics.means,
            precisions=statistics.precisions,
            log_peaks=statistics.log_peaks,
            lower=statistics.lower,
            upper=statistics.upper,
            joint_limit=1 / noise.joint_limit_rad**2,
            weight=time * np.where(e.seen, fraction * noise.prior, noise.prior_unseen),
        )
        smooth = Smoothness(time_s[frames], statistics.acceleration * noise.smoothness)
        terms: list[Term] = [self.reprojection(e, frames), self.lifted(e, frames), prior, smooth]
        if (e.rotation_sigma < UNKNOWN_RAD).any():
            R_ref = e.rotations_cam.astype(np.float64)
            R_ref[:, 0] = np.swapaxes(self.camera.R_cam_ref[frames], -1, -2) @ R_ref[:, 0]
            terms.append(EstimatedRotations(R_ref, e.rotation_sigma, noise.rotations * np.where(e.seen, time, 0.0)))
        if self.anchor is not None and not e.seen.all():
            anchor_std = np.full(NUM_PARAMETERS, noise.anchor_rad)
            anchor_std[PELVIS] = noise.anchor_m
            terms.append(Anchor(self.anchor.frames(frames), anchor_std, np.where(e.seen, 0.0, time)))
        return terms


def _trust(visibility: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Weight of a keypoint: its variance grows as visibility falls to one half; below 0.2 it fades out."""
    spread = 1 + (_HIDDEN - 1) * np.minimum(2 * (1 - visibility), 1)
    return np.asarray(np.minimum(visibility / 0.2, 1) / spread**2)


def _result(
    person: int, evidence: LongEvidence, betas: Array, camera: CameraPath, motion: LongMotion, terms: EvidenceTerms
) -> PersonShotMotion:
    n = len(evidence.frame)
    residual, confidence = np.full(n, np.nan, np.float32), np.empty(n, np.float32)
    doubt, pose_error = np.empty(n, np.float32), np.full(n, np.nan, np.float32)
    R_cam_root = np.empty((n, 3, 3))
    for frames in chunks(n):
        e = evidence.frames(frames)
        reprojection, visibility = terms.reprojection(e, frames), e.visibility
        posed = motion.frames(frames)
        R_cam_root[frames] = camera.R_cam_ref[frames] @ posed.R_ref_root
        all_distances = reprojection.distances_px(posed)
        # Confidence: how much of what was visible the fit explains (a keypoint three sigmas off counts half).
        explained = 1 / (1 + (np.nan_to_num(all_distances, nan=np.inf) / (3 * reprojection.sigma_px)) ** 2)
        confidence[frames] = (visibility * explained).mean(axis=1)
        distances = np.where(visibility > 0.5, all_distances, np.nan)
        enough = np.isfinite(distances).any(axis=1)
        residual[frames][enough] = np.nanmedian(distances[enough], axis=1)
        doubt[frames] = misoriented(R_cam_root[frames], e.rotations_cam[:, 0], e.rotation_sigma[:, 0])
        lifted = e.seen & (e.rotation_sigma < UNKNOWN_RAD).any(axis=1)
        pose_error[frames][lifted] = expected_error_m(posed.points[lifted], e.landmarks_cam[lifted])
    return PersonShotMotion(
        person=person,
        frame=evidence.frame,
        observed=evidence.seen,
        R_cam_root=R_cam_root,
        body_pose=motion.vectors[:, 1:].copy(),
        betas=np.asarray(betas, np.float64),
        pelvis_cam=camera.to_camera(motion.pelvis_ref[:, None])[:, 0],
        residual_px=residual,
        confidence=confidence * (1 - doubt),
        misoriented=doubt,
        pose_error_m=pose_error,
    )
