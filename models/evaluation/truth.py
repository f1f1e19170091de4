"""Sequences from the arrays of a run folder, of a truth with motion.zarr's names, or of a Pose2Sim truth.

The arrays may come from strangers: whatever is wrong with them is one TruthError in one sentence.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from humanmm.errors import TruthError
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.evaluation.skeleton import LIMB_NAMES, SMPL_NAMES, pick
from humanmm.models.geometry.axes import R_ZUP_YUP, zup_camera_pose
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence

MAX_FRAMES = 2_000_000

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
    num_frames = int(_need(arrays, "num_frames"))
    if not 0 < num_frames <= MAX_FRAMES:
        raise TruthError(f"num_frames is {num_frames}; expected 1 to {MAX_FRAMES}")
    fps = float(_need(arrays, "fps"))
    if not (np.isfinite(fps) and fps > 0) and num_frames > 1:
        raise TruthError(f"fps is {fps}; expected a positive number")
    cut_frames = tuple(int(cut) for cut in np.atleast_1d(_need(arrays, "cut_frames")).ravel())
    if list(cut_frames) != sorted(set(cut_frames)) or any(not 0 < cut < num_frames for cut in cut_frames):
        raise TruthError(f"cut_frames are {cut_frames}; expected rising frame numbers between 1 and {num_frames - 1}")
    spans = tuple((cut, cut) for cut in cut_frames)
    if transitions is None and "transitions" in arrays:
        transitions = tuple((int(start), int(end)) for start, end in _shaped(arrays, "transitions", (None, 2)))
    if transitions is not None:
        if tuple((start + end) // 2 for start, end in transitions) != cut_frames:
            raise TruthError(f"the transitions {transitions} disagree with the cuts {cut_frames}")
        spans = transitions
    joint_names = tuple(str(name) for name in arrays["joint_names"]) if "joint_names" in arrays else SMPL_NAMES
    cameras = _contract_cameras(arrays, num_frames)
    keys = [key.split("/") for key in arrays]
    numbers = sorted(int(key[1]) for key in keys if len(key) == 3 and key[0] == "people" and key[2] == "joints")
    model = str(arrays["body_model"]) if "body_model" in arrays else ""
    people = tuple(
        _contract_person(arrays, number, num_frames=num_frames, joint_names=joint_names, model=model, cameras=cameras)
        for number in numbers
    )
    return MotionSequence(num_frames, fps or 1.0, joint_names, people, spans, cameras)


def _contract_cameras(arrays: Arrays, num_frames: int) -> CameraSequence | None:
    keys = ("cameras/R_world_cam", "cameras/t_world_cam", "cameras/K")
    if not all(key in arrays for key in keys):
        return None
    shapes = ((num_frames, 3, 3), (num_frames, 3), (num_frames, 3, 3))
    return CameraSequence(*(_shaped(arrays, key, shape) for key, shape in zip(keys, shapes, strict=True)))


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
    joints = _shaped(arrays, f"{prefix}/joints", (None, len(joint_names), 3))
    n = len(joints)
    frame = np.arange(n)
    if f"{prefix}/frame" in arrays:
        frame = _shaped(arrays, f"{prefix}/frame", (n,)).astype(np.int64)
    if n and (frame[0] < 0 or frame[-1] >= num_frames or (np.diff(frame) <= 0).any()):
        raise TruthError(f"{prefix}/frame does not rise strictly between 0 and {num_frames - 1}")

    def optional(name: str, shape: tuple[int, ...]) -> np.ndarray | None:
        key = f"{prefix}/{name}"
        return _shaped(arrays, key, shape) if key in arrays else None

    observed = optional("observed", (n,))
    root_orient = optional("root_orient", (n, 3))
    parts = (root_orient, optional("body_pose", (n, 23, 3)), optional("betas", (10,)), optional("transl", (n, 3)))
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
    joint_names = tuple(str(name) for name in _need(arrays, "joint_names"))
    joints = _shaped(arrays, "joints3d", (None, len(joint_names), 3)) @ R_ZUP_YUP.T
    num_frames = len(joints)
    extrinsics = _shaped(arrays, "R_world2cam", (num_frames, 3, 3)), _shaped(arrays, "t_world2cam", (num_frames, 3))
    cameras = CameraSequence(*zup_camera_pose(*extrinsics), _shaped(arrays, "K", (num_frames, 3, 3)))
    frame = np.arange(num_frames)
    person = PersonSequence(
        person=0,
        frame=frame,
        observed=np.isfinite(pick(joints, joint_names, LIMB_NAMES)).all(axis=(1, 2)),
        joints=joints,
        bbox_xyxy=projected_boxes(joints, frame, cameras),
    )
    cut_frames = tuple(int(cut) for cut in np.atleast_1d(_need(arrays, "cut_frames")))
    transitions = tuple((cut, cut) for cut in cut_frames)
    return MotionSequence(num_frames, float(_need(arrays, "fps")), joint_names, (person,), transitions, cameras)


def _need(arrays: Arrays, key: str) -> np.ndarray:
    if key not in arrays:
        raise TruthError(f"lacks {key}")
    return arrays[key]


def _shaped(arrays: Arrays, key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """The array as float64, its shape checked; None in `shape` stands for any length up to the frame limit."""
    array = _need(arrays, key)
    fits = len(array.shape) == len(shape)
    fits = fits and all(want in (None, have) for have, want in zip(array.shape, shape, strict=True))
    if not fits or len(array) > MAX_FRAMES:
        wanted = "×".join("N" if side is None else str(side) for side in shape)
        raise TruthError(f"{key} has shape {'×'.join(map(str, array.shape))}; expected {wanted}")
    if array.dtype.kind not in "fiub":
        raise TruthError(f"{key} has type {array.dtype}; expected numbers")
    return array.astype(np.float64)
