"""The normal equations of `solver`: positions along chains of frames, and the cameras of the shots.

A position meets its neighbours one and two frames away and the camera of its own shot. The positions alone are a narrow
band: it is factorised once (A = L Lᵀ), each segment's column of its camera is carried through it (Y = L⁻¹ B), and what
remains for the cameras (C − Σ Yᵀ Y, the Schur complement; Triggs et al. 2000, "Bundle adjustment: a modern synthesis",
section 6.1) is small. Time and memory grow linearly with frames and with shots.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import SuperLU, splu

Array = np.ndarray

CAMERA_UNKNOWNS = 7
"""Per shot: position (3), small rotation (3), scale (1)."""
SCALE = 6
"""The last of them."""

_REACH = 2
"""Frames that a position meets on either side."""

_HORIZON_S = 15.0
"""Influence horizon: what a camera does to its people fades within a second after its shot, and after this it is below
rounding."""


@dataclass(frozen=True)
class Segment:
    """A shot's trajectory as one segment of a person's chain: positions [start, stop) in the order of all positions."""

    start: int
    stop: int
    shot: int
    horizon: int
    """End of the positions, of the same person, that this segment's camera influences."""


def segments_of(persons: Sequence[int], shots: Sequence[int], times: Sequence[Float[Array, " n"]]) -> list[Segment]:
    """The segments of trajectories that are sorted by person, then by time."""
    segments = []
    starts = np.concatenate([[0], np.cumsum([len(time) for time in times])])
    for k, time in enumerate(times):
        horizon = int(starts[k + 1])
        for later in range(k + 1, len(times)):
            felt = int(np.searchsorted(times[later], time[-1] + _HORIZON_S)) if persons[later] == persons[k] else 0
            horizon += felt
            if felt < len(times[later]):
                break
        segments.append(Segment(int(starts[k]), int(starts[k + 1]), shots[k], horizon))
    return segments


class WorldEquations:
    """H δ = −g of N positions (3 numbers each) and S cameras (7 each)."""

    def __init__(self, segments: Sequence[Segment], num_shots: int) -> None:
        self.segments = tuple(segments)
        n = segments[-1].stop if segments else 0
        self.gradient = np.zeros((n, 3))
        self.own = np.zeros((n, 3, 3))
        self.next = np.zeros((_REACH + 1, n))
        """next[d, i]: the block of positions i and i + d is this times the identity; d = 0 is unused."""
        self.mixed = np.zeros((n, 3, CAMERA_UNKNOWNS))
        """Blocks of each position and the camera of its shot."""
        self.camera_gradient = np.zeros((num_shots, CAMERA_UNKNOWNS))
        self.cameras: dict[tuple[int, int], Array] = {}
        """Blocks of two cameras."""
        self._reduced: SuperLU | None = None
        """What remains for the cameras, factorised by `step`."""

    def add_positions(
        self,
        first: int,
        shot: int,
        residual: Float[Array, "n m"],
        by_position: Float[Array, "n m 3"],
        by_camera: Float[Array, "n m 7"],
    ) -> None:
        """Add Σ r² / 2 of residuals that depend on one position each, from `first` on, and on the camera of a shot."""
        rows, transposed = slice(first, first + len(residual)), np.swapaxes(by_position, -1, -2)
        self.own[rows] += transposed @ by_position
        self.mixed[rows] += transposed @ by_camera
        self.gradient[rows] += (transposed @ residual[..., None])[..., 0]
        self._add_camera(shot, residual, by_camera)

    def add_chain(self, at: Array, coefficients: Float[Array, "n d"], residual: Float[Array, "n 3"]) -> None:
        """Add Σ r² / 2 with r = Σ_k coefficients[:, k] · position[at + k], k < d ≤ 3."""
        for a in range(coefficients.shape[1]):
            self.gradient[at + a] += coefficients[:, a, None] * residual
            for c in range(3):
                self.own[at + a, c, c] += coefficients[:, a] ** 2
            for b in range(a + 1, coefficients.shape[1]):
                self.next[b - a, at + a] += coefficients[:, a] * coefficients[:, b]

    def add_still(
        self,
        first: int,
        shot: int,
        weight: Float[Array, "n k"],
        moved: Float[Array, "n k 3"],
        lever: Float[Array, "n k 3 3"],
    ) -> None:
        """Add Σ r² / 2 with r = weight · (position[i + 1] − position[i] + lever · rotation of the camera).

        i runs from `first` on; k residuals each, `moved` is what they are now, without the weight.
        """
        residual, by_camera = weight[..., None] * moved, np.zeros((*moved.shape, CAMERA_UNKNOWNS))
        by_camera[..., 3:6] = weight[..., None, None] * lever
        total = (weight**2).sum(axis=1)
        pull, of_camera = (np.einsum("nk,nk...->n...", weight, one) for one in (residual, by_camera))
        for offset, sign in ((0, -1), (1, 1)):
            rows = slice(first + offset, first + offset + len(weight))
            self.own[rows] += total[:, None, None] * np.eye(3)
            self.gradient[rows] += sign * pull
            self.mixed[rows] += sign * of_camera
        self.next[1, first : first + len(weight)] -= total
        self._add_camera(shot, residual, by_camera)

    def add_cameras(self, residual: Float[Array, " m"], *blocks: tuple[int, Float[Array, "m 7"]]) -> None:
        """Add Σ r² / 2 of residuals that depend on the cameras of some shots."""
        for a, by_a in blocks:
            self.camera_gradient[a] += by_a.T @ residual
            for b, by_b in blocks:
                self._add_block(a, b, by_a.T @ by_b)

    def step(
        self, damping: float, camera_damping: Float[Array, "S 7"]
    ) -> tuple[Float[Array, "N 3"], Float[Array, "S 7"]]:
        """Gauss-Newton step of positions and cameras, the diagonal enlarged by these numbers."""
        band = self._factor(damping)
        y = _through(band, -self.gradient.reshape(-1, 1))[:, 0]
        columns: list[Array] = []
        right = -self.camera_gradient
        for shot, extra in enumerate(camera_damping):
            self._add_block(shot, shot, np.diag(extra))
        for k, segment in enumerate(self.segments):
            B = np.zeros((segment.horizon - segment.start, 3, CAMERA_UNKNOWNS))
            B[: segment.stop - segment.start] = self.mixed[segment.start : segment.stop]
            rows = slice(3 * segment.start, 3 * segment.horizon)
            Y = _through(band[rows], B.reshape(-1, CAMERA_UNKNOWNS))
            right[segment.shot] -= Y.T @ y[rows]
            self._add_block(segment.shot, segment.shot, -Y.T @ Y)
            for earlier, its_Y in zip(self.segments[:k][::-1], columns[::-1], strict=True):
                if earlier.horizon <= segment.start:
                    break
                first, shared = (
                    3 * (segment.start - earlier.start),
                    3 * (min(earlier.horizon, segment.horizon) - segment.start),
                )
                block = -its_Y[first : first + shared].T @ Y[:shared]
                self._add_block(earlier.shot, segment.shot, block)
                self._add_block(segment.shot, earlier.shot, block.T)
            columns.append(Y)
        cameras = self._solve_cameras(right)
        for segment, Y in zip(self.segments, columns, strict=True):
            y[3 * segment.start : 3 * segment.horizon] -= Y @ cameras[segment.shot]
        return _through(band, y[:, None], transposed=True).reshape(-1, 3), cameras

    def camera_std(self, unknown: int) -> Float[Array, " S"]:
        """Standard deviation of one unknown of every camera, all others unknown too, after `step`."""
        if self._reduced is None:
            raise RuntimeError("the equations have not been solved yet")
        index = np.arange(unknown, self.camera_gradient.size, CAMERA_UNKNOWNS)
        unit = np.zeros((self.camera_gradient.size, len(index)))
        unit[index, np.arange(len(index))] = 1.0
        return np.sqrt(np.diagonal(self._reduced.solve(unit)[index]))

    def _add_camera(self, shot: int, residual: Float[Array, "n m"], by_camera: Float[Array, "n m 7"]) -> None:
        rows = by_camera.reshape(-1, CAMERA_UNKNOWNS)
        self.camera_gradient[shot] += rows.T @ residual.ravel()
        self._add_block(shot, shot, rows.T @ rows)

    def _add_block(self, a: int, b: int, block: Float[Array, "7 7"]) -> None:
        before = self.cameras.get((a, b))
        self.cameras[a, b] = block if before is None else before + block

    def _factor(self, damping: float) -> Float[Array, "3N 7"]:
        """L of the positions' band: each column from its diagonal down, as LAPACK keeps it."""
        n, width = len(self.own), 3 * _REACH + 1
        band = np.zeros((n, 3, width))
        for c in range(3):
            band[:, c, : 3 - c] = self.own[:, c:, c]
            band[:, c, 0] += damping
            for d in range(1, _REACH + 1):
                band[:, c, 3 * d] = self.next[d]
        if not n:
            return band.reshape(0, width)
        factor, failed = lapack.dpbtrf(band.reshape(-1, width).T, lower=1, overwrite_ab=1)
        if failed:
            raise np.linalg.LinAlgError("what is known of the people's positions is not finite")
        return np.asarray(factor.T)

    def _solve_cameras(self, right: Float[Array, "S 7"]) -> Float[Array, "S 7"]:
        corners, blocks = np.array(list(self.cameras)) * CAMERA_UNKNOWNS, np.array(list(self.cameras.values()))
        inside = np.arange(CAMERA_UNKNOWNS)
        row = np.broadcast_to(corners[:, 0, None, None] + inside[:, None], blocks.shape)
        column = np.broadcast_to(corners[:, 1, None, None] + inside, blocks.shape)
        whole = sparse.csc_matrix((blocks.ravel(), (row.ravel(), column.ravel())), shape=(right.size, right.size))
        self._reduced = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return np.asarray(self._reduced.solve(right.ravel())).reshape(right.shape)


def _through(band: Float[Array, "n 7"], right: Float[Array, "n c"], *, transposed: bool = False) -> Float[Array, "n c"]:
    """L⁻¹ right, or L⁻ᵀ right."""
    if not len(right):
        return right
    answer, _ = lapack.dtbtrs(band.T, right, uplo="L", trans="T" if transposed else "N")
    return np.asarray(answer)
