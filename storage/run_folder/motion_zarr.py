"""The run folder, and its motion.zarr exactly as the public contract says (schema "humanmm.motion/1").

A zarr v3 group with crc32c on every array. It is written beside its final place and renamed into it, so that a reader
sees the old recording or the new one, never a half-written one.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import BytesCodec, Crc32cCodec, ZstdCodec

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES, PARENTS
from humanmm.models.body.fingers import FINGER_NAMES
from humanmm.models.motion.worlds import world_of_person
from humanmm.models.records.recording import Delivery, RecordedPerson, Recording
from humanmm.storage.run_folder.exporters import always_written, export
from humanmm.storage.run_folder.exporters.index import motion_digest, remove_stale
from humanmm.storage.store.files import copy_file, replace_folder, sweep

SCHEMA = "humanmm.motion/1"
MOTION = "motion.zarr"
ASKED_VIEWS = ("world.mp4", "side-by-side.mp4", "run.rrd")
"""What `humanmm view` writes into `view` on request, of the motion that is there then."""
EXPORT = "export"
WORLD = "z-up, metres, first person's first pelvis above the origin, floor at z=0"

_PERSON_ARRAYS: dict[str, str] = {
    "frame": "int32", "observed": "bool", "root_orient": "float32", "body_pose": "float32", "betas": "float32",
    "transl": "float32", "joints": "float32", "contacts": "float32", "keypoints2d": "float32", "bbox": "float32",
    "confidence": "float32",
}  # fmt: skip
_HAND_ARRAYS = {"hand_pose": "float32", "hand_confidence": "float32"}
"""Of runs with hands."""
_VIDEO_ARRAYS: dict[str, tuple[str, str]] = {
    "time_s": ("time_s", "float64"),
    "shot_index": ("shot_index", "int32"),
    "cameras/R_world_cam": ("R_world_cam", "float32"),
    "cameras/t_world_cam": ("t_world_cam", "float32"),
    "cameras/K": ("K", "float32"),
    "cameras/source": ("camera_source", "uint8"),
}


def write_run_folder(run_dir: Path, delivery: Delivery, blob_dir: Path) -> None:
    """Everything in a run folder but run.json, run.log and timeline.png, which the flow writes.

    `blob_dir` holds the delivery's pictures. Each file appears only when complete; AMASS files of people who are no
    longer in the recording go away, and so do exports and films of another recording.
    """
    sweep(run_dir)
    if not _holds(run_dir / MOTION, delivery.recording):
        for name in ASKED_VIEWS:
            (run_dir / "view" / name).unlink(missing_ok=True)
    for name in delivery.files:
        copy_file(blob_dir / name, run_dir / "view" / name)
    export_dir, recording = run_dir / EXPORT, delivery.recording
    anybody = any(len(person.frame) for person in recording.people)
    written = export(recording, export_dir, "amass", force=True) if anybody else ()
    for stale in set(always_written(export_dir)) - set(written):
        stale.unlink()
    remove_stale(export_dir, recording)
    write_motion(run_dir / MOTION, delivery.recording)


def _holds(path: Path, recording: Recording) -> bool:
    """Whether a motion.zarr holds this recording already."""
    try:
        return motion_digest(read_motion(path)) == motion_digest(recording)
    except InputError:
        return False


def write_motion(path: Path, recording: Recording) -> None:
    """Write motion.zarr at `path`, replacing an older one."""

    def fill(folder: Path) -> None:
        group = zarr.open_group(folder, mode="w", zarr_format=3)
        group.attrs.update(_attributes(recording))
        for key, (field, dtype) in _VIDEO_ARRAYS.items():
            _put(group, key, getattr(recording, field), dtype)
        for person in recording.people:
            name = f"people/{person.person:02d}"
            for field, dtype in _PERSON_ARRAYS.items():
                _put(group, f"{name}/{field}", getattr(person, field), dtype)
            if person.hand_pose is not None:
                for field, dtype in _HAND_ARRAYS.items():
                    _put(group, f"{name}/{field}", getattr(person, field), dtype)
                group[f"{name}/hand_pose"].attrs["joint_names"] = list(FINGER_NAMES)
            group[name].attrs["hands"] = person.hand_pose is not None
            group[name].attrs["probability"] = person.probability
            group[name].attrs["world"] = world_of_person(recording, person)
            array = group[f"{name}/keypoints2d"]
            array.attrs["keypoint_names"] = list(recording.keypoint_names)

    replace_folder(path, fill)


def read_motion(path: Path) -> Recording:
    """The recording in motion.zarr. Errors name the file and what is wrong with it."""
    if not (path / "zarr.json").is_file():
        raise InputError(f"{path} is no motion.zarr: it has no zarr.json; name a folder that `humanmm recover` wrote")
    try:
        group = zarr.open_group(path, mode="r")
    except ValueError as error:
        raise _damaged(path, error) from error
    schema = group.attrs.get("schema")
    if schema != SCHEMA:
        raise InputError(f"{path} has schema {schema!r}, this version reads {SCHEMA!r}")
    attributes = dict(group.attrs)
    try:
        numbers = _numbers(group)
        fields = {field: _get(group, key) for key, (field, _) in _VIDEO_ARRAYS.items()}
        people = tuple(
            RecordedPerson(
                person=n,
                **{field: _get(group, f"people/{n:02d}/{field}") for field in _PERSON_ARRAYS},
                **{field: _get(group, f"people/{n:02d}/{field}") for field in _hand_arrays(group, n)},
                probability=float(group[f"people/{n:02d}"].attrs.get("probability", 1.0)),  # type: ignore[arg-type]
            )
            for n in numbers
        )
        names = group[f"people/{numbers[0]:02d}/keypoints2d"].attrs["keypoint_names"] if numbers else ()
        return Recording(
            width=int(attributes["width"]),  # type: ignore[arg-type]
            height=int(attributes["height"]),  # type: ignore[arg-type]
            cut_frames=tuple(int(c) for c in attributes["cut_frames"]),  # type: ignore[union-attr, arg-type]
            people=people,
            body_model=str(attributes["body_model"]),
            keypoint_names=tuple(str(name) for name in names),  # type: ignore[union-attr]
            worlds=_worlds(attributes.get("shots", ())),
            **fields,
        )
    except (KeyError, ValueError) as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(f"{path} is damaged: {error}; `humanmm recover` writes it anew from the store")


def _numbers(group: zarr.Group) -> list[int]:
    """Of all people. An earlier version did not name them: there, those that are found."""
    named = group.attrs.get("people")
    if named is not None:
        return [int(number) for number in named]  # type: ignore[union-attr, arg-type]
    return sorted(int(name) for name in group["people"].group_keys()) if "people" in group else []  # type: ignore[union-attr]


def _worlds(shots: Any) -> tuple[int, ...]:
    """The world of each shot; empty where all are one, or no shot names its own."""
    worlds = tuple(int(shot["world"]) for shot in shots)
    return worlds if any(worlds) else ()


def _attributes(recording: Recording) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "fps": recording.fps,
        "width": recording.width,
        "height": recording.height,
        "num_frames": recording.num_frames,
        "world": WORLD,
        "body_model": recording.body_model,
        "people": sorted(person.person for person in recording.people),
        "joint_names": list(JOINT_NAMES),
        "parents": list(PARENTS),
        "cut_frames": list(recording.cut_frames),
        "shots": [
            {"start": start, "end": end, "world": recording.world_of_shot(shot)}
            for shot, (start, end) in enumerate(recording.shot_spans)
        ],
    }


def _put(group: zarr.Group, key: str, values: np.ndarray, dtype: str) -> None:
    array = np.ascontiguousarray(values, dtype=dtype)
    group.create_array(
        key,
        data=array,
        chunks=tuple(max(1, side) for side in array.shape),
        serializer=BytesCodec(endian="little" if array.dtype.itemsize > 1 else None),
        compressors=[ZstdCodec(level=3), Crc32cCodec()],
        config={"write_empty_chunks": True},  # so that a file that is missing is no array of zeros
    )


def _hand_arrays(group: zarr.Group, person: int) -> Iterable[str]:
    """Those that somebody has. An earlier version did not say who has hands: there, those that are found."""
    name = f"people/{person:02d}"
    found = [field for field in _HAND_ARRAYS if f"{name}/{field}" in group]
    hands = group[name].attrs.get("hands")
    return found if hands is None else (_HAND_ARRAYS if hands else ())


def _get(group: zarr.Group, key: str) -> np.ndarray:
    """One array. ValueError if files of it are missing, as after a copy that broke off: zarr reads zeros for them.

    An earlier version, which did not name the people, wrote no files for zeros: there it cannot be told.
    """
    array = group[key]
    if not isinstance(array, zarr.Array):
        raise ValueError(f"{key} is not an array")
    if "people" in group.attrs and array.nchunks_initialized != array.nchunks:
        raise ValueError(f"files of {key} are missing")
    return np.asarray(array[...])
