"""The Manhattan frame of a shot: the vertical, and the two level directions along which walls and floors run.

Coughlan and Yuille, "Manhattan world", ICCV 1999: most straight edges of a built place run along three directions at
right angles. A segment is the image of an edge along one of them, or along none; the rotation of largest posterior
probability is searched on a grid of verticals about where up is thought to be, and settled by iteratively reweighted
least squares. It gives the vertical, and the camera's heading against the walls up to quarter turns: two cameras that
look at opposite walls of a room share no point, but they share its directions.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.segments import Segments
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat, swing

Array = np.ndarray

ALONG = 0.2
"""Fraction of segments along each of the three directions; the others run anywhere."""
SEARCH_DEG, STEP_DEG = 24.0, 3.0
"""Verticals are tried so far from where up is thought to be, and so far apart."""
HEADINGS = 45
"""Headings that are tried in a quarter turn."""
CANDIDATES, ITERATIONS = 12, 12
LEAST_SEGMENTS = 12
CHANCE_SIGMAS = 4.0
"""A segment that runs anywhere counts for an axis if it comes within about so many standard deviations, both sides."""
DISTINCT_DEG = 4.0
"""Frames that lie closer together are one."""
QUARTER_TURNS = rotvec_to_rotmat(np.outer(np.arange(4) * math.pi / 2, [0.0, 0.0, 1.0]))
"""(4, 3, 3) about the vertical: they leave a Manhattan frame what it is."""


@dataclass(frozen=True)
class ManhattanFrame:
    """The directions of a built place, as one shot sees them."""

    R_axes_walls: Float[Array, "3 3"]
    """Columns: two level directions, then up. Quarter turns about up give the same frame."""
    sigma_deg: float
    """Standard deviation of a rotation about one axis, if the frame is the right one."""
    margin: float
    """Log posterior above that of the best other frame."""

    @property
    def up(self) -> Float[Array, "3"]:
        return np.asarray(self.R_axes_walls[:, 2])


def find_manhattan_frame(seen: Segments, up: Float[Array, "3"], up_sigma_deg: float) -> ManhattanFrame | None:
    """The likeliest frame, given where people or the picture say up is; None with too few segments."""
    if len(seen.normal) < LEAST_SEGMENTS:
        return None
    kappa = 1 / math.radians(up_sigma_deg) ** 2
    frames = settled(seen, start_frames(seen, up, kappa), up, kappa)
    value = log_posterior(seen, frames, up, kappa)
    best = int(value.argmax())
    others = value[off_deg(frames[best], frames) > DISTINCT_DEG]
    H, _ = _normal_equations(seen, frames[best], up, kappa)
    sigma = math.sqrt(float(np.trace(np.linalg.inv(H))) / 3)
    return ManhattanFrame(frames[best], math.degrees(sigma), float(value[best] - max(others, default=0.0)))


def off_deg(first: Float[Array, "3 3"], second: Float[Array, "*s 3 3"]) -> Float[Array, "*s"]:
    """Angle between a frame and others, up to quarter turns about the vertical, degrees."""
    return np.asarray(np.degrees(rotation_angle((first.T @ second)[..., None, :, :] @ QUARTER_TURNS).min(axis=-1)))


def log_posterior(
    seen: Segments, axes: Float[Array, "*s 3 3"], up: Float[Array, "3"], kappa: float
) -> Float[Array, "*s"]:
    """Of all segments, given the directions, against running anywhere; and of the vertical (von Mises-Fisher)."""
    residual, _ = seen.residuals(axes)
    likelihood = np.log(_densities(seen, residual).sum(axis=-1) + 1 - 3 * ALONG) @ seen.weight
    return np.asarray(likelihood + kappa * (axes[..., 2] @ up - 1))


def start_frames(
    seen: Segments, up: Float[Array, "3"], kappa: float, *, count: int = CANDIDATES
) -> Float[Array, "s 3 3"]:
    """Frames along which many segments run, best first: a grid of verticals, and for each a histogram of headings.

    `kappa`: concentration of the vertical about `up`; `count`: no more frames than this.
    """
    reach = np.radians(np.arange(-SEARCH_DEG, SEARCH_DEG + STEP_DEG / 2, STEP_DEG))
    tilt = np.stack(np.meshgrid(reach, reach, [0.0]), axis=-1).reshape(-1, 3)
    tilt = tilt[np.linalg.norm(tilt, axis=1) <= math.radians(SEARCH_DEG)]
    verticals = swing(np.array([[0.0, 0.0, 1.0]]), up[None])[0] @ rotvec_to_rotmat(tilt)
    residual, _ = seen.residuals(verticals[:, :, 2].T)
    upright = ALONG * _against_anywhere(residual, np.hypot(seen.sigma, math.radians(STEP_DEG / 2))[:, None])
    # The level direction of a segment that is not upright is its plane's normal × the vertical.
    x, y = seen.normal @ verticals[:, :, 1].T, -(seen.normal @ verticals[:, :, 0].T)
    quarter = math.pi / 2
    heading = np.minimum((np.mod(np.arctan2(y, x), quarter) / quarter * HEADINGS).astype(int), HEADINGS - 1)
    votes = seen.weight[:, None] * np.hypot(x, y) * (1 - ALONG) / (upright + 1 - ALONG)
    at = np.arange(len(verticals)) * HEADINGS + heading
    histogram = np.bincount(at.ravel(), votes.ravel(), len(verticals) * HEADINGS).reshape(-1, HEADINGS)
    smooth = histogram + 0.5 * (np.roll(histogram, 1, axis=1) + np.roll(histogram, -1, axis=1))
    expected = np.maximum(histogram.sum(axis=1, keepdims=True) * 2 / HEADINGS, 1e-9)
    # Poisson: how much likelier so many votes are than those of headings at random.
    peak = np.where(smooth > expected, smooth * np.log(np.maximum(smooth, 1e-9) / expected) - smooth + expected, 0.0)
    vertical = seen.weight @ np.log(upright + 1 - ALONG) + kappa * (verticals[:, :, 2] @ up - 1)
    likeliest = np.argsort(-(vertical[:, None] + peak), axis=None, kind="stable")[: 40 * CANDIDATES]
    which, column = np.divmod(likeliest, HEADINGS)
    left = verticals[which] @ rotvec_to_rotmat((column[:, None] + 0.5) / HEADINGS * quarter * np.array([0.0, 0.0, 1.0]))
    starts: list[Array] = []
    while len(left) and len(starts) < count:
        starts.append(left[0])
        left = left[off_deg(left[0], left) > DISTINCT_DEG]
    return np.stack(starts)


def settled(seen: Segments, axes: Float[Array, "s 3 3"], up: Float[Array, "3"], kappa: float) -> Float[Array, "s 3 3"]:
    """The maxima of the posterior near some frames."""
    axes, moving = axes.copy(), np.arange(len(axes))
    for _ in range(ITERATIONS):
        H, g = _normal_equations(seen, axes[moving], up, kappa)
        step = -np.linalg.solve(H, g[..., None])[..., 0]
        length = np.linalg.norm(step, axis=-1)
        step *= np.minimum(1.0, 0.1 / np.maximum(length, 1e-12))[:, None]
        axes[moving] = rotvec_to_rotmat(step) @ axes[moving]
        moving = moving[length >= 1e-4]
        if not len(moving):
            break
    return axes


def _against_anywhere(residual: Float[Array, "n a"], sigma: Float[Array, "n 1"]) -> Float[Array, "n a"]:
    """Normal density of the residuals in units of that of segments that run anywhere (1 / π)."""
    return np.asarray(np.exp(-0.5 * (residual / sigma) ** 2) * math.sqrt(math.pi / 2) / sigma)


def _densities(seen: Segments, residual: Float[Array, "*s n 3"]) -> Float[Array, "*s n 3"]:
    return ALONG * _against_anywhere(residual, seen.sigma[:, None])


def support(seen: Segments, residual: Float[Array, "*s n 3"]) -> tuple[Float[Array, "*s n 3"], Float[Array, "*s 3"]]:
    """Probability of each segment to run along each axis, and the fraction of them that chance does not explain.

    `residual`: of the segments against the axes. Segments that run anywhere come to lie along an axis now and then: a
    number of them within two standard deviations of what chance brings says nothing of the axis.
    """
    density = _densities(seen, residual)
    shares = density / (density.sum(axis=-1, keepdims=True) + 1 - 3 * ALONG)
    counts, chance = seen.weight @ shares, float(seen.weight @ (CHANCE_SIGMAS * seen.sigma / math.pi))
    return shares, np.clip((counts - chance - 2 * math.sqrt(chance)) / np.maximum(counts, 1e-9), 0.0, 1.0)


def _normal_equations(
    seen: Segments, axes: Float[Array, "*s 3 3"], up: Float[Array, "3"], kappa: float
) -> tuple[Float[Array, "*s 3 3"], Float[Array, "*s 3"]]:
    """Gauss-Newton matrix and gradient of a small rotation of the axes, every segment in its shares."""
    residual, beside = seen.residuals(axes)
    shares, real = support(seen, residual)
    J = np.cross(np.swapaxes(axes, -1, -2)[..., None, :, :], seen.normal[:, None]) / beside[..., None]
    weight = seen.weight[:, None] * shares * real[..., None, :] / seen.sigma[:, None] ** 2
    rows, flat = (*axes.shape[:-2], -1, 3), (*axes.shape[:-2], -1, 1)
    weighted = np.swapaxes((weight[..., None] * J).reshape(rows), -1, -2)
    z = axes[..., 2]
    H = weighted @ J.reshape(rows) + kappa * (np.eye(3) - z[..., :, None] * z[..., None, :]) + 1e-3 * np.eye(3)
    g = (weighted @ np.sin(residual).reshape(flat))[..., 0] - kappa * np.cross(z, up)
    return H, g
