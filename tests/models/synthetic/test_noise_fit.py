"""The fit of the noise finds the numbers with which errors were made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.evaluation.skeleton import SMPL_NAMES
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.synthetic.detector_errors import MeasuredClip, person_errors
from humanmm.models.synthetic.detector_noise import DetectorNoise, detect, fitted_noise, pitch_and_roll
from humanmm.models.synthetic.mocap import MocapSequence, leg_length, pose_actor
from humanmm.models.synthetic.multishot import person_track
from humanmm.models.synthetic.noise_fit import NoiseFit, fit_noise
from humanmm.models.synthetic.noise_plot import plot_fit
from humanmm.models.synthetic.rigs import look_at

pytestmark = pytest.mark.slow
SIZE = (1920, 1080)
KNOWN = replace(
    fitted_noise(), keypoint_fraction=0.015, landmark_deviation_m=(0.02, 0.02, 0.04), rotation_deg=(4.0, 6.0, 2.0),
    tilt_deg=3.0, tilt_per_pitch=-0.6, lean_per_roll=-0.4, landmark_scale=0.9, hidden_rate=(0, 0), lost_rate=(0, 0),
    swap_rate=(0.0, 1.0), swap_s=0.6, miss_rate=0.7, miss_s=0.2, shot_fraction=0.3, new_fraction=0.1,
    memory_path=0.15, rest_speed=0.1,
)  # fmt: skip


def measured(sequence: MocapSequence, number: int, noise: DetectorNoise = KNOWN) -> MeasuredClip:
    """A static camera at a random height and roll, and the detector of the known noise."""
    rng = np.random.default_rng(number)
    actor = pose_actor(sequence, rng)
    n, fps, K = len(actor.joints), sequence.fps, np.array([[1200.0, 0, 960], [0, 1200, 540], [0, 0, 1]])
    middle = actor.joints[:, 0].mean(axis=0)
    away = rng.uniform(0, 2 * np.pi)
    eye = middle + 8 * np.array([np.cos(away), np.sin(away), 0]) + [0, 0, rng.uniform(-0.8, 3.5)]
    R = look_at(eye, middle) @ rotvec_to_rotmat(np.array([0.0, 0.0, rng.normal(0, 0.15)]))
    R_all = np.tile(R, (n, 1, 1))
    points = load_landmarks().place(actor.betas, actor.joints, actor.R_world_joint)
    in_camera = (points - eye) @ R
    behind = (actor.R_world_root[:, :, 2] * (eye - actor.joints[:, 0])).sum(axis=1) < 0
    stature = leg_length(load_body().rest_joints(actor.betas)) / leg_length(load_body().J_template)
    pitch, roll = pitch_and_roll(R_all, in_camera[:, 23:25].mean(axis=1))
    seen = detect(in_camera, K, SIZE, behind, stature, fps, noise, rng, pitch=pitch, roll=roll)
    track = person_track(seen, 0, fps, np.full(64, 1 / 64), rng)
    body = BodyParameters(
        "body24", rotmat_to_rotvec(actor.R_world_root), actor.body_pose, actor.betas, actor.joints[:, 0]
    )
    person = PersonSequence(0, np.arange(n), np.ones(n, bool), actor.joints, body=body)
    cameras = CameraSequence(R_all, np.tile(eye, (n, 1)), np.tile(K, (n, 1, 1)))
    truth = MotionSequence(n, fps, SMPL_NAMES, (person,), (), cameras)
    return MeasuredClip(truth, person_errors(truth, [ScenePeople(0, n, (track,))], f"clip{number}"))


def clips(count: int, noise: DetectorNoise) -> list[MeasuredClip]:
    """Two seconds each, of real motion."""
    from humanmm.storage.readers.mocap_pack import read_pack

    sequences = read_pack(Path(__file__).parents[3] / "data" / "mocap" / "cmu_val.npz")
    return [measured(sequences[k % len(sequences)].cropped(0, 60), k, noise) for k in range(count)]


@pytest.fixture(scope="module")
def fit() -> NoiseFit:
    return fit_noise(clips(240, KNOWN))


def test_errors_of_places_and_rotations_are_found(fit: NoiseFit) -> None:
    assert fit.noise.keypoint_fraction == pytest.approx(KNOWN.keypoint_fraction, rel=0.1)
    assert fit.noise.landmark_scale == pytest.approx(KNOWN.landmark_scale, rel=0.05)
    assert fit.noise.rotation_deg == pytest.approx(KNOWN.rotation_deg, rel=0.35)
    assert fit.noise.landmark_deviation_m == pytest.approx(KNOWN.landmark_deviation_m, rel=0.25)


def test_tilt_follows_pitch_and_lean_follows_roll(fit: NoiseFit) -> None:
    pitch = np.degrees(np.mean([one.errors.pitch.mean() for one in fit.series]))  # at 0 the line is an extrapolation
    tilts = [noise.tilt_deg + noise.tilt_per_pitch * pitch for noise in (fit.noise, KNOWN)]
    assert tilts[0] == pytest.approx(tilts[1], abs=1.5)  # 240 shots that are off by 4° each
    assert fit.noise.tilt_per_pitch == pytest.approx(KNOWN.tilt_per_pitch, abs=0.12)
    assert fit.noise.lean_per_roll == pytest.approx(KNOWN.lean_per_roll, abs=0.12)


def test_how_long_errors_stay_and_how_they_follow_movement_is_found(fit: NoiseFit) -> None:
    assert fit.noise.rest_speed == pytest.approx(KNOWN.rest_speed, rel=0.3)
    assert fit.noise.new_fraction == pytest.approx(KNOWN.new_fraction, abs=0.05)
    assert fit.noise.memory_path == pytest.approx(KNOWN.memory_path, rel=0.3)


def test_exchanged_sides_and_missed_frames_are_found(fit: NoiseFit) -> None:
    assert fit.noise.swap_rate[0] == 0
    share = KNOWN.swap_rate[1] * KNOWN.swap_s
    assert fit.noise.swap_rate[1] * fit.noise.swap_s == pytest.approx(share, rel=0.5)
    way_a_second = np.average(
        [one.body_steps(fit.noise.rest_speed).mean() * one.fps for one in fit.series],
        weights=[len(one.found) for one in fit.series],
    )
    missed = fit.noise.miss_rate * way_a_second * fit.noise.miss_s
    gone = np.concatenate([~one.found for one in fit.series])  # two dozen runs of random length, and empty edges
    assert missed == pytest.approx(gone.mean(), rel=0.05)


def test_how_far_hidden_limbs_are_off_and_how_much_that_varies_is_found() -> None:
    noise = replace(
        KNOWN, hidden_rate=(2.0, 2.0), hidden_s=(0.2, 0.2), hidden_factor=3.0, hidden_spread=0.8,
        hidden_landmark_factor=2.0,
    )  # fmt: skip
    found = fit_noise(clips(20, noise)).noise
    assert found.hidden_factor == pytest.approx(3.0, rel=0.25)
    assert found.hidden_spread == pytest.approx(0.8, abs=0.2)
    assert found.hidden_landmark_factor == pytest.approx(2.0, rel=0.25)


def test_the_fit_can_be_drawn(fit: NoiseFit, tmp_path: Path) -> None:
    few = replace(fit, series=fit.series[:3])
    figure = plot_fit(few)
    assert len(figure.axes) == 12
    for axes in figure.axes[:6]:
        for line in axes.lines:
            errors, fractions = line.get_xdata(), line.get_ydata()
            assert (np.diff(errors) >= 0).all() and (fractions[0], fractions[-1]) == (0, 1), "a distribution"
    figure.savefig(tmp_path / "fit.png", dpi=80)
    assert (tmp_path / "fit.png").read_bytes()[:4] == b"\x89PNG"
