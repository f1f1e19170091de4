"""Stage `shots`: how much of the detector is used, who counts as a person, whom the user wants alone."""

from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import pytest
import three_shots
from held_results import inputs_of

from humanmm.errors import NoUsablePersonError
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.shots import shots

END = 3 * three_shots.LENGTH
FACTS = VideoFacts(960, 540, np.arange(END) / three_shots.FPS, np.arange(END) == 0, 0, "h264", "mp4")


def _track(**changes: Any) -> PersonTrack:
    """The man of `three_shots` through all three, whose cuts the colours do not show."""
    clothes = np.full((1, HISTOGRAM_BINS), 1 / HISTOGRAM_BINS, np.float32)
    tracks = [three_shots.shot_of(k)[1].tracks[0] for k in range(3)]
    whole = reduce(PersonTrack.then, (replace(track, color_histogram=clothes) for track in tracks))
    return replace(_aside(whole, 400.0 * (whole.frame >= three_shots.LENGTH)), **changes)


def _aside(track: PersonTrack, shift_px: np.ndarray) -> PersonTrack:
    """The same so far to the right."""
    shift = np.zeros((len(track.frame), 3), np.float32)
    shift[:, 0] = shift_px
    return replace(track, keypoints2d=track.keypoints2d + shift[:, None], bbox=track.bbox + shift[:, [0, 1, 0, 1]])


def _listed(*tracks: PersonTrack, corrections: tuple[dict[str, Any], ...] = (), **settings: Any) -> ShotList:
    results = {"decode": FACTS, "scenes": Scenes(END, ()), "people": [ScenePeople(0, END, tracks)]}
    return shots(inputs_of("shots", results, shots=settings, corrections=list(corrections)))


def test_people_show_the_cuts_that_colours_do_not_unless_colours_alone_are_asked() -> None:
    for parts, starts in (("scenes", [0]), ("boxes", [0, 20]), ("keypoints", [0, 20, 40])):
        assert [shot.start for shot in _listed(_track(), parts=parts).shots] == starts
    removed = _listed(_track(), corrections=({"kind": "remove-cut", "frame": 20},))
    assert [shot.start for shot in removed.shots] == [0, 40] and removed.corrections[0].applied


def test_who_is_hardly_a_person_is_left_out_as_the_user_wants() -> None:
    (person,) = _listed(_track(probability=0.3)).people
    assert person.doubtful
    with pytest.raises(NoUsablePersonError, match=r"less than 0\.4"):
        _listed(_track(probability=0.3), min_confidence=0.4)


def test_the_person_whom_the_user_wants_is_alone() -> None:
    aside = _aside(_track(), np.full(END, 300.0))
    both = _listed(_track(), aside, parts="scenes")
    assert [person.person for person in both.people] == [0, 1]
    alone = _listed(_track(), aside, parts="scenes", person=1)
    assert [person.person for person in alone.people] == [1]
    assert [appearance.person for shot in alone.shots for appearance in shot.people] == [1]
