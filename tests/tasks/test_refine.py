"""Stage `refine`: the user's settings and his floor reach the motion."""

from dataclasses import replace
from typing import Any

import numpy as np
import three_shots
from held_results import inputs_of, scenes_of

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.refine import refine

SEEN = three_shots.results()
FRAMES = np.arange(3 * three_shots.LENGTH, dtype=np.int32)
WITHOUT_FIT = {"refit": False, "foot_lock": False, "networks": "none"}


def _world(pose_noise_rad: float = 0.0) -> WorldMotion:
    """The man of `three_shots` as he was, his limbs shaken."""
    R_world_root, pose, pelvis = three_shots.body(FRAMES)
    pose = pose + np.random.default_rng(0).normal(0, pose_noise_rad, pose.shape)
    n = len(FRAMES)
    person = PersonMotion(
        person=0, frame=FRAMES, observed=np.ones(n, bool), R_world_root=R_world_root, body_pose=pose,
        betas=three_shots.BETAS, pelvis_world=pelvis, contacts=np.zeros((n, 4), np.float32),
        confidence=np.ones(n, np.float32),
    )  # fmt: skip
    cameras = [three_shots.camera(int(frame) // three_shots.LENGTH) for frame in FRAMES]
    K = np.tile(np.diag([900.0, 900.0, 1.0]), (n, 1, 1))
    K[:, :2, 2] = 480, 270
    R, centre = (np.stack(part) for part in zip(*cameras, strict=True))
    return WorldMotion(R, centre, K, np.zeros(n, np.uint8), (person,), ())


def _refined(world: WorldMotion, corrections: tuple[dict[str, Any], ...] = (), **settings: Any) -> WorldMotion:
    results = {
        "decode": VideoFacts(960, 540, SEEN.time_s, SEEN.time_s == 0, 0, "h264", "mp4"),
        "scenes": scenes_of(SEEN.shots),
        "people": SEEN.scenes,
        "shots": SEEN.shots,
        "align": world,
    }
    return refine(inputs_of("refine", results, refine=WITHOUT_FIT | settings, corrections=list(corrections)))


def test_a_lower_floor_is_what_the_user_says_it_is() -> None:
    plain, corrected = _refined(_world()), _refined(_world(), ({"kind": "floor", "metres": -0.4},))
    rise = corrected.people[0].pelvis_world - plain.people[0].pelvis_world
    np.testing.assert_allclose(rise, np.tile([0.0, 0.0, 0.4], (len(FRAMES), 1)), atol=1e-6)
    np.testing.assert_allclose(corrected.t_world_cam - plain.t_world_cam, rise, atol=1e-6)


def test_a_lower_band_limit_makes_shaken_limbs_quieter() -> None:
    def shaking_deg(cutoff_hz: float) -> float:
        R = rotvec_to_rotmat(_refined(_world(0.1), cutoff_hz=cutoff_hz).people[0].body_pose[:, 3:].astype(np.float64))
        return float(np.degrees(rotation_angle(np.swapaxes(R[:-1], -1, -2) @ R[1:])).mean())

    assert shaking_deg(2.0) < 0.5 * shaking_deg(12.0)


def test_the_jump_of_posture_at_a_cut_is_closed_if_the_user_does_not_forbid_it() -> None:
    world = _world()
    pose = world.people[0].body_pose.copy()
    pose[three_shots.LENGTH :, 17, 1] += 0.6  # an elbow, from the second shot on
    jumping = replace(world, people=(replace(world.people[0], body_pose=pose),))

    def jump_rad(refined: WorldMotion) -> float:
        bent = refined.people[0].body_pose[:, 17]
        return float(np.linalg.norm(bent[three_shots.LENGTH] - bent[three_shots.LENGTH - 1]))

    kept, closed = (_refined(jumping, remove_discontinuities=close, cutoff_hz=60.0) for close in (False, True))
    assert jump_rad(closed) < 0.1 < 0.4 < jump_rad(kept)


def test_the_refit_puts_the_body_where_it_was_seen_if_it_is_asked_for() -> None:
    truth = _world()
    drift = 0.1 * np.sin(FRAMES / 6.0)[:, None] * np.array([1.0, 1.0, 0.0])
    moved = replace(truth.people[0], pelvis_world=truth.people[0].pelvis_world + drift)
    drifting = replace(truth, people=(moved,))

    def wander_m(**settings: Any) -> float:
        refined = _refined(drifting, **settings)
        return float(np.ptp(refined.people[0].pelvis_world[:, :2] - refined.t_world_cam[0, :2], axis=0).max())

    assert wander_m(refit=True) < 0.6 * wander_m()


def test_feet_are_locked_if_it_is_asked_for() -> None:
    world = _world()
    pose = world.people[0].body_pose.copy()
    pose[:, [0, 1], 0] += 0.02 * np.sin(FRAMES / 2.0)[:, None]  # the thighs, and with them the feet
    swaying = replace(world, people=(replace(world.people[0], body_pose=pose),))

    def slide_m(**settings: Any) -> float:
        (person,) = _refined(swaying, cutoff_hz=60.0, **settings).people
        rest = load_body().rest_joints(person.betas)
        joints, _ = forward_kinematics(rest, person.R_world_root, person.body_pose, person.pelvis_world)
        feet = joints[:, list(CONTACT_JOINTS)]
        return float(np.linalg.norm(np.diff(feet, axis=0), axis=-1)[(person.contacts > 0.5)[1:]].mean())

    assert slide_m(foot_lock=True) < 0.5 * slide_m()
