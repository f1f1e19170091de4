"""Results of the stages before `align` on a whole video, shot by shot, and what the alignment reads of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import chunks, forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.camera.background.ground import GroundPicture
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import PersonShotMotion, ShotMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople

Array = np.ndarray

SOLES = (29, 31, 30, 32)
"""Landmarks of the feet: left heel, left toes, right heel, right toes."""


@dataclass(frozen=True)
class ShotResults:
    """Everything `align` reads, one entry a shot (`scenes`: a scene) where it is a list; None where that failed."""

    shots: ShotList
    scenes: Sequence[ScenePeople | None]
    cameras: Sequence[ShotCamera | None]
    motions: Sequence[ShotMotion | None]
    time_s: Float[Array, "F"]
    intrinsics: Intrinsics
    key_frames: Sequence[Sequence[FrameFeatures]]
    """Features of every shot's key frames, people left out; empty where there are none."""
    ground: Sequence[Sequence[GroundPicture]] = ()
    """Pictures of the ground around people, one entry a shot; none at all where there are no pictures."""
    pictures: Sequence[Sequence[GroundPicture]] = ()
    """Every shot's key frames, people left out; none at all where there are no pictures."""

    def key_frames_of(self, shot: int) -> Sequence[FrameFeatures]:
        """Features and edges of a shot's key frames as a pinhole camera would see them."""
        span, one = self.shots.shots[shot], self.intrinsics
        distortion = one.of_shot(span.start, span.end).distortion
        return [frame.straightened(distortion, one.width, one.height) for frame in self.key_frames[shot]]

    @property
    def certain(self) -> frozenset[int]:
        """Numbers of the people who are not doubtful."""
        return frozenset(person.person for person in self.shots.people if not person.doubtful)

    @property
    def insets(self) -> frozenset[int]:
        """Numbers of the people in a picture within the picture, before which another camera stood."""
        return frozenset(person.person for person in self.shots.people if person.inset)


def usable(results: ShotResults, shot: int) -> bool:
    """Whether a shot has a camera and a motion."""
    return results.cameras[shot] is not None and results.motions[shot] is not None


def motions_of(results: ShotResults, shot: int) -> dict[int, PersonShotMotion]:
    """The motions in a shot by person; none where it failed."""
    motion = results.motions[shot]
    return {person.person: person for person in motion.people} if motion is not None else {}


def witnesses_of(results: ShotResults, shot: int) -> dict[int, PersonShotMotion]:
    """The motions in a shot of those by whom its camera is judged, by person (`ShotList.witnesses`)."""
    motions = motions_of(results, shot)
    return {person: motions[person] for person in sorted(results.shots.witnesses(motions))}


def camera_of(results: ShotResults, shot: int) -> ShotCamera:
    """The camera of a shot that has one. ValueError where it failed."""
    camera = results.cameras[shot]
    if camera is None:
        raise ValueError(f"shot {shot} has no camera")
    return camera


def refocused(results: ShotResults, factor: float) -> ShotResults:
    """The same results if the focal length is `factor` times as long as they were made with.

    What is seen with a longer lens is as far to the side, and farther away; it lies nearer to the axis, and a body in
    the same picture is turned by so much; a pan or tilt by so many pixels is a smaller one, a roll is the same.
    """
    farther, smaller = np.array([1.0, 1.0, factor]), np.array([1 / factor, 1 / factor, 1.0])

    def of_camera(camera: ShotCamera) -> ShotCamera:
        K = camera.K.copy()
        K[:, [0, 1], [0, 1]] *= factor
        R = camera.R_shot_cam.copy()
        # Step by step: a pan may be longer than half a turn.
        steps = rotmat_to_rotvec(np.swapaxes(camera.R_shot_cam[:-1], -1, -2) @ camera.R_shot_cam[1:])
        for k, step in enumerate(rotvec_to_rotmat(steps * smaller)):
            R[k + 1] = R[k] @ step
        return replace(camera, K=K, R_shot_cam=R)

    def of_motion(motion: PersonShotMotion) -> PersonShotMotion:
        pelvis = motion.pelvis_cam * farther
        return replace(motion, pelvis_cam=pelvis, R_cam_root=swing(motion.pelvis_cam, pelvis) @ motion.R_cam_root)

    return replace(
        results,
        intrinsics=replace(results.intrinsics, focal_px=factor * results.intrinsics.focal_px),
        cameras=[None if camera is None else of_camera(camera) for camera in results.cameras],
        motions=[
            None if motion is None else replace(motion, people=tuple(map(of_motion, motion.people)))
            for motion in results.motions
        ],
    )


def posed(
    motion: PersonShotMotion, R_axes_cam: Float[Array, "n 3 3"]
) -> tuple[Float[Array, "n 24 3"], Float[Array, "n 4 3"]]:
    """Joints and sole points about the pelvis, in axes rotated by R_axes_cam."""
    rest, landmarks = load_body().rest_joints(motion.betas), load_landmarks()
    n = len(motion.frame)
    joints, soles = np.empty((n, len(rest), 3)), np.empty((n, len(SOLES), 3))
    for frames in chunks(n):
        R_root = R_axes_cam[frames] @ motion.R_cam_root[frames]
        joints[frames], R = forward_kinematics(rest, R_root, motion.body_pose[frames], np.zeros((len(R_root), 3)))
        soles[frames] = landmarks.place(motion.betas, joints[frames], R)[:, list(SOLES)]
    return joints, soles
