"""Planned clips: what they say of themselves is what they show."""

import json
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.rendering.places.plan import Edit
from humanmm.models.rendering.places.sites import PLACES
from humanmm.models.rendering.places.takes import MOTIONS, Library


def test_the_same_plan_gives_the_same_clip(planned: Callable[[int], Edit], edits: list[Edit]) -> None:
    again = planned(3)
    assert json.dumps(again.features) == json.dumps(edits[3].features)
    np.testing.assert_array_equal(again.parts[0].actors[0].joints, edits[3].parts[0].actors[0].joints)


def test_places_and_motions_are_gone_through_in_turn(edits: list[Edit]) -> None:
    places = [edit.features["parts"][0]["place"] for edit in edits]
    assert places == list(PLACES)[: len(edits)]
    motions = [edit.features["parts"][0]["people"][0]["motion"] for edit in edits]
    assert len(set(motions) & set(MOTIONS)) == len(edits)


def test_cuts_are_where_and_what_they_are_said_to_be(edits: list[Edit]) -> None:
    kinds = set()
    for edit in edits:
        cuts, before = list(edit.features["cuts"]), 0
        for number, clip in enumerate(edit.parts):
            for k, shot in enumerate(clip.shots):
                if k or number:
                    cut = cuts.pop(0)
                    kinds.add(cut["kind"])
                    assert cut["frame"] == before + shot.start
                    assert cut["linked"] == (k > 0)
                if k:
                    R = clip.shots[k - 1].R_world_cam[-1].T @ shot.R_world_cam[0]
                    assert abs(np.rad2deg(rotation_angle(R)) - cut["angle_deg"]) < 0.06
                    apart = np.linalg.norm(clip.shots[k - 1].t_world_cam[-1] - shot.t_world_cam[0])
                    assert apart > 0.3 or cut["angle_deg"] > 2 or cut["lost_s"] > 0.09, "nobody can see this cut"
            before += clip.num_frames
        assert not cuts
    assert {"angle", "jump"} <= kinds <= {"angle", "jump", "return", "match"}


def test_lost_time_is_missing_from_the_motion(library: Library, edits: list[Edit]) -> None:
    found = 0
    for edit in edits:
        clip, fps = edit.parts[0], edit.parts[0].fps
        steps = np.linalg.norm(np.diff(clip.actors[0].joints, axis=0), axis=-1).mean(axis=1)
        for (_, shot), lost in zip(pairwise(clip.shots), edit.lost_s, strict=False):
            if lost > 0.2 and np.median(steps) * fps > 0.3:
                found += steps[shot.start - 1] > 1.5 * np.median(steps)
    assert found >= 1


def test_the_first_person_is_in_the_picture_and_passers_by_are_no_subjects(edits: list[Edit]) -> None:
    for edit in edits:
        for clip, part in zip(edit.parts, edit.features["parts"], strict=True):
            assert clip.subjects == len(part["people"])
            assert len(clip.actors) == clip.subjects + part["passers_by"]
            joints = clip.actors[0].joints
            assert np.isfinite(joints).all()
            assert joints[..., 2].min() > -0.1
    assert any(part["passers_by"] for edit in edits for part in edit.features["parts"])
