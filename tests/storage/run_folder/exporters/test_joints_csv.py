"""Joints for spreadsheets."""

import csv
from pathlib import Path

import numpy as np
import two_people

from humanmm.models.motion.excerpt import Wishes
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.exporters import export


def test_csv_holds_every_joint_of_every_frame(tmp_path: Path, recording: Recording) -> None:
    with export(recording, tmp_path, "csv")[1].open(newline="") as file:
        rows = list(csv.DictReader(file))
    person = recording.people[1]
    xyz = np.array([[float(row[axis]) for axis in ("x_m", "y_m", "z_m")] for row in rows]).reshape(-1, 24, 3)
    np.testing.assert_allclose(xyz, person.joints, atol=1e-5)
    assert [int(row["frame"]) for row in rows[::24]] == person.frame.tolist()


def test_csv_names_its_unit_and_the_frames_of_the_video_at_another_rate(tmp_path: Path) -> None:
    recording = two_people.recording()
    wishes = Wishes(fps=10.0, unit="cm", up="y", people=(1,))
    with export(recording, tmp_path, "csv", wishes=wishes)[0].open(newline="") as file:
        rows = list(csv.DictReader(file))[::24]
    assert list(rows[0])[-3:] == ["x_cm", "y_cm", "z_cm"]
    for row in rows:
        frame = int(row["frame"])
        assert frame == np.argmin(np.abs(recording.time_s - float(row["time_s"])))
        assert row["shot"] == str(int(recording.shot_index[frame]))
    heights = [
        np.interp(float(row["time_s"]), recording.time_s[5:-5], recording.people[1].pelvis[:, 2]) for row in rows
    ]
    np.testing.assert_allclose([float(row["y_cm"]) for row in rows], 100 * np.array(heights), atol=0.01)


def test_ntsc_video_at_30_hz_has_every_frame_once(tmp_path: Path) -> None:
    recording = two_people.recording(fps=30000 / 1001)
    with export(recording, tmp_path, "csv", wishes=Wishes(fps=30.0))[0].open(newline="") as file:
        frames = [int(row["frame"]) for row in csv.DictReader(file)]
    assert frames[::24] == list(range(40))
