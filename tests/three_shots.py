"""Three shots of somebody who stands and turns, each from a static camera: exact observations and exact fits."""

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.cuts.camera_rotation import viewing_axes
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import PersonShotMotion, ShotMotion, WorldMotion
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

FPS, LENGTH = 30.0, 20
INTRINSICS = Intrinsics(900.0, 960, 540, "given", 0.0)
BETAS = np.zeros(10)
AZIMUTHS_DEG = (-60.0, 30.0, 150.0)


def body(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Somebody who stands and turns slowly, arms bent: R_world_root, body pose, pelvis."""
    time_s = frames / FPS
    pose = np.zeros((len(frames), 23, 3))
    pose[:, 15, 2], pose[:, 16, 2] = -1.1, 0.9
    pose[:, 17, 1], pose[:, 18, 1] = -0.9 + 0.2 * np.sin(5 * time_s), 0.7
    pose[:, 0, 0], pose[:, 3, 0] = -0.3, 0.5
    upright = rotvec_to_rotmat(np.array([np.pi / 2, 0, 0]))
    turn = rotvec_to_rotmat(np.outer(0.5 * time_s, [0, 0, 1.0]))
    return turn @ upright, pose, np.tile([0.0, 0.0, 0.95], (len(frames), 1))


def camera(shot: int) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam and centre of a shot's standing camera."""
    azimuth = np.radians(AZIMUTHS_DEG[shot])
    centre = np.array([4 * np.cos(azimuth), 4 * np.sin(azimuth), 1.5])
    z = np.array([0, 0, 0.9]) - centre
    z /= np.linalg.norm(z)
    x = np.cross(z, [0, 0, 1.0]) / np.linalg.norm(np.cross(z, [0, 0, 1.0]))
    return np.stack([x, np.cross(z, x), z], axis=1), centre


def shot_of(index: int, person: int = 0) -> tuple[Shot, ScenePeople, ShotCamera, ShotMotion]:
    """A shot of LENGTH frames with exact observations and an exact fit."""
    frames = np.arange(index * LENGTH, (index + 1) * LENGTH, dtype=np.int32)
    R_world_root, pose, pelvis = body(frames)
    R, centre = camera(index)
    R_cam_root, pelvis_cam = R.T @ R_world_root, (pelvis - centre) @ R
    joints, rotations = forward_kinematics(load_body().rest_joints(BETAS), R_cam_root, pose, pelvis_cam)
    points = load_landmarks().place(BETAS, joints, rotations)
    pixels = (points / points[..., 2:]) @ K_of(INTRINSICS).T
    keypoints = np.concatenate([pixels[..., :2], np.ones((LENGTH, 33, 1))], axis=-1)
    relative = points - points[:, [23, 24]].mean(axis=1, keepdims=True)
    landmarks = np.einsum("nba,njb->nja", viewing_axes(keypoints, K_of(INTRINSICS)), relative)
    box = np.concatenate([keypoints[..., :2].min(axis=1), keypoints[..., :2].max(axis=1)], axis=1)
    track = PersonTrack(
        frame=frames,
        keypoints2d=keypoints.astype(np.float32),
        landmarks3d=landmarks.astype(np.float32),
        bbox=box.astype(np.float32),
        confidence=np.ones(LENGTH, np.float32),
        masks=Silhouettes.pack(np.zeros((LENGTH, 128, 128))),
        mask_affine=np.zeros((LENGTH, 2, 3), np.float32),
        color_frame=frames[:1],
        color_histogram=np.full((1, 8), 1 / 8, np.float32),
    )
    motion = PersonShotMotion(
        person,
        frames,
        np.ones(LENGTH, bool),
        R_cam_root,
        pose,
        BETAS,
        pelvis_cam,
        np.ones(LENGTH, np.float32),
        np.ones(LENGTH, np.float32),
        np.zeros(LENGTH, np.float32),
        np.full(LENGTH, 0.05, np.float32),
    )
    start, end = int(frames[0]), int(frames[-1]) + 1
    still = ShotCamera(
        start, end, np.tile(np.eye(3), (LENGTH, 1, 1)), np.zeros((LENGTH, 3)),
        np.tile(K_of(INTRINSICS), (LENGTH, 1, 1)), "static", True, float("nan"),
    )  # fmt: skip
    began = Transition("cut", start, start, "scene") if index else None
    return (
        Shot(index, start, end, index, began, (Appearance(person, 0, ()),)),
        ScenePeople(start, end, (track,)),
        still,
        ShotMotion(start, end, (motion,)),
    )


def results(people: tuple[int, ...] = (0, 0, 0)) -> ShotResults:
    """What `align` reads of three shots that show these people, one each."""
    shots, scenes, cameras, motions = zip(*(shot_of(k, person) for k, person in enumerate(people)), strict=True)
    cast = tuple(Person(k, BETAS, 1.0) for k in sorted(set(people)))
    listed = ShotList(3 * LENGTH, shots, cast)
    return ShotResults(listed, scenes, cameras, motions, np.arange(3 * LENGTH) / FPS, INTRINSICS, [()] * 3)


def rotation_error_deg(world: WorldMotion, frame_a: int, frame_b: int) -> float:
    """How far the rotation between two frames' cameras is from the true one."""
    found = world.R_world_cam[frame_a].T @ world.R_world_cam[frame_b]
    true = camera(frame_a // LENGTH)[0].T @ camera(frame_b // LENGTH)[0]
    return float(np.degrees(np.linalg.norm(rotmat_to_rotvec(found.T @ true))))
