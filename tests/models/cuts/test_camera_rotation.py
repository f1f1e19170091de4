"""Cuts: the bundle adjustment finds the rotation, the essential matrix agrees with OpenCV."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from walking import FPS, K, case

from humanmm.models.cuts import bundle as cut_bundle
from humanmm.models.cuts import camera_rotation as cuts
from humanmm.models.cuts import epipolar, residuals
from humanmm.models.cuts.sides import CutCameras, CutPerson
from humanmm.models.geometry.robust import huber_weight
from humanmm.models.geometry.rotations import angle_between_deg, rotvec_to_rotmat
from humanmm.models.records.motion import CutAlignment

CAMERAS = CutCameras(K, K, moving=False)


def align(person: CutPerson, method: cuts.CutMethod = cuts.align_by_bundle) -> CutAlignment:
    return method([person], CAMERAS, cut_frame=20, cut_time_s=19.5 / FPS)


@pytest.mark.parametrize("angle_deg", [5.0, 60.0, 120.0, 178.0])
def test_the_rotation_at_a_cut_is_found_at_every_angle(angle_deg: float) -> None:
    person, truth = case(angle_deg)
    found = align(person)
    # 3 px and 2 cm of noise over a window leave two to three degrees.
    assert angle_between_deg(found.R_before_after, truth) < 5.0
    assert found.linked and found.residual_px < 10.0


def test_the_bundle_mends_a_tilted_pose_estimator_that_rotation_alone_believes() -> None:
    bundle, turned = [], []
    for seed, angle_deg in enumerate([40.0, 80.0, 120.0, 160.0]):
        person, truth = case(angle_deg, tilt_deg=8.0, seed=10 * seed)
        bundle.append(angle_between_deg(align(person).R_before_after, truth))
        item = cuts._prepare(person, CAMERAS, 19.5 / FPS)
        start = cuts._starts(item, person)[0]
        turned.append(angle_between_deg(start, truth))
    assert np.mean(bundle) < 0.7 * np.mean(turned)


@pytest.mark.parametrize("bones", [0.8, 1.25])
def test_the_equations_are_derivatives_of_the_residuals(bones: float) -> None:
    """Of Gauss and Newton; where all bones are stretched (0.8), theirs are the whole second derivative."""
    person, truth = case(70.0, tilt_deg=5.0)
    item = cuts._prepare(person, CAMERAS, 19.5 / FPS)
    item = replace(item, bone_lengths=bones * item.bone_lengths)
    problem = residuals.CutProblem([item], cuts._BODY, residuals.BundleSettings())
    h, num = 1e-4, 9 * problem.num_points + 15
    steps = h * np.concatenate([np.zeros((1, num)), np.eye(num), -np.eye(num)])
    at = cut_bundle.starts_of([item], np.repeat(truth[None], len(steps), axis=0))
    state, camera = at.people[0].moved(steps[:, :-9]), at.camera.moved(steps[:, -9:])

    def derivative(values: np.ndarray) -> np.ndarray:
        return (values[1 : num + 1] - values[num + 1 :]).reshape(num, -1).T / (2 * h)

    gradient, hessian = (np.zeros(shape) for shape in (num, (num, num)))
    sides = [problem._side_residuals(view, k, state, camera) for k, view in enumerate((item.before, item.after))]
    of_velocity = camera.velocity / problem.settings.camera_velocity_ms
    for values in (*(part for side in sides for part in side), problem._prior(state), of_velocity):
        J = derivative(values)
        size = np.linalg.norm(values[0], axis=-1, keepdims=True)
        # The robust weight scales image residuals and their derivatives alike.
        robust = huber_weight(size, residuals.HUBER) if values.shape[-1] == 2 else np.ones_like(size)
        weight = np.broadcast_to(robust, values[0].shape).ravel()
        gradient += J.T @ (weight * values[0].ravel())
        hessian += J.T @ (weight[:, None] * J)
    length, direction, _ = problem._bones(item, state)
    J = derivative(length)
    gradient += J.T @ length[0].ravel()
    hessian += J.T @ J
    if bones < 1:
        assert (length[0] > 0).all()
        by_vector = derivative(direction).reshape(*direction.shape[1:], num)
        vectors = derivative(problem.along_bone @ residuals.moving(state, residuals._bone_times(item)))
        hessian += np.einsum("tb,tbcu,tbcv->uv", length[0], by_vector, vectors.reshape(by_vector.shape))
    (found,) = problem.equations(at.people, at.camera)
    motion, others = slice(0, -15), slice(-15, None)
    both = np.concatenate([hessian, gradient[:, None]], axis=1)
    np.testing.assert_allclose(found.motion.matrix(0), hessian[motion, motion], rtol=1e-4, atol=1e-2)
    np.testing.assert_allclose(found.mixed[0, :, :-1], hessian[motion, others], rtol=1e-4, atol=1e-2)
    np.testing.assert_allclose(found.mixed[0, :, -1], gradient[motion], rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(found.others[0, :-1], both[others, -16:], rtol=1e-4, atol=1e-2)


def test_runs_side_by_side_are_those_alone() -> None:
    person, truth = case(70.0)
    item = cuts._prepare(person, CAMERAS, 19.5 / FPS)
    starts = truth @ rotvec_to_rotmat(np.radians([[0.0, 0.0, 0.0], [0.0, 40.0, 0.0], [30.0, 0.0, 0.0]]))
    settings = residuals.BundleSettings()
    together = [one.R_before_after for one in cut_bundle.adjust([item], cuts._BODY, starts, settings)]
    for start in starts:
        (alone,) = cut_bundle.adjust([item], cuts._BODY, start[None], settings)
        assert min(angle_between_deg(alone.R_before_after, R) for R in together) < 0.5  # stopped a little earlier


def test_a_long_gap_is_reported() -> None:
    person, _ = case(60.0)
    late = replace(person.after, time_s=person.after.time_s + 0.5)
    found = align(CutPerson(person.before, late))
    assert found.gap_s > 0.5 and any("uncertain" in warning for warning in found.warnings)


@pytest.mark.parametrize("method", [cuts.align_by_bundle, cuts.align_by_eight_point])
def test_without_anybody_on_both_sides_there_is_no_link(method: cuts.CutMethod) -> None:
    found = method([], CAMERAS, cut_frame=7, cut_time_s=0.2)
    assert found.method == "none" and not found.linked


def matches(seed: int, num: int = 30) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    R, t = rotvec_to_rotmat(rng.normal(0, 0.2, 3)), rng.normal(size=3)
    X = rng.uniform([-2, -2, 4], [2, 2, 9], (num, 3))
    Y = (X - t) @ R
    return X[:, :2] / X[:, 2:], Y[:, :2] / Y[:, 2:], R, t / np.linalg.norm(t)


def test_eight_exact_matches_give_the_relative_pose_exactly() -> None:
    first, second, R, t = matches(3)
    view = epipolar.eight_point_pose(first, second, threshold=1e-3)
    assert view is not None
    np.testing.assert_allclose(view.R_before_after, R, atol=1e-6)
    np.testing.assert_allclose(view.t_before_after, t, atol=1e-5)


def test_the_eight_point_step_survives_wrong_matches_like_opencv() -> None:
    first, second, R, _ = matches(5, 60)
    rng = np.random.default_rng(1)
    first, second = (x + rng.normal(0, 3e-4, x.shape) for x in (first, second))
    second[:12] = rng.uniform(-0.4, 0.4, (12, 2))
    view = epipolar.eight_point_pose(first, second, threshold=2e-3, iterations=500)
    assert view is not None
    E, _ = cv2.findEssentialMat(first, second, np.eye(3), method=cv2.RANSAC, threshold=2e-3)
    _, R_after_before, _, _ = cv2.recoverPose(E, first, second, np.eye(3))
    # Both find it; 3e-4 of noise on rays allows a degree.
    assert angle_between_deg(view.R_before_after, R) < 1.0
    assert angle_between_deg(R_after_before.T, view.R_before_after) < 2.0


def test_the_papers_way_needs_eight_keypoints_seen_on_both_sides() -> None:
    person, _ = case(60.0)
    hidden = person.after.keypoints2d.copy()
    hidden[:, 13:, 2] = 0.0
    found = align(CutPerson(person.before, replace(person.after, keypoints2d=hidden)), cuts.align_by_eight_point)
    assert found.method == "none" and "eight are needed" in found.warnings[-1]


def test_a_person_whose_keypoints_are_one_place_ends_no_run() -> None:
    person, _ = case(60.0)
    place = person.after.keypoints2d.copy()
    place[..., :2] = 300.0
    collapsed = replace(person.after, keypoints2d=place)
    item = cuts._prepare(CutPerson(person.before, collapsed), CAMERAS, 19.5 / FPS)
    assert cuts._pnp(cuts._at_cut(item.before), item.after, 0) is None
