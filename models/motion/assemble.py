"""Assembles the recording: the only module where world motion, the detector's observations and the shot list meet."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.projection import in_front, project, world_to_camera
from humanmm.models.motion.hands.recorded import RecordedHands, recorded_hands
from humanmm.models.motion.refine.worlds import worlds_of_motion
from humanmm.models.records import landmarks
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.models.records.shots import Shot, ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts

NEAR_M = 0.05
"""Points closer than this to the camera plane are not projected."""


def record_motion(
    facts: VideoFacts, shot_list: ShotList, scenes: Sequence[ScenePeople | None], motion: WorldMotion
) -> Recording:
    """The recording of one video: cameras, and everybody's motion, joints and observations; world axes, metres.

    `scenes`: what the detector saw, one a scene, None where it failed.
    """
    body, hands = load_body(), {}
    if any(track.hands is not None for scene in scenes if scene is not None for track in scene.tracks):
        for person in motion.people:
            tracks = [(shot, track) for shot in shot_list.shots if (track := _track_of(person.person, shot, scenes))]
            hands[person.person] = recorded_hands(person, motion, facts.time_s, tracks)
        bent = (replace(person, body_pose=hands[person.person].body_pose) for person in motion.people)
        motion = replace(motion, people=tuple(bent))
    rest = {person.person: body.rest_joints(person.betas) for person in motion.people}
    joints = {person.person: world_joints(person, rest[person.person]) for person in motion.people}
    pelvis = {number: joints_at_rest[0] for number, joints_at_rest in rest.items()}
    return assemble(facts, shot_list, scenes, motion, rest_pelvis=pelvis, joints_world=joints, hands=hands)


def assemble(
    facts: VideoFacts,
    shot_list: ShotList,
    scenes: Sequence[ScenePeople | None],
    motion: WorldMotion,
    *,
    rest_pelvis: Mapping[int, Float[np.ndarray, "3"]],
    joints_world: Mapping[int, Float[np.ndarray, "frames 24 3"]],
    hands: Mapping[int, RecordedHands] | None = None,
) -> Recording:
    """The recording of one video. By person number: `rest_pelvis` is J0(betas), `joints_world` forward kinematics, and
    `hands` if anybody looked at them."""
    in_transition = transition_frames(shot_list)
    probability = {person.person: person.probability for person in shot_list.people}
    people = []
    for person in sorted(motion.people, key=lambda p: p.person):
        keypoints2d, bbox, seen = _observations(person, shot_list, scenes)
        joints = np.asarray(joints_world[person.person], np.float32)
        bbox[~seen] = _projected_boxes(joints[~seen], motion, person.frame[~seen])
        fingers = (hands or {}).get(person.person)
        people.append(
            RecordedPerson(
                person=person.person,
                frame=person.frame.astype(np.int32),
                observed=person.observed & ~in_transition[person.frame],
                root_orient=continuous_rotvec(person.R_world_root).astype(np.float32),
                body_pose=person.body_pose.astype(np.float32),
                betas=person.betas.astype(np.float32),
                transl=(person.pelvis_world - rest_pelvis[person.person]).astype(np.float32),
                joints=joints,
                contacts=person.contacts.astype(np.float32),
                keypoints2d=keypoints2d,
                bbox=bbox,
                confidence=person.confidence.astype(np.float32),
                probability=probability[person.person],
                hand_pose=fingers.hand_pose.astype(np.float32) if fingers is not None else None,
                hand_confidence=fingers.confidence.astype(np.float32) if fingers is not None else None,
            )
        )
    return Recording(
        width=facts.width,
        height=facts.height,
        time_s=facts.time_s.astype(np.float64),
        shot_index=shot_of_each_frame(shot_list),
        cut_frames=tuple(shot.start for shot in shot_list.shots[1:]),
        R_world_cam=motion.R_world_cam.astype(np.float32),
        t_world_cam=motion.t_world_cam.astype(np.float32),
        K=motion.K.astype(np.float32),
        camera_source=motion.camera_source.astype(np.uint8),
        people=tuple(people),
        worlds=worlds_of_motion(shot_list, motion),
    )


def world_joints(
    person: PersonMotion, rest_joints: Float[np.ndarray, "24 3"], *, window: int = 1024
) -> Float[np.ndarray, "frames 24 3"]:
    """Joints of a person in the world, metres, float32; a window of frames at a time, to keep long videos small."""
    joints = np.empty((len(person.frame), *rest_joints.shape), np.float32)
    for start in range(0, len(joints), window):
        rows = slice(start, start + window)
        joints[rows], _ = forward_kinematics(
            rest_joints, person.R_world_root[rows], person.body_pose[rows], person.pelvis_world[rows]
        )
    return joints


def shot_of_each_frame(shot_list: ShotList) -> np.ndarray:
    """(F,) int32, 0-based shot of each frame."""
    shot_index = np.zeros(shot_list.num_frames, np.int32)
    for shot in shot_list.shots:
        shot_index[shot.start : shot.end] = shot.index
    return shot_index


def transition_frames(shot_list: ShotList) -> np.ndarray:
    """(F,) bool, true inside gradual transitions [start, end), where two pictures mix and nobody counts as observed."""
    inside = np.zeros(shot_list.num_frames, bool)
    for shot in shot_list.shots:
        if shot.transition is not None:
            inside[shot.transition.start : shot.transition.end] = True
    return inside


def continuous_rotvec(R: Float[np.ndarray, "frames 3 3"]) -> Float[np.ndarray, "frames 3"]:
    """Axis-angle of a rotation over time without jumps at half a turn: angles run from 0 to 2π, quaternions agree."""
    if len(R) == 0:
        return np.zeros((0, 3))
    quat_xyzw = Rotation.from_matrix(R).as_quat()
    quat_xyzw[0] *= 1.0 if quat_xyzw[0, 3] >= 0 else -1.0
    same_side = np.einsum("ij,ij->i", quat_xyzw[1:], quat_xyzw[:-1]) >= 0
    quat_xyzw[1:] *= np.cumprod(np.where(same_side, 1.0, -1.0))[:, None]
    sine = np.linalg.norm(quat_xyzw[:, :3], axis=1)
    angle = 2 * np.arctan2(sine, quat_xyzw[:, 3])
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)  # limit of θ / sin(θ/2) at 0
    return np.asarray(quat_xyzw[:, :3] * scale[:, None])


def _observations(
    person: PersonMotion, shot_list: ShotList, scenes: Sequence[ScenePeople | None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the detector saw of a person: keypoints (N,33,3), left and right put right, boxes (N,4), seen (N,) bool."""
    num_frames = len(person.frame)
    keypoints2d = np.zeros((num_frames, len(landmarks.NAMES), 3), np.float32)
    bbox = np.zeros((num_frames, 4), np.float32)
    seen = np.zeros(num_frames, bool)
    first = int(person.frame[0]) if num_frames else 0
    for shot in shot_list.shots:
        track = _track_of(person.person, shot, scenes)
        if track is None:
            continue
        rows = track.frame - first
        inside = (track.frame >= shot.start) & (track.frame < shot.end) & (rows >= 0) & (rows < num_frames)
        keypoints2d[rows[inside]] = track.keypoints2d[inside]
        bbox[rows[inside]] = track.bbox[inside]
        seen[rows[inside]] = True
    return keypoints2d, bbox, seen


def _track_of(person: int, shot: Shot, scenes: Sequence[ScenePeople | None]) -> PersonTrack | None:
    scene = scenes[shot.scene]
    if scene is None:
        return None
    for appearance in shot.people:
        if appearance.person == person:
            return scene.track_of(appearance)
    return None


def _projected_boxes(joints: np.ndarray, motion: WorldMotion, frame: np.ndarray) -> np.ndarray:
    """(N,4) float32 boxes about the projected joints; zero where a joint is behind the camera."""
    in_camera = world_to_camera(joints, motion.R_world_cam[frame], motion.t_world_cam[frame])
    pixels = project(in_camera, motion.K[frame], near_m=NEAR_M)
    boxes = np.concatenate([pixels.min(1), pixels.max(1)], axis=-1)
    whole = in_front(in_camera, NEAR_M).all(axis=1, keepdims=True)
    return np.where(whole, boxes, 0.0).astype(np.float32)
