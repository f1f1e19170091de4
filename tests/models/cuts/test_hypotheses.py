"""Hypotheses of a cut: answers weighed by cost, the fitted body beside them, spinning bodies through lost time."""

import numpy as np
import pytest
from walking import FPS, case

from humanmm.models.cuts.bundle import BundleResult
from humanmm.models.cuts.hypotheses import SIDES_SWAPPED, fitted_body_rotation, hypotheses_of
from humanmm.models.cuts.sides import CutPerson
from humanmm.models.geometry.rotations import angle_between_deg, rotvec_to_rotmat

UP = np.array([0.0, -1.0, 0.0])


def about_up(degrees: float | np.ndarray) -> np.ndarray:
    return rotvec_to_rotmat(np.radians(np.asarray(degrees))[..., None] * UP)


def spinning(deg_s: float, lost_s: float, camera_deg: float = 60.0) -> CutPerson:
    """A body that spins evenly before two cameras `camera_deg` apart; the second starts `lost_s` late."""
    person, _ = case(camera_deg)
    frames = np.arange(24) / FPS
    root = about_up(deg_s * (frames + lost_s * (frames > 11.5 / FPS)))
    root[12:] = about_up(-camera_deg) @ root[12:]
    sides = [
        type(side)(times, side.keypoints2d, side.landmarks3d, part, side.R_cut_cam)
        for side, times, part in (
            (person.before, frames[:12], root[:12]),
            (person.after, frames[12:], root[12:]),
        )
    ]
    return CutPerson(*sides)


def answer(degrees: float, cost: float = 8.0) -> BundleResult:
    return BundleResult(about_up(degrees), cost, 1.0)


def test_a_spinning_body_is_followed_through_the_time_that_nobody_filmed() -> None:
    person = spinning(400.0, lost_s=0.2)
    # What one frame's motion explains: the camera seems to have rotated by what the body has.
    seen = answer(60.0 - 400.0 * 0.2)
    found = hypotheses_of([person], [seen], [], 1 / FPS)
    assert angle_between_deg(found[0].R_before_after, seen.R_before_after) < 10.0  # most cuts lose nothing
    near = [one for one in found if angle_between_deg(one.R_before_after, about_up(60.0)) < 15.0]
    assert sum(one.probability for one in near) > 0.04 and near[0].sigma_deg > found[0].sigma_deg


def test_a_body_that_stands_leaves_the_answer_and_the_fitted_body() -> None:
    person = spinning(5.0, lost_s=0.2)
    found = hypotheses_of([person], [answer(60.0)], [], 1 / FPS)
    assert [one.source for one in found] == ["people", "people, fitted body"]
    assert 0.9 < sum(one.probability for one in found) < 1.0


def test_the_fitted_body_carries_its_own_rotation_over_the_cut() -> None:
    person = spinning(0.0, lost_s=0.0, camera_deg=75.0)
    R_body = fitted_body_rotation(person)
    assert R_body is not None and angle_between_deg(R_body, about_up(75.0)) < 1e-6
    unfitted, _ = case(75.0)
    assert fitted_body_rotation(unfitted) is None


def test_cheaper_answers_are_likelier_and_swapped_sides_less() -> None:
    person, _ = case(60.0)
    as_found, dearer, swapped = answer(10.0), answer(90.0, cost=11.0), answer(170.0)
    found = hypotheses_of([person], [as_found, dearer], [swapped], 0.0)
    by_angle = {round(angle_between_deg(one.R_before_after, np.eye(3))): one for one in found}
    assert by_angle[10].probability > 2 * by_angle[90].probability > 0
    assert by_angle[10].probability == pytest.approx(by_angle[170].probability / 0.15)
    assert by_angle[170].source.endswith(SIDES_SWAPPED) and by_angle[90].sigma_deg > by_angle[10].sigma_deg


def test_answers_that_nearly_agree_are_one() -> None:
    person, _ = case(60.0)
    assert len(hypotheses_of([person], [answer(60.0), answer(70.0, cost=9.0)], [], 0.0)) == 1


def test_a_motion_that_fits_badly_or_was_long_unseen_is_hardly_believed_but_never_lost() -> None:
    person, _ = case(60.0)
    costly = hypotheses_of([person], [answer(60.0, cost=20_000.0)], [], 0.0)
    late = hypotheses_of([person], [answer(60.0)], [], 9.0)
    for found in (costly, late):
        assert len(found) == 1 and found[0].probability < 0.01 and found[0].sigma_deg == 45.0
