"""Trajectories, read again by evo."""

import json
from pathlib import Path

import numpy as np
import pytest
import two_people

from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


def test_evo_reads_the_trajectory_of_each_shot(tmp_path: Path) -> None:
    file_interface = pytest.importorskip("evo.tools.file_interface")
    paths = export(RECORDING, tmp_path, "tum")
    assert [path.name for path in paths] == ["shot_000.tum", "shot_001.tum", "cameras.json"]
    for path, frames in zip(paths, (slice(0, two_people.CUT), slice(two_people.CUT, 40)), strict=False):
        trajectory = file_interface.read_tum_trajectory_file(path)
        np.testing.assert_allclose(trajectory.positions_xyz, RECORDING.t_world_cam[frames], atol=1e-6)
        np.testing.assert_allclose(trajectory.timestamps, RECORDING.time_s[frames], atol=1e-8)
        R = np.stack([pose[:3, :3] for pose in trajectory.poses_se3])
        np.testing.assert_allclose(R, RECORDING.R_world_cam[frames], atol=1e-6)


def test_the_facts_beside_them_have_the_span_and_the_lens(tmp_path: Path) -> None:
    facts = json.loads(export(RECORDING, tmp_path, "tum")[-1].read_text())
    first, second = facts["shots"]
    assert (first["start"], first["end"], first["source"], first["focal_px"]) == (0, 25, "tracked", 1100.0)
    assert (second["start"], second["end"], second["source"], len(second["focal_px"])) == (25, 40, "static", 15)
    assert facts["width"] == 1280 and second["K"][0][2] == 640
