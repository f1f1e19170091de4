"""Verdicts on recovered clips: each fails for what it names, and for nothing else."""

from dataclasses import replace

import numpy as np
from standing_person import NUM_FRAMES, R_TOWARDS, recording_of, standing_person

from humanmm.models.benchmark.expectations import ExpectedCut, ExpectedPerson, GoldenClip, Part
from humanmm.models.benchmark.golden import SeenClip, Verdict, verdicts
from humanmm.models.records.recording import Recording

LEFT_OF_CENTRE = (0, 0.24, 0.22, 0.51, 0.88)
"""Where the body at x = −0.8 is seen, and somewhat more."""
RIGHT_OF_CENTRE = (0, 0.49, 0.22, 0.76, 0.88)
EVERY = ((0, NUM_FRAMES),)
PARTS = (Part(video="a.mp4"),)


def one(**values: object) -> GoldenClip:
    """A clip with a woman at the left."""
    woman = ExpectedPerson(who="woman", frames=EVERY, at=(LEFT_OF_CENTRE,))
    clip = GoldenClip(name="one", shows="", parts=PARTS, people=(woman,))
    return clip.model_copy(update=values)


def two() -> GoldenClip:
    """A clip with a woman at the left and a man at the right."""
    man = ExpectedPerson(who="man", frames=EVERY, at=(RIGHT_OF_CENTRE,))
    return one(people=(*one().people, man))


def seen(recording: Recording | None, **values: object) -> SeenClip:
    return replace(SeenClip(NUM_FRAMES, recording, {}), **values)


def failing(found: list[Verdict]) -> list[str]:
    return [f"{verdict.kind} {verdict.about}".strip() for verdict in found if not verdict.holds]


WOMAN, MAN = standing_person(0, x=-0.8), standing_person(1, x=0.8)


def test_people_where_they_are_hold() -> None:
    found = verdicts(two(), seen(recording_of(WOMAN, MAN)))
    assert not failing(found)
    assert {verdict.kind for verdict in found} == {"found", "one number", "elsewhere", "strangers", "cuts"}
    assert all(verdict.figure == 0 for verdict in found)


def test_a_body_where_nobody_is_fails_unless_it_is_doubtful_or_one_of_a_crowd() -> None:
    recording = recording_of(WOMAN, MAN)
    assert failing(verdicts(one(), seen(recording))) == ["elsewhere"]
    doubtful = recording_of(WOMAN, replace(MAN, probability=0.3))
    assert not failing(verdicts(one(), seen(doubtful)))
    crowd = ExpectedPerson(who="spectators", maybe=EVERY, crowd=True, at=((0, 0.45, 0.1, 1.0, 1.0),))
    assert not failing(verdicts(one(people=(*one().people, crowd)), seen(recording)))


def test_a_person_who_is_not_found_or_changes_number_fails() -> None:
    assert failing(verdicts(two(), seen(recording_of(WOMAN)))) == ["found man", "one number man"]
    half = np.arange(NUM_FRAMES) < NUM_FRAMES // 2
    recording = recording_of(WOMAN, replace(MAN, observed=half), replace(MAN, person=2, observed=~half))
    assert failing(verdicts(two(), seen(recording))) == ["one number man"]


def test_two_people_with_one_number_fail() -> None:
    half = np.arange(NUM_FRAMES) < NUM_FRAMES // 2
    joined = replace(WOMAN, joints=WOMAN.joints.copy(), observed=np.ones(NUM_FRAMES, bool))
    joined.joints[~half] += [1.6, 0, 0]  # she walks over and is the man
    woman = ExpectedPerson(who="woman", frames=((0, 15),), at=(LEFT_OF_CENTRE,))
    man = ExpectedPerson(who="man", frames=((15, 30),), at=(RIGHT_OF_CENTRE,))
    assert failing(verdicts(one(people=(woman, man)), seen(recording_of(joined)))) == ["strangers"]


def test_facing_height_and_uprightness_are_those_of_the_world() -> None:
    asked = {"facing": {5: "towards"}, "upright": (5,), "feet_m": {5: (-0.1, 0.1)}}
    woman = one().people[0].model_copy(update=asked)
    assert not failing(verdicts(one(people=(woman,)), seen(recording_of(WOMAN))))
    away = standing_person(0, x=-0.8, R_world_root=np.diag([-1.0, -1.0, 1.0]) @ R_TOWARDS)
    assert failing(verdicts(one(people=(woman,)), seen(recording_of(away)))) == ["facing woman, frame 5"]
    raised = recording_of(replace(WOMAN, joints=WOMAN.joints + np.float32([0, 0, 0.3])))
    assert failing(verdicts(one(people=(woman,)), seen(raised))) == ["feet woman, frame 5"]


def test_a_landmark_is_measured_in_percent_of_the_height() -> None:
    woman = one().people[0].model_copy(update={"points": {5: {"nose": (0.313, 0.37), "left_ankle": (0.1, 0.9)}}})
    points = [v for v in verdicts(one(people=(woman,)), seen(recording_of(WOMAN))) if v.kind == "points"]
    assert [verdict.holds for verdict in points] == [True, False]
    assert points[0].figure < 4


def test_cuts_within_two_frames_hold_and_say_what_is_linked() -> None:
    clip = one(cuts=(ExpectedCut(start=10, end=10, linked=False),))
    recording = recording_of(WOMAN, cut_frames=(11,))
    assert not failing(verdicts(clip, seen(recording, linked={11: False})))
    assert failing(verdicts(clip, seen(recording, linked={11: True}))) == ["linked frame 10"]
    late = recording_of(WOMAN, cut_frames=(13,))
    assert failing(verdicts(clip, seen(late, linked={13: False}))) == ["cuts", "linked frame 10"]


def test_the_camera_is_static_level_and_not_rolled() -> None:
    asked = {"camera": "static", "down_deg": {0: (-1.0, 1.0)}, "roll_deg": {0: (-1.0, 1.0)}}
    recording = recording_of(WOMAN)
    assert not failing(verdicts(one(**asked), seen(recording)))
    turned = np.array([[np.cos(0.2), -np.sin(0.2), 0], [np.sin(0.2), np.cos(0.2), 0], [0, 0, 1]])
    tilted = replace(recording, R_world_cam=(recording.R_world_cam @ turned).astype(np.float32))
    moving = replace(tilted, camera_source=np.ones(NUM_FRAMES, np.uint8))
    assert [v.found for v in verdicts(one(**asked), seen(moving)) if v.kind == "tilt"] == ["0°", "11.46°"]
    assert {"camera", "tilt roll, frame 0"} <= set(failing(verdicts(one(**asked), seen(moving))))


def test_a_refused_video_is_right_only_where_nobody_is() -> None:
    refused = seen(None, refused="no usable person: nobody is seen for long enough")
    assert refused.ending == "refused"
    assert not failing(verdicts(GoldenClip(name="bags", shows="", parts=PARTS), refused))
    assert failing(verdicts(one(camera="static"), refused)) == ["found woman", "one number woman", "camera"]
    broken = seen(None, refused="hmr · shot 0 failed: out of memory")
    assert broken.ending == "failed"
    assert failing(verdicts(GoldenClip(name="bags", shows="", parts=PARTS), broken)) == ["elsewhere"]
