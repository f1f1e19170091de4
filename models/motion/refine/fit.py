"""One more fit of the body, over the whole clip in the world: all shots' evidence, and feet that do not move.

`hmr` fits each shot by itself and `align` puts the shots into one world. Here one person's keypoints and 3D landmarks
of all shots are seen by cameras that now stand in one world, motion runs on through the cuts, and a planted foot has
the same position in every frame, on the floor: what one view leaves open (how far away, how the body is tilted) the
leg, the floor and the neighbouring shot decide.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from humanmm.models.body.kinematics import chunks
from humanmm.models.geometry.rotations import skew
from humanmm.models.motion.fit.equations import (
    FRAMES_AT_ONCE,
    REFERENCE_HZ,
    NormalEquations,
    Term,
    cauchy,
    frame_weights,
    memoised,
)
from humanmm.models.motion.fit.evidence import LongEvidence, Sighting
from humanmm.models.motion.fit.hmr import EvidenceTerms, NoiseModel, pelvis_depths
from humanmm.models.motion.fit.solver import SolverSettings, solve_windows
from humanmm.models.motion.fit.state import PELVIS, ROOT, CameraPath, LongMotion, Motion, Skeleton
from humanmm.models.motion.refine.contacts import STANDS
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.progress import Progress, silent

Array = np.ndarray

PLANTED_SPEED_MS = 0.07
"""Speed that an estimated foot keeps while it stands, m/s: about what motion capture skates. With 0.1 feet slide by 4.0
and not 3.9 mm a frame on 48 development clips (median; a tenth more in the mean clip), other errors are the same."""

FLOOR_SIGMA_M = 0.05
"""Standard deviation of the height of a joint that stands, metres: the vertical is not exact, and floors are uneven.
With 0.03 and 0.06 WA-MPJPE of development clips is within 2 mm of it."""

UPRIGHT_SIGMA_RAD = 0.12
"""Standard deviation of a pelvis about upright, radians: of 0.2, 0.12 and 0.07 the best on five development clips.
On 23 of them, against no such term: ROE 37.5 -> 36.4 degrees, MPJPE 124.3 -> 122.9, W 474 -> 471 mm (means)."""

NOISE = NoiseModel(smoothness=0.85, prior_lifted=0.1, rotations=0.4)
"""Smaller accelerations than `hmr` expects: with 1.0 motions have 1.07 of the truth's jitter, with 0.85 0.94 (median of
29 development clips; other errors change by 1 %).

Of lifted people less of the pose prior, which draws rare poses towards common ones, and more of the rotations. In `hmr`
the same has poses nearer by up to 3 %, but cameras at hard cuts worse (docs/measurements/networks.md)."""

SETTINGS = SolverSettings(max_iterations=6, relative_decrease=3e-3, first_damping=1e-6)
"""The start is a fit already: a few steps settle it, on 27 development clips as well as to 1e-3 of the cost. Damping
goes by the diagonal, which planted feet make large: more of it would hold back the slow drift of the whole body that
they are to correct."""


@dataclass(frozen=True, eq=False)
class PlantedFeet:
    """Joints that stand keep their position from frame to frame: (p_(t+1) − p_t) / (σ Δt), robust for each joint."""

    feet: Skeleton
    time_s: Float[Array, " N"]
    contacts: Float[Array, "N 4"]
    """Probabilities; below one half they do not count."""
    speed_ms: float = PLANTED_SPEED_MS
    robust_scale: float = 2.0
    """Speed, in sigmas, beyond which a contact is not believed."""

    @cached_property
    def _span(self) -> Float[Array, " M"]:
        return np.diff(self.time_s)

    @cached_property
    def _weight(self) -> Float[Array, "M 4"]:
        stands = self.contacts * (self.contacts >= STANDS)
        return np.asarray(stands[1:] * stands[:-1] * (self._span * REFERENCE_HZ)[:, None])

    @memoised
    def _feet(self, motion: Motion) -> Motion:
        return motion.with_points(self.feet)

    @memoised
    def _residual(self, feet: Motion) -> Float[Array, "M 4 3"]:
        return np.asarray(np.diff(feet.points, axis=0) / (self.speed_ms * self._span)[:, None, None])

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        loss, _ = cauchy(np.sum(self._residual(self._feet(motion)) ** 2, axis=-1), self.robust_scale)
        return float(np.sum(self._weight * loss))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature: the only term whose blocks between neighbouring frames are full."""
        if len(self.time_s) < 2:
            return
        feet = self._feet(motion)
        residual = self._residual(feet)
        _, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        root = np.sqrt(self._weight * trust)
        scale = np.repeat(root / (self.speed_ms * self._span)[:, None], 3, axis=1)
        right = (root[..., None] * residual).reshape(len(root), -1, 1)
        axes, which = np.tile(np.eye(3), (root.shape[1], 1)), np.repeat(np.arange(root.shape[1]), 3)
        legs = np.flatnonzero(self.feet.moves_point.any(axis=0))  # nothing else moves a foot
        block = legs[:, None], legs
        for steps in chunks(len(root), FRAMES_AT_ONCE):
            if not root[steps].any():
                continue
            first, last = slice(steps.start, steps.stop), slice(steps.start + 1, steps.stop + 1)
            frames = slice(first.start, last.stop)
            J = feet.point_rows(frames, which, np.broadcast_to(axes, (last.stop - first.start, *axes.shape)))[..., legs]
            now, later = (rows * scale[steps, :, None] for rows in (J[:-1], J[1:]))
            now_T, later_T = np.swapaxes(now, -1, -2), np.swapaxes(later, -1, -2)
            equations.own[first, *block] += now_T @ now
            equations.own[last, *block] += later_T @ later
            equations.next_one[first, *block] -= now_T @ later
            equations.gradient[first, legs] -= (now_T @ right[steps])[..., 0]
            equations.gradient[last, legs] += (later_T @ right[steps])[..., 0]


@dataclass(frozen=True, eq=False)
class FeetOnFloor:
    """Joints that stand are as high as a foot on the floor has them: (z − height) / σ, robust for each.

    The picture says where a standing foot meets the floor, and so how far away it is: what a camera above the floor
    sees of a step toward it or away from it.
    """

    feet: Skeleton
    height: Float[Array, " 4"]
    """Of each joint in the world where its foot stands flat on the floor."""
    weight: Float[Array, "N 4"]
    sigma_m: float = FLOOR_SIGMA_M
    robust_scale: float = 2.0
    """Height, in sigmas, beyond which somebody stands on something else."""

    @memoised
    def _residual(self, motion: Motion) -> tuple[Motion, Float[Array, "N 4"]]:
        feet = motion.with_points(self.feet)
        return feet, (feet.points[..., 2] - self.height) / self.sigma_m

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        loss, _ = cauchy(self._residual(motion)[1] ** 2, self.robust_scale)
        return float(np.sum(self.weight * loss))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature."""
        feet, residual = self._residual(motion)
        _, trust = cauchy(residual**2, self.robust_scale)
        root = np.sqrt(self.weight * trust)
        which = np.arange(residual.shape[1])
        for frames in chunks(len(root), FRAMES_AT_ONCE):
            if not root[frames].any():
                continue
            up = np.broadcast_to([0.0, 0.0, 1.0], (*root[frames].shape, 3)) * (root[frames] / self.sigma_m)[..., None]
            rows = feet.point_rows(frames, which, up)
            equations.add_rows(frames, rows, root[frames] * residual[frames])


@dataclass(frozen=True, eq=False)
class Uprightness:
    """Pelves are upright more often than a pose network believes: z × (R_world_root e_y) / σ, robust for each frame.

    On development clips (gravity from the truth) the pitch of the pelvis, as seen, scatters by 7.8° about upright where
    the truth scatters by 6.3°, and is wrong by 8.3°: most of what looks like a lean is an error.
    """

    weight: Float[Array, " N"]
    sigma_rad: float = UPRIGHT_SIGMA_RAD
    robust_scale: float = 1.5

    def _residual(self, motion: Motion) -> tuple[Float[Array, "N 2"], Float[Array, " N"]]:
        up = motion.R_ref_root[:, :, 1]
        return up[:, :2] / self.sigma_rad, np.where(up[:, 2] > 0, self.weight, 0.0)

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        residual, weight = self._residual(motion)
        loss, _ = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        return float(np.sum(weight * loss))

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature."""
        residual, weight = self._residual(motion)
        _, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        root = np.sqrt(weight * trust)
        rows = -(motion.R_ref_root @ skew(np.array([0.0, 1.0, 0.0])))[:, :2] * (root / self.sigma_rad)[:, None, None]
        equations.add_rows(slice(None), rows, root[:, None] * residual, ROOT)


@dataclass(frozen=True, eq=False)
class RootVelocity:
    """The pelvis goes as the networks say: R_rootᵀ ((p_(t+1) − p_t) / Δt − v_t) / σ, robust for each step."""

    R_world_root: Float[Array, "N 3 3"]
    velocity: Float[Array, "N 3"]
    """From each frame to the next, root axes, m/s; the last frame's is unused."""
    sigma: Float[Array, "N 3"]
    time_s: Float[Array, " N"]
    weight: float
    robust_scale: float = 2.0

    @cached_property
    def _span(self) -> Float[Array, " M"]:
        return np.diff(self.time_s)

    @memoised
    def _residual(self, motion: Motion) -> tuple[Float[Array, "M 3"], Float[Array, " M"], Float[Array, " M"]]:
        """Residuals, robust costs and weights."""
        steps = np.diff(motion.pelvis_ref, axis=0) / self._span[:, None]
        own = np.einsum("nji,nj->ni", self.R_world_root[:-1], steps) - self.velocity[:-1]
        residual = own / self.sigma[:-1]
        loss, trust = cauchy(np.sum(residual**2, axis=-1), self.robust_scale)
        weight = self.weight * self._span * REFERENCE_HZ
        return residual, weight * loss, weight * trust

    def cost(self, motion: Motion) -> float:
        """Half the robust sum of squares."""
        return float(np.sum(self._residual(motion)[1])) if len(self.time_s) > 1 else 0.0

    def add(self, motion: Motion, equations: NormalEquations) -> None:
        """Add gradient and curvature."""
        if len(self.time_s) < 2:
            return
        residual, _, trust = self._residual(motion)
        rows = np.swapaxes(self.R_world_root[:-1], -1, -2) / (self.sigma[:-1] * self._span[:, None])[..., None]
        transposed = np.swapaxes(rows, -1, -2) * trust[:, None, None]
        block, gradient = transposed @ rows, (transposed @ residual[..., None])[..., 0]
        equations.own[:-1, PELVIS, PELVIS] += block
        equations.own[1:, PELVIS, PELVIS] += block
        equations.next_one[:-1, PELVIS, PELVIS] -= block
        equations.gradient[:-1, PELVIS] -= gradient
        equations.gradient[1:, PELVIS] += gradient


def gather_clip(
    person: int,
    frame: Array,
    *,
    shots: ShotList,
    scenes: Sequence[ScenePeople | None],
    time_s: Float[Array, " F"],
    K: Float[Array, "F 3 3"],
) -> LongEvidence | None:
    """A person's observations in every shot; None if there are none."""
    sightings = tuple(
        Sighting(scene.track_of(appearance), span, appearance.tracking_failures, K[slice(*span)])
        for shot in shots.shots
        if (scene := scenes[shot.scene]) is not None
        for span in (shot.clear,)
        for appearance in shot.people
        if appearance.person == person
    )
    clip = LongEvidence.of(sightings, frame, time_s)
    return clip if clip.seen.any() else None


def fit_world(
    start: LongMotion,
    betas: Float[Array, " 10"],
    clip: LongEvidence,
    camera: CameraPath,
    contacts: Float[Array, "N 4"],
    standing_height: Float[Array, " 4"],
    *,
    learned: Callable[[slice], Sequence[Term]] = lambda _: (),
    progress: Progress = silent,
) -> LongMotion:
    """The motion in the world that agrees best with all shots' evidence, with the feet that stand, and with the terms
    that the motion networks add (`learned`).

    `standing_height`: of each joint of a foot that stands flat on the floor, metres above z = 0.
    """
    of_evidence = EvidenceTerms(clip, betas, camera, pelvis_depths(start, camera), NOISE)
    feet = Skeleton(start.skeleton.rest_joints, np.array(CONTACT_JOINTS), np.zeros((len(CONTACT_JOINTS), 3)))

    seen_weight = np.where(clip.seen, frame_weights(clip.time_s), 0.0)

    def terms(frames: slice) -> list[Term]:
        planted = PlantedFeet(feet, clip.time_s[frames], contacts[frames])
        standing = contacts[frames] * (contacts[frames] >= STANDS) * seen_weight[frames, None]
        on_floor = FeetOnFloor(feet, standing_height, standing)
        return [*of_evidence(frames), planted, on_floor, Uprightness(seen_weight[frames]), *learned(frames)]

    return solve_windows(start, terms, SETTINGS.lasting(clip.time_s), progress=progress)
