"""What was seen of one person: the tracker's observations as evidence for a fit, made for a run of frames at a time.

A long motion's observations stay in their tracks (left and right put right by `ScenePeople.track_of`); nothing of their
size is kept beside them.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import chunks
from humanmm.models.body.landmarks import LandmarkModel, load_keypoints, load_landmarks
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.geometry.projection import ray_axes, viewing_rays
from humanmm.models.geometry.rotations import rotvec_to_rotmat, unit
from humanmm.models.motion.fit.state import NUM_ROTATIONS, Skeleton
from humanmm.models.records.landmarks import NUM_LANDMARKS
from humanmm.models.records.tracks import MASK_SIDE, UNKNOWN_RAD, PersonTrack

Array = np.ndarray

FAILURE_TRUST = 0.1
"""Factor of a keypoint's visibility where tracking failed."""


@dataclass(frozen=True)
class Bone:
    """One bone of the network's skeleton: the landmarks that it joins, and the errors to expect of its 3D vector."""

    start: int
    end: int
    across_m: float
    """Expected error of the network's 3D vector across the viewing ray, after scaling to the body's bone length."""
    along_m: float
    """The same along the ray."""


BONES = (
    Bone(12, 11, 0.05, 0.06), Bone(24, 23, 0.05, 0.04), Bone(23, 11, 0.06, 0.05), Bone(24, 12, 0.06, 0.05),
    Bone(11, 13, 0.045, 0.09), Bone(12, 14, 0.045, 0.09), Bone(13, 15, 0.045, 0.09), Bone(14, 16, 0.045, 0.09),
    Bone(15, 17, 0.03, 0.06), Bone(16, 18, 0.03, 0.06), Bone(15, 19, 0.03, 0.06), Bone(16, 20, 0.03, 0.06),
    Bone(23, 25, 0.06, 0.09), Bone(24, 26, 0.06, 0.09), Bone(25, 27, 0.06, 0.09), Bone(26, 28, 0.06, 0.09),
    Bone(29, 31, 0.09, 0.14), Bone(30, 32, 0.09, 0.14), Bone(8, 7, 0.03, 0.04), Bone(7, 0, 0.03, 0.04),
    Bone(8, 0, 0.03, 0.04),
)  # fmt: skip
"""Vectors taken from the network's 3D landmarks. Errors of neighbouring bones are nearly independent, those of joints
are not: an arm's error is carried on to its hand."""

BONE_START, BONE_END = np.array([(bone.start, bone.end) for bone in BONES]).T


def person_skeleton(betas: Float[Array, " 10"]) -> Skeleton:
    """The person's rest joints with the 33 landmarks on them."""
    return _skeleton(betas, load_landmarks())


def _skeleton(betas: Float[Array, " 10"], model: LandmarkModel) -> Skeleton:
    return Skeleton(load_body().rest_joints(betas), model.joint, model.offsets(betas))


def bone_lengths(skeleton: Skeleton) -> Float[Array, " B"]:
    """Lengths of BONES in a body whose points are the 33 landmarks, metres."""
    rest = skeleton.rest_joints[skeleton.point_joint] + skeleton.point_offset
    return np.asarray(np.linalg.norm(rest[BONE_END] - rest[BONE_START], axis=-1))


@dataclass(frozen=True, eq=False)
class Sighting:
    """One track's observations in a span of frames."""

    track: PersonTrack
    """With left and right put right (`ScenePeople.track_of`)."""
    span: tuple[int, int]
    tracking_failures: tuple[tuple[int, int], ...]
    """Frames [start, end) in which the pose is hardly trusted."""
    K: Float[Array, "n 3 3"]
    """Cameras of the span."""

    @cached_property
    def bone_lengths(self) -> Float[Array, " B"]:
        """Median lengths of BONES in the network's landmarks, metres."""
        rows = np.arange(*self._rows(*self.span))
        lengths = np.empty((len(rows), len(BONES)), np.float32)
        for some in chunks(len(rows)):
            landmarks = self.track.landmarks3d[rows[some]]
            lengths[some] = np.linalg.norm(landmarks[:, BONE_END] - landmarks[:, BONE_START], axis=-1)
        return np.asarray(np.maximum(np.median(lengths, axis=0), 1e-3), np.float32)

    @property
    def frame(self) -> Int[Array, " n"]:
        """Frames with an observation."""
        return self.track.frame[slice(*self._rows(*self.span))]

    def _rows(self, first: int, last: int) -> tuple[int, int]:
        """Rows of the track in [first, last) and in the span."""
        bounds = [max(first, self.span[0]), min(last, self.span[1])]
        start, end = np.searchsorted(self.track.frame, bounds).tolist()
        return start, max(start, end)

    def enter(self, evidence: "Evidence", first: int) -> None:
        """Write what was seen into evidence that begins at frame `first`."""
        rows = slice(*self._rows(first, first + len(evidence.seen)))
        frame = self.track.frame[rows]
        if not len(frame):
            return
        keypoints, landmarks = self.track.keypoints2d[rows], self.track.landmarks3d[rows]

        centre = self.track.mask_affine[rows] @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
        ray = unit(viewing_rays(centre[:, None], self.K[frame - self.span[0]])[:, 0])
        landmarks_cam = landmarks @ np.swapaxes(ray_axes(ray), -1, -2).astype(np.float32)

        at = frame - first
        evidence.seen[at] = True
        evidence.keypoints[at] = keypoints[..., :2]
        trust = np.where(in_intervals(frame, self.tracking_failures), FAILURE_TRUST, 1.0)
        evidence.visibility[at] = np.clip(keypoints[..., 2], 0, 1) * trust[:, None]
        if self.track.keypoint_sigma is not None:
            evidence.keypoint_sigma_px[at] = self.track.keypoint_sigma[rows]
        evidence.trust[at] = trust
        evidence.landmarks_cam[at] = landmarks_cam
        evidence.bones[at] = (landmarks_cam[:, BONE_END] - landmarks_cam[:, BONE_START]) / self.bone_lengths[:, None]
        evidence.ray[at] = ray
        evidence.lifted[at] = self.track.is_in_space
        if self.track.pose is not None:
            pose = self.track.pose.chosen(rows)
            rotations = rotvec_to_rotmat(pose.vectors.astype(np.float64))
            rotations[:, 0] = ray_axes(ray) @ rotations[:, 0]
            evidence.rotations_cam[at] = rotations
            evidence.rotation_sigma[at] = pose.sigma_as_named / np.sqrt(trust)[:, None]


@dataclass(frozen=True, eq=False)
class Evidence:
    """One person's observations on every frame of a run, dense: weight zero where nothing was seen. N frames.

    Keypoints, visibility, landmarks, bones and rotations in single precision, as the network gives them.
    """

    seen: Bool[Array, " N"]
    keypoints: Float[Array, "N 33 2"]
    visibility: Float[Array, "N 33"]
    keypoint_sigma_px: Float[Array, "N 33"]
    """Expected errors of the keypoints, each axis; NaN where no network says."""
    trust: Float[Array, " N"]
    """1; 0 where nothing was seen, little where tracking failed."""
    landmarks_cam: Float[Array, "N 33 3"]
    """Metres, camera axes (rotated by the viewing ray), as large as the network says."""
    bones: Float[Array, "N B 3"]
    """BONES in camera axes, each in units of its median length in the network's landmarks."""
    ray: Float[Array, "N 3"]
    """Unit viewing ray of the crop's centre."""
    lifted: Bool[Array, " N"]
    """Where the landmarks are the lifter's."""
    rotations_cam: Float[Array, "N 20 3 3"]
    """The lifter's: the root's in camera axes, the free joints' relative to their parents."""
    rotation_sigma: Float[Array, "N 20"]
    """Their expected errors, radians; UNKNOWN_RAD where nobody lifted."""

    @classmethod
    def empty(cls, num_frames: int) -> "Evidence":
        """Nothing seen yet."""
        n = num_frames
        return cls(
            seen=np.zeros(n, bool),
            keypoints=np.zeros((n, NUM_LANDMARKS, 2), np.float32),
            visibility=np.zeros((n, NUM_LANDMARKS), np.float32),
            keypoint_sigma_px=np.full((n, NUM_LANDMARKS), np.nan, np.float32),
            trust=np.zeros(n),
            landmarks_cam=np.zeros((n, NUM_LANDMARKS, 3), np.float32),
            bones=np.zeros((n, len(BONES), 3), np.float32),
            ray=np.tile([0.0, 0.0, 1.0], (n, 1)),
            lifted=np.zeros(n, bool),
            rotations_cam=np.tile(np.eye(3, dtype=np.float32), (n, NUM_ROTATIONS, 1, 1)),
            rotation_sigma=np.full((n, NUM_ROTATIONS), UNKNOWN_RAD, np.float32),
        )


@dataclass(frozen=True, eq=False)
class LongEvidence:
    """One person's observations on N frames that follow one another, however many."""

    frame: Int[Array, " N"]
    time_s: Float[Array, " N"]
    seen: Bool[Array, " N"]
    """Where something was seen that is believed."""
    sightings: tuple[Sighting, ...]

    @classmethod
    def of(cls, sightings: tuple[Sighting, ...], frame: Int[Array, " N"], time_s: Float[Array, " F"]) -> "LongEvidence":
        """What the sightings say of these frames; `time_s` holds all frames of the video."""
        seen = np.zeros(len(frame), bool)
        for sighting in sightings:
            at = sighting.frame - frame[0]
            seen[at[(at >= 0) & (at < len(frame))]] = True
        return cls(frame.astype(np.int32), time_s[frame], seen, sightings)

    def keypoint_skeleton(self, betas: Float[Array, " 10"]) -> Skeleton:
        """The person's rest joints with what was seen in the picture on them.

        The shipped pose networks see landmarks elsewhere than the lifter has them. Keypoints of other programs, and
        tracks that no lifter has seen (simulated ones are such), are of the landmarks themselves.
        """
        of_networks = any(one.track.pose is not None and not one.track.lifted for one in self.sightings)
        return _skeleton(betas, load_keypoints() if of_networks else load_landmarks())

    def believed(self, observed: Bool[Array, " N"]) -> "LongEvidence":
        """The evidence without the frames that an earlier stage did not believe."""
        return replace(self, seen=self.seen & observed)

    def frames(self, chosen: slice) -> Evidence:
        """A run of frames."""
        seen = self.seen[chosen]
        evidence = Evidence.empty(len(seen))
        for sighting in self.sightings:
            sighting.enter(evidence, int(self.frame[chosen][0]))
        evidence.seen[~seen] = False
        evidence.visibility[~seen] = evidence.trust[~seen] = 0
        evidence.rotation_sigma[~seen] = UNKNOWN_RAD
        return evidence


def gather(
    track: PersonTrack,
    span: tuple[int, int],
    time_s: Float[Array, " F"],
    K: Float[Array, "n 3 3"],
    *,
    tracking_failures: tuple[tuple[int, int], ...] = (),
) -> LongEvidence | None:
    """A track's observations in `span` from first to last; None if there are none.

    The track has left and right put right (`ScenePeople.track_of`); `time_s` holds all frames of the video, K those of
    the span.
    """
    sighting = Sighting(track, span, tracking_failures, K)
    if not len(sighting.frame):
        return None
    return LongEvidence.of((sighting,), np.arange(sighting.frame[0], sighting.frame[-1] + 1), time_s)
