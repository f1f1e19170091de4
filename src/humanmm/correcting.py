"""Makes corrections of a finished run: numbers of its people become places in its pictures, and stay right for later
runs, in which people may have other numbers.

A correction is checked against the run first: a person, shot, cut or frame that it does not have is an error.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from humanmm.config import MAX_FOV_DEG, MIN_FOV_DEG
from humanmm.corrections import (
    NONE,
    ONCE,
    AddCut,
    Correction,
    Corrections,
    Exclude,
    Floor,
    Focal,
    Height,
    Main,
    Nobody,
    RemoveCut,
    SamePerson,
    Sides,
    StaticShot,
    Swap,
    Who,
    make,
    read_corrections,
)
from humanmm.errors import InputError
from humanmm.models.body.body24 import load_body
from humanmm.models.records.landmarks import INDEX
from humanmm.storage.run_folder.corrections_file import FILE, append, begin, of_folder, remove, standing
from humanmm.storage.run_folder.run_record import read_run_record

if TYPE_CHECKING:
    from humanmm.models.records.recording import RecordedPerson, Recording

SIDES: tuple[Literal["shoulder", "wrist", "hip", "knee", "ankle"], ...] = ("shoulder", "wrist", "hip", "knee", "ankle")
"""Joints whose left and right may distinguish the sides."""
ALONE = 1.5
"""Somebody this many times his own size away from all others cannot be taken for one of them."""
NEAR_FRAMES = 2


@dataclass(frozen=True)
class Corrector:
    """Makes corrections of one run."""

    recording: "Recording"
    record: Mapping[str, Any]
    """Its run.json."""
    pending: tuple[Correction, ...] = ()
    """Corrections of its folder that it was not computed with, and those that were taken out since: `pending_of`."""

    # ---- cuts and shots

    def add_cut(self, frame: int, end: int | None = None) -> AddCut:
        """A cut, or with `end` a gradual transition in [frame, end)."""
        self._check_frame(frame)
        if frame == 0:
            raise InputError("there is nothing before frame 0; a cut is the first frame of the later shot")
        if end is not None:
            self._check_span(frame, end)
        return AddCut(frame=frame, end=end)

    def remove_cut(self, frame: int) -> RemoveCut:
        """One of the run's cuts, a frame of one of its gradual transitions, or a suspected cut."""
        found = [shot["transition"] for shot in self.record["shots"] if shot["transition"]]
        spans = [(one["start"], one["end"]) for one in found]
        spans += [(suspected, suspected) for suspected in self.record.get("suspected_cuts", [])]
        if not any(start - NEAR_FRAMES <= frame <= end + NEAR_FRAMES for start, end in spans):
            cuts = ", ".join(str(shot["start"]) for shot in self.record["shots"][1:]) or "none"
            raise InputError(f"the run has no cut at frame {frame}; its cuts are at {cuts}")
        return RemoveCut(frame=frame)

    def static_shot(self, number: int) -> StaticShot:
        """A shot of the run."""
        shots = self.record["shots"]
        if not 0 <= number < len(shots):
            raise InputError(f"the run has no shot {number}; it has {len(shots)}, numbered from 0")
        return StaticShot(frame=(shots[number]["start"] + shots[number]["end"]) // 2)

    # ---- people

    def same_person(self, number: int, other: int) -> SamePerson:
        """Two people of the run."""
        if number == other:
            raise InputError(f"person {number} is one already; name two people")
        return SamePerson(who=self.place(number), other=self.place(other))

    def nobody(self, number: int) -> Nobody:
        """One of the run's people."""
        return Nobody(who=self.place(number))

    def swap(self, number: int, other: int, start: int, end: int) -> Swap:
        """Two people of the run who change places in [start, end)."""
        self._check_span(start, end)
        if number == other:
            raise InputError(f"person {number} cannot change places with himself; name two people")
        return Swap(who=self.place(number), other=self.place(other), start=start, end=end)

    def sides(self, number: int, start: int | None = None, end: int | None = None) -> list[Sides]:
        """One of the run's people in [start, end), or wherever he is seen: a correction for each shot."""
        person = self._person(number)
        first = int(person.frame[0]) if start is None else start
        last = int(person.frame[-1]) + 1 if end is None else end
        self._check_span(first, last)
        spans = [(max(first, shot["start"]), min(last, shot["end"])) for shot in self.record["shots"]]
        found = [self._sides(person, *span) for span in spans if span[0] < span[1]]
        known = [one for one in found if one is not None]
        if not known:
            raise InputError(f"person {number} is not seen in frames {first} to {last - 1}")
        return known

    def _sides(self, person: "RecordedPerson", start: int, end: int) -> Sides | None:
        """Where the true left and right of one joint are: the wrong way round, where they are farthest apart."""
        rows = np.flatnonzero(_seen(person) & (person.frame >= start) & (person.frame < end))
        if not len(rows):
            return None
        pairs = np.array([[INDEX[f"left_{joint}"], INDEX[f"right_{joint}"]] for joint in SIDES])
        keypoints = person.keypoints2d[rows][:, pairs].astype(float)
        apart = np.linalg.norm(keypoints[:, :, 0, :2] - keypoints[:, :, 1, :2], axis=-1) * keypoints[..., 2].min(
            axis=-1
        )
        row, joint = np.unravel_index(int(apart.argmax()), apart.shape)
        right, left = keypoints[row, joint, :, :2].round(1).tolist()  # as found, which is wrong
        who = self._at(person, int(rows[row]))
        return Sides(who=who, start=start, end=end, joint=SIDES[int(joint)], left=tuple(left), right=tuple(right))

    def height(self, number: int, metres: float) -> Height:
        """How tall one of the run's people is."""
        return make(Height, who=self.place(number), metres=metres)

    def height_of(self, number: int) -> float:
        """How tall one of the run's people stands, metres."""
        return load_body().standing_height(self._person(number).betas)

    def exclude(self, start: int, end: int, number: int | None = None) -> Exclude:
        """Frames in which nothing is to be believed of one of the run's people, or of anybody."""
        self._check_span(start, end)
        who = None if number is None else self.place(number)
        return Exclude(who=who, start=start, end=end)

    def main(self, x: float, y: float, frame: int) -> Main:
        """Whoever is at a place."""
        self._check_frame(frame)
        width, height = self.recording.width, self.recording.height
        if not (0 <= x <= width and 0 <= y <= height):
            raise InputError(f"{x:g}, {y:g} is not in the picture, which is {width} x {height} pixels")
        who = Who(frame=frame, x=x, y=y)
        return Main(who=who.model_copy(update={"number": self._number_at(who)}))

    # ---- the world

    def floor(self, rise_m: float) -> Floor:
        """The floor so much higher than z = 0 of the run: the sum of what was corrected before and this."""
        given = self.record["config"].get("corrections", {}).get("correction", ())
        before = sum(one["metres"] for one in given if one["kind"] == "floor")
        return make(Floor, metres=round(before + rise_m, 4))

    def focal(self, px: float) -> Focal:
        """The focal length of the video, pixels: of a horizontal field of view between the limits of the settings."""
        correction, width = make(Focal, px=px), self.recording.width
        fov_deg = math.degrees(2 * math.atan(width / (2 * px)))
        if not MIN_FOV_DEG < fov_deg < MAX_FOV_DEG:
            least, most = (width / (2 * math.tan(math.radians(fov) / 2)) for fov in (MAX_FOV_DEG, MIN_FOV_DEG))
            raise InputError(
                f"focal: px must be between {least:.0f} and {most:.0f} for a picture {width} pixels wide (a field of "
                f"view of {MIN_FOV_DEG:g} to {MAX_FOV_DEG:g} degrees), not {px:g}"
            )
        return correction

    # ---- where and when

    def frame_at(self, time_s: float) -> int:
        """The frame that is shown at a time, seconds from the first frame on, as the page of the run shows it."""
        times = self.recording.time_s - self.recording.time_s[0]
        if not -1e-6 <= time_s <= times[-1] + 1.0:
            raise InputError(f"the video lasts from 0.00 to {times[-1]:.2f} s; {time_s:g} s is outside")
        return int(np.searchsorted(times, time_s + 1e-6, side="right")) - 1

    def place(self, number: int) -> Who:
        """Where one of the run's people can be distinguished from all others: seen, and far from them; not in frames
        in which the pending corrections make somebody else of whoever is there, or nobody."""
        person = self._person(number)
        rows = np.flatnonzero(_seen(person))
        if not len(rows):
            raise InputError(f"person {number} was nowhere seen")
        for one in self.pending:
            if isinstance(one, Swap | Exclude) and self._concerns(one, number):
                rows = rows[(person.frame[rows] < one.start) | (person.frame[rows] >= one.end)]
        if not len(rows):
            raise InputError(
                f"person {number} is seen in no frame outside the swaps and excluded frames that are not computed yet; "
                "compute them first with `humanmm recover`: then he can be named by his number in the new run"
            )
        # not where people were distinguished by hand: there it depends on the order of corrections who is who
        given = self.record["config"].get("corrections", {}).get("correction", ())
        swapped = np.zeros(len(rows), bool)
        for one in given:
            if one["kind"] == "swap":
                swapped |= (person.frame[rows] >= one["start"]) & (person.frame[rows] < one["end"])
        rows = rows[~swapped] if not swapped.all() else rows
        alone = np.minimum(np.array([self._distance(person, int(row)) for row in rows]), ALONE)
        middle = np.abs(rows - rows[len(rows) // 2]) / max(len(person.frame), 1)
        return self._at(person, int(rows[int((alone - 0.1 * middle).argmax())]))

    def _concerns(self, correction: Swap | Exclude, number: int) -> bool:
        """Whether it is about one of the run's people."""
        named = (correction.who, correction.other if isinstance(correction, Swap) else None)
        return correction.who is None or number in [self._number_at(who) for who in named if who is not None]

    def _number_at(self, who: Who) -> int | None:
        """The number of whoever is at a place, None if nobody is."""
        for person in self.recording.people:
            row = who.frame - int(person.frame[0])
            if 0 <= row < len(person.frame):
                x0, y0, x1, y1 = person.bbox[row]
                if x0 <= who.x <= x1 and y0 <= who.y <= y1:
                    return person.person
        return None

    def _at(self, person: "RecordedPerson", row: int) -> Who:
        x0, y0, x1, y1 = person.bbox[row].astype(float)
        x, y = round((x0 + x1) / 2, 1), round((y0 + y1) / 2, 1)
        return Who(frame=int(person.frame[row]), x=x, y=y, number=person.person)

    def _distance(self, person: "RecordedPerson", row: int) -> float:
        """From one person to the nearest other in a frame, in his own sizes."""
        frame, own = int(person.frame[row]), person.bbox[row].astype(float)
        size = max(float(np.sqrt(np.prod(own[2:] - own[:2]))), 1.0)
        nearest = np.inf
        for other in self.recording.people:
            at = frame - int(other.frame[0])
            if other is not person and 0 <= at < len(other.frame):
                box = other.bbox[at].astype(float)
                nearest = min(nearest, float(np.linalg.norm((own[:2] + own[2:] - box[:2] - box[2:]) / 2)) / size)
        return nearest

    def _person(self, number: int) -> "RecordedPerson":
        for person in self.recording.people:
            if person.person == number:
                return person
        numbers = ", ".join(str(person.person) for person in self.recording.people)
        raise InputError(f"the run has no person {number}; it has {numbers}")

    def _check_frame(self, frame: int) -> None:
        last = self.recording.num_frames - 1
        if not 0 <= frame <= last:
            raise InputError(f"the video has no frame {frame}; it has 0 to {last}")

    def _check_span(self, start: int, end: int) -> None:
        self._check_frame(start)
        self._check_frame(end - 1)
        if end <= start:
            raise InputError(f"frames {start} to {end} are none: --to is the first frame after them")


def _seen(person: "RecordedPerson") -> np.ndarray:
    """(N,) bool: the detector saw him there."""
    return np.asarray(person.observed & (person.keypoints2d[..., 2] > 0).any(axis=1))


def contrary(correction: Correction, among: Sequence[Correction]) -> int | None:
    """Number, from 1, of the correction that says the opposite of this one: taking it out is enough."""
    for number, one in enumerate(among, start=1):
        cuts = isinstance(correction, AddCut | RemoveCut) and isinstance(one, AddCut | RemoveCut)
        if cuts and one.kind != correction.kind and one.facts["frame"] == correction.facts["frame"]:
            return number
    return None


@dataclass(frozen=True)
class Entered:
    """What became of a correction in the file of a run."""

    removed: tuple[Correction, ...]
    """What it took out: its contrary, or what may be there once."""
    number: int | None
    """Its own number, from 1; None if it is not there: taking out was enough, or the file had it already."""


def take_over(run_dir: Path) -> Corrections:
    """Write the corrections that a run was given from elsewhere into its folder, which has no file yet: what is written
    there takes their place. Returns them; none if there was nothing to take over."""
    given = standing(_given(run_dir), run_dir)
    if (run_dir / FILE).is_file() or not given.correction:
        return NONE
    begin(run_dir / FILE, given.correction, video=_video(run_dir))
    return given


def enter(run_dir: Path, correction: Correction) -> Entered:
    """Write a correction into the file of a run; one that takes an earlier one back, or may be there once, replaces
    it. What the run was given from elsewhere is written there first (`take_over`)."""
    take_over(run_dir)
    path, held = run_dir / FILE, of_folder(run_dir)
    video, before = _video(run_dir), held.correction
    if held.for_video(video).left_aside:
        raise InputError(f"{path} was written for another video than that of the run; move it away first")
    number = contrary(correction, before)
    if number is not None:
        remove(path, number)
        return Entered((before[number - 1],), None)
    if any(one.facts == correction.facts for one in before):
        return Entered((), None)
    replaced = [n for n, one in enumerate(before, start=1) if correction.kind in ONCE and one.kind == correction.kind]
    for number in reversed(replaced):
        remove(path, number)
    append(path, correction, video=video, remark=str(correction))
    return Entered(tuple(before[n - 1] for n in reversed(replaced)), len(before) - len(replaced) + 1)


def take_out(run_dir: Path, number: int | None = None) -> Correction:
    """Take a correction, counted from 1 as in `states`, or the last one out of the file of a run."""
    take_over(run_dir)
    entries = of_folder(run_dir).correction
    if not entries:
        raise InputError(f"{run_dir / FILE} holds no correction")
    chosen = len(entries) if number is None else number
    if not 1 <= chosen <= len(entries):
        raise InputError(f"there is no correction {chosen}; there are {len(entries)}, numbered from 1")
    remove(run_dir / FILE, chosen)
    return entries[chosen - 1]


def states(run_dir: Path) -> list[tuple[Correction, str]]:
    """The corrections of a run, in its folder's file or given from elsewhere, each with what the last run made of
    it."""
    done = {str(one["correction"]): one for one in read_run_record(run_dir).get("corrections", ())}

    def state(one: Correction) -> str:
        found = done.get(str(one.model_dump(mode="json", exclude_none=True)))
        if found is None:
            return "not computed yet"
        remark = f": {found['reason']}" if found["reason"] else ""
        return f"{'applied' if found['applied'] else 'does not fit'}{remark}"

    return [(one, state(one)) for one in standing(_given(run_dir), run_dir).correction]


def pending_of(run_dir: Path) -> tuple[Correction, ...]:
    """The corrections of a run that it was not computed with, and those that it was and that were taken out since."""
    given, now = _given(run_dir), standing(_given(run_dir), run_dir)
    return tuple(
        one
        for some, others in ((now, given), (given, now))
        for one in some.correction
        if one.identity not in {other.identity for other in others.correction}
    )


def _given(run_dir: Path) -> Corrections:
    """The corrections that the run was computed with."""
    return read_corrections(read_run_record(run_dir)["config"].get("corrections", {}))


def _video(run_dir: Path) -> str:
    return str(read_run_record(run_dir)["video"]["sha256"])
