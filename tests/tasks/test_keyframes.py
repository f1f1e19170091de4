"""Stage `keyframes`: what the background of each shot looks like, without its people."""

from dataclasses import replace
from typing import Any

import numpy as np
import three_shots
from held_results import inputs_of

from humanmm.models.camera.background.ground import HIDDEN
from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.records.shots import Scenes, Shot, ShotList, Transition
from humanmm.models.records.tracks import ScenePeople
from humanmm.tasks.keyframes import keyframes


def test_features_lie_on_nobody_and_a_scene_that_failed_has_none(film: Any) -> None:
    cut, end = Transition("cut", film.CUT, film.CUT, "scene"), film.facts.num_frames
    shots = ShotList(end, (Shot(0, 0, film.CUT, 0, None, ()), Shot(1, film.CUT, end, 1, cut, ())), ())
    x0, y0, x1, y1 = box = (60.0, 20.0, 120.0, 100.0)
    (track,) = three_shots.shot_of(0)[1].tracks
    somebody = replace(track.within(0, film.CUT), bbox=np.tile(np.float32(box), (film.CUT, 1)))

    def described(*people: ScenePeople | None) -> Any:
        results = {"decode": film.facts, "scenes": Scenes(end, (cut,)), "people": list(people), "shots": shots}
        return keyframes(inputs_of("keyframes", results, video=film.video)).of_shot

    def on_him(of_frame: Any) -> np.ndarray:
        x, y = of_frame.xy.T
        return (x > x0) & (x < x1) & (y > y0) & (y < y1)

    nobody = ScenePeople(0, film.CUT, ())
    first, _ = described(nobody, ScenePeople(film.CUT, end, ()))
    assert [one.frame for one in first] == [0, 7, 13] and all(on_him(one).any() for one in first)
    without_him, failed = described(ScenePeople(0, film.CUT, (somebody,)), None)
    assert failed == ()
    assert not any(on_him(one).any() for one in without_him) and all(len(one.xy) for one in without_him)


def test_pictures_are_kept_without_people_and_of_several_shots_alone(film: Any) -> None:
    end = film.facts.num_frames
    (track,) = three_shots.shot_of(0)[1].tracks
    box = np.tile(np.float32([60, 20, 120, 100]), (film.CUT, 1))
    somebody = ScenePeople(0, film.CUT, (replace(track.within(0, film.CUT), bbox=box),))

    def described(shots: list[Shot], *people: ScenePeople) -> KeyFrameFeatures:
        listed = ShotList(end, tuple(shots), ())
        cuts = tuple(shot.transition for shot in shots if shot.transition is not None)
        results = {"decode": film.facts, "scenes": Scenes(end, cuts), "people": list(people), "shots": listed}
        return keyframes(inputs_of("keyframes", results, video=film.video))

    cut = Transition("cut", film.CUT, film.CUT, "scene")
    both = [Shot(0, 0, film.CUT, 0, None, ()), Shot(1, film.CUT, end, 1, cut, ())]
    several = described(both, somebody, ScenePeople(film.CUT, end, ()))
    first, second = several.ground
    frames = [picture.frame for picture in first]
    assert frames == sorted(frames) and frames[0] == 0 and frames[-1] == film.CUT - 1 and len(frames) > 3
    assert all((picture.gray == HIDDEN).any() and (picture.gray != HIDDEN).any() for picture in first)
    assert second == ()  # nobody is in it
    whole, empty = several.pictures
    assert [picture.frame for picture in whole] == [0, film.CUT // 2, film.CUT - 1] and len(empty) == 3
    assert [(picture.gray == HIDDEN).any() for picture in (*whole, *empty)] == [True] * 3 + [False] * 3
    alone = described([Shot(0, 0, end, 0, None, ())], somebody)
    assert alone.ground == () and alone.pictures == ()


def test_what_is_burned_in_is_no_background(film: Any) -> None:
    end, boxes = film.facts.num_frames, ((0.0, 0.0, 400.0, 40.0),)
    cut = Transition("cut", film.CUT, film.CUT, "scene")
    shots = (Shot(0, 0, film.CUT, 0, None, (), burned_in=boxes), Shot(1, film.CUT, end, 1, cut, ()))
    people = [ScenePeople(0, film.CUT, ()), ScenePeople(film.CUT, end, ())]
    results = {
        "decode": film.facts, "scenes": Scenes(end, (cut,)), "people": people, "shots": ShotList(end, shots, ()),
    }  # fmt: skip
    found = keyframes(inputs_of("keyframes", results, video=film.video))
    assert all((one.xy[:, 1] >= 40).all() for one in found.of_shot[0])
    assert any((one.xy[:, 1] < 40).any() for one in found.of_shot[1])
    assert all((one.gray == HIDDEN).any() for one in found.pictures[0])
    assert not any((one.gray == HIDDEN).any() for one in found.pictures[1])
