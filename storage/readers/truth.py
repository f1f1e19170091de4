"""Reads what an evaluation compares: run folders, npz truths with motion.zarr's array names, and Pose2Sim truths.

Files come from strangers: no pickles, no array larger than a limit is ever allocated, and whatever is wrong is one
TruthError in one sentence.
"""

import json
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.errors import BaseZarrError

from humanmm.errors import TruthError
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.evaluation.skeleton import LIMB_NAMES, SMPL_NAMES, pick
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence

MAX_ARRAY_BYTES = 2**30
"""One array of an hour of video at 60 fps stays below this."""

MAX_FRAMES = 2_000_000
MAX_JSON_BYTES = 64 * 2**20

R_ZUP_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""World axes of a y-up truth to our z-up ones."""

Arrays = Mapping[str, np.ndarray]


def read_sequence(path: Path) -> MotionSequence:
    """The sequence in a run folder, a motion.zarr or an npz truth. Raises TruthError."""
    try:
        return _read(path)
    except TruthError as error:
        raise TruthError(f"{path}: {error}") from error
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error, BaseZarrError) as error:
        raise TruthError(f"{path}: cannot be read as a run folder or truth ({_first_line(error)})") from error


def _read(path: Path) -> MotionSequence:
    if path.is_dir():
        for group in (path / "motion.zarr", path):
            if (group / "zarr.json").is_file():
                return _contract_sequence(_ZarrArrays(group), transitions=_transitions(path / "run.json"))
        raise TruthError("neither a run folder nor a motion.zarr; expected motion.zarr/zarr.json in it")
    if not path.is_file():
        raise TruthError("does not exist; expected a run folder or an .npz truth")
    if not zipfile.is_zipfile(path):
        raise TruthError("not an .npz file; expected a run folder or an .npz truth")
    arrays = NpzArrays(path)
    if "joints3d" in arrays and "R_world2cam" in arrays:
        return _pose2sim_sequence(arrays)
    if "num_frames" in arrays and "cut_frames" in arrays:
        return _contract_sequence(arrays, transitions=_spans(arrays))
    raise TruthError(
        "no truth: expected motion.zarr's array names (num_frames, cut_frames, people/00/joints, …) or Pose2Sim's "
        f"(joints3d, R_world2cam, …), found {', '.join(sorted(arrays)[:6]) or 'nothing'}"
    )


class NpzArrays(Mapping[str, np.ndarray]):
    """The arrays of an npz by name, each read when asked for, after its header was looked at."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with zipfile.ZipFile(path) as file:
            self._names = {name.removesuffix(".npy"): name for name in file.namelist() if name.endswith(".npy")}

    def __getitem__(self, key: str) -> np.ndarray:
        with zipfile.ZipFile(self._path) as file, file.open(self._names[key]) as member:
            version = np.lib.format.read_magic(member)
            if version == (1, 0):
                shape, _, dtype = np.lib.format.read_array_header_1_0(member)
            else:
                shape, _, dtype = np.lib.format.read_array_header_2_0(member)
            _check_size(key, shape, dtype)
            member.seek(0)
            return np.asarray(np.lib.format.read_array(member, allow_pickle=False))

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class _ZarrArrays(Mapping[str, np.ndarray]):
    """The arrays and attributes of a motion.zarr by name, as an npz truth has them."""

    def __init__(self, path: Path) -> None:
        self._group = zarr.open_group(path, mode="r")
        self._attributes = dict(self._group.attrs)
        people = self._group.get("people")
        prefixes = [f"people/{name}" for name in sorted(people.group_keys())] if isinstance(people, zarr.Group) else []
        self._arrays = [key for prefix in ("", "cameras", *prefixes) for key in _keys(self._group, prefix)]

    def __getitem__(self, key: str) -> np.ndarray:
        if key in self._attributes:
            return np.asarray(self._attributes[key])
        array = self._group[key]
        if not isinstance(array, zarr.Array):
            raise TruthError(f"{key} is a group, expected an array")
        _check_size(key, array.shape, array.dtype)
        _check_size(f"a chunk of {key}", array.chunks, array.dtype)
        return np.asarray(array[...])

    def __iter__(self) -> Iterator[str]:
        return iter([*self._attributes, *self._arrays])

    def __len__(self) -> int:
        return len(self._attributes) + len(self._arrays)


def _keys(group: zarr.Group, prefix: str) -> list[str]:
    child = group.get(prefix) if prefix else group
    return [f"{prefix}/{key}".lstrip("/") for key in child.array_keys()] if isinstance(child, zarr.Group) else []


def _check_size(key: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    if dtype.hasobject:
        raise TruthError(f"{key} holds Python objects; expected plain numbers or names (no pickles)")
    size = math.prod(shape) * dtype.itemsize
    if size > MAX_ARRAY_BYTES:
        raise TruthError(f"{key} claims {size:,} bytes; expected at most {MAX_ARRAY_BYTES:,}")


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


def _transitions(run_json: Path) -> tuple[tuple[int, int], ...] | None:
    """[start, end) of every change of shot as run.json tells them; None where there is no run.json."""
    if not run_json.is_file():
        return None
    if run_json.stat().st_size > MAX_JSON_BYTES:
        raise TruthError(f"{run_json.name} is larger than {MAX_JSON_BYTES:,} bytes")
    shots = json.loads(run_json.read_text(encoding="utf-8"))["shots"]
    spans = []
    for shot in shots[1:]:
        transition = shot.get("transition") or {"start": shot["start"], "end": shot["start"]}
        spans.append((int(transition["start"]), int(transition["end"])))
    return tuple(spans)


def _spans(arrays: Arrays) -> tuple[tuple[int, int], ...] | None:
    """[start, end) of every change of shot as an npz truth tells them; None where it names cuts alone."""
    if "transitions" not in arrays:
        return None
    return tuple((int(start), int(end)) for start, end in _shaped(arrays, "transitions", (None, 2)))


def _contract_sequence(arrays: Arrays, *, transitions: tuple[tuple[int, int], ...] | None) -> MotionSequence:
    """A sequence from motion.zarr's array names and attributes."""
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


def _pose2sim_sequence(arrays: Arrays) -> MotionSequence:
    """A Pose2Sim truth as a sequence: one person, y up, world-to-camera extrinsics, NaN where not triangulated."""
    joint_names = tuple(str(name) for name in _need(arrays, "joint_names"))
    joints = _shaped(arrays, "joints3d", (None, len(joint_names), 3)) @ R_ZUP_YUP.T
    num_frames = len(joints)
    R_world_cam = R_ZUP_YUP @ np.swapaxes(_shaped(arrays, "R_world2cam", (num_frames, 3, 3)), 1, 2)
    t_cam_world = _shaped(arrays, "t_world2cam", (num_frames, 3))
    cameras = CameraSequence(
        R_world_cam=R_world_cam,
        t_world_cam=-(R_world_cam @ t_cam_world[..., None])[..., 0],
        K=_shaped(arrays, "K", (num_frames, 3, 3)),
    )
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
