"""Blender opens what we export, and finds the joints within 1 mm and the camera's view within 1 pixel.

`$HUMANMM_BPY` names a Python that can import bpy (pip install bpy, for Python 3.11); this one is tried otherwise.
"""

import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import two_people

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.exporters import export

pytestmark = pytest.mark.slow
RECORDING = two_people.recording(fps=29.97)
PORTRAIT = dataclasses.replace(RECORDING, width=720, height=1280, K=RECORDING.K[:, [1, 0, 2]][:, :, [1, 0, 2]])
FRAMES = (0, 6, 24, 25, 33)
SCRIPT = Path(__file__).with_name("in_blender.py")


@pytest.fixture
def bpy_python(monkeypatch: pytest.MonkeyPatch) -> str:
    """A Python that can import bpy."""
    python = os.environ.get("HUMANMM_BPY") or (sys.executable if importlib.util.find_spec("bpy") else "")
    if not python:
        pytest.skip("bpy is not installed: pip install bpy in a Python 3.11, and name that in $HUMANMM_BPY")
    monkeypatch.setenv("HUMANMM_BLENDER", python)  # it writes fbx
    return python


Frames = Callable[[int], float]
"""Blender's frame of a frame of the video."""


def timed(row: int) -> float:
    """A file that knows seconds: 29.97 Hz in a scene of 30, from frame 0 on."""
    return float(RECORDING.time_s[row] * 30)


def timed_from_1(row: int) -> float:
    """The same where Blender begins at 1."""
    return 1 + timed(row)


def counted(first: int) -> Frames:
    """A file that knows frames alone."""
    return lambda row: float(row + first)


def opened(
    python: str, file: Path, frames: Frames, *, rows: tuple[int, ...] = FRAMES, recording: Recording = RECORDING
) -> dict[str, Any]:
    """What Blender has of a file in some frames of the video."""
    out = file.with_suffix(".json")
    asked = ",".join(str(frames(row)) for row in rows)
    width, height = (str(side) for side in (recording.width, recording.height))
    command = [python, str(SCRIPT), str(file), "30", width, height, asked, str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found: dict[str, Any] = json.loads(out.read_text())
    return found


def worst_joint_mm(found: dict[str, Any], number: int, frames: Frames, rows: tuple[int, ...] = FRAMES) -> float:
    """The largest distance of a joint in Blender from the run's, over the frames in which the person is there."""
    person, worst = RECORDING.people[number], 0.0
    for row in rows:
        here = row - int(person.frame[0])
        if 0 <= here < len(person.frame):
            bones = found["people"][f"person_{number:02d}"][str(frames(row))]
            by_name = {name.split("/")[-1].split("_Pelvis")[-1]: place for name, place in bones.items()}
            joints = np.array([by_name.get(name) or _ending(bones, name) for name in JOINT_NAMES])
            worst = max(worst, float(np.abs(joints - person.joints[here]).max()) * 1000)
    return worst


def _ending(bones: dict[str, Any], name: str) -> Any:
    """USD's bones have the names of all their parents in theirs."""
    (found,) = (place for bone, place in bones.items() if bone.replace("/", "_").endswith(name))
    return found


def worst_pixel(found: dict[str, Any], frames: Frames, recording: Recording = RECORDING) -> float:
    """The largest distance, in pixels, between a joint's place in the view of a camera in Blender and in ours."""
    worst = 0.0
    for row in FRAMES:
        shot = int(recording.shot_index[row])
        (name,) = (name for name in found["cameras"] if name.startswith(f"camera_shot_{shot:03d}"))
        view = np.array(found["cameras"][name][str(frames(row))])
        points = recording.people[0].joints[row].astype(float)
        clip = np.concatenate([points, np.ones((24, 1))], axis=1) @ view.T
        half = np.array([recording.width, recording.height]) / 2
        pixels = half * (1 + clip[:, :2] / clip[:, 3:] * (1, -1))
        cam = (points - recording.t_world_cam[row]) @ recording.R_world_cam[row] @ recording.K[row].T
        worst = max(worst, float(np.abs(pixels - cam[:, :2] / cam[:, 2:]).max()))
    return worst


@pytest.mark.parametrize(("name", "frames"), [("glb", timed), ("fbx", timed_from_1), ("usd", counted(0))])
def test_a_scene_has_all_people_and_cameras_where_they_are(
    tmp_path: Path, bpy_python: str, name: str, frames: Frames
) -> None:
    if name == "usd":
        pytest.importorskip("pxr", reason="pip install 'humanmm[usd]'")
    (file,) = export(RECORDING, tmp_path, name)
    found = opened(bpy_python, file, frames)
    assert worst_joint_mm(found, 0, frames) < 0.1
    assert worst_joint_mm(found, 1, frames) < 0.1
    assert worst_pixel(found, frames) < 0.1


@pytest.mark.parametrize(("name", "frames"), [("glb", timed), ("fbx", timed_from_1), ("blender", counted(1))])
def test_an_upright_picture_is_seen_as_it_is(tmp_path: Path, bpy_python: str, name: str, frames: Frames) -> None:
    (file,) = export(PORTRAIT, tmp_path, name)
    found = opened(bpy_python, file, frames, recording=PORTRAIT)
    assert worst_pixel(found, frames, PORTRAIT) < 0.1


def test_bvh_files_have_the_joints_of_their_people(tmp_path: Path, bpy_python: str) -> None:
    for person, file in zip(RECORDING.people, export(RECORDING, tmp_path, "bvh"), strict=True):
        frames = counted(1 - int(person.frame[0]))  # the file begins with the person
        found = opened(bpy_python, file, frames, rows=(6, 20, 33))
        assert worst_joint_mm(found, person.person, frames, rows=(6, 20, 33)) < 0.1


def test_the_script_makes_the_cameras_and_cuts_between_them(tmp_path: Path, bpy_python: str) -> None:
    (file,) = export(RECORDING, tmp_path, "blender")
    found = opened(bpy_python, file, counted(1))
    assert worst_pixel(found, counted(1)) < 0.1
    assert found["markers"] == [["camera_shot_000", 1, "camera_shot_000"], ["camera_shot_001", 26, "camera_shot_001"]]


def test_somebody_who_is_not_there_yet_is_a_point(tmp_path: Path, bpy_python: str) -> None:
    found = opened(bpy_python, export(RECORDING, tmp_path, "glb")[0], timed, rows=(2, 10))
    bones = np.array(list(found["people"]["person_01"][str(timed(2))].values()))
    assert np.ptp(bones, axis=0).max() < 1e-6
    assert np.ptp(np.array(list(found["people"]["person_01"][str(timed(10))].values())), axis=0).max() > 0.5
