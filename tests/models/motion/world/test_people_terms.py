"""What people say of their sizes and of the focal length."""

import numpy as np
import pytest
from walker import EDGE, FPS, stride

from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.world.people_terms import equations_of_people
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.solver import solve
from humanmm.models.motion.world.state import SolveSettings, WorldState


def two_people(*, second: float, size_known: bool = False) -> tuple[list[ShotTrajectory], list[ShotRig]]:
    """Two who walk abreast, each with one foot standing, filmed from in front and from behind by static cameras; the
    second is taken for `second` times as large as he is, and so for as far away."""
    pelvis, feet = stride(40)
    trajectories, rigs = [], []
    for shot, (rows, camera) in enumerate(
        ((np.arange(20), np.array([5.0, 0.5, 1.5])), (np.arange(20, 40), np.array([-4.0, 1.0, 1.3])))
    ):
        for person, (place, size) in enumerate((((0.0, 0.0, 0.0), 1.0), ((0.3, 1.2, 0.0), second))):
            offset = size * (pelvis[rows] + place - camera)
            seen = (person, shot, rows, rows / FPS, offset, size * feet[rows], np.ones(20), unit(offset))
            trajectories.append(ShotTrajectory(*seen, size_known=size_known and person == 1))
        rigs.append(ShotRig(np.zeros((20, 3)), int(rows[0]), 1.0, scale_known=True))
    return trajectories, rigs


def test_two_people_in_one_world_tell_how_much_larger_the_one_is() -> None:
    trajectories, rigs = two_people(second=0.85)
    size = solve(trajectories, rigs, [EDGE]).size
    assert abs(size[1] / size[0] - 1 / 0.85) < 0.03
    # By what factor both are off, nobody can know.
    assert abs(np.log(size[0] * size[1])) < 0.02


@pytest.mark.parametrize("hz", [5.0, 10.0, 30.0])
def test_at_no_frame_rate_is_every_step_a_hole(hz: float) -> None:
    n = 40
    runs, at = 12.0 * np.arange(n)[:, None] / hz * [1.0, 0.0, 0.0], np.array([0.0, 5.0, -0.5])  # carried by a car
    offset, feet = np.tile(at, (n, 1)) + runs, np.tile([0.0, 0.0, -0.9], (n, 4, 1))
    seen = ShotTrajectory(
        0, 0, np.arange(n), np.arange(n) / hz, offset, feet, np.full(n, 0.9), np.tile(unit(at), (n, 1))
    )
    rig = ShotRig(np.zeros((n, 3)), 0, 1.0, scale_known=True)
    state = WorldState([offset], np.eye(3)[None], np.zeros((1, 3)), np.ones(1), np.zeros(1), 0.0)
    settings = SolveSettings()
    equations = equations_of_people([seen], [rig], state, settings, robust=False, still=False, floor=False)
    np.testing.assert_allclose(equations.gradient, 0.0, atol=1e-9)


def test_whose_height_is_known_keeps_his_size() -> None:
    trajectories, rigs = two_people(second=0.85, size_known=True)
    size = solve(trajectories, rigs, [EDGE]).size
    assert abs(size[1] - 1) < 0.02
    assert abs(size[0] - 0.85) < 0.03


@pytest.mark.parametrize("factor", [0.85, 1.2])
def test_who_walks_at_an_angle_tells_a_wrong_focal_length(factor: float) -> None:
    pelvis, feet = stride(60)
    trajectories, rigs = [], []
    views = ((np.arange(30), np.array([3.0, -3.0, 1.4])), (np.arange(30, 60), np.array([-2.0, -2.5, 1.4])))
    for shot, (rows, camera) in enumerate(views):
        offset = pelvis[rows] - camera
        ahead = np.tile(unit(offset.mean(axis=0)), (30, 1))
        true = ShotTrajectory(0, shot, rows, rows / FPS, offset, feet[rows], np.ones(30), ahead)
        trajectories.append(true.seen_through(-np.log(factor)))
        rigs.append(ShotRig(np.zeros((30, 3)), int(rows[0]), 1.0, scale_known=True))
    found = solve(trajectories, rigs, [EDGE], focal_std=0.3).focal
    assert abs(np.log(found / factor)) < 0.5 * abs(np.log(factor))
    assert solve(trajectories, rigs, [EDGE]).focal == pytest.approx(1.0, abs=1e-6)


def jumps(rate_hz: int, *, aside_m: float) -> tuple[np.ndarray, ShotTrajectory]:
    """Somebody who jumps 0.35 m high and so far aside every 1.5 s with stiff legs, and what a static camera sees."""
    time_s = np.arange(6 * rate_hz) / rate_hz
    flight = np.clip((time_s % 1.5 - 0.5) / (2 * np.sqrt(2 * 0.35 / 9.81)), 0, 1)
    aside, height = aside_m * (time_s // 1.5 + flight), 4 * 0.35 * flight * (1 - flight)
    pelvis = np.stack([aside, np.full_like(time_s, 5.0), 0.92 + height], axis=1)
    soles = np.array([(x, y, -0.92) for x in (0.1, -0.1) for y in (-0.05, 0.15)])
    n, camera = len(time_s), np.array([0.0, 0.0, 1.5])
    feet, ahead = np.tile(soles, (n, 1, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))
    return time_s, ShotTrajectory(0, 0, np.arange(n), time_s, pelvis - camera, feet, np.full(n, 0.9), ahead)


def test_the_same_motion_has_the_same_path_however_many_frames_show_it() -> None:
    at_s, paths = np.arange(0.3, 5.7, 0.1), []
    for rate_hz in (30, 50, 60, 120):
        time_s, trajectory = jumps(rate_hz, aside_m=0.8)
        rig = ShotRig(np.zeros((len(time_s), 3)), 0, 1.0, scale_known=True, level_deg=1.0)
        found = solve([trajectory], [rig], []).pelvis[0]
        paths.append(np.stack([np.interp(at_s, time_s, axis) for axis in found.T], axis=1))
    for path in paths[1:]:
        assert np.abs(np.ptp(path, axis=0) / np.ptp(paths[0], axis=0) - 1)[[0, 2]].max() < 0.03
        moved = path - paths[0]
        assert np.linalg.norm(moved - moved.mean(axis=0), axis=1).max() < 0.005


@pytest.mark.parametrize("aside_m", [0.0, 0.8])
def test_who_jumps_rises_as_high_as_the_pictures_show(aside_m: float) -> None:
    time_s, trajectory = jumps(30, aside_m=aside_m)
    rig = ShotRig(np.zeros((len(time_s), 3)), 0, 1.0, scale_known=True, level_deg=1.0)
    found = solve([trajectory], [rig], []).pelvis[0]
    assert np.ptp(found[:, 2] - trajectory.offset[:, 2]) < 0.05
