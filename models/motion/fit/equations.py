"""The normal equations of a fit, kept as the banded matrix that LAPACK factorises, and what a term of a fit is.

Frames meet only through terms between neighbours, so the equations of a window are a band of 2·63 + 1 diagonals and a
step costs the same for every frame.
"""

import functools
from collections.abc import Callable
from functools import cached_property
from typing import Protocol, TypeVar, cast

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import lapack

from humanmm.models.geometry.robust import cauchy_loss, cauchy_weight
from humanmm.models.motion.fit.state import NUM_PARAMETERS, Motion

Array = np.ndarray
T = TypeVar("T")
V = TypeVar("V")

REFERENCE_HZ = 30.0
"""Frame rate at which a frame weighs 1."""

FRAMES_AT_ONCE = 16
"""Frames whose rows are in memory together: they stay in the processor's cache until they are multiplied."""

_BAND = 2 * NUM_PARAMETERS + 1
_COLUMN = 3 * NUM_PARAMETERS
"""Length of a column of blocks: rows of frames t, t + 1 and t + 2."""
_STEP = _COLUMN + 1
"""From an element on the diagonal to the next one."""


class NormalEquations:
    """H δ = −g of one window of N frames, where frame t meets t, t + 1 and t + 2 only.

    LAPACK keeps column j of a band from its diagonal on, one column after the other. Laid out with `_STEP` numbers a
    column, each frame's 63 columns are at the same time an ordinary array of three blocks (t, t), (t, t + 1) and
    (t, t + 2), one beside the other: terms add to the blocks, and the factorisation finds its band.
    """

    def __init__(self, num_frames: int) -> None:
        self.gradient = np.zeros((num_frames, NUM_PARAMETERS))
        self._values = np.zeros((num_frames, NUM_PARAMETERS * _STEP))
        blocks = self._values[:, : NUM_PARAMETERS * _COLUMN].reshape(num_frames, NUM_PARAMETERS, _COLUMN)
        self.own: Float[Array, "N 63 63"] = blocks[..., :NUM_PARAMETERS]
        """Blocks (t, t); what stands above the diagonal is not read."""
        self.next_one: Float[Array, "N 63 63"] = blocks[..., NUM_PARAMETERS : 2 * NUM_PARAMETERS]
        """Blocks (t, t + 1); the last is unused."""
        next_two = blocks[..., 2 * NUM_PARAMETERS :]
        self.next_two: Float[Array, "N 63"] = np.einsum("nii->ni", next_two)
        """Diagonals of blocks (t, t + 2), which hold nothing else; the last two are unused."""
        self.diagonal: Float[Array, "N 63"] = np.einsum("nii->ni", self.own)
        item = self._values.itemsize
        self.rotation_blocks: Float[Array, "N 21 3 3"] = np.lib.stride_tricks.as_strided(
            self._values,
            (num_frames, NUM_PARAMETERS // 3, 3, 3),
            (self._values.strides[0], 3 * _STEP * item, _COLUMN * item, item),
        )
        """The blocks on the diagonals of `own`: of the root, the pelvis and each joint with itself."""

    def clear(self) -> None:
        """Forget everything that was added."""
        self.gradient[:] = 0
        self._values[:] = 0

    def add_rows(
        self,
        frames: slice,
        rows: Float[Array, "n R p"],
        residual: Float[Array, "n R"],
        part: slice = slice(None),
    ) -> None:
        """Add Σ r² / 2 for residuals of single frames: `rows` are their derivatives by a part of the step, and both are
        times the root of their weight."""
        transposed = np.swapaxes(rows, -1, -2)
        self.own[frames, part, part] += transposed @ rows
        self.gradient[frames, part] += (transposed @ residual[..., None])[..., 0]

    def hold(self, held: Bool[Array, " N"]) -> None:
        """Take held frames out of the unknowns: their step is zero."""
        if not held.any():
            return
        self.gradient[held] = 0
        self.own[held] = np.eye(NUM_PARAMETERS)
        later_one, later_two = np.zeros_like(held), np.zeros_like(held)
        later_one[:-1], later_two[:-2] = held[1:], held[2:]
        self.next_one[held | later_one] = 0
        self.next_two[held | later_two] = 0

    def step(self, damping: float) -> Float[Array, "N 63"] | None:
        """The step with every diagonal element enlarged by the fraction `damping`, or None where rounding has made the
        equations indefinite."""
        band = self._work
        np.copyto(band, self._values.reshape(-1, _STEP)[:, :_BAND])
        band[:, 0] *= 1 + damping
        # The last frames' columns reach past the end, where nothing was added: LAPACK does not look there.
        factor, failed = lapack.dpbtrf(band.T, lower=1, overwrite_ab=1)
        if failed:
            return None
        solution, _ = lapack.dpbtrs(factor, -self.gradient.ravel(), lower=1, overwrite_b=1)
        return solution.reshape(self.gradient.shape) if np.isfinite(solution).all() else None

    @cached_property
    def _work(self) -> Array:
        return np.empty((self.gradient.size, _BAND))


class Term(Protocol):
    """One reason why a motion is more or less likely."""

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        ...

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature at this motion."""
        ...


def memoised(method: Callable[[T, Motion], V]) -> Callable[[T, Motion], V]:
    """A term's method whose answer the motion keeps: cost and derivatives at a motion need the same residuals."""

    @functools.wraps(method)
    def kept(term: T, motion: Motion) -> V:
        key = (term, method.__name__)
        if key not in motion.cache:
            motion.cache[key] = method(term, motion)
        return cast(V, motion.cache[key])

    return kept


def frame_weights(time_s: Float[Array, " N"]) -> Float[Array, " N"]:
    """Time that each frame stands for, in units of 1/30 s: half the distance to both neighbours."""
    if len(time_s) < 2:
        return np.ones(len(time_s))
    steps = np.diff(time_s)
    span = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    return np.asarray(span * REFERENCE_HZ)


def cauchy(squared: Array, scale: float) -> tuple[Array, Array]:
    """Robust half-cost c² / 2 · log(1 + s / c²) and weight of squared residuals s; c is the kernel's scale."""
    ratio = squared / (scale * scale)
    return 0.5 * scale * scale * cauchy_loss(ratio), cauchy_weight(ratio)
