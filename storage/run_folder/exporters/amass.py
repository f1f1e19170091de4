"""AMASS's SMPL-X dialect: what the Blender SMPL-X add-on and GMR read. z up, metres, axis-angle, float64.

With its defaults the add-on plays at 30 Hz: it refuses files of a lower rate (int(29.97) is 29), and of a higher one it
takes every n-th frame, n a whole number. GMR does the same. `reader_rate` is the nearest rate at which both keep time.
"""

import math
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from humanmm.models.body.fingers import from_flat_hands
from humanmm.models.body.smpl_joints import SMPLX_REST_PELVIS
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson, Recording

NUM_BETAS = 16
BODY_JOINTS = 21
"""SMPL-X ends the body at the wrists; SMPL's two hand joints (22, 23) have no counterpart."""

READER_HZ = 30.0
"""Rate to which the add-on and GMR bring a file."""
_SAME_RATE = 0.01

_WINDOW = 1024
"""Frames that are written at a time."""


def reader_rate(recording: Recording) -> float:
    """30, 60, 90, … Hz: the lowest that is not below the video's rate; one per cent below is the same (30.02, 60.1)."""
    return READER_HZ * max(1, math.ceil(recording.fps / READER_HZ * (1 - _SAME_RATE)))


def write_amass(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as npz. `betas` are zero unless the body is SMPL; ours stand beside them, in their own basis.

    `frame` is the frame of the video that is nearest to each row, `start_frame` the first of them.
    The same as np.savez writes, but a window of frames at a time: in float64 the poses alone take 1.3 kB a frame.
    """
    frame = excerpt.source_frame[person.frame]
    constants = {
        "gender": np.array("neutral"),
        "surface_model_type": np.array("smplx"),
        "mocap_frame_rate": np.array(excerpt.fps, np.float64),
        "betas": np.zeros(NUM_BETAS),
        "num_betas": np.array(NUM_BETAS),
        "betas_body24": person.betas.astype(np.float64),
        "frame": frame.astype(np.int64),
        "start_frame": np.array(frame[0], np.int64),
        "time_s": excerpt.recording.time_s[person.frame],
        "observed": person.observed,
    }
    num_frames = len(person.frame)
    windows = [slice(start, min(start + _WINDOW, num_frames)) for start in range(0, num_frames, _WINDOW)]
    with zipfile.ZipFile(path, "w") as archive:
        for name, value in constants.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, value, allow_pickle=False)
        for name, (width, rows_of) in _over_time(person).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                header = {"descr": "<f8", "fortran_order": False, "shape": (num_frames, width)}
                np.lib.format.write_array_header_1_0(file, header)
                for rows in windows:
                    file.write(rows_of(rows).astype("<f8").tobytes())


def _over_time(person: RecordedPerson) -> dict[str, tuple[int, Callable[[slice], np.ndarray]]]:
    """Every array with a row a frame: its width, and what gives some of its rows."""

    def zeros(width: int) -> tuple[int, Callable[[slice], np.ndarray]]:
        return width, lambda rows: np.zeros((rows.stop - rows.start, width))

    def body(rows: slice) -> np.ndarray:
        return person.body_pose[rows, :BODY_JOINTS].reshape(rows.stop - rows.start, -1)

    def hands(rows: slice) -> np.ndarray:
        if person.hand_pose is None:
            return zeros(90)[1](rows)
        return from_flat_hands(person.hand_pose[rows]).reshape(rows.stop - rows.start, -1)

    def poses(rows: slice) -> np.ndarray:
        return np.concatenate([person.root_orient[rows], body(rows), zeros(3 + 6)[1](rows), hands(rows)], axis=1)

    return {
        "trans": (3, lambda rows: person.pelvis[rows].astype(np.float64) - SMPLX_REST_PELVIS),
        "poses": (165, poses),
        "root_orient": (3, lambda rows: person.root_orient[rows]),
        "pose_body": (3 * BODY_JOINTS, body),
        "pose_jaw": zeros(3),
        "pose_eye": zeros(6),
        "pose_hand": (90, hands),
    }
