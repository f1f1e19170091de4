"""Frames in which a pose network has swapped a person's left and right.

Seen from behind or with a blurred face, the network may call the left side right, with full confidence, for whole
runs of frames. Three kinds of evidence show it: labels that jump against the motion (between neighbouring frames), a
body whose feet and knees point backwards (weak, in every frame), and above all a body whose motion does not go on
across a cut (between shots: the cost of the bundle adjustment of `cuts` with and without swapped labels). One
two-state chain per person over the frames of the whole video holds all three, and is solved exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.cuts import camera_rotation as cuts
from humanmm.models.cuts.sides import CutPerson, SideTrack
from humanmm.models.geometry.chains import two_state_chain
from humanmm.models.geometry.intervals import Interval, frame_intervals, in_intervals
from humanmm.models.geometry.rotations import unit
from humanmm.models.records.landmarks import NUM_LANDMARKS, SWAP, with_sides_swapped

Array = np.ndarray

_LABELS = (np.arange(NUM_LANDMARKS), SWAP)
"""Order of the landmarks as labelled, and with left and right swapped."""
LIMBS = np.arange(11, 33)
"""Shoulders to toes: a guessed face is no evidence of the body's side."""
_WEIGHT = np.array([1, 1, 0.5, 0.5, 0.3, 0.3, *[0.1] * 6, 1, 1, 1, 1, 1, 1, 0.5, 0.5, 0.7, 0.7])
"""Trust in LIMBS: arms and hands swing, fingers are weak evidence."""

KEYPOINT_SIGMA = 0.03
"""Standard deviation of a 2D keypoint from frame to frame, fraction of the body's height."""
SPEED_PER_S = 1.5
"""Usual speed of a limb, body heights per second (2D) and metres per second (3D)."""
LANDMARK_SIGMA_M = 0.06
"""Standard deviation of a 3D landmark from frame to frame."""
CAP = 9.0
"""A single point adds at most this to an energy: one wrong point must not decide."""
MAX_STEP_S = 0.5
"""Frames further apart than this are no evidence of each other's labels."""

NEIGHBOUR_S = 0.14
SETTLE_RATIO = 0.9
"""A frame changes its state if its distance from the median of its neighbours (those within NEIGHBOUR_S) then is below
this fraction of what it was: a tie changes nothing."""

FORWARD_M, FORWARD_SIGMA_M = 0.08, 0.035
"""Feet and knees of a rightly labelled body lie this far forward of heels and legs (4,600 frames, rendered)."""
FORWARD_OUTLIERS, FORWARD_RANGE_M = 0.05, 0.23
"""So many rightly labelled frames lie anywhere within this range, as all swapped ones do (from -0.11 to 0.12 m)."""
INDEPENDENT_S = 0.5
"""Evidence within a single frame is nearly the same in neighbouring frames: it counts once in this time."""

ODDS_TRUST = 16.0
"""Weight of the lifter's odds beside that: those of neighbouring frames count about as if they were independent. Of
13,295 frames of spins, kicks, floor work and acrobatics with sides beyond doubt (rendered places, 104 clips)
523 have the wrong ones with a weight of 2 (and CHANGE 8), 438 with 8, 425 with 16, 401 with 24; of 8,646 frames of
ordinary clips 45, and 18 with all others."""
ODDS_LIMIT = 1.0
"""What the lifter's odds say in one frame at most. Where a body is seen as none that it has learnt (legs behind wheels,
a wide coat) it says 5 to 8 for whole runs of frames, against two networks that see the face: they must not be outvoted
by one that is sure. Of 1,931 frames of places and 2,875 ordinary ones 191 and 22 were wrong without a limit, 183 and 20
with 2, 183 and 13 with 1, 193 and 21 with 0.5."""
OTHERS_TRUST = 1.0
"""Weight of what other networks say of a frame: of the 425 frames with the wrong sides 339 are left."""

CUT_WINDOW_S = 0.5
CUT_GAP_S = 0.1
"""A gap this long between two shots halves the evidence of the cut."""
DOUBTFUL_COST = 25.0
"""A cut that costs so much with either labels counts half as much: something else is wrong there."""
MAX_CUT_GAP_S = 1.0
"""Longer gaps between shots carry no pose across."""
HELD = 50.0
"""Energy of a frame next to a cut that leaves its state relative to its neighbour's: more than single frames say, so
that whoever judges the cut changes them together or not at all."""
KEEP_PRIOR = 2.0
"""Energy of half a second swapped: the tracks come with sides put right, and 97 % of their frames are."""
CHANGE = 4.0
"""Energy of a change within a shot: the track's own frames have been compared before."""


@dataclass(frozen=True)
class SidesSeen:
    """One person's observations in one shot, frames in order (holes allowed)."""

    time_s: Float[Array, "n"]
    shown_s: Float[Array, "n"]
    """Seconds for which each frame is shown."""
    frame: Int[Array, "n"]
    keypoints2d: Float[Array, "n 33 3"]
    landmarks3d: Float[Array, "n 33 3"]
    swap_odds: Float[Array, "n"] | None = None
    """The lifter's log-odds that left and right are swapped."""
    side_odds: Float[Array, "n"] | None = None
    """Other networks' log-odds that they are not."""

    def only(self, rows: Array) -> "SidesSeen":
        """Some of the observations."""
        swap_odds, side_odds = (None if odds is None else odds[rows] for odds in (self.swap_odds, self.side_odds))
        return SidesSeen(
            self.time_s[rows], self.shown_s[rows], self.frame[rows], self.keypoints2d[rows], self.landmarks3d[rows],
            swap_odds, side_odds,
        )  # fmt: skip


NEAR_FRAMES = 3
"""A person need not be seen in the very frame that the user names."""


@dataclass(frozen=True)
class KnownSides:
    """What the user says of one person's left and right in frames [start, end)."""

    start: int
    end: int
    frame: int
    """The frame that `pair` and `places` belong to."""
    pair: tuple[int, int] | None = None
    """A left and a right landmark; None: whatever is found in these frames is the wrong way round."""
    places: Float[Array, "2 2"] | None = None
    """Where these two truly are in that frame, source pixels."""

    def is_answered(self, sightings: Sequence[SidesSeen]) -> bool:
        """Whether what the user says can be compared with what was found."""
        return self.is_wrong(sightings, [np.zeros(len(one.frame), bool) for one in sightings]) is not None

    def is_wrong(self, sightings: Sequence[SidesSeen], states: Sequence[Bool[Array, "n"]]) -> bool | None:
        """Whether these states of all shots contradict the user; None if the person is seen nowhere near the frame."""
        if self.pair is None or self.places is None:
            return True
        apart = [np.abs(one.frame - self.frame) for one in sightings]
        nearest = min(range(len(apart)), key=lambda k: apart[k].min(initial=NEAR_FRAMES + 1), default=None)
        if nearest is None or apart[nearest].min(initial=NEAR_FRAMES + 1) > NEAR_FRAMES:
            return None
        row = [int(apart[nearest].argmin())]
        keypoints = with_sides_swapped(sightings[nearest].keypoints2d[row], states[nearest][row])[0]
        labelled = keypoints[list(self.pair), :2]
        kept, crossed = (np.linalg.norm(labelled - places, axis=1).sum() for places in (self.places, self.places[::-1]))
        return bool(crossed < kept)


def left_right_swaps(
    sightings: Sequence[SidesSeen], K: Float[Array, "3 3"], known: Sequence[KnownSides] = ()
) -> tuple[tuple[Interval, ...], ...]:
    """For each shot of one person, in time order: the frames [start, end) with left and right swapped.

    K may be rough: a focal length wrong by 30 % changes nothing here. What the user knows holds; the other frames
    follow from it.
    """
    states = _swapped_frames(sightings, K, [np.full(len(sighting.frame), FREE) for sighting in sightings])
    if known:
        states = _swapped_frames(sightings, K, _fixed_states(sightings, states, known))
    return tuple(frame_intervals(sighting.frame, state) for sighting, state in zip(sightings, states, strict=True))


FREE = -1
"""In place of a state: nobody knows it."""
KNOWN = 1e6
"""Energy of contradicting the user."""


def _fixed_states(
    sightings: Sequence[SidesSeen], found: Sequence[Bool[Array, "n"]], known: Sequence[KnownSides]
) -> list[Int[Array, "n"]]:
    """The state of each frame by what the user knows, or FREE: as `found`, or the other one where that is wrong."""
    fixed = [np.full(len(sighting.frame), FREE) for sighting in sightings]
    for one in known:
        wrong = one.is_wrong(sightings, found)
        if wrong is None:
            continue
        for sighting, state, own in zip(sightings, found, fixed, strict=True):
            inside = in_intervals(sighting.frame, [(one.start, one.end)])
            own[inside] = state[inside] ^ wrong
    return fixed


def _swapped_frames(
    sightings: Sequence[SidesSeen], K: Float[Array, "3 3"], fixed: Sequence[Int[Array, "n"]]
) -> list[Bool[Array, "n"]]:
    """For each shot of one person, which frames have left and right swapped; `fixed` has those that are known."""
    held = [states for sighting, states in zip(sightings, fixed, strict=True) if len(sighting.frame)]
    seen = [sighting for sighting in sightings if len(sighting.frame)]
    if not seen:
        return [np.zeros(0, dtype=bool) for _ in sightings]
    relative = [_settled(sighting, _within_shot(sighting, own), own) for sighting, own in zip(seen, held, strict=True)]
    pairs: list[Array] = []
    for k, (sighting, state) in enumerate(zip(seen, relative, strict=True)):
        pairs.append(step_energies(sighting) + _held_at_cuts(sighting, state, first=k == 0, last=k + 1 == len(seen)))
        if k + 1 < len(seen):
            as_found, one_swapped = _across_cut(sighting, state, seen[k + 1], relative[k + 1], K)
            agreed = state[-1] == relative[k + 1][0]
            pairs.append(np.array([[as_found, one_swapped] if agreed else [one_swapped, as_found]]))
    unary = np.concatenate([_frame_evidence(sighting) + _given(own) for sighting, own in zip(seen, held, strict=True)])
    whole = two_state_chain(unary, np.concatenate(pairs))
    states = np.split(whole, np.cumsum([len(sighting.frame) for sighting in seen])[:-1])
    parts = iter([_settled(*one) for one in zip(seen, states, held, strict=True)])
    return [next(parts) if len(sighting.frame) else np.zeros(0, dtype=bool) for sighting in sightings]


def _given(fixed: Int[Array, "n"]) -> Float[Array, "n 2"]:
    """Energy of each frame as labelled and swapped, from what the user knows."""
    return np.asarray(KNOWN * np.stack([fixed == 1, fixed == 0], axis=1))


def _within_shot(sighting: SidesSeen, fixed: Int[Array, "n"]) -> Bool[Array, "n"]:
    """States of the frames of one shot, from the motion between them and each frame's own evidence."""
    if len(sighting.frame) < 2:
        return np.asarray(fixed == 1)
    return two_state_chain(_frame_evidence(sighting) + _given(fixed), step_energies(sighting))


def _settled(sighting: SidesSeen, state: Bool[Array, "n"], fixed: Int[Array, "n"]) -> Bool[Array, "n"]:
    """The states with single frames put right by the median of their neighbours.

    A picture in which the network mixes both sides looks wrong next to either neighbour, so the chain may pass it in
    the wrong state; against the median of its surroundings it shows where it belongs.
    """
    if (fixed != FREE).all():
        return state
    for _ in range(2):
        flat, _ = _normalised(with_sides_swapped(sighting.keypoints2d, state))
        solid = with_sides_swapped(sighting.landmarks3d, state).astype(np.float64)
        new = state.copy()
        for k, now in enumerate(sighting.time_s):
            first, last = np.searchsorted(sighting.time_s, [now - NEIGHBOUR_S - 1e-9, now + NEIGHBOUR_S + 1e-9])
            others = np.r_[first:k, k + 1 : last]
            if len(others) < 4 or fixed[k] != FREE:
                continue
            usual = (np.median(flat[others], axis=0), np.median(solid[others], axis=0))
            kept, swapped = (
                _distance(flat[k, labels], usual[0]) / KEYPOINT_SIGMA
                + _distance(solid[k, labels], usual[1]) / LANDMARK_SIGMA_M
                for labels in _LABELS
            )
            new[k] ^= swapped < SETTLE_RATIO * kept
        if (new == state).all():
            break
        state = new
    return state


def _distance(a: Float[Array, "33 c"], b: Float[Array, "33 c"]) -> float:
    """Weighted mean distance of the limbs' points: no cap, a mixed-up frame is far from everything."""
    return float(np.average(np.linalg.norm(a - b, axis=-1)[LIMBS], weights=_WEIGHT))


def _normalised(keypoints2d: Float[Array, "n 33 3"]) -> tuple[Float[Array, "n 33 2"], Float[Array, "n"]]:
    """Image points about the torso in body heights, and the height in pixels."""
    image = keypoints2d[..., :2].astype(np.float64)
    image = image - image[:, [11, 12, 23, 24]].mean(axis=1, keepdims=True)
    height = np.maximum(np.maximum(np.ptp(image[..., 1], axis=1), np.ptp(image[..., 0], axis=1)), 1e-6)
    return image / height[:, None, None], height


def step_energies(sighting: SidesSeen) -> Float[Array, "n-1 2"]:
    """Energy of each neighbouring pair of frames with the same and with different labels: how far the limbs moved
    against what is usual in the time between."""
    step = np.diff(sighting.time_s)[:, None]
    image, height = _normalised(sighting.keypoints2d)
    image = image * height[:, None, None]
    height = np.minimum(height[1:], height[:-1])[:, None]
    landmarks = sighting.landmarks3d.astype(np.float64)
    energies = []
    for labels in _LABELS:
        flat = np.linalg.norm(image[1:, labels] - image[:-1], axis=-1)[:, LIMBS] / height
        solid = np.linalg.norm(landmarks[1:, labels] - landmarks[:-1], axis=-1)[:, LIMBS]
        energy = _capped(flat, np.hypot(KEYPOINT_SIGMA, SPEED_PER_S * step))
        energy = energy + _capped(solid, np.hypot(LANDMARK_SIGMA_M, SPEED_PER_S * step))
        energies.append(0.5 * (energy * _WEIGHT).sum(axis=1))
    near = np.diff(sighting.time_s) <= MAX_STEP_S
    return np.asarray(np.stack(energies, axis=1) * near[:, None] + np.array([0.0, CHANGE]))


def _frame_evidence(sighting: SidesSeen) -> Float[Array, "n 2"]:
    """Energy of each frame as labelled and swapped, from feet and knees that should lie forward of the body's plane,
    from the lifter, and from other networks' looks at the frame."""
    off = (forwardness(sighting.landmarks3d) - FORWARD_M) / FORWARD_SIGMA_M
    normal = np.exp(-0.5 * off**2) / (FORWARD_SIGMA_M * np.sqrt(2 * np.pi))
    right = -np.log((1 - FORWARD_OUTLIERS) * normal * FORWARD_RANGE_M + FORWARD_OUTLIERS)
    weight = np.minimum(1.0, sighting.shown_s / INDEPENDENT_S)
    energies = np.stack([right, np.full(len(right), KEEP_PRIOR)], axis=1)
    if sighting.swap_odds is not None:
        swapped = np.clip(sighting.swap_odds.astype(np.float64), -ODDS_LIMIT, ODDS_LIMIT)
        odds = np.stack([swapped, -swapped], axis=1)
        energies = energies + ODDS_TRUST * np.logaddexp(0.0, odds)
    energies = weight[:, None] * energies
    if sighting.side_odds is not None:
        energies[:, 1] += OTHERS_TRUST * sighting.side_odds
    return np.asarray(energies)


def forwardness(landmarks3d: Float[Array, "n 33 3"]) -> Float[Array, "n"]:
    """How far toes lie forward of heels and knees of legs, metres; forward follows from the labels of hips and
    shoulders."""
    x = landmarks3d.astype(np.float64)
    up = x[:, [11, 12]].mean(axis=1) - x[:, [23, 24]].mean(axis=1)
    left = unit(x[:, 11] - x[:, 12]) + unit(x[:, 23] - x[:, 24])
    forward = unit(np.cross(left, up))
    toes = 0.5 * (x[:, 31] - x[:, 29] + x[:, 32] - x[:, 30])
    knees = 0.5 * (x[:, 25] + x[:, 26]) - 0.25 * (x[:, 23] + x[:, 24] + x[:, 27] + x[:, 28])
    return np.asarray(0.5 * ((toes + knees) * forward).sum(axis=1))


def _held_at_cuts(sighting: SidesSeen, state: Bool[Array, "n"], *, first: bool, last: bool) -> Float[Array, "n-1 2"]:
    """Energy that keeps frames next to a cut in their states relative to one another: the cut judges them together."""
    held = np.zeros((max(len(state) - 1, 0), 2))
    time_s = sighting.time_s
    near = np.zeros(len(held), dtype=bool)
    if not first:
        near |= time_s[1:] <= time_s[0] + cuts.WINDOW_S
    if not last:
        near |= time_s[:-1] >= time_s[-1] - cuts.WINDOW_S
    changed = state[1:] != state[:-1]
    held[near & changed, 0] = HELD
    held[near & ~changed, 1] = HELD
    return held


def _across_cut(
    before: SidesSeen,
    state_before: Bool[Array, "n"],
    after: SidesSeen,
    state_after: Bool[Array, "m"],
    K: Float[Array, "3 3"],
) -> tuple[float, float]:
    """Energies of two neighbouring shots with the states as found, and with those of one of them inverted."""
    gap = float(after.time_s[0] - before.time_s[-1])
    if gap > MAX_CUT_GAP_S:
        return 0.0, 0.0
    first = _near_cut(before, state_before, before.time_s >= before.time_s[-1] - CUT_WINDOW_S)
    near = after.time_s <= after.time_s[0] + CUT_WINDOW_S
    trust = 1.0 / (1.0 + (gap / CUT_GAP_S) ** 2)
    costs = [
        cuts.continuation_cost(CutPerson(first, _near_cut(after, state, near)), K)
        for state in (state_after, ~state_after)
    ]
    trust /= 1.0 + (min(costs) / DOUBTFUL_COST) ** 2
    return trust * costs[0], trust * costs[1]


def _near_cut(sighting: SidesSeen, state: Bool[Array, "n"], near: Bool[Array, "n"]) -> SideTrack:
    return SideTrack(
        time_s=sighting.time_s[near],
        keypoints2d=with_sides_swapped(sighting.keypoints2d[near], state[near]),
        landmarks3d=with_sides_swapped(sighting.landmarks3d[near], state[near]),
        R_cam_root=None,
        R_cut_cam=np.broadcast_to(np.eye(3), (int(near.sum()), 3, 3)),
    )


def _capped(distance: Float[Array, "*n"], deviation: Float[Array, "*n"]) -> Float[Array, "*n"]:
    return np.asarray(np.minimum((distance / deviation) ** 2, CAP))
