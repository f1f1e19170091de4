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
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing
from humanmm.models.records.sequence import MotionSequence, PersonSequence

Array = np.ndarray

NUM_JOINTS = 23
"""Body joints of SMPL; systems that end at the wrists leave the last two at rest."""
SMPL_REST_PELVIS = np.array([-0.0018, -0.2233, 0.0282])
"""Pelvis joint of SMPL's neutral template about its origin, metres, as published with the model."""
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
    orient, pose = _rows(parameters, "global_orient", 3), _rows(parameters, "body_pose", 63)
    transl = _rows(parameters, "transl", 3)
    frame = np.arange(len(orient))
    return SystemResult(frame, rotvec_to_rotmat(orient), pose.reshape(len(pose), -1, 3), transl, Y_UP)


def wham_result(tracks: Sequence[Mapping[str, Any]]) -> SystemResult:
    """From WHAM's longest track: y up."""
    track = max(tracks, key=lambda one: len(one["frame_ids"]))
    pose = _rows(track, "pose_world", 72).reshape(-1, 24, 3)
    frame = np.asarray(track["frame_ids"]).astype(np.int64)
    transl = _rows(track, "trans_world", 3)
    return SystemResult(frame, rotvec_to_rotmat(pose[:, 0]), pose[:, 1:], transl, Y_UP, _note(len(tracks)))


def slahmr_result(arrays: Mapping[str, Array]) -> SystemResult:
    """From SLAHMR's first track, in the first camera's axes; its floor says what is up, if it has one."""
    orient, pose, trans = (arrays[name].astype(np.float64) for name in ("root_orient", "pose_body", "trans"))
    if orient.ndim == 2:  # a single track without its own axis
        orient, pose, trans = orient[None], pose[None], trans[None]
    up = CAMERA_UP
    if "floor_plane" in arrays:
        normal = arrays["floor_plane"].astype(np.float64).reshape(-1, arrays["floor_plane"].shape[-1])[0, :3]
        length = float(np.linalg.norm(normal))
        if length > 1e-6:
            up = normal / length * (1.0 if normal @ CAMERA_UP >= 0 else -1.0)
    frame = np.arange(orient.shape[1])
    body_pose = pose[0].reshape(len(frame), -1, 3)
    return SystemResult(frame, rotvec_to_rotmat(orient[0]), body_pose, trans[0], up, _note(len(orient)))


def tram_result(arrays: Mapping[str, Array]) -> SystemResult:
    """From TRAM's person in camera axes and its camera."""
    R_cam_body = arrays["pred_rotmat"].astype(np.float64).reshape(-1, 24, 3, 3)
    trans, frame = arrays["pred_trans"].astype(np.float64).reshape(-1, 3), arrays["frame"].astype(np.int64).ravel()
    R, t = arrays["pred_cam_R"].astype(np.float64)[frame], arrays["pred_cam_T"].astype(np.float64).reshape(-1, 3)[frame]
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


def _rows(arrays: Mapping[str, Any], name: str, width: int) -> Array:
    if name not in arrays:
        raise InputError(f"{name} is missing; expected {width} numbers a frame")
    array = np.asarray(arrays[name], np.float64)
    if array.shape[-1:] != (width,):
        raise InputError(f"{name} has shape {array.shape}; expected {width} numbers a frame")
    return array.reshape(-1, width)


def _note(num_tracks: int) -> tuple[str, ...]:
    return (f"{num_tracks} tracks were found; one is compared.",) if num_tracks > 1 else ()
