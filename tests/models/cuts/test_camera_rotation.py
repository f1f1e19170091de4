"""Cuts: the bundle adjustment finds the turn, the essential matrix agrees with OpenCV, left and right are put right."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import MIRROR, load_landmarks
from humanmm.models.cuts import bundle as cut_bundle
from humanmm.models.cuts import camera_rotation as cuts
from humanmm.models.cuts import epipolar, residuals
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.shots import side_swaps as flips
from humanmm.models.shots.tracking_failures import lapsed_frames

FPS = 30.0
K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])
CAMERAS = cuts.CutCameras(K, K, moving=False)


def walker(num_frames: int) -> np.ndarray:
    """Landmarks (frames, 33, 3) of a body that walks along a curve: world, z up, metres."""
    body, betas = load_body(), np.zeros(10)
    phase = 2 * np.pi * np.arange(num_frames) / FPS
    pose = np.zeros((num_frames, 23, 3))
    swing = 0.5 * np.sin(phase)
    pose[:, 0, 0], pose[:, 1, 0] = -swing, swing
    pose[:, 3, 0], pose[:, 4, 0] = 0.5 + 0.4 * np.cos(phase), 0.5 - 0.4 * np.cos(phase)
    pose[:, 15, 2], pose[:, 16, 2] = -1.1, 1.1
    pose[:, 15, 1], pose[:, 16, 1] = 0.5 * swing, 0.5 * swing
    pose[:, 17, 1], pose[:, 18, 1] = -0.7, 0.7
    heading = Rotation.from_rotvec(np.outer(0.3 * np.arange(num_frames) / FPS, [0, 0, 1]))
    turn = heading * Rotation.from_euler("x", np.pi / 2)
    pelvis = np.cumsum(heading.apply(np.array([0.0, -1.2 / FPS, 0.0])), axis=0)
    pelvis[:, 2] = 0.95
    joints, R = forward_kinematics(body.rest_joints(betas), turn.as_matrix(), pose, pelvis)
    return load_landmarks().place(betas, joints, R)


def camera(azimuth_deg: float, target: np.ndarray, distance: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam and centre of a camera that looks at the target from a side."""
    azimuth = np.radians(azimuth_deg)
    centre = target + distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.12])
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1), centre


def observed(
    points: np.ndarray, R: np.ndarray, centre: np.ndarray, frames: np.ndarray, *, tilt_deg: float = 0.0, seed: int = 0
) -> cuts.SideTrack:
    """What a pose network would say: noisy pixels, 3D points about the mid-hip turned by `tilt_deg`."""
    rng = np.random.default_rng(seed)
    cam = (points[frames] - centre) @ R
    pixels = (cam / cam[..., 2:]) @ K.T
    keypoints = np.concatenate([pixels[..., :2], np.ones((*cam.shape[:2], 1))], axis=-1)
    keypoints[..., :2] += rng.normal(0, 3.0, keypoints[..., :2].shape)
    relative = cam - cam[:, [23, 24]].mean(axis=1, keepdims=True)
    relative = relative @ rotvec_to_rotmat(np.radians(tilt_deg) * np.array([0.6, 0.8, 0.0])).T
    relative += rng.normal(0, 0.02, relative.shape)
    rays = cuts.viewing_axes(keypoints, K)
    return cuts.SideTrack(
        time_s=frames / FPS,
        keypoints2d=keypoints,
        landmarks3d=np.einsum("nba,njb->nja", rays, relative),
        R_cam_root=None,
        R_cut_cam=np.tile(np.eye(3), (len(frames), 1, 1)),
    )


def case(angle_deg: float, *, tilt_deg: float = 0.0, seed: int = 0) -> tuple[cuts.CutPerson, np.ndarray]:
    """A cut at frame 20 between two cameras that stand `angle_deg` apart, and the true R_before_after."""
    points = walker(40)
    target = points[20, [23, 24]].mean(axis=0)
    R1, c1 = camera(20.0, target)
    R2, c2 = camera(20.0 + angle_deg, target, 3.5)
    before = observed(points, R1, c1, np.arange(8, 20), tilt_deg=tilt_deg, seed=seed)
    after = observed(points, R2, c2, np.arange(20, 32), tilt_deg=-tilt_deg, seed=seed + 1)
    return cuts.CutPerson(before, after), R1.T @ R2


def align(person: cuts.CutPerson, **changes: str) -> cuts.CutAlignment:
    method = changes.get("method", "bundle")
    return cuts.align_cut([person], CAMERAS, cut_frame=20, cut_time_s=19.5 / FPS, method=method)  # type: ignore[arg-type]


@pytest.mark.parametrize("angle_deg", [5.0, 60.0, 120.0, 178.0])
def test_the_turn_at_a_cut_is_found_at_every_angle(angle_deg: float) -> None:
    person, truth = case(angle_deg)
    found = align(person)
    # 3 px and 2 cm of noise over a window leave two to three degrees.
    assert cuts.angle_deg(found.R_before_after, truth) < 5.0
    assert found.linked and found.residual_px < 10.0


def test_the_bundle_mends_a_tilted_pose_estimator_that_turning_alone_believes() -> None:
    bundle, turned = [], []
    for seed, angle_deg in enumerate([40.0, 80.0, 120.0, 160.0]):
        person, truth = case(angle_deg, tilt_deg=8.0, seed=10 * seed)
        bundle.append(cuts.angle_deg(align(person).R_before_after, truth))
        item = cuts._prepare(person, CAMERAS, 19.5 / FPS)
        start = cuts._starts(item, person)[0]
        turned.append(cuts.angle_deg(start, truth))
    assert np.mean(bundle) < 0.7 * np.mean(turned)


def test_the_analytic_jacobian_is_that_of_the_residuals() -> None:
    person, truth = case(70.0, tilt_deg=5.0)
    item = cuts._prepare(person, CAMERAS, 19.5 / FPS)
    problem = residuals.CutProblem([item], cuts._BODY, residuals.BundleSettings())
    state, shift = cut_bundle._start(item, truth)
    view = residuals.CameraState(truth, shift, np.zeros(3))
    _, J = problem.linearise(item, state, view)
    rng = np.random.default_rng(0)
    direction = rng.normal(size=problem.num_unknowns)
    h = 1e-6
    ends = []
    for sign in (1.0, -1.0):
        step = sign * h * direction
        moved, seen = state.moved(step[:-9]), view.moved(step[-9:])
        image = [problem._side_residuals(v, k, moved, seen) for k, v in enumerate((item.before, item.after))]
        ends.append(np.concatenate([part.ravel() for pair in image for part in pair]))
    numeric = (ends[0] - ends[1]) / (2 * h)
    image = [problem._side_residuals(v, k, state, view) for k, v in enumerate((item.before, item.after))]
    # The robust weight scales image residuals and their derivatives alike.
    robust = []
    for part in image:
        size = np.linalg.norm(part[0], axis=-1, keepdims=True)
        factor = np.sqrt(np.minimum(1.0, residuals.HUBER / np.maximum(size, 1e-9)))
        robust += [np.broadcast_to(factor, part[0].shape).ravel(), np.ones(part[1].size)]
    analytic = J[: len(numeric)] @ direction
    np.testing.assert_allclose(analytic, numeric * np.concatenate(robust), rtol=1e-4, atol=1e-4)


def test_a_long_gap_is_told() -> None:
    person, _ = case(60.0)
    late = replace(person.after, time_s=person.after.time_s + 0.5)
    found = align(cuts.CutPerson(person.before, late))
    assert found.gap_s > 0.5 and any("uncertain" in warning for warning in found.warnings)


def test_without_anybody_on_both_sides_there_is_no_link() -> None:
    found = cuts.align_cut([], CAMERAS, cut_frame=7, cut_time_s=0.2, method="bundle")
    assert found.method == "none" and not found.linked


def matches(seed: int, num: int = 30) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    R, t = rotvec_to_rotmat(rng.normal(0, 0.2, 3)), rng.normal(size=3)
    X = rng.uniform([-2, -2, 4], [2, 2, 9], (num, 3))
    Y = (X - t) @ R
    return X[:, :2] / X[:, 2:], Y[:, :2] / Y[:, 2:], R, t / np.linalg.norm(t)


def test_eight_exact_matches_give_the_relative_pose_exactly() -> None:
    first, second, R, t = matches(3)
    view = epipolar.relative_pose(first, second, threshold=1e-3)
    assert view is not None
    np.testing.assert_allclose(view.R_before_after, R, atol=1e-6)
    np.testing.assert_allclose(view.t_before_after, t, atol=1e-5)


def test_the_eight_point_step_survives_wrong_matches_like_opencv() -> None:
    first, second, R, _ = matches(5, 60)
    rng = np.random.default_rng(1)
    first, second = (x + rng.normal(0, 3e-4, x.shape) for x in (first, second))
    second[:12] = rng.uniform(-0.4, 0.4, (12, 2))
    view = epipolar.relative_pose(first, second, threshold=2e-3, iterations=500)
    assert view is not None
    E, _ = cv2.findEssentialMat(first, second, np.eye(3), method=cv2.RANSAC, threshold=2e-3)
    _, R_after_before, _, _ = cv2.recoverPose(E, first, second, np.eye(3))
    # Both find it; 3e-4 of noise on rays allows a degree.
    assert cuts.angle_deg(view.R_before_after, R) < 1.0
    assert cuts.angle_deg(R_after_before.T, view.R_before_after) < 2.0


def test_the_papers_way_needs_eight_keypoints_seen_on_both_sides() -> None:
    person, _ = case(60.0)
    hidden = person.after.keypoints2d.copy()
    hidden[:, 13:, 2] = 0.0
    found = align(cuts.CutPerson(person.before, replace(person.after, keypoints2d=hidden)), method="eight-point")
    assert found.method == "none" and "eight are needed" in found.warnings[-1]


def sighting(track: cuts.SideTrack) -> flips.Sighting:
    frame = np.round(track.time_s * FPS).astype(np.int32)
    return flips.Sighting(track.time_s, frame, track.keypoints2d, track.landmarks3d)


def flipped(s: flips.Sighting, frames: slice) -> flips.Sighting:
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    keypoints[frames], landmarks[frames] = (x[frames][:, list(MIRROR)] for x in (keypoints, landmarks))
    return replace(s, keypoints2d=keypoints, landmarks3d=landmarks)


def test_a_run_of_exchanged_frames_within_a_shot_is_found() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    assert flips.swapped_spans([flipped(s, slice(4, 9))], K) == (((int(s.frame[4]), int(s.frame[9])),),)


def test_a_rightly_labelled_video_is_left_alone() -> None:
    person, _ = case(130.0)
    assert flips.swapped_spans([sighting(person.before), sighting(person.after)], K) == ((), ())


@pytest.mark.parametrize("angle_deg", [10.0, 90.0, 170.0])
def test_a_whole_shot_with_left_and_right_exchanged_is_found_by_the_cut(angle_deg: float) -> None:
    person, _ = case(angle_deg)
    first, second = sighting(person.before), sighting(person.after)
    spans = flips.swapped_spans([first, flipped(second, slice(None))], K)
    assert spans == ((), ((int(second.frame[0]), int(second.frame[-1]) + 1),))


def test_the_chain_finds_the_states_of_least_energy() -> None:
    rng = np.random.default_rng(2)
    unary, pairs = rng.normal(size=(7, 2)), rng.normal(size=(6, 2))

    def energy(states: np.ndarray) -> float:
        agree = (states[1:] != states[:-1]).astype(int)
        return float(unary[np.arange(7), states.astype(int)].sum() + pairs[np.arange(6), agree].sum())

    everything = [np.array([(code >> k) & 1 for k in range(7)], bool) for code in range(128)]
    best = min(everything, key=energy)
    np.testing.assert_array_equal(flips.two_state_chain(unary, pairs), best)


NUM_WALK = 60


def walk() -> flips.Sighting:
    points = walker(NUM_WALK)
    return sighting(observed(points, *camera(20.0, points[NUM_WALK // 2, 23]), np.arange(NUM_WALK)))


def mixed(s: flips.Sighting, frames: slice) -> flips.Sighting:
    """The body turned by 70° with the legs' labels exchanged: no choice of sides makes it fit."""
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    legs = np.arange(23, 33)
    for points in (keypoints, landmarks):
        points[frames, 23:] = points[frames][:, np.array(MIRROR)[legs]]
    c, s70 = np.cos(np.radians(70)), np.sin(np.radians(70))
    landmarks[frames] = landmarks[frames] @ np.array([[c, 0, s70], [0, 1, 0], [-s70, 0, c]])
    middle = keypoints[frames, 23:25, :1].mean(axis=1, keepdims=True)
    keypoints[frames, :, :1] = middle - 1.5 * (keypoints[frames, :, :1] - middle)
    return replace(s, keypoints2d=keypoints, landmarks3d=landmarks)


def test_a_walk_has_no_lapse() -> None:
    assert not lapsed_frames(walk()).any()


@pytest.mark.parametrize("frames", [slice(20, 21), slice(20, 29), slice(0, 3), slice(NUM_WALK - 3, NUM_WALK)])
def test_a_spell_of_mixed_up_poses_is_a_lapse(frames: slice) -> None:
    expected = np.zeros(NUM_WALK, bool)
    expected[frames] = True
    np.testing.assert_array_equal(lapsed_frames(mixed(walk(), frames)), expected)


def test_a_long_spell_is_none_because_either_pose_may_be_the_right_one() -> None:
    assert not lapsed_frames(mixed(walk(), slice(15, 40))).any()


def test_exchanged_sides_are_no_lapse() -> None:
    s = walk()
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    for points in (keypoints, landmarks):
        points[20:28] = points[20:28][:, list(MIRROR)]
    assert not lapsed_frames(replace(s, keypoints2d=keypoints, landmarks3d=landmarks)).any()


def test_what_lies_on_either_side_of_a_hole_is_not_compared() -> None:
    s = walk()
    after = s.time_s >= s.time_s[30]
    apart = replace(s, time_s=s.time_s + np.where(after, 1.0, 0.0))
    assert not lapsed_frames(mixed(apart, slice(30, 33))).any()
