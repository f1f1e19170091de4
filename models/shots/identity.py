"""Who is who across cuts: one number for one human being (what the paper's single-person method leaves open).

Every shot × track is a sighting. Shots are taken in order, and each shot's sightings are matched one to one with the
people known so far (Hungarian); a sighting that fits nobody better than chance starts a new person. The score is a sum
of log-odds, positive for "the same": clothing colours carry most; the 3D pose on both sides of a cut, compared up to
any rotation because the camera's is not known yet, adds a little; the detector's bone lengths hardly differ between
people (within 5 % of its mean person on bodies that differ by 20 %) and are not used.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment
from scipy.special import expit, logit

from humanmm.models.body.body24 import JOINT_NAMES, Body, load_body
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.perception.clothing import colour_distance, mean_colours
from humanmm.models.records import landmarks
from humanmm.models.records.shots import DOUBTFUL, Appearance, Person, Shot, TrackPart
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shots.left_right_swaps import KnownSides
from humanmm.models.video.frame_times import ROUNDING_S, shown_s

SAME_COLOURS = 0.62
"""Hellinger distance of two clothing histograms at which the same and another person are equally likely."""
COLOUR_SPREAD, COLOUR_LIMIT = 0.06, 4.0
SAME_POSE_M, POSE_SPREAD_M, POSE_LIMIT = 0.2, 0.1, 1.0
NEIGHBOUR_ODDS = 0.5
"""Log-odds for being the same across a cut before anything is seen: a cut mostly shows the same scene."""
CUT_GAP_FRAMES = 3
"""A pose this many frames from a cut still counts as the pose at the cut."""
POSE_FRAMES = 5

MIN_SEEN_S = 0.3
BONE_NOISE = 0.1
"""Standard deviation of a bone's logarithmic length in the detector's 3D landmarks, mostly bias."""
SCALE_NOISE = 0.3
"""Standard deviation of the common factor (its logarithm) of all bones of somebody whose height the user gave."""
BONE_BIAS = np.array([-0.08, -0.08, -0.07, -0.16, -0.09, -0.03, 0.01])
"""Logarithm of the detector's bone lengths over body24's, for `bone_lengths` of one and the same person: its landmarks
lie elsewhere than the joints (measured on renderings of 300 random bodies; real clips agree)."""


@dataclass(frozen=True)
class GivenFacts:
    """What the user says of somebody."""

    main: bool = False
    """He is person 0, and a person for sure."""
    height_m: float | None = None
    sides: tuple[KnownSides, ...] = ()
    """Frames in which his left and right are known."""


@dataclass(frozen=True)
class Candidate:
    """Everything that was seen of somebody who may be a person."""

    sightings: tuple["Sighting", ...]
    given: GivenFacts = GivenFacts()


@dataclass(frozen=True)
class Cast:
    """Everybody in the video: people by number, and for each shot who appears on which track."""

    people: tuple[Person, ...]
    appearances: tuple[tuple[Appearance, ...], ...]
    refused: tuple[float, ...] = ()
    """Probabilities of those left out as no persons, largest first."""
    given: tuple[GivenFacts, ...] = ()
    """What the user says of each of the people."""


@dataclass(frozen=True)
class Sighting:
    """One track inside one shot."""

    shot: int
    track: int
    first: Float[np.ndarray, "33 3"] | None
    """3D pose at the shot's first frame; None when not seen there."""
    last: Float[np.ndarray, "33 3"] | None
    colours: Float[np.ndarray, " bins"]
    area: float
    num_frames: int
    seen_s: float
    """How long those frames are shown."""
    log_odds: float
    """Of being a person."""
    bones: Float[np.ndarray, "frames 7"]
    """Lengths of confident frames, metres, as the pose network measures them."""
    parts: tuple[TrackPart, ...] = ()
    """As in `Appearance`."""


def matched_people(
    shots: Sequence[Shot], scenes: Sequence[ScenePeople | None], *, time_s: Float[np.ndarray, " F"]
) -> list[list[Sighting]]:
    """All sightings, those of one and the same person together; a failed scene is None.

    `time_s` holds the presentation times of all frames.
    """
    people: list[list[Sighting]] = []
    for index, shot in enumerate(shots):
        scene = scenes[shot.scene]
        tracks = scene.tracks if scene is not None else ()
        sightings = [s for k, track in enumerate(tracks) if (s := sighting(index, shot, k, track, time_s)) is not None]
        for known, new in match(people, sightings).items():
            if known < len(people):
                people[known].append(sightings[new])
            else:
                people.append([sightings[new]])
    return people


def cast_of(people: Sequence[Candidate], num_shots: int, *, min_confidence: float = 0.2) -> Cast:
    """Number the people of `num_shots` shots: the main one first, the doubtful ones last.

    Left out is who is seen for a moment only, and who is a person with a lower probability than `min_confidence`.
    """
    candidates = [
        (1.0 if p.given.main else probability(p.sightings), sum(s.area for s in p.sightings), p)
        for p in people
        if _is_long_seen(p.sightings)
    ]
    kept = [candidate for candidate in candidates if candidate[0] >= min_confidence]
    kept.sort(key=lambda candidate: (not candidate[2].given.main, candidate[0] < DOUBTFUL, -candidate[1]))
    body = load_body()
    numbered = tuple(
        Person(
            number,
            shape_from_bones(np.concatenate([s.bones for s in p.sightings]), body, height_m=p.given.height_m),
            area,
            likelihood,
        )
        for number, (likelihood, area, p) in enumerate(kept)
    )
    appearances: list[list[Appearance]] = [[] for _ in range(num_shots)]
    for number, (_, _, p) in enumerate(kept):
        for s in p.sightings:
            appearances[s.shot].append(Appearance(number, s.track, parts=s.parts))
    refused = tuple(sorted((p for p, _, _ in candidates if p < min_confidence), reverse=True))
    return Cast(numbered, tuple(map(tuple, appearances)), refused, tuple(p.given for _, _, p in kept))


def sighting(
    index: int, shot: Shot, number: int, track: PersonTrack, time_s: Float[np.ndarray, " F"]
) -> Sighting | None:
    """What one track shows of a person in one shot outside transitions; None when nothing."""
    inside = np.flatnonzero(in_intervals(track.frame, [shot.outside_transitions]))
    if not len(inside):
        return None
    confidence = track.confidence[inside].astype(np.float64)
    confident = inside[confidence >= np.median(confidence)]
    bones = bone_lengths(track.landmarks3d[confident].astype(np.float64))
    boxes = track.bbox[inside].astype(np.float64)
    return Sighting(
        shot=index,
        track=number,
        first=pose_at(track, inside[:POSE_FRAMES], shot.start, time_s),
        last=pose_at(track, inside[-POSE_FRAMES:], shot.end - 1, time_s),
        colours=_colours(track, shot),
        area=float((boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum()),
        num_frames=len(inside),
        seen_s=float(shown_s(time_s, track.frame[inside]).sum()),
        log_odds=float(logit(np.clip(track.probability, 1e-4, 1 - 1e-4))),
        bones=_in_detector_convention(bones, lifted=track.lifted),
    )


def _colours(track: PersonTrack, shot: Shot) -> Float[np.ndarray, " bins"]:
    """Mean clothing colours inside the shot; of the whole track when none were taken there."""
    inside = in_intervals(track.color_frame, [shot.outside_transitions])
    chosen = track.color_histogram[inside] if inside.any() else track.color_histogram
    return mean_colours(chosen)


def pose_at(
    track: PersonTrack, rows: np.ndarray, frame: int, time_s: Float[np.ndarray, " F"]
) -> Float[np.ndarray, "33 3"] | None:
    """The 3D landmarks of some rows carried linearly to a frame; None when the nearest row is too far from it."""
    if np.abs(track.frame[rows] - frame).min() > CUT_GAP_FRAMES:
        return None
    poses = track.landmarks3d[rows].astype(np.float64)
    if len(rows) < 3:
        return np.asarray(poses.mean(axis=0))
    offsets = time_s[track.frame[rows]] - time_s[frame]
    line = np.linalg.lstsq(np.column_stack([np.ones(len(rows)), offsets]), poses.reshape(len(rows), -1), rcond=None)[0]
    return np.asarray(line[0].reshape(-1, 3))


def match(people: Sequence[Sequence[Sighting]], sightings: Sequence[Sighting]) -> dict[int, int]:
    """Known person -> sighting of the best one-to-one matching; numbers from len(people) on are new people."""
    odds = np.array([[same_person_odds(person, new) for new in sightings] for person in people])
    odds = odds.reshape(len(people), len(sightings))
    rows, columns = linear_sum_assignment(-np.maximum(odds, 0))
    matched = {int(r): int(c) for r, c in zip(rows, columns, strict=True) if odds[r, c] > 0}
    strangers = [k for k in range(len(sightings)) if k not in matched.values()]
    return matched | {len(people) + i: k for i, k in enumerate(strangers)}


def same_person_odds(person: Sequence[Sighting], new: Sighting) -> float:
    """Log-odds that a sighting shows a known person: best colours of any of the person's shots, pose at the cut."""
    dressed = [old.colours for old in person if old.colours.any()] if new.colours.any() else []
    distance = min((colour_distance(old, new.colours) for old in dressed), default=SAME_COLOURS)  # else no evidence
    odds = float(np.clip((SAME_COLOURS - distance) / COLOUR_SPREAD, -COLOUR_LIMIT, COLOUR_LIMIT))
    before = person[-1]
    if before.shot == new.shot - 1:
        odds += NEIGHBOUR_ODDS
        if before.last is not None and new.first is not None:
            residual = pose_residual_m(before.last, new.first)
            odds += float(np.clip((SAME_POSE_M - residual) / POSE_SPREAD_M, -POSE_LIMIT, POSE_LIMIT))
    return odds


def identity_probabilities(
    shots: Sequence[Shot], scenes: Sequence[ScenePeople | None], time_s: Float[np.ndarray, " F"]
) -> dict[tuple[int, int], float]:
    """By person and shot, of every shot after the first in which anybody is seen: that he is who he is said to be.

    From the log-odds of this answer against the best other one. `scenes`: None where the detector failed.
    """
    known: dict[int, list[Sighting]] = {}
    found = {}
    for shot in shots:
        scene = scenes[shot.scene]
        seen = {
            one.person: view
            for one in shot.people
            if scene is not None
            and (view := sighting(shot.index, shot, one.track, scene.track_of(one), time_s)) is not None
        }
        if known:
            odds = {
                (person, new): same_person_odds(sightings, view)
                for person, sightings in known.items()
                for new, view in seen.items()
            }
            found.update({(new, shot.index): float(expit(_margin(new, seen, known, odds))) for new in seen})
        for person, view in seen.items():
            known.setdefault(person, []).append(view)
    return found


def _margin(
    new: int, seen: dict[int, Sighting], known: dict[int, list[Sighting]], odds: dict[tuple[int, int], float]
) -> float:
    """Log-odds of the answer for somebody in a shot against the best other one: that he is new, or somebody else, who
    would then be he if he is seen in the shot as well."""
    own = odds.get((new, new), 0.0)  # 0: nobody who was known
    others = [0.0] if new in known else []
    for person in known.keys() - {new}:
        if person in seen:
            others.append(odds[person, new] + max(0.0, odds.get((new, person), 0.0)) - odds[person, person])
        else:
            others.append(odds[person, new])
    return own - max(others, default=-np.inf)


def pose_residual_m(a: Float[np.ndarray, "33 3"], b: Float[np.ndarray, "33 3"]) -> float:
    """Root mean square distance of the limbs after the best rotation, left and right swapped or not."""
    limbs = list(landmarks.LIMBS)
    return min(_after_rotation(a[limbs], b[limbs]), _after_rotation(a[limbs], b[landmarks.SWAP][limbs]))


def _after_rotation(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> float:
    aligned = umeyama_alignment(a, b, with_scale=False, unique=False).apply(a)
    return float(np.sqrt(np.square(aligned - b).sum() / len(a)))


def _is_long_seen(person: Sequence[Sighting]) -> bool:
    return sum(s.num_frames for s in person) >= 2 and sum(s.seen_s for s in person) >= MIN_SEEN_S - ROUNDING_S


def probability(person: Sequence[Sighting]) -> float:
    """That somebody is a person, from all his tracks, each counting by its frames."""
    odds = np.average([s.log_odds for s in person], weights=[s.num_frames for s in person])
    return float(expit(odds))


def _in_detector_convention(bones: Float[np.ndarray, "frames 7"], *, lifted: bool) -> Float[np.ndarray, "frames 7"]:
    """Lifted landmarks lie where `body.landmarks` has them: their bones differ from body24's by that alone."""
    return bones * np.exp(BONE_BIAS - _lifted_bias()) if lifted else bones


@lru_cache(maxsize=1)
def _lifted_bias() -> Float[np.ndarray, " 7"]:
    """Logarithm of the average body's bones between landmarks over those between joints."""
    body, model, shape = load_body(), load_landmarks(), np.zeros(load_body().num_betas)
    points = body.rest_joints(shape)[model.joint] + model.offsets(shape)
    return np.asarray(np.log(bone_lengths(points[None])[0] / _body_bones(body, shape)))


_PAIRS = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
_JOINT_OF = {"shoulder": "Shoulder", "elbow": "Elbow", "wrist": "Wrist", "hip": "Hip", "knee": "Knee", "ankle": "Ankle"}


def bone_lengths(poses: Float[np.ndarray, "frames 33 3"]) -> Float[np.ndarray, "frames 7"]:
    """Upper arm, forearm, thigh, shank (mean of both sides), shoulders, hips, trunk of landmarks, metres."""

    def point(side: str, name: str) -> np.ndarray:
        return poses[:, landmarks.INDEX[f"{side}_{name}"]]

    return _lengths(point)


def shape_from_bones(
    bones: Float[np.ndarray, "frames 7"], body: Body, *, height_m: float | None = None
) -> Float[np.ndarray, " betas"]:
    """Shape whose bone lengths are likeliest: ridge regression of log lengths, prior N(0, 1) on every component.

    With a known height the shape stands exactly so tall; the bones then give proportions, their common factor is free
    within SCALE_NOISE.
    """
    wanted = np.log(np.median(bones, axis=0) / _body_bones(body, np.zeros(body.num_betas))) - BONE_BIAS
    step = 0.5
    jacobian = np.column_stack(
        [
            np.log(_body_bones(body, step * unit) / _body_bones(body, -step * unit)) / (2 * step)
            for unit in np.eye(body.num_betas)
        ]
    )
    trust: np.ndarray = np.eye(len(wanted)) / BONE_NOISE**2
    if height_m is not None:
        trust = np.linalg.inv(BONE_NOISE**2 * np.eye(len(wanted)) + SCALE_NOISE**2)
    normal = jacobian.T @ trust @ jacobian + np.eye(body.num_betas)
    betas = np.linalg.solve(normal, jacobian.T @ trust @ wanted)
    return np.asarray(betas if height_m is None else _as_tall(betas, normal, body, height_m), np.float32)


def _as_tall(
    betas: Float[np.ndarray, " betas"], normal: np.ndarray, body: Body, height_m: float
) -> Float[np.ndarray, " betas"]:
    """The likeliest shape of one height: Newton's steps on the constraint, each the shortest by the metric `normal`."""
    found: np.ndarray = betas
    for _ in range(20):
        missing = height_m - body.standing_height(found)
        if abs(missing) < 1e-4:
            break
        ends = [[body.standing_height(found + side * unit) for side in (-0.05, 0.05)] for unit in np.eye(len(found))]
        slope = np.diff(ends, axis=1)[:, 0] / 0.1
        direction = np.linalg.solve(normal, slope)
        found = found + direction * missing / (slope @ direction)
    return found


def _body_bones(body: Body, betas: Float[np.ndarray, " betas"]) -> Float[np.ndarray, " 7"]:
    joints = body.rest_joints(betas)

    def point(side: str, name: str) -> np.ndarray:
        return np.asarray(joints[None, JOINT_NAMES.index(f"{side[0].upper()}_{_JOINT_OF[name]}")])

    return np.asarray(_lengths(point)[0])


def _lengths(point: Callable[[str, str], np.ndarray]) -> Float[np.ndarray, "frames 7"]:
    def length(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(a - b, axis=-1))

    sides = ("left", "right")
    limbs = [np.mean([length(point(side, a), point(side, b)) for side in sides], axis=0) for a, b in _PAIRS]
    shoulders, hips = [[point(side, name) for side in sides] for name in ("shoulder", "hip")]
    trunk = length((shoulders[0] + shoulders[1]) / 2, (hips[0] + hips[1]) / 2)
    return np.stack([*limbs, length(*shoulders), length(*hips), trunk], axis=-1)
