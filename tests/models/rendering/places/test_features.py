"""What a clip's truth says of its cuts, people and shots."""

from typing import Any

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.rendering.places.features import cuts_of, person_of, shot_of
from humanmm.models.rendering.places.takes import Performance
from humanmm.models.rendering.script import Shot
from humanmm.models.synthetic.mocap import Actor


class Part:
    """What `cuts_of` reads of a clip: shots whose cameras pan by 5° and stand `yaws` degrees apart."""

    def __init__(self, num_frames: int, *yaws: float) -> None:
        self.num_frames = num_frames
        length = num_frames // len(yaws)
        self.shots = [_shot(k * length, (k + 1) * length, yaw) for k, yaw in enumerate(yaws)]


def _shot(start: int, end: int, yaw_deg: float) -> Shot:
    R = rotvec_to_rotmat(np.outer(np.radians(yaw_deg + np.linspace(0, 5, end - start)), [0, 0, 1.0]))
    height = np.linspace(1.0, 2.0, end - start)
    gain = np.array([0.9, 1.0, 1.1])
    return Shot(start, end, "pan", R, np.stack([0 * height, 0 * height, height], 1), np.full(end - start, 900.0), gain)


def test_every_cut_has_its_frame_and_the_angle_between_the_cameras_that_meet_there() -> None:
    parts: Any = [Part(40, 0.0, 90.0), Part(30, 10.0)]
    assert cuts_of(parts, ["angle", "jump"], [0.0, 0.12345]) == [
        {"frame": 20, "kind": "angle", "angle_deg": 85.0, "lost_s": 0.0, "linked": True},
        {"frame": 40, "kind": "jump", "angle_deg": None, "lost_s": 0.123, "linked": False},
    ]


def test_a_clip_of_one_shot_has_no_cut() -> None:
    clip: Any = Part(20, 0.0)
    assert cuts_of([clip], [], []) == []


def test_a_person_is_as_tall_as_the_body_and_a_shot_as_high_and_bright_as_its_camera() -> None:
    still = np.zeros((2, 24, 3))
    actor = Actor(np.zeros(10), np.zeros((2, 3, 3)), still[:, 1:], still, np.zeros((2, 24, 3, 3)), np.zeros((2, 4)))
    height = float(np.ptp(load_body().rest_vertices(np.zeros(10))[:, 1]))
    found = person_of(Performance("walk", "08_01", "08", "adult", actor))
    assert found.pop("height_m") == pytest.approx(height, abs=0.005)
    assert found == {"motion": "walk", "take": "08_01", "subject": "08", "body": "adult"}
    assert shot_of(_shot(0, 11, 0.0)) == {"camera": "pan", "height_m": 1.5, "gain": 1.0}
