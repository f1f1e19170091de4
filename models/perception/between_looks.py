"""Looking at some frames of a scene and knowing all: people do not need every frame of a video at 60 Hz.

Tracking counts looks, from 0 on; here they become frames again, and what lies between two looks at somebody is
interpolated, unless he jumps: whether he was in the one place or in the other nobody saw.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import Akima1DInterpolator

from humanmm.models.geometry.boxes import box_size
from humanmm.models.records.hands import HandTracks, not_looked
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frame_times import sampled_every, shown_s

Array = np.ndarray

JUMP, TIMES_AROUND = 0.2, 3.0
"""Whose landmarks move (median) by such a fraction of the body's size from one look to the next, and by so many times
as much as in the steps before and after, jumps: a picture is cut there, or a detector errs. No body starts and stops
within three looks like that."""


def looked_at(time_s: Float[Array, " F"], span: tuple[int, int], *, max_rate_hz: float, every: int) -> Int[Array, " L"]:
    """The frames [start, end) of a scene that are looked at, no more than about `max_rate_hz` in a second.

    `time_s` holds the presentation times of all frames of the video. At both ends of the scene, where shots are joined,
    `every` frames are all looked at.
    """
    start, end = span
    is_due = sampled_every(time_s[start:end], 1 / max_rate_hz)
    is_due[:every] = is_due[max(end - start - every, 0) :] = True
    return start + np.flatnonzero(is_due)


def times_of(looks: Int[Array, " L"], end: int, time_s: Float[Array, " F"]) -> Float[Array, " L+1"]:
    """Times of the looks, and of the end of the scene [start, end): for so long the last one counts."""
    last = end - 1
    return np.append(time_s[looks], time_s[last] + shown_s(time_s, np.array([last]))[0])


def in_frames(people: ScenePeople, looks: Int[Array, " L"], span: tuple[int, int], time_s: Array) -> ScenePeople:
    """What was seen in looks 0, 1, … in the frames of the video: those looked at, and those between two successive
    looks at a person."""
    unfollowed = tuple(
        replace(one, first=int(looks[one.first]), last=int(looks[one.last])) for one in people.unfollowed
    )
    tracks = tuple(_in_frames(track, looks, time_s) for track in people.tracks)
    every = span[1] - span[0] == len(looks)
    return ScenePeople(*span, tracks, people.warnings, unfollowed, None if every else looks.astype(np.int32))


def _in_frames(track: PersonTrack, looks: Int[Array, " L"], time_s: Float[Array, " F"]) -> PersonTrack:
    seen = looks[track.frame]
    runs = np.split(np.arange(len(seen)), np.flatnonzero((np.diff(track.frame) > 1) | _jumps(track)) + 1)
    frames = np.concatenate([np.arange(seen[run[0]], seen[run[-1]] + 1) for run in runs])
    colours = {"color_frame": looks[track.color_frame].astype(np.int32)}
    if len(frames) == len(seen):
        return replace(track, frame=seen.astype(np.int32), **colours)
    # of two looks that are equally near the earlier one
    after = np.minimum(np.searchsorted(seen, frames), len(seen) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(time_s[frames] - time_s[seen[before]] <= time_s[seen[after]] - time_s[frames], before, after)
    nearest = np.where(seen[after] == frames, after, nearest)

    def between(values: Array) -> Array:
        runs_of = [
            _interpolated(time_s[seen[run]], values[run], time_s[seen[run[0]] : seen[run[-1]] + 1]) for run in runs
        ]
        return np.concatenate(runs_of).astype(values.dtype)

    rows, side_odds = np.searchsorted(frames, seen), None
    if track.side_odds is not None:
        side_odds = np.zeros(len(frames), np.float32)
        side_odds[rows] = track.side_odds
    keypoints = between(track.keypoints2d)
    keypoints[..., 2] = np.clip(keypoints[..., 2], 0, 1)
    sigma = track.keypoint_sigma
    return replace(
        track,
        frame=frames.astype(np.int32),
        keypoints2d=keypoints,
        keypoint_sigma=None if sigma is None else np.maximum(between(sigma), sigma.min()),
        landmarks3d=between(track.landmarks3d),
        bbox=between(track.bbox),
        confidence=np.clip(between(track.confidence), 0, 1),
        masks=track.masks.chosen(nearest),
        mask_affine=between(track.mask_affine),
        side_odds=side_odds,
        hands=None if track.hands is None else _spread(track.hands, rows, len(frames)),
        **colours,
    )


def _jumps(track: PersonTrack) -> Bool[Array, " N-1"]:
    """Whether somebody jumps between his sightings n and n + 1, in successive looks."""
    moved = np.linalg.norm(np.diff(track.keypoints2d[..., :2].astype(np.float64), axis=0), axis=-1)
    size = box_size(track.bbox.astype(np.float64))
    step = np.median(moved, axis=-1) / np.sqrt(size[1:] * size[:-1])
    step[np.diff(track.frame) > 1] = np.nan  # not known
    before, after = np.append(np.nan, step[:-1]), np.append(step[1:], np.nan)
    around = np.fmax(before, after)
    return np.asarray((step >= JUMP) & (step >= TIMES_AROUND * around))


def _interpolated(known_s: Float[Array, " k"], values: Float[Array, "k ..."], time_s: Float[Array, " n"]) -> Array:
    """Values at any times of the span of the known ones: cubic, without overshooting where something jumps."""
    if len(known_s) < 3:
        share = (time_s - known_s[0]) / max(known_s[-1] - known_s[0], 1e-9)
        return np.asarray(values[0] + share.reshape(-1, *[1] * (values.ndim - 1)) * (values[-1] - values[0]))
    return np.asarray(Akima1DInterpolator(known_s, values.astype(np.float64), method="makima")(time_s))


def _spread(hands: HandTracks, rows: Int[Array, " n"], count: int) -> HandTracks:
    """The hands of a track in those rows of a longer one."""
    spread = not_looked(count)
    for name, values in vars(hands).items():
        getattr(spread, name)[rows] = values
    return spread
