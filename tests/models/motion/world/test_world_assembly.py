"""From shots to one world: cuts are joined, failed shots are marked, strangers are kept apart."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.cuts.camera_rotation import align_by_bundle, align_by_eight_point, viewing_axes
from humanmm.models.cuts.hypotheses import SIDES_SWAPPED
from humanmm.models.cuts.sides import CutCameras, CutPerson
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.world.align import ShotResults, align
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import CutAlignment, PersonShotMotion, ShotMotion, WorldMotion
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

FPS, LENGTH = 30.0, 20
INTRINSICS = Intrinsics(900.0, 960, 540, "given", 0.0)
BETAS = np.zeros(10)
AZIMUTHS_DEG = (-60.0, 30.0, 150.0)


def body(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Somebody who stands and turns slowly, arms bent: R_world_root, body pose, pelvis."""
    time_s = frames / FPS
    pose = np.zeros((len(frames), 23, 3))
    pose[:, 15, 2], pose[:, 16, 2] = -1.1, 0.9
    pose[:, 17, 1], pose[:, 18, 1] = -0.9 + 0.2 * np.sin(5 * time_s), 0.7
    pose[:, 0, 0], pose[:, 3, 0] = -0.3, 0.5
    upright = rotvec_to_rotmat(np.array([np.pi / 2, 0, 0]))
    turn = rotvec_to_rotmat(np.outer(0.5 * time_s, [0, 0, 1.0]))
    return turn @ upright, pose, np.tile([0.0, 0.0, 0.95], (len(frames), 1))


def camera(shot: int) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam and centre of a shot's standing camera."""
    azimuth = np.radians(AZIMUTHS_DEG[shot])
    centre = np.array([4 * np.cos(azimuth), 4 * np.sin(azimuth), 1.5])
    z = np.array([0, 0, 0.9]) - centre
    z /= np.linalg.norm(z)
    x = np.cross(z, [0, 0, 1.0]) / np.linalg.norm(np.cross(z, [0, 0, 1.0]))
    return np.stack([x, np.cross(z, x), z], axis=1), centre


def shot_of(index: int, person: int = 0) -> tuple[Shot, ScenePeople, ShotCamera, ShotMotion]:
    """A shot of LENGTH frames with exact observations and an exact fit."""
    frames = np.arange(index * LENGTH, (index + 1) * LENGTH, dtype=np.int32)
    R_world_root, pose, pelvis = body(frames)
    R, centre = camera(index)
    R_cam_root, pelvis_cam = R.T @ R_world_root, (pelvis - centre) @ R
    joints, rotations = forward_kinematics(load_body().rest_joints(BETAS), R_cam_root, pose, pelvis_cam)
    points = load_landmarks().place(BETAS, joints, rotations)
    pixels = (points / points[..., 2:]) @ K_of(INTRINSICS).T
    keypoints = np.concatenate([pixels[..., :2], np.ones((LENGTH, 33, 1))], axis=-1)
    relative = points - points[:, [23, 24]].mean(axis=1, keepdims=True)
    landmarks = np.einsum("nba,njb->nja", viewing_axes(keypoints, K_of(INTRINSICS)), relative)
    box = np.concatenate([keypoints[..., :2].min(axis=1), keypoints[..., :2].max(axis=1)], axis=1)
    track = PersonTrack(
        frame=frames,
        keypoints2d=keypoints.astype(np.float32),
        landmarks3d=landmarks.astype(np.float32),
        bbox=box.astype(np.float32),
        confidence=np.ones(LENGTH, np.float32),
        masks=Silhouettes.pack(np.zeros((LENGTH, 128, 128))),
        mask_affine=np.zeros((LENGTH, 2, 3), np.float32),
        color_frame=frames[:1],
        color_histogram=np.full((1, 8), 1 / 8, np.float32),
    )
    motion = PersonShotMotion(
        person,
        frames,
        np.ones(LENGTH, bool),
        R_cam_root,
        pose,
        BETAS,
        pelvis_cam,
        np.ones(LENGTH, np.float32),
        np.ones(LENGTH, np.float32),
    )
    start, end = int(frames[0]), int(frames[-1]) + 1
    still = ShotCamera(
        start, end, np.tile(np.eye(3), (LENGTH, 1, 1)), np.zeros((LENGTH, 3)),
        np.tile(K_of(INTRINSICS), (LENGTH, 1, 1)), "static", True, float("nan"),
    )  # fmt: skip
    began = Transition("cut", start, start, "scene") if index else None
    return (
        Shot(index, start, end, index, began, (Appearance(person, 0, ()),)),
        ScenePeople(start, end, (track,)),
        still,
        ShotMotion(start, end, (motion,)),
    )


def results(people: tuple[int, ...] = (0, 0, 0)) -> ShotResults:
    shots, scenes, cameras, motions = zip(*(shot_of(k, person) for k, person in enumerate(people)), strict=True)
    cast = tuple(Person(k, BETAS, 1.0) for k in sorted(set(people)))
    listed = ShotList(3 * LENGTH, shots, cast)
    return ShotResults(listed, scenes, cameras, motions, np.arange(3 * LENGTH) / FPS, INTRINSICS, [()] * 3)


def turn_error_deg(world: WorldMotion, frame_a: int, frame_b: int) -> float:
    found = world.R_world_cam[frame_a].T @ world.R_world_cam[frame_b]
    true = camera(frame_a // LENGTH)[0].T @ camera(frame_b // LENGTH)[0]
    return float(np.degrees(np.linalg.norm(rotmat_to_rotvec(found.T @ true))))


def test_exact_shots_give_back_cameras_and_motion() -> None:
    world = align(results())
    assert [cut.linked for cut in world.cuts] == [True, True]
    # The cut is exact up to a degree or two: priors pull motion and bones a little.
    assert max(turn_error_deg(world, 19, 20), turn_error_deg(world, 39, 40)) < 4.0
    person = world.people[0]
    assert person.observed.all() and len(person.frame) == 3 * LENGTH
    np.testing.assert_allclose(person.pelvis_world, np.tile([0, 0, 0.95], (60, 1)), atol=0.08)
    forward = world.R_world_cam[0][:, 2]
    assert abs(forward[0]) < 1e-6 and forward[1] > 0.9


def test_reported_turns_are_those_of_the_cameras() -> None:
    world = align(results())
    for cut in world.cuts:
        turn = world.R_world_cam[cut.cut_frame - 1].T @ world.R_world_cam[cut.cut_frame]
        np.testing.assert_allclose(cut.R_before_after, turn)


def test_every_piece_of_evidence_is_told_and_how_certain_a_cut_is() -> None:
    world = align(results())
    assert [(one.shot_a, one.shot_b, one.source, one.used) for one in world.evidence] == [
        (0, 1, "person 0", True),
        (1, 2, "person 0", True),
    ]
    assert all(cut.uncertainty_deg < 30 and cut.probability > 0.8 for cut in world.cuts) and not world.warnings


def test_somebody_whose_sides_do_not_fit_the_rest_is_told() -> None:
    def torn(people: Sequence[CutPerson], cameras: CutCameras, **when: Any) -> CutAlignment:
        cut = align_by_bundle(people, cameras, **when)
        swapped = replace(cut.hypotheses[0], source=f"people, {SIDES_SWAPPED}")
        return replace(cut, hypotheses=(swapped,))

    world = align(results(), method=torn)
    assert world.evidence[0].source == "person 0, left and right swapped"
    assert any("face the wrong way" in warning for warning in world.warnings)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_failed_shot_is_marked_and_the_others_keep_together(lost: int) -> None:
    whole = results()
    cameras = [None if k == lost else c for k, c in enumerate(whole.cameras)]
    motions = [None if k == lost else m for k, m in enumerate(whole.motions)]
    world = align(replace(whole, cameras=cameras, motions=motions))
    codes = world.camera_source.reshape(3, LENGTH)
    assert (codes[lost] == 4).all() and (np.delete(codes, lost, axis=0) == 0).all()
    assert np.isfinite(world.t_world_cam).all()
    person = world.people[0]
    assert not person.observed[(person.frame // LENGTH) == lost].any()
    assert person.observed.sum() == 2 * LENGTH
    if lost == 1:  # two thirds of a second are lost between them
        assert any("uncertain" in warning for warning in world.warnings)


def test_a_shot_of_somebody_else_keeps_gravity_and_floor_and_says_so() -> None:
    world = align(results((0, 0, 1)))
    assert [cut.linked for cut in world.cuts] == [True, False]
    assert world.cuts[1].method == "none"
    stranger = world.people[1]
    np.testing.assert_allclose(stranger.pelvis_world[0], [0, 0, 0.95], atol=0.1)
    up = world.R_world_cam[40].T @ np.array([0, 0, 1.0])
    true = camera(2)[0].T @ np.array([0, 0, 1.0])
    assert np.degrees(np.arccos(np.clip(up @ true, -1, 1))) < 6.0


def within(motion: ShotMotion, clear: tuple[int, int]) -> ShotMotion:
    """The motion in the clear frames of its shot, as `hmr` gives it."""
    (person,) = motion.people
    rows = (person.frame >= clear[0]) & (person.frame < clear[1])
    kept = {f.name: getattr(person, f.name)[rows] for f in fields(person) if f.name not in ("person", "betas")}
    return replace(motion, people=(replace(person, **kept),))


def test_frames_of_a_dissolve_are_not_observed_on_either_side() -> None:
    whole = results()
    dissolve = Transition("dissolve", 17, 23, "scene")
    first, second = replace(whole.shots.shots[0], ending=dissolve), replace(whole.shots.shots[1], transition=dissolve)
    shots = replace(whole.shots, shots=(first, second, whole.shots.shots[2]))
    motions = [
        within(m, shot.outside_transitions) for m, shot in zip(whole.motions, shots.shots, strict=True) if m is not None
    ]
    world = align(replace(whole, shots=shots, motions=motions))
    hidden = np.flatnonzero(~world.people[0].observed)
    np.testing.assert_array_equal(hidden, np.arange(17, 23))
    assert world.cuts[0].gap_s > 0.2


def test_a_shot_with_nobody_in_it_keeps_its_camera() -> None:
    whole = results()
    middle = whole.motions[1]
    assert middle is not None
    empty = replace(whole.shots.shots[1], people=())
    shots = replace(whole.shots, shots=(whole.shots.shots[0], empty, whole.shots.shots[2]))
    motions = (whole.motions[0], replace(middle, people=()), whole.motions[2])
    world = align(replace(whole, shots=shots, motions=motions))
    assert [cut.linked for cut in world.cuts] == [False, True]
    assert np.isfinite(world.R_world_cam).all() and np.isfinite(world.t_world_cam).all()
    assert (world.camera_source[20:40] == 0).all()


def test_the_papers_way_is_there_too() -> None:
    world = align(results(), method=align_by_eight_point)
    assert {cut.method for cut in world.cuts} == {"eight-point"}
    assert max(turn_error_deg(world, 19, 20), turn_error_deg(world, 39, 40)) < 25.0


def test_a_turn_that_is_known_is_taken_as_it_is_and_the_other_cut_is_still_solved() -> None:
    known = camera(0)[0].T @ camera(1)[0]
    world = align(results(), known_rotations={LENGTH: known})
    assert [cut.method for cut in world.cuts] == ["given", "bundle"]
    assert turn_error_deg(world, 19, 20) < 0.1  # levelling all shots together moves it by nothing
    assert turn_error_deg(world, 39, 40) < 4.0
