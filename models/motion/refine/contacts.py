"""When a foot stands: from its speed and its height above whatever carried the body a moment ago.

Four joints: left ankle, left toe base, right ankle, right toe base. Speeds are taken over a fixed time, not over
frames, and the part along the viewing ray, where a single camera is nearly blind, counts less. Heights are compared
with the lowest sole within half a second instead of with the floor alone: somebody on a wall or a stair stands as
well, and in a jump both feet are above the ground that they left.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.video.frame_times import ROUNDING_S

Array = np.ndarray
STANDS = 0.5
"""Probability from which a joint stands: hysteresis and shortest duration leave it above this where a contact holds."""


@dataclass(frozen=True)
class ContactModel:
    """Where a standing foot becomes a moving one."""

    speed_ms: float = 0.45
    """Speed at which both are equally likely, m/s. With 0.6 feet are held for too long; with 0.35 those of hard clips
    are held too seldom, and slide (docs/measurements/world.md)."""
    speed_softness_ms: float = 0.07
    height_m: float = 0.14
    """The same for the height of the sole above the support, metres."""
    height_softness_m: float = 0.03
    baseline_s: float = 0.08
    """Time over which speeds are taken."""
    support_window_s: float = 0.5
    """How far back and forth the support is looked for."""
    along_ray: float = 0.4
    """Weight of the part of the velocity along the viewing ray."""
    begin: float = 0.6
    """A contact begins only where the probability reaches this, and lasts while it is above one half."""
    shortest_s: float = 0.1
    """Shorter contacts, and shorter interruptions of one, are noise."""
    longest_gap_s: float = 1.0
    """A foot that stands at one place before and after a shorter time without anybody seen stood there meanwhile."""
    same_place_m: float = 0.25
    """So far apart one place may be on both sides: the poses of two shots differ, and a step is longer. Of 51 joints
    that stand on both sides of a dissolve or fade this near, 48 have moved by less than 0.1 m, of nine others six."""


def contact_probabilities(
    feet: Float[Array, "N 4 3"],
    sole_height: Float[Array, " 4"],
    *,
    time_s: Float[Array, " N"],
    ray: Float[Array, "N 3"],
    observed: Bool[Array, " N"],
    model: ContactModel | None = None,
) -> Float[Array, "N 4"]:
    """Probability that each joint of `feet` (world, metres) stands still on something.

    `sole_height`: height of each joint above the ground when the foot is flat on it. `ray`: unit viewing ray. Above one
    half exactly in the intervals that hysteresis and shortest duration leave. Where nobody was seen 0, but for feet
    that stood before and after at one place.
    """
    model = model or ContactModel()
    velocity = velocities(feet, time_s, model.baseline_s)
    along = np.sum(velocity * ray[:, None], axis=-1, keepdims=True) * ray[:, None]
    speed = np.linalg.norm(velocity - (1 - model.along_ray) * along, axis=-1)
    height = feet[..., 2] - sole_height
    clear = height - support_height(height.min(axis=1), time_s, model.support_window_s)[:, None]
    probability = _logistic((model.speed_ms - speed) / model.speed_softness_ms)
    probability *= _logistic((model.height_m - clear) / model.height_softness_m)
    probability[~observed] = 0.0
    settled = np.stack([_settled(p, time_s, model) for p in probability.T], axis=1)
    for start, end in runs_of_true(~observed):
        inside = start > 0 and end < len(observed)
        if inside and time_s[end] - time_s[start - 1] < model.longest_gap_s:
            settled[start:end] = _through_gap(settled[[start - 1, end]], feet[[start - 1, end]], model)
    return settled


def velocities(points: Float[Array, "N K 3"], time_s: Float[Array, " N"], baseline_s: float) -> Float[Array, "N K 3"]:
    """Central differences over about `baseline_s` (one frame to either side at least), metres per second."""
    if len(time_s) < 2:
        return np.zeros_like(points)
    earlier, later = _frames_about(time_s, baseline_s / 2)
    return np.asarray((points[later] - points[earlier]) / (time_s[later] - time_s[earlier])[:, None, None])


def support_height(lowest: Float[Array, " N"], time_s: Float[Array, " N"], window_s: float) -> Float[Array, " N"]:
    """Height of the lowest sole within the window around each frame (one frame to either side at least)."""
    if len(time_s) < 2:
        return lowest
    first, last = _frames_about(time_s, window_s)
    bounds = np.stack([first, last + 1], axis=1).ravel()
    return np.asarray(np.minimum.reduceat(np.append(lowest, np.inf), bounds)[::2])


def _frames_about(time_s: Float[Array, " N"], reach_s: float) -> tuple[Int[Array, " N"], Int[Array, " N"]]:
    """First and last frame that lie within `reach_s` of each, to half a frame; its neighbours at least."""
    frame = np.arange(len(time_s))
    margin_s = reach_s + 0.5 * float(np.median(np.diff(time_s))) - ROUNDING_S
    first = np.searchsorted(time_s, time_s - margin_s)
    last = np.searchsorted(time_s, time_s + margin_s, side="right") - 1
    return np.minimum(first, np.maximum(frame - 1, 0)), np.maximum(last, np.minimum(frame + 1, len(frame) - 1))


def _through_gap(
    probability: Float[Array, "2 4"], feet: Float[Array, "2 4 3"], model: ContactModel
) -> Float[Array, " 4"]:
    """The probability of each contact in a gap, by those right before and right after it."""
    least = probability.min(axis=0)
    stood = (least >= STANDS) & (np.linalg.norm(feet[1] - feet[0], axis=-1) < model.same_place_m)
    return np.where(stood, least, 0.0)


def _settled(probability: Float[Array, " N"], time_s: Float[Array, " N"], model: ContactModel) -> Float[Array, " N"]:
    """The probability, moved to the other side of one half where hysteresis or the shortest duration say so."""
    holds = probability >= STANDS
    duration = np.gradient(time_s) if len(time_s) > 1 else np.zeros(len(time_s))
    shortest_contact_s, shortest_gap_s = model.shortest_s - ROUNDING_S, model.shortest_s / 2 - ROUNDING_S
    for start, end in runs_of_true(~holds):  # short interruptions of a contact
        inside = start > 0 and end < len(holds)
        if inside and duration[start:end].sum() < shortest_gap_s and probability[start:end].max() > 0.1:
            holds[start:end] = True
    for start, end in runs_of_true(holds):
        if duration[start:end].sum() < shortest_contact_s or probability[start:end].max() < model.begin:
            holds[start:end] = False
    return np.asarray(np.where(holds, np.maximum(probability, 0.501), np.minimum(probability, 0.499)))


def _logistic(x: Array) -> Array:
    return np.asarray(1 / (1 + np.exp(-np.clip(x, -60, 60))))
