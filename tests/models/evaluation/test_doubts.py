"""What is wrong in a run is found against its truth, and whether run.json doubted it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.evaluation.doubts import CLIP, Judgement, judged
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.records.sequence import MotionSequence


def record_of(
    sequence: MotionSequence,
    *,
    facing: float = 0.99,
    worst_s: float = 0.0,
    pose_mm: float | None = 50.0,
    probability: float = 0.95,
    is_person: float = 0.9,
    focal: tuple[str, float] = ("estimated", 0.05),
) -> dict[str, Any]:
    """run.json of a run with one person, a travelling camera and no doubt but these."""
    cut = sequence.cut_frames[0]
    shots = [
        {
            "start": start,
            "end": end,
            "linked": True,
            "join": {"uncertainty_deg": 3.0, "probability": probability} if start else None,
            "facing": [{"person": 0, "probability": facing, "worst_s": worst_s}],
            "pose": [{"person": 0, "error_mm": pose_mm}],
            "camera": {"path_scale": {"source": "floor", "relative_uncertainty": 0.2}},
        }
        for start, end in ((0, cut), (cut, sequence.num_frames))
    ]
    return {
        "focal": {"source": focal[0], "relative_uncertainty": focal[1]},
        "people": [{"person": 0, "probability": is_person}],
        "shots": shots,
        "unfollowed": [],
        "warnings": [],
    }


def wrong(found: list[Judgement]) -> set[str]:
    return {one.kind for one in found if one.wrong}


def test_a_perfect_run_is_wrong_in_nothing(sequence: MotionSequence) -> None:
    found = judged(record_of(sequence), sequence, sequence)
    kinds = [one.kind for one in found]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "facing": 2, "pose": 2, "cut": 1, "focal": 2, "path": 2, "shots": 1, "people": 1, CLIP: 1,
    }  # fmt: skip
    assert not any(one.wrong or one.warned for one in found)


@pytest.mark.parametrize("facing", [0.99, 0.7])
def test_a_body_turned_round_is_wrong_whether_it_was_doubted_or_not(sequence: MotionSequence, facing: float) -> None:
    cut, person = sequence.cut_frames[0], sequence.people[0]
    assert person.R_world_root is not None
    R = person.R_world_root.copy()
    R[cut:] = R[cut:] @ np.diag([-1.0, 1.0, -1.0])
    prediction = replace(sequence, people=(replace(person, R_world_root=R),))
    found = judged(record_of(sequence, facing=facing), prediction, sequence)
    first, second = (one for one in found if one.kind == "facing")
    assert first == Judgement("facing", False, facing < 0.925)
    assert second == Judgement("facing", True, facing < 0.925)


@pytest.mark.parametrize(("pose_mm", "warned"), [(50.0, False), (120.0, True), (None, False)])
def test_a_pose_that_is_far_off_in_a_shot_is_wrong(
    sequence: MotionSequence, pose_mm: float | None, warned: bool
) -> None:
    cut, person = sequence.cut_frames[0], sequence.people[0]
    joints = person.joints.copy()
    joints[cut:] += np.random.default_rng(0).normal(0, 0.15, joints[cut:].shape)
    prediction = replace(sequence, people=(replace(person, joints=joints),))
    found = judged(record_of(sequence, pose_mm=pose_mm), prediction, sequence)
    first, second = (one for one in found if one.kind == "pose")
    assert (first, second) == (Judgement("pose", False, warned), Judgement("pose", True, warned))


def test_of_somebody_who_may_be_no_person_nobody_says_which_way_he_faces(sequence: MotionSequence) -> None:
    for is_person, warned in ((0.9, True), (0.4, False)):
        found = judged(record_of(sequence, facing=0.7, is_person=is_person), sequence, sequence)
        assert [one.warned for one in found if one.kind == "facing"] == [warned, warned]


@pytest.mark.parametrize(
    ("source", "uncertainty", "warned"),
    [("given", 0.0, False), ("estimated", 0.1, False), ("estimated", 0.3, True), ("default", 0.4, True)],
)
def test_a_focal_length_is_doubted_where_it_is_assumed_or_hardly_known(
    sequence: MotionSequence, source: str, uncertainty: float, warned: bool
) -> None:
    found = judged(record_of(sequence, focal=(source, uncertainty)), sequence, sequence)
    assert [one.warned for one in found if one.kind == "focal"] == [warned, warned]


def test_a_body_turned_round_for_a_moment_of_a_long_shot_is_wrong_too(sequence: MotionSequence) -> None:
    person, cut = sequence.people[0], sequence.cut_frames[0]
    assert person.R_world_root is not None and sequence.num_frames - cut > 60
    R = person.R_world_root.copy()
    R[cut : cut + 10] = R[cut : cut + 10] @ np.diag([-1.0, 1.0, -1.0])
    prediction = replace(sequence, people=(replace(person, R_world_root=R),))
    found = judged(record_of(sequence, worst_s=0.2), prediction, sequence)
    assert [one for one in found if one.kind == "facing"][1] == Judgement("facing", True, True)


def test_a_shot_rotated_at_its_cut_is_wrong_and_a_doubtful_probability_is_a_warning(sequence: MotionSequence) -> None:
    cut, cameras = sequence.cut_frames[0], sequence.cameras
    assert cameras is not None
    turn = np.where((np.arange(sequence.num_frames) >= cut)[:, None, None], yaw_to_rotmat(1.0), np.eye(3))
    prediction = replace(sequence, cameras=replace(cameras, R_world_cam=turn @ cameras.R_world_cam))
    for probability, warned in ((0.95, False), (0.5, True)):
        found = judged(record_of(sequence, probability=probability), prediction, sequence)
        assert Judgement("cut", True, warned) in found


def test_lenses_paths_cuts_and_people_are_held_against_the_truth(sequence: MotionSequence) -> None:
    cameras, cut = sequence.cameras, sequence.cut_frames[0]
    assert cameras is not None
    zoomed = replace(sequence, cameras=replace(cameras, K=cameras.K * [[[1.4, 1, 1], [1, 1.4, 1], [1, 1, 1]]]))
    assert wrong(judged(record_of(sequence), zoomed, sequence)) == {"focal", CLIP}
    long = replace(sequence, cameras=replace(cameras, t_world_cam=2 * cameras.t_world_cam))
    assert wrong(judged(record_of(sequence), long, sequence)) == {"path", CLIP}
    assert wrong(judged(record_of(sequence), replace(sequence, transitions=()), sequence)) == {"shots", CLIP}
    assert wrong(judged(record_of(sequence), replace(sequence, people=()), sequence)) == {"people", CLIP}
    seen = record_of(sequence) | {"unfollowed": [{"start": 3, "end": 40}]}
    assert Judgement("people", True, True) in judged(seen, replace(sequence, people=()), sequence)
    divided = [
        one.kind for one in judged(record_of(sequence), sequence, replace(sequence, transitions=((cut + 9,) * 2,)))
    ]
    assert divided.count("focal") == 1, "a shot with a true cut in it has no lens of its own"


def test_a_warning_is_counted_where_it_belongs(sequence: MotionSequence) -> None:
    record = record_of(sequence)
    record["warnings"] = [
        "camera, shot 1: pycolmap's two-view rotations differ",
        "camera, shot 0: the camera zooms: its focal length changes by 30 %",
    ]
    found = judged(record, sequence, sequence)
    assert [one.warned for one in found if one.kind == "path"] == [True, True]
    assert [one.warned for one in found if one.kind == "focal"] == [True, False]
    assert [one.warned for one in found if one.kind == CLIP] == [True]
    record["shots"][0]["camera"]["path_scale"] = {"source": "assumed", "relative_uncertainty": None}
    assert [one.warned for one in judged(record, sequence, sequence) if one.kind == "path"] == [True, True]
    start, end = record["shots"][1]["start"], record["shots"][1]["end"]
    record["warnings"] = [f"intrinsics: frames {start} to {end - 1} seem to be seen with a lens of their own"]
    assert [one.warned for one in judged(record, sequence, sequence) if one.kind == "focal"] == [False, True]


@pytest.mark.parametrize("late", [-2, -1, 1, 2])
def test_a_cut_that_is_found_a_little_early_or_late_is_judged_too(sequence: MotionSequence, late: int) -> None:
    true, cameras = sequence.cut_frames[0], sequence.cameras
    assert cameras is not None
    cut, frame = true + late, np.arange(sequence.num_frames)
    R = cameras.R_world_cam[np.where(frame < cut, np.minimum(frame, true - 1), np.maximum(frame, true))]
    for turned_rad, is_wrong in ((0.0, False), (2.0, True)):
        R_turned = np.where((frame < cut)[:, None, None], R, yaw_to_rotmat(turned_rad) @ R)
        prediction = replace(sequence, transitions=((cut, cut),), cameras=replace(cameras, R_world_cam=R_turned))
        found = judged(record_of(prediction), prediction, sequence)
        assert [one for one in found if one.kind == "cut"] == [Judgement("cut", is_wrong, False)]
