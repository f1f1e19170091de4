"""Following everybody through one scene: a frame's crop comes from the last frame's landmarks, a search finds the rest.

Frames come once, in order; the last few are kept, so that a person found late is followed back to where he appeared.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import UInt8

from humanmm.models.perception.networks import box_overlaps, locate
from humanmm.models.perception.observation import Observation, clothing_histogram, observe
from humanmm.models.perception.regions import Region
from humanmm.models.perception.search import QUICK, THOROUGH, Effort, find_people, paint_out, same_person
from humanmm.models.perception.tracks import PersonTrack, ScenePeople

Image = UInt8[np.ndarray, "height width 3"]

QUICK_PERIOD_S, THOROUGH_PERIOD_S = 0.33, 1.5
HISTOGRAM_PERIOD_S = 0.2
MIN_TRACK_S = 0.25


@dataclass
class Trail:
    """A track while it grows: packed observations only."""

    last: Observation
    last_frame: int
    velocity: tuple[float, float] = (0.0, 0.0)
    rows: dict[int, tuple[np.ndarray, ...]] = field(default_factory=dict)
    colours: dict[int, np.ndarray] = field(default_factory=dict)
    active: bool = True

    def predicted(self) -> Region:
        return self.last.next_region.moved(*self.velocity)

    def add(self, frame: int, seen: Observation) -> None:
        """Take an observation in; frames may come in either direction."""
        steps = frame - self.last_frame
        if steps:
            side = seen.next_region.side
            before, now = self.last.next_region, seen.next_region
            step = np.clip(np.array([now.x - before.x, now.y - before.y]) / abs(steps), -0.1 * side, 0.1 * side)
            self.velocity = (float(step[0]), float(step[1]))
        self.last, self.last_frame = seen, frame
        self.rows[frame] = (
            seen.keypoints.astype(np.float32),
            seen.landmarks3d.astype(np.float32),
            seen.bbox.astype(np.float32),
            np.array(seen.confidence, np.float32),
            np.packbits(seen.mask, axis=-1),
            seen.mask_to_source.astype(np.float32),
        )

    def finished(self) -> PersonTrack:
        frames = sorted(self.rows)
        columns = [np.stack(column) for column in zip(*(self.rows[f] for f in frames), strict=True)]
        sampled = sorted(self.colours)
        return PersonTrack(
            frame=np.array(frames, np.int32),
            keypoints2d=columns[0],
            landmarks3d=columns[1],
            bbox=columns[2],
            confidence=columns[3],
            mask_bits=columns[4],
            mask_affine=columns[5],
            color_frame=np.array(sampled, np.int32),
            color_histogram=np.stack([self.colours[f] for f in sampled]),
        )


class SceneTracker:
    """State of one scene; `step` takes its frames in order, `finish` gives the tracks."""

    def __init__(self, *, fps: float, max_people: int) -> None:
        self._fps = fps if fps > 0 else 30.0
        self._max_people = max_people
        self._trails: list[Trail] = []
        self._recent: deque[tuple[int, Image]] = deque(maxlen=round(np.clip(QUICK_PERIOD_S * self._fps, 3, 20)) + 1)
        self._next_quick = self._next_thorough = -1

    def step(self, frame: int, image: Image) -> None:
        """Look at one frame."""
        self._recent.append((frame, image))
        active = [trail for trail in self._trails if trail.active]
        seen, lost = self._follow(frame, image, active)
        if frame >= self._next_thorough:
            self._search(frame, image, seen, THOROUGH)
            self._next_thorough = frame + max(1, round(THOROUGH_PERIOD_S * self._fps))
            self._next_quick = frame + max(1, round(QUICK_PERIOD_S * self._fps))
        elif frame >= self._next_quick or lost:
            self._search(frame, image, seen, QUICK)
            self._next_quick = frame + max(1, round(QUICK_PERIOD_S * self._fps))

    def finish(self, start: int, end: int) -> ScenePeople:
        """All tracks of the scene [start, end)."""
        shortest = min(MIN_TRACK_S * self._fps, 0.5 * (end - start))
        tracks = [trail.finished() for trail in self._trails if len(trail.rows) >= shortest]
        tracks.sort(key=lambda t: -float(((t.bbox[:, 2:] - t.bbox[:, :2]).prod(axis=1)).sum()))
        return ScenePeople(start, end, tuple(tracks))

    def _follow(self, frame: int, image: Image, active: list[Trail]) -> tuple[list[Observation], bool]:
        seen: list[Observation] = []
        lost = False
        for trail in active:
            observation = _look(image, trail)
            if observation is not None and any(same_person(observation, other) for other in seen):
                canvas = image.copy()
                for other in seen:
                    paint_out(canvas, other)
                observation = _look(canvas, trail)
                if observation is not None and any(same_person(observation, other) for other in seen):
                    observation = None
            if observation is None:
                trail.active, lost = False, True
                continue
            trail.add(frame, observation)
            self._colour(trail, frame, image, observation)
            seen.append(observation)
        return seen, lost

    def _search(self, frame: int, image: Image, seen: list[Observation], effort: Effort) -> None:
        limit = self._max_people - len(seen)
        if limit <= 0:
            return
        for person in find_people(image, seen, effort, limit=limit):
            trail = self._resumed(frame, person)
            if trail is None:
                trail = Trail(person, frame)
                trail.add(frame, person)
                self._trails.append(trail)
                self._follow_back(frame, trail)
                trail.last, trail.last_frame = person, frame
            else:
                trail.velocity = (0.0, 0.0)
                trail.add(frame, person)
            self._colour(trail, frame, image, person)

    def _resumed(self, frame: int, person: Observation) -> Trail | None:
        """The lost trail that this person continues: near in time, place and size."""
        best, best_distance = None, 0.5
        for trail in self._trails:
            gap = (frame - trail.last_frame) / self._fps
            if trail.active or not 0 < gap < 1.0:
                continue
            side = trail.last.next_region.side
            there = person.next_region
            distance = np.hypot(there.x - trail.last.next_region.x, there.y - trail.last.next_region.y) / side
            if distance < best_distance and 0.6 < there.side / side < 1.6:
                best, best_distance = trail, distance
        if best is not None:
            best.active = True
        return best

    def _follow_back(self, frame: int, trail: Trail) -> None:
        for earlier, image in reversed(self._recent):
            if earlier >= frame:
                continue
            observation = _look(image, trail)
            if observation is None or any(
                other is not trail and earlier in other.rows and _covers(other.rows[earlier][2], observation.bbox)
                for other in self._trails
            ):
                break
            trail.add(earlier, observation)
        trail.velocity = (-trail.velocity[0], -trail.velocity[1])

    def _colour(self, trail: Trail, frame: int, image: Image, seen: Observation) -> None:
        if not trail.colours or frame - max(trail.colours) >= HISTOGRAM_PERIOD_S * self._fps:
            trail.colours[frame] = clothing_histogram(image, seen).astype(np.float32)


def _covers(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(box_overlaps(a[None], b[None])[0, 0] > 0.6)


def _look(image: Image, trail: Trail) -> Observation | None:
    """The trail's person in a neighbouring frame; a crop that jumped or changed size is looked at again."""
    region = trail.predicted()
    frame_size = (image.shape[1], image.shape[0])
    answer = locate(image, region)
    if answer.next_region.outlier_of(region, shift=0.12, ratio=1.3):
        answer = locate(image, answer.next_region)
        if answer.next_region.outlier_of(region, shift=0.35, ratio=1.6):
            return None
    return observe(answer, frame_size)


def track_people(
    frames: Iterable[tuple[int, Image]], *, start: int, end: int, fps: float, size: tuple[int, int], max_people: int
) -> ScenePeople:
    """Everybody in the frames [start, end) of one scene.

    Pictures may be smaller than the source (`size` is its width and height): results are in source pixels.
    """
    tracker = SceneTracker(fps=fps, max_people=max_people)
    scale = np.ones(2)
    for frame, image in frames:
        scale = np.array(size) / (image.shape[1], image.shape[0])
        tracker.step(frame, image)
    return _in_source_pixels(tracker.finish(start, end), scale)


def _in_source_pixels(people: ScenePeople, scale: np.ndarray) -> ScenePeople:
    if (scale == 1).all():
        return people
    tracks = tuple(
        replace(
            track,
            keypoints2d=(track.keypoints2d * [*scale, 1]).astype(np.float32),
            bbox=(track.bbox * [*scale, *scale]).astype(np.float32),
            mask_affine=(track.mask_affine * scale[:, None]).astype(np.float32),
        )
        for track in people.tracks
    )
    return replace(people, tracks=tracks)
