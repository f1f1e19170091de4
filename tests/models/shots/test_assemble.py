"""Shots know where they begin, where they end, and which of their frames show them alone."""

import numpy as np
import pytest

from humanmm.errors import NoUsablePersonError
from humanmm.models.records.shots import Scenes, Shot, Transition
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.shots.assemble import detect_shots

SCENES = Scenes(60, (Transition("cut", 30, 30, "scene"),))
FACTS = VideoFacts(960, 540, np.arange(60) / 30, np.arange(60) == 0, 0, "h264", "mp4")


@pytest.mark.parametrize("people", [[None, None], [ScenePeople(0, 30, ()), ScenePeople(30, 60, ())]])
def test_a_video_in_which_nobody_is_seen_is_an_error_in_plain_words(people: list[ScenePeople | None]) -> None:
    with pytest.raises(NoUsablePersonError, match="no usable person"):
        detect_shots(FACTS, SCENES, people)


def test_frames_that_a_dissolve_mixes_are_outside_transitions_in_neither_shot() -> None:
    dissolve = Transition("dissolve", 25, 36, "scene")
    first = Shot(0, 0, 30, 0, None, (), ending=dissolve)
    second = Shot(1, 30, 60, 1, dissolve, (), ending=Transition("cut", 60, 60, "scene"))
    assert first.outside_transitions == (0, 25)
    assert second.outside_transitions == (36, 60)


def test_a_shot_between_two_long_dissolves_may_have_no_frame_outside_transitions() -> None:
    shot = Shot(1, 30, 40, 1, Transition("dissolve", 22, 38, "scene"), (), Transition("fade", 36, 44, "scene"))
    assert shot.outside_transitions == (38, 38)
