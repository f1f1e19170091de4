"""The fit's parts: derivatives, the banded solver, windows."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import load_body
from humanmm.models.body.landmarks import LandmarkModel, load_keypoints
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.fit.equations import NormalEquations, Term, frame_weights
from humanmm.models.motion.fit.evidence import person_skeleton
from humanmm.models.motion.fit.solver import SolverSettings, minimise, solve_windows
from humanmm.models.motion.fit.state import NUM_PARAMETERS, CameraPath, LongMotion, Motion, Skeleton
from humanmm.models.motion.fit.terms import Anchor, Bones, PosePrior, Reprojection, Smoothness

N = 5
K = np.array([[1000.0, 0, 500], [0, 1000, 300], [0, 0, 1]])


def skeleton() -> Skeleton:
    return person_skeleton(np.zeros(10))


def _skeleton(model: LandmarkModel) -> Skeleton:
    return Skeleton(load_body().rest_joints(np.zeros(10)), model.joint, model.offsets(np.zeros(10)))


def slow_motion(num_frames: int, seed: int = 0) -> Motion:
    """Near neighbours in time, as `Smoothness` expects; in front of the camera."""
    rng = np.random.default_rng(seed)
    drift = np.arange(num_frames)[:, None]
    root = rotvec_to_rotmat(rng.normal(size=3) + drift * rng.normal(size=3) * 0.01)
    pose = rng.normal(size=(23, 3)) * 0.3 + drift[..., None] * rng.normal(size=(23, 3)) * 0.01
    return Motion(skeleton(), root, rng.normal(size=3) * 0.2 + [0, 0, 5] + drift * 0.02, rotvec_to_rotmat(pose))


def every_term(motion: Motion) -> dict[str, Term]:
    rng = np.random.default_rng(1)
    n = motion.num_frames
    camera = CameraPath(
        Rotation.from_rotvec(rng.normal(size=(n, 3)) * 0.1).as_matrix(),
        rng.normal(size=(n, 3)) * 0.1,
        np.broadcast_to(K, (n, 3, 3)),
    )
    root = rng.normal(size=(2, 57, 57))
    precisions = root @ np.swapaxes(root, -1, -2)
    walls = np.full(57, 0.2)
    return {
        "reprojection": Reprojection(
            _skeleton(load_keypoints()),
            camera,
            rng.normal(size=(n, 33, 2)) * 100 + 500,
            np.full((n, 33), 20.0),
            rng.uniform(size=(n, 33)),
        ),
        "bones": Bones(
            start=np.array([11, 13, 23, 25, 12]),
            end=np.array([13, 15, 25, 27, 11]),
            vectors=rng.normal(size=(n, 5, 3)) * 0.3,
            R_ref_view=Rotation.random(n, random_state=4).as_matrix(),
            sigma=rng.uniform(0.05, 0.1, (5, 3)),
            tilt_std=np.array([0.1, 0.2, 0.05]),
            weight=rng.uniform(size=(n, 5)),
            time_weight=rng.uniform(0.5, 1, n),
        ),
        "prior": PosePrior(
            rng.normal(size=(2, 57)) * 0.1, precisions, np.array([0.0, 0.5]), -walls, walls, 50.0, rng.uniform(size=n)
        ),
        "anchor": Anchor(slow_motion(n, seed=5), rng.uniform(0.5, 1, 63), rng.uniform(size=n)),
        "smoothness": Smoothness(np.cumsum(rng.uniform(0.02, 0.05, n)), np.full(63, 5.0)),
    }


def test_points_move_as_their_jacobian_says() -> None:
    motion, h = slow_motion(2), 1e-6
    along = np.tile(np.eye(3), (2, 33, 1))
    jacobian = motion.point_rows(slice(None), np.repeat(np.arange(33), 3), along).reshape(2, 33, 3, -1)
    numeric = np.empty_like(jacobian)
    for k in range(NUM_PARAMETERS):
        step = np.zeros((2, NUM_PARAMETERS))
        step[:, k] = h
        numeric[..., k] = (motion.moved(step).points - motion.moved(-step).points) / (2 * h)
    np.testing.assert_allclose(jacobian, numeric, atol=1e-7)


@pytest.mark.parametrize("name", ["reprojection", "bones", "prior", "anchor", "smoothness"])
def test_a_term_s_gradient_is_the_slope_of_its_cost(name: str) -> None:
    motion = slow_motion(N)
    term = every_term(motion)[name]
    equations = NormalEquations(N)
    term.add(motion, equations)
    numeric, h = np.empty((N, NUM_PARAMETERS)), 1e-6
    for frame in range(N):
        for k in range(NUM_PARAMETERS):
            step = np.zeros((N, NUM_PARAMETERS))
            step[frame, k] = h
            numeric[frame, k] = (term.cost(motion.moved(step)) - term.cost(motion.moved(-step))) / (2 * h)
    # Smoothness takes small rotations as commuting: exact to the size of one frame's rotation (here some 1 %).
    # The inner rotation of Bones comes from three rounds of reweighting: nearly, not quite, its minimum.
    tolerance = {"smoothness": 3e-2, "bones": 3e-2}.get(name, 1e-5)
    np.testing.assert_allclose(equations.gradient, numeric, atol=tolerance * np.abs(numeric).max())


def test_the_minimum_is_one_where_every_gradient_vanishes() -> None:
    motion = slow_motion(8)
    terms = list(every_term(motion).values())[1:]
    held = np.zeros(8, bool)
    settings = SolverSettings(max_iterations=200, relative_decrease=1e-12)
    before, after = NormalEquations(8), NormalEquations(8)
    solved = minimise(motion, terms, held=held, settings=settings)
    for term in terms:
        term.add(motion, before)
        term.add(solved, after)
    assert np.abs(after.gradient).max() < 0.02 * np.abs(before.gradient).max()


def test_held_frames_do_not_move() -> None:
    motion = slow_motion(6)
    held = np.array([True, True, False, False, False, False])
    solved = minimise(motion, list(every_term(motion).values()), held=held, settings=SolverSettings())
    np.testing.assert_array_equal(solved.R_body[:2], motion.R_body[:2])
    np.testing.assert_array_equal(solved.pelvis_ref[:2], motion.pelvis_ref[:2])
    assert np.abs(solved.pelvis_ref[2:] - motion.pelvis_ref[2:]).max() > 1e-4


def test_windows_give_what_one_solve_of_everything_gives() -> None:
    """Two cameras at right angles see every point, with 20 mm of noise."""
    truth, num_frames = slow_motion(60), 60
    time_s = np.arange(num_frames) / 30
    noisy = truth.points + np.random.default_rng(2).normal(size=truth.points.shape) * 0.02
    views = []
    for R, t in ((np.eye(3), np.zeros(3)), (rotvec_to_rotmat([0, np.pi / 2, 0]), np.array([0.0, 0, 10]))):
        path = CameraPath(*(np.broadcast_to(x, (num_frames, *x.shape)) for x in (R, t, K)))
        seen = path.to_camera(noisy)
        views.append((path, seen[..., :2] / seen[..., 2:] * 1000 + [500, 300]))

    def terms_of(frames: slice) -> Sequence[Term]:
        weight = np.ones((len(time_s[frames]), 33))
        seen = [
            Reprojection(skeleton(), path.frames(frames), px[frames], 4 * weight, weight, 100.0) for path, px in views
        ]
        return [*seen, Smoothness(time_s[frames], np.full(63, 10.0))]

    exact = {"max_iterations": 15, "relative_decrease": 1e-7}
    start = LongMotion.empty(truth.skeleton, num_frames)
    start.put(slice(None), truth)
    told: list[tuple[int, int]] = []
    whole, parts = (
        solve_windows(
            start, terms_of, SolverSettings(**exact, **windows), progress=lambda *so_far: told.append(so_far)
        ).frames(slice(None))
        for windows in ({"window": 1000}, {"window": 20, "lookahead": 20})
    )
    # What a window cannot see lies 20 frames ahead: a twentieth remains of noise of 20 mm, and no jump between windows.
    gap = np.linalg.norm(whole.points - parts.points, axis=-1)
    assert gap.mean() < 1e-3
    assert np.abs(np.diff(gap, axis=0)).max() < 2e-3
    assert told == [(60, 60), (20, 60), (40, 60), (60, 60)]


@pytest.mark.parametrize(
    ("hz", "window", "lookahead"),
    [(10, 120, 24), (24, 120, 24), (29.97, 120, 24), (30, 120, 24), (60, 240, 48), (120, 480, 96), (1000, 960, 192)],
)
def test_windows_last_as_long_where_there_are_more_frames_a_second(hz: float, window: int, lookahead: int) -> None:
    lasting = SolverSettings(max_iterations=6).lasting(100.0 + np.arange(200) / hz)
    assert lasting == SolverSettings(max_iterations=6, window=window, lookahead=lookahead)
    assert SolverSettings().lasting(np.zeros(1)) == SolverSettings()


def test_a_long_motion_gives_back_what_was_put_in() -> None:
    motion = slow_motion(10)
    kept = LongMotion.empty(motion.skeleton, 30)
    kept.put(slice(5, 15), motion)
    back = kept.frames(slice(7, 15))
    np.testing.assert_allclose(back.R_local, motion.R_local[2:], atol=1e-6)  # rotation vectors in single precision
    np.testing.assert_array_equal(back.pelvis_ref, motion.pelvis_ref[2:])


def test_frames_weigh_by_the_time_they_stand_for() -> None:
    np.testing.assert_allclose(frame_weights(np.arange(10) / 60), 0.5)
    np.testing.assert_allclose(frame_weights(np.array([0.0, 1 / 30, 3 / 30])), [1, 1.5, 2])
