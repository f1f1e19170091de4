"""Where up is in a shot: from who stands, never from who lies or is upside down."""

from dataclasses import replace

import numpy as np
from three_shots import LENGTH, camera, results

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import (
    ShotVertical,
    UpDirection,
    standing_axes,
    upright_together,
    vertical_of,
)
from humanmm.models.motion.rotations.rotation_mixtures import Upright
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of
from humanmm.models.motion.rotations.shot_rotations import ShotRotations

HEAD_OVER_HEELS = rotvec_to_rotmat(np.array([0.0, 0.0, np.pi]))
"""About the camera's axis."""
TRUE_UP = camera(0)[0].T @ np.array([0.0, 0.0, 1.0])
"""In the axes of the first shot, which are those of its camera."""


def upside_down(frames: slice) -> ShotResults:
    """The first shot's person on his hands in some of the frames."""
    whole = results()
    shot = whole.motions[0]
    assert shot is not None
    R = shot.people[0].R_cam_root.copy()
    R[frames] = HEAD_OVER_HEELS @ R[frames]
    person = replace(shot.people[0], R_cam_root=R)
    return replace(whole, motions=[replace(shot, people=(person,)), *whole.motions[1:]])


def off_deg(given: ShotResults) -> float:
    """Between the true vertical and that of the first shot."""
    camera_0 = camera_of(given, 0)
    up = vertical_of(camera_0, standing_axes(given, 0)).upright.direction
    return float(np.degrees(np.arccos(np.clip(up @ TRUE_UP, -1, 1))))


def test_who_stands_says_where_up_is() -> None:
    assert len(standing_axes(results(), 0)) == 1
    assert off_deg(results()) < 6


def test_a_handstand_does_not_turn_the_world_over() -> None:
    handstand = upside_down(slice(None))
    assert not standing_axes(handstand, 0)
    assert off_deg(handstand) < 30  # the picture's own vertical is left


def lying(turn: np.ndarray) -> ShotResults:
    """The first shot's person turned about the camera's axes in all frames."""
    whole = results()
    shot = whole.motions[0]
    assert shot is not None
    person = replace(shot.people[0], R_cam_root=rotvec_to_rotmat(np.radians(turn)) @ shot.people[0].R_cam_root)
    return replace(whole, motions=[replace(shot, people=(person,)), *whole.motions[1:]])


def test_who_lies_does_not_say_where_up_is() -> None:
    for turn in ([0.0, 0.0, 90.0], [0.0, 0.0, -60.0], [90.0, 0.0, 0.0], [-90.0, 0.0, 0.0]):
        assert not standing_axes(lying(np.array(turn)), 0), turn
        assert off_deg(lying(np.array(turn))) < 30
    assert standing_axes(lying(np.array([0.0, 0.0, 12.0])), 0), "a camera may be rolled a little"


def test_who_turns_cartwheels_counts_while_he_stands() -> None:
    cartwheel = upside_down(slice(0, 3 * LENGTH // 4))
    (axis,) = standing_axes(cartwheel, 0)
    (standing,) = standing_axes(results(), 0)
    assert axis.axis @ standing.axis > np.cos(np.deg2rad(5)) and axis.sigma_deg > standing.sigma_deg
    assert off_deg(cartwheel) < 10


def test_a_shot_without_walls_takes_the_vertical_from_one_that_has_them() -> None:
    whole = results()
    true = [camera(k)[0].T @ np.array([0.0, 0, 1]) for k in range(3)]
    leaning = rotvec_to_rotmat(np.radians([6.0, 0, 0])) @ true[1]
    verticals = {
        k: ShotVertical((UpDirection(up, sigma_deg),), Upright(up, sigma_deg))
        for k, (up, sigma_deg) in enumerate([(true[0], 1.0), (leaning, 10.0), (true[2], 1.0)])
    }
    R = np.stack([camera(0)[0].T @ camera(k)[0] for k in range(3)])
    found = upright_together(whole, ShotRotations(R, (0, 0, 2), (), (), (None, None, None)), verticals)
    assert sorted(found) == [0, 1]  # the third shares a world with nobody
    assert np.degrees(np.arccos(found[1].direction @ true[1])) < 1
    assert found[0].sigma_deg == 1.0 and 1 < found[1].sigma_deg < 5
