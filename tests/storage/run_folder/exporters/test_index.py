"""What exports.json tells of the files beside it."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import two_people

from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export
from humanmm.storage.run_folder.exporters.index import FILE, motion_digest, read_index, remove_stale
from humanmm.storage.run_folder.motion_zarr import read_motion, write_motion

RECORDING = two_people.recording()


def test_it_says_where_each_file_begins_in_the_video(tmp_path: Path) -> None:
    wishes = Wishes(start_s=float(RECORDING.time_s[3]))
    export(RECORDING, tmp_path, "bvh", wishes=wishes)
    export(RECORDING, tmp_path, "glb", wishes=Wishes(fps=60.0))
    files = read_index(tmp_path)
    assert list(files) == ["person_00.bvh", "person_01.bvh", "scene.glb"]
    facts = files["person_01.bvh"]
    assert (facts["format"], facts["up"], facts["unit"], facts["resampled"]) == ("bvh", "y", "cm", False)
    assert facts["cut_frames"] == [two_people.CUT - 3] and facts["first_video_frame"] == 3
    second = facts["people"][1]
    assert (second["first_frame"], second["first_video_frame"], second["num_frames"]) == (2, 5, 30)
    assert second["observed"] == [[2, 10], [14, 32]]
    assert files["scene.glb"]["fps"] == 60.0 and files["scene.glb"]["resampled"]


def test_a_motion_has_one_digest_before_and_after_it_was_written(tmp_path: Path) -> None:
    write_motion(tmp_path / "motion.zarr", RECORDING)
    assert motion_digest(read_motion(tmp_path / "motion.zarr")) == motion_digest(RECORDING)
    person = dataclasses.replace(RECORDING.people[0], joints=np.nextafter(RECORDING.people[0].joints, np.float32(9)))
    assert motion_digest(dataclasses.replace(RECORDING, people=(person,))) != motion_digest(RECORDING)


def test_an_index_that_is_no_index_or_names_files_elsewhere_removes_nothing(tmp_path: Path) -> None:
    folder, outside = tmp_path / "export", tmp_path / "mine.bvh"
    folder.mkdir()
    outside.write_text("mine")
    for text in ("not json", "[]", '{"files": 3}', json.dumps({"files": {"../mine.bvh": {"motion": "another"}}})):
        (folder / FILE).write_text(text)
        remove_stale(folder, RECORDING)
        assert outside.read_text() == "mine"
