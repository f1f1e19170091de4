"""What the page shows, as a tree for JSON: numbers of the recording, and what run.json says of shots and doubts.

Arrays are base64 of little-endian numbers; rotations are quaternions of 16 bits (0.2 mm at the end of a limb), the
body's vertices 16 bits (0.1 mm). All that is drawn comes from here; storage/view/page/recording.js reads it.
"""

import base64
import dataclasses
import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from humanmm.errors import InputError
from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.fingers import body_of
from humanmm.models.body.kinematics import chunks
from humanmm.models.drawing.palette import RGB, person_color, shot_color
from humanmm.models.motion.refine.worlds import JoinedShot, worlds_of
from humanmm.models.motion.worlds import WorldPlace, world_of_person, world_places
from humanmm.models.records.camera import SOURCES
from humanmm.models.records.recording import CONTACT_JOINTS, RecordedPerson, Recording

_LARGEST = 32767


def scene_tree(recording: Recording, record: Mapping[str, Any]) -> dict[str, Any]:
    """The tree; `record` is that of run.json. Strings of users (names, warnings) are in it as they are."""
    if recording.body_model != "body24":
        raise InputError(f"the run has the body model {recording.body_model!r}; only body24 can be shown")
    place_of = places_of(record["shots"])
    recording = dataclasses.replace(recording, worlds=tuple(place_of))
    body = body_of(recording.people[0]) if recording.people else load_body()
    joint, weight = _top_weights(body)
    return {
        "name": PurePath(record["video"]["path"]).name,
        "width": recording.width,
        "height": recording.height,
        "time": _packed(recording.time_s - recording.time_s[0], "float64"),
        "jointNames": body.joint_names,
        "parents": body.parents,
        "contactJoints": CONTACT_JOINTS,
        "body": {"faces": _packed(body.faces, "uint16"), "joint": _packed(joint, "uint8"), "weight": weight},
        "cameras": {
            "R": _packed(recording.R_world_cam, "float32"),
            "t": _packed(recording.t_world_cam, "float32"),
            "K": _packed(recording.K, "float32"),
        },
        "shots": [_shot(recording, shot, index, place_of[index]) for index, shot in enumerate(record["shots"])],
        "people": [_person(recording, person) for person in recording.people if len(person.frame)],
        "places": [_place(place) for place in world_places(recording, place_of)],
        "warnings": [{"text": text, "frame": frame_of(text, record["shots"])} for text in _doubts(record)],
    }


def places_of(shots: Sequence[Mapping[str, Any]]) -> list[int]:
    """The place of every shot, counted from 0; shots that people or backgrounds link are in one place.

    `shots` is that of run.json. A place of the page is a world (`motion.worlds`).
    """
    joined = []
    for index, shot in enumerate(shots):
        evidence = (shot.get("join") or {}).get("evidence", ())
        earlier = tuple(int(one["shot"]) for one in evidence if one["used"] and one["shot"] < index)
        joined.append(JoinedShot(bool(shot["linked"]), earlier, frozenset(shot["people"])))
    return list(worlds_of(joined))


def with_worlds(recording: Recording, record: Mapping[str, Any]) -> Recording:
    """The recording; its worlds are those of run.json where its motion.zarr, of an earlier version, names none."""
    places = () if recording.worlds else places_of(record.get("shots", ()))
    return dataclasses.replace(recording, worlds=tuple(places)) if any(places) else recording


def frame_of(warning: str, shots: Sequence[Mapping[str, Any]]) -> int | None:
    """The frame that a warning speaks of: one that it names, or the first of the shot that it names."""
    named = re.search(r"\bframes? (\d+)", warning)
    num_frames = int(shots[-1]["end"]) if shots else 0
    if named and int(named[1]) < num_frames:
        return int(named[1])
    shot = re.search(r"\bshot (\d+)", warning)
    if shot and int(shot[1]) < len(shots):
        return int(shots[int(shot[1])]["start"])
    return None


def _doubts(record: Mapping[str, Any]) -> list[str]:
    failures = [f"{one['stage']}, {one['unit']}: {one['reason']}" for one in record["failures"]]
    return [*failures, *record["warnings"]]


def _shot(recording: Recording, shot: Mapping[str, Any], index: int, place: int) -> dict[str, Any]:
    start, end = int(shot["start"]), int(shot["end"])
    source = SOURCES[int(np.bincount(recording.camera_source[start:end]).argmax())].replace("_", " ")
    join = shot.get("join")
    return {
        "start": start,
        "end": end,
        "source": source,
        "color": _hex(shot_color(index)),
        "place": place,
        "failed": bool(shot["failed"]),
        "transition": shot["transition"],
        "join": join
        and {
            "linked": bool(shot["linked"]),
            "uncertainty": join["uncertainty_deg"],
            "probability": join.get("probability"),
        },
    }


def _person(recording: Recording, person: RecordedPerson) -> dict[str, Any]:
    body = body_of(person)
    return {
        "person": person.person,
        "color": _hex(person_color(person)),
        "probability": float(person.probability),
        "place": world_of_person(recording, person),
        "first": int(person.frame[0]),
        "restJoints": body.rest_joints(person.betas).round(6).tolist(),
        "vertices": _scaled(body.rest_vertices(person.betas)),
        "pelvis": _packed(person.pelvis, "float32"),
        "turns": _scaled(_quaternions_xyzw(person), largest=1.0),
        "observed": _packed(person.observed, "uint8"),
        "contacts": _packed(np.rint(person.contacts * 255), "uint8"),
    }


def _place(place: WorldPlace) -> dict[str, Any]:
    """Its shots, its middle, and the offset along x by which it stands beside those before it."""
    offset = [round(place.offset_m, 3), 0.0, 0.0]
    return {
        "offset": offset, "center": place.center.round(3).tolist(), "shots": list(place.shots), "title": place.title
    }  # fmt: skip


def _quaternions_xyzw(person: RecordedPerson) -> Float[np.ndarray, "N J 4"]:
    """Of every joint relative to its parent; the pelvis's to the world."""
    pose = person.pose()
    turns = np.empty((len(pose), 1 + pose.shape[1], 4), np.float32)
    for rows in chunks(len(turns)):
        vectors = np.concatenate([person.root_orient[rows, None], pose[rows]], axis=1)
        turns[rows] = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat().reshape(-1, *turns.shape[1:])
    return turns


def _top_weights(body: Body) -> tuple[np.ndarray, dict[str, Any]]:
    """(V,4) joints of every vertex, and their weights of 255."""
    weight = np.rint(body.skin_weight * 255)
    strongest = body.skin_weight.argmax(axis=1)[:, None]
    rest = np.take_along_axis(weight, strongest, axis=1) + 255 - weight.sum(axis=1, keepdims=True)
    np.put_along_axis(weight, strongest, rest, axis=1)  # rounded weights still sum to 1
    return np.where(weight > 0, body.skin_joint, 0), _packed(weight, "uint8")


def _packed(values: np.ndarray, dtype: str) -> dict[str, Any]:
    """An array as JSON holds it."""
    data = np.ascontiguousarray(values, np.dtype(dtype).newbyteorder("<")).tobytes()
    return {"dtype": dtype, "base64": base64.b64encode(data).decode()}


def _scaled(values: np.ndarray, *, largest: float | None = None) -> dict[str, Any]:
    """An array as 16-bit numbers and their unit."""
    scale = (float(np.abs(values).max()) if largest is None else largest) / _LARGEST
    return {**_packed(np.rint(values / scale), "int16"), "scale": scale}


def _hex(color: RGB) -> int:
    """0xrrggbb."""
    red, green, blue = color
    return red << 16 | green << 8 | blue
