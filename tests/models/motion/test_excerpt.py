"""Parts of a recording: people, spans, rates, axes and units."""

import dataclasses

import numpy as np
import pytest
import two_people
from hand_points import with_hands
from scipy.spatial.transform import Rotation, Slerp

from humanmm.errors import InputError
from humanmm.models.body.kinematics import compose
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.excerpt import Excerpt, Wishes, continuous_quaternions, excerpt, is_steady
from humanmm.models.records.recording import Recording

RECORDING = two_people.recording()


def part(recording: Recording = RECORDING, **wishes: object) -> Excerpt:
    return excerpt(recording, Wishes(**wishes), up="z", unit="m")  # type: ignore[arg-type]


def test_without_wishes_every_number_stays_as_it_is() -> None:
    whole = part().recording
    assert whole.cut_frames == RECORDING.cut_frames
    for mine, given in zip(whole.people, RECORDING.people, strict=True):
        for field in dataclasses.fields(mine):
            np.testing.assert_array_equal(getattr(mine, field.name), getattr(given, field.name))
    np.testing.assert_array_equal(whole.R_world_cam, RECORDING.R_world_cam)


def test_the_rate_of_the_video_is_no_other_rate() -> None:
    ntsc = two_people.recording(fps=30000 / 1001)
    assert not part(ntsc, fps=29.97).resampled and part(ntsc, fps=30.0).resampled
    same = part(fps=29.97)
    assert not same.resampled
    np.testing.assert_array_equal(same.recording.people[0].joints, RECORDING.people[0].joints)


def test_a_span_keeps_its_frames_and_says_which_they_were() -> None:
    times = RECORDING.time_s
    piece = part(start_s=times[20], end_s=times[30])
    assert piece.source_frame.tolist() == list(range(20, 30))
    assert piece.recording.cut_frames == (two_people.CUT - 20,)
    assert piece.recording.people[1].frame.tolist() == list(range(10))
    np.testing.assert_array_equal(piece.recording.people[1].joints, RECORDING.people[1].joints[15:25])
    assert piece.seconds[0] == 0


def test_a_span_counts_from_the_first_frame_as_on_the_page() -> None:
    times = RECORDING.time_s
    late = two_people.recording(time_s=times + 1.4)
    piece = part(late, start_s=times[20], end_s=times[30])
    assert piece.source_frame.tolist() == list(range(20, 30)) and piece.recording.time_s[0] == late.time_s[20]
    with pytest.raises(InputError, match=f"no frame from 9 s to .* the video runs from 0.00 s to {times[-1]:.2f} s"):
        part(late, start_s=9.0)


def test_people_who_are_not_in_a_span_are_left_out() -> None:
    assert [person.person for person in part(end_s=RECORDING.time_s[4]).recording.people] == [0]
    assert [person.person for person in part(people=(1,)).recording.people] == [1]


def test_new_rotations_are_slerps_and_new_pelvises_lie_on_straight_lines() -> None:
    sixty = part(fps=60.0).recording
    person, given = sixty.people[0], RECORDING.people[0]
    at = sixty.time_s
    R = Slerp(RECORDING.time_s, Rotation.from_rotvec(given.root_orient))(at).as_matrix()
    assert rotation_angle(np.swapaxes(R, -1, -2) @ rotvec_to_rotmat(person.root_orient)).max() < 1e-5
    R = Slerp(RECORDING.time_s, Rotation.from_rotvec(given.body_pose[:, 17]))(at).as_matrix()
    assert rotation_angle(np.swapaxes(R, -1, -2) @ rotvec_to_rotmat(person.body_pose[:, 17])).max() < 1e-5
    expected = [np.interp(at, RECORDING.time_s, given.pelvis[:, axis]) for axis in range(3)]
    np.testing.assert_allclose(person.pelvis, np.stack(expected, 1), atol=1e-6)


def test_another_rate_and_back_gives_the_motion_again() -> None:
    there = part(fps=29.97 * 4).recording
    back = there.people[0].joints[::4]
    np.testing.assert_allclose(back, RECORDING.people[0].joints, atol=2e-6)


def test_cameras_do_not_move_through_a_cut_and_people_do() -> None:
    fine = part(fps=29.97 * 5)
    new, before, after = fine.recording, two_people.CUT - 1, two_people.CUT
    at_cut = (new.time_s > RECORDING.time_s[before] + 1e-6) & (new.time_s < RECORDING.time_s[after] - 1e-6)
    assert at_cut.sum() == 4
    nearer = [before, before, after, after]
    np.testing.assert_allclose(new.t_world_cam[at_cut], RECORDING.t_world_cam[nearer], atol=1e-6)
    np.testing.assert_allclose(new.K[at_cut], RECORDING.K[nearer], atol=1e-3)
    np.testing.assert_array_equal(fine.source_frame[at_cut], nearer)
    assert new.cut_frames == (5 * two_people.CUT - 2,)
    assert (np.diff(new.people[0].pelvis[at_cut, 0]) > 1e-4).all()


def test_the_frames_of_ntsc_video_at_30_hz_are_counted_one_by_one_and_its_cut_stays() -> None:
    ntsc = two_people.recording(num_frames=300, fps=30000 / 1001)
    even = part(ntsc, fps=30.0)
    assert even.source_frame.tolist() == list(range(300))
    assert even.recording.cut_frames == ntsc.cut_frames
    late, given = even.recording.people[1], ntsc.people[1]
    np.testing.assert_array_equal(late.observed, given.observed[late.frame - given.frame[0]])


@pytest.mark.parametrize("rate", [10.0, 24.0, 30.0, 59.94, 100.0])
def test_a_new_frame_shows_the_nearest_one_of_the_video_and_is_of_its_shot(rate: float) -> None:
    times = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.05, 40))
    recording = two_people.recording(time_s=times)
    new = part(recording, fps=rate)
    distance = np.abs(new.recording.time_s[:, None] - times)
    shown = distance[np.arange(len(distance)), new.source_frame]
    np.testing.assert_allclose(shown, distance.min(axis=1), atol=2e-6)
    np.testing.assert_array_equal(new.recording.shot_index, recording.shot_index[new.source_frame])
    np.testing.assert_array_equal(new.recording.camera_source, recording.camera_source[new.source_frame])


def test_of_two_frames_that_are_as_near_the_earlier_is_shown() -> None:
    assert part(two_people.recording(fps=30.0), fps=60.0).source_frame[:6].tolist() == [0, 0, 1, 1, 2, 2]


def test_who_comes_late_and_is_unseen_does_so_at_another_rate_too() -> None:
    fine = part(fps=29.97 * 2).recording.people[1]
    assert fine.frame[0] == 10 and fine.frame[-1] == 2 * 34
    unseen_s = fine.frame[~fine.observed] / (2 * 29.97)
    assert RECORDING.time_s[12] < unseen_s.min() < RECORDING.time_s[13] + 1e-6
    assert RECORDING.time_s[16] - 1e-6 < unseen_s.max() < RECORDING.time_s[17]


def test_who_is_there_for_a_moment_is_not_lost_at_a_low_rate() -> None:
    brief = part(start_s=RECORDING.time_s[30], fps=2.0).recording
    assert [len(person.frame) for person in brief.people] == [1, 1]


def _long_unseen(fps: float = 10.0) -> Recording:
    """Person 0 is seen in frames 0-9, 15-39 and 65-79 of 10 Hz: unseen for 0.5 and for 2.5 s."""
    recording = two_people.recording(num_frames=80, fps=fps)
    seen = np.ones(80, bool)
    seen[10:15] = seen[40:65] = False
    return dataclasses.replace(recording, people=(dataclasses.replace(recording.people[0], observed=seen),))


def test_who_is_not_seen_for_more_than_two_seconds_is_not_shown_unless_that_is_wished() -> None:
    recording = _long_unseen()
    expected = np.ones(80, bool)
    expected[40:65] = False
    shown = part(recording)
    np.testing.assert_array_equal(shown.shown(shown.recording.people[0]), expected)
    kept = part(recording, keep_unseen=True)
    assert kept.shown(kept.recording.people[0]).all()
    quick = part(_long_unseen(fps=20.0))
    assert quick.shown(quick.recording.people[0]).all(), "the same frames are 1.25 s"


def test_a_part_and_another_rate_hide_the_same_moments() -> None:
    recording = _long_unseen()
    piece = part(recording, start_s=5.0, fps=20.0)
    shown = piece.shown(piece.recording.people[0])
    hidden_s = piece.recording.time_s[~shown]
    assert hidden_s[0] == 5.0 and 6.4 <= hidden_s[-1] < 6.5 and shown[-1]


def test_a_variable_rate_is_no_constant_one() -> None:
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.02, 0.05, 40))
    assert is_steady(RECORDING) and not is_steady(two_people.recording(time_s=times))
    even = part(two_people.recording(time_s=times), fps=30.0)
    assert even.resampled
    np.testing.assert_allclose(np.diff(even.recording.time_s), 1 / 30, atol=1e-9)
    assert even.recording.time_s[-1] <= times[-1]


@pytest.mark.parametrize("up", ["y", "z"])
def test_rotations_and_rest_pose_of_a_file_give_its_joints(up: str) -> None:
    chosen = excerpt(RECORDING, Wishes(up=up, unit="cm"), up="y", unit="m")  # type: ignore[arg-type]
    for person in chosen.recording.people:
        R = chosen.local_rotations(person, slice(None))
        joints, _ = compose(chosen.rest_joints(person), R, chosen.points(person.pelvis))
        np.testing.assert_allclose(joints, chosen.points(person.joints), atol=1e-3)
    assert chosen.points(np.array([0.0, 0, 1])).tolist() == ([0, 100, 0] if up == "y" else [0, 0, 100])
    head = chosen.rest_joints(chosen.recording.people[0])[15]
    assert np.argmax(head) == (1 if up == "y" else 2), "the rest pose stands upright"


@pytest.mark.parametrize(
    ("wishes", "words"),
    [
        ({"people": (3,)}, "no person 3; the run has 0, 1"),
        ({"fps": 0.0}, "0 frames per second"),
        ({"fps": float("nan")}, "frames per second"),
        ({"start_s": 9.0}, "no frame from 9 s to"),
        ({"up": "x"}, "expected y or z"),
        ({"unit": "inch"}, "m, cm or mm"),
        ({"start_s": 0.5, "end_s": 0.2}, "no frame from 0.5 s to 0.2 s"),
    ],
)
def test_what_is_not_there_is_reported_in_one_sentence(wishes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        part(**wishes)


def test_a_skeleton_is_refused_for_another_body_model() -> None:
    other = part(dataclasses.replace(RECORDING, body_model="smpl-neutral"))
    with pytest.raises(InputError, match="body24 alone"):
        other.rest_joints(other.recording.people[0])


def test_quaternions_over_time_take_the_short_way() -> None:
    R = Rotation.from_rotvec(np.outer(np.linspace(0, 12, 60), [0, 0, 1])).as_matrix()
    found = continuous_quaternions(np.stack([R, R], axis=1))
    assert found.shape == (60, 2, 4) and (np.sum(found[1:] * found[:-1], axis=-1) > 0.9).all()
    assert continuous_quaternions(R[:1]).shape == (1, 4)


def test_fingers_are_cut_and_resampled_with_their_person() -> None:
    recording = with_hands(two_people.recording())
    part = excerpt(recording, Wishes(start_s=0.2, end_s=0.9, fps=60), up="z", unit="m")
    person, source = part.recording.people[0], recording.people[0]
    assert person.hand_pose is not None and source.hand_pose is not None and person.hand_confidence is not None
    assert person.hand_pose.shape == (len(person.frame), 30, 3)
    before = part.source_frame[0]
    np.testing.assert_allclose(person.hand_pose[0], source.hand_pose[before], atol=1e-5)
    between = (source.hand_pose[before] + source.hand_pose[before + 1]) / 2
    np.testing.assert_allclose(person.hand_pose[1], between, atol=5e-3)
    np.testing.assert_allclose(person.hand_confidence, np.tile([0.9, 0], (len(person.frame), 1)), atol=1e-6)
    assert part.rest_joints(person).shape == (52, 3)
    assert part.local_rotations(person, slice(0, 4)).shape == (4, 52, 3, 3)
