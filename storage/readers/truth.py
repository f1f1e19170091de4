"""Reads what an evaluation compares: run folders, npz truths with motion.zarr's array names, and Pose2Sim truths.

Files come from strangers (see `humanmm.storage.readers.archives`): whatever is wrong is one TruthError in one sentence.
"""

import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.evaluation.truth import contract_sequence, pose2sim_sequence
from humanmm.models.records.foreign_arrays import shown, whole_numbers
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.archives import NpzArrays, ZarrArrays, damage
from humanmm.storage.run_folder.run_record import read_run_record

MAX_JSON_BYTES = 64 * 2**20


def read_sequence(path: Path) -> MotionSequence:
    """The sequence in a run folder, a motion.zarr or an npz truth. Raises TruthError."""
    try:
        with damage("cannot be read as a run folder or truth: it is damaged"):
            return _read(path)
    except InputError as error:
        raise TruthError(f"{path}: {error}") from error
    except OSError as error:
        raise TruthError(f"{path}: cannot be read as a run folder or truth ({error.strerror or 'damaged'})") from error


def read_truth(path: Path, run: Path) -> MotionSequence:
    """The truth of a run, its cameras and boxes in the run's square pixels. Raises TruthError.

    An npz truth that gives the size of the stored pictures as its own was made in pixels that are not square.
    """
    truth, sizes = read_sequence(path), _sizes_of(run)
    if path.is_dir() or sizes is None or sizes.coded == sizes.square or _size_in(path) != sizes.coded:
        return truth
    cameras, factor = truth.cameras, np.tile(sizes.to_square, 2)
    if cameras is not None:
        cameras = replace(cameras, K=sizes.squared(cameras.K, sizes.coded))
    people = tuple(
        one if one.bbox_xyxy is None else replace(one, bbox_xyxy=one.bbox_xyxy * factor) for one in truth.people
    )
    return replace(truth, cameras=cameras, people=people)


def _sizes_of(run: Path) -> PictureSizes | None:
    """Of the pictures of a run's video, as run.json has them; None where it does not say."""
    try:
        video = read_run_record(run)["video"]
        square, coded = ((int(video[width]), int(video[height])) for width, height in _SIDES)
        turned = int(video["rotation_deg"]) in (90, 270)
    except (InputError, KeyError, TypeError, ValueError):
        return None
    return PictureSizes(square, coded[::-1] if turned else coded)


_SIDES = (("width", "height"), ("coded_width", "coded_height"))


def _size_in(path: Path) -> tuple[int, int] | None:
    """Width and height that an npz truth gives; None where it gives none."""
    try:
        with damage("cannot be read as a truth: it is damaged"):
            width, height = (int(whole_numbers(NpzArrays(path), name, ())) for name in _SIDES[0])
    except InputError:
        return None
    return width, height


def read_boxes(path: Path, num_frames: int) -> dict[str, np.ndarray] | None:
    """By name, the box (num_frames, 4) of everybody in an npz truth, passers-by too; NaN where nobody set one.

    Source pixels, xyxy. None where a truth has no boxes.
    """
    try:
        with damage("cannot be read as a truth: it is damaged"):
            arrays = NpzArrays(path)
            names = [key.removesuffix("/bbox") for key in arrays if key.endswith("/bbox")]
            found = {}
            for name in names:
                frame = arrays[f"{name}/frame"]
                inside = (frame >= 0) & (frame < num_frames)
                found[name] = np.full((num_frames, 4), np.nan)
                found[name][frame[inside]] = arrays[f"{name}/bbox"][inside]
            return found or None
    except InputError as error:
        raise TruthError(f"{path}: {error}") from error


def _read(path: Path) -> MotionSequence:
    if path.is_dir():
        for group in (path / "motion.zarr", path):
            if (group / "zarr.json").is_file():
                return contract_sequence(ZarrArrays(group), transitions=_transitions(path / "run.json"))
        raise TruthError("neither a run folder nor a motion.zarr; expected motion.zarr/zarr.json in it")
    if not path.is_file():
        raise TruthError("does not exist; expected a run folder or an .npz truth")
    if not zipfile.is_zipfile(path):
        raise TruthError("not an .npz file; expected a run folder or an .npz truth")
    arrays = NpzArrays(path)
    if "joints3d" in arrays and "R_world2cam" in arrays:
        return pose2sim_sequence(arrays)
    if "num_frames" in arrays and "cut_frames" in arrays:
        return contract_sequence(arrays)
    raise TruthError(
        "no truth: expected motion.zarr's array names (num_frames, cut_frames, people/00/joints, …) or Pose2Sim's "
        f"(joints3d, R_world2cam, …), found {', '.join(map(shown, sorted(arrays)[:6])) or 'nothing'}"
    )


def _transitions(run_json: Path) -> tuple[tuple[int, int], ...] | None:
    """[start, end) of every change of shot as run.json has them; None where there is no run.json."""
    if not run_json.is_file():
        return None
    if run_json.stat().st_size > MAX_JSON_BYTES:
        raise TruthError(f"{run_json.name} is larger than {MAX_JSON_BYTES:,} bytes")
    try:
        tree = json.loads(run_json.read_text(encoding="utf-8", errors="surrogateescape"))
    except (ValueError, RecursionError):
        raise TruthError(f"{run_json.name} is not json, or holds lists in lists without end") from None
    shots = tree.get("shots") if isinstance(tree, dict) else None
    if not isinstance(shots, list):
        raise TruthError(f"{run_json.name} has no list of shots")
    return tuple(_change(shot, number) for number, shot in enumerate(shots) if number > 0)


def _change(shot: Any, number: int) -> tuple[int, int]:
    """[start, end) of the change before a shot."""
    where = f"shot {number} of run.json"
    if not isinstance(shot, dict):
        raise TruthError(f"{where} is no table with a start")
    change = shot.get("transition") or {"start": shot.get("start"), "end": shot.get("start")}
    start, end = (change.get(name) for name in ("start", "end")) if isinstance(change, dict) else (None, None)
    if type(start) is not int or type(end) is not int or min(start, end) < 0:
        raise TruthError(f"{where} has no whole frame numbers where it begins")
    return start, end
