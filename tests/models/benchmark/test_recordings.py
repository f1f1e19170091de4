"""Truths of data sets' videos, and how a performance is cut: repeatable, no camera twice in a row."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import ImageRecording, MultiviewSequence, cut_in_turns, cut_performance
from humanmm.models.evaluation.truth import contract_sequence

F, C = 240, 4
SEQUENCE = MultiviewSequence(
    name="dance",
    fps=60.0,
    joint_names=("a", "b"),
    people=(np.arange(F)[:, None, None] + np.zeros((F, 2, 3)),),
    K=np.tile(np.diag([500.0, 500, 1]), (C, 1, 1)),
    R_world_cam=np.tile(np.eye(3), (C, 1, 1)),
    t_world_cam=np.arange(C)[:, None] * np.array([1.0, 0, 0]),
    videos=tuple(Path(f"c{k}.mp4") for k in range(C)),
)


def test_shots_follow_each_other_and_no_camera_comes_twice_in_a_row() -> None:
    cut = cut_performance(SEQUENCE, F, 3, seed=1)
    assert (cut.step, cut.fps, cut.num_frames) == (2, 30.0, 120)
    assert [shot[1] for shot in cut.shots] == [0, *(shot[2] for shot in cut.shots[:-1])]
    cameras = [shot[0] for shot in cut.shots]
    assert all(one != other for one, other in pairwise(cameras))
    assert cut.shots == cut_performance(SEQUENCE, F, 3, seed=1).shots
    assert cut.shots != cut_performance(SEQUENCE, F, 3, seed=2).shots


def test_the_truth_has_the_camera_and_the_joints_of_every_frame() -> None:
    cut = cut_performance(SEQUENCE, F, 2, seed=1)
    truth = contract_sequence(cut.truth((640, 480)))
    assert truth.cut_frames == tuple(start for _, start, _ in cut.shots[1:])
    assert truth.cameras is not None
    for camera, start, end in cut.shots:
        assert (truth.cameras.t_world_cam[start:end, 0] == camera).all()
    np.testing.assert_array_equal(truth.people[0].joints[:, 0, 0], np.arange(0, F, 2))


def test_a_short_performance_is_refused_with_its_length() -> None:
    with pytest.raises(InputError, match="dance is too short for 9 cuts: 120 frames at 30 a second"):
        cut_performance(SEQUENCE, F, 9, seed=1)


def test_a_person_is_visible_by_the_joints_that_are_known() -> None:
    joints = np.zeros((3, 2, 3))
    joints[1, 0], joints[2] = np.nan, np.nan
    recording = ImageRecording(
        "walk", 30.0, (Path("0.jpg"),) * 3, ("a", "b"), (joints,), (np.array([True, True, False]),), np.eye(3),
        np.tile(np.eye(3), (3, 1, 1)), np.zeros((3, 3)),
    )  # fmt: skip
    arrays = recording.truth((64, 48))
    assert arrays["people/00/visibility"].tolist() == [1.0, 0.5, 0.0]
    assert arrays["people/00/observed"].tolist() == [True, True, False]
    two = replace(recording, people=(joints, joints), observed=(np.ones(3, bool),) * 2).truth((64, 48))
    assert "people/01/joints" in two


def test_every_two_cameras_have_a_video_of_their_turns() -> None:
    cuts = cut_in_turns(replace(SEQUENCE, people=SEQUENCE.people * 2), F)
    assert [[shot[0] for shot in cut.shots] for cut in cuts][:2] == [[0, 1, 0], [0, 2, 0]] and len(cuts) == 6
    assert all(cut.shots == tuple((cut.shots[k][0], 40 * k, 40 * k + 40) for k in range(3)) for cut in cuts)
    assert len(contract_sequence(cuts[0].truth((640, 480))).people) == 2
    with pytest.raises(InputError, match="dance is too short for two cuts: 40 frames at 30 a second"):
        cut_in_turns(SEQUENCE, 80)
