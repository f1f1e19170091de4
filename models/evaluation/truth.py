"""Sequences from the arrays of a run folder, of a truth with motion.zarr's names, or of a Pose2Sim truth.

The arrays may come from strangers: whatever is wrong with them is one InputError in one sentence.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from humanmm.errors import TruthError
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.evaluation.skeleton import LIMB_NAMES, SMPL_NAMES, pick
from humanmm.models.geometry.axes import R_ZUP_YUP, zup_camera_pose
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.foreign_arrays import (
    MAX_NUMBERS,
    MAX_ROWS,
    frame_numbers,
    numbers,
    rotations,
    shown,
    whole_numbers,
)
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence

Arrays = Mapping[str, np.ndarray]


def header_arrays(
    schema: str,
    joint_names: Sequence[str],
    num_frames: int,
    cuts: Sequence[int],
    fps: float,
    size: tuple[int, int],
    parents: Sequence[int] | None = None,
) -> dict[str, np.ndarray]:
    """What a truth says besides cameras and people; without `parents` the joints are points, no tree."""
    return {
        "schema": np.array(schema),
        "fps": np.array(fps),
        "width": np.array(size[0]),
        "height": np.array(size[1]),
        "num_frames": np.array(num_frames),
        "cut_frames": np.array(cuts, np.int32),
        "joint_names": np.array(joint_names),
        "parents": np.array(parents) if parents is not None else np.full(len(joint_names), -1, np.int32),
        "time_s": np.arange(num_frames) / fps,
    }


def contract_sequence(arrays: Arrays, *, transitions: tuple[tuple[int, int], ...] | None = None) -> MotionSequence:
    """A sequence from motion.zarr's array names and attributes.

    `transitions`: [start, end) of every change of shot; without them `arrays` may have them, or every change is a cut.
    """
    num_frames = int(whole_numbers(arrays, "num_frames", ()))
    if not 0 < num_frames <= MAX_ROWS:
        raise TruthError(f"num_frames is {num_frames}; expected 1 to {MAX_ROWS}")
    fps = _fps(arrays) if num_frames > 1 else 1.0
    cut_frames = _cut_frames(arrays, num_frames)
    if transitions is None and "transitions" in arrays:
        transitions = tuple((int(start), int(end)) for start, end in whole_numbers(arrays, "transitions", (None, 2)))
    spans = tuple((cut, cut) for cut in cut_frames)
    if transitions is not None:
        spans = _spans(transitions, cut_frames, num_frames)
    joint_names = _joint_names(arrays) if "joint_names" in arrays else SMPL_NAMES
    cameras = _contract_cameras(arrays, num_frames)
    model = str(arrays["body_model"]) if "body_model" in arrays else ""
    people: list[PersonSequence] = []
    for number in _people(arrays):
        person = _contract_person(
            arrays, number, num_frames=num_frames, joint_names=joint_names, model=model, cameras=cameras
        )
        people.append(person)
        if sum(one.joints.size for one in people) > MAX_NUMBERS:
            raise TruthError(f"its people have more than {MAX_NUMBERS:,} coordinates")
    linked = np.ones(len(cut_frames), bool)
    if "linked" in arrays:
        linked = whole_numbers(arrays, "linked", (len(cut_frames),)).astype(bool)
    unlinked = tuple(cut for cut, joined in zip(cut_frames, linked, strict=True) if not joined)
    return MotionSequence(num_frames, fps, joint_names, tuple(people), spans, cameras, unlinked_cuts=unlinked)


def _fps(arrays: Arrays) -> float:
    fps = float(numbers(arrays, "fps", ()))
    if not (np.isfinite(fps) and fps > 0):
        raise TruthError(f"fps is {fps}; expected a positive number")
    return fps


def _cut_frames(arrays: Arrays, num_frames: int) -> tuple[int, ...]:
    given = {"cut_frames": np.atleast_1d(arrays["cut_frames"])} if "cut_frames" in arrays else {}
    cut_frames = tuple(whole_numbers(given, "cut_frames", (None,)).tolist())
    if list(cut_frames) != sorted(set(cut_frames)) or any(not 0 < cut < num_frames for cut in cut_frames):
        raise TruthError(
            f"cut_frames are {_listed(cut_frames)}; expected rising frame numbers between 1 and {num_frames - 1}"
        )
    return cut_frames


def _spans(
    transitions: tuple[tuple[int, int], ...], cut_frames: tuple[int, ...], num_frames: int
) -> tuple[tuple[int, int], ...]:
    """The transitions, which have the cuts in their middles."""
    middles = tuple((start + end) // 2 for start, end in transitions)
    if middles != cut_frames or any(not 0 <= start <= end <= num_frames for start, end in transitions):
        raise TruthError(f"the transitions {_listed(transitions)} disagree with the cuts {_listed(cut_frames)}")
    return transitions


def _listed(values: Sequence[object]) -> str:
    return ", ".join(map(str, values[:6])) + (", …" if len(values) > 6 else "")


def _joint_names(arrays: Arrays) -> tuple[str, ...]:
    found = arrays["joint_names"] if "joint_names" in arrays else np.array("")
    names = tuple(str(name) for name in np.atleast_1d(found))
    if found.ndim != 1 or len(set(names)) != len(names):
        raise TruthError(
            f"joint_names are {', '.join(map(shown, names[:6])) or 'missing'}; expected a list of different names"
        )
    return names


def _people(arrays: Arrays) -> list[int]:
    """The numbers of the people."""
    keys = [key.split("/") for key in arrays]
    names = sorted(key[1] for key in keys if len(key) == 3 and key[0] == "people" and key[2] == "joints")
    for name in names:
        if not re.fullmatch("[0-9]{2,6}", name) or name != f"{int(name):02d}":
            raise TruthError(f"people/{shown(name)}/joints: people are numbered people/00, people/01, …")
    return [int(name) for name in names]


def _contract_cameras(arrays: Arrays, num_frames: int) -> CameraSequence | None:
    keys = ("cameras/R_world_cam", "cameras/t_world_cam", "cameras/K")
    if not all(key in arrays for key in keys):
        return None
    return CameraSequence(
        rotations(arrays, keys[0], (num_frames, 3, 3)),
        numbers(arrays, keys[1], (num_frames, 3)),
        numbers(arrays, keys[2], (num_frames, 3, 3)),
    )


def _contract_person(
    arrays: Arrays,
    number: int,
    *,
    num_frames: int,
    joint_names: tuple[str, ...],
    model: str,
    cameras: CameraSequence | None,
) -> PersonSequence:
    prefix = f"people/{number:02d}"
    joints = numbers(arrays, f"{prefix}/joints", (None, len(joint_names), 3))
    n = len(joints)
    frame = np.arange(n)
    if f"{prefix}/frame" in arrays:
        frame = frame_numbers(arrays, f"{prefix}/frame", n, below=num_frames)
    elif n > num_frames:
        raise TruthError(f"{prefix}/joints has {n} frames; the truth has {num_frames}")

    def optional(name: str, shape: tuple[int, ...], *, finite: bool = False) -> np.ndarray | None:
        key = f"{prefix}/{name}"
        return numbers(arrays, key, shape, finite=finite) if key in arrays else None

    observed = optional("observed", (n,))
    root_orient = optional("root_orient", (n, 3), finite=True)
    parts = (
        root_orient,
        optional("body_pose", (n, 23, 3), finite=True),
        optional("betas", (10,), finite=True),
        optional("transl", (n, 3), finite=True),
    )
    bbox = optional("bbox", (n, 4))
    if bbox is None and cameras is not None:
        bbox = projected_boxes(joints, frame, cameras)
    body = None
    if all(part is not None for part in parts):
        body = BodyParameters(model, *(part for part in parts if part is not None))
    return PersonSequence(
        person=number,
        frame=frame,
        observed=np.ones(n, bool) if observed is None else observed.astype(bool),
        joints=joints,
        R_world_root=None if root_orient is None else rotvec_to_rotmat(root_orient),
        contacts=optional("contacts", (n, 4)),
        bbox_xyxy=bbox,
        body=body,
    )


def pose2sim_sequence(arrays: Arrays) -> MotionSequence:
    """A Pose2Sim truth as a sequence: one person, y up, world-to-camera extrinsics, NaN where not triangulated."""
    joint_names = _joint_names(arrays)
    joints = numbers(arrays, "joints3d", (None, len(joint_names), 3)) @ R_ZUP_YUP.T
    num_frames = len(joints)
    extrinsics = rotations(arrays, "R_world2cam", (num_frames, 3, 3)), numbers(arrays, "t_world2cam", (num_frames, 3))
    cameras = CameraSequence(*zup_camera_pose(*extrinsics), numbers(arrays, "K", (num_frames, 3, 3)))
    frame = np.arange(num_frames)
    person = PersonSequence(
        person=0,
        frame=frame,
        observed=np.isfinite(pick(joints, joint_names, LIMB_NAMES)).all(axis=(1, 2)),
        joints=joints,
        bbox_xyxy=projected_boxes(joints, frame, cameras),
    )
    transitions = tuple((cut, cut) for cut in _cut_frames(arrays, num_frames))
    return MotionSequence(num_frames, _fps(arrays), joint_names, (person,), transitions, cameras)
