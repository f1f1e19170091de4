"""Fits the noise of ms-Mocap to what the pose network really does on rendered clips, where the truth is exact.

Everything is measured as `detector_noise.detect` makes it: in the picture as a share of the height that the landmarks
span, in 3D about the mid-hip in the axes of its viewing ray.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import curve_fit

from humanmm.models.benchmark.detector_errors import MeasuredClip, PersonErrors
from humanmm.models.benchmark.detector_noise import LIMBS, DetectorNoise, detect
from humanmm.models.benchmark.mocap import leg_length
from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.evaluation.take import PersonTake, Take
from humanmm.models.rotations import kabsch, rotation_from_vector, swing, vector_from_rotation

Array = np.ndarray

BODY = slice(11, 33)
"""Landmarks below the neck: a posture's rotation is theirs."""
HIDDEN_BELOW = 0.5
"""Mean visibility of a limb's landmarks below which it counts as hidden."""
OUTLIER = 0.12
"""Mean error of a visible limb, share of the height, from which it counts as lost."""
SHORTEST_SERIES_S = 0.8
ANATOMY_M = 0.012
"""Not fitted, an assumption: rendered people have the anatomy that the landmarks were calibrated on."""
LAGS_S = np.arange(0, 1.01, 1 / 30)


@dataclass(frozen=True, eq=False)
class Series:
    """One person in one shot beside the truth, n frames."""

    errors: PersonErrors
    fps: float
    points: Float[Array, "n 33 3"]
    """True landmarks in camera axes, metres."""
    K: Float[Array, "n 3 3"]
    behind: Bool[Array, " n"]
    stature: float
    """Length of the legs over the average's."""
    picture: Float[Array, "n 33 2"]
    """Detected minus true place, shares of the height."""
    turn: Float[Array, "n 3"]
    """Rotation of the 3D landmarks, radians."""
    solid: Float[Array, "n 33 3"]
    """What is left of the 3D error after rotation and scale, metres."""
    scale: float

    @property
    def found(self) -> Bool[Array, " n"]:
        return self.errors.found

    @property
    def hidden(self) -> Bool[Array, "limbs n"]:
        """Which limbs the network itself says it cannot see."""
        visibility = self.errors.keypoints[..., 2]
        return np.stack([visibility[:, list(limb)].mean(axis=1) < HIDDEN_BELOW for limb in LIMBS])

    @property
    def lost(self) -> Bool[Array, "limbs n"]:
        distance = np.linalg.norm(self.picture, axis=-1)
        far = np.stack([distance[:, list(limb)].mean(axis=1) > OUTLIER for limb in LIMBS])
        return np.asarray(far & ~self.hidden)


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """The fitted noise, with what it was fitted to."""

    noise: DetectorNoise
    series: tuple[Series, ...]
    frames: int

    def to_json(self) -> dict[str, Any]:
        values = {k: _rounded(v) for k, v in asdict(self.noise).items()}
        clips = sorted({one.errors.clip for one in self.series})
        return {
            "noise": values,
            "fitted_to": {"clips": clips, "persons_in_shots": len(self.series), "frames": self.frames},
        }


def fit_noise(clips: Sequence[MeasuredClip]) -> NoiseFit:
    """Every number of the noise from the clips' errors."""
    series = [_series(clip.take, errors) for clip in clips for errors in clip.errors]
    series = [one for one in series if one.found.sum() >= 5]
    a, b = _tilt(series)
    share = _spread(np.concatenate([one.picture[_usable(one)] for one in series]))
    hidden = np.concatenate([one.picture[_limb_mask(one.hidden)] for one in series])
    lost = np.concatenate([one.picture[_limb_mask(one.lost)] for one in series])
    turn = np.concatenate([_straight(one, a, b)[one.found] for one in series])
    solid = np.concatenate([one.solid[_usable(one)] for one in series])
    constant, slow, slow_s, quick_s = _memory(series, a, b)
    swaps = _swaps(series)
    hidden_hz, hidden_s = _events([(run, one.fps) for one in series for run in one.hidden[:, one.found]])
    lost_hz, lost_s = _events([(run, one.fps) for one in series for run in one.lost[:, one.found]])
    miss_hz, miss_s = _events([(~one.found, one.fps) for one in series])
    noise = DetectorNoise(
        keypoint_share=share,
        landmark_sigma_m=_spreads(solid),
        turn_deg=_spreads(np.degrees(turn)),
        tilt_deg=float(np.degrees(a[0])),
        tilt_per_pitch=float(a[1]),
        lean_per_roll=float(b),
        landmark_scale=float(np.median([one.scale * one.stature for one in series])),
        anatomy_m=ANATOMY_M,
        shot_share=constant,
        slow_share=slow,
        slow_s=slow_s,
        quick_s=quick_s,
        hidden_hz=hidden_hz,
        hidden_s=hidden_s,
        hidden_factor=_spread(hidden) / share if len(hidden) else 1.0,
        outlier_hz=lost_hz,
        outlier_s=lost_s,
        outlier_share=float(np.median(np.linalg.norm(lost, axis=-1))) if len(lost) else 0.0,
        swap_hz=(swaps[0][0], swaps[1][0]),
        swap_s=swaps[1][1],
        miss_hz=miss_hz,
        miss_s=miss_s,
    )
    return NoiseFit(noise, tuple(series), sum(int(one.found.sum()) for one in series))


def simulate(one: Series, noise: DetectorNoise, rng: np.random.Generator, size: tuple[int, int]) -> Series:
    """The same person in the same shot with modelled errors instead of measured ones; sides as the truth has them."""
    still = replace(noise, swap_hz=(0.0, 0.0), miss_hz=0.0)
    made = detect(
        one.points, one.K[0], size, one.behind, one.stature, one.fps, still, rng,
        pitch=one.errors.pitch, roll=one.errors.roll,
    )  # fmt: skip
    errors = replace(
        one.errors, keypoints=made.keypoints.astype(float), landmarks=made.landmarks.astype(float), found=made.found
    )
    return _residuals(errors, one.fps, one.points, one.K, one.behind, one.stature)


def _series(take: Take, errors: PersonErrors) -> Series:
    person, cameras = take.people[errors.person], take.cameras
    assert cameras is not None
    points, facing, hips, stature = _true_landmarks(person, errors.rows)
    frame = person.frame[errors.rows]
    in_camera = np.einsum("nba,nkb->nka", cameras.R_world_cam[frame], points - cameras.t_world_cam[frame, None])
    behind = (facing * (cameras.t_world_cam[frame] - hips)).sum(axis=1) < 0
    return _residuals(errors, take.fps, in_camera, cameras.K[frame], behind, stature)


def _residuals(
    errors: PersonErrors,
    fps: float,
    points: Float[Array, "n 33 3"],
    K: Float[Array, "n 3 3"],
    behind: Bool[Array, " n"],
    stature: float,
) -> Series:
    projected = np.einsum("nab,nkb->nka", K, points)
    pixels = projected[..., :2] / np.maximum(projected[..., 2:], 0.1)
    height = np.ptp(pixels[..., 1], axis=1)[:, None, None]
    ray = points[:, 23:25].mean(axis=1)
    R_cam_ray = swing(np.broadcast_to([0.0, 0.0, 1.0], ray.shape), ray)
    true = np.einsum("nba,nkb->nka", R_cam_ray, points - ray[:, None])
    seen = errors.landmarks - errors.landmarks[:, 23:25].mean(axis=1, keepdims=True)
    R = np.tile(np.eye(3), (len(points), 1, 1))
    found = errors.found
    R[found] = kabsch(true[found][:, BODY], seen[found][:, BODY], np.ones((int(found.sum()), 22)))
    turned = np.einsum("nab,nkb->nka", R, true)
    sizes = np.linalg.norm(seen[found][:, BODY], axis=(1, 2)) / np.linalg.norm(turned[found][:, BODY], axis=(1, 2))
    scale = float(np.median(sizes)) if found.any() else 1.0
    return Series(
        errors, fps, points, K, behind, stature,
        picture=(errors.keypoints[..., :2] - pixels) / height,
        turn=vector_from_rotation(R),
        solid=seen - scale * turned,
        scale=scale,
    )  # fmt: skip


def _true_landmarks(person: PersonTake, rows: Array) -> tuple[Array, Array, Array, float]:
    """Landmarks (world), the body's forward direction, the pelvis, and the stature."""
    body = load_body()
    if person.body is None:
        raise ValueError("the truth has no body model: noise can be fitted to rendered clips only")
    rest = body.rest_joints(person.body.betas)
    R_root = rotation_from_vector(person.body.root_orient[rows])
    joints, R = forward_kinematics(rest, R_root, person.body.body_pose[rows], person.joints[rows, 0])
    points = load_landmarks().place(person.body.betas, joints, R)
    return points, R_root[..., 2], joints[:, 0], leg_length(rest) / leg_length(body.J_template)


def _usable(one: Series) -> Bool[Array, "n 33"]:
    """Landmarks below the neck that are seen, hidden and lost limbs aside."""
    usable = ~_limb_mask(one.hidden | one.lost)
    usable[:, :11] = False
    usable[~one.found] = False
    return usable


def _limb_mask(limbs: Bool[Array, "limbs n"]) -> Bool[Array, "n 33"]:
    mask = np.zeros((limbs.shape[1], 33), bool)
    for limb, rows in zip(LIMBS, limbs, strict=True):
        mask[np.ix_(rows, list(limb))] = True
    return mask


def _spread(values: Float[Array, "m k"]) -> float:
    """One sigma an axis of the bulk (1.4826 · median of the sizes): hidden and lost limbs make the tails."""
    return float(1.4826 * np.nanmedian(np.abs(values)))


def _spreads(values: Float[Array, "m 3"]) -> tuple[float, float, float]:
    """One sigma of each axis."""
    return _spread(values[:, :1]), _spread(values[:, 1:2]), _spread(values[:, 2:])


def _tilt(series: Sequence[Series]) -> tuple[Float[Array, "2"], float]:
    """Tilt about x = a₀ + a₁ · pitch, lean about z = b · roll; least squares over shots, robust by Huber's weights."""
    x = np.array([np.median(one.turn[one.found, 0]) for one in series])
    z = np.array([np.median(one.turn[one.found, 2]) for one in series])
    pitch = np.array([one.errors.pitch.mean() for one in series])
    roll = np.array([one.errors.roll.mean() for one in series])
    a = _robust_line(np.stack([np.ones_like(pitch), pitch], axis=1), x)
    b = _robust_line(roll[:, None], z)
    return a, float(b[0])


def _robust_line(design: Float[Array, "m k"], target: Float[Array, " m"]) -> Float[Array, " k"]:
    weight = np.ones(len(target))
    found: Array = np.zeros(design.shape[1])
    for _ in range(20):
        found = np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)[0]
        left = np.abs(target - design @ found)
        limit = 1.345 * 1.4826 * np.median(left) + 1e-9
        weight = np.sqrt(np.minimum(1.0, limit / np.maximum(left, 1e-12)))
    return np.asarray(found)


def _straight(one: Series, a: Float[Array, "2"], b: float) -> Float[Array, "n 3"]:
    """The turn without what pitch and roll explain."""
    explained = np.stack([a[0] + a[1] * one.errors.pitch, 0 * one.errors.roll, b * one.errors.roll], axis=1)
    return np.asarray(one.turn - explained)


def _memory(series: Sequence[Series], a: Float[Array, "2"], b: float) -> tuple[float, float, float, float]:
    """Shares that stay for a shot and that change slowly, and the two times: from the errors' autocorrelation."""
    total, count, power = np.zeros(len(LAGS_S)), np.zeros(len(LAGS_S)), 0.0
    norm = 0
    for one in series:
        n = len(one.found)
        if n < SHORTEST_SERIES_S * one.fps:
            continue
        picture = one.picture[:, BODY].reshape(n, -1) / 0.02
        turn = _straight(one, a, b) / np.radians(6.0)
        values = np.clip(np.concatenate([picture, turn], axis=1), -4, 4)
        values[~one.found] = np.nan
        power += np.nansum(values**2)
        norm += int(np.isfinite(values).sum())
        for k, lag in enumerate(np.rint(LAGS_S * one.fps).astype(int)):
            if lag >= n:
                break
            product = values[: n - lag] * values[lag:]
            total[k] += np.nansum(product)
            count[k] += np.isfinite(product).sum()
    usable = count > 0
    correlation = (total[usable] / count[usable]) / (power / norm)
    parameters, _ = curve_fit(
        _correlation, LAGS_S[usable], correlation, p0=(0.4, 0.35, 0.6, 0.06),
        bounds=((0, 0, 0.25, 0.01), (0.95, 0.95, 3.0, 0.2)),
    )  # fmt: skip
    constant, rest, slow_s, quick_s = parameters
    return float(constant), float((1 - constant) * rest), float(slow_s), float(quick_s)


def _correlation(lag: Array, constant: float, rest: float, slow_s: float, quick_s: float) -> Array:
    """Of a constant, a slow and a quick part; `rest` is the slow part's share of what is not constant."""
    return np.asarray(constant + (1 - constant) * (rest * np.exp(-lag / slow_s) + (1 - rest) * np.exp(-lag / quick_s)))


def _events(runs: Sequence[tuple[Bool[Array, " n"], float]]) -> tuple[float, float]:
    """How often an event begins, a second, and how long it lasts; a run that was on at the start counts half."""
    beginnings = seconds = inside = 0.0
    for run, fps in runs:
        beginnings += float((run[1:] & ~run[:-1]).sum()) + 0.5 * float(run[:1].sum())
        seconds += len(run) / fps
        inside += float(run.sum()) / fps
    return beginnings / max(seconds, 1e-9), inside / max(beginnings, 1.0)


def _swaps(series: Sequence[Series]) -> list[tuple[float, float]]:
    """Rate and length of exchanged sides, from the front and from behind."""
    return [
        _events([(one.errors.swapped[rows], one.fps) for one in series if (rows := side(one)).any()]) for side in _SIDES
    ]


_SIDES: tuple[Callable[[Series], Bool[Array, " n"]], ...] = (
    lambda one: one.found & ~one.behind,
    lambda one: one.found & one.behind,
)


def _rounded(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_rounded(v) for v in value]
    return float(f"{value:.4g}")
