"""Other systems' results as sequences: SMPL parameters in their own world, put on body24's average person, z up.

SMPL's mesh is not here, so that joints come from body24's skeleton: rotations and path are theirs, bone lengths those
of an average person. Errors after a similarity (PA, WA) do not change by this; W and RTE change by a few per cent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.smpl_joints import SMPL_REST_PELVIS
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing
from humanmm.models.records.foreign_arrays import frame_numbers, numbers, rotations
from humanmm.models.records.sequence import MotionSequence, PersonSequence

Array = np.ndarray

NUM_JOINTS = 23
"""Body joints of SMPL; systems that end at the wrists leave the last two at rest."""
Y_UP, CAMERA_UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class SystemResult:
    """One person in a world of the system's own, N frames."""

    frame: Int[Array, " N"]
    global_orient: Float[Array, "N 3 3"]
    body_pose: Float[Array, "N J 3"]
    """Axis-angle, the first J of SMPL's 23 body joints."""
    transl: Float[Array, "N 3"]
    """SMPL's transl, metres."""
    up: Float[Array, "3"]
    """The direction that is up in the system's world."""
    notes: tuple[str, ...] = ()


def gvhmr_result(parameters: Mapping[str, Any]) -> SystemResult:
    """From GVHMR's smpl_params_global: y up."""
    orient = numbers(parameters, "global_orient", (None, 3), finite=True)
    pose = numbers(parameters, "body_pose", (len(orient), 63), finite=True).reshape(-1, 21, 3)
    transl = numbers(parameters, "transl", (len(orient), 3), finite=True)
    return SystemResult(np.arange(len(orient)), rotvec_to_rotmat(orient), pose, transl, Y_UP)


def wham_result(tracks: Sequence[Mapping[str, Any]]) -> SystemResult:
    """From WHAM's longest track: y up."""
    track = max(tracks, key=lambda one: np.size(one.get("frame_ids", ())))
    pose = numbers(track, "pose_world", (None, 72), finite=True).reshape(-1, 24, 3)
    frame = frame_numbers(track, "frame_ids", len(pose))
    transl = numbers(track, "trans_world", (len(pose), 3), finite=True)
    return SystemResult(frame, rotvec_to_rotmat(pose[:, 0]), pose[:, 1:], transl, Y_UP, _note(len(tracks)))


def slahmr_result(arrays: Mapping[str, Array]) -> SystemResult:
    """From SLAHMR's first track, in the first camera's axes; its floor says what is up, if it has one."""
    given = {name: arrays[name] for name in ("root_orient", "pose_body", "trans") if name in arrays}
    num_tracks = len(given["root_orient"]) if given["root_orient"].ndim == 3 else 1
    first = {name: array[:1] if array.ndim == 3 else array for name, array in given.items()}
    orient = numbers(first, "root_orient", (None, 3), finite=True)
    pose = numbers(first, "pose_body", (len(orient), 63), finite=True).reshape(-1, 21, 3)
    trans = numbers(first, "trans", (len(orient), 3), finite=True)
    up = CAMERA_UP
    if "floor_plane" in arrays:
        planes = numbers(
            {"floor_plane": np.atleast_2d(arrays["floor_plane"])}, "floor_plane", (None, None), finite=True
        )
        if planes.shape[0] < 1 or planes.shape[1] < 3:
            raise InputError(f"floor_plane has shape {planes.shape}; expected at least one row of three numbers")
        normal = planes[0, :3]
        length = float(np.linalg.norm(normal))
        if length > 1e-6:
            up = normal / length * (1.0 if normal @ CAMERA_UP >= 0 else -1.0)
    return SystemResult(np.arange(len(orient)), rotvec_to_rotmat(orient), pose, trans, up, _note(num_tracks))


def tram_result(arrays: Mapping[str, Array]) -> SystemResult:
    """From TRAM's person in camera axes and its camera."""
    R_cam_body = rotations(arrays, "pred_rotmat", (None, 24, 3, 3), finite=True)
    trans = numbers(arrays, "pred_trans", (len(R_cam_body), 3), finite=True)
    cameras = rotations(arrays, "pred_cam_R", (None, 3, 3), finite=True)
    frame = frame_numbers(arrays, "frame", len(R_cam_body), below=len(cameras))
    R, t = cameras[frame], numbers(arrays, "pred_cam_T", (len(cameras), 3), finite=True)[frame]
    transl = (R @ (trans + SMPL_REST_PELVIS)[..., None])[..., 0] + t - SMPL_REST_PELVIS
    return SystemResult(frame, R @ R_cam_body[:, 0], rotmat_to_rotvec(R_cam_body[:, 1:]), transl, CAMERA_UP)


def imported_sequence(result: SystemResult, *, num_frames: int, fps: float) -> MotionSequence:
    """The motion in a world with z up."""
    R_world_theirs = swing(result.up / np.linalg.norm(result.up), np.array([0.0, 0.0, 1.0]))
    R_root = R_world_theirs @ result.global_orient
    pose = np.zeros((len(result.frame), NUM_JOINTS, 3))
    given = result.body_pose[:, :NUM_JOINTS]
    pose[:, : given.shape[1]] = given
    pelvis = (result.transl + SMPL_REST_PELVIS) @ R_world_theirs.T
    joints, _ = forward_kinematics(load_body().J_template, R_root, pose, pelvis)
    person = PersonSequence(
        person=0,
        frame=result.frame.astype(np.int64),
        observed=np.ones(len(result.frame), bool),
        joints=joints,
        R_world_root=R_root,
    )
    return MotionSequence(num_frames, fps, JOINT_NAMES, (person,), (), notes=result.notes)


def _note(num_tracks: int) -> tuple[str, ...]:
    return (f"{num_tracks} tracks were found; one is compared.",) if num_tracks > 1 else ()
