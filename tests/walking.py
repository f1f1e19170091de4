"""A body that walks along a curve, and what a pose network would see of it from cameras around it."""

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.cuts import camera_rotation as cuts
from humanmm.models.cuts.sides import CutPerson, SideTrack
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.shots.left_right_swaps import SidesSeen

FPS = 30.0
K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])


def walker(num_frames: int) -> np.ndarray:
    """Landmarks (frames, 33, 3) of a body that walks along a curve: world, z up, metres."""
    body, betas = load_body(), np.zeros(10)
    phase = 2 * np.pi * np.arange(num_frames) / FPS
    pose = np.zeros((num_frames, 23, 3))
    swing = 0.5 * np.sin(phase)
    pose[:, 0, 0], pose[:, 1, 0] = -swing, swing
    pose[:, 3, 0], pose[:, 4, 0] = 0.5 + 0.4 * np.cos(phase), 0.5 - 0.4 * np.cos(phase)
    pose[:, 15, 2], pose[:, 16, 2] = -1.1, 1.1
    pose[:, 15, 1], pose[:, 16, 1] = 0.5 * swing, 0.5 * swing
    pose[:, 17, 1], pose[:, 18, 1] = -0.7, 0.7
    heading = Rotation.from_rotvec(np.outer(0.3 * np.arange(num_frames) / FPS, [0, 0, 1]))
    turn = heading * Rotation.from_euler("x", np.pi / 2)
    pelvis = np.cumsum(heading.apply(np.array([0.0, -1.2 / FPS, 0.0])), axis=0)
    pelvis[:, 2] = 0.95
    joints, R = forward_kinematics(body.rest_joints(betas), turn.as_matrix(), pose, pelvis)
    return load_landmarks().place(betas, joints, R)


def camera(azimuth_deg: float, target: np.ndarray, distance: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam and centre of a camera that looks at the target from a side."""
    azimuth = np.radians(azimuth_deg)
    centre = target + distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.12])
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1), centre


def observed(
    points: np.ndarray, R: np.ndarray, centre: np.ndarray, frames: np.ndarray, *, tilt_deg: float = 0.0, seed: int = 0
) -> SideTrack:
    """What a pose network would say: noisy pixels, 3D points about the mid-hip turned by `tilt_deg`."""
    rng = np.random.default_rng(seed)
    cam = (points[frames] - centre) @ R
    pixels = (cam / cam[..., 2:]) @ K.T
    keypoints = np.concatenate([pixels[..., :2], np.ones((*cam.shape[:2], 1))], axis=-1)
    keypoints[..., :2] += rng.normal(0, 3.0, keypoints[..., :2].shape)
    relative = cam - cam[:, [23, 24]].mean(axis=1, keepdims=True)
    relative = relative @ rotvec_to_rotmat(np.radians(tilt_deg) * np.array([0.6, 0.8, 0.0])).T
    relative += rng.normal(0, 0.02, relative.shape)
    rays = cuts.viewing_axes(keypoints, K)
    return SideTrack(
        time_s=frames / FPS,
        keypoints2d=keypoints,
        landmarks3d=np.einsum("nba,njb->nja", rays, relative),
        R_cam_root=None,
        R_cut_cam=np.tile(np.eye(3), (len(frames), 1, 1)),
    )


def case(angle_deg: float, *, tilt_deg: float = 0.0, seed: int = 0) -> tuple[CutPerson, np.ndarray]:
    """A cut at frame 20 between two cameras that stand `angle_deg` apart, and the true R_before_after."""
    points = walker(40)
    target = points[20, [23, 24]].mean(axis=0)
    R1, c1 = camera(20.0, target)
    R2, c2 = camera(20.0 + angle_deg, target, 3.5)
    before = observed(points, R1, c1, np.arange(8, 20), tilt_deg=tilt_deg, seed=seed)
    after = observed(points, R2, c2, np.arange(20, 32), tilt_deg=-tilt_deg, seed=seed + 1)
    return CutPerson(before, after), R1.T @ R2


def sighting(track: SideTrack) -> SidesSeen:
    """The same observations, as the stage `shots` takes them."""
    frame = np.round(track.time_s * FPS).astype(np.int32)
    return SidesSeen(track.time_s, np.full(len(frame), 1 / FPS), frame, track.keypoints2d, track.landmarks3d)
