"""The overlay's error: nothing where the body lies on what was seen, and as much as it was moved where it does not."""

from collections.abc import Callable

import pytest

from humanmm.models.evaluation.overlay import (
    COUNTED,
    fast_overlay_error,
    in_picture,
    landmarks_in_world,
    mean_offsets,
    overlay_error,
    overlay_of,
    standing_height_px,
    stature_m,
)
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.recording import Recording

Change = Callable[..., Recording]


def test_a_body_on_its_keypoints_has_no_error(standing: Recording) -> None:
    error = overlay_error(overlay_of(standing))
    assert error is not None
    assert error.p95 < 1e-3  # float32 pixels
    assert error.count == len(COUNTED) * standing.num_frames


def test_the_error_is_in_percent_of_the_standing_height(standing: Recording, changed: Change) -> None:
    (person,) = standing.people
    height = float(standing_height_px(person, standing)[0])
    assert height == pytest.approx(stature_m(person.betas) * standing.K[0, 1, 1] / 4.0, rel=1e-5)  # 4 m away
    keypoints = person.keypoints2d.copy()
    keypoints[..., 0] -= 0.03 * height
    people = overlay_of(changed(keypoints2d=keypoints))
    error = overlay_error(people)
    assert error is not None
    assert error.median == pytest.approx(3.0, rel=1e-3)
    assert mean_offsets(people)["left_knee"] == pytest.approx((3.0, 0.0), abs=1e-3)


def test_doubtful_keypoints_unobserved_frames_and_those_outside_the_picture_do_not_count(
    standing: Recording, changed: Change
) -> None:
    (person,) = standing.people
    keypoints, observed = person.keypoints2d.copy(), person.observed.copy()
    keypoints[:, INDEX["nose"], 2] = 0.4
    keypoints[:, INDEX["left_heel"], 1] = standing.height + 5
    observed[:3] = False
    error = overlay_error(overlay_of(changed(keypoints2d=keypoints, observed=observed)))
    assert error is not None
    assert error.count == (len(COUNTED) - 2) * (standing.num_frames - 3)


def test_the_row_of_fast_frames_has_the_frames_in_which_a_wrist_is_fast(standing: Recording, changed: Change) -> None:
    (person,) = standing.people
    height = float(standing_height_px(person, standing)[0])
    keypoints = person.keypoints2d.copy()
    keypoints[10, INDEX["left_wrist"], 0] += 0.2 * height  # frames 9 and 11 are fast, frame 10 is not
    keypoints[[9, 11], INDEX["nose"], 0] += 0.07 * height
    people = overlay_of(changed(keypoints2d=keypoints))
    slow, fast = overlay_error(people, ["nose"]), fast_overlay_error([people], ["nose"])
    assert slow is not None
    assert fast is not None
    assert slow.median < 1e-3
    assert fast.median == pytest.approx(7.0, rel=1e-3)
    assert fast.count == 2


def test_landmarks_of_a_standing_body_have_the_head_above_the_feet(standing: Recording) -> None:
    (person,) = standing.people
    landmarks = landmarks_in_world(person)
    assert (landmarks[:, INDEX["nose"], 2] > landmarks[:, INDEX["left_heel"], 2] + 1.2).all()
    pixels, visible = in_picture(landmarks, person, standing)
    assert visible.all()
    assert (pixels[:, INDEX["nose"], 1] < pixels[:, INDEX["left_heel"], 1]).all()
