"""The script that makes cameras in Blender. test_blender.py runs it."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import two_people

from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


def test_the_script_is_python_and_has_a_row_for_every_frame(tmp_path: Path) -> None:
    text = export(RECORDING, tmp_path, "blender")[0].read_text()
    ast.parse(text)
    scene = json.loads(re.search(r'r"""(.*?)"""', text).group(1))  # type: ignore[union-attr]
    assert scene["size_px"] == [1280, 720] and scene["fps"] == 29.97
    first, second = scene["shots"]
    assert (first["name"], first["first"], len(first["frames"])) == ("camera_shot_000", 1, 25)
    assert (second["name"], second["first"], len(second["frames"])) == ("camera_shot_001", 26, 15)
    np.testing.assert_allclose([row[:3] for row in second["frames"]], RECORDING.t_world_cam[25:], atol=1e-6)
    np.testing.assert_allclose([row[7] / 36 * 1280 for row in second["frames"]], RECORDING.K[25:, 0, 0], atol=1e-3)


def test_a_variable_rate_becomes_the_mean_one(tmp_path: Path) -> None:
    times = np.cumsum(np.random.default_rng(3).uniform(0.02, 0.05, 40))
    text = export(two_people.recording(time_s=times), tmp_path, "blender", wishes=Wishes(start_s=0.1))[0].read_text()
    assert '"num_frames": ' in text


def test_the_film_behind_the_cameras_shows_the_frames_of_the_excerpt(tmp_path: Path) -> None:
    def script(folder: str, wishes: Wishes) -> str:
        return export(RECORDING, tmp_path / folder, "blender", wishes=wishes)[0].read_text()

    start_s = float(RECORDING.time_s[9])
    assert '"film_start": 1,' in script("whole", Wishes())
    part = script("part", Wishes(start_s=start_s))
    assert '"film_start": -8,' in part, "the video's tenth frame is shown in frame 1"
    assert "the path of the video\n" in part and "ffmpeg" not in part
    faster = script("faster", Wishes(start_s=start_s, fps=60.0))
    assert "ffmpeg -i VIDEO -vf trim=start_frame=9,setpts=PTS-STARTPTS,fps=60 COPY\n" in faster
    assert '"film_start": 1,' in faster
