"""The terms of a fit: each adds its robust cost, gradient and Gauss-Newton curvature to the normal equations.

A term sees the whole window of N frames. Terms of a single frame fill the diagonal blocks; `Smoothness` couples
neighbours. All residuals are in units of their expected error, and all sums are integrals over time in units of 1/30 s,
so that the same numbers hold at any frame rate, also a variable one (`frame_weights`).

A new term (a planted foot, a floor, another camera) is a class with `cost` and `add`; the solver knows nothing else.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.kinematics import chunks
from humanmm.models.geometry.rotations import rotmat_to_rotvec, skew
from humanmm.models.motion.fit.equations import FRAMES_AT_ONCE, REFERENCE_HZ, NormalEquations, cauchy, memoised
from humanmm.models.motion.fit.state import BODY, NUM_PARAMETERS, PELVIS, ROOT, CameraPath, Motion, Skeleton

Array = np.ndarray

NEAREST_DEPTH = 0.2
"""Points closer to the camera plane than this, in metres, have no usable projection."""


@dataclass(frozen=True, eq=False)
class Reprojection:
    """Points seen at pixels: |π(K (R_cam_ref p + t)) − x| / σ, robust for each point."""

    skeleton: Skeleton
    """The body with these points on it."""
    camera: CameraPath
    pixels: Float[Array, "N K 2"]
    sigma_px: Float[Array, "N K"]
    weight: Float[Array, "N K"]
    """Trust × time weight; zero where unseen."""
    robust_scale: float = 3.0
    """Scale of the Cauchy kernel, in standard deviations."""

    @memoised
    def _seen(self, motion: Motion) -> Motion:
        return motion.with_points(self.skeleton)

    @memoised
    def _residual(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Residuals (N, K, 2), weights (N, K), and x/z, y/z, z in the camera (N, K, 3)."""
        p = self.camera.to_camera(self._seen(motion).points)
        weight = np.where(p[..., 2] > NEAREST_DEPTH, self.weight, 0.0)
        p[..., 2] = np.maximum(p[..., 2], NEAREST_DEPTH)
        p[..., :2] /= p[..., 2:]
        K = self.camera.K[:, None]
        x, y = p[..., 0], p[..., 1]
        projected = np.stack([K[..., 0, 0] * x + K[..., 0, 1] * y + K[..., 0, 2], K[..., 1, 1] * y + K[..., 1, 2]], -1)
        return (projected - self.pixels) / self.sigma_px[..., None], weight, p

    @memoised
    def _loss(self, motion: Motion) -> tuple[Array, Array]:
        """Robust half-costs and weights."""
        residual, _, _ = self._residual(motion)
        return cauchy(np.sum(residual**2, axis=-1), self.robust_scale)

    def cost(self, motion: Motion) -> float:
        return float(np.sum(self._residual(motion)[1] * self._loss(motion)[0]))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, weight, in_camera = self._residual(motion)
        x, y, z = np.moveaxis(in_camera, -1, 0)
        root = np.sqrt(weight * self._loss(motion)[1])
        K = self.camera.K[:, None]
        along = np.zeros((*weight.shape, 2, 3))  # ∂ residual / ∂ p_cam
        along[..., 0, 0], along[..., 0, 1] = K[..., 0, 0], K[..., 0, 1]
        along[..., 0, 2] = -K[..., 0, 0] * x - K[..., 0, 1] * y
        along[..., 1, 1], along[..., 1, 2] = K[..., 1, 1], -K[..., 1, 1] * y
        along *= (root / (z * self.sigma_px))[..., None, None]
        along = along.reshape(len(z), -1, 3) @ self.camera.R_cam_ref
        right = (root[..., None] * residual).reshape(len(z), -1).astype(np.float32)
        which = np.repeat(np.arange(weight.shape[1]), 2)
        for frames in chunks(len(z), FRAMES_AT_ONCE):
            rows = self._seen(motion).point_rows(frames, which, along[frames], dtype=np.float32)
            equations.add_rows(frames, rows, right[frames])

    def distances_px(self, motion: Motion) -> Float[Array, "N K"]:
        """Reprojection errors in pixels, nan where the point has no weight."""
        residual, weight, _ = self._residual(motion)
        return np.where(weight > 0, np.linalg.norm(residual, axis=-1) * self.sigma_px, np.nan)


@dataclass(frozen=True, eq=False)
class Bones:
    """Vectors between points known in 3D, all of a frame rotated by one unknown small rotation φ.

    r_b = A_b ((p_to − p_from) − exp(φ) v_b), φ ~ N(0, diag(tilt_std²)) in the axes of `R_ref_view`. A network that
    lifts a picture to 3D is wrong about the tilt of the whole body before it is wrong about one bone against the
    others; φ takes that part, and is eliminated frame by frame.
    """

    start: Int[Array, " B"]
    end: Int[Array, " B"]
    vectors: Float[Array, "N B 3"]
    """v, metres, in the axes of the reference frame."""
    R_ref_view: Float[Array, "N 3 3"]
    """Axes in which errors are stated: across (x, y) and along (z) the viewing ray."""
    sigma: Float[Array, "B 3"]
    """Expected errors in view axes, metres."""
    tilt_std: Float[Array, " 3"]
    """Standard deviation of φ about the view axes, radians."""
    weight: Float[Array, "N B"]
    time_weight: Float[Array, " N"]
    robust_scale: float = 3.0

    @cached_property
    def _tilting(self) -> tuple[Float[Array, "N 3B 3"], Float[Array, "N B 9"]]:
        """A [v]×, by which residuals grow with φ (exp(φ) v ≈ v − [v]× φ), and its square for each bone."""
        tilting = skew(self.vectors @ self.R_ref_view) / self.sigma[..., None]
        squared = np.swapaxes(tilting, -1, -2) @ tilting
        return tilting.reshape(len(tilting), -1, 3), squared.reshape(*tilting.shape[:2], 9)

    @memoised
    def _residual(self, motion: Motion) -> tuple[Array, Array, Array, Array]:
        """Residuals, robust costs and weights at the best φ, and what φ itself costs: (N,B,3), (N,B), (N,B), (N,)."""
        points = motion.points
        gap = (points[:, self.end] - points[:, self.start] - self.vectors) @ self.R_ref_view
        tilting, squared = self._tilting
        base = gap / self.sigma
        trust = np.ones_like(self.weight)
        loose = self.time_weight[:, None, None] * np.diag(1 / self.tilt_std**2)
        for _ in range(3):
            w = self.weight * trust
            S = (w[:, None] @ squared).reshape(-1, 3, 3) + loose
            s = np.swapaxes(tilting, -1, -2) @ (w[..., None] * base).reshape(len(w), -1, 1)
            phi = -np.linalg.solve(S, s)
            residual = base + (tilting @ phi).reshape(base.shape)
            loss, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        tilt_cost = 0.5 * self.time_weight * np.sum((phi[..., 0] / self.tilt_std) ** 2, axis=-1)
        return residual, loss, trust, tilt_cost

    def cost(self, motion: Motion) -> float:
        _, loss, _, tilt_cost = self._residual(motion)
        return float(np.sum(self.weight * loss) + np.sum(tilt_cost))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, _, trust, _ = self._residual(motion)
        root = np.sqrt(self.weight * trust)[..., None]
        along = np.swapaxes(self.R_ref_view, -1, -2)[:, None] * (root / self.sigma)[..., None]
        along = along.reshape(len(root), -1, 3)
        right = (root * residual).reshape(len(root), -1).astype(np.float32)
        start, end = np.repeat(self.start, 3), np.repeat(self.end, 3)
        for frames in chunks(len(root), FRAMES_AT_ONCE):
            rows = motion.point_rows(frames, end, along[frames], dtype=np.float32)
            rows -= motion.point_rows(frames, start, along[frames], dtype=np.float32)
            equations.add_rows(frames, rows, right[frames])


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
    """A mixture of Gaussians over the rotation vectors of the free joints, and soft limits at the ends of their ranges.

    The likeliest Gaussian alone counts in each frame (the maximum stands for the sum).
    """

    means: Float[Array, "C 57"]
    precisions: Float[Array, "C 57 57"]
    log_peaks: Float[Array, " C"]
    """Logarithm of each Gaussian's weighted density at its mean, up to one constant."""
    lower: Float[Array, " 57"]
    upper: Float[Array, " 57"]
    joint_limit: float
    """1 / σ² of the joint limits, per rad²."""
    weight: Float[Array, " N"]

    @cached_property
    def _roots(self) -> Float[Array, "C 57 57"]:
        """U with UᵀU = precision: U (x − mean) are residuals."""
        return np.swapaxes(np.linalg.cholesky(self.precisions), -1, -2)

    @memoised
    def _vectors(self, motion: Motion) -> Float[Array, "N 19 3"]:
        return rotmat_to_rotvec(motion.free_rotations[:, 1:])

    def _beyond(self, x: Array) -> Array:
        return np.asarray(np.maximum(x - self.upper, 0) + np.minimum(x - self.lower, 0))

    @memoised
    def _likeliest(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Each frame's Gaussian, its residuals (N, 57), and what they cost."""
        x = self._vectors(motion).reshape(motion.num_frames, -1)
        residuals = (x - self.means[:, None]) @ np.swapaxes(self._roots, -1, -2)
        costs = 0.5 * np.einsum("cni,cni->cn", residuals, residuals) - self.log_peaks[:, None]
        chosen, frames = np.argmin(costs, axis=0), np.arange(len(x))
        return chosen, residuals[chosen, frames], costs[chosen, frames] + np.max(self.log_peaks)

    def cost(self, motion: Motion) -> float:
        x = self._vectors(motion).reshape(motion.num_frames, -1)
        _, _, costs = self._likeliest(motion)
        return float(np.sum(self.weight * (costs + 0.5 * self.joint_limit * np.sum(self._beyond(x) ** 2, axis=-1))))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        vectors = self._vectors(motion)
        chosen, residuals, _ = self._likeliest(motion)
        chain = _inverse_right_jacobian(vectors)  # from rotation vectors to steps, joint by joint
        transposed = np.swapaxes(chain, -1, -2).astype(np.float32)
        hessian = self.precisions.astype(np.float32)[chosen] * self.weight.astype(np.float32)[:, None, None]
        for _ in range(2):  # H → chainᵀ H chain: from the left, for H is symmetric
            hessian = transposed @ hessian.reshape(*vectors.shape, -1)
            hessian = np.swapaxes(hessian.reshape(len(vectors), self.means.shape[1], -1), -1, -2)
        equations.own[:, BODY, BODY] += hessian
        beyond = self._beyond(vectors.reshape(len(vectors), -1)).reshape(vectors.shape)
        stiff = self.joint_limit * self.weight[:, None, None] * (beyond != 0)
        equations.rotation_blocks[:, 2:] += transposed @ (stiff[..., None] * chain)
        pull = (residuals[:, None] @ self._roots[chosen]).reshape(vectors.shape) * self.weight[:, None, None]
        of_steps = np.swapaxes(chain, -1, -2) @ (pull + stiff * beyond)[..., None]
        equations.gradient[:, BODY] += of_steps.reshape(len(vectors), -1)


@dataclass(frozen=True, eq=False)
class EstimatedRotations:
    """Rotations of the root and the free joints that a network estimates, robust for each joint: log(Rᵀ R_now) / σ."""

    R_ref: Float[Array, "N 20 3 3"]
    """The root's in the reference frame, the joints' relative to their parents."""
    sigma_rad: Float[Array, "N 20"]
    weight: Float[Array, " N"]
    robust_scale: float = 3.0

    @memoised
    def _residual(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Rotation vectors (N, 20, 3), robust costs and weights (N, 20)."""
        vectors = rotmat_to_rotvec(np.swapaxes(self.R_ref, -1, -2) @ motion.free_rotations)
        return vectors, *cauchy(np.sum((vectors / self.sigma_rad[..., None]) ** 2, axis=-1), self.robust_scale)

    def cost(self, motion: Motion) -> float:
        return float(np.sum(self.weight[:, None] * self._residual(motion)[1]))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        vectors, _, trust = self._residual(motion)
        chain = _inverse_right_jacobian(vectors)
        precision = self.weight[:, None] * trust / self.sigma_rad**2
        transposed = np.swapaxes(chain, -1, -2) * precision[..., None, None]
        gradient = (transposed @ vectors[..., None])[..., 0]
        equations.rotation_blocks[:, 0] += transposed[:, 0] @ chain[:, 0]
        equations.rotation_blocks[:, 2:] += transposed[:, 1:] @ chain[:, 1:]
        equations.gradient[:, ROOT] += gradient[:, 0]
        equations.gradient[:, BODY] += gradient[:, 1:].reshape(len(vectors), -1)


@dataclass(frozen=True, eq=False)
class Anchor:
    """Frames that stay near a reference motion: in a long hole, smoothness alone flies off with the last velocity."""

    reference: Motion
    sigma: Float[Array, " 63"]
    """Standard deviation of each parameter: radians, metres for the pelvis."""
    weight: Float[Array, " N"]

    @memoised
    def _residual(self, motion: Motion) -> tuple[Array, Array]:
        """Displacements (N, 63), and rotation vectors (N, 20, 3) of the rotated joints."""
        rotation = rotmat_to_rotvec(np.swapaxes(self.reference.free_rotations, -1, -2) @ motion.free_rotations)
        gap = np.empty((motion.num_frames, NUM_PARAMETERS))
        gap[:, ROOT], gap[:, BODY] = rotation[:, 0], rotation[:, 1:].reshape(len(gap), -1)
        gap[:, PELVIS] = motion.pelvis_ref - self.reference.pelvis_ref
        return gap / self.sigma, rotation

    def cost(self, motion: Motion) -> float:
        residual, _ = self._residual(motion)
        return 0.5 * float(np.sum(self.weight[:, None] * residual**2))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        residual, rotation = self._residual(motion)
        chain = _inverse_right_jacobian(rotation)
        pelvis = np.broadcast_to(np.eye(3), (len(rotation), 1, 3, 3))
        rows = np.concatenate([chain[:, :1], pelvis, chain[:, 1:]], axis=1) / self.sigma.reshape(-1, 3, 1)
        transposed = np.swapaxes(rows, -1, -2) * self.weight[:, None, None, None]
        equations.rotation_blocks += transposed @ rows
        equations.gradient += (transposed @ residual.reshape(*rotation.shape[:1], -1, 3, 1)).reshape(len(rotation), -1)


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

    @memoised
    def _residual(self, motion: Motion) -> Float[Array, "M 63"]:
        dt = np.diff(self.time_s)
        rotation = (
            rotmat_to_rotvec(np.swapaxes(motion.free_rotations[:-1], -1, -2) @ motion.free_rotations[1:])
            / dt[:, None, None]
        )
        velocity = np.empty((len(dt), NUM_PARAMETERS))
        velocity[:, ROOT], velocity[:, BODY] = rotation[:, 0], rotation[:, 1:].reshape(len(dt), -1)
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
        for k in range(3):
            rows = slice(k, k + len(stencil))
            equations.gradient[rows] += stencil[:, k, None] * residual
            equations.diagonal[rows] += stencil[:, k, None] ** 2 * information
        for k in range(2):
            rows = slice(k, k + len(stencil))
            later = np.einsum("nii->ni", equations.next_one[rows])
            later += (stencil[:, k] * stencil[:, k + 1])[:, None] * information
        equations.next_two[: len(stencil)] += (stencil[:, 0] * stencil[:, 2])[:, None] * information
