"""Fits the noise of ms-Mocap to what the pose network really does on rendered clips, where the truth is exact."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import least_squares

from humanmm.models.geometry.robust import STD_PER_MEDIAN, huber_weight
from humanmm.models.synthetic.detector_errors import MeasuredClip
from humanmm.models.synthetic.detector_noise import AXES, LIMBS, PARTS, TRUNK, DetectorNoise, ErrorPatterns
from humanmm.models.synthetic.noise_series import Series, limb_mask, series_of

Array = np.ndarray

ANATOMY_M = 0.012
"""Not fitted, an assumption: rendered people have the anatomy that the landmarks were calibrated on."""
LAGS_S = tuple(frames / 30 for frames in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 45, 60))
HUBER_LIMIT = 1.345
"""In standard deviations: 95 % efficient on normal errors (Holland and Welsch 1977)."""
PATH_BINS, LEAST_PAIRS = 8, 1000
CLIPPED = 2.5


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
    series = [series_of(clip.sequence, errors) for clip in clips for errors in clip.errors]
    series = [one for one in series if one.found.sum() >= 5]
    a, b = _tilt(series)
    fraction, deviation_m, patterns = _patterns(series)
    memory = _memory(series)
    hidden = np.concatenate([one.picture[limb_mask(one.hidden)] for one in series])
    hidden_size, hidden_spread = _size_and_spread(hidden) if len(hidden) else (fraction, 0.0)
    lost = np.concatenate([one.picture[limb_mask(one.lost)] for one in series])
    rotation = np.concatenate([_straight(one, a, b)[one.found] for one in series])
    rest = memory.rest_speed
    swaps = [_events(_swaps(series, side, rest)) for side in _SIDES]
    hidden_limbs = [_events(_of_limbs(series, "hidden", limbs, rest)) for limbs in _ARMS_AND_LEGS]
    lost_limbs = [_events(_of_limbs(series, "lost", limbs, rest)) for limbs in _ARMS_AND_LEGS]
    miss_rate, miss_s = _events([(~one.found, one.body_steps(rest), one.fps) for one in series])
    noise = DetectorNoise(
        keypoint_fraction=fraction,
        landmark_deviation_m=deviation_m,
        patterns=patterns,
        rotation_deg=_spreads(np.degrees(rotation)),
        tilt_deg=float(np.degrees(a[0])),
        tilt_per_pitch=float(a[1]),
        lean_per_roll=float(b),
        landmark_scale=float(np.median([one.scale * one.stature for one in series])),
        anatomy_m=ANATOMY_M,
        new_fraction=1.0 - memory.constant - memory.slow,
        shot_fraction=memory.constant / (memory.constant + memory.slow),
        memory_path=memory.memory_path,
        rest_speed=rest,
        hidden_rate=(hidden_limbs[0][0], hidden_limbs[1][0]),
        hidden_s=(hidden_limbs[0][1], hidden_limbs[1][1]),
        hidden_factor=hidden_size / fraction,
        hidden_spread=hidden_spread,
        hidden_landmark_factor=_hidden_landmarks(series),
        lost_rate=(lost_limbs[0][0], lost_limbs[1][0]),
        lost_s=(lost_limbs[0][1], lost_limbs[1][1]),
        lost_fraction=float(np.median(np.linalg.norm(lost, axis=-1))) if len(lost) else 0.0,
        swap_rate=(swaps[0][0], swaps[1][0]),
        swap_s=max(swaps[0][1], swaps[1][1]),
        miss_rate=miss_rate,
        miss_s=miss_s,
    )
    return NoiseFit(noise, tuple(series), sum(int(one.found.sum()) for one in series))


def _size_and_spread(values: Float[Array, "m k"]) -> tuple[float, float]:
    """Of normal errors whose standard deviation is itself log-normal: its median, and the standard deviation of its
    logarithm. By mean and variance of log |e|, which are −(γ + ln 2) / 2 and π² / 8 for a normal error of size 1."""
    log = np.log(np.abs(values[np.isfinite(values) & (values != 0)]))
    size = np.exp(log.mean() + 0.5 * (np.euler_gamma + np.log(2.0)))
    return float(size), float(np.sqrt(max(log.var() - np.pi**2 / 8, 0.0)))


def _hidden_landmarks(series: Sequence[Series]) -> float:
    """How many times as far 3D landmarks of hidden limbs are off as others, by medians."""
    hidden = np.concatenate([one.solid[limb_mask(one.hidden) & one.found[:, None]] for one in series])
    others = np.concatenate([one.solid[one.usable] for one in series])
    return _spread(hidden) / _spread(others) if len(hidden) else 1.0


def _spread(values: Float[Array, "m k"]) -> float:
    """Robust standard deviation per axis (1.4826 · median of the sizes): hidden and lost limbs make the tails."""
    return float(STD_PER_MEDIAN * np.nanmedian(np.abs(values)))


def _spreads(values: Float[Array, "m 3"]) -> tuple[float, float, float]:
    """Robust standard deviation of each axis."""
    return _spread(values[:, :1]), _spread(values[:, 1:2]), _spread(values[:, 2:])


def _tilt(series: Sequence[Series]) -> tuple[Float[Array, "2"], float]:
    """Tilt about x = a₀ + a₁ · pitch, lean about z = b · roll; least squares over shots, robust by Huber's weights."""
    x = np.array([np.median(one.rotation[one.found, 0]) for one in series])
    z = np.array([np.median(one.rotation[one.found, 2]) for one in series])
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
        limit = HUBER_LIMIT * STD_PER_MEDIAN * np.median(left) + 1e-9
        weight = np.sqrt(huber_weight(left, limit))
    return np.asarray(found)


def _straight(one: Series, a: Float[Array, "2"], b: float) -> Float[Array, "n 3"]:
    """The rotation without what pitch and roll explain."""
    explained = np.stack([a[0] + a[1] * one.errors.pitch, 0 * one.errors.roll, b * one.errors.roll], axis=1)
    return np.asarray(one.rotation - explained)


def rates_of_change(series: Sequence[Series]) -> tuple[Float[Array, " bins"], Float[Array, " bins"]]:
    """How far errors in the picture change from frame to frame while their part of the body has a certain speed: speeds
    (heights of the body a second), and the standard deviation of the change per axis (heights)."""
    path, change, _ = _pairs(series, 0.0)
    bins = np.array_split(np.argsort(path, kind="stable"), PATH_BINS)
    fps = float(np.median([one.fps for one in series]))
    speed = np.array([np.median(path[rows]) * fps for rows in bins])
    return speed, np.array([_spread(change[rows]) for rows in bins])


def _patterns(series: Sequence[Series]) -> tuple[float, tuple[float, float, float], ErrorPatterns]:
    """How large errors are, and how they are related within trunk, arms and legs: robust spreads, and correlations of
    what is clipped at 2.5 standard deviations."""
    trunk = [_errors_of(series, TRUNK, 1.0), _errors_of(series, tuple(TRUNK[k] for k in (1, 0, 3, 2)), -1.0)]
    arms = [_errors_of(series, LIMBS[0], 1.0), _errors_of(series, LIMBS[1], -1.0)]
    legs = [_errors_of(series, LIMBS[2], 1.0), _errors_of(series, LIMBS[3], -1.0)]
    covariances = [_robust_covariance(np.concatenate(sides)) for sides in (trunk, arms, legs)]
    variances = np.concatenate([
        np.tile(np.diagonal(covariance).reshape(-1, AXES), (copies, 1))
        for covariance, copies in zip(covariances, (1, 2, 2), strict=True)
    ]).mean(axis=0)  # fmt: skip
    sizes = np.sqrt([variances[:2].mean(), variances[:2].mean(), *variances[2:]])
    related: list[Any] = []
    for covariance in covariances:
        scale = np.tile(sizes, len(covariance) // AXES)
        related.append(tuple(tuple(row) for row in (covariance / np.outer(scale, scale)).tolist()))
    return float(sizes[0]), (float(sizes[2]), float(sizes[3]), float(sizes[4])), ErrorPatterns(*related)


def _errors_of(series: Sequence[Series], part: Sequence[int], side: float) -> Float[Array, "m d"]:
    """Errors in the picture and in 3D of some landmarks where all of them are seen; x times `side`."""
    found = []
    for one in series:
        rows = one.usable[:, part].all(axis=1)
        errors = np.concatenate([one.picture[rows][:, part], one.solid[rows][:, part]], axis=-1)
        found.append((errors * [side, 1, side, 1, 1]).reshape(len(errors), AXES * len(part)))
    return np.concatenate(found)


def _robust_covariance(values: Float[Array, "m d"]) -> Float[Array, "d d"]:
    spread = np.array([_spread(column) for column in values.T])
    clipped = np.clip(values / spread, -CLIPPED, CLIPPED)
    products = clipped.T @ clipped
    size = np.sqrt(np.diagonal(products))
    return np.asarray(products / np.outer(size, size) * np.outer(spread, spread))


@dataclass(frozen=True)
class _Memory:
    """How errors decay."""

    constant: float
    slow: float
    memory_path: float
    rest_speed: float


def _memory(series: Sequence[Series]) -> _Memory:
    """From how far errors in the picture differ from later ones, over time and over the path length of the part of
    the body in between. By medians; jumps are left out (`Series.lost`)."""
    lags: list[float] = []
    paths: list[float] = []
    fractions: list[float] = []
    for lag_s in LAGS_S:
        lengths, change, both = _pairs(series, lag_s)
        if len(lengths) < LEAST_PAIRS:
            continue
        for rows in np.array_split(np.argsort(lengths, kind="stable"), PATH_BINS):
            lags.append(lag_s)
            paths.append(float(np.median(lengths[rows])))
            fractions.append(1 - _spread(change[rows]) ** 2 / 2 / _spread(both[rows]) ** 2)
    lag, path, known = np.array(lags), np.array(paths), np.array(fractions)

    def missed(values: Array) -> Array:
        return np.asarray(_correlation(lag, path, *values) - known)

    found = least_squares(
        missed, (0.2, 0.7, 0.2, 0.05),
        bounds=((0, 0, 0.01, 1e-3), (0.95, 1.0, 5.0, 5.0)),
    )  # fmt: skip
    constant, slow, memory_path, rest_speed = (float(value) for value in found.x)
    all_of_it = max(1.0, constant + slow)
    return _Memory(constant / all_of_it, slow / all_of_it, memory_path, rest_speed)


def _pairs(
    series: Sequence[Series], lag_s: float
) -> tuple[Float[Array, " m"], Float[Array, "m 2"], Float[Array, "m 4"]]:
    """Of landmarks that are seen now and `lag_s` later (the next frame at least): the path length of their part, how
    much their error in the picture has changed, and both errors."""
    part_of = np.zeros(33, int)
    for number, part in enumerate(PARTS):
        part_of[list(part)] = number
    paths, changes, errors = [], [], []
    for one in series:
        lag = max(1, round(lag_s * one.fps))
        usable, error, path = one.usable, one.picture, np.cumsum(one.speed, axis=0)[:, part_of] / one.fps
        early, late = slice(None, -lag), slice(lag, None)
        both = usable[early] & usable[late]
        paths.append((path[late] - path[early])[both])
        changes.append((error[late] - error[early])[both])
        errors.append(np.concatenate([error[late][both], error[early][both]], axis=1))
    return np.concatenate(paths), np.concatenate(changes), np.concatenate(errors)


def _correlation(
    lag_s: Array, path: Array, constant: float, slow: float, memory_path: float, rest_speed: float
) -> Array:
    """Of errors with later ones: of a constant and a slow part. What is new in every frame has none."""
    return np.asarray(constant + slow * np.exp(-(path + rest_speed * lag_s) / memory_path))


Runs = list[tuple[Bool[Array, " n"], Float[Array, " n"], float]]
"""Frames inside events, with the path lengths from the frame before, and the frame rate."""


def _events(runs: Runs) -> tuple[float, float]:
    """How often an event begins, times per path length, and its seconds; a run at the start counts half."""
    beginnings = path = inside_s = 0.0
    for run, steps, fps in runs:
        beginnings += float((run[1:] & ~run[:-1]).sum()) + 0.5 * float(run[:1].sum())
        path += float(steps.sum())
        inside_s += float(run.sum()) / fps
    return beginnings / max(path, 1e-9), inside_s / max(beginnings, 1.0)


_ARMS_AND_LEGS = ((0, 1), (2, 3))


def _of_limbs(series: Sequence[Series], event: Literal["hidden", "lost"], limbs: Sequence[int], rest: float) -> Runs:
    """Events of some limbs, in the frames in which the person was found."""
    runs: Runs = []
    for one in series:
        inside = one.hidden if event == "hidden" else one.lost
        runs += [(inside[limb][one.found], one.steps(rest)[one.found][:, 2 + limb], one.fps) for limb in limbs]
    return runs


def _swaps(series: Sequence[Series], side: Callable[[Series], Bool[Array, " n"]], rest: float) -> Runs:
    """Left-right swaps, as seen from one side."""
    of_side = [(one, rows) for one in series if (rows := side(one)).any()]
    return [(one.errors.swapped[rows], one.body_steps(rest)[rows], one.fps) for one, rows in of_side]


_SIDES: tuple[Callable[[Series], Bool[Array, " n"]], ...] = (
    lambda one: one.found & ~one.behind,
    lambda one: one.found & one.behind,
)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(v) for name, v in value.items()}
    if isinstance(value, tuple):
        return [_rounded(v) for v in value]
    return float(f"{value:.4g}")
