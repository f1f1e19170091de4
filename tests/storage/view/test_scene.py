"""The tree of the page: numbers come back as they were, places stand apart, warnings know their frame."""

import base64
import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from hand_points import with_hands
from scipy.spatial.transform import Rotation

from humanmm.errors import InputError
from humanmm.models.body.body24 import load_body
from humanmm.models.body.fingers import JOINT_NAMES_52, PARENTS_52
from humanmm.models.body.kinematics import compose
from humanmm.models.records.recording import Recording
from humanmm.storage.view.scene import frame_of, places_of, scene_tree, with_worlds


def _unpacked(packed: dict[str, Any]) -> np.ndarray:
    values = np.frombuffer(base64.b64decode(packed["base64"]), np.dtype(packed["dtype"]).newbyteorder("<"))
    return values * packed.get("scale", 1)


def _shot(linked: bool, people: list[int], *evidence: int) -> dict[str, Any]:
    used = [{"shot": shot, "used": True} for shot in evidence]
    return {"start": 0, "end": 10, "linked": linked, "people": people, "join": {"evidence": used}}


def test_the_joints_of_the_rounded_rotations_are_those_of_the_recording(
    recording: Recording, record: dict[str, Any]
) -> None:
    tree = json.loads(json.dumps(scene_tree(recording, record)))
    for message, person in zip(tree["people"], recording.people, strict=True):
        turns = Rotation.from_quat(_unpacked(message["turns"]).reshape(-1, 4)).as_matrix().reshape(-1, 24, 3, 3)
        joints, _ = compose(np.array(message["restJoints"]), turns, _unpacked(message["pelvis"]).reshape(-1, 3))
        assert np.abs(joints - person.joints).max() < 1e-3
        vertices = load_body().rest_vertices(person.betas)
        assert np.abs(_unpacked(message["vertices"]).reshape(-1, 3) - vertices).max() < 1e-4
        assert (_unpacked(message["observed"]) == person.observed).all() and message["first"] == person.frame[0]


def test_skinning_weights_of_a_vertex_still_sum_to_one(recording: Recording, record: dict[str, Any]) -> None:
    body = scene_tree(recording, record)["body"]
    weight = _unpacked(body["weight"]).reshape(-1, 4)
    assert (weight.sum(axis=1) == 255).all()
    assert np.abs(weight / 255 - load_body().skin_weight).max() < 0.01


def test_times_are_those_of_the_frames_from_the_first_one_on(recording: Recording, record: dict[str, Any]) -> None:
    times = _unpacked(scene_tree(recording, record)["time"])
    np.testing.assert_array_equal(times, recording.time_s - recording.time_s[0])


def test_a_shot_that_nothing_links_begins_a_place_and_a_linked_one_goes_where_its_evidence_is() -> None:
    shots = [
        _shot(True, [0]),
        _shot(False, [1]),
        _shot(True, [0]),
        _shot(True, [2], 1),
        _shot(False, []),
        _shot(True, []),
    ]
    assert places_of(shots) == [0, 1, 0, 1, 2, 2]


def test_places_stand_beside_each_other_and_everybody_in_his_own(recording: Recording, record: dict[str, Any]) -> None:
    first_shot, second_shot = record["shots"]
    tree = scene_tree(recording, record | {"shots": [first_shot, second_shot | {"linked": False}]})
    first, second = tree["places"]
    assert first["offset"] == [0, 0, 0] and second["offset"][0] > 3 and second["title"] == "shot 1"
    assert [person["place"] for person in tree["people"]] == [0, 0], "where he was seen most"


def test_an_earlier_motion_has_the_worlds_of_its_run_json(recording: Recording, record: dict[str, Any]) -> None:
    first_shot, second_shot = record["shots"]
    apart = record | {"shots": [first_shot, second_shot | {"linked": False}]}
    assert with_worlds(recording, apart).worlds == (0, 1) and with_worlds(recording, record).worlds == ()
    named = dataclasses.replace(recording, worlds=(0, 1))
    assert with_worlds(named, record) is named


def test_a_warning_knows_the_frame_that_it_names_or_the_first_of_its_shot() -> None:
    shots = [{"start": 0, "end": 20}, {"start": 20, "end": 50}]
    assert frame_of("align: cut at frame 33: the rotation is uncertain", shots) == 33
    assert (
        frame_of("align: shot 0: the pose of person 1 is doubtful, above all in frames 24-38, 50: 90 mm", shots) == 24
    )
    assert frame_of("camera, shot 1: taken as static", shots) == 20
    assert frame_of("no shot 7, no frame 99", shots) is None and frame_of("nothing", shots) is None


def test_another_body_model_is_refused(recording: Recording, record: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="body24"):
        scene_tree(dataclasses.replace(recording, body_model="smpl-neutral"), record)


def test_the_page_has_the_fingers_where_hands_were_asked_for(recording: Recording, record: dict[str, Any]) -> None:
    hands = with_hands(recording)
    tree = json.loads(json.dumps(scene_tree(hands, record)))
    assert tree["jointNames"] == list(JOINT_NAMES_52) and tree["parents"] == list(PARENTS_52)
    assert _unpacked(tree["body"]["joint"]).max() == 51
    for message, person in zip(tree["people"], hands.people, strict=True):
        turns = Rotation.from_quat(_unpacked(message["turns"]).reshape(-1, 4)).as_rotvec().reshape(-1, 52, 3)
        assert np.abs(turns[:, 22:] - person.hand_pose).max() < 1e-3
