"""The normal equations of `world_solve`: places along chains of frames, and the cameras of the shots.

A place meets its neighbours one and two frames away and the camera of its own shot. The places alone are a narrow band:
it is factorised once (A = L Lᵀ), each strand's column of its camera is carried through it (Y = L⁻¹ B), and what remains
for the cameras (C − Σ Yᵀ Y, the Schur complement) is small. Time and memory grow linearly with frames and with shots.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

Array = np.ndarray

CAMERA_UNKNOWNS = 7
"""Per shot: place (3), small rotation (3), scale (1)."""

_REACH = 2
"""Frames that a place meets on either side."""

_ECHO_S = 15.0
"""What a camera does to its people fades within a second after its shot: after this it is below rounding."""


@dataclass(frozen=True)
class Link:
    """A strand as one link of a person's chain: places [start, stop) in the order of all places."""

    start: int
    stop: int
    shot: int
    echo: int
    """End of the places, of the same person, that this strand's camera can be felt in."""


def links_of(persons: Sequence[int], shots: Sequence[int], times: Sequence[Float[Array, " n"]]) -> list[Link]:
    """The links of strands that are sorted by person, then by time."""
    links = []
    starts = np.concatenate([[0], np.cumsum([len(time) for time in times])])
    for k, time in enumerate(times):
        echo = int(starts[k + 1])
        for later in range(k + 1, len(times)):
            felt = int(np.searchsorted(times[later], time[-1] + _ECHO_S)) if persons[later] == persons[k] else 0
            echo += felt
            if felt < len(times[later]):
                break
        links.append(Link(int(starts[k]), int(starts[k + 1]), shots[k], echo))
    return links


class WorldEquations:
    """H δ = −g of N places (3 numbers each) and S cameras (7 each)."""

    def __init__(self, links: Sequence[Link], num_shots: int) -> None:
        self.links = tuple(links)
        n = links[-1].stop if links else 0
        self.gradient = np.zeros((n, 3))
        self.own = np.zeros((n, 3, 3))
        self.next = np.zeros((_REACH + 1, n))
        """next[d, i]: the block of places i and i + d is this times the identity; d = 0 is unused."""
        self.mixed = np.zeros((n, 3, CAMERA_UNKNOWNS))
        """Blocks of each place and the camera of its shot."""
        self.camera_gradient = np.zeros((num_shots, CAMERA_UNKNOWNS))
        self.cameras: dict[tuple[int, int], Array] = {}
        """Blocks of two cameras."""

    def add_places(
        self,
        first: int,
        shot: int,
        residual: Float[Array, "n m"],
        by_place: Float[Array, "n m 3"],
        by_camera: Float[Array, "n m 7"],
    ) -> None:
        """Add Σ r² / 2 of residuals that hang on one place each, from `first` on, and on the camera of a shot."""
        rows, transposed = slice(first, first + len(residual)), np.swapaxes(by_place, -1, -2)
        self.own[rows] += transposed @ by_place
        self.mixed[rows] += transposed @ by_camera
        self.gradient[rows] += (transposed @ residual[..., None])[..., 0]
        self._add_camera(shot, residual, by_camera)

    def add_chain(self, at: Array, shares: Float[Array, "n d"], residual: Float[Array, "n 3"]) -> None:
        """Add Σ r² / 2 with r = Σ_k shares[:, k] · place[at + k], k < d ≤ 3."""
        for a in range(shares.shape[1]):
            self.gradient[at + a] += shares[:, a, None] * residual
            for c in range(3):
                self.own[at + a, c, c] += shares[:, a] ** 2
            for b in range(a + 1, shares.shape[1]):
                self.next[b - a, at + a] += shares[:, a] * shares[:, b]

    def add_still(
        self,
        first: int,
        shot: int,
        weight: Float[Array, " n"],
        moved: Float[Array, "n 3"],
        lever: Float[Array, "n 3 3"],
    ) -> None:
        """Add Σ r² / 2 with r = weight · (place[i + 1] − place[i] + lever · turn of the camera), i from `first` on;
        `moved` is what r is now, without the weight."""
        residual, by_camera = weight[:, None] * moved, np.zeros((len(weight), 3, CAMERA_UNKNOWNS))
        self.add_chain(first + np.arange(len(weight)), np.stack([-weight, weight], axis=1), residual)
        by_camera[..., 3:6] = weight[:, None, None] * lever
        for offset, sign in ((0, -1), (1, 1)):
            self.mixed[first + offset : first + offset + len(weight)] += sign * weight[:, None, None] * by_camera
        self._add_camera(shot, residual, by_camera)

    def add_cameras(self, residual: Float[Array, " m"], *blocks: tuple[int, Float[Array, "m 7"]]) -> None:
        """Add Σ r² / 2 of residuals that hang on the cameras of some shots."""
        for a, by_a in blocks:
            self.camera_gradient[a] += by_a.T @ residual
            for b, by_b in blocks:
                self._add_block(a, b, by_a.T @ by_b)

    def step(
        self, damping: float, camera_damping: Float[Array, "S 7"]
    ) -> tuple[Float[Array, "N 3"], Float[Array, "S 7"]]:
        """Gauss-Newton step of places and cameras, the diagonal enlarged by these numbers."""
        band = self._factor(damping)
        y = _through(band, -self.gradient.reshape(-1, 1))[:, 0]
        columns: list[Array] = []
        right = -self.camera_gradient
        for shot, extra in enumerate(camera_damping):
            self._add_block(shot, shot, np.diag(extra))
        for k, link in enumerate(self.links):
            B = np.zeros((link.echo - link.start, 3, CAMERA_UNKNOWNS))
            B[: link.stop - link.start] = self.mixed[link.start : link.stop]
            rows = slice(3 * link.start, 3 * link.echo)
            Y = _through(band[rows], B.reshape(-1, CAMERA_UNKNOWNS))
            right[link.shot] -= Y.T @ y[rows]
            self._add_block(link.shot, link.shot, -Y.T @ Y)
            for earlier, its_Y in zip(self.links[:k][::-1], columns[::-1], strict=True):
                if earlier.echo <= link.start:
                    break
                first, shared = 3 * (link.start - earlier.start), 3 * (min(earlier.echo, link.echo) - link.start)
                block = -its_Y[first : first + shared].T @ Y[:shared]
                self._add_block(earlier.shot, link.shot, block)
                self._add_block(link.shot, earlier.shot, block.T)
            columns.append(Y)
        cameras = self._solve_cameras(right)
        for link, Y in zip(self.links, columns, strict=True):
            y[3 * link.start : 3 * link.echo] -= Y @ cameras[link.shot]
        return _through(band, y[:, None], transposed=True).reshape(-1, 3), cameras

    def _add_camera(self, shot: int, residual: Float[Array, "n m"], by_camera: Float[Array, "n m 7"]) -> None:
        rows = by_camera.reshape(-1, CAMERA_UNKNOWNS)
        self.camera_gradient[shot] += rows.T @ residual.ravel()
        self._add_block(shot, shot, rows.T @ rows)

    def _add_block(self, a: int, b: int, block: Float[Array, "7 7"]) -> None:
        before = self.cameras.get((a, b))
        self.cameras[a, b] = block if before is None else before + block

    def _factor(self, damping: float) -> Float[Array, "3N 7"]:
        """L of the places' band: each column from its diagonal down, as LAPACK keeps it."""
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
            raise np.linalg.LinAlgError("what is known of the people's places is not finite")
        return np.asarray(factor.T)

    def _solve_cameras(self, right: Float[Array, "S 7"]) -> Float[Array, "S 7"]:
        corners, blocks = np.array(list(self.cameras)) * CAMERA_UNKNOWNS, np.array(list(self.cameras.values()))
        inside = np.arange(CAMERA_UNKNOWNS)
        row = np.broadcast_to(corners[:, 0, None, None] + inside[:, None], blocks.shape)
        column = np.broadcast_to(corners[:, 1, None, None] + inside, blocks.shape)
        whole = sparse.csc_matrix((blocks.ravel(), (row.ravel(), column.ravel())), shape=(right.size, right.size))
        factor = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return np.asarray(factor.solve(right.ravel())).reshape(right.shape)


def _through(band: Float[Array, "n 7"], right: Float[Array, "n c"], *, transposed: bool = False) -> Float[Array, "n c"]:
    """L⁻¹ right, or L⁻ᵀ right."""
    if not len(right):
        return right
    answer, _ = lapack.dtbtrs(band.T, right, uplo="L", trans="T" if transposed else "N")
    return np.asarray(answer)
