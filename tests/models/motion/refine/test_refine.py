"""Refinement of motions whose truth is known: somebody stands, jumps, is lost for a while, is seen through a cut."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.refine.refine import Observations, RefineSettings, refine_world, sole_heights
from humanmm.models.records.motion import CutAlignment, PersonMotion, WorldMotion
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, ScenePeople, Silhouettes

N = 120
CUT = 60
R_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
BETAS = np.zeros(10)
CAMERA = np.array([0.0, -4.0, 1.3])
R_WORLD_CAM = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # looks along +y
K = np.array([[1000.0, 0.0, 480.0], [0.0, 1000.0, 400.0], [0.0, 0.0, 1.0]])


def standing(fps: float = 30.0) -> tuple[WorldMotion, np.ndarray]:
    """A person who stands and waves, soles on the floor, and the times of the frames."""
    time = np.arange(N) / fps
    body_pose = np.zeros((N, 23, 3))
    body_pose[:, 15, 2] = -1.0 + 0.3 * np.sin(4 * time)  # left upper arm, down and waving
    body_pose[:, 16, 2] = 1.1  # right upper arm, down
    rest = load_body().rest_joints(BETAS)
    height = sole_heights(load_body(), BETAS)[0] - rest[7, 1] + rest[0, 1]
    person = PersonMotion(
        person=0,
        frame=np.arange(N, dtype=np.int32),
        observed=np.ones(N, bool),
        R_world_root=np.tile(R_UPRIGHT, (N, 1, 1)),
        body_pose=body_pose,
        betas=BETAS,
        pelvis_world=np.tile([0.0, 0.0, height], (N, 1)),
        contacts=np.zeros((N, 4), np.float32),
        confidence=np.ones(N, np.float32),
    )
    world = WorldMotion(
        R_world_cam=np.tile(R_WORLD_CAM, (N, 1, 1)),
        t_world_cam=np.tile(CAMERA, (N, 1)),
        K=np.tile(K, (N, 1, 1)),
        camera_source=np.zeros(N, np.uint8),
        people=(person,),
        cuts=(),
    )
    return world, time


def with_person(world: WorldMotion, **changes: np.ndarray) -> WorldMotion:
    return replace(world, people=(replace(world.people[0], **changes),))


def joints(world: WorldMotion) -> np.ndarray:
    p = world.people[0]
    rest = load_body().rest_joints(p.betas)
    return forward_kinematics(rest, p.R_world_root, p.body_pose, p.pelvis_world)[0]


def refined(world: WorldMotion, time: np.ndarray, *, cuts: tuple[int, ...] = (), **changes: bool) -> WorldMotion:
    return refine_world(world, None, time_s=time, cut_frames=cuts, settings=RefineSettings(**changes))


def test_a_clean_motion_is_left_as_it_is() -> None:
    world, time = standing()
    np.testing.assert_allclose(joints(refined(world, time)), joints(world), atol=0.004)


def seen(world: WorldMotion, cut_frames: tuple[int, ...] = ()) -> Observations:
    """What a perfect detector sees of the first person: keypoints and landmarks, one track through one scene."""
    person = world.people[0]
    model = load_landmarks()
    rest = load_body().rest_joints(BETAS)
    places = model.place(BETAS, *forward_kinematics(rest, person.R_world_root, person.body_pose, person.pelvis_world))
    in_camera = (places - world.t_world_cam[:, None]) @ R_WORLD_CAM
    pixels = in_camera[..., :2] / in_camera[..., 2:] * 1000.0 + K[:2, 2]
    # the mask's middle lies where the optical axis goes, so that the viewing ray needs no turning
    affine = np.tile(np.array([[1.0, 0.0, 480.0 - MASK_SIDE / 2], [0.0, 1.0, 400.0 - MASK_SIDE / 2]]), (N, 1, 1))
    track = PersonTrack(
        frame=person.frame,
        keypoints2d=np.concatenate([pixels, np.ones((N, 33, 1))], axis=-1),
        landmarks3d=in_camera - in_camera[:, 23:25].mean(axis=1, keepdims=True),
        bbox=np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1),
        confidence=np.ones(N, np.float32),
        masks=Silhouettes.pack(np.zeros((N, MASK_SIDE, MASK_SIDE))),
        mask_affine=affine,
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, 1), np.float32),
    )
    starts = [0, *cut_frames]
    shots = tuple(
        Shot(index, start, end, 0, None, (Appearance(0, 0, ()),))
        for index, (start, end) in enumerate(zip(starts, [*cut_frames, N], strict=True))
    )
    return Observations(ShotList(N, shots, (Person(0, BETAS, 1.0),)), (ScenePeople(0, N, (track,)),))


def test_feet_that_stand_take_away_the_error_of_the_distance() -> None:
    world, time = standing()
    drift = 0.06 * np.sin(2 * np.pi * 0.5 * time)[:, None] * np.array([0.0, 1.0, 0.0])
    noisy = with_person(world, pelvis_world=world.people[0].pelvis_world + drift)
    told: list[tuple[int, int]] = []
    after = refine_world(noisy, seen(world), time_s=time, cut_frames=(), progress=lambda *so_far: told.append(so_far))
    assert told[-1] == (N, N)
    feet = joints(after)[:, CONTACT_JOINTS]
    assert np.ptp(after.people[0].pelvis_world[:, 1]) < 0.02
    assert np.linalg.norm(np.diff(feet, axis=0), axis=-1).max() < 0.002
    assert (after.people[0].contacts >= 0.5).mean() > 0.9


def test_the_evidence_of_both_shots_puts_a_wrong_posture_right() -> None:
    world, time = standing()
    pose = world.people[0].body_pose.copy()
    pose[CUT:, 16] += [0.0, 0.3, 0.3]  # the right arm, from the cut on
    after = refine_world(with_person(world, body_pose=pose), seen(world, (CUT,)), time_s=time, cut_frames=(CUT,))
    wrist = JOINT_NAMES.index("R_Wrist")
    before = np.linalg.norm(
        joints(with_person(world, body_pose=pose))[CUT:, wrist] - joints(world)[CUT:, wrist], axis=1
    )
    error = np.linalg.norm(joints(after)[CUT:, wrist] - joints(world)[CUT:, wrist], axis=1)
    assert error.mean() < 0.35 * before.mean()


def test_frames_that_were_not_believed_are_not_fitted_to() -> None:
    world, time = standing()
    observed = (np.arange(N) < 50) | (np.arange(N) >= 58)
    observations = seen(world)
    track = observations.scenes[0].tracks[0]  # type: ignore[union-attr]
    track.keypoints2d[50:58, :, :2] += 300.0
    after = refine_world(with_person(world, observed=observed), observations, time_s=time, cut_frames=())
    assert np.abs(joints(after) - joints(world)).max() < 0.1  # 300 pixels are 1.2 m at this distance


def test_a_person_whose_scene_failed_is_refined_without_it() -> None:
    world, time = standing()
    failed = Observations(seen(world).shots, (None,))
    np.testing.assert_allclose(
        joints(refine_world(world, failed, time_s=time, cut_frames=())), joints(world), atol=0.004
    )


def test_each_world_has_its_own_floor_and_its_first_person_above_its_origin() -> None:
    world, time = standing()
    sides = np.array([[0.3, 0.2, -0.02], [5.0, 3.0, 0.05]])  # where the two worlds of align lie beside theirs
    one = world.people[0]
    people = tuple(
        replace(
            one, person=number, **{name: getattr(one, name)[rows] for name in (
                "frame", "observed", "R_world_root", "body_pose", "contacts", "confidence")},
            pelvis_world=one.pelvis_world[rows] + sides[number],
        )
        for number, rows in enumerate((slice(0, CUT), slice(CUT, N)))
    )  # fmt: skip
    cut = CutAlignment(CUT, "none", np.eye(3), float("nan"), 180.0, float("nan"), linked=False)
    centre = world.t_world_cam + np.repeat(sides, [CUT, N - CUT], axis=0)
    apart = replace(world, people=people, t_world_cam=centre, cuts=(cut,))
    shots = (Shot(0, 0, CUT, 0, None, (Appearance(0, 0, ()),)), Shot(1, CUT, N, 1, None, (Appearance(1, 0, ()),)))
    observations = Observations(ShotList(N, shots, (Person(0, BETAS, 1.0), Person(1, BETAS, 1.0))), (None, None))
    after = refine_world(apart, observations, time_s=time, cut_frames=(CUT,))
    for person, start in zip(after.people, (0, CUT), strict=True):
        np.testing.assert_allclose(person.pelvis_world[0], [0.0, 0.0, one.pelvis_world[0, 2]], atol=0.004)
        in_camera = person.pelvis_world[0] - after.t_world_cam[start]
        np.testing.assert_allclose(in_camera, one.pelvis_world[0] - CAMERA, atol=0.004)


def test_soles_come_to_stand_on_the_floor() -> None:
    world, time = standing()
    raised = with_person(world, pelvis_world=world.people[0].pelvis_world + np.array([0.0, 0.0, 0.06]))
    after = refined(raised, time)
    soles = joints(after)[:, CONTACT_JOINTS, 2] - sole_heights(load_body(), BETAS)
    assert np.abs(soles).max() < 0.005
    assert after.t_world_cam[0, 2] == pytest.approx(CAMERA[2] - 0.06, abs=0.01)  # the camera sank with the floor


def test_a_jump_stays_a_jump() -> None:
    world, time = standing()
    air = np.clip(0.25 - (time - 2.0) ** 2 / 0.09 * 0.25, 0, None)  # 25 cm up, 0.6 s long
    jumping = with_person(world, pelvis_world=world.people[0].pelvis_world + air[:, None] * [0.0, 0.0, 1.0])
    after = refined(jumping, time)
    rise = after.people[0].pelvis_world[:, 2] - after.people[0].pelvis_world[0, 2]
    assert rise.max() == pytest.approx(0.25, abs=0.03)
    assert not (after.people[0].contacts[(time > 1.85) & (time < 2.15)] >= 0.5).any()
    assert (after.people[0].contacts[time > 2.6] >= 0.5).mean() > 0.9


def test_the_jump_of_posture_at_a_cut_is_shared_out() -> None:
    world, time = standing()
    person = world.people[0]
    R, pose = person.R_world_root.copy(), person.body_pose.copy()
    R[CUT:] = R[CUT:] @ rotvec_to_rotmat([0.1, 0.2, 0.0])
    pose[CUT:, 17] = [0.0, 0.4, 0.0]
    after = refined(with_person(world, R_world_root=R, body_pose=pose), time, cuts=(CUT,))
    R_step = np.swapaxes(after.people[0].R_world_root[:-1], -1, -2) @ after.people[0].R_world_root[1:]
    assert np.degrees(rotation_angle(R_step)).max() < 3.0
    assert np.abs(np.diff(after.people[0].body_pose[:, 17, 1])).max() < 0.08
    far = after.people[0].R_world_root[[10, N - 10]]
    assert np.degrees(rotation_angle(np.swapaxes(far, -1, -2) @ R[[10, N - 10]])).max() < 1.0


def test_a_time_out_of_view_is_filled_without_a_swing() -> None:
    world, time = standing()
    person = world.people[0]
    observed = (np.arange(N) < 40) | (np.arange(N) >= 80)
    pelvis = person.pelvis_world + np.where(np.arange(N) < 60, 0.0, 1.0)[:, None] * [1.0, 0.0, 0.0]
    R = person.R_world_root @ rotvec_to_rotmat(np.where(np.arange(N) < 60, 0.0, 1.5)[:, None] * [0.0, 1.0, 0.0])
    pelvis[~observed], R[~observed] = 77.0, np.eye(3)
    after = refined(with_person(world, observed=observed, pelvis_world=pelvis, R_world_root=R), time).people[0]
    assert after.pelvis_world[:, 0].min() > -0.05
    assert after.pelvis_world[:, 0].max() < 1.05
    R_step = np.swapaxes(after.R_world_root[:-1], -1, -2) @ after.R_world_root[1:]
    assert np.degrees(rotation_angle(R_step)).max() < 6.0
    assert not after.observed[40:80].any()
    assert (after.contacts[45:75] == 0).all()


def test_the_world_begins_under_the_first_person() -> None:
    world, time = standing()
    shifted = replace(
        with_person(world, pelvis_world=world.people[0].pelvis_world + np.array([3.0, -2.0, 0.0])),
        t_world_cam=world.t_world_cam + np.array([3.0, -2.0, 0.0]),
    )
    after = refined(shifted, time)
    np.testing.assert_allclose(after.people[0].pelvis_world[0, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(after.t_world_cam[0], CAMERA, atol=0.01)


def test_quick_movements_are_not_blurred() -> None:
    world, time = standing()
    pose = world.people[0].body_pose.copy()
    pose[:, 16, 2] = 0.6 + 0.5 * np.sin(2 * np.pi * 3.0 * time)  # the right arm, three times a second
    after = refined(with_person(world, body_pose=pose), time)
    assert np.abs(after.people[0].body_pose - pose).max() < 0.03 * 0.5


def test_nobody_seen_is_nobody_refined() -> None:
    world, time = standing()
    after = refined(with_person(world, observed=np.zeros(N, bool)), time)
    np.testing.assert_array_equal(after.people[0].body_pose, world.people[0].body_pose)
    empty = replace(world, people=())
    assert refined(empty, time).people == ()


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_handful_of_frames_is_enough(count: int) -> None:
    world, time = standing()
    person = world.people[0]
    few = {name: getattr(person, name)[:count] for name in ("frame", "observed", "R_world_root", "body_pose")}
    few |= {name: getattr(person, name)[:count] for name in ("pelvis_world", "contacts", "confidence")}
    after = refined(with_person(world, **few), time)
    assert np.isfinite(after.people[0].pelvis_world).all()


def test_sixty_frames_a_second_give_the_same_motion_as_thirty() -> None:
    ends = []
    for fps in (30.0, 60.0):
        world, time = standing(fps)
        drift = 0.06 * np.sin(2 * np.pi * 0.5 * time)[:, None] * np.array([0.0, 1.0, 0.0])
        noisy = with_person(world, pelvis_world=world.people[0].pelvis_world + drift)
        after = refine_world(noisy, seen(world), time_s=time, cut_frames=())
        ends.append(np.ptp(after.people[0].pelvis_world[: round(1.5 * fps), 1]))
    assert ends[0] == pytest.approx(ends[1], abs=0.01)


def test_a_floor_that_the_user_knows_is_z_zero_and_everything_else_moves_with_it() -> None:
    world, time = standing()
    plain = refined(world, time)
    raised = refine_world(world, None, time_s=time, cut_frames=(), settings=RefineSettings(floor_m=-0.4))
    np.testing.assert_allclose(joints(raised) - joints(plain), np.tile([0.0, 0.0, 0.4], (N, 24, 1)), atol=1e-6)
    np.testing.assert_allclose(raised.t_world_cam[:, 2] - plain.t_world_cam[:, 2], 0.4, atol=1e-9)


def test_feet_that_stand_near_a_floor_that_the_user_knows_are_put_on_it() -> None:
    world, time = standing()
    raised = refine_world(world, None, time_s=time, cut_frames=(), settings=RefineSettings(floor_m=0.02))
    soles = joints(raised)[:, list(CONTACT_JOINTS), 2] - sole_heights(load_body(), BETAS)
    assert np.abs(soles[10:-10]).max() < 0.004
