"""The scale of a camera's path from the floor: in any unit, where the vertical errs, and silent without evidence."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import scale_from_floor
from humanmm.models.motion.world.solver import solve


def room(rng: np.random.Generator) -> np.ndarray:
    """Points on the floor, on a wall behind, on a table before it."""
    floor = np.stack([rng.uniform(-3, 3, 60), rng.uniform(-3, 3, 60), np.zeros(60)], axis=1)
    wall = np.stack([rng.uniform(-4, 4, 80), np.full(80, 3.0), rng.uniform(0.2, 3, 80)], axis=1)
    table = np.stack([rng.uniform(1, 2, 20), rng.uniform(0, 1, 20), np.full(20, 0.75)], axis=1)
    return np.concatenate([floor, wall, table])


def shot(
    scale: float = 1.0, *, height_m: float = 1.4, tilt_deg: float = 0.0, level_deg: float = 1.0
) -> tuple[ShotRig, ShotTrajectory]:
    """Somebody who moves all the time before a camera that travels half a metre; axes tilted in the direction of
    view."""
    rng, n, centre = np.random.default_rng(3), 40, np.array([0.0, -5.0, height_m])
    frame = np.arange(n, dtype=np.int32)
    path = np.stack([0.012 * frame, 0 * frame, 0.1 * np.sin(frame / 6)], axis=1)
    pelvis = np.stack([0.3 * np.sin(frame / 4), 0.2 * np.cos(frame / 5), 0.9 + 0 * frame], axis=1)
    feet = np.tile(np.array([[0.1, 0, -0.9], [0.1, 0.2, -0.9], [-0.1, 0, -0.9], [-0.1, 0.2, -0.9]]), (n, 1, 1))
    feet[:, :, 0] += 0.3 * np.sin(frame)[:, None]  # nothing stands still
    c, s = np.cos(np.deg2rad(tilt_deg)), np.sin(np.deg2rad(tilt_deg))
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    points = (room(rng) - centre) @ R.T / scale
    rig = ShotRig(
        path @ R.T / scale, 0, 1.0, scale_known=False, level_deg=level_deg,
        scenery=points * (1 + rng.normal(0, 0.02, (len(points), 1))), relative_std=np.full(len(points), 0.02),
    )  # fmt: skip
    offset = (pelvis - centre - path) @ R.T
    return rig, ShotTrajectory(0, 0, frame, frame / 30, offset, feet @ R.T, np.full(n, 0.9), unit(offset))


@pytest.mark.parametrize("scale", [0.02, 1.0, 40.0])
def test_the_floor_gives_the_scale_in_any_unit(scale: float) -> None:
    rig, person = shot(scale)
    found = scale_from_floor(rig, [person])
    assert found is not None
    assert abs(found.mean - np.log(scale)) < found.sigma < 0.2


def test_a_vertical_that_is_known_to_err_is_made_good_by_the_floor() -> None:
    rig, person = shot(height_m=0.4, tilt_deg=6.0, level_deg=8.0)
    found, believed = scale_from_floor(rig, [person]), scale_from_floor(replace(rig, level_deg=0.5), [person])
    assert found is not None and believed is not None
    assert abs(found.mean) < found.sigma < 0.3
    assert abs(believed.mean) > 1


def test_a_body_too_high_above_everything_does_not_overrule_those_who_are_seen_well() -> None:
    rig, person = shot()
    floating = replace(person, person=1, offset=person.offset + np.array([0, 0, 1.2]), weight=np.full(40, 0.1))
    found = scale_from_floor(rig, [person, floating])
    assert found is not None
    assert abs(found.mean) < 0.12


def test_without_people_or_points_the_floor_says_nothing() -> None:
    rig, person = shot()
    assert scale_from_floor(rig, []) is None
    assert scale_from_floor(replace(rig, relative_std=np.full(160, 0.9)), [person]) is None
    assert scale_from_floor(replace(rig, scenery=np.zeros((0, 3)), relative_std=np.zeros(0)), [person]) is None


def test_feet_that_never_stand_do_not_shrink_a_path_against_the_floor() -> None:
    rig, person = shot(2.5)
    assert abs(np.log(solve([person], [rig], []).scale[0] / 2.5)) < 0.15
