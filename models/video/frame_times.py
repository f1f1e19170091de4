"""Frames and seconds: how long frames are shown, which frame a moment belongs to, which frames sample a video evenly.

Frame rates may vary (phones, screen recordings), so that nothing counts frames where seconds are meant: everything is
read from the presentation times `time_s` of a video's frames, strictly increasing.
"""

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.errors import VideoError

Array = np.ndarray

ROUNDING_S = 1e-6
"""Presentation times are multiples of a time base that carry a rounding error far below this."""


LONG_GAP_S, MAX_GAP_S, MAX_RATE_HZ = 5.0, 3600.0, 2000.0
STEADY, STEADY_SHARE = 1.5, 0.9
"""A video is of steady rate if this share of its pictures is shown for at most so many times the median."""
_GAP_S, _GAP_PICTURES = 1.0, 10
_RESTAMP = (
    "and motion needs true times: write new ones, for instance with `ffmpeg -i FILE -vf setpts=N/25/TB -an NEW.mp4`"
)


def check_times(time_s: Float[Array, " F"], *, num_pictures: int) -> None:
    """Raise VideoError where the times that are left of `num_pictures` cannot be true."""
    if len(time_s) < 2:
        raise VideoError(f"all {num_pictures} pictures of the video have the same time stamp, {_RESTAMP}")
    if np.median(np.diff(time_s)) * MAX_RATE_HZ < 1:
        total_s = float(time_s[-1] - time_s[0])
        raise VideoError(f"{len(time_s)} pictures in {total_s:.6f} s: the time stamps are wrong, {_RESTAMP}")
    before, gap_s = longest_gap_s(time_s)
    if gap_s > MAX_GAP_S:
        raise VideoError(f"after {before:.2f} s no picture comes for {gap_s:.0f} s: a time stamp is wrong, {_RESTAMP}")


def longest_gap_s(time_s: Float[Array, " F"]) -> tuple[float, float]:
    """The time before the longest gap between two frames, and its length, seconds."""
    gaps_s = np.diff(time_s)
    longest = int(np.argmax(gaps_s))
    return float(time_s[longest]), float(gaps_s[longest])


def long_gap_s(time_s: Float[Array, " F"]) -> float:
    """A longer gap between two frames is out of the ordinary, seconds: LONG_GAP_S, less in a video of steady rate.

    Where the rate varies, as in the film of a screen, a picture that stays is ordinary.
    """
    steps_s = np.diff(time_s)
    usual_s = float(np.median(steps_s))
    if np.quantile(steps_s, STEADY_SHARE) > STEADY * usual_s:
        return LONG_GAP_S
    return min(LONG_GAP_S, max(_GAP_S, _GAP_PICTURES * usual_s))


def elapsed_s(time_s: Float[Array, " F"], first: int, last: int) -> float:
    """Seconds from one frame to another, to a microsecond: 30 frames at 30 Hz are 1.0, not 0.9999999999999998."""
    return round(float(time_s[last] - time_s[first]), 6)


def shown_s(time_s: Float[Array, " F"], frames: Int[Array, " n"]) -> Float[Array, " n"]:
    """Seconds for which each of some frames is shown: until the next; the video's last as long as the one before it."""
    first = np.minimum(frames, len(time_s) - 2)
    return np.asarray(time_s[first + 1] - time_s[first])


def nearest_frame(time_s: Float[Array, " F"], moment_s: float) -> int:
    """The frame whose presentation time is nearest to a moment; the earlier of two that are equally near."""
    after = int(np.searchsorted(time_s, moment_s))
    low = max(after - 1, 0)
    return low + min(_nearest(time_s[low : after + 1].tolist(), moment_s), len(time_s) - 1 - low)


def sampled_every(time_s: Float[Array, " F"], period_s: float) -> Bool[Array, " F"]:
    """Which frames sample the video about every `period_s`: the first, then each time the one nearest to a period later
    (the next, where frames are further apart than that)."""
    num_frames = len(time_s)
    moments = [*time_s.tolist(), float(time_s[-1] + shown_s(time_s, np.array([num_frames - 1]))[0])]
    chosen = np.zeros(num_frames, bool)
    frame = 0
    while frame < num_frames:
        chosen[frame] = True
        frame = max(frame + 1, _nearest(moments, moments[frame] + period_s))
    return chosen


def _nearest(moments: Sequence[float], moment: float) -> int:
    """Index of the nearest of increasing moments, the earlier of two; one past the end where all lie before."""
    after = bisect_left(moments, moment)
    if after == 0 or after == len(moments):
        return after
    is_nearer = moments[after] - moment < moment - moments[after - 1] - ROUNDING_S
    return after if is_nearer else after - 1
