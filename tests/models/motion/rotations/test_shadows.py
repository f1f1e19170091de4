"""Shadows tell the heading between two shots of one place; without them, or where they contradict, nothing is named."""

from dataclasses import replace

import numpy as np
import pytest
from shadowed_ground import shadowed
from three_shots import camera, results

from humanmm.models.geometry.rotations import angle_between_deg
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, Upright
from humanmm.models.motion.rotations.shadows import NEIGHBOURS, ShotLight, light_edges, shot_lights
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.motion.rotations.standing import FEET
from humanmm.models.records.shots import Person
from humanmm.models.shadows.light import AZIMUTHS_DEG, ELEVATIONS_DEG

CAMERAS = [camera(k) for k in range(3)]


def upright(sigma_deg: float = 1.0) -> dict[int, Upright]:
    """Where up is in each shot, exactly."""
    return {k: Upright(R.T @ np.array([0, 0, 1.0]), sigma_deg) for k, (R, _) in enumerate(CAMERAS)}


def lit(azimuth_deg: float = 70.0, **light: float) -> ShotResults:
    whole = results()
    return replace(whole, ground=shadowed(whole, CAMERAS, azimuth_deg=azimuth_deg, **light))


def edges_of(whole: ShotResults, sigma_deg: float = 1.0) -> list[RotationEdge]:
    return light_edges(shot_lights(whole, upright(sigma_deg)))


def off_deg(edge: RotationEdge) -> float:
    """Error of the likeliest hypothesis."""
    likeliest = max(edge.hypotheses, key=lambda one: one.probability)
    return angle_between_deg(likeliest.R_a_b, CAMERAS[edge.a][0].T @ CAMERAS[edge.b][0])


@pytest.mark.parametrize("azimuth_deg", [70.0, 200.0, 310.0])
def test_shadows_give_the_heading_between_shots(azimuth_deg: float) -> None:
    edges = edges_of(lit(azimuth_deg))
    assert [(edge.a, edge.b) for edge in edges] == [(0, 1), (0, 2), (1, 2)]
    for edge in edges:
        assert off_deg(edge) < 20
        assert max(one.probability for one in edge.hypotheses) > 0.5
        assert not edge.connects and edge.pooled  # two squares under one sun are not one place


def test_no_shadow_names_no_heading() -> None:
    assert not edges_of(lit(darker=1.0))


def test_a_light_from_above_tells_no_heading() -> None:
    steep = [one.probability for edge in edges_of(lit(elevation_deg=86.0)) for one in edge.hypotheses]
    assert max(steep, default=0.0) < 0.3


def test_where_up_is_hardly_known_shadows_say_less() -> None:
    sure, unsure = (
        max(one.sigma_deg for edge in edges_of(lit(), sigma) for one in edge.hypotheses) for sigma in (1.0, 8.0)
    )
    assert unsure > sure + 5


def test_the_shadow_of_somebody_doubtful_is_not_asked() -> None:
    whole = lit()
    doubtful = replace(whole.shots, people=(Person(0, np.zeros(10), 1.0, probability=0.3),))
    assert not shot_lights(replace(whole, shots=doubtful), upright())


def test_whose_feet_are_never_in_view_stands_on_no_floor() -> None:
    whole = lit()
    scenes = []
    for scene in whole.scenes:
        assert scene is not None
        keypoints = scene.tracks[0].keypoints2d.copy()
        keypoints[:, FEET, 2] = 0.2
        scenes.append(replace(scene, tracks=(replace(scene.tracks[0], keypoints2d=keypoints),)))
    assert not shot_lights(replace(whole, scenes=scenes), upright())


def light(azimuth: int, probability: float = 0.95) -> ShotLight:
    """A light whose direction is known, in level axes."""
    direction = np.full((len(AZIMUTHS_DEG), len(ELEVATIONS_DEG)), 1e-6)
    direction[azimuth, 2] = 1.0
    return ShotLight(np.eye(3), 1.0, 0.08, probability, direction / direction.sum())


def test_each_shot_is_compared_with_the_next_ones_alone() -> None:
    edges = light_edges({shot: light(3) for shot in range(20)})
    assert len(edges) == 19 + 18 + 17 and max(edge.b - edge.a for edge in edges) == NEIGHBOURS


def test_two_lights_differ_by_the_heading() -> None:
    (edge,) = light_edges({0: light(8), 1: light(2)})
    (one,) = edge.hypotheses
    heading = np.degrees(np.arctan2(one.R_a_b[1, 0], one.R_a_b[0, 0]))
    assert heading == pytest.approx(AZIMUTHS_DEG[8] - AZIMUTHS_DEG[2], abs=1)
    assert one.probability == pytest.approx(0.9 * 0.95**2, rel=0.1)
    assert not light_edges({0: light(8), 1: light(2, probability=0.1)})
