"""The normal equations of `solver`: positions along chains of frames, and the cameras of the shots.

A position meets its neighbours one and two frames away and the camera of its own shot. The positions alone are a narrow
band: it is factorised once (A = L Lᵀ), each segment's column of its camera is carried through it (Y = L⁻¹ B), and what
remains for the cameras (C − Σ Yᵀ Y, the Schur complement; Triggs et al. 2000, "Bundle adjustment: a modern synthesis",
section 6.1) is small. Time and memory grow linearly with frames and with shots.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import SuperLU, splu

Array = np.ndarray

CAMERA_UNKNOWNS = 7
"""Per shot: position (3), small rotation (3), scale (1)."""
SCALE = 6
"""The last of them."""
SHARED_UNKNOWNS = CAMERA_UNKNOWNS + 2
"""What the positions of a segment share: their camera, and the logarithms of their person's size and of the focal
length."""
SIZE = CAMERA_UNKNOWNS
"""The size among them."""

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
    person: int
    shot: int
    horizon: int
    """End of the positions, of the same person, that this segment's camera influences."""


def segments_of(persons: Sequence[int], shots: Sequence[int], times: Sequence[Float[Array, " n"]]) -> list[Segment]:
    """The segments of trajectories that are sorted by person (numbered from 0), then by time."""
    segments = []
    starts = np.concatenate([[0], np.cumsum([len(time) for time in times])])
    for k, time in enumerate(times):
        horizon = int(starts[k + 1])
        for later in range(k + 1, len(times)):
            felt = int(np.searchsorted(times[later], time[-1] + _HORIZON_S)) if persons[later] == persons[k] else 0
            horizon += felt
            if felt < len(times[later]):
                break
        segments.append(Segment(int(starts[k]), int(starts[k + 1]), persons[k], shots[k], horizon))
    return segments


class WorldEquations:
    """H δ = −g of N positions (3 numbers each), S cameras (7 each), P people's sizes (1 each) and the focal length."""

    def __init__(self, segments: Sequence[Segment], num_shots: int) -> None:
        self.segments = tuple(segments)
        self.num_shots = num_shots
        n = segments[-1].stop if segments else 0
        self.gradient = np.zeros((n, 3))
        self.own = np.zeros((n, 3, 3))
        self.next_one = np.zeros((n, 3, 3))
        """Blocks of positions i and i + 1."""
        self.next_two = np.zeros(n)
        """The block of positions i and i + 2 is this times the identity."""
        self.mixed = np.zeros((n, 3, SHARED_UNKNOWNS))
        """Blocks of each position and what its segment shares."""
        num_people = max((segment.person + 1 for segment in segments), default=0)
        self.shared_gradient = np.zeros(CAMERA_UNKNOWNS * num_shots + num_people + 1)
        self._blocks: list[tuple[Array, Array, Array]] = []
        """Rows, columns and values of the matrix of all that is shared."""
        self._reduced: SuperLU | None = None
        """What remains for what is shared, factorised by `step`."""

    def camera(self, shot: int) -> Int[Array, " 7"]:
        """Where a shot's camera stands among what is shared."""
        return np.arange(CAMERA_UNKNOWNS * shot, CAMERA_UNKNOWNS * (shot + 1))

    def size(self, person: int) -> Int[Array, " 1"]:
        """Where a person's size stands among what is shared."""
        return np.array([CAMERA_UNKNOWNS * self.num_shots + person])

    @property
    def focal(self) -> Int[Array, " 1"]:
        """Where the focal length stands among what is shared."""
        return np.array([len(self.shared_gradient) - 1])

    def _shared(self, segment: int) -> Int[Array, " 9"]:
        own = self.segments[segment]
        return np.concatenate([self.camera(own.shot), self.size(own.person), self.focal])

    def add_positions(
        self,
        segment: int,
        residual: Float[Array, "n m"],
        by_position: Float[Array, "n m 3"],
        by_shared: Float[Array, "n m 9"],
    ) -> None:
        """Add Σ r² / 2 of residuals that depend on one position of a segment each, and on what it shares."""
        first = self.segments[segment].start
        rows, transposed = slice(first, first + len(residual)), np.swapaxes(by_position, -1, -2)
        self.own[rows] += transposed @ by_position
        self.mixed[rows] += transposed @ by_shared
        self.gradient[rows] += (transposed @ residual[..., None])[..., 0]
        self._add_shared(segment, residual.reshape(-1), by_shared)

    def add_chain(self, at: Array, coefficients: Float[Array, "n d"], residual: Float[Array, "n 3"]) -> None:
        """Add Σ r² / 2 with r = Σ_k coefficients[:, k] · position[at + k], k < d ≤ 3."""
        for a in range(coefficients.shape[1]):
            self.gradient[at + a] += coefficients[:, a, None] * residual
            for c in range(3):
                self.own[at + a, c, c] += coefficients[:, a] ** 2
                if a + 1 < coefficients.shape[1]:
                    self.next_one[at + a, c, c] += coefficients[:, a] * coefficients[:, a + 1]
        if coefficients.shape[1] == _REACH + 1:
            self.next_two[at] += coefficients[:, 0] * coefficients[:, 2]

    def add_moves(
        self,
        segment: int,
        whiten: Float[Array, "n k 3 3"],
        moved: Float[Array, "n k 3"],
        by_shared: Float[Array, "n k 3 9"],
    ) -> None:
        """Add Σ r² / 2 with r = whiten (position[i + 1] − position[i] + by_shared · what the segment shares).

        i are the positions of a segment but its last; k residuals each, `moved` is what they are now, not whitened.
        """
        first, by_shared = self.segments[segment].start, whiten @ by_shared
        residual, transposed = (whiten @ moved[..., None])[..., 0], np.swapaxes(whiten, -1, -2)
        total = (transposed @ whiten).sum(axis=1)
        pull, of_shared = (transposed @ residual[..., None])[..., 0].sum(axis=1), (transposed @ by_shared).sum(axis=1)
        for offset, sign in ((0, -1), (1, 1)):
            rows = slice(first + offset, first + offset + len(moved))
            self.own[rows] += total
            self.gradient[rows] += sign * pull
            self.mixed[rows] += sign * of_shared
        self.next_one[first : first + len(moved)] -= total
        self._add_shared(segment, residual.reshape(-1), by_shared)

    def add_shared(self, residual: Float[Array, " m"], *blocks: tuple[Array, Float[Array, "m u"]]) -> None:
        """Add Σ r² / 2 of residuals that depend on shared unknowns alone: which, and the derivatives by them."""
        for a, by_a in blocks:
            self.shared_gradient[a] += by_a.T @ residual
            for b, by_b in blocks:
                self._add_block(a, b, by_a.T @ by_b)

    def step(
        self, damping: float, shared_damping: Float[Array, " U"]
    ) -> tuple[Float[Array, "N 3"], Float[Array, " U"]]:
        """Gauss-Newton step of positions and of what is shared, the diagonal enlarged by these numbers."""
        band = self._factor(damping)
        y = _through(band, -self.gradient.reshape(-1, 1))[:, 0]
        columns: list[Array] = []
        right = -self.shared_gradient
        all_shared = np.arange(len(right))
        self._blocks.append((all_shared, all_shared, shared_damping))
        of_segment = [self._shared(k) for k in range(len(self.segments))]
        for k, segment in enumerate(self.segments):
            B = np.zeros((segment.horizon - segment.start, 3, SHARED_UNKNOWNS))
            B[: segment.stop - segment.start] = self.mixed[segment.start : segment.stop]
            rows = slice(3 * segment.start, 3 * segment.horizon)
            Y = _through(band[rows], B.reshape(-1, SHARED_UNKNOWNS))
            own = of_segment[k]
            right[own] -= Y.T @ y[rows]
            self._add_block(own, own, -Y.T @ Y)
            for before in range(k - 1, -1, -1):
                earlier = self.segments[before]
                if earlier.horizon <= segment.start:
                    break
                first, common = (
                    3 * (segment.start - earlier.start),
                    3 * (min(earlier.horizon, segment.horizon) - segment.start),
                )
                block = -columns[before][first : first + common].T @ Y[:common]
                self._add_block(of_segment[before], own, block)
                self._add_block(own, of_segment[before], block.T)
            columns.append(Y)
        shared = self._solve_shared(right)
        for segment, own, Y in zip(self.segments, of_segment, columns, strict=True):
            y[3 * segment.start : 3 * segment.horizon] -= Y @ shared[own]
        return _through(band, y[:, None], transposed=True).reshape(-1, 3), shared

    def std(self, unknowns: Int[Array, " u"]) -> Float[Array, " u"]:
        """Standard deviations of shared unknowns, all others unknown too, after `step`."""
        if self._reduced is None:
            raise RuntimeError("the equations have not been solved yet")
        unit = np.zeros((len(self.shared_gradient), len(unknowns)))
        unit[unknowns, np.arange(len(unknowns))] = 1.0
        return np.asarray(np.sqrt(np.diagonal(self._reduced.solve(unit)[unknowns])))

    def _add_shared(self, segment: int, residual: Float[Array, " m"], by_shared: Float[Array, "n k 9"]) -> None:
        rows, own = by_shared.reshape(-1, SHARED_UNKNOWNS), self._shared(segment)
        self.shared_gradient[own] += rows.T @ residual
        self._add_block(own, own, rows.T @ rows)

    def _add_block(self, a: Array, b: Array, block: Float[Array, "a b"]) -> None:
        self._blocks.append((np.repeat(a, len(b)), np.tile(b, len(a)), block.ravel()))

    def _factor(self, damping: float) -> Float[Array, "3N 7"]:
        """L of the positions' band: each column from its diagonal down, as LAPACK keeps it."""
        n, width = len(self.own), 3 * _REACH + 1
        band = np.zeros((n, 3, width))
        for c in range(3):
            band[:, c, : 3 - c] = self.own[:, c:, c]
            band[:, c, 0] += damping
            band[:, c, 3 - c : 6 - c] += self.next_one[:, c]
            band[:, c, 6] = self.next_two
        if not n:
            return band.reshape(0, width)
        factor, failed = lapack.dpbtrf(band.reshape(-1, width).T, lower=1, overwrite_ab=1)
        if failed:
            raise np.linalg.LinAlgError("what is known of the people's positions is not finite")
        return np.asarray(factor.T)

    def _solve_shared(self, right: Float[Array, " U"]) -> Float[Array, " U"]:
        row, column, value = (np.concatenate(part) for part in zip(*self._blocks, strict=True))
        whole = sparse.csc_matrix((value, (row, column)), shape=(right.size, right.size))
        self._reduced = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return np.asarray(self._reduced.solve(right))


def _through(band: Float[Array, "n 7"], right: Float[Array, "n c"], *, transposed: bool = False) -> Float[Array, "n c"]:
    """L⁻¹ right, or L⁻ᵀ right."""
    if not len(right):
        return right
    answer, _ = lapack.dtbtrs(band.T, right, uplo="L", trans="T" if transposed else "N")
    return np.asarray(answer)
