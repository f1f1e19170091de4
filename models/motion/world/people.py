"""One person's shots, aligned in the world, as one motion without holes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.motion import PersonMotion, PersonShotMotion

Array = np.ndarray


@dataclass(frozen=True)
class Part:
    """One person in one shot, in the world."""

    motion: PersonShotMotion
    R_world_root: Float[Array, "n 3 3"]
    pelvis_world: Float[Array, "n 3"]
    contacts: Float[Array, "n 4"]


def concatenated(person: int, parts: Sequence[Part]) -> PersonMotion:
    """One person's shots as one motion without holes; what lies between is interpolated and not observed."""
    parts = sorted(parts, key=lambda part: int(part.motion.frame[0]))
    known = np.concatenate([part.motion.frame for part in parts])
    frame = np.arange(known[0], known[-1] + 1, dtype=np.int32)
    row, fraction = rows_before(known, frame)
    R = np.concatenate([part.R_world_root for part in parts])
    pose = np.concatenate([part.motion.body_pose for part in parts])
    pelvis = np.concatenate([part.pelvis_world for part in parts])
    exact = fraction == 0
    observed = np.concatenate([part.motion.observed for part in parts])[row] & exact
    contacts = np.concatenate([part.contacts for part in parts])[row] * exact[:, None]
    confidence = np.concatenate([part.motion.confidence for part in parts])[row] * exact
    return PersonMotion(
        person=person,
        frame=frame,
        observed=observed,
        R_world_root=interpolate_rotmats(R, row, fraction),
        body_pose=interpolate_pose(pose, row, fraction),
        betas=parts[0].motion.betas,
        pelvis_world=pelvis[row] + fraction[:, None] * (pelvis[np.minimum(row + 1, len(pelvis) - 1)] - pelvis[row]),
        contacts=contacts.astype(np.float32),
        confidence=confidence.astype(np.float32),
    )


def rows_before(known: Int[Array, "m"], frame: Int[Array, "n"]) -> tuple[Int[Array, "n"], Float[Array, "n"]]:
    """For each frame the last known row at or before it, and how far it lies towards the next one (0..1)."""
    row = np.searchsorted(known, frame, side="right") - 1
    following = np.minimum(row + 1, len(known) - 1)
    span = np.maximum(known[following] - known[row], 1)
    return row, np.where(following > row, (frame - known[row]) / span, 0.0)


def interpolate_pose(
    pose: Float[Array, "m 23 3"], row: Int[Array, "n"], fraction: Float[Array, "n"]
) -> Float[Array, "n 23 3"]:
    """Rotation vectors, interpolated as rotations where the fraction is not 0."""
    out, open_ = pose[row], np.flatnonzero(fraction > 0)
    if len(open_):
        rows_before = row[open_][:, None] + np.array([0, 1])
        ends = rotvec_to_rotmat(pose[np.minimum(rows_before, len(pose) - 1)].reshape(-1, *pose.shape[1:]))
        out[open_] = rotmat_to_rotvec(interpolate_rotmats(ends, 2 * np.arange(len(open_)), fraction[open_]))
    return np.asarray(out)


def interpolate_rotmats(
    R: Float[Array, "m *j 3 3"], row: Int[Array, "n"], fraction: Float[Array, "n"]
) -> Float[Array, "n *j 3 3"]:
    """Rotations interpolated along the shortest arc; exact where the fraction is 0."""
    out = R[row]
    open_ = np.flatnonzero(fraction > 0)
    if len(open_):
        first, second = R[row[open_]], R[np.minimum(row[open_] + 1, len(R) - 1)]
        rotvec = rotmat_to_rotvec(np.swapaxes(first, -1, -2) @ second)
        part = fraction[open_].reshape(-1, *([1] * (rotvec.ndim - 1)))
        out[open_] = first @ rotvec_to_rotmat(part * rotvec)
    return np.asarray(out)
