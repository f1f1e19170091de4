"""Following everybody through one scene: a frame's crop comes from the last frame's landmarks, a search finds the rest.

Frames come once, in order; the last few are kept, so that a person found late is followed back to where he appeared.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from itertools import compress

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.clothing import clothing_histogram, colour_distance
from humanmm.models.perception.hands.follow import due_frames
from humanmm.models.perception.interfaces import Detection, Landmarks, Networks, PoseNetwork
from humanmm.models.perception.keypoints.fusion import BEST
from humanmm.models.perception.observation import Observation, averaged, inside, observe, similarity
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region
from humanmm.models.perception.tracking.linking import joined, untangled
from humanmm.models.perception.tracking.overlooked import Overlooked
from humanmm.models.perception.tracking.painting import covered_fraction, without
from humanmm.models.perception.tracking.search import (
    MAX_COVERED,
    detections,
    find_people,
    lies_on,
    same_person,
    settle,
)
from humanmm.models.perception.tracking.sides import side_vote
from humanmm.models.perception.tracking.track_builder import (
    MIN_TRACK_S,
    TrackBuilder,
    largest_first,
    shortest_track_s,
)
from humanmm.models.records import landmarks
from humanmm.models.records.shots import DOUBTFUL, Unfollowed
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frame_times import elapsed_s, nearest_frame, sampled_every, shown_s

Array = np.ndarray

SEARCH_PERIOD_S, FEWEST_SEARCHES = 0.33, 4
"""Everybody is looked for about so often, and at least so many times in a scene."""
CLOSER_EVERY = 3
"""Every third search looks for people behind those seen, and if nobody is seen or somebody was lost, also at enlarged
parts of the frame."""
LOST_S = 3.0
KEPT_S, MIN_KEPT_FRAMES, MAX_KEPT_FRAMES = 0.7, 3, 20
"""How far back a person found late is followed."""
PATIENCE_S = 0.7
"""How long a person who is not seen is looked for where he would be."""
RESUMED_S = 1.0
"""A person found within this time of his loss goes on in his track."""
LOCAL_SEARCH_S = 0.1
CAREFUL_FRAMES = 5
"""At both ends of a scene every crop is looked at twice: joining shots rests on these frames."""
OTHER_COLOURS = 0.6
"""Hellinger distance at which whoever is found in a lost person's place is somebody else."""
MISSING_HANDICAP = 0.3
"""Against taking a person from a track that has just seen him."""
TENURE_BONUS = 0.3
"""For a track that has followed the person for TENURE_S or more."""
TENURE_S = 1.0
STEP_PER_S, LONGEST_STEP = 3.0, 0.3
"""How far an upper body gets between two frames from where it is expected, of the height."""


class SceneTracker:
    """State of one scene [start, end); `step` takes its frames in order, `finish` gives the tracks.

    `time_s` holds the presentation times of all frames of the video.
    """

    def __init__(
        self,
        *,
        start: int,
        end: int,
        time_s: Float[Array, " F"],
        max_people: int,
        networks: Networks,
        hands: bool = False,
    ) -> None:
        self._networks = networks
        self._start, self._end = start, end
        self._time_s = time_s
        self._max_people = max_people
        self._tracks: list[TrackBuilder] = []
        self._recent: deque[tuple[int, Picture]] = deque()
        self._size = (0, 0)
        self._search_due = search_due(time_s[start:end])
        self._hands_due = due_frames(time_s[:end]) if hands else None
        self._searches = 0
        self._overlooked = Overlooked(time_s, max_people)

    def step(self, frame: int, image: Picture) -> None:
        """Look at one frame."""
        self._size = image.size
        self._keep(frame, image)
        seen = self._follow(frame, image)
        if self._search_due[frame - self._start]:
            self._search(frame, image, seen)

    def finish(self) -> ScenePeople:
        """All tracks of the scene, largest first."""
        shortest_s = shortest_track_s(self._time_s, (self._start, self._end))
        people = joined(untangled(self._tracks), self._size)
        tracks = largest_first(finished(track) for track in people if track.seen_s >= shortest_s)
        return ScenePeople(self._start, self._end, tracks, unfollowed=self._overlooked.finished())

    def _keep(self, frame: int, image: Picture) -> None:
        """Keep a frame's picture, and forget those too old to follow anybody back to."""
        self._recent.append((frame, image))
        oldest = nearest_frame(self._time_s, self._time_s[frame] - KEPT_S)
        oldest = max(min(oldest, frame - MIN_KEPT_FRAMES), frame - MAX_KEPT_FRAMES)
        while self._recent[0][0] < oldest:
            self._recent.popleft()

    def _follow(self, frame: int, image: Picture) -> list[Observation]:
        """Look for everybody known, nearest first (lowest in the picture): the others may be hidden behind them."""
        seen: dict[int, Observation] = {}
        order = [k for k, track in enumerate(self._tracks) if track.active]
        order.sort(key=lambda k: -self._tracks[k].last.bbox[3])
        for k in order:
            track = self._tracks[k]
            found = self._look_behind(frame, image, track, list(seen.values()))
            rival = next((r for r in seen if found is not None and same_person(found, seen[r])), None)
            if rival is not None and found is not None:
                claims = [self._claim(frame, image, one, found) for one in (track, self._tracks[rival])]
                if claims[0] <= claims[1]:
                    found = None
                else:
                    del seen[rival]
                    self._forget(rival, frame)
            if found is None:
                if track.lost_since is None:
                    track.lost_since = frame
                track.active = elapsed_s(self._time_s, track.lost_since - 1, frame) <= PATIENCE_S
                continue
            track.add(frame, found)
            track.note_colours(frame, image)
            track.note_own_motion(frame, image)
            track.look_at_hands(frame, image, self._hands_due)
            seen[k] = found
        return list(seen.values())

    def _forget(self, number: int, frame: int) -> None:
        """Take back a frame's observation from a track that lost it to a better claim.

        It goes on from the other's place: put back to its own, people fell into more tracks (docs/accuracy.md).
        """
        track = self._tracks[number]
        track.rows.pop(frame, None)
        track.forget_appearance(frame)
        track.hands.pop(frame, None)
        track.lost_since = frame

    def _look_behind(
        self, frame: int, image: Picture, track: TrackBuilder, nearer: list[Observation]
    ) -> Observation | None:
        """The track's person; people nearer are painted out where they overlap."""
        region = track.predicted(frame)
        half = 0.35 * region.side
        box = np.array([region.x - half, region.y - half, region.x + half, region.y + half])
        hiding = [other for other in nearer if box_iou(box, other.bbox) > 0.1]
        if not hiding:
            found = self._look(frame, image, region, track)
        else:
            canvas, painted = without(image, hiding, spared=track.predicted_keypoints(frame))
            found = self._look(frame, canvas, region, track)
            if found is not None and covered_fraction(painted, found) > MAX_COVERED:
                found = None
        if track.lost_since is None:
            return found or (self._look(frame, image, region, track) if hiding else None)
        if found is None and self._local_search_due(track.lost_since, frame):
            found = self._found_again(image, region, hiding)
        colours = track.mean_colours()
        if found is None or colours is None:
            return found
        clothes = colour_distance(clothing_histogram(image, found), colours)
        return found if clothes <= OTHER_COLOURS else None

    def _found_again(self, image: Picture, region: Region, hiding: list[Observation]) -> Observation | None:
        """Who the detector sees near a region when all who may hide him are painted out."""
        canvas = without(image, hiding)[0] if hiding else image
        for detection in self._networks.detect(canvas, Region(region.x, region.y, 1.8 * region.side)):
            person = settle(self._networks.locate, canvas, detection)
            if person is not None and not person.region.outlier_of(region, shift=0.6, ratio=1.6):
                return person
        return None

    def _local_search_due(self, lost_since: int, frame: int) -> bool:
        since = sampled_every(self._time_s[lost_since : frame + 2], LOCAL_SEARCH_S)
        return frame > lost_since and bool(since[frame - lost_since])

    def _look(self, frame: int, image: Picture, region: Region, track: TrackBuilder) -> Observation | None:
        """The track's person in a region; a crop that jumped or grew is looked at again.

        Whose legs are out of the frame must be where he was: the crop of an upper body hangs on hips that are guessed,
        and slides to whoever stands beside.
        """
        output = self._networks.locate(image, region)
        if output.next_region.outlier_of(region, shift=0.12, ratio=1.3):
            output = self._networks.locate(image, output.next_region)
            if output.next_region.outlier_of(region, shift=0.35, ratio=1.6):
                return None
        careful = frame - self._start < CAREFUL_FRAMES or self._end - frame <= CAREFUL_FRAMES
        if careful:
            output = _second_look(self._networks.locate, image, output)
        seen = observe(output, image.size)
        if seen is None:
            return None
        if any(_is_cut_above_knees(one, image) for one in (seen, track.last)) and not _goes_on(track, frame, seen):
            return None
        return seen

    def _claim(self, frame: int, image: Picture, track: TrackBuilder, seen: Observation) -> float:
        """How well an observation in a frame continues a track, by place, pose and clothes."""
        place = similarity(track.predicted_keypoints(frame), seen.keypoints, seen.region.side)
        colours = track.mean_colours()
        clothes = colour_distance(clothing_histogram(image, seen), colours) if colours is not None else 0.5
        tenure = min(1.0, track.seen_s / TENURE_S)
        return place - clothes + TENURE_BONUS * tenure - (0.0 if track.lost_since is None else MISSING_HANDICAP)

    def _search(self, frame: int, image: Picture, seen: list[Observation]) -> None:
        """Ask the detector for everybody: who is new is followed from here, who is known gets its testimony."""
        detected = detections(self._networks.detect, image)
        present = [track for track in self._tracks if frame in track.rows]
        of_each = [[lies_on(track.last, one) for one in detected] for track in present]
        for known, is_his in zip(present, of_each, strict=True):
            his = list(compress(detected, is_his))
            known.detector_scores[frame] = max((one.score for one in his), default=0.0)
            known.note_detected_sides(frame, his)
        self._find_new(frame, image, seen, detected)
        followed = [track.last for track in self._tracks if frame in track.rows]
        self._overlooked.note(frame, detected, followed)

    def _find_new(self, frame: int, image: Picture, seen: list[Observation], detected: list[Detection]) -> None:
        """Follow whoever is in the picture and known by no track. Who is hidden for a moment counts as one of those who
        are followed; he alone may be found anew when they are as many as may be."""
        limit = self._max_people - len(seen)
        if limit <= 0:
            return
        lost = any(0 < elapsed_s(self._time_s, track.last_frame, frame) < LOST_S for track in self._tracks)
        closer = self._searches % CLOSER_EVERY == 0
        self._searches += 1
        people = find_people(
            self._networks, image, seen, detected,
            behind=lost or closer, closer=closer and (lost or not seen or self._searches == 1), limit=limit,
        )  # fmt: skip
        for person in people:
            track = self._resumed(frame, image, person)
            followed = sum(one.active for one in self._tracks)
            if followed >= self._max_people and (track is None or not track.active):
                continue
            if track is None:
                track = TrackBuilder(self._time_s, person, frame)
                self._tracks.append(track)
            track.add(frame, person)
            track.note_colours(frame, image)
            track.note_own_motion(frame, image)
            track.look_at_hands(frame, image, self._hands_due)
            self._follow_back(frame, track)

    def _resumed(self, frame: int, image: Picture, person: Observation) -> TrackBuilder | None:
        """The lost track that this person continues: near in time, place, size and clothes."""
        best, least = None, 1.0
        for track in self._tracks:
            gap_s = elapsed_s(self._time_s, track.last_frame, frame)
            if frame in track.rows or not 0 < gap_s < RESUMED_S:
                continue
            here, there = track.last.next_region, person.next_region
            distance = float(np.hypot(there.x - here.x, there.y - here.y)) / here.side
            colours = track.mean_colours()
            clothes = 0.0 if colours is None else colour_distance(clothing_histogram(image, person), colours)
            if clothes < OTHER_COLOURS and 0.6 < there.side / here.side < 1.6 and distance + clothes < least:
                best, least = track, distance + clothes
        return best

    def _follow_back(self, frame: int, track: TrackBuilder) -> None:
        """Fill the frames before a find, as far as they are kept and the person can be seen in them."""
        found = track.last
        for earlier, image in reversed(self._recent):
            if earlier >= frame:
                continue
            if earlier in track.rows:
                break
            others = [t.rows[earlier] for t in self._tracks if t is not track and earlier in t.rows]
            looked = self._look(earlier, image, track.predicted(earlier), track)
            if looked is None or any(
                similarity(row.keypoints, looked.keypoints, min(row.side, looked.region.side)) > 0.5 for row in others
            ):
                break
            track.add(earlier, looked)
            track.look_at_hands(earlier, image, self._hands_due)
        track.last, track.last_frame = found, frame


def search_due(time_s: Float[Array, " F"]) -> Bool[Array, " F"]:
    """In which frames of a scene everybody is looked for: about every SEARCH_PERIOD_S, FEWEST_SEARCHES times or more,
    and in the last one, from which whoever has just come is followed back."""
    scene_s = float(shown_s(time_s, np.arange(len(time_s))).sum())
    due = sampled_every(time_s, min(SEARCH_PERIOD_S, scene_s / FEWEST_SEARCHES))
    due[-1] = True
    return due


def finished(track: TrackBuilder) -> PersonTrack:
    """The finished track, or only where the detector sees somebody, if he is credible there and not as a whole."""
    part = track.where_detected()
    whole = track.finished()
    if part is None or part.seen_s < MIN_TRACK_S or not part.colours or whole.probability >= DOUBTFUL:
        return whole
    detected = part.finished()
    return detected if detected.probability >= DOUBTFUL else whole


def _is_cut_above_knees(seen: Observation, image: Picture) -> bool:
    """True where the frame ends above somebody's knees."""
    legs = [*landmarks.KNEES, *landmarks.ANKLES]
    return not inside(seen.keypoints[legs, :2], image.size).any()


def _goes_on(track: TrackBuilder, frame: int, seen: Observation) -> bool:
    """True where what is seen of somebody lies where his track has it."""
    reach = min(STEP_PER_S * abs(elapsed_s(track.time_s, track.last_frame, frame)), LONGEST_STEP)
    expected = track.predicted_keypoints(frame)
    both = (expected[:, 2] > landmarks.VISIBLE) & (seen.keypoints[:, 2] > landmarks.VISIBLE)
    apart = np.linalg.norm(expected[both, :2] - seen.keypoints[both, :2], axis=1)
    return bool(both.any() and np.median(apart) < reach * HEIGHT_OF_SIDE * seen.region.side)


def _second_look(locate: PoseNetwork, image: Picture, output: Landmarks) -> Landmarks:
    """The mean of an output and of the mirrored crop's, where the two agree on left and right."""
    other = locate(image, output.region, mirrored=True)
    agree = side_vote(output.keypoints, other.keypoints, output.region.side) > -0.5
    return averaged(output, other) if agree and other.presence > 0.5 else output


def track_pictures(
    frames: Iterable[tuple[int, Picture]],
    *,
    start: int,
    end: int,
    time_s: Float[Array, " F"],
    size: tuple[int, int],
    max_people: int,
    networks: Networks = BEST,
    hands: bool = False,
) -> ScenePeople:
    """Everybody in the frames [start, end) of one scene, and their hands if asked for.

    `time_s` holds the presentation times of all frames of the video. Pictures may be smaller than the source (`size` is
    its width and height): results are in source pixels.
    """
    tracker = SceneTracker(start=start, end=end, time_s=time_s, max_people=max_people, networks=networks, hands=hands)
    scale = np.ones(2)
    for frame, image in frames:
        scale = np.array(size) / image.size
        tracker.step(frame, image)
    return in_source_pixels(tracker.finish(), scale)


def in_source_pixels(people: ScenePeople, scale: np.ndarray) -> ScenePeople:
    """What was found in smaller pictures, in pixels of the video: `scale` (2,) is its sides over theirs."""
    if (scale == 1).all():
        return people

    def scaled(track: PersonTrack) -> PersonTrack:
        return replace(
            track,
            keypoints2d=(track.keypoints2d * [*scale, 1]).astype(np.float32),
            keypoint_sigma=None if track.keypoint_sigma is None else track.keypoint_sigma * np.float32(scale.mean()),
            bbox=(track.bbox * [*scale, *scale]).astype(np.float32),
            mask_affine=(track.mask_affine * scale[:, None]).astype(np.float32),
            hands=track.hands.scaled(scale) if track.hands is not None else None,
        )

    def enlarged(one: Unfollowed) -> Unfollowed:
        x0, y0, x1, y1 = (np.array(one.box) * [*scale, *scale]).tolist()
        return replace(one, box=(x0, y0, x1, y1))

    return replace(
        people,
        tracks=tuple(scaled(track) for track in people.tracks),
        unfollowed=tuple(enlarged(one) for one in people.unfollowed),
    )
