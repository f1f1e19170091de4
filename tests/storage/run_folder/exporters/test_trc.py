"""Markers for OpenSim and Pose2Sim."""

from pathlib import Path

import numpy as np
import two_people

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.motion.excerpt import Wishes
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.exporters import export


def test_trc_is_y_up_with_the_markers_of_the_joints(tmp_path: Path, recording: Recording) -> None:
    lines = export(recording, tmp_path, "trc")[0].read_text().splitlines()
    assert lines[0].split("\t")[3] == "person_00.trc"
    assert lines[2].split("\t")[2:5] == ["12", "24", "m"]
    assert lines[3].split("\t")[2::3][:24] == list(JOINT_NAMES)
    body = np.array([[float(value) for value in line.split("\t")] for line in lines[6:]])
    assert body.shape == (12, 2 + 72)
    xyz = body[:, 2:].reshape(12, 24, 3)
    expected = recording.people[0].joints
    np.testing.assert_allclose(np.stack([xyz[..., 0], -xyz[..., 2], xyz[..., 1]], -1), expected, atol=1e-5)


def test_frames_of_a_span_keep_their_numbers_and_those_of_another_rate_have_new_ones(tmp_path: Path) -> None:
    recording = two_people.recording()
    for fps, numbers in ((None, [11, 12, 13]), (60.0, [1, 2, 3])):
        wishes = Wishes(people=(0,), start_s=recording.time_s[10], fps=fps)
        lines = export(recording, tmp_path, "trc", wishes=wishes, force=True)[0].read_text().splitlines()
        assert [int(line.split("\t")[0]) for line in lines[6:9]] == numbers
        assert float(lines[6].split("\t")[1]) == round(recording.time_s[10], 6)
        assert lines[2].split("\t")[0] == ("60" if fps else "29.97")
