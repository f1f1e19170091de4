"""What exports.json tells of the files beside it."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
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


def test_it_says_which_world_each_shot_and_person_is_of(tmp_path: Path) -> None:
    apart = dataclasses.replace(RECORDING, worlds=(0, 1))
    export(apart, tmp_path, "bvh", wishes=Wishes(start_s=float(RECORDING.time_s[3])))
    facts = read_index(tmp_path)["person_00.bvh"]
    assert facts["shots"] == [
        {"shot": 0, "frames": [0, two_people.CUT - 3], "video_frames": [3, two_people.CUT], "world": 0},
        {"shot": 1, "frames": [two_people.CUT - 3, 37], "video_frames": [two_people.CUT, 40], "world": 1},
    ]
    assert [person["world"] for person in facts["people"]] == [0, 0]
    later = Wishes(start_s=float(RECORDING.time_s[two_people.CUT]))
    export(apart, tmp_path, "bvh", wishes=later, force=True)
    facts = read_index(tmp_path)["person_00.bvh"]
    assert [shot["world"] for shot in facts["shots"]] == [1] and [one["world"] for one in facts["people"]] == [1, 1]


def test_naming_worlds_makes_no_other_motion() -> None:
    assert motion_digest(dataclasses.replace(RECORDING, worlds=(0, 1))) == motion_digest(RECORDING)


def test_a_motion_has_one_digest_before_and_after_it_was_written(tmp_path: Path) -> None:
    write_motion(tmp_path / "motion.zarr", RECORDING)
    assert motion_digest(read_motion(tmp_path / "motion.zarr")) == motion_digest(RECORDING)
    person = dataclasses.replace(RECORDING.people[0], joints=np.nextafter(RECORDING.people[0].joints, np.float32(9)))
    assert motion_digest(dataclasses.replace(RECORDING, people=(person,))) != motion_digest(RECORDING)


def test_exports_of_another_motion_are_removed_but_not_those_that_somebody_changed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    export(RECORDING, tmp_path, "bvh")
    export(RECORDING, tmp_path, "colmap")
    edited = tmp_path / "person_00.bvh"
    edited.write_text(edited.read_text() + "0 0 0\n")
    remove_stale(tmp_path, RECORDING)
    assert len(read_index(tmp_path)) > 2 and not caplog.messages, "they are of this motion"
    remove_stale(tmp_path, dataclasses.replace(RECORDING, people=RECORDING.people[:1]))
    assert list(tmp_path.iterdir()) == [edited], "no index: the file belongs to whoever changed it"
    assert "left exports of an earlier result" in caplog.text and "changed by somebody: person_00.bvh" in caplog.text


def test_an_index_that_is_no_index_or_names_files_elsewhere_removes_nothing(tmp_path: Path) -> None:
    folder, outside = tmp_path / "export", tmp_path / "mine.bvh"
    folder.mkdir()
    outside.write_text("mine")
    for text in ("not json", "[]", '{"files": 3}', json.dumps({"files": {"../mine.bvh": {"motion": "another"}}})):
        (folder / FILE).write_text(text)
        remove_stale(folder, RECORDING)
        assert outside.read_text() == "mine"
