"""The directions of walls between shots: four headings, between which people choose; and the vertical."""

import numpy as np
import pytest
from room_edges import camera_towards

from humanmm.models.camera.background.manhattan import ManhattanFrame
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import UpDirection, vertical_of
from humanmm.models.motion.rotations.rotation_mixtures import (
    COMPARE_ALL,
    Mixtures,
    RotationEdge,
    RotationHypothesis,
    compared,
)
from humanmm.models.motion.rotations.shot_rotations import solve_rotations
from humanmm.models.motion.rotations.walls import ONE_PLACE, ShotWalls, wall_edges
from humanmm.models.records.camera import ShotCamera

HEADINGS = (10.0, 130.0, 205.0)
CAMERAS = [camera_towards(heading, 8.0) for heading in HEADINGS]
"""R_world_cam; the walls run along the world's axes."""


def walls(sure: float = 0.9) -> dict[int, ShotWalls]:
    """Each shot's frame, known only up to quarter turns."""
    rotations = [rotvec_to_rotmat(np.array([0.0, 0.0, k * np.pi / 2])) for k in (0, 3, 1)]
    return {
        k: ShotWalls(ManhattanFrame(R.T @ R_quarter, sigma_deg=0.3, margin=50.0), sure)
        for k, (R, R_quarter) in enumerate(zip(CAMERAS, rotations, strict=True))
    }


def truth(a: int, b: int) -> np.ndarray:
    return np.asarray(CAMERAS[a].T @ CAMERAS[b])


def people(a: int, b: int, off_deg: float) -> RotationEdge:
    off = rotvec_to_rotmat(np.radians([0.0, off_deg, 0.0]))
    return RotationEdge(a, b, (RotationHypothesis(truth(a, b) @ off, 15.0, 0.9, "people"),))


def test_one_of_the_four_headings_is_the_true_one_and_none_is_likelier_than_another() -> None:
    edges = wall_edges(walls())
    assert [(edge.a, edge.b) for edge in edges] == [(0, 1), (0, 2), (1, 2)]
    for edge in edges:
        off = [float(np.degrees(rotation_angle(one.R_a_b.T @ truth(edge.a, edge.b)))) for one in edge.hypotheses]
        assert min(off) < 1e-4 and sorted(off)[1] > 80
        assert [one.probability for one in edge.hypotheses] == pytest.approx([ONE_PLACE * 0.81 / 4] * 4)
        assert not edge.connects  # two rooms may have the same walls


def test_all_pairs_of_shots_are_as_many_witnesses_as_there_are_rotations_to_find() -> None:
    found = Mixtures.of(wall_edges(walls()), [None] * len(CAMERAS))
    assert found.weight.sum() == pytest.approx(len(CAMERAS) - 1)


def test_scenes_that_are_not_connected_take_nothing_from_the_walls_of_one() -> None:
    """Two shots of one place are as sure of their rotation, however many other places the video shows."""
    both = {k: walls()[k] for k in (0, 1)}
    elsewhere = {k: walls()[2] for k in range(2, 10)}
    alone = solve_rotations(2, [people(0, 1, 18.0), *wall_edges(both)])
    among = solve_rotations(10, [people(0, 1, 18.0), *wall_edges(both | elsewhere)])
    assert among.certainty[1] == alone.certainty[1]


def test_the_walls_of_many_shots_are_compared_with_those_near_in_time_and_still_exact() -> None:
    some = walls()
    edges = wall_edges({shot: some[shot % 3] for shot in range(20)})
    assert [(edge.a, edge.b) for edge in edges] == compared(range(20)) and len(edges) < 3 * 20
    assert len(wall_edges({shot: some[shot % 3] for shot in range(COMPARE_ALL)})) == COMPARE_ALL * (COMPARE_ALL - 1) / 2
    cuts = []
    for shot in range(19):
        off = rotvec_to_rotmat(np.radians([0.0, 15.0 * (-1) ** shot, 0.0]))
        seen = CAMERAS[shot % 3].T @ CAMERAS[(shot + 1) % 3] @ off
        cuts.append(RotationEdge(shot, shot + 1, (RotationHypothesis(seen, 15.0, 0.9, "people"),)))
    found = solve_rotations(20, [*cuts, *edges])
    for shot, R in enumerate(found.R_group_shot):
        assert np.degrees(rotation_angle(R.T @ truth(0, shot % 3))) < 0.5


def test_people_choose_the_heading_and_walls_make_it_exact() -> None:
    found = solve_rotations(3, [people(0, 1, 18.0), people(1, 2, -14.0), *wall_edges(walls())])
    for k in (1, 2):
        R = found.R_group_shot[0].T @ found.R_group_shot[k]
        assert np.degrees(rotation_angle(R.T @ truth(0, k))) < 0.5
        certainty = found.certainty[k]
        assert certainty is not None and certainty.probability > 0.8 and certainty.sigma_deg < 8


def test_people_between_two_headings_leave_the_rotation_doubtful() -> None:
    found = solve_rotations(2, [people(0, 1, 45.0), *wall_edges({k: walls()[k] for k in (0, 1)})])
    certainty = found.certainty[1]
    assert certainty is not None and certainty.probability < 0.7


def test_walls_tell_the_vertical_better_than_somebody_who_leans() -> None:
    R = CAMERAS[0]
    camera = ShotCamera(
        0, 2, np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), "static", True, 0.0
    )
    leaning = UpDirection(rotvec_to_rotmat(np.radians([9.0, 0.0, 0.0])) @ R.T[:, 2], 8.0)
    alone, with_walls = (vertical_of(camera, [leaning], up).upright for up in (None, walls()[0].up))
    off = [np.degrees(np.arccos(min(1.0, one.direction @ R.T[:, 2]))) for one in (alone, with_walls)]
    assert off[0] > 5 and off[1] < 1.5
    assert with_walls.sigma_deg < 2 < alone.sigma_deg
