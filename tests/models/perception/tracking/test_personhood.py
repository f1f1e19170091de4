"""What makes a track a person's."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.tracking.personhood import MOVED, Evidence, mean_score, person_probability, pose_change
from humanmm.models.records import landmarks

WALKING = Evidence(detector=0.5, trust=0.9, steadiness=0.98, pose_change=0.15, seen_s=3.0)


def test_somebody_who_moves_and_whom_the_detector_sees_is_a_person() -> None:
    assert person_probability(WALKING) > 0.95
    unseen_against_the_light = replace(WALKING, detector=0.1)
    assert person_probability(unseen_against_the_light) > 0.5


def test_limbs_that_jump_in_a_body_that_the_detector_hardly_sees_are_doubtful() -> None:
    assert person_probability(replace(WALKING, detector=0.15, trust=0.6, steadiness=0.65)) < 0.5


@pytest.mark.parametrize(("seen_s", "doubtful"), [(1.0, False), (20.0, True)])
def test_who_never_moves_is_taken_for_a_picture_in_the_end(seen_s: float, doubtful: bool) -> None:
    still = replace(WALKING, pose_change=0.1 * MOVED, seen_s=seen_s)
    assert (person_probability(still) < 0.5) == doubtful


@pytest.mark.parametrize(("own_motion", "doubtful"), [(0.1, True), (0.35, False), (None, False), (5.0, False)])
def test_who_moves_only_with_the_wall_is_a_picture(own_motion: float | None, doubtful: bool) -> None:
    poster = replace(WALKING, pose_change=0.3 * MOVED, seen_s=4.0, own_motion=own_motion)
    assert (person_probability(poster) < 0.5) == doubtful


def test_who_was_seen_for_a_moment_may_have_been_still() -> None:
    moment, longer = (replace(WALKING, pose_change=MOVED, seen_s=s, own_motion=0.1) for s in (0.5, 3.0))
    assert person_probability(moment) > person_probability(longer)


def test_a_track_that_the_detector_was_never_run_on_is_neither_seen_nor_unseen() -> None:
    assert mean_score([0.0, 0.6]) == pytest.approx(0.3)
    assert 0 < mean_score([]) < 0.5


def test_neither_moving_through_the_picture_nor_coming_nearer_is_a_change_of_pose() -> None:
    rng, frames = np.random.default_rng(0), 30
    pose = np.column_stack([rng.uniform(-0.5, 0.5, (33, 2)), np.ones(33)])
    height = np.linspace(100.0, 200.0, frames)
    keypoints = np.tile(pose, (frames, 1, 1))
    keypoints[..., :2] = keypoints[..., :2] * height[:, None, None] + np.linspace(0, 300, frames)[:, None, None]
    assert pose_change(keypoints, height) < 1e-9
    arms = [landmarks.INDEX[f"{side}_wrist"] for side in ("left", "right")]
    keypoints[:, arms, 1] += (0.2 * np.sin(np.arange(frames)) * height)[:, None]
    assert pose_change(keypoints, height) == pytest.approx(0.2 / np.sqrt(2), rel=0.1)
