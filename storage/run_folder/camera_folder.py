"""The folder of `humanmm camera`: a TUM trajectory for each shot, and cameras.json with what that has no place for."""

import json
import math
import re
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from humanmm.errors import InputError
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.exporters.cameras.tum import focal_lengths, write_trajectory
from humanmm.storage.run_folder.run_record import coded_picture

FACTS = "cameras.json"
OURS = r"cameras\.json|shot_\d+\.tum"


def write_camera_folder(
    folder: Path,
    facts: VideoFacts,
    shots: ShotList,
    intrinsics: Intrinsics,
    cameras: Sequence[ShotCamera],
    *,
    force: bool,
) -> None:
    """Write `folder` as a whole or not at all; without `force` one that is there is left alone.

    Each shot is in the axes of its own first camera (x right, y down, z forward), `shot_000.tum` is camera to shot.
    Raises InputError if the folder is there, or cannot be written.
    """
    check_camera_folder(folder, force=force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as scratch:
            new = Path(scratch) / "new"
            new.mkdir()
            for number, camera in enumerate(cameras):
                time_s = facts.time_s[camera.start : camera.end]
                write_trajectory(new / _file(number), time_s, camera.R_shot_cam, camera.t_shot_cam)
            tree = _facts(facts, shots, intrinsics, cameras)
            (new / FACTS).write_text(json.dumps(tree, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            if folder.exists():
                shutil.rmtree(folder)
            new.rename(folder)
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror or error}") from error


def check_camera_folder(folder: Path, *, force: bool) -> None:
    """InputError if the folder may not be written: to be called before anything is computed, too."""
    if not folder.exists():
        return
    if not force:
        raise InputError(f"{folder} is there already; --force replaces it")
    if not folder.is_dir() or not all(re.fullmatch(OURS, entry.name) for entry in folder.iterdir()):
        raise InputError(f"{folder} holds other things than cameras, and is not replaced")


def _file(number: int) -> str:
    return f"shot_{number:03d}.tum"


def _facts(facts: VideoFacts, shots: ShotList, intrinsics: Intrinsics, cameras: Sequence[ShotCamera]) -> dict[str, Any]:
    return {
        "width": facts.width, "height": facts.height, **coded_picture(facts), "num_frames": facts.num_frames,
        "focal": {
            "px": intrinsics.focal_px, "source": intrinsics.source,
            "relative_uncertainty": intrinsics.relative_uncertainty, "distortion": intrinsics.distortion,
        },
        "shots": [_of_shot(number, camera) for number, camera in enumerate(cameras)],
        "warnings": [*facts.warnings, *shots.warnings, *intrinsics.warnings],
    }  # fmt: skip


def _of_shot(number: int, camera: ShotCamera) -> dict[str, Any]:
    return {
        "file": _file(number), "start": camera.start, "end": camera.end, "K": camera.K[0].tolist(),
        "focal_px": focal_lengths(camera.K), "source": camera.source, "metric": camera.metric,
        "reprojection_px": _number(camera.reprojection_px),
        "cross_check": {name: _number(value) for name, value in asdict(camera.cross_check).items()},
        "warnings": list(camera.warnings),
    }  # fmt: skip


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
