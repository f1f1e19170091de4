"""Following everybody through one scene: a frame's crop comes from the last frame's landmarks, a search finds the rest.

Frames come once, in order; the last few are kept, so that a person found late is followed back to where he appeared.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from humanmm.models.perception.clothing import clothing_histogram, colour_distance
from humanmm.models.perception.linking import joined, untangled
from humanmm.models.perception.networks import Landmarks, box_overlaps, detect, locate
from humanmm.models.perception.observation import Observation, averaged, observe, similarity
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.perception.search import (
    MAX_COVERED,
    covered_share,
    find_people,
    paint_out,
    places_to_look,
    same_person,
    settle,
)
from humanmm.models.perception.sides import side_vote
from humanmm.models.perception.trail import Trail
from humanmm.models.records.tracks import PersonTrack, ScenePeople

SEARCH_PERIOD_S = 0.33
THOROUGH_PERIOD_S = 1.0
"""While nobody is seen, or somebody was lost, all tiles of the frame are searched this often; else a few at a time."""
LOST_S = 3.0
KEPT_S, MAX_KEPT_FRAMES = 0.7, 20
"""How far back a person found late is followed."""
COLOUR_PERIOD_S = 0.2
PATIENCE_S = 0.7
"""How long a person who is not seen is looked for where he would be."""
LOCAL_SEARCH_S = 0.1
CAREFUL_FRAMES = 5
"""At both ends of a scene every crop is looked at twice: joining shots rests on these frames."""
SIDE_LOOK_S = 0.1
LEANING_RAD, LYING_RAD = 0.17, 1.05
"""A crop turned by an angle between these gets a second, upright look now and then, to tell left from right."""
OTHER_COLOURS = 0.6
"""Hellinger distance at which whoever is found in a lost person's place is somebody else."""
MISSING_HANDICAP = 0.3
"""Against taking a person from a trail that has just seen him."""
TENURE_BONUS = 0.3
"""For a trail that has followed the person for a second or more."""
MIN_TRACK_S, MIN_TRACK_CONFIDENCE = 0.25, 0.5


class SceneTracker:
    """State of one scene; `step` takes its frames in order, `finish` gives the tracks."""

    def __init__(self, *, start: int, end: int, fps: float, max_people: int) -> None:
        self._start, self._end = start, end
        self._fps = fps if fps > 0 else 30.0
        self._max_people = max_people
        self._trails: list[Trail] = []
        self._recent: deque[tuple[int, Picture]] = deque(maxlen=self._frames(KEPT_S, least=3, most=MAX_KEPT_FRAMES) + 1)
        self._searches = 0

    def _frames(self, seconds: float, *, least: int = 1, most: int = 1 << 30) -> int:
        return int(np.clip(round(seconds * self._fps), least, most))

    def step(self, frame: int, image: Picture) -> None:
        """Look at one frame."""
        self._recent.append((frame, image))
        seen = self._follow(frame, image)
        if (frame - self._start) % self._frames(SEARCH_PERIOD_S) == 0:
            self._search(frame, image, seen)

    def finish(self) -> ScenePeople:
        """All tracks of the scene, largest first."""
        shortest = min(MIN_TRACK_S * self._fps, 0.5 * (self._end - self._start))
        people = joined(untangled(self._trails), self._fps)
        tracks = [trail.finished(self._fps) for trail in people if len(trail.rows) >= shortest]
        tracks = [track for track in tracks if track.confidence.mean() >= MIN_TRACK_CONFIDENCE]
        tracks.sort(key=lambda t: -float((t.bbox[:, 2:] - t.bbox[:, :2]).prod(axis=1).sum()))
        return ScenePeople(self._start, self._end, tuple(tracks))

    def _follow(self, frame: int, image: Picture) -> list[Observation]:
        """Look for everybody known, nearest first (lowest in the picture): the others may be hidden behind them."""
        seen: dict[int, Observation] = {}
        order = [k for k, trail in enumerate(self._trails) if trail.active]
        order.sort(key=lambda k: -self._trails[k].last.bbox[3])
        for k in order:
            trail = self._trails[k]
            found = self._look_behind(frame, image, trail, list(seen.values()))
            rival = next((r for r in seen if found is not None and same_person(found[0], seen[r])), None)
            if rival is not None and found is not None:
                if self._claim(image, trail, found[0]) <= self._claim(image, self._trails[rival], found[0]):
                    found = None
                else:
                    del seen[rival]
                    self._forget(rival, frame)
            if found is None:
                trail.missing += 1
                trail.active = trail.missing <= PATIENCE_S * self._fps
                continue
            trail.add(frame, *found)
            self._note_colours(trail, frame, image)
            seen[k] = found[0]
        return list(seen.values())

    def _forget(self, number: int, frame: int) -> None:
        """Take back a frame's observation from a trail that lost it to a better claim."""
        trail = self._trails[number]
        trail.rows.pop(frame, None)
        trail.colours.pop(frame, None)
        trail.missing += 1

    def _look_behind(
        self, frame: int, image: Picture, trail: Trail, nearer: list[Observation]
    ) -> tuple[Observation, float] | None:
        """The trail's person and a vote on his sides; people nearer than him are painted out where they overlap."""
        region = trail.predicted()
        half = 0.35 * region.side
        box = np.array([region.x - half, region.y - half, region.x + half, region.y + half])
        hiding = [other for other in nearer if box_overlaps(box[None], other.bbox[None])[0, 0] > 0.1]
        canvas, painted = image, np.zeros((image.height, image.width) if hiding else (1, 1), np.uint8)
        if hiding:
            canvas = image.copy()
            for other in hiding:
                paint_out(canvas, other, painted)
        found = self._look(frame, canvas, trail, region)
        if hiding and found is not None and covered_share(painted, found[0]) > MAX_COVERED:
            found = None
        if not trail.missing:
            return found or (self._look(frame, image, trail, region) if hiding else None)
        if found is None and trail.missing % self._frames(LOCAL_SEARCH_S) == 0:
            for detection in detect(canvas, Region(region.x, region.y, 1.8 * region.side)):
                person = settle(canvas, detection.region)
                if person is not None and not person.region.outlier_of(region, shift=0.6, ratio=1.6):
                    found = person, 0.0
                    break
        colours = trail.mean_colours()
        if found is None or colours is None:
            return found
        clothes = colour_distance(clothing_histogram(image, found[0]), colours)
        return found if clothes <= OTHER_COLOURS else None

    def _look(self, frame: int, image: Picture, trail: Trail, region: Region) -> tuple[Observation, float] | None:
        """The person in a region and a vote on his sides; a crop that jumped or changed size is looked at again."""
        answer = locate(image, region)
        if answer.next_region.outlier_of(region, shift=0.12, ratio=1.3):
            answer = locate(image, answer.next_region)
            if answer.next_region.outlier_of(region, shift=0.35, ratio=1.6):
                return None
        careful = frame - self._start < CAREFUL_FRAMES or self._end - frame <= CAREFUL_FRAMES
        if careful:
            answer = _second_look(image, answer)
        seen = observe(answer, image.size)
        if seen is None:
            return None
        vote = 0.0
        if LEANING_RAD < abs(seen.region.angle) < LYING_RAD and (careful or frame % self._frames(SIDE_LOOK_S) == 0):
            upright = locate(image, replace(seen.region, angle=0.0))
            vote = side_vote(seen.keypoints, upright.keypoints, seen.region.side)
        return seen, vote

    def _claim(self, image: Picture, trail: Trail, seen: Observation) -> float:
        """How well an observation continues a trail, by place, pose and clothes."""
        place = similarity(trail.predicted_keypoints(), seen.keypoints, seen.region.side)
        colours = trail.mean_colours()
        clothes = colour_distance(clothing_histogram(image, seen), colours) if colours is not None else 0.5
        tenure = min(1.0, len(trail.rows) / self._fps)
        return place - clothes + TENURE_BONUS * tenure - (MISSING_HANDICAP if trail.missing else 0.0)

    def _search(self, frame: int, image: Picture, seen: list[Observation]) -> None:
        limit = self._max_people - len(seen)
        if limit <= 0:
            return
        first = self._searches == 0
        lost = any(0 < frame - trail.last_frame < LOST_S * self._fps for trail in self._trails)
        due = self._searches % round(THOROUGH_PERIOD_S / SEARCH_PERIOD_S) == 0
        thorough = first or (due and (lost or not seen))
        places = places_to_look(image, self._searches, thorough=thorough)
        self._searches += 1
        for person in find_people(image, seen, places, upright=first, limit=limit):
            trail = self._resumed(frame, image, person)
            if trail is None:
                trail = Trail(person, frame)
                self._trails.append(trail)
            trail.velocity = (0.0, 0.0)
            trail.add(frame, person)
            self._note_colours(trail, frame, image)
            self._follow_back(frame, trail)

    def _resumed(self, frame: int, image: Picture, person: Observation) -> Trail | None:
        """The lost trail that this person continues: near in time, place, size and clothes."""
        best, least = None, 1.0
        for trail in self._trails:
            gap = (frame - trail.last_frame) / self._fps
            if frame in trail.rows or not 0 < gap < 1.0:
                continue
            here, there = trail.last.next_region, person.next_region
            distance = float(np.hypot(there.x - here.x, there.y - here.y)) / here.side
            colours = trail.mean_colours()
            clothes = 0.0 if colours is None else colour_distance(clothing_histogram(image, person), colours)
            if clothes < OTHER_COLOURS and 0.6 < there.side / here.side < 1.6 and distance + clothes < least:
                best, least = trail, distance + clothes
        return best

    def _follow_back(self, frame: int, trail: Trail) -> None:
        """Fill the frames before a find, as far as they are kept and the person can be seen in them."""
        found = trail.last
        for earlier, image in reversed(self._recent):
            if earlier >= frame:
                continue
            if earlier in trail.rows:
                break
            others = [t.rows[earlier] for t in self._trails if t is not trail and earlier in t.rows]
            looked = self._look(earlier, image, trail, trail.predicted())
            if looked is None or any(
                similarity(row.keypoints, looked[0].keypoints, min(row.side, looked[0].region.side)) > 0.5
                for row in others
            ):
                break
            trail.add(earlier, *looked)
        backwards = trail.velocity
        trail.last, trail.last_frame, trail.velocity = found, frame, (-backwards[0], -backwards[1])

    def _note_colours(self, trail: Trail, frame: int, image: Picture) -> None:
        if not trail.colours or frame - max(trail.colours) >= COLOUR_PERIOD_S * self._fps:
            trail.colours[frame] = clothing_histogram(image, trail.last).astype(np.float32)


def _second_look(image: Picture, answer: Landmarks) -> Landmarks:
    """The mean of an answer and of the mirrored crop's, where the two agree on left and right."""
    other = locate(image, answer.region, mirrored=True)
    agree = side_vote(answer.keypoints, other.keypoints, answer.region.side) > -0.5
    return averaged(answer, other) if agree and other.presence > 0.5 else answer


def track_people(
    frames: Iterable[tuple[int, Picture]], *, start: int, end: int, fps: float, size: tuple[int, int], max_people: int
) -> ScenePeople:
    """Everybody in the frames [start, end) of one scene.

    Pictures may be smaller than the source (`size` is its width and height): results are in source pixels.
    """
    tracker = SceneTracker(start=start, end=end, fps=fps, max_people=max_people)
    scale = np.ones(2)
    for frame, image in frames:
        scale = np.array(size) / image.size
        tracker.step(frame, image)
    return _in_source_pixels(tracker.finish(), scale)


def _in_source_pixels(people: ScenePeople, scale: np.ndarray) -> ScenePeople:
    if (scale == 1).all():
        return people

    def scaled(track: PersonTrack) -> PersonTrack:
        return replace(
            track,
            keypoints2d=(track.keypoints2d * [*scale, 1]).astype(np.float32),
            bbox=(track.bbox * [*scale, *scale]).astype(np.float32),
            mask_affine=(track.mask_affine * scale[:, None]).astype(np.float32),
        )

    return replace(people, tracks=tuple(scaled(track) for track in people.tracks))
