"""Whether a recovered clip is what somebody saw in it: one verdict for each expectation of the golden set.

Bodies are compared where the recovered camera sees them, so that a person counts as found only if his body lies there.
Whoever is delivered as doubtful counts as not delivered, and so do frames that are not observed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from humanmm.models.benchmark.expectations import ExpectedCut, ExpectedPerson, GoldenClip
from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.evaluation.overlay import in_picture, landmarks_in_world, standing_height_px
from humanmm.models.geometry.boxes import box_iou
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.camera import SOURCES
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.models.records.shots import DOUBTFUL

Array = np.ndarray

LEAST_IOU = 0.3
"""A body whose box overlaps the box of a person less than this does not lie on him: boxes by eye are rough."""
NEAR_IOU = 0.1
"""A body that lies on nobody, but overlaps the box of somebody without a body this much, is a bad one of his and not
elsewhere: it fails once."""
IN_CROWD = 0.5
"""Share of a body's box inside the box of a crowd from which it is one of them."""
ELSEWHERE = 0.02
"""Frames with somebody where nobody is, as a fraction of the clip's, that pass: a flicker."""
ONE_NUMBER = 0.95
"""Share of the frames with a person that his commonest number must have."""
FEW = 0.1
"""Of two people's frames, how many may share a number before they count as one person."""
CUT_FRAMES, GRADUAL_FRAMES = 2, 3
"""How far a cut may be from a hard cut, and outside a gradual transition."""
FACING_DEG = 60.0
"""How far a direction may be from one of the eight that the eye distinguishes."""
POINT_PCT = 5.0
"""How far a landmark may be from its place, percent of the standing height: half a hand's breadth of a man, and half
for the eye's error."""
UPRIGHT_DEG = 20.0
"""How far from the vertical the trunk of somebody may be who stands upright."""

_DIRECTIONS = {
    "towards": (0, -1), "towards left": (-1, -1), "left": (-1, 0), "away left": (-1, 1),
    "away": (0, 1), "away right": (1, 1), "right": (1, 0), "towards right": (1, -1),
}  # fmt: skip
"""Right and forward, in the camera's axes."""
_SOLES = [INDEX[name] for name in ("left_heel", "right_heel", "left_foot_index", "right_foot_index")]
_EARS = [INDEX["left_ear"], INDEX["right_ear"]]


KINDS: dict[str, str] = {
    "found": "the body of each person lies on him",
    "one number": "he keeps his number",
    "strangers": "no two people have one number",
    "elsewhere": "nobody is where nobody is",
    "points": "landmarks lie where the eye puts them",
    "facing": "chests point where the eye sees them point",
    "upright": "who stands upright does so in the world",
    "feet": "feet are at their height above the floor",
    "camera": "static or moving",
    "tilt": "how the camera is tilted",
    "cuts": "cuts are found, and no others",
    "linked": "what is joined to the shots before",
}
"""Kinds of expectations, and what each says."""


@dataclass(frozen=True)
class SeenClip:
    """What was recovered of a clip."""

    num_frames: int
    recording: Recording | None
    """None if the video was refused."""
    linked: Mapping[int, bool]
    """By first frame of a shot after the first: whether something places it relative to the shots before."""
    warnings: tuple[str, ...] = ()
    refused: str = ""
    """Why nothing was recovered."""

    @property
    def ending(self) -> str:
        """How the run ended, in words."""
        if self.recording is None:
            return "refused" if self.refused.startswith("no usable person") else "failed"
        return f"done, {len(self.warnings)} warnings" if self.warnings else "done"


@dataclass(frozen=True)
class Verdict:
    """One expectation and what was found instead."""

    kind: str
    """One of KINDS."""
    about: str
    expected: str
    found: str
    figure: float
    """How far `found` is from `expected`, 0 where it is as it should be; NaN if that is unknown."""
    holds: bool


def verdicts(clip: GoldenClip, seen: SeenClip) -> list[Verdict]:
    """One verdict for each thing that must hold of a clip."""
    recording = seen.recording
    bodies = [] if recording is None else [_Body.of(person, recording) for person in _trusted(recording)]
    matches = match(clip, bodies, seen.num_frames)
    found = [*_people(clip, matches, seen), _elsewhere(clip, matches, seen), *_strangers(clip, matches)]
    found += [*_camera(clip, recording), *_cuts(clip, seen)]
    return found


def _trusted(recording: Recording) -> list[RecordedPerson]:
    return [person for person in recording.people if person.probability >= DOUBTFUL and person.observed.any()]


@dataclass(frozen=True, eq=False)
class _Body:
    """One recovered person as the camera sees him. N frames."""

    person: RecordedPerson
    boxes: Float[Array, "N 4"]
    """Fractions of the picture, cut off at its edges; NaN where he is not observed or not in view."""
    pixels: Float[Array, "N 33 2"]
    height_px: Float[Array, " N"]
    R_cam_root: Float[Array, "N 3 3"]
    neck_above: Float[Array, "N 3"]
    """From pelvis to neck, world, metres."""
    soles_m: Float[Array, " N"]
    """Height of the lowest of heels and toes above z = 0."""

    @classmethod
    def of(cls, person: RecordedPerson, recording: Recording) -> "_Body":
        """A person of a recording."""
        landmarks = landmarks_in_world(person)
        pixels, visible = in_picture(landmarks, person, recording)
        size = np.array([recording.width, recording.height])
        inside = np.clip(pixels / size, 0, 1)
        boxes = np.concatenate([inside.min(axis=1), inside.max(axis=1)], axis=1)
        flat = (boxes[:, 2:] - boxes[:, :2]).min(axis=1) <= 0
        boxes[flat | ~person.observed | ~visible.all(axis=1)] = np.nan
        R_root = rotvec_to_rotmat(person.root_orient.astype(np.float64))
        neck = person.joints[:, JOINT_NAMES.index("Neck")] - person.pelvis
        R_world_cam = recording.R_world_cam[person.frame].astype(np.float64)
        return cls(
            person=person,
            boxes=boxes,
            pixels=pixels,
            height_px=standing_height_px(person, recording),
            R_cam_root=np.swapaxes(R_world_cam, 1, 2) @ R_root,
            neck_above=neck.astype(np.float64),
            soles_m=landmarks[:, _SOLES, 2].min(axis=1),
        )

    def dense(self, num_frames: int) -> Float[Array, "frames 4"]:
        """Boxes of all frames of the clip."""
        boxes = np.full((num_frames, 4), np.nan)
        boxes[self.person.frame] = self.boxes
        return boxes


@dataclass(frozen=True, eq=False)
class Matches:
    """Which body lies on whom, frame by frame."""

    bodies: Sequence[_Body]
    body_of: np.ndarray
    """(people, frames) int: index into `bodies`, −1 for nobody."""
    strays: np.ndarray
    """(bodies, frames) bool: a body where nobody is."""
    boxes: np.ndarray
    """(bodies, frames, 4)."""

    def rows(self, person: int, frame: int) -> tuple[_Body, int] | None:
        """The body on an expected person in a frame, and its row there."""
        index = int(self.body_of[person, frame])
        if index < 0:
            return None
        body = self.bodies[index]
        return body, frame - int(body.person.frame[0])


def match(clip: GoldenClip, bodies: Sequence[_Body], num_frames: int) -> Matches:
    """One to one in every frame, by the greatest sum of the overlaps of boxes."""
    wanted = np.array([person.boxes(num_frames) for person in clip.people]).reshape(-1, num_frames, 4)
    boxes = np.array([body.dense(num_frames) for body in bodies]).reshape(-1, num_frames, 4)
    crowd = np.array([person.crowd for person in clip.people], bool)
    body_of = np.full((len(clip.people), num_frames), -1)
    strays = np.isfinite(boxes[..., 0])
    for frame in np.flatnonzero(strays.any(axis=0)):
        here = np.flatnonzero(strays[:, frame])
        there = np.flatnonzero(np.isfinite(wanted[:, frame, 0]) & ~crowd)
        overlap = box_iou(wanted[there, None, frame], boxes[None, here, frame])
        rows, columns = linear_sum_assignment(np.where(overlap >= LEAST_IOU, overlap, 0), maximize=True)
        for row, column in zip(rows, columns, strict=True):
            if overlap[row, column] >= LEAST_IOU:
                body_of[there[row], frame] = here[column]
        found = body_of[there, frame]
        near = (overlap[found < 0] >= NEAR_IOU).any(axis=0)
        strays[here, frame] = ~near & ~np.isin(here, found)
        for k in np.flatnonzero(crowd & np.isfinite(wanted[:, frame, 0])):
            strays[here, frame] &= _fraction_inside(boxes[here, frame], wanted[k, frame]) < IN_CROWD
    return Matches(bodies, body_of, strays, boxes)


def _fraction_inside(boxes: Float[Array, "n 4"], zone: Float[Array, " 4"]) -> Float[Array, " n"]:
    """How much of each box lies in the zone."""
    sides = np.minimum(boxes[:, 2:], zone[2:]) - np.maximum(boxes[:, :2], zone[:2])
    area = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(np.maximum(sides, 0).prod(axis=1) / np.maximum(area, 1e-12))


def _people(clip: GoldenClip, matches: Matches, seen: SeenClip) -> Iterator[Verdict]:
    for k, person in enumerate(clip.people):
        required = person.required(seen.num_frames)
        if required.any():
            on_him = matches.body_of[k][required]
            share = float((on_him >= 0).mean())
            text = f"in {share:.0%} of {required.sum()} frames" if seen.recording else seen.ending
            yield Verdict("found", person.who, f"in {person.share:.0%}", text, 1 - share, share >= person.share)
            yield _one_number(person, on_him, matches)
        yield from _details(person, k, matches, seen)


def _one_number(person: ExpectedPerson, on_him: np.ndarray, matches: Matches) -> Verdict:
    numbers = [matches.bodies[index].person.person for index in on_him if index >= 0]
    if not numbers:
        return _untold("one number", person.who, f"{ONE_NUMBER:.0%}")
    values, counts = np.unique(numbers, return_counts=True)
    share = float(counts.max() / counts.sum())
    order = np.argsort(-counts)
    text = ", ".join(f"{values[i]}: {counts[i]}" for i in order)
    return Verdict(
        "one number", person.who, f"{ONE_NUMBER:.0%}", f"frames by number {text}", 1 - share, share >= ONE_NUMBER
    )


def _details(person: ExpectedPerson, k: int, matches: Matches, seen: SeenClip) -> Iterator[Verdict]:
    """What is expected of single frames."""
    for frame, value in person.facing.items():
        about, there = f"{person.who}, frame {frame}", matches.rows(k, frame)
        yield _facing(about, value, *there) if there else _untold("facing", about, value)
    for frame in person.upright:
        about, there = f"{person.who}, frame {frame}", matches.rows(k, frame)
        yield _upright(about, *there) if there else _untold("upright", about, f"within {UPRIGHT_DEG:g}°")
    for frame, bounds in person.feet_m.items():
        about, there = f"{person.who}, frame {frame}", matches.rows(k, frame)
        yield (
            _between("feet", about, float(there[0].soles_m[there[1]]), bounds, " m")
            if there
            else _untold("feet", about, f"{bounds[0]:g} to {bounds[1]:g} m")
        )
    for frame, points in person.points.items():
        there = matches.rows(k, frame)
        for name, at in points.items():
            about = f"{person.who}, frame {frame}, {name}"
            if there is None or seen.recording is None:
                yield _untold("points", about, f"within {POINT_PCT:g} %")
            else:
                yield _point(about, name, at, *there, seen.recording)


def _untold(kind: str, about: str, expected: str) -> Verdict:
    return Verdict(kind, about, expected, "not found", float("nan"), False)


def _facing(about: str, value: str, body: _Body, row: int) -> Verdict:
    """The angle about the vertical between the pelvis's front (+z of body24) and the direction that was seen."""
    front = body.R_cam_root[row, [0, 2], 2]
    wanted = np.array(_DIRECTIONS[value], np.float64)
    cosine = front @ wanted / max(float(np.linalg.norm(front) * np.linalg.norm(wanted)), 1e-9)
    off = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    nearest = max(_DIRECTIONS, key=lambda name: front @ np.array(_DIRECTIONS[name]) / np.hypot(*_DIRECTIONS[name]))
    return Verdict("facing", about, value, f"{nearest}, {off:.0f}° off", off, off <= FACING_DEG)


def _upright(about: str, body: _Body, row: int) -> Verdict:
    above = body.neck_above[row]
    off = float(np.degrees(np.arccos(np.clip(above[2] / np.linalg.norm(above), -1, 1))))
    return Verdict("upright", about, f"within {UPRIGHT_DEG:g}°", f"{off:.0f}° off", off, off <= UPRIGHT_DEG)


def _point(about: str, name: str, at: tuple[float, float], body: _Body, row: int, recording: Recording) -> Verdict:
    placed = body.pixels[row, _EARS].mean(axis=0) if name == "head" else body.pixels[row, INDEX[name]]
    wanted = np.array(at) * (recording.width, recording.height)
    off = float(100 * np.linalg.norm(placed - wanted) / body.height_px[row])
    return Verdict("points", about, f"within {POINT_PCT:g} %", f"{off:.1f} % off", off, off <= POINT_PCT)


def _elsewhere(clip: GoldenClip, matches: Matches, seen: SeenClip) -> Verdict:
    expected = "no body" if not clip.people else "no other body"
    if seen.ending == "failed":
        return Verdict("elsewhere", "", expected, seen.refused, float("nan"), False)
    share = float(matches.strays.sum()) / seen.num_frames
    where = []
    for index, body in enumerate(matches.bodies):
        frames = np.flatnonzero(matches.strays[index])
        if len(frames):
            x0, y0, x1, y1 = np.median(matches.boxes[index, frames], axis=0)
            where.append(
                f"number {body.person.person} in {len(frames)} of frames {frames[0]}–{frames[-1]} at "
                f"{x0:.2f} {y0:.2f} {x1:.2f} {y1:.2f}"
            )
    return Verdict("elsewhere", "", expected, "; ".join(where) or "none", share, share <= ELSEWHERE)


def _strangers(clip: GoldenClip, matches: Matches) -> Iterator[Verdict]:
    """Two people never have one number."""
    named = [k for k, person in enumerate(clip.people) if person.frames]
    if len(named) < 2:
        return
    numbers = []
    for k in named:
        found = [matches.bodies[index].person.person for index in matches.body_of[k] if index >= 0]
        values, counts = np.unique(found, return_counts=True)
        numbers.append({int(v) for v, c in zip(values, counts, strict=True) if c >= FEW * len(found)})
    same = [
        f"{clip.people[named[i]].who} and {clip.people[named[j]].who}"
        for i, j in combinations(range(len(named)), 2)
        if numbers[i] & numbers[j]
    ]
    yield Verdict("strangers", "", "no two people have one number", "; ".join(same) or "none", len(same), not same)


def _camera(clip: GoldenClip, recording: Recording | None) -> Iterator[Verdict]:
    if clip.camera is not None:
        names = {"static": ("static",), "moving": ("tracked", "rotation_only")}[clip.camera]
        sources = [] if recording is None else [SOURCES[code] for code in recording.camera_source]
        share = float(np.mean([name in names for name in sources])) if sources else float("nan")
        text = ", ".join(dict.fromkeys(sources)) or "unknown"
        yield Verdict("camera", "", clip.camera, text, 1 - share, share == 1.0)
    if recording is None:
        angles = [("down", frame) for frame in clip.down_deg] + [("roll", frame) for frame in clip.roll_deg]
        yield from (
            Verdict("tilt", f"{way}, frame {frame}", "", "unknown", float("nan"), False) for way, frame in angles
        )
        return
    for frame, bounds in clip.down_deg.items():
        down = float(np.degrees(np.arcsin(np.clip(-recording.R_world_cam[frame][2, 2], -1, 1))))
        yield _between("tilt", f"down, frame {frame}", down, bounds, "°")
    for frame, bounds in clip.roll_deg.items():
        R = recording.R_world_cam[frame]
        roll = float(np.degrees(np.arctan2(-R[2, 0], -R[2, 1])))
        yield _between("tilt", f"roll, frame {frame}", roll, bounds, "°")


def _between(kind: str, about: str, value: float, bounds: tuple[float, float], unit: str) -> Verdict:
    low, high = bounds
    off = max(low - value, value - high, 0.0)
    return Verdict(kind, about, f"{low:g} to {high:g}{unit}", f"{round(value, 2) + 0.0:g}{unit}", off, off == 0)


def _cuts(clip: GoldenClip, seen: SeenClip) -> Iterator[Verdict]:
    if seen.recording is None:
        if clip.cuts:
            yield Verdict("cuts", "", f"{len(clip.cuts)}", "unknown", float("nan"), False)
        return
    left = list(seen.recording.cut_frames)
    placed: list[tuple[ExpectedCut, int | None]] = []
    for cut in clip.cuts:
        slack = CUT_FRAMES if cut.start == cut.end else GRADUAL_FRAMES
        near = [frame for frame in left if cut.start - slack <= frame <= cut.end + slack]
        at = min(near, key=lambda frame: abs(2 * frame - cut.start - cut.end)) if near else None
        placed.append((cut, at))
        if at is not None:
            left.remove(at)
    missed = [str(cut.start) for cut, at in placed if at is None]
    errors = [*(f"missed at {frame}" for frame in missed), *(f"false at {frame}" for frame in left)]
    wrong = len(missed) + len(left)
    yield Verdict("cuts", "", f"{len(clip.cuts)}", "; ".join(errors) or "the same", wrong, wrong == 0)
    for cut, at in placed:
        expected = "linked" if cut.linked else "not linked"
        linked = None if at is None else seen.linked[at]
        text = "no cut" if linked is None else "linked" if linked else "not linked"
        figure = float("nan") if linked is None else float(linked is not cut.linked)
        yield Verdict("linked", f"frame {cut.start}", expected, text, figure, linked is cut.linked)
