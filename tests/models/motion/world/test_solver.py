"""The solve: exact evidence, any unit of a path, noise of depth, one floor."""

from dataclasses import replace

import numpy as np
from walker import EDGE, scene

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import scale_from_feet
from humanmm.models.motion.world.solver import Solution, solve, with_riders


def placed(solution: Solution, pelvis: np.ndarray) -> np.ndarray:
    """Errors of the solved pelvis after the free horizontal shift of the world."""
    found = np.concatenate(solution.pelvis)
    return found - pelvis - np.array([1.0, 1.0, 0.0]) * (found - pelvis)[0]


def test_exact_evidence_gives_the_exact_world() -> None:
    trajectories, rigs, pelvis = scene(scale=0.3)
    solution = solve(trajectories, rigs, [EDGE])
    assert abs(solution.scale[0] - 0.3) < 0.01
    # Inertia's sigma rounds the walker's sway by millimetres.
    assert np.abs(placed(solution, pelvis)).max() < 0.03


def test_standing_feet_determine_the_scale_of_a_cameras_path_whatever_its_unit() -> None:
    for scale in (0.01, 1.0, 50.0):
        trajectories, rigs, _ = scene(scale=scale, noise=0.02)
        assert abs(scale_from_feet(rigs[0], trajectories[:1]) / scale - 1) < 0.25
        found = solve(trajectories, rigs, [EDGE]).scale[0]
        assert abs(found / scale - 1) < 0.15


def test_depth_noise_neither_lets_the_person_jump_at_the_cut_nor_sink() -> None:
    trajectories, rigs, pelvis = scene(noise=0.03)
    found = np.concatenate(solve(trajectories, rigs, [EDGE]).pelvis)
    jump = np.linalg.norm(np.diff(found, axis=0)[29] - np.diff(pelvis, axis=0)[29])
    assert jump < 0.02
    assert abs(np.median(found[:, 2]) - 0.95) < 0.03


def test_who_rides_along_is_placed_and_changes_nothing() -> None:
    trajectories, rigs, _ = scene(scale=0.3)
    above = np.array([0.5, 1.0, 0.8])
    riders = [replace(one, person=1, offset=one.offset + above) for one in trajectories]
    alone = solve(trajectories, rigs, [EDGE])
    both = with_riders(alone, riders, rigs)
    assert (both.rotation is alone.rotation) and (both.origin is alone.origin) and (both.scale is alone.scale)
    np.testing.assert_array_equal(np.concatenate(both.pelvis[:2]), np.concatenate(alone.pelvis))
    apart = np.concatenate(both.pelvis[2:]) - np.concatenate(alone.pelvis)
    assert np.abs(apart - above).max() < 0.1
    assert [one.shape for one in both.contacts[2:]] == [(30, 4), (30, 4)]
    assert set(both.size) == {0, 1} and both.size[0] == alone.size[0]
    assert with_riders(alone, [], rigs) is alone


def test_who_passes_for_a_moment_has_little_say_in_the_size_of_somebody_seen_for_long() -> None:
    trajectories, rigs, _ = scene()
    static = trajectories[1]
    seen = {name: values[:10] for name, values in vars(static).items() if isinstance(values, np.ndarray)}
    # All that a smaller shape does to a trajectory: who is smaller is nearer, with shorter legs.
    small = replace(static, **seen | {name: 0.9 * seen[name] for name in ("offset", "feet")}, person=1)
    size = solve([*trajectories, small], rigs, [EDGE]).size
    assert size[1] > 1.001
    assert abs(np.log(size[0])) < np.log(size[1]) / 3


def test_people_of_different_sizes_all_stand_on_the_floor() -> None:
    trajectories, rigs, _ = scene()
    static = trajectories[1]
    beside = static.offset + np.array([-1.0, 0.5, 0.0])
    # He was fitted as large as the other, and is a tenth smaller: farther away in the fit than he is.
    other = replace(static, person=1, offset=beside, feet=static.feet).grown(1 / 0.9)
    found = solve([*trajectories, other], rigs, [EDGE])
    assert abs(found.size[1] / found.size[0] - 0.9) < 0.02
    for one, at in zip([*trajectories, other], found.pelvis, strict=True):
        soles = at[:, None] + found.size[one.person] * one.feet
        assert abs(soles[..., 2].min(axis=1)).mean() < 0.02


def test_a_rider_is_as_large_as_the_known_cameras_have_him() -> None:
    trajectories, rigs, _ = scene()
    alone = solve(trajectories, rigs, [EDGE])
    rider = replace(trajectories[1], person=1).grown(1 / 0.9)
    found = with_riders(alone, [rider], rigs)
    assert abs(found.size[1] - 0.9) < 0.02
    soles = found.pelvis[2][:, None] + found.size[1] * rider.feet
    assert abs(soles[..., 2].min(axis=1)).mean() < 0.02
    # Who is a witness in another shot is as large here as there.
    again = with_riders(alone, [trajectories[1].grown(1 / 0.9)], rigs)
    assert again.size == alone.size


def test_a_shot_is_as_level_as_its_own_evidence_has_it() -> None:
    trajectories, rigs, _ = scene()
    tilted = rotvec_to_rotmat(np.array([0.1, 0.05, 0.0]))
    turned = [
        replace(one, offset=one.offset @ tilted.T, feet=one.feet @ tilted.T, ahead=one.ahead @ tilted.T)
        for one in trajectories
    ]
    sure = [replace(rig, path=rig.path @ tilted.T, level_deg=1.0, up=tilted[:, 2]) for rig in rigs]
    for rotation in solve(turned, sure, [EDGE]).rotation:
        assert np.degrees(np.arccos((rotation @ tilted)[2, 2])) < 0.5


def test_all_shots_share_one_floor_even_if_they_come_at_different_heights() -> None:
    trajectories, rigs, _ = scene()
    low = np.array([0.0, 0.0, -0.4])
    solution = solve([trajectories[0], replace(trajectories[1], offset=trajectories[1].offset + low)], rigs, [EDGE])
    soles = np.concatenate([p[:, None] + s.feet for p, s in zip(solution.pelvis, trajectories, strict=True)])
    lowest = soles[..., 2].min(axis=1)
    assert np.abs(lowest[:30].mean() - lowest[30:].mean()) < 0.03
    assert np.abs(lowest).max() < 0.06


def test_distances_that_err_as_somebody_squats_and_rises_do_not_tilt_the_camera() -> None:
    rows = np.arange(90)
    bob = np.cos(2 * np.pi * rows / 36)
    offset = np.stack([0 * bob, 3.4 + 0.1 * bob, -0.1 + 0.1 * bob], axis=1)  # farther the higher: an error of 3 %
    sole = np.array([[x, y, -0.8] for x in (0.15, -0.15) for y in (-0.1, 0.1)])
    feet = sole - np.array([0.0, 0.0, 0.1]) * bob[:, None, None]
    ahead = np.tile([0.0, 1.0, 0.0], (90, 1))
    squats = ShotTrajectory(0, 0, rows, rows / 30, offset, feet, np.ones(90), ahead)
    solution = solve([squats], [ShotRig(np.zeros((90, 3)), 0, 1.0, scale_known=True)], [])
    # He stands on one floor all the time: nothing speaks against the camera's vertical.
    assert np.rad2deg(np.arccos(solution.rotation[0, 2, 2])) < 1.0
