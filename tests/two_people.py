"""A recording of two moving people whose joints are those of their rotations: a cut, a camera that moves, one that
zooms, somebody who comes late and leaves early, frames in which he was not seen."""

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.assemble import continuous_rotvec
from humanmm.models.records.camera import Scenery, ShotCamera
from humanmm.models.records.recording import RecordedPerson, Recording

CUT = 25
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Body axes at rest to world axes."""


def recording(*, num_frames: int = 40, fps: float = 29.97, time_s: np.ndarray | None = None) -> Recording:
    """Person 0 is there all the time, person 1 from frame 5 to the sixth last one."""
    times = np.arange(num_frames) / fps if time_s is None else time_s
    R_world_cam, t_world_cam, K = _cameras(times, CUT)
    return Recording(
        width=1280,
        height=720,
        time_s=times,
        shot_index=(np.arange(num_frames) >= CUT).astype(np.int32),
        cut_frames=(CUT,) if num_frames > CUT else (),
        R_world_cam=R_world_cam.astype(np.float32),
        t_world_cam=t_world_cam.astype(np.float32),
        K=K.astype(np.float32),
        camera_source=np.where(np.arange(num_frames) < CUT, 1, 0).astype(np.uint8),
        people=(
            _person(0, np.arange(num_frames), times, unseen=slice(0, 0)),
            _person(1, np.arange(5, num_frames - 5), times, unseen=slice(8, 12)),
        ),
    )


def travelling_camera(points: np.ndarray, relative_std: np.ndarray, *, unit_m: float = 1.0) -> ShotCamera:
    """The first camera of `recording` as it was tracked, in a unit of its own; `points` of its background (world)."""
    taken = recording()
    R, t = (array[:CUT].astype(np.float64) for array in (taken.R_world_cam, taken.t_world_cam))
    positions, path = ((places - t[0]) @ R[0] / unit_m for places in (points, t))
    return ShotCamera(
        0, CUT, R[0].T @ R, path, taken.K[:CUT].astype(np.float64), "tracked", metric=False, reprojection_px=0.5,
        scenery=Scenery(positions.astype(np.float32), relative_std.astype(np.float32)),
    )  # fmt: skip


def _person(number: int, frame: np.ndarray, times: np.ndarray, *, unseen: slice) -> RecordedPerson:
    rng = np.random.default_rng(number)
    t = times[frame]
    betas = rng.normal(0, 1, 10)
    rest = load_body().rest_joints(betas)
    phases, speeds = rng.uniform(0, 2 * np.pi, (23, 3)), rng.uniform(0.5, 2.0, (23, 3))
    pose = 0.7 * np.sin(phases + speeds * 2 * t[:, None, None])
    heading = rotvec_to_rotmat(np.outer(1.5 * t + number, [0, 0, 1])) @ UPRIGHT
    sway = rotvec_to_rotmat(0.3 * np.sin(3 * t)[:, None] * np.array([1.0, 0, 0]))
    R_root = heading @ sway
    pelvis = np.stack([1.2 * t - number, np.sin(t) + 2 * number, 0.95 + 0.03 * np.sin(7 * t)], axis=1)
    root = continuous_rotvec(R_root).astype(np.float32)
    pose = pose.astype(np.float32)
    joints, _ = forward_kinematics(rest, rotvec_to_rotmat(root), pose, pelvis)
    observed = np.ones(len(frame), bool)
    observed[unseen] = False
    return RecordedPerson(
        person=number,
        frame=frame.astype(np.int32),
        observed=observed,
        root_orient=root,
        body_pose=pose,
        betas=betas.astype(np.float32),
        transl=(pelvis - rest[0]).astype(np.float32),
        joints=joints.astype(np.float32),
        contacts=rng.uniform(size=(len(frame), 4)).astype(np.float32),
        keypoints2d=rng.uniform(size=(len(frame), 33, 3)).astype(np.float32),
        bbox=rng.uniform(size=(len(frame), 4)).astype(np.float32),
        confidence=rng.uniform(size=len(frame)).astype(np.float32),
    )


def _cameras(times: np.ndarray, cut: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The first camera moves and turns, the second stands and zooms; both look at the people."""
    first = np.arange(len(times)) < cut
    t = times - times[0]
    centre = np.where(first[:, None], np.stack([0.5 * t, -6 + 0 * t, 1.5 + 0.2 * t], 1), np.array([5.0, 3.0, 1.2]))
    target = np.where(first[:, None], np.stack([0.2 * t, 1 + 0 * t, 1 + 0 * t], 1), np.array([0.0, 1.0, 1.0]))
    z = target - centre
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    focal = np.where(first, 1100.0, 1000.0 + 200 * t)
    K = np.zeros((len(times), 3, 3))
    K[:, 0, 0] = K[:, 1, 1] = focal
    K[:, 0, 2], K[:, 1, 2], K[:, 2, 2] = 640, 360, 1
    return np.stack([x, np.cross(z, x), z], axis=2), centre, K
