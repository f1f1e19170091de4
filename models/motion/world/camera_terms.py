"""What is known of the shots' cameras, as equations: verticals, rotations, scales of paths, cameras that return."""

from collections.abc import Sequence

import numpy as np

from humanmm.models.geometry.robust import cauchy_weight
from humanmm.models.geometry.rotations import rotmat_to_rotvec, skew, swing
from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, SCALE, WorldEquations
from humanmm.models.motion.world.problem import CameraEdge, SameCamera, ShotRig
from humanmm.models.motion.world.scale import LogScale
from humanmm.models.motion.world.state import SolveSettings, WorldState

UP = np.array([0.0, 0.0, 1.0])
SAME_CAMERA_M = 0.02
"""Standard deviation of where a static camera stands when it is shown again, each axis."""


def add_levels(
    equations: WorldEquations,
    rigs: Sequence[ShotRig],
    edges: Sequence[CameraEdge],
    state: WorldState,
    settings: SolveSettings,
) -> None:
    """Every shot is about as level as its own evidence has it, and heads where it did; neighbouring shots are rotated
    against each other as their edge says."""
    of_rotation, rotated = np.eye(CAMERA_UNKNOWNS)[3:6], rotmat_to_rotvec(state.rotation)
    for shot, rig in enumerate(rigs):
        tilt_deg = min(rig.level_deg, settings.level_deg)
        w_axes = 1 / np.deg2rad([tilt_deg, tilt_deg, settings.level_deg / settings.heading_trust])
        tilt = rotmat_to_rotvec(swing(UP, state.rotation[shot] @ rig.up))
        off = np.array([tilt[0], tilt[1], rotated[shot, 2]])
        equations.add_shared(w_axes * off, (equations.camera(shot), w_axes[:, None] * of_rotation))
    for edge in edges:
        w_axes = np.array([1.0, 1.0, settings.heading_trust]) / np.deg2rad(edge.sigma_deg)
        difference, by_b = rotated[edge.b] - rotated[edge.a], w_axes[:, None] * of_rotation
        equations.add_shared(w_axes * difference, (equations.camera(edge.b), by_b), (equations.camera(edge.a), -by_b))


def add_scales(
    equations: WorldEquations, floors: Sequence[LogScale | None], state: WorldState, settings: SolveSettings
) -> None:
    """The scale of a camera's path is about what the floor says."""
    of_scale = np.eye(CAMERA_UNKNOWNS)[SCALE:]
    for shot, floor in enumerate(floors):
        if floor is None:
            continue
        off = (np.log(state.scale[shot]) - floor.mean) / floor.sigma
        w = np.sqrt(cauchy_weight(np.square(off / settings.floor_scale_reach)))
        by_scale = w / (floor.sigma * state.scale[shot]) * of_scale
        equations.add_shared(np.array([w * off]), (equations.camera(shot), by_scale))


def add_same_cameras(
    equations: WorldEquations, rigs: Sequence[ShotRig], same: Sequence[SameCamera], state: WorldState
) -> None:
    """A static camera that returns is where it was."""
    w = 1 / SAME_CAMERA_M
    for pair in same:
        difference, blocks = np.zeros(3), []
        for shot, frame, sign in ((pair.shot_a, pair.frame_a, 1.0), (pair.shot_b, pair.frame_b, -1.0)):
            arm = state.scale[shot] * rigs[shot].path[frame - rigs[shot].start] @ state.rotation[shot].T
            difference = difference + sign * (state.origin[shot] + arm)
            by_camera = np.concatenate([np.eye(3), -skew(arm), np.zeros((3, 1))], axis=1)
            blocks.append((equations.camera(shot), sign * w * by_camera))
        equations.add_shared(w * difference, *blocks)
