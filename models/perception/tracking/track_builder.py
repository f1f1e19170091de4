"""A track being built, frame by frame, and the finished track at the end of the scene."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.perception import own_motion
from humanmm.models.perception.clothing import clothing_histogram, mean_colours, part_colours
from humanmm.models.perception.hands.follow import Looks, hand_tracks, look_at_hands
from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.keypoints.naming import side_odds
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region
from humanmm.models.perception.tracking.personhood import Evidence, mean_score, person_probability, pose_change
from humanmm.models.perception.tracking.sides import left_right_swaps
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import PersonTrack, Silhouettes, deflated_mask
from humanmm.models.video.frame_times import ROUNDING_S, elapsed_s, shown_s

Array = np.ndarray

MIN_TRACK_S = 0.25
"""Whoever is seen for less in a scene has no track there."""
COLOUR_PERIOD_S = 0.2
"""Colours are taken no more often than this."""
MAX_STEP = 0.1
"""Largest motion of the region that is carried on to the next frame, as a fraction of its side."""
FADE = 0.8
"""Fraction of the motion that is carried on with every frame in which the person is not seen."""
UNSTEADY = 0.07
"""Second difference of the limbs, as a fraction of the region's side, at which a track is hardly a person's, for frames
1/30 s apart or less: people measured 0.005 to 0.035, bodies seen in furniture, pictures and hands 0.03 to 0.11."""
UNSTEADY_INTERVAL_S = 1 / 30
_STEADY_FRAMES = 7
_HAND_REACH = 13
"""Frames from which a hand is no longer looked for where it was."""
STEADINESS_UNKNOWN = 0.8
"""Of a track without three frames in a row."""


def shortest_track_s(time_s: Float[np.ndarray, " F"], span: tuple[int, int]) -> float:
    """How long somebody must be seen in the scene [start, end): MIN_TRACK_S, in a short one half of it."""
    scene_s = float(shown_s(time_s, np.arange(*span)).sum())
    return min(MIN_TRACK_S, 0.5 * scene_s) - ROUNDING_S


def largest_first(tracks: Iterable[PersonTrack]) -> tuple[PersonTrack, ...]:
    """Tracks by the areas of their boxes, summed over frames."""
    return tuple(sorted(tracks, key=lambda t: -float((t.bbox[:, 2:] - t.bbox[:, :2]).prod(axis=1).sum())))


@dataclass(frozen=True, eq=False, slots=True)
class Row:
    """One packed observation, about 2 KB."""

    numbers: Float[np.ndarray, " 241"]
    """Single precision: keypoints, 3D landmarks, box, the mask's affine map and the keypoints' errors (NaN if unknown)
    one after the other (an array of its own for each would take half as much again)."""
    confidence: float
    mask: bytes
    """Deflated."""
    side: float
    side_odds: float
    """Log-odds for left and right as named, by another network; 0 without one."""

    @classmethod
    def of(cls, seen: Observation) -> "Row":
        """An observation, packed."""
        sigma = np.full(landmarks.NUM_LANDMARKS, np.nan) if seen.keypoint_sigma is None else seen.keypoint_sigma
        parts = (seen.keypoints, seen.landmarks3d, seen.bbox, seen.mask_to_source, sigma)
        numbers = np.concatenate([np.ravel(part) for part in parts]).astype(np.float32)
        return cls(numbers, seen.confidence, deflated_mask(seen.mask), seen.region.side, seen.side_odds)

    @property
    def keypoints(self) -> Float[np.ndarray, "33 3"]:
        """x, y and visibility."""
        return self.numbers[:99].reshape(33, 3)

    @property
    def landmarks3d(self) -> Float[np.ndarray, "33 3"]:
        """Metres about the mid-hip."""
        return self.numbers[99:198].reshape(33, 3)

    @property
    def bbox(self) -> Float[np.ndarray, " 4"]:
        """xyxy."""
        return self.numbers[198:202]

    @property
    def mask_affine(self) -> Float[np.ndarray, "2 3"]:
        """From pixels of the mask to the picture's."""
        return self.numbers[202:208].reshape(2, 3)

    @property
    def keypoint_sigma(self) -> Float[np.ndarray, " 33"]:
        """Pixels; NaN if unknown."""
        return self.numbers[208:]


@dataclass(eq=False)
class TrackBuilder:
    """Observations of one person so far."""

    time_s: Float[Array, " F"]
    """Presentation times of the video's frames."""
    last: Observation
    last_frame: int
    velocity: Float[Array, " 2"] = field(default_factory=lambda: np.zeros(2))
    """Of the region, pixels per second, forward in time, whichever way frames are taken."""
    rows: dict[int, Row] = field(default_factory=dict)
    colours: dict[int, np.ndarray] = field(default_factory=dict)
    """Histograms of the clothes, a few a second."""
    parts: dict[int, np.ndarray] = field(default_factory=dict)
    """Colours of the body's parts in the same frames."""
    detector_scores: dict[int, float] = field(default_factory=dict)
    """What the detector gave this person in the frames of a search, 0 where it did not see him."""
    detector_sides: dict[int, float] = field(default_factory=dict)
    """Log-odds for left and right as named, by the detector's keypoints in these frames."""
    own_motions: dict[int, float] = field(default_factory=dict)
    """How far he moved by himself up to a frame (`own_motion`), a few a second."""
    hands: dict[int, Looks] = field(default_factory=dict)
    """What was seen of both hands, if they are looked for."""
    lost_since: int | None = None
    """First frame in which the person was looked for and not seen; None while he is seen."""
    active: bool = True
    _looks: deque[tuple[int, own_motion.Look]] = field(default_factory=deque)
    """The last ones, oldest first."""

    @property
    def seen_s(self) -> float:
        """Seconds in which the person was seen."""
        return float(shown_s(self.time_s, np.array(list(self.rows), np.int64)).sum())

    def predicted(self, frame: int) -> Region:
        """Where to look in a frame before or after the last one: the motion goes on, and fades while nobody is seen."""
        steps = abs(frame - self.last_frame)
        if not steps:
            return self.last.next_region
        limit = MAX_STEP * self.last.next_region.side
        step = self.velocity * ((self.time_s[frame] - self.time_s[self.last_frame]) / steps)
        dx, dy = np.clip(step, -limit, limit) * ((1 - FADE**steps) / (1 - FADE))
        return self.last.next_region.moved(float(dx), float(dy))

    def predicted_keypoints(self, frame: int) -> Float[Array, "33 3"]:
        """The last pose moved to where it is expected in a frame."""
        there, here = self.predicted(frame), self.last.next_region
        shift = np.array([there.x - here.x, there.y - here.y, 0.0])
        return np.asarray(self.last.keypoints + shift)

    def mean_colours(self) -> Float[Array, " bins"] | None:
        """Clothing so far; None before anything is known."""
        return mean_colours(np.stack(list(self.colours.values()))) if self.colours else None

    def note_colours(self, frame: int, image: Picture) -> None:
        """Take the colours of the last observation, unless that was done a moment ago."""
        if not self.colours or elapsed_s(self.time_s, max(self.colours), frame) >= COLOUR_PERIOD_S:
            self.colours[frame] = clothing_histogram(image, self.last).astype(np.float32)
            self.parts[frame] = part_colours(image, self.last).astype(np.float32)

    def note_own_motion(self, frame: int, image: Picture) -> None:
        """Compare the last observation with one about a second before, unless that was done a moment ago."""
        if self._looks and elapsed_s(self.time_s, self._looks[-1][0], frame) < own_motion.PERIOD_S:
            return
        while self._looks and elapsed_s(self.time_s, self._looks[0][0], frame) > own_motion.BACK_S:
            self._looks.popleft()
        seen = own_motion.look(image, self.last)
        for earlier, before in self._looks if len(self._looks) < 2 else (self._looks[0], self._looks[-1]):
            moved = own_motion.own_motion(before, seen)
            if moved is None:
                continue  # somebody fast: try a shorter time
            if moved > 1 or elapsed_s(self.time_s, earlier, frame) >= own_motion.LEAST_S:
                self.own_motions[frame] = moved
            break
        self._looks.append((frame, seen))

    def forget_appearance(self, frame: int) -> None:
        """Colours and motion in a frame turned out to be somebody else's."""
        self.colours.pop(frame, None)
        self.parts.pop(frame, None)
        self.own_motions.pop(frame, None)
        if self._looks and self._looks[-1][0] == frame:
            self._looks.pop()

    def add(self, frame: int, seen: Observation) -> None:
        """Take an observation in; frames may come in either direction."""
        if frame != self.last_frame:
            before, now = self.last.next_region, seen.next_region
            seconds = self.time_s[frame] - self.time_s[self.last_frame]
            self.velocity = np.array([now.x - before.x, now.y - before.y]) / seconds
        self.last, self.last_frame, self.lost_since, self.active = seen, frame, None, True
        self.rows[frame] = Row.of(seen)

    def note_detected_sides(self, frame: int, detected: Sequence[Detection]) -> None:
        """What detections of this person, best first, say of his left and right in the track's last frame."""
        limbs = next((one.keypoints[list(landmarks.COCO_LIMBS)] for one in detected if one.keypoints is not None), None)
        if limbs is not None:
            self.detector_sides[frame] = side_odds(self.last.keypoints, limbs, self.last.region.side)

    def look_at_hands(self, frame: int, image: Picture, due: Bool[Array, "F 2"] | None) -> None:
        """Look at the hands that are `due` in a frame of the track; nothing is if `due` is None."""
        if due is None or not due[frame].any():
            return
        near = (f for step in range(1, _HAND_REACH) for f in (frame - step, frame + step) if f in self.hands)
        before = [(self.rows[f].keypoints, self.hands[f]) for f in islice(near, 2)]
        self.hands[frame] = look_at_hands(image, self.rows[frame].keypoints, due[frame], before)

    def take_over(self, other: "TrackBuilder") -> None:
        """Go on with what another track has of the same person; where both have a frame, this one's counts."""
        self.rows = other.rows | self.rows
        self.colours = other.colours | self.colours
        self.parts = other.parts | self.parts
        self.detector_scores = other.detector_scores | self.detector_scores
        self.detector_sides = other.detector_sides | self.detector_sides
        self.own_motions = other.own_motions | self.own_motions
        self.hands = other.hands | self.hands

    def split(self, frame: int) -> tuple["TrackBuilder", "TrackBuilder"]:
        """The track before a frame, and from that frame on."""
        halves = tuple(TrackBuilder(self.time_s, self.last, self.last_frame) for _ in range(2))
        for f, row in self.rows.items():
            halves[f >= frame].rows[f] = row
        for f, colours in self.colours.items():
            halves[f >= frame].colours[f] = colours
            halves[f >= frame].parts[f] = self.parts[f]
        for f, score in self.detector_scores.items():
            halves[f >= frame].detector_scores[f] = score
        for f, odds in self.detector_sides.items():
            halves[f >= frame].detector_sides[f] = odds
        for f, moved in self.own_motions.items():
            halves[f >= frame].own_motions[f] = moved
        for f, looks in self.hands.items():
            halves[f >= frame].hands[f] = looks
        return halves[0], halves[1]

    def where_detected(self) -> "TrackBuilder | None":
        """The part between searches before and after which the detector never sees the person: a track may go on over
        a car when he has left. None where that is the whole track, or nothing of it."""
        seen = [frame for frame, score in self.detector_scores.items() if score > 0]
        if not seen:
            return None
        unseen = [frame for frame, score in self.detector_scores.items() if score <= 0]
        end = min((frame for frame in unseen if frame > max(seen)), default=None)
        start = max((frame for frame in unseen if frame < min(seen)), default=None)
        if start is None and end is None:
            return None
        part = self if end is None else self.split(end)[0]
        return part if start is None else part.split(start + 1)[1]

    def finished(self) -> PersonTrack:
        """The track, with left and right named alike in all frames and confidence lowered where it is unsteady.

        The rows are gone then: a long track is not kept twice.
        """
        frames = np.array(sorted(self.rows), np.int32)
        count, masks = len(frames), []
        keypoints, poses = np.empty((count, 33, 3), np.float32), np.empty((count, 33, 3), np.float32)
        bbox, mask_affine = np.empty((count, 4), np.float32), np.empty((count, 2, 3), np.float32)
        sigma = np.empty((count, 33), np.float32)
        odds, side, seen_confidence = np.empty(count), np.empty(count), np.empty(count)
        for k, frame in enumerate(frames.tolist()):
            row = self.rows.pop(frame)
            keypoints[k], poses[k], bbox[k], mask_affine[k] = row.keypoints, row.landmarks3d, row.bbox, row.mask_affine
            sigma[k] = row.keypoint_sigma
            odds[k] = row.side_odds + self.detector_sides.get(frame, 0.0)
            side[k], seen_confidence[k] = row.side, row.confidence
            masks.append(row.mask)
        hands = hand_tracks([self.hands.get(frame) for frame in frames.tolist()]) if self.hands else None
        time_s = self.time_s[frames]
        is_swapped = left_right_swaps(keypoints, poses, odds, time_s, side)
        keypoints = landmarks.with_sides_swapped(keypoints, is_swapped)
        sigma = landmarks.with_sides_swapped(sigma, is_swapped)
        steady = steadiness(keypoints, frames, side, time_s)
        evidence = Evidence(
            detector=mean_score(self.detector_scores.values()),
            trust=float(seen_confidence.mean()),
            steadiness=float(steady.mean()),
            pose_change=pose_change(keypoints, HEIGHT_OF_SIDE * side),
            seen_s=float(shown_s(self.time_s, frames).sum()),
            own_motion=own_motion.of_track(self.own_motions.values()),
        )
        sampled = sorted(self.colours)
        return PersonTrack(
            frame=frames,
            keypoints2d=keypoints,
            landmarks3d=landmarks.with_sides_swapped(poses, is_swapped),
            bbox=bbox,
            confidence=(seen_confidence * steady).astype(np.float32),
            masks=Silhouettes.of(masks),
            mask_affine=mask_affine,
            keypoint_sigma=None if np.isnan(sigma).any() else sigma,
            color_frame=np.array(sampled, np.int32),
            color_histogram=np.stack([self.colours[f] for f in sampled]).astype(np.float32),
            color_parts=np.stack([self.parts[f] for f in sampled]).astype(np.float32),
            side_odds=np.where(is_swapped, -odds, odds).astype(np.float32),
            probability=person_probability(evidence),
            evidence=tuple(evidence.features().tolist()),
            hands=hands.with_sides_swapped(is_swapped) if hands is not None else None,
        )


def steadiness(
    keypoints: Float[Array, "n 33 3"],
    frames: Int[Array, " n"],
    side: Float[Array, " n"],
    time_s: Float[Array, " n"],
) -> Float[Array, " n"]:
    """1 where the limbs move smoothly about a frame, towards 0 where they jump: a body that is not there jumps.

    `side` is the region's, pixels; `time_s` the times of the track's frames. Over three frames in a row, the middle
    one's distance from the straight line between the others (twice, which is the second difference where the frames are
    evenly apart) is compared with what it may be in the time between them.
    """
    count = len(frames)
    if count < 3:
        return np.full(count, STEADINESS_UNKNOWN)
    limbs = keypoints[:, list(landmarks.LIMBS), :2]
    interval = np.diff(time_s)
    whole = interval[1:] + interval[:-1]
    # weights 1, −2, 1 where the frames are evenly apart
    first, last = ((2 * part / whole)[:, None, None] for part in (interval[1:], interval[:-1]))
    bend = np.linalg.norm(last * limbs[2:] - 2 * limbs[1:-1] + first * limbs[:-2], axis=-1) / side[1:-1, None]
    allowed = UNSTEADY * np.maximum(1.0, whole / 2 / UNSTEADY_INTERVAL_S)
    consecutive = frames[2:] - frames[:-2] == 2
    if not consecutive.any():
        return np.full(count, STEADINESS_UNKNOWN)
    unsteady = np.interp(frames, frames[1:-1][consecutive], (np.median(bend, axis=1) / allowed)[consecutive])
    padded = np.pad(unsteady, _STEADY_FRAMES // 2, mode="edge")
    local = np.median(np.lib.stride_tricks.sliding_window_view(padded, _STEADY_FRAMES), axis=1)
    return np.asarray(np.exp(-(local**2)))
