"""θ, β, Γ, τ of one person in one shot (paper section 3.3): body24 fitted to 2D keypoints and 3D landmarks at once.

The whole shot is one problem: reprojection of the visible keypoints, the network's 3D landmarks (turned by the viewing
ray, for they are orthographic about the crop's centre), how people hold and move their joints, and one shape for the
whole video. Bone lengths give the metric depth. It starts from closed-form inverse kinematics (`fit_start`) and is
solved in the shot's own axes, so that a turning camera does not count as motion of the person.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import chunks
from humanmm.models.body.landmarks import MIRROR, NUM_LANDMARKS, load_landmarks
from humanmm.models.camera.observations import ShotCamera
from humanmm.models.motion.fit_equations import Term, frame_weights
from humanmm.models.motion.fit_solver import SolverSettings, solve_windows
from humanmm.models.motion.fit_start import bridged, start_pose, start_position
from humanmm.models.motion.fit_state import NUM_PARAMETERS, PELVIS, CameraPath, LongMotion, Motion, Skeleton
from humanmm.models.motion.fit_terms import (
    Anchor,
    Bones,
    PosePrior,
    Reprojection,
    Smoothness,
)
from humanmm.models.motion.pose_prior import load_pose_statistics
from humanmm.models.motion.results import PersonShotMotion, ShotMotion
from humanmm.models.perception.tracks import MASK_SIDE, PersonTrack, ScenePeople
from humanmm.models.rotations import swing
from humanmm.models.shots.boundaries import Person, Shot

Array = np.ndarray

_KEYPOINT_SIGMA_M = np.array(
    [0.02] * 11  # face
    + [0.027, 0.027, 0.028, 0.028, 0.02, 0.02]  # shoulders, elbows, wrists
    + [0.025] * 6  # knuckles
    + [0.024, 0.024, 0.029, 0.029, 0.022, 0.022, 0.029, 0.029, 0.036, 0.036]  # hips, knees, ankles, heels, toes
)
"""Expected error of fully visible keypoints, metres at the person's depth, per axis (measured: `body.landmarks`)."""

_MIRROR = np.array(MIRROR)

_HIDDEN = 2.2
"""How much larger that error is for keypoints of visibility 0.5 or less (measured in the same way)."""


@dataclass(frozen=True)
class _Bone:
    start: int
    end: int
    across_m: float
    """Expected error of the network's 3D vector across the viewing ray, after scaling to the body's bone length."""
    along_m: float
    """The same along the ray."""


_BONES = (
    _Bone(12, 11, 0.05, 0.06), _Bone(24, 23, 0.05, 0.04), _Bone(23, 11, 0.06, 0.05), _Bone(24, 12, 0.06, 0.05),
    _Bone(11, 13, 0.045, 0.09), _Bone(12, 14, 0.045, 0.09), _Bone(13, 15, 0.045, 0.09), _Bone(14, 16, 0.045, 0.09),
    _Bone(15, 17, 0.03, 0.06), _Bone(16, 18, 0.03, 0.06), _Bone(15, 19, 0.03, 0.06), _Bone(16, 20, 0.03, 0.06),
    _Bone(23, 25, 0.06, 0.09), _Bone(24, 26, 0.06, 0.09), _Bone(25, 27, 0.06, 0.09), _Bone(26, 28, 0.06, 0.09),
    _Bone(29, 31, 0.09, 0.14), _Bone(30, 32, 0.09, 0.14), _Bone(8, 7, 0.03, 0.04), _Bone(7, 0, 0.03, 0.04),
    _Bone(8, 0, 0.03, 0.04),
)  # fmt: skip
"""Vectors taken from the network's 3D landmarks. Errors of neighbouring bones are nearly independent, those of joints
are not: an arm's error is carried on to its hand."""


LIFTED_TRUST, LIFTED_PRIOR = 2.0, 0.3
"""Where 3D landmarks were lifted from 2D keypoints (weights/lifter.md), weight of their bones against the network's,
and of the pose prior: what the lifter knows of poses is nearly what the prior knows, and counts once. On four videos
of subjects that neither has seen (cmu_val) trust of 0.5, 1 and 2 gives 57, 55 and 53 mm after a similarity; the
prior's weight, from 1 to 0.1, changes it by less than 1 mm there."""


@dataclass(frozen=True)
class NoiseModel:
    """Expected errors of the evidence; everything in the fit is measured in these units."""

    turn_rad: tuple[float, float, float] = (0.14, 0.17, 0.05)
    """Tilt of all 3D landmarks together, about the view's x, y and z axes (measured: 8, 10 and 3 degrees)."""
    bones: float = 1.0
    """Trust in the network's 3D landmarks, against what was measured."""
    prior: float = 1.0
    """Weight of the pose prior against one frame's evidence."""
    prior_unseen: float = 0.01
    """The same in frames without any evidence, where the neighbours should decide."""
    leash_m: float = 0.3
    """How far the pelvis of an unseen frame may leave the straight line across the hole, metres."""
    leash_rad: float = 0.5
    """The same for rotations."""
    wall_rad: float = 0.1
    """Softness of the ends of joint ranges."""
    smoothness: float = 1.0
    """Expected accelerations, in units of the motion-capture statistic."""


def fit_shot(
    scene: ScenePeople,
    shot: Shot,
    people: tuple[Person, ...],
    time_s: Float[Array, " F"],
    camera: ShotCamera,
    *,
    noise: NoiseModel | None = None,
) -> ShotMotion:
    """Everybody in one shot, where no transition mixes it with another; people who are not seen there are left out."""
    betas = {person.person: person.betas for person in people}
    motions = []
    for appearance in shot.people:
        track = scene.tracks[appearance.track]
        first, last = shot.clear
        K = camera.K[first - camera.start : last - camera.start]
        evidence = gather(track, shot.clear, appearance.swapped, time_s, K)
        if evidence is not None:
            path = camera_path(camera, evidence.frame)
            motions.append(fit_person(appearance.person, evidence, betas[appearance.person], path, noise=noise))
    return ShotMotion(shot.start, shot.end, tuple(motions))


@dataclass(frozen=True)
class Evidence:
    """One person's observations on every frame of a run, dense: weight zero where nothing was seen. N frames.

    Keypoints, visibility and landmarks in single precision, as the network gives them.
    """

    frame: Array
    time_s: Float[Array, " N"]
    seen: Array
    keypoints: Float[Array, "N 33 2"]
    visibility: Float[Array, "N 33"]
    landmarks_cam: Float[Array, "N 33 3"]
    """Metres, camera axes (turned by the viewing ray), as large as the network says."""
    ray: Float[Array, "N 3"]
    """Unit viewing ray of the crop's centre."""
    lifted: Bool[Array, " N"]
    """Where the landmarks were made from the keypoints."""

    @classmethod
    def empty(cls, frame: Array, time_s: Float[Array, " N"]) -> "Evidence":
        """Nothing seen yet in frames that follow one another."""
        n = len(frame)
        return cls(
            frame=frame.astype(np.int32),
            time_s=time_s,
            seen=np.zeros(n, bool),
            keypoints=np.zeros((n, NUM_LANDMARKS, 2), np.float32),
            visibility=np.zeros((n, NUM_LANDMARKS), np.float32),
            landmarks_cam=np.zeros((n, NUM_LANDMARKS, 3), np.float32),
            ray=np.tile([0.0, 0.0, 1.0], (n, 1)),
            lifted=np.zeros(n, bool),
        )

    def frames(self, chosen: slice) -> "Evidence":
        """A run of frames, without a copy."""
        return Evidence(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def add(
        self,
        track: PersonTrack,
        span: tuple[int, int],
        swapped: tuple[tuple[int, int], ...],
        K: Float[Array, "n 3 3"],
    ) -> slice | None:
        """Enter a track's observations in `span`, with left and right put right; K holds the cameras of the span.

        Returns the frames from the first observation to the last, None if there are none.
        """
        first, last = max(span[0], int(self.frame[0])), min(span[1], int(self.frame[-1]) + 1)
        inside = np.flatnonzero((track.frame >= first) & (track.frame < last))
        if not len(inside):
            return None
        for portion in chunks(len(inside)):
            observed = inside[portion]
            index = track.frame[observed]
            keypoints, landmarks = track.keypoints2d[observed], track.landmarks3d[observed]
            exchange = np.zeros(len(index), bool)
            for start, end in swapped:
                exchange |= (index >= start) & (index < end)
            keypoints[exchange] = keypoints[exchange][:, _MIRROR]
            landmarks[exchange] = landmarks[exchange][:, _MIRROR]

            centre = track.mask_affine[observed] @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
            homogeneous = np.concatenate([centre, np.ones((len(centre), 1))], axis=1)
            ray = np.linalg.solve(K[index - span[0]], homogeneous[..., None])[..., 0]
            ray /= np.linalg.norm(ray, axis=1, keepdims=True)
            R_cam_ray = swing(np.broadcast_to([0.0, 0.0, 1.0], ray.shape), ray)

            rows = index - self.frame[0]
            self.seen[rows] = True
            self.keypoints[rows] = keypoints[..., :2]
            self.visibility[rows] = np.clip(keypoints[..., 2], 0, 1)
            self.landmarks_cam[rows] = landmarks @ np.swapaxes(R_cam_ray, -1, -2).astype(np.float32)
            self.ray[rows] = ray
            self.lifted[rows] = track.lifted
        return slice(*(track.frame[inside[[0, -1]]] - self.frame[0] + [0, 1]).tolist())


def gather(
    track: PersonTrack,
    span: tuple[int, int],
    swapped: tuple[tuple[int, int], ...],
    time_s: Float[Array, " F"],
    K: Float[Array, "n 3 3"],
) -> Evidence | None:
    """A track's observations in `span` from first to last, with left and right put right; None if there are none.

    `time_s` holds all frames of the video, K those of the span.
    """
    inside = track.frame[(track.frame >= span[0]) & (track.frame < span[1])]
    if not len(inside):
        return None
    frame = np.arange(inside[0], inside[-1] + 1)
    evidence = Evidence.empty(frame, time_s[frame])
    evidence.add(track, span, swapped, K)
    return evidence


def camera_path(camera: ShotCamera, frame: Array) -> CameraPath:
    """The shot's camera seen from its own axes; only its rotation where the translation has no scale."""
    rows = frame - camera.start
    R_cam_shot = np.swapaxes(camera.R_shot_cam[rows], -1, -2)
    t_shot_cam = camera.t_shot_cam[rows] if camera.metric else np.zeros((len(rows), 3))
    t_cam_shot = -(R_cam_shot @ t_shot_cam[..., None])[..., 0]
    return CameraPath(R_cam_shot, t_cam_shot, camera.K[rows])


def fit_person(
    person: int,
    evidence: Evidence,
    betas: Float[Array, " 10"],
    camera: CameraPath,
    *,
    noise: NoiseModel | None = None,
    settings: SolverSettings | None = None,
) -> PersonShotMotion:
    """θ, Γ and τ of every frame, in the axes of its camera."""
    noise = noise or NoiseModel()
    body, model = load_body(), load_landmarks()
    skeleton = Skeleton(body.rest_joints(betas), model.joint, model.offsets(betas))
    motion = _start(skeleton, evidence, camera)
    depths = pelvis_depths(motion, camera)
    terms = EvidenceTerms(evidence, bone_vectors(skeleton, evidence), camera, depths, noise, bridge=motion)
    motion = solve_windows(motion, terms, settings)
    return _result(person, evidence, betas, camera, motion, terms)


def bone_vectors(skeleton: Skeleton, evidence: Evidence) -> Float[Array, "N B 3"]:
    """The network's bones in camera axes, each brought to the body's own length (by its median over the shot)."""
    start, end = np.array([(bone.start, bone.end) for bone in _BONES]).T
    rest = skeleton.rest_joints[skeleton.point_joint] + skeleton.point_offset
    ours = np.linalg.norm(rest[end] - rest[start], axis=-1)
    vectors = np.empty((len(evidence.frame), len(_BONES), 3), np.float32)
    lengths = np.empty(vectors.shape[:2], np.float32)
    for frames in chunks(len(vectors)):
        landmarks = evidence.landmarks_cam[frames]
        vectors[frames] = landmarks[:, end] - landmarks[:, start]
        lengths[frames] = np.linalg.norm(vectors[frames], axis=-1)
    theirs = np.median(lengths[evidence.seen], axis=0)
    vectors *= (ours / np.maximum(theirs, 1e-3))[:, None].astype(np.float32)
    return vectors


def _start(skeleton: Skeleton, evidence: Evidence, camera: CameraPath) -> LongMotion:
    """Inverse kinematics of the seen frames, placed on their rays; the others between them."""
    n = len(evidence.frame)
    start, depth = LongMotion.empty(skeleton, n), np.empty(n)
    for frames in chunks(n):
        R_cam_ref, visibility = camera.R_cam_ref[frames], evidence.visibility[frames]
        R_local = start_pose(skeleton, evidence.landmarks_cam[frames] @ R_cam_ref)
        posed = Motion.of(skeleton, R_local, np.zeros((len(R_local), 3))).points @ np.swapaxes(R_cam_ref, -1, -2)
        homogeneous = np.concatenate([evidence.keypoints[frames], np.ones((*visibility.shape, 1))], axis=-1)
        rays = (homogeneous @ np.swapaxes(np.linalg.inv(camera.K[frames]), -1, -2))[..., :2]
        pelvis_cam = start_position(posed, rays, visibility**2 + 1e-3)
        from_camera = pelvis_cam - camera.t_cam_ref[frames]
        pelvis_ref = (np.swapaxes(R_cam_ref, -1, -2) @ from_camera[..., None])[..., 0]
        start.put(frames, Motion.of(skeleton, R_local, pelvis_ref))
        depth[frames] = pelvis_cam[:, 2]
    known = evidence.seen & (depth > 0.3)
    if not known.any():
        known = evidence.seen
    return bridged(start, known, evidence.time_s)


def pelvis_depths(motion: LongMotion, camera: CameraPath) -> Float[Array, " N"]:
    """Depth of the pelvis in each camera, metres."""
    return np.asarray(np.maximum(camera.to_camera(motion.pelvis_ref[:, None])[:, 0, 2], 0.3))


@dataclass(frozen=True, eq=False)
class EvidenceTerms:
    """Builds the terms of a window of frames."""

    evidence: Evidence
    bones: Float[Array, "N B 3"]
    camera: CameraPath
    depth: Float[Array, " N"]
    noise: NoiseModel
    bridge: LongMotion | None = None
    """What unseen frames stay near, if anything."""

    def reprojection(self, frames: slice) -> Reprojection:
        e, camera = self.evidence, self.camera.frames(frames)
        px_per_m = camera.K[:, 0, 0] / self.depth[frames]
        weight = _trust(e.visibility[frames]) * frame_weights(e.time_s)[frames][:, None]
        return Reprojection(camera, e.keypoints[frames], px_per_m[:, None] * _KEYPOINT_SIGMA_M, weight)

    def lifted(self, frames: slice) -> Bones:
        e, camera = self.evidence, self.camera.frames(frames)
        start, end = np.array([(bone.start, bone.end) for bone in _BONES]).T
        R_cam_view = swing(np.broadcast_to([0.0, 0.0, 1.0], e.ray[frames].shape), e.ray[frames])
        trust, time = _trust(e.visibility[frames]), frame_weights(e.time_s)[frames]
        time_and_trust = time * np.where(e.lifted[frames], LIFTED_TRUST, 1.0)
        weight = np.minimum(trust[:, start], trust[:, end]) * time_and_trust[:, None]
        return Bones(
            start=start,
            end=end,
            vectors=self.bones[frames] @ camera.R_cam_ref,
            R_ref_view=np.swapaxes(camera.R_cam_ref, -1, -2) @ R_cam_view,
            sigma=np.array([(bone.across_m, bone.across_m, bone.along_m) for bone in _BONES]) / self.noise.bones,
            turn=np.array(self.noise.turn_rad),
            weight=weight,
            time_weight=time,
        )

    def __call__(self, frames: slice) -> list[Term]:
        e, noise, statistics = self.evidence, self.noise, load_pose_statistics()
        time = frame_weights(e.time_s)[frames]
        share = np.where(e.lifted[frames], LIFTED_PRIOR, 1.0)
        prior = PosePrior(
            means=statistics.means,
            precisions=statistics.precisions,
            log_peaks=statistics.log_peaks,
            lower=statistics.lower,
            upper=statistics.upper,
            wall=1 / noise.wall_rad**2,
            weight=time * np.where(e.seen[frames], share * noise.prior, noise.prior_unseen),
        )
        smooth = Smoothness(e.time_s[frames], statistics.acceleration * noise.smoothness)
        terms: list[Term] = [self.reprojection(frames), self.lifted(frames), prior, smooth]
        if self.bridge is not None and not e.seen[frames].all():
            leash = np.full(NUM_PARAMETERS, noise.leash_rad)
            leash[PELVIS] = noise.leash_m
            terms.append(Anchor(self.bridge.frames(frames), leash, np.where(e.seen[frames], 0.0, time)))
        return terms


def _trust(visibility: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Weight of a keypoint: its variance grows as visibility falls to one half; below 0.2 it fades out."""
    spread = 1 + (_HIDDEN - 1) * np.minimum(2 * (1 - visibility), 1)
    return np.asarray(np.minimum(visibility / 0.2, 1) / spread**2)


def _result(
    person: int, evidence: Evidence, betas: Array, camera: CameraPath, motion: LongMotion, terms: EvidenceTerms
) -> PersonShotMotion:
    n = len(evidence.frame)
    residual, confidence = np.full(n, np.nan, np.float32), np.empty(n, np.float32)
    R_cam_root = np.empty((n, 3, 3))
    for frames in chunks(n):
        reprojection, visibility = terms.reprojection(frames), evidence.visibility[frames]
        posed = motion.frames(frames)
        R_cam_root[frames] = camera.R_cam_ref[frames] @ posed.R_ref_root
        all_distances = reprojection.distances_px(posed)
        # Confidence: how much of what was visible the fit explains (a keypoint three sigmas off counts half).
        explained = 1 / (1 + (np.nan_to_num(all_distances, nan=np.inf) / (3 * reprojection.sigma_px)) ** 2)
        confidence[frames] = (visibility * explained).mean(axis=1)
        distances = np.where(visibility > 0.5, all_distances, np.nan)
        enough = np.isfinite(distances).any(axis=1)
        residual[frames][enough] = np.nanmedian(distances[enough], axis=1)
    return PersonShotMotion(
        person=person,
        frame=evidence.frame,
        observed=evidence.seen,
        R_cam_root=R_cam_root,
        body_pose=motion.vectors[:, 1:].copy(),
        betas=np.asarray(betas, np.float64),
        pelvis_cam=camera.to_camera(motion.pelvis_ref[:, None])[:, 0],
        residual_px=residual,
        confidence=confidence,
    )
