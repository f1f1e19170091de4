"""Tracks of one scene put right at its end: split where they went on to somebody else, joined where one person did."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.perception.appearance import median_parts, same_look_odds
from humanmm.models.perception.clothing import colour_distance, mean_colours
from humanmm.models.perception.tracking.track_builder import Row, TrackBuilder
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE
from humanmm.models.video.frame_times import elapsed_s

Array = np.ndarray

CHANGED_COLOURS = 0.55
"""Hellinger distance between neighbouring stretches at which a track has moved on to somebody else. One person's
clothes changed by up to 0.42 within a scene; the step from one player to another was 0.69."""
STRETCH = 3
"""Colour samples in each of the two stretches compared."""

HANDED_OVER_ODDS = 4.0
"""So much likelier, in log-odds, is it that somebody who is found anew beside a track is whom it showed before than
that it still shows him: it went on to another person when two met. Of a track that did 5.2; of 58 other scenes, most
of them of several people, some of whom dance, hug and fight, none has more than 3."""
FEWEST_COLOURS = 2
"""Samples of a track's colours on either side of where it is split for this."""
BESIDE = 1.0
"""Somebody found anew is as near to the track, in sides of its region."""

LEAP, LEAP_S, CALM_S = 0.8, 0.35, 0.3
"""Lengths of the trunk by which a track leaps to somebody else, between two of its frames no farther apart than LEAP_S:
beyond twice what its fastest movement within CALM_S of either frame explains. Of 15,286 steps of real and rendered
people nine are farther; of the eight in real films seven go to another person, one is a body seen across two men."""
SEEN, FEWEST_STEPS = 0.5, 2
"""Visibility of a landmark that counts for a leap, and steps from frame to frame that say how fast it moves."""
_LEAPING = [0, *landmarks.TORSO]
"""Nose, shoulders and hips."""

PLACE_LIMIT = 6.0
SHORT_GAP_S = 1.5
WALK_SIDES, WALK_SIDES_PER_S = 0.03, 0.11
"""Scale of how far a person gets unseen, in sides of his region (about 1.6 body heights): at once, and with time.
People in a dozen real films get 0.05, 0.13, 0.24 and 0.33 sides in 0.2, 0.5, 1 and 1.5 s (medians; 0.29 to 1.17 in one
of a hundred cases): 1.7 and 6.6 times the scale, as where the density in the plane falls by e with each scale."""
SIZE_SPREAD = 0.3
RETURN_ODDS, RETURN_ODDS_PER_S = -1.5, -0.5
"""Log-odds that somebody who appears some time after another left is the same, before the clothes are compared: people
who come in one after the other often dress alike, and one wrong join is worse than a new number."""
AT_EDGE = 0.01
"""Of the picture's longer side: a box so near to its edge touches it."""
LINGER_S = 1.0
"""So long may a track go on where its person was (a jump was too fast for it) while he is followed anew elsewhere."""
ONE_PLACE, TAKING_TURNS, FEWEST_TURNS = 0.08, 0.3, 5
"""Two tracks are one body's that is taken from the one by the other and back: their trunks are no farther apart than a
fraction of the region's side in the median over at least so many frames that both span, and no more than a fraction of
these frames has both. Measured: 0.04, 0.11 of such a body; the next nearest of 230 scenes, people who dance or wrestle
among them, 0.13, 0.5."""


def untangled(tracks: Sequence[TrackBuilder]) -> list[TrackBuilder]:
    """Tracks, split where they jumped from one person to another."""
    result: list[TrackBuilder] = []
    rest = list(tracks)
    while rest:
        track = rest.pop()
        change = colour_change(track) or leap(track) or handed_over(track, tracks)
        if change is None:
            result.append(track)
        else:
            rest += [half for half in track.split(change) if half.rows and half.colours]
    return result


def colour_change(track: TrackBuilder) -> int | None:
    """The frame at which the clothes change most, if they change at all."""
    frames = sorted(track.colours)
    worst, where = CHANGED_COLOURS, None
    for k in range(STRETCH, len(frames) - STRETCH + 1):
        before = mean_colours(np.stack([track.colours[f] for f in frames[k - STRETCH : k]]))
        after = mean_colours(np.stack([track.colours[f] for f in frames[k : k + STRETCH]]))
        distance = colour_distance(before, after)
        if distance > worst:
            worst, where = distance, frames[k]
    return where


def leap(track: TrackBuilder) -> int | None:
    """The frame with which a track that moves calmly before and after begins to show somebody far from where it was."""
    frames = sorted(track.rows)
    time_s = track.time_s[frames]
    points = np.stack([track.rows[frame].keypoints[_LEAPING] for frame in frames]).astype(np.float64)
    shoulders, hips = points[:, 1:3, :2].mean(axis=1), points[:, 3:, :2].mean(axis=1)
    trunk = np.linalg.norm(shoulders - hips, axis=1)
    worst, where = LEAP, None
    for k in np.flatnonzero(np.diff(time_s) <= LEAP_S):
        seen = (points[k : k + 2, :, 2] >= SEEN).all(axis=0)
        before = slice(int(np.searchsorted(time_s, time_s[k] - CALM_S)), k + 1)
        after = slice(k + 1, int(np.searchsorted(time_s, time_s[k + 1] + CALM_S, side="right")))
        if not seen.any() or min(before.stop - before.start, after.stop - after.start) < FEWEST_STEPS + 1:
            continue
        length = max(float(np.median(trunk[before.start : after.stop])), 1.0)
        speed = max(_speed(points[side][:, seen, :2], time_s[side]) for side in (before, after))
        moved = np.linalg.norm(points[k + 1, seen, :2] - points[k, seen, :2], axis=1).mean()
        excess = (moved - 2 * speed * (time_s[k + 1] - time_s[k])) / length
        if excess > worst:
            worst, where = float(excess), frames[k + 1]
    return where


def _speed(points: Float[Array, "n points 2"], time_s: Float[Array, " n"]) -> float:
    """The larger of the median speed from frame to frame and that from the first frame to the last, pixels a second."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1) / np.diff(time_s)
    whole = np.linalg.norm(points[-1] - points[0], axis=1).mean() / (time_s[-1] - time_s[0])
    return float(max(np.median(steps), whole))


def handed_over(track: TrackBuilder, others: Sequence[TrackBuilder]) -> int | None:
    """The frame from which a track shows somebody else, its own person being found anew beside him; None if there is
    none. People who dress too much alike for `colour_change` are told apart by this comparison."""
    most, where = HANDED_OVER_ODDS, None
    own = sorted(track.rows)
    for other in others:
        found = min(other.rows)
        if other is track or not other.colours or not own[0] < found <= own[-1]:
            continue
        if _apart(track.rows[own[bisect_left(own, found)]], other.rows[found]) > BESIDE:
            continue
        anew = _Looks(other)
        for frame in sorted(track.colours)[FEWEST_COLOURS : len(track.colours) - FEWEST_COLOURS + 1]:
            if frame > found or elapsed_s(track.time_s, frame, found) > SHORT_GAP_S:
                continue
            before, after = (_Looks(half) for half in track.split(frame))
            odds = _look_odds(before, anew) - _look_odds(before, after)
            if odds > most:
                most, where = odds, frame
    return where


def joined(tracks: Sequence[TrackBuilder], size: tuple[int, int]) -> list[TrackBuilder]:
    """Tracks that take turns on one body, joined; and those that do not overlap in time and look like one person's,
    best pair first. `size` is the picture's width and height, pixels."""
    pool = dict(enumerate(map(_Looks, without_doubles(tracks))))
    odds = {(i, j): _join_odds(pool, i, j, size) for i in pool for j in pool if i != j}
    while odds:
        first, second = max(odds, key=lambda pair: odds[pair])
        if odds[first, second] <= 0:
            break
        track = pool[second].track
        before, _ = pool.pop(first).track.split(pool[second].frames[0])
        track.take_over(before)
        pool[second] = _Looks(track)
        odds = {pair: value for pair, value in odds.items() if first not in pair}
        for i, j in odds:
            if second in (i, j):
                odds[i, j] = _join_odds(pool, i, j, size)
    return [one.track for one in pool.values()]


def _join_odds(pool: Mapping[int, "_Looks"], first: int, second: int, size: tuple[int, int]) -> float:
    """Log-odds that one of many goes on as another: any of those who are lost by then, or are found from then on, may
    be the one."""
    a, b = pool[first], pool[second]
    odds = _continuation_odds(a, b, size)
    if odds <= 0:  # no join, however few they are
        return odds
    start = b.frames[0]
    end = a.frames[bisect_left(a.frames, start) - 1]
    lost = sum(one.frames[0] < start and not one.still_there(start) for one in pool.values())
    found = sum(one.frames[0] > end for one in pool.values())
    return odds - float(np.log(max(lost, found)))


def without_doubles(tracks: Sequence[TrackBuilder]) -> list[TrackBuilder]:
    """The tracks, each that takes turns with a longer one on its body joined to it."""
    pool: list[TrackBuilder] = []
    for track in sorted(tracks, key=lambda track: -track.seen_s):
        longer = next((other for other in pool if take_turns(other, track)), None)
        if longer is None:
            pool.append(track)
        else:
            longer.take_over(track)
    return pool


def take_turns(a: TrackBuilder, b: TrackBuilder) -> bool:
    """True where two tracks follow one body by turns: in the same clothes they lie on each other, and hardly a frame
    has both."""
    frames = np.arange(max(min(a.rows), min(b.rows)), min(max(a.rows), max(b.rows)) + 1)
    if len(frames) < FEWEST_TURNS:
        return False
    both = np.mean([frame in a.rows and frame in b.rows for frame in frames])
    clothes = [mean_colours(np.stack(list(track.colours.values()))) for track in (a, b)]
    if both > TAKING_TURNS or colour_distance(*clothes) > CHANGED_COLOURS:
        return False
    (trunk_a, side), (trunk_b, _) = (_trunk(track, frames) for track in (a, b))
    apart = np.linalg.norm(trunk_a - trunk_b, axis=-1).mean(axis=1) / side
    return bool(np.median(apart) < ONE_PLACE)


def _trunk(track: TrackBuilder, frames: Int[Array, " n"]) -> tuple[Float[Array, "n 4 2"], Float[Array, " n"]]:
    """Shoulders and hips in some frames, and the side of the region, pixels; linear between a track's own frames."""
    own = sorted(track.rows)
    rows = [track.rows[frame] for frame in own]
    values = np.column_stack([
        np.stack([row.keypoints[list(landmarks.TORSO), :2].ravel() for row in rows]), [row.side for row in rows]
    ])  # fmt: skip
    there = np.stack([np.interp(frames, own, column) for column in values.T], axis=1)
    return there[:, :-1].reshape(len(frames), -1, 2), there[:, -1]


class _Looks:
    """What a track shows as a whole: taken once, for all whom it may be."""

    def __init__(self, track: TrackBuilder) -> None:
        self.track = track
        self.frames = sorted(track.rows)
        self.colours = mean_colours(np.stack(list(track.colours.values())))
        self.parts = median_parts(list(track.parts.values()))
        self._looked = sorted(track.detector_scores)
        scores = [track.detector_scores[frame] for frame in self._looked]
        self._best_from = np.maximum.accumulate(scores[::-1])[::-1].tolist()

    def still_there(self, frame: int) -> bool:
        """Whether the track has its person in or after a frame, and not only lingers where he was: as the detector said
        when it looked after that frame, or else when it looked last."""
        last = self.frames[-1]
        if last < frame:
            return False
        if not self._looked:
            return True
        look = min(bisect_left(self._looked, frame), len(self._looked) - 1)
        return bool(self._best_from[look] > 0) or elapsed_s(self.track.time_s, frame, last) > LINGER_S

    def confirmed(self, frame: int) -> int:
        """The last frame, up to one of the track's, in which the detector saw its person; that one if there is none."""
        seen = [look for look in self._looked if look <= frame and self.track.detector_scores[look] > 0]
        return next((look for look in reversed(seen) if look in self.track.rows), frame)


def _continuation_odds(a: _Looks, b: _Looks, size: tuple[int, int]) -> float:
    """Log-odds that b goes on where a ended; −∞ where b comes first, or a is still seen when b is; or where a has left
    the picture, and b is within it from the first: whoever comes back is seen at an edge before."""
    start = b.frames[0]
    earlier = bisect_left(a.frames, start)
    if earlier == 0 or a.still_there(start):
        return -np.inf
    end, after = a.frames[earlier - 1], b.track.rows[start]
    if _left(a.track.rows[end], size) and not _touches_edge(after, size):
        return -np.inf
    if a.frames[-1] >= start:  # it lingers
        end = a.confirmed(end)
    before = a.track.rows[end]
    odds = _look_odds(a, b)
    gap_s = elapsed_s(a.track.time_s, end, start)
    if gap_s > SHORT_GAP_S:
        return odds + RETURN_ODDS + RETURN_ODDS_PER_S * (gap_s - SHORT_GAP_S)
    odds += _place_odds(_apart(before, after), gap_s, area=np.prod(size) / before.side**2)
    return odds - abs(float(np.log(after.side / before.side))) / SIZE_SPREAD


def _look_odds(a: _Looks, b: _Looks) -> float:
    """Log-odds that two tracks look like one person's."""
    return same_look_odds(a.colours, a.parts, b.colours, b.parts)


def _place_odds(apart: float, gap_s: float, *, area: float) -> float:
    """Log-odds that somebody got so far unseen, against anybody else, who is anywhere in the picture; sides of his
    region and, for the picture's `area`, their squares."""
    scale = WALK_SIDES + WALK_SIDES_PER_S * gap_s
    own = 2 * np.pi * scale**2
    return float(np.clip(np.log(max(area / own, 1.0)) - apart / scale, -PLACE_LIMIT, PLACE_LIMIT))


def _left(row: Row, size: tuple[int, int]) -> bool:
    """True where somebody's hips are beyond the edge of the picture: he has gone out of it."""
    hips = row.keypoints[list(landmarks.HIPS), :2].mean(axis=0)
    return bool((hips < 0).any() or (hips > size).any())


def _touches_edge(row: Row, size: tuple[int, int]) -> bool:
    """True where somebody's box reaches the edge of the picture."""
    margin = AT_EDGE * max(size)
    return bool((row.bbox[:2] < margin).any() or (row.bbox[2:] > np.array(size) - margin).any())


def _apart(a: Row, b: Row) -> float:
    """From the middle of one region to that of another, in sides of the first."""
    return float(np.linalg.norm((b.mask_affine - a.mask_affine) @ [MASK_SIDE / 2, MASK_SIDE / 2, 1])) / a.side
