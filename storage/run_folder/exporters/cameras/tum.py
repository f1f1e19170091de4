"""Trajectories in TUM's format, which evo reads: one file a shot, a line a frame, camera to world.

`time_s tx ty tz qx qy qz qw`; camera axes are x right, y down, z forward. cameras.json beside them has what the format
has no place for: the span of each shot, its K, and how the camera was found.
"""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotmat_to_unitquat_wxyz
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.camera import SOURCES


def tum_files(excerpt: Excerpt) -> Mapping[str, Callable[[Path], None]]:
    """shot_000.tum, …, cameras.json, and what writes each."""
    files: dict[str, Callable[[Path], None]] = {}
    for frames in excerpt.shots():
        shot = int(excerpt.recording.shot_index[frames.start])
        files[f"shot_{shot:03d}.tum"] = partial(_write_trajectory, excerpt, frames)
    return {**files, "cameras.json": partial(_write_facts, excerpt)}


def write_trajectory(
    path: Path, time_s: Float[np.ndarray, " n"], R: Float[np.ndarray, "n 3 3"], t: Float[np.ndarray, "n 3"]
) -> None:
    """A line for each of n frames; R and t are camera to world."""
    wxyz = rotmat_to_unitquat_wxyz(R.astype(np.float64))
    np.savetxt(path, np.column_stack([time_s, t, wxyz[:, 1:], wxyz[:, 0]]), fmt="%.9f")


def focal_lengths(K: Float[np.ndarray, "n 3 3"]) -> float | list[float]:
    """In pixels: one, or of a camera that zooms one a frame."""
    return K[:, 1, 1].tolist() if np.ptp(K[:, 1, 1]) > 0 else float(K[0, 1, 1])


def _write_trajectory(excerpt: Excerpt, frames: slice, path: Path) -> None:
    recording = excerpt.recording
    R = excerpt.R_file_world @ recording.R_world_cam[frames].astype(np.float64)
    write_trajectory(path, recording.time_s[frames], R, excerpt.points(recording.t_world_cam[frames]))


def _write_facts(excerpt: Excerpt, path: Path) -> None:
    recording = excerpt.recording

    def facts(frames: slice) -> dict[str, Any]:
        K = recording.K[frames]
        return {
            "file": f"shot_{int(recording.shot_index[frames.start]):03d}.tum",
            "start": int(excerpt.source_frame[frames.start]),
            "end": int(excerpt.source_frame[frames.stop - 1]) + 1,
            "source": SOURCES[int(recording.camera_source[frames.start])],
            "K": K[0].tolist(),
            "focal_px": focal_lengths(K),
        }

    tree = {
        "width": recording.width, "height": recording.height, "up": excerpt.up, "unit": excerpt.unit,
        "shots": [facts(frames) for frames in excerpt.shots()],
    }  # fmt: skip
    path.write_text(json.dumps(tree, indent=1) + "\n", encoding="utf-8")
