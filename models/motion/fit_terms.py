"""The terms of a fit: each adds its robust cost, gradient and Gauss-Newton curvature to the normal equations.

A term sees the whole window of N frames. Terms of a single frame fill the diagonal blocks; `Smoothness` couples
neighbours. All residuals are in units of their expected error, and all sums are integrals over time in units of 1/30 s,
so that the same numbers hold at any frame rate, also a variable one (`frame_weights`).

A new term (a planted foot, a floor, another camera) is a class with `cost` and `add`; the solver knows nothing else.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.motion.fit_state import BODY, FREE_JOINTS, NUM_PARAMETERS, PELVIS, ROOT, CameraPath, Motion
from humanmm.models.rotations import skew, vector_from_rotation

Array = np.ndarray

REFERENCE_HZ = 30.0
"""Frame rate at which a frame weighs 1."""

NEAREST_DEPTH = 0.2
"""Points closer to the camera plane than this, in metres, have no usable projection."""


@dataclass(eq=False)
class NormalEquations:
    """H δ = −g of one window, where frame t meets t, t + 1 and t + 2 only."""

    gradient: Float[Array, "N 63"]
    own: Float[Array, "N 63 63"]
    next_one: Float[Array, "N 63 63"]
    """Block (t, t + 1); the last is unused."""
    next_two: Float[Array, "N 63"]
    """Diagonal of block (t, t + 2), which holds nothing else; the last two are unused."""

    @classmethod
    def zeros(cls, num_frames: int) -> "NormalEquations":
        """Empty equations."""
        block = (num_frames, NUM_PARAMETERS, NUM_PARAMETERS)
        return cls(np.zeros(block[:2]), np.zeros(block), np.zeros(block), np.zeros(block[:2]))


class Term(Protocol):
    """One reason why a motion is more or less likely."""

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        ...

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature at this motion."""
        ...


def frame_weights(time_s: Float[Array, " N"]) -> Float[Array, " N"]:
    """Time that each frame stands for, in units of 1/30 s: half the way to both neighbours."""
    if len(time_s) < 2:
        return np.ones(len(time_s))
    steps = np.diff(time_s)
    span = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    return np.asarray(span * REFERENCE_HZ)


def cauchy(squared: Array, scale: float) -> tuple[Array, Array]:
    """Robust half-cost and weight of squared residuals: c²/2 log(1 + s/c²) and 1 / (1 + s/c²)."""
    ratio = squared / (scale * scale)
    return 0.5 * scale * scale * np.log1p(ratio), 1 / (1 + ratio)


@dataclass(frozen=True, eq=False)
class Reprojection:
    """Points seen at pixels: |π(K (R_cam_ref p + t)) − x| / σ, robust for each point."""

    camera: CameraPath
    pixels: Float[Array, "N K 2"]
    sigma_px: Float[Array, "N K"]
    weight: Float[Array, "N K"]
    """Trust × time weight; zero where unseen."""
    robust_scale: float = 3.0
    """Residual, in sigmas, beyond which a point loses its say."""

    def _residual(self, motion: Motion) -> tuple[Array, Array, Array]:
        p = self.camera.to_camera(motion.points)
        weight = np.where(p[..., 2] > NEAREST_DEPTH, self.weight, 0.0)
        depth = np.maximum(p[..., 2:], NEAREST_DEPTH)
        flat = p[..., :2] / depth
        K = self.camera.K[:, None]
        projected = np.stack(
            [
                K[..., 0, 0] * flat[..., 0] + K[..., 0, 1] * flat[..., 1] + K[..., 0, 2],
                K[..., 1, 1] * flat[..., 1] + K[..., 1, 2],
            ],
            axis=-1,
        )
        return (projected - self.pixels) / self.sigma_px[..., None], weight, np.concatenate([flat, depth], axis=-1)

    def cost(self, motion: Motion) -> float:
        residual, weight, _ = self._residual(motion)
        loss, _ = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        return float(np.sum(weight * loss))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, weight, flat = self._residual(motion)
        _, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        K = self.camera.K[:, None]
        D = np.zeros((*weight.shape, 2, 3))  # ∂ residual / ∂ p_cam
        x, y, z = flat[..., 0], flat[..., 1], flat[..., 2]
        D[..., 0, 0], D[..., 0, 1] = K[..., 0, 0], K[..., 0, 1]
        D[..., 0, 2] = -K[..., 0, 0] * x - K[..., 0, 1] * y
        D[..., 1, 1], D[..., 1, 2] = K[..., 1, 1], -K[..., 1, 1] * y
        D = D / (z * self.sigma_px)[..., None, None] @ self.camera.R_cam_ref[:, None]
        _add_residual(D @ motion.point_jacobian, residual, weight * trust, equations)

    def distances_px(self, motion: Motion) -> Float[Array, "N K"]:
        """Reprojection errors in pixels, nan where the point has no weight."""
        residual, weight, _ = self._residual(motion)
        return np.where(weight > 0, np.linalg.norm(residual, axis=-1) * self.sigma_px, np.nan)


@dataclass(frozen=True, eq=False)
class Bones:
    """Vectors between points known in 3D, all of a frame turned by one unknown small rotation φ.

    r_b = A_b ((p_to − p_from) − exp(φ) v_b), φ ~ N(0, diag(turn²)) in the axes of `R_ref_view`. A network that lifts a
    picture to 3D is wrong about the tilt of the whole body before it is wrong about one bone against the others; φ
    takes that part, and is eliminated frame by frame.
    """

    start: Int[Array, " B"]
    end: Int[Array, " B"]
    vectors: Float[Array, "N B 3"]
    """v, metres, in the axes of the reference frame."""
    R_ref_view: Float[Array, "N 3 3"]
    """Axes in which errors are stated: across (x, y) and along (z) the viewing ray."""
    sigma: Float[Array, "B 3"]
    """Expected errors in view axes, metres."""
    turn: Float[Array, " 3"]
    """Expected size of φ about the view axes, radians."""
    weight: Float[Array, "N B"]
    time_weight: Float[Array, " N"]
    robust_scale: float = 3.0

    def _residual(self, motion: Motion) -> tuple[Array, Array, Array, Array]:
        """Residuals, robust costs and weights at the best φ, and what φ itself costs: (N,B,3), (N,B), (N,B), (N,)."""
        view = np.swapaxes(self.R_ref_view, -1, -2)[:, None]
        points = motion.points
        gap = (view @ (points[:, self.end] - points[:, self.start] - self.vectors)[..., None])[..., 0]
        # exp(φ) v ≈ v − [v]× φ, so the residual grows by A [v]× φ.
        turning = skew((view @ self.vectors[..., None])[..., 0]) / self.sigma[..., None]
        base = gap / self.sigma
        phi = np.zeros((len(base), 3))
        trust = np.ones_like(self.weight)
        for _ in range(3):
            w = (self.weight * trust)[..., None, None]
            S = np.sum(np.swapaxes(turning, -1, -2) @ (w * turning), axis=1)
            S += self.time_weight[:, None, None] * np.diag(1 / self.turn**2)
            s = np.sum(np.swapaxes(turning, -1, -2) @ (w * base[..., None]), axis=1)
            phi = -np.linalg.solve(S, s)[..., 0]
            residual = base + (turning @ phi[:, None, :, None])[..., 0]
            loss, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        turned = 0.5 * self.time_weight * np.sum((phi / self.turn) ** 2, axis=-1)
        return residual, loss, trust, turned

    def cost(self, motion: Motion) -> float:
        _, loss, _, turned = self._residual(motion)
        return float(np.sum(self.weight * loss) + np.sum(turned))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, _, trust, _ = self._residual(motion)
        D = np.swapaxes(self.R_ref_view, -1, -2)[:, None] / self.sigma[..., None]
        point_jacobian = motion.point_jacobian
        J = D @ (point_jacobian[:, self.end] - point_jacobian[:, self.start])
        _add_residual(J, residual, self.weight * trust, equations)


def _add_residual(
    J: Float[Array, "N K R 63"],
    residual: Float[Array, "N K R"],
    weight: Float[Array, "N K"],
    equations: NormalEquations,
) -> None:
    """Add Σ_k w_k |r_k|² / 2."""
    root = np.sqrt(weight)[..., None]
    rows = (root[..., None] * J).reshape(len(J), -1, NUM_PARAMETERS)
    right = (root * residual).reshape(len(J), -1, 1)
    transposed = np.swapaxes(rows, -1, -2)
    equations.own += transposed @ rows
    equations.gradient += (transposed @ right)[..., 0]


def _inverse_right_jacobian(v: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """∂ log(R exp δ) / ∂ δ at δ = 0, where v = log R."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    small = angle < 1e-3
    a = np.where(small, 1.0, angle)
    c = np.where(small, 1 / 12, 1 / a**2 - (1 + np.cos(a)) / (2 * a * np.maximum(np.sin(a), 1e-6)))
    K = skew(v)
    return np.asarray(np.eye(3) + 0.5 * K + c * (K @ K))


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A mixture of Gaussians over the rotation vectors of the free joints, and soft walls at the ends of their ranges.

    The likeliest Gaussian alone counts in each frame (the maximum stands for the sum).
    """

    means: Float[Array, "C 57"]
    precisions: Float[Array, "C 57 57"]
    log_peaks: Float[Array, " C"]
    """Logarithm of each Gaussian's weighted density at its mean, up to one constant."""
    lower: Float[Array, " 57"]
    upper: Float[Array, " 57"]
    wall: float
    """1 / σ² of the walls, per rad²."""
    weight: Float[Array, " N"]

    def _vectors(self, motion: Motion) -> Float[Array, "N 19 3"]:
        return vector_from_rotation(motion.R_body[:, np.array(FREE_JOINTS) - 1])

    def _beyond(self, x: Array) -> Array:
        return np.asarray(np.maximum(x - self.upper, 0) + np.minimum(x - self.lower, 0))

    def _likeliest(self, x: Float[Array, "N 57"]) -> tuple[Array, Array]:
        """Each frame's Gaussian and what it costs."""
        gap = x - self.means[:, None]
        costs = 0.5 * np.sum((gap @ self.precisions) * gap, axis=-1) - self.log_peaks[:, None]
        chosen = np.argmin(costs, axis=0)
        return chosen, costs[chosen, np.arange(len(x))] + np.max(self.log_peaks)

    def cost(self, motion: Motion) -> float:
        x = self._vectors(motion).reshape(motion.num_frames, -1)
        _, costs = self._likeliest(x)
        return float(np.sum(self.weight * (costs + 0.5 * self.wall * np.sum(self._beyond(x) ** 2, axis=-1))))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        vectors = self._vectors(motion)
        x = vectors.reshape(motion.num_frames, -1)
        beyond = self._beyond(x)
        chosen, _ = self._likeliest(x)
        precision = self.precisions[chosen]
        slope = (precision @ (x - self.means[chosen])[..., None])[..., 0] + self.wall * beyond
        curvature = precision + (self.wall * (beyond != 0))[:, :, None] * np.eye(x.shape[1])
        L = _inverse_right_jacobian(vectors)  # block-diagonal chain rule from rotation vectors to steps
        n, joints = vectors.shape[:2]
        blocks = curvature.reshape(n, joints, 3, joints, 3).transpose(0, 1, 3, 2, 4)
        blocks = np.swapaxes(L, -1, -2)[:, :, None] @ blocks @ L[:, None]
        H = blocks.transpose(0, 1, 3, 2, 4).reshape(n, 3 * joints, 3 * joints)
        g = (np.swapaxes(L, -1, -2) @ slope.reshape(n, joints, 3, 1)).reshape(n, -1)
        equations.own[:, BODY, BODY] += self.weight[:, None, None] * H
        equations.gradient[:, BODY] += self.weight[:, None] * g


@dataclass(frozen=True, eq=False)
class Anchor:
    """Frames that stay near a reference motion: in a long hole, smoothness alone flies off with the last velocity."""

    reference: Motion
    sigma: Float[Array, " 63"]
    """Leash of each parameter: radians, metres for the pelvis."""
    weight: Float[Array, " N"]

    def _residual(self, motion: Motion) -> tuple[Array, Array]:
        """Displacements (N, 63), and rotation vectors (N, 20, 3) of the turned joints."""
        free = np.array(FREE_JOINTS) - 1
        now, then = (
            np.concatenate([m.R_ref_root[:, None], m.R_body[:, free]], axis=1) for m in (motion, self.reference)
        )
        turn = vector_from_rotation(np.swapaxes(then, -1, -2) @ now)
        gap = np.empty((motion.num_frames, NUM_PARAMETERS))
        gap[:, ROOT], gap[:, BODY] = turn[:, 0], turn[:, 1:].reshape(len(gap), -1)
        gap[:, PELVIS] = motion.pelvis_ref - self.reference.pelvis_ref
        return gap / self.sigma, turn

    def cost(self, motion: Motion) -> float:
        residual, _ = self._residual(motion)
        return 0.5 * float(np.sum(self.weight[:, None] * residual**2))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, turn = self._residual(motion)
        J = np.zeros((motion.num_frames, NUM_PARAMETERS, NUM_PARAMETERS))
        J[:, PELVIS, PELVIS] = np.eye(3)
        blocks = _inverse_right_jacobian(turn)
        for k, first in enumerate((0, *range(BODY.start, NUM_PARAMETERS, 3))):
            J[:, first : first + 3, first : first + 3] = blocks[:, k]
        J = J / self.sigma[:, None]
        transposed = np.swapaxes(J, -1, -2) * self.weight[:, None, None]
        equations.own += transposed @ J
        equations.gradient += (transposed @ residual[..., None])[..., 0]


@dataclass(frozen=True, eq=False)
class Smoothness:
    """Accelerations, linear and angular, in units of what people do: (v_t − v_(t−1)) / Δt / σ.

    Angular velocity is log(R_tᵀ R_(t+1)) / Δt in the joint's own axes. Steps between frames are small, so a step δ
    changes it as δ_(t+1) − δ_t.
    """

    time_s: Float[Array, " N"]
    sigma: Float[Array, " 63"]
    """Expected size of each parameter's acceleration: rad/s², m/s²."""

    def _stencil(self) -> Float[Array, "M 3"]:
        """Coefficients of frames t − 1, t, t + 1 in the acceleration at t, with the frame's time weight in them."""
        before, after = np.diff(self.time_s)[:-1], np.diff(self.time_s)[1:]
        middle = (before + after) / 2
        rows = np.stack([1 / before, -1 / before - 1 / after, 1 / after], axis=-1)
        return np.asarray(rows / middle[:, None] * np.sqrt(middle * REFERENCE_HZ)[:, None])

    def _residual(self, motion: Motion) -> Float[Array, "M 63"]:
        dt = np.diff(self.time_s)
        R = np.concatenate([motion.R_ref_root[:, None], motion.R_body[:, np.array(FREE_JOINTS) - 1]], axis=1)
        turn = vector_from_rotation(np.swapaxes(R[:-1], -1, -2) @ R[1:]) / dt[:, None, None]
        velocity = np.empty((len(dt), NUM_PARAMETERS))
        velocity[:, ROOT], velocity[:, BODY] = turn[:, 0], turn[:, 1:].reshape(len(dt), -1)
        velocity[:, PELVIS] = np.diff(motion.pelvis_ref, axis=0) / dt[:, None]
        middle = (dt[1:] + dt[:-1]) / 2
        return np.asarray(np.diff(velocity, axis=0) * (np.sqrt(REFERENCE_HZ / middle)[:, None] / self.sigma))

    def cost(self, motion: Motion) -> float:
        if motion.num_frames < 3:
            return 0.0
        return 0.5 * float(np.sum(self._residual(motion) ** 2))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        if motion.num_frames < 3:
            return
        stencil, residual = self._stencil(), self._residual(motion) / self.sigma
        information = 1 / self.sigma**2
        along = np.arange(NUM_PARAMETERS)
        for k in range(3):
            rows = slice(k, k + len(stencil))
            equations.gradient[rows] += stencil[:, k, None] * residual
            equations.own[rows, along, along] += stencil[:, k, None] ** 2 * information
        for k in range(2):
            rows = slice(k, k + len(stencil))
            equations.next_one[rows, along, along] += (stencil[:, k] * stencil[:, k + 1])[:, None] * information
        equations.next_two[: len(stencil)] += (stencil[:, 0] * stencil[:, 2])[:, None] * information
