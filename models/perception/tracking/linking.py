"""Tracks of one scene put right at its end: split where the clothes change, joined where one person went on."""

from collections.abc import Sequence

import numpy as np

from humanmm.models.perception.appearance import median_parts, same_look_odds
from humanmm.models.perception.clothing import colour_distance, mean_colours
from humanmm.models.perception.tracking.track_builder import TrackBuilder
from humanmm.models.video.frame_times import elapsed_s

CHANGED_COLOURS = 0.55
"""Hellinger distance between neighbouring stretches at which a track has moved on to somebody else. One person's
clothes changed by up to 0.42 within a scene; the step from one player to another was 0.69."""
STRETCH = 3
"""Colour samples in each of the two stretches compared."""

PLACE_LIMIT = 4.0
SHORT_GAP_S = 1.5
REACH_SIDES, REACH_SIDES_PER_S = 0.3, 1.5
"""How far a person gets unseen, in sides of his region (about 1.6 body heights): at once, and by running."""
SIZE_SPREAD = 0.3
RETURN_ODDS, RETURN_ODDS_PER_S = -1.5, -0.5
"""Log-odds that somebody who appears some time after another left is the same, before the clothes are compared: people
who come in one after the other often dress alike, and one wrong join is worse than a new number."""
LINGER_S = 1.0
"""So long may a track go on where its person was (a jump was too fast for it) while he is followed anew elsewhere."""


def untangled(tracks: Sequence[TrackBuilder]) -> list[TrackBuilder]:
    """Tracks, split where they jumped from one person to another."""
    result: list[TrackBuilder] = []
    rest = list(tracks)
    while rest:
        track = rest.pop()
        change = colour_change(track)
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


def joined(tracks: Sequence[TrackBuilder]) -> list[TrackBuilder]:
    """Tracks that do not overlap in time and look like one person's, joined, best pair first."""
    pool = list(tracks)
    while True:
        best, pair = 0.0, None
        for a in pool:
            for b in pool:
                if a is not b and (odds := continuation_odds(a, b)) > best:
                    best, pair = odds, (a, b)
        if pair is None:
            return pool
        first, second = pair
        before, _ = first.split(min(second.rows))
        second.rows.update(before.rows)
        second.colours.update(before.colours)
        second.parts.update(before.parts)
        second.detector_scores.update(before.detector_scores)
        second.detector_sides.update(before.detector_sides)
        second.own_motions.update(before.own_motions)
        second.hands.update(before.hands)
        pool = [track for track in pool if track is not first]


def _still_there(track: TrackBuilder, frame: int) -> bool:
    """Whether a track has its person in or after a frame, and not only lingers where he was."""
    last = max(track.rows)
    if last < frame:
        return False
    scores = [score for f, score in track.detector_scores.items() if f >= frame]
    return not scores or max(scores) > 0 or elapsed_s(track.time_s, frame, last) > LINGER_S


def continuation_odds(a: TrackBuilder, b: TrackBuilder) -> float:
    """Log-odds that b goes on where a ended; −∞ where b comes first, or a is still seen when b is."""
    start = min(b.rows)
    end = max((frame for frame in a.rows if frame < start), default=None)
    if end is None or _still_there(a, start):
        return -np.inf
    looks = [
        (mean_colours(np.stack(list(track.colours.values()))), median_parts(list(track.parts.values())))
        for track in (a, b)
    ]
    odds = same_look_odds(*looks[0], *looks[1])
    gap_s = elapsed_s(a.time_s, end, start)
    if gap_s > SHORT_GAP_S:
        return odds + RETURN_ODDS + RETURN_ODDS_PER_S * (gap_s - SHORT_GAP_S)
    before, after = a.rows[end], b.rows[start]
    middle_before, middle_after = before.mask_affine @ [64, 64, 1], after.mask_affine @ [64, 64, 1]
    travelled = float(np.linalg.norm(middle_after - middle_before)) / before.side
    reach = REACH_SIDES + REACH_SIDES_PER_S * gap_s
    odds += float(np.clip(4 * (1 - travelled / reach), -PLACE_LIMIT, 3.0))
    return odds - abs(float(np.log(after.side / before.side))) / SIZE_SPREAD
