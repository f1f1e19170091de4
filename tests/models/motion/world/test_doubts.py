"""What is doubtful in a world is said, what is certain is not."""

from dataclasses import replace

import numpy as np
import pytest
from three_shots import BETAS, LENGTH, results

from humanmm.models.motion.world import doubts
from humanmm.models.motion.world.align import align
from humanmm.models.records.motion import Facing, PathScale, PersonShotMotion, PoseJump
from humanmm.models.records.shots import Person


def misoriented(motion: PersonShotMotion, frames: slice, probability: float) -> PersonShotMotion:
    doubt = motion.misoriented.copy()
    doubt[frames] = probability
    return replace(motion, misoriented=doubt)


def test_a_body_that_may_be_turned_the_wrong_way_is_named_with_its_frames() -> None:
    three = results()
    first, second, third = three.motions
    assert second is not None
    turned = replace(second, people=(misoriented(second.people[0], slice(2, 9), 0.8),))
    world = align(replace(three, motions=(first, turned, third)))
    doubtful = [facing for facing in world.facings if facing.probability < doubts.CERTAIN_FACING]
    assert [(one.person, one.shot, one.doubtful) for one in doubtful] == [(0, 1, ((LENGTH + 2, LENGTH + 9),))]
    (said,) = (sentence for sentence in world.warnings if "faces" in sentence)
    assert "shot 1: which way person 0 faces" in said
    assert f"frames {LENGTH + 2}-{LENGTH + 8}" in said


def test_a_pose_that_is_expected_to_be_far_off_is_named_with_its_frames() -> None:
    three = results()
    first, second, third = three.motions
    assert second is not None and third is not None
    error = np.full(LENGTH, 0.06, np.float32)
    error[3:] = 0.2
    guessed, silent = (
        replace(shot, people=(replace(shot.people[0], pose_error_m=values),))
        for shot, values in ((second, error), (third, np.full(LENGTH, np.nan, np.float32)))
    )
    world = align(replace(three, motions=(first, guessed, silent)))
    usual, doubtful, unknown = world.pose_errors
    assert usual.error_m == pytest.approx(0.05) and usual.doubtful == ()
    assert doubtful.doubtful == ((LENGTH + 3, 2 * LENGTH),)
    assert np.isnan(unknown.error_m) and unknown.doubtful == ()
    (said,) = (sentence for sentence in world.warnings if "pose of person" in sentence)
    assert f"shot 1: the pose of person 0 is doubtful, above all in frames {LENGTH + 3}-{2 * LENGTH - 1}: " in said
    assert f"off by {1000 * error.mean():.0f} mm" in said
    assert doubts.of_pose_errors(world.pose_errors, certain=set()) == []


def test_who_may_be_no_person_at_all_has_no_second_warning() -> None:
    three, facing = results(), Facing(3, 0, 0.5, ((4, 5),), 0.02)
    bag, woman = (
        replace(three, shots=replace(three.shots, people=(Person(3, BETAS, 1.0, probability),)))
        for probability in (0.3, 0.9)
    )
    assert doubts.of_facings([facing], bag.certain) == []
    (said,) = doubts.of_facings([facing], woman.certain)
    assert "frames 4:" in said and "one frame in 2 " in said


def test_a_doubtful_moment_of_a_long_shot_is_named_though_the_mean_is_high() -> None:
    (said,) = doubts.of_facings([Facing(0, 1, 0.99, ((300, 315),), 0.3)], {0})
    assert "frames 300-314" in said
    assert doubts.of_facings([Facing(0, 1, 0.99, ((300, 303),), 0.04)], {0}) == []


@pytest.mark.parametrize("hz", [15, 30, 120])
def test_doubtful_moments_near_in_time_are_one_run_at_every_frame_rate(hz: int) -> None:
    """Both last a fifteenth of a second, a fifteenth or third of one apart."""
    three, part, wide = results(), hz // 15, 5 * hz // 15
    first, second, third = three.motions
    assert second is not None
    n = 4 * part + wide
    one = replace(second.people[0], **{
        name: np.resize(values, (n, *values.shape[1:]))
        for name, values in vars(second.people[0]).items()
        if isinstance(values, np.ndarray) and len(values) == LENGTH
    })  # fmt: skip
    one = replace(one, frame=LENGTH + np.arange(n, dtype=np.int32), observed=np.ones(n, bool))
    doubt = np.zeros(n, np.float32)
    starts = (0, 2 * part, 3 * part + wide)
    for start in starts:
        doubt[start : start + part] = 0.8
    turned = replace(second, people=(replace(one, misoriented=doubt, pose_error_m=doubt),))
    video = replace(three, motions=(first, turned, third), time_s=np.arange(200) / hz)
    runs = ((LENGTH, LENGTH + 3 * part), (LENGTH + starts[2], LENGTH + n))
    assert [facing.doubtful for facing in doubts.facings_of(video) if facing.shot == 1] == [runs]
    assert [error.doubtful for error in doubts.pose_errors_of(video) if error.shot == 1] == [runs]


def test_a_picture_that_stays_counts_for_as_long_as_it_is_shown() -> None:
    three, stays_s = results(), 0.6
    first, second, third = three.motions
    assert second is not None
    doubt = np.zeros(LENGTH, np.float32)
    doubt[2] = 0.9
    turned = replace(second, people=(replace(second.people[0], misoriented=doubt, pose_error_m=doubt),))
    interval_s = np.full(3 * LENGTH, 1 / 60)
    interval_s[LENGTH + 2] = stays_s
    video = replace(three, motions=(first, turned, third), time_s=np.cumsum(interval_s) - interval_s)
    share = stays_s / interval_s[LENGTH : 2 * LENGTH].sum()
    facing = next(one for one in doubts.facings_of(video) if one.shot == 1)
    assert facing.worst_s == pytest.approx(0.9 * stays_s)
    assert facing.probability == pytest.approx(1 - 0.9 * share)
    error = next(one for one in doubts.pose_errors_of(video) if one.shot == 1)
    assert error.error_m == pytest.approx(0.9 * share)


def test_a_path_of_unknown_scale_is_doubtful_only_where_it_is_long_enough_to_matter() -> None:
    unsure, sure = PathScale(0, "floor", 0.5), PathScale(0, "feet", 0.2)
    far, near = np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.array([[0.0, 0, 0], [0.1, 0, 0]])
    (said,) = doubts.of_paths([unsure], [far])
    assert "2.0 m ± 50 %" in said
    assert doubts.of_paths([unsure], [near]) == []
    assert doubts.of_paths([sure], [far]) == []
    (assumed,) = doubts.of_paths([PathScale(0, "assumed", np.nan)], [near])
    assert "taken for a metre" in assumed


def test_who_does_not_go_on_across_a_cut_is_named() -> None:
    (cut, _) = align(results()).cuts
    leap = replace(cut, pose_jumps=(PoseJump(0, 0.4, 0.08), PoseJump(1, 0.1, 0.08), PoseJump(2, 0.5, 0.08)))
    (said,) = doubts.of_jumps([leap], certain={0, 1})
    assert f"cut at frame {cut.cut_frame}: person 0 does not go on" in said and "0.40 m" in said
