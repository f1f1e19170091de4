"""The world: scale from standing feet, one floor, no jump at cuts, up from the upright, origin and heading as
promised."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.rotations import rotvec_to_rotmat, unit
from humanmm.models.motion.rotations import gravity as world_gravity
from humanmm.models.motion.world.align import _at_origin
from humanmm.models.motion.world.people import interpolate_rotmats, rows_before
from humanmm.models.motion.world.problem import CameraEdge, SameCamera, ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import scale_from_feet
from humanmm.models.motion.world.solver import Solution, solve

FPS = 30.0
EDGE = CameraEdge(0, 1, 8.0)


def stride(num_frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Pelvis (n,3) and sole points from it (n,4,3) of somebody who walks along x, one foot standing at any time."""
    time_s = np.arange(num_frames) / FPS
    pelvis = np.stack([1.2 * time_s, 0.03 * np.sin(2 * np.pi * time_s), 0.95 + 0 * time_s], axis=1)
    feet = np.zeros((num_frames, 4, 3))
    for side, phase in ((0, 0.0), (2, 0.5)):
        cycle = time_s + phase
        step, part = np.floor(cycle), cycle % 1.0
        along = 1.2 * (step + np.clip((part - 0.5) * 2, 0, 1) - phase) + 0.3
        lift = 0.12 * np.sin(np.pi * np.clip((part - 0.5) * 2, 0, 1))
        for toe in (0, 1):
            feet[:, side + toe] = np.stack([along + 0.2 * toe, 0.1 * (1 - side) + 0 * along, lift], axis=1)
    return pelvis, feet - pelvis[:, None]


def scene(
    *, scale: float = 1.0, noise: float = 0.0, cut: int = 30, num_frames: int = 60
) -> tuple[list[ShotTrajectory], list[ShotRig], np.ndarray]:
    """One walker in two shots: a moving camera of unknown scale, then a static one; and the true pelvis."""
    rng = np.random.default_rng(0)
    pelvis, feet = stride(num_frames)
    frames = np.arange(num_frames, dtype=np.int32)
    path = np.stack([0.02 * frames, -4.0 + 0.01 * frames, 1.4 + 0 * frames], axis=1)[:cut]
    centre = np.array([2.0, 4.0, 1.2])
    trajectories, rigs = [], []
    for shot, (rows, camera) in enumerate(
        ((frames[:cut], path), (frames[cut:], np.tile(centre, (num_frames - cut, 1))))
    ):
        offset = pelvis[rows] - camera
        # Depth errs slowly, as a fit's does.
        offset = offset * (1 + noise * np.sin(rows / 9.0 + shot))[:, None] + rng.normal(0, 0.2 * noise, offset.shape)
        trajectories.append(
            ShotTrajectory(0, shot, rows, rows / FPS, offset, feet[rows], np.ones(len(rows)), unit(offset))
        )
        rigs.append(ShotRig((camera - camera[0]) / scale, int(rows[0]), 1.0, scale_known=shot == 1))
    return trajectories, rigs, pelvis


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


def test_all_shots_share_one_floor_even_if_they_come_at_different_heights() -> None:
    trajectories, rigs, _ = scene()
    low = np.array([0.0, 0.0, -0.4])
    solution = solve([trajectories[0], replace(trajectories[1], offset=trajectories[1].offset + low)], rigs, [EDGE])
    soles = np.concatenate([p[:, None] + s.feet for p, s in zip(solution.pelvis, trajectories, strict=True)])
    lowest = soles[..., 2].min(axis=1)
    assert np.abs(lowest[:30].mean() - lowest[30:].mean()) < 0.03
    assert np.abs(lowest).max() < 0.06


def test_a_static_camera_that_returns_is_at_its_old_place() -> None:
    trajectories, rigs, _ = scene(noise=0.03, cut=20, num_frames=60)
    first = ShotRig(np.zeros((20, 3)), 0, 1.0, scale_known=True)
    solution = solve(trajectories, [first, rigs[1]], [EDGE], [SameCamera(0, 0, 1, 40)])
    assert np.linalg.norm(solution.origin[0] - solution.origin[1]) < 0.1


def test_contacts_are_where_the_feet_stand() -> None:
    trajectories, rigs, _ = scene()
    contacts = np.concatenate(solve(trajectories, rigs, [EDGE]).contacts)
    part = (np.arange(60) / FPS) % 1.0
    standing, swinging = (part > 0.1) & (part < 0.4), (part > 0.65) & (part < 0.85)
    assert contacts[standing, 0].min() > 0.6
    assert contacts[swinging, 0].max() < 0.3


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
            seen = (person, shot, rows, rows / FPS, offset, feet[rows], np.ones(20), unit(offset))
            trajectories.append(ShotTrajectory(*seen, size_known=size_known and person == 1))
        rigs.append(ShotRig(np.zeros((20, 3)), int(rows[0]), 1.0, scale_known=True))
    return trajectories, rigs


def test_two_people_in_one_world_tell_how_much_larger_the_one_is() -> None:
    trajectories, rigs = two_people(second=0.85)
    size = solve(trajectories, rigs, [EDGE]).size
    assert abs(size[1] / size[0] - 1 / 0.85) < 0.03
    # By what factor both are off, nobody can know.
    assert abs(np.log(size[0] * size[1])) < 0.02


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


def test_legs_that_swing_too_little_do_not_hold_back_who_comes_toward_the_camera() -> None:
    pelvis, feet = stride(30)
    rows, camera = np.arange(30), np.array([4.0, 0.0, 1.4])
    swing_lost = feet * np.array([0.5, 1.0, 1.0])  # he walks along x, the line of sight
    offset = pelvis - camera
    seen = ShotTrajectory(0, 0, rows, rows / FPS, offset, swing_lost, np.ones(30), unit(offset))
    found = solve([seen], [ShotRig(np.zeros((30, 3)), 0, 1.0, scale_known=True)], []).pelvis[0]
    # Feet that were believed along the line of sight as across it would leave 0.64 of the way.
    assert np.ptp(found[:, 0]) > 0.85 * np.ptp(pelvis[:, 0])


def test_up_comes_from_those_who_stand_and_not_from_the_one_who_bends() -> None:
    rng = np.random.default_rng(4)
    true = rotvec_to_rotmat(np.array([0.4, -0.3, 0.2])) @ np.array([0.0, 0.0, 1.0])
    standing = [rotvec_to_rotmat(rng.normal(0, 0.05, 3)) @ true for _ in range(4)]
    bent = rotvec_to_rotmat(np.array([1.4, 0.0, 0.0])) @ true
    level = np.cross(true, rng.normal(size=(3, 3)))
    evidence = world_gravity.UprightEvidence(
        np.array([bent, *standing]),
        np.full(5, 8.0),
        level / np.linalg.norm(level, axis=1)[:, None],
        np.full(3, 5.0),
    )
    up = world_gravity.up_direction(evidence)
    assert np.degrees(np.arccos(up @ true)) < 3.0


def test_a_pan_has_an_axis_and_a_static_camera_has_none() -> None:
    axis = np.array([0.1, -0.98, 0.17])
    axis /= np.linalg.norm(axis)
    found = world_gravity.pan_axis(rotvec_to_rotmat(np.outer(np.linspace(0, 0.5, 30), axis)))
    assert found is not None and abs(found @ axis) > 0.9999
    assert world_gravity.pan_axis(np.tile(np.eye(3), (30, 1, 1))) is None


def test_the_world_begins_above_the_origin_and_looks_along_y() -> None:
    trajectories, rigs, _ = scene()
    R = Rotation.from_euler("zx", [35, -90], degrees=True).as_matrix()
    solution = _at_origin(solve(trajectories, rigs, [EDGE]), trajectories, R)
    np.testing.assert_allclose(solution.pelvis[0][0, :2], 0, atol=1e-9)
    ahead = solution.rotation[0] @ R[:, 2]
    assert abs(ahead[0]) < 1e-9 and ahead[1] > 0.9


def test_holes_are_interpolated_along_the_shortest_rotation() -> None:
    known = np.array([3, 4, 8])
    row, fraction = rows_before(known, np.arange(3, 9))
    np.testing.assert_allclose(known[row] + fraction * (np.array([4, 8, 8])[row] - known[row]), np.arange(3, 9))
    R = rotvec_to_rotmat(np.outer([0.0, 0.1, 0.9], [0, 0, 1.0]))
    angle = np.arctan2(interpolate_rotmats(R, row, fraction)[:, 1, 0], interpolate_rotmats(R, row, fraction)[:, 0, 0])
    np.testing.assert_allclose(angle, [0, 0.1, 0.3, 0.5, 0.7, 0.9], atol=1e-9)
