"""Levels the shots of one group: gravity from the evidence of all (`gravity`), heading from the first camera."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.rotations.gravity import (
    PAN_SIGMA_DEG,
    ROLL_SIGMA_DEG,
    UprightEvidence,
    mean_axis,
    pan_axis,
    standing_axis,
    up_direction,
)
from humanmm.models.motion.rotations.rotation_mixtures import Upright
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, posed, witnesses_of
from humanmm.models.motion.rotations.shot_rotations import ShotRotations
from humanmm.models.records.camera import ShotCamera

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class UpDirection:
    """A direction that should be up, shot axes."""

    axis: Float[Array, "3"]
    sigma_deg: float
    """Standard deviation."""


@dataclass(frozen=True)
class ShotVertical:
    """Where up is in one shot: all that says so, and what it says together."""

    directions: tuple[UpDirection, ...]
    upright: Upright


PICTURE_SIGMA_DEG = 25.0
"""The picture's own vertical is weak evidence of the vertical."""
SHOT_SIGMA_DEG = 6.0
"""Error of a shot's own vertical besides that of its people: two shots see them from two sides."""
MOST_ROLL_DEG, MOST_UP_DEG, MOST_DOWN_DEG = 25.0, 25.0, 80.0
"""Whose long axis would have the camera rolled farther, or look farther up or down, lies, stands on his hands or is
fitted wrongly: he says nothing of where up is. Of 577 right axes in rendered places (kicks, spins, floor work,
acrobatics; drones that look down by 70 degrees) this leaves 576, of 39 that are wrong by more than 30 degrees 11."""
TILT_SIGMA_DEG = 3.0
"""Error of the vertical that another shot of one world gives, about a level axis."""
OVERRULED_SIGMAS = 3.0
"""Walls whose vertical lies further than this from what all evidence says are overruled."""


def levelled(
    results: ShotResults,
    group: Sequence[int],
    R_first_shot: Sequence[Float[Array, "3 3"]],
    verticals: Mapping[int, ShotVertical],
) -> list[Float[Array, "3 3"]]:
    """Each shot's axes to world axes: gravity from the evidence of all shots, +y where the first camera looks.

    `verticals`: of every shot of the group.
    """
    up, up_sigma, level, level_sigma = [], [], [], []
    for shot, R in zip(group, R_first_shot, strict=True):
        camera = camera_of(results, shot)
        for one in verticals[shot].directions:
            up.append(R @ one.axis)
            up_sigma.append(one.sigma_deg)
        level.append(R @ _mean_x(camera))
        level_sigma.append(ROLL_SIGMA_DEG)
        turned_about = pan_axis(camera.R_shot_cam)
        if turned_about is not None:
            # The axis is vertical: any direction across it is level.
            for across in np.linalg.svd(turned_about[None])[2][1:]:
                level.append(R @ across)
                level_sigma.append(2 * PAN_SIGMA_DEG)
    z = up_direction(UprightEvidence(np.array(up), np.array(up_sigma), np.array(level), np.array(level_sigma)))
    first = camera_of(results, group[0])
    y = _heading(first.R_shot_cam[0], z)
    R_world_first = np.stack([np.cross(y, z), y, z])
    return [R_world_first @ R for R in R_first_shot]


def vertical_of(camera: ShotCamera, standing: Sequence[UpDirection], walls: UpDirection | None = None) -> ShotVertical:
    """Where up is in a shot's own axes, from its camera, its people's standing axes and its walls alone."""
    # The picture's own vertical: hardly informed, but never upside down.
    picture = UpDirection(camera.R_shot_cam[0] @ np.array([0.0, -1.0, 0.0]), PICTURE_SIGMA_DEG)
    directions = (*standing, picture, *([walls] if walls is not None else []))
    up = up_direction(
        UprightEvidence(
            up=np.array([one.axis for one in directions]),
            up_sigma_deg=np.array([one.sigma_deg for one in directions]),
            level=_mean_x(camera)[None],
            level_sigma_deg=np.array([ROLL_SIGMA_DEG]),
        )
    )
    sigma_deg = float(np.hypot(min(one.sigma_deg for one in (*standing, picture)), SHOT_SIGMA_DEG))
    if walls is not None and np.degrees(np.arccos(min(1.0, up @ walls.axis))) < OVERRULED_SIGMAS * walls.sigma_deg:
        sigma_deg = min(sigma_deg, walls.sigma_deg)
    return ShotVertical(directions, Upright(up, sigma_deg))


def upright_together(
    results: ShotResults, rotations: ShotRotations, verticals: Mapping[int, ShotVertical]
) -> dict[int, Upright]:
    """Where up is in the shots of one world, from what all of them say; nothing of a shot that shares none."""
    found = {}
    for first in sorted(set(rotations.group)):
        group = [shot for shot in verticals if rotations.group[shot] == first]
        if len(group) < 2:
            continue
        R_group_shot = rotations.R_group_shot[group]
        best_deg = min(verticals[shot].upright.sigma_deg for shot in group)
        R_world_shot = levelled(results, group, list(R_group_shot[0].T @ R_group_shot), verticals)
        for shot, R in zip(group, R_world_shot, strict=True):
            sigma_deg = min(verticals[shot].upright.sigma_deg, float(np.hypot(best_deg, TILT_SIGMA_DEG)))
            found[shot] = Upright(R[2], sigma_deg)
    return found


def level_axes(up: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Axes with z up, as columns; where the level ones point is arbitrary."""
    across = unit(np.cross(up, np.eye(3)[np.argmin(np.abs(up))]))
    return np.stack([across, np.cross(up, across), up], axis=-1)


def _heading(R_cam: Float[Array, "3 3"], z: Float[Array, "3"]) -> Float[Array, "3"]:
    """Horizontal direction in which a camera looks; where it looks straight down, the top of its picture."""
    ahead = R_cam[:, 2] - z * (z @ R_cam[:, 2])
    if np.linalg.norm(ahead) < 0.05:
        ahead = -R_cam[:, 1] + z * (z @ R_cam[:, 1])
    return np.asarray(ahead / np.linalg.norm(ahead))


def _mean_x(camera: ShotCamera) -> Float[Array, "3"]:
    """Mean x axis of a shot's camera, shot axes."""
    x = camera.R_shot_cam[..., 0].mean(axis=0)
    return np.asarray(x / max(float(np.linalg.norm(x)), 1e-9))


def standing_axes(results: ShotResults, shot: int) -> list[UpDirection]:
    """Mean standing axis of each person of a shot whose axis can be vertical in some of it."""
    camera = camera_of(results, shot)
    found = []
    for motion in witnesses_of(results, shot).values():
        seen = motion.observed
        if not seen.any():
            continue
        R_shot_cam = camera.R_shot_cam[motion.frame - camera.start]
        joints, _ = posed(motion, R_shot_cam)
        axis, weight = standing_axis(joints[seen])
        weight = weight * _is_plausible(axis, R_shot_cam[seen])
        if weight.any():
            found.append(UpDirection(*mean_axis(axis, weight)))
    return found


def _is_plausible(axis: Float[Array, "frames 3"], R_shot_cam: Float[Array, "frames 3 3"]) -> Bool[Array, " frames"]:
    """Whether cameras are held so that this axis, shot axes, is vertical."""
    right, down, ahead = np.einsum("fab,fa->bf", R_shot_cam, axis)
    roll, pitch = np.degrees(np.arcsin(np.clip(right, -1, 1))), np.degrees(np.arctan2(ahead, -down))
    return np.asarray((np.abs(roll) < MOST_ROLL_DEG) & (pitch < MOST_UP_DEG) & (pitch > -MOST_DOWN_DEG))
