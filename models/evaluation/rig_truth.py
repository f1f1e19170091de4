"""The truth of videos that calibrated cameras took at the same time: who is who in them, and where their joints are.

Each camera's people were found by a pose network in its video alone. Two tracks are one person's where their joints'
rays meet; a joint is where at least three cameras agree on it. Such a truth has the network's own idea of where a joint
is in a body, but not its depths: these come from the cameras.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float, Int
from scipy.signal import butter, sosfiltfilt

from humanmm.models.geometry.triangulation import triangulated
from humanmm.models.records.landmarks import LIMBS, NAMES

Array = np.ndarray

JOINT_NAMES = tuple(NAMES[joint] for joint in LIMBS)
CAMERAS = 3
"""So many cameras must agree on a joint: two may agree by chance."""
AGREES = 0.05
"""How far from a joint a camera's picture of it may lie, of the person's height in that picture."""
_COMMON_S = 0.3
"""Two tracks of one person are seen together for so long."""
_GAP_S = 0.2
_CUTOFF_HZ, _ORDER = 6.0, 4
"""Of the Butterworth filter that biomechanics uses on gait (Winter 2009, section 2.2)."""


@dataclass(frozen=True)
class RigTrack:
    """What one camera sees of one person, in ideal pictures (undistorted, at unit focal length)."""

    camera: int
    frame: Int[Array, "N"]
    xy: Float[Array, "N 12 2"]
    visibility: Float[Array, "N 12"]
    height: Float[Array, "N"]
    """Of the person, in the same units."""


@dataclass(frozen=True)
class RigPerson:
    """One person of F frames."""

    joints: Float[Array, "F 12 3"]
    """`JOINT_NAMES`; NaN where too few cameras agree."""
    spread: float
    """How far the cameras' pictures lie from the joints: the median, of the person's height."""
    cameras: tuple[int, ...]
    """Who sees him."""


def people_of(
    tracks: Sequence[RigTrack],
    R_world_cam: Float[Array, "C 3 3"],
    t_world_cam: Float[Array, "C 3"],
    num_frames: int,
    fps: float,
) -> list[RigPerson]:
    """Everybody whom at least three cameras see, the best seen first."""
    rig = R_world_cam, t_world_cam
    groups = [[track] for track in tracks]
    for _, one, other in sorted(_pairs(tracks, *rig, least=round(_COMMON_S * fps)), key=lambda pair: pair[0]):
        first, second = (next(group for group in groups if any(track is k for k in group)) for track in (one, other))
        if first is second or not _may_be_one(first, second):
            continue
        both = first + second
        if _spread(both, *rig, num_frames, least=2)[1] < AGREES:
            groups = [group for group in groups if group is not first and group is not second] + [both]
    people = []
    for group in groups:
        cameras = tuple(sorted({track.camera for track in group}))
        if len(cameras) >= CAMERAS:
            joints, spread = _spread(group, *rig, num_frames, least=CAMERAS)
            people.append(RigPerson(smooth(joints, fps), spread, cameras))
    return sorted(people, key=lambda person: -np.isfinite(person.joints).sum())


def smooth(joints: Float[Array, "F J 3"], fps: float) -> Float[Array, "F J 3"]:
    """Short holes filled, and tremor taken out; longer holes stay."""
    sos = butter(_ORDER, min(_CUTOFF_HZ, 0.45 * fps), fs=fps, output="sos")
    frame, filled = np.arange(len(joints)), np.full_like(joints, np.nan)
    for joint in range(joints.shape[1]):
        known = np.flatnonzero(np.isfinite(joints[:, joint]).all(axis=-1))
        for run in np.split(known, np.flatnonzero(np.diff(known) > _GAP_S * fps) + 1):
            if len(run) < 2:
                continue
            inside = frame[run[0] : run[-1] + 1]
            path = np.stack([np.interp(inside, run, joints[run, joint, axis]) for axis in range(3)], axis=-1)
            filled[inside, joint] = sosfiltfilt(sos, path, axis=0, padlen=min(3 * _ORDER, len(path) - 1))
    return filled


def _pairs(
    tracks: Sequence[RigTrack], R_world_cam: Array, t_world_cam: Array, *, least: int
) -> list[tuple[float, RigTrack, RigTrack]]:
    """Tracks of two cameras whose rays meet, and how far from their pictures; of the person's height."""
    found = []
    for one, other in combinations(tracks, 2):
        if one.camera == other.camera or len(np.intersect1d(one.frame, other.frame)) < max(least, 1):
            continue
        last = int(max(one.frame[-1], other.frame[-1])) + 1
        _, spread = _spread([one, other], R_world_cam, t_world_cam, last, least=2)
        if spread < AGREES:
            found.append((spread, one, other))
    return found


def _may_be_one(first: Sequence[RigTrack], second: Sequence[RigTrack]) -> bool:
    """False where a camera sees both at once."""
    return not any(
        one.camera == other.camera and len(np.intersect1d(one.frame, other.frame)) for one in first for other in second
    )


def _spread(
    group: Sequence[RigTrack], R_world_cam: Array, t_world_cam: Array, num_frames: int, *, least: int
) -> tuple[Float[Array, "F 12 3"], float]:
    """Joints of one person, and how far the cameras' pictures lie from them: the median, of his height in each."""
    cameras = sorted({track.camera for track in group})
    shape = (len(cameras), num_frames, len(LIMBS))
    xy, weight, height = np.full((*shape, 2), np.nan), np.zeros(shape), np.full(shape[:2], np.nan)
    for track in group:
        row = cameras.index(track.camera)
        xy[row, track.frame], weight[row, track.frame] = track.xy, np.maximum(track.visibility, 1e-3)
        height[row, track.frame] = track.height
    shared = np.isfinite(height).sum(axis=0) >= 2
    limit = AGREES * np.nan_to_num(height, nan=1.0)[..., None]
    joints, error = triangulated(xy, weight, R_world_cam[cameras], t_world_cam[cameras], limit, least=least)
    # rays that do not meet count as far apart: a chance meeting of a few joints is no agreement
    apart = np.where(np.isfinite(joints).all(axis=-1), error, np.where(weight > 0, np.inf, np.nan)) / height[..., None]
    seen = np.isfinite(height)[..., None] & shared[None, :, None] & (weight > 0)
    return joints, float(np.median(apart[seen])) if seen.any() else np.inf
