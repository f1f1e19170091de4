"""Feet that stand: which do, that they keep their position, and that those that bear the body are on the floor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from humanmm.models.geometry.rotations import skew, unit
from humanmm.models.motion.world.equations import SHARED_UNKNOWNS, SIZE, WorldEquations
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import LOWEST_PERCENT
from humanmm.models.motion.world.state import DENSE_S, SolveSettings, WorldState

Array = np.ndarray

COMING_S = 0.15
"""Standard deviation of the Gaussian over which the speed along the line of sight is a mean."""
FEWEST_STANDING = 3
"""Fewer frames with a foot that stands do not say where the floor of a shot is: then the lowest points of all its
frames do."""


def add_feet(
    equations: WorldEquations,
    trajectory: ShotTrajectory,
    rig: ShotRig,
    state: WorldState,
    index: int,
    settings: SolveSettings,
    *,
    floor: bool,
) -> None:
    """Planted feet keep their position, those that bear the body are on the floor, none is below it."""
    if len(trajectory.frame) < 2:
        return
    rotated = trajectory.feet @ state.rotation[trajectory.shot].T
    pair = rotated + state.pelvis[index][:, None]
    still, on_floor, whiten = hold(trajectory, rig, state, index, settings)
    correlated = np.sqrt(max(1.0, settings.correlation_s / trajectory.step_s))
    step = np.diff(trajectory.time_s)[:, None]
    weight = np.sqrt(still) / step / np.sqrt(correlated)
    # Squared it goes by the root of time so far; over dense frames, whose sum is an integral, it goes by time.
    weight *= min(1.0, trajectory.step_s / DENSE_S) ** 0.25
    moved = np.diff(pair, axis=0)
    by_shared = np.zeros((*moved.shape, SHARED_UNKNOWNS))
    # The line of sight turns with the shot as the legs do: seen from it, all that turns is how the pelvis went.
    by_shared[..., 3:6] = skew(np.diff(state.pelvis[index], axis=0))[:, None]
    by_shared[..., SIZE] = np.diff(rotated, axis=0)  # who is larger has longer legs
    equations.add_moves(index, weight[..., None, None] * whiten[:, None], moved, by_shared)
    if not floor:
        return
    below = pair[..., 2] < 0
    bearing = np.sqrt(np.where(below, np.maximum(on_floor, 0.5), on_floor)) / settings.floor_m / correlated
    by_position, by_shared = np.zeros((*bearing.shape, 3)), np.zeros((*bearing.shape, SHARED_UNKNOWNS))
    by_position[..., 2] = bearing
    by_shared[..., 3:6] = bearing[..., None] * -skew(rotated)[..., 2, :]
    by_shared[..., SIZE] = bearing * rotated[..., 2]
    equations.add_positions(index, bearing * pair[..., 2], by_position, by_shared)


def hold(
    trajectory: ShotTrajectory, rig: ShotRig, state: WorldState, index: int, settings: SolveSettings
) -> tuple[Float[Array, "n-1 4"], Float[Array, "n 4"], Float[Array, "n-1 3 3"]]:
    """How surely each sole point stands still between frames, how surely it stands on the floor in each frame, and
    what whitens the velocity of one that stands still."""
    feet = trajectory.feet @ state.rotation[trajectory.shot].T + state.pelvis[index][:, None]
    step = np.diff(trajectory.time_s)[:, None]
    sight = unit(trajectory.offset[:-1] @ state.rotation[trajectory.shot].T)
    coming = _coming_ms(trajectory, rig, float(state.scale[trajectory.shot]))
    along_ms = np.hypot(settings.still_along_ms, settings.swing_fraction * coming)[:, None, None]
    along = sight[:, :, None] @ sight[:, None]
    whiten = (np.eye(3) - along) / settings.still_ms + along / along_ms
    speed = np.linalg.norm(np.einsum("nab,nkb->nka", whiten, np.diff(feet, axis=0)), axis=-1) / step
    # Over a hole in the track nothing is held.
    still = 1 / (1 + (speed / settings.moving) ** 2) ** 2 * (step < trajectory.hole_s)
    in_frame = np.zeros((len(feet), 4))
    if len(feet) > 1:
        in_frame[:-1] = still
        in_frame[1:] = np.maximum(in_frame[1:], still)
    on_floor = in_frame / (1 + (feet[..., 2] / settings.floor_m) ** 2) ** 2
    return still, on_floor, whiten


def _coming_ms(trajectory: ShotTrajectory, rig: ShotRig, scale: float) -> Float[Array, "n-1"]:
    """Speed along the line of sight at which the pictures show somebody come or go, m/s; fitted distances tremble, so
    that it is a mean over some frames."""
    seen = scale * rig.path[trajectory.frame - rig.start] + trajectory.offset
    velocity = np.diff(seen, axis=0) / np.diff(trajectory.time_s)[:, None]
    frames = COMING_S / trajectory.step_s
    return np.asarray(
        np.abs(np.sum(gaussian_filter1d(velocity, frames, axis=0) * unit(trajectory.offset[:-1]), axis=-1))
    )


def put_on_floor(
    trajectories: Sequence[ShotTrajectory], rigs: Sequence[ShotRig], state: WorldState, settings: SolveSettings
) -> WorldState:
    """Every shot raised or lowered so that its lowest standing feet are at z = 0."""
    shift = np.zeros(len(state.origin))
    for shot in range(len(shift)):
        heights, weights = [], []
        for k, trajectory in enumerate(trajectories):
            if trajectory.shot == shot:
                feet = trajectory.feet @ state.rotation[shot].T + state.pelvis[k][:, None]
                lowest = feet[..., 2].min(axis=1)
                still = hold(trajectory, rigs[trajectory.shot], state, k, settings)[0].max(axis=1, initial=0.0)
                heights.append(lowest)
                weights.append(np.concatenate([still, still[-1:]]) if len(still) else np.ones(1))
        if heights:
            height, weight = np.concatenate(heights), np.concatenate(weights)
            grounded = height[weight > 0.5] if (weight > 0.5).sum() >= FEWEST_STANDING else height
            shift[shot] = np.percentile(grounded, LOWEST_PERCENT)
    drop = shift[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(
        state,
        pelvis=[p - drop[trajectory.shot] for trajectory, p in zip(trajectories, state.pelvis, strict=True)],
        origin=state.origin - drop,
    )
