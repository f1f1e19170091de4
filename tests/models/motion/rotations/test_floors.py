"""Floors tell the rotation between two shots of one place."""

from dataclasses import replace

import numpy as np
from drawn_floor import carpet, picture
from three_shots import INTRINSICS, LENGTH, camera, results

from humanmm.models.camera.background.ground import GroundPicture
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import angle_between_deg
from humanmm.models.motion.rotations.floors import floor_edges
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, Upright
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.records.shots import Person

CAMERAS = [camera(k) for k in range(3)]
SCALE = 3.0


def upright(sigma_deg: float = 1.0) -> dict[int, Upright]:
    """Where up is in each shot, exactly."""
    return {k: Upright(R.T @ np.array([0, 0, 1.0]), sigma_deg) for k, (R, _) in enumerate(CAMERAS)}


def on(*floors: np.ndarray) -> ShotResults:
    """Three shots, each on one of these floors."""
    whole, K = results(), np.diag([1 / SCALE, 1 / SCALE, 1.0]) @ K_of(INTRINSICS)
    pictures = [
        (GroundPicture(k * LENGTH + 3, np.zeros(2, np.float32), SCALE, picture(floor, K, *CAMERAS[k])),)
        for k, floor in enumerate(floors)
    ]
    return replace(whole, pictures=pictures)


def likeliest(edge: RotationEdge) -> tuple[float, float]:
    """Probability and error, degrees, of the likeliest hypothesis."""
    one = max(edge.hypotheses, key=lambda one: one.probability)
    return one.probability, angle_between_deg(one.R_a_b, CAMERAS[edge.a][0].T @ CAMERAS[edge.b][0])


def test_one_floor_gives_rotations_between_all_shots() -> None:
    edges = floor_edges(on(*[carpet()] * 3), upright())
    assert [(edge.a, edge.b) for edge in edges] == [(0, 1), (0, 2), (1, 2)]
    for edge in edges:
        probability, off_deg = likeliest(edge)
        assert probability > 0.9 and off_deg < 1.5
        assert not edge.connects and edge.pooled


def test_three_floors_are_three_places() -> None:
    edges = floor_edges(on(carpet(1), carpet(2), carpet(3)), upright())
    assert all(likeliest(edge)[0] < 0.5 for edge in edges)


def test_without_somebody_certain_no_camera_has_a_height() -> None:
    whole = on(*[carpet()] * 3)
    doubtful = replace(whole.shots, people=(Person(0, np.zeros(10), 1.0, probability=0.3),))
    assert not floor_edges(replace(whole, shots=doubtful), upright())


def test_a_shot_without_a_picture_says_nothing_and_the_others_do() -> None:
    whole = on(*[carpet()] * 3)
    blind = replace(whole, pictures=[whole.pictures[0], (), whole.pictures[2]])
    assert [(edge.a, edge.b) for edge in floor_edges(blind, upright())] == [(0, 2)]
