"""exports.json: what `humanmm export` wrote into a folder, of which motion, and where each file begins in the video.

Formats such as BVH have no place for that. And when another result takes the place of a motion, the exports of the
earlier one can be found and removed; files that somebody else laid there, or changed since, are not touched.
"""

import dataclasses
import hashlib
import json
import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.motion.worlds import world_of_person
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.storage.store.files import file_sha256, replace_text

log = logging.getLogger(__name__)
FILE = "exports.json"


def note(folder: Path, names: Iterable[str], facts: dict[str, Any]) -> None:
    """Add files of a folder to its exports.json, all with the same facts, each with the hash of its content."""
    known = read_index(folder)
    known.update({name: {**facts, "sha256": file_sha256(folder / name)} for name in names})
    _write(folder, known)


def facts_of(excerpt: Excerpt, recording: Recording, format_name: str) -> dict[str, Any]:
    """The entry of the files of one export. Frames of the video are counted from 0; spans are [start, end)."""
    part = excerpt.recording
    return {
        "format": format_name,
        "motion": motion_digest(recording),
        "fps": round(excerpt.fps, 6),
        "num_frames": part.num_frames,
        "start_s": round(float(part.time_s[0]), 6),
        "first_video_frame": int(excerpt.source_frame[0]),
        "resampled": excerpt.resampled,
        "up": excerpt.up,
        "unit": excerpt.unit,
        "cut_frames": list(part.cut_frames),
        "shots": [_shot(excerpt, frames) for frames in excerpt.shots()],
        "people": [_person(excerpt, person) for person in part.people],
    }


def _shot(excerpt: Excerpt, frames: slice) -> dict[str, Any]:
    shown = excerpt.source_frame[frames]
    return {
        "shot": excerpt.shot_of(frames),
        "frames": [frames.start, frames.stop],
        "video_frames": [int(shown[0]), int(shown[-1]) + 1],
        "world": excerpt.recording.world_of_shot(excerpt.shot_of(frames)),
    }


def _person(excerpt: Excerpt, person: RecordedPerson) -> dict[str, Any]:
    frame = person.frame
    return {
        "person": person.person,
        "world": world_of_person(excerpt.recording, person),
        "first_frame": int(frame[0]),
        "num_frames": len(frame),
        "first_video_frame": int(excerpt.source_frame[frame[0]]),
        "observed": [[int(frame[a]), int(frame[b - 1]) + 1] for a, b in runs_of_true(person.observed)],
        "probability": round(float(person.probability), 4),
    }


def remove_stale(folder: Path, recording: Recording) -> None:
    """Remove the exports of another motion than this one; those that were changed since stay, and are forgotten."""
    known = read_index(folder)
    if not known:
        return
    digest = motion_digest(recording)
    stale = [name for name, facts in known.items() if facts.get("motion") != digest]
    changed = [name for name in stale if (folder / name).exists() and not _is_as_written(folder / name, known[name])]
    removed = [name for name in stale if name not in changed]
    for name in removed:
        (folder / name).unlink(missing_ok=True)
        parent = (folder / name).parent
        if parent != folder and parent.is_dir() and not any(parent.iterdir()):
            parent.rmdir()
    if removed:
        log.warning("removed the exports of an earlier result from %s: %s", folder, ", ".join(sorted(removed)))
    if changed:
        names = ", ".join(sorted(changed))
        log.warning("left exports of an earlier result in %s, as they were changed by somebody: %s", folder, names)
    if stale:
        _write(folder, {name: facts for name, facts in known.items() if name not in stale})


def _is_as_written(path: Path, facts: dict[str, Any]) -> bool:
    return path.is_file() and file_sha256(path) == facts.get("sha256")


def read_index(folder: Path) -> dict[str, dict[str, Any]]:
    """File → facts; empty if there is no exports.json, or it is none of ours."""
    try:
        files = json.loads((folder / FILE).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    if not isinstance(files, dict):
        return {}
    inside = folder.resolve()
    return {
        name: facts
        for name, facts in files.items()
        if isinstance(facts, dict) and (folder / name).resolve().is_relative_to(inside) and name != FILE
    }


def motion_digest(recording: Recording) -> str:
    """sha256 of every number of a recording, at the precision of motion.zarr; which worlds they are of is no number."""
    total = hashlib.sha256()
    for field in dataclasses.fields(recording):
        if field.name not in ("people", "worlds"):
            _add(total, field.name, getattr(recording, field.name))
    for person in recording.people:
        for field in dataclasses.fields(person):
            _add(total, field.name, getattr(person, field.name))
    return total.hexdigest()


def _add(total: Any, name: str, value: Any) -> None:
    total.update(name.encode())
    if not isinstance(value, np.ndarray):
        total.update(repr(value).encode())
    elif value.dtype.kind == "f":
        total.update(np.ascontiguousarray(value, np.float64 if name == "time_s" else np.float32).tobytes())
    else:
        total.update(np.ascontiguousarray(value, np.int64).tobytes())


def _write(folder: Path, files: dict[str, dict[str, Any]]) -> None:
    if files:
        replace_text(folder / FILE, json.dumps({"files": dict(sorted(files.items()))}, indent=1) + "\n")
    else:
        (folder / FILE).unlink(missing_ok=True)
