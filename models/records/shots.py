"""Where one shot ends and the next begins, and who is who across the cut."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Transition:
    """Change of shot at [start, end): a hard cut has start == end == first frame of the new shot."""

    type: Literal["cut", "dissolve", "fade"]
    start: int
    end: int
    evidence: str
    """Which part of the detector found it: scene, bbox or keypoints; or user."""
    dim: tuple[int, int] | None = None
    """Of a fade, the frames [start, end) that have less than BRIGHT of their light."""

    @property
    def cut_frame(self) -> int:
        """First frame of the new shot: (start + end) // 2."""
        return (self.start + self.end) // 2

    @property
    def clear_until(self) -> int:
        """End of the frames that show the shot before well."""
        return self.start + self._faint_frames if self.dim is None else self.dim[0]

    @property
    def clear_from(self) -> int:
        """First of the frames that show the shot after well."""
        return self.end - self._faint_frames if self.dim is None else self.dim[1]

    @property
    def _faint_frames(self) -> int:
        """Frames at either end of a dissolve in which the other picture has FAINT of the light at most."""
        return int(FAINT * (self.end - self.start + 1)) if self.type == "dissolve" else 0


FAINT = 0.3
"""Keypoints of people over whom another picture lies with 0.1 to 0.3 of the light are off by 2.1 % of their height in
the median (2.0 % without it), with 0.3 to 0.4 by 2.5 % and by 10 % in the mean (125 people and frames of development
clips)."""
BRIGHT = 0.5
"""Keypoints of people in a picture that a fade leaves 0.6 or more of its light are off by 2.1 % of their height in the
median, with 0.4, 0.25 and 0.1 of it by 2.4, 2.2 and 3.2 %, and in the worst tenth by 3.9, 6.3, 12 and 13 % (40 each, of
eight development clips; 1.8 and 3.9 % outside fades)."""


@dataclass(frozen=True)
class CorrectionNote:
    """What became of one correction of the user's."""

    identity: str
    """What it says (`humanmm.corrections.Correction.identity`)."""
    applied: bool
    reason: str = ""
    """Why it does not fit, or what is to be known although it does."""


Box = tuple[float, float, float, float]
"""x0, y0, x1, y1 in source pixels."""


SPANNED = 0.99
"""A box over more of the picture's width or height is a bar beside what was filmed."""


@dataclass(frozen=True)
class Change:
    """A frame that differs more from the one before it than any frame around it does."""

    frame: int
    outstanding: float
    """How many times as much as the largest of those."""
    step: tuple[float, float]
    """x, y in pixels: how far the place moves besides its motion before and after."""


@dataclass(frozen=True)
class Scenes:
    """Colour-based boundaries of a video of num_frames; scene k runs [starts[k], starts[k+1])."""

    num_frames: int
    transitions: tuple[Transition, ...]
    corrections: tuple[CorrectionNote, ...] = ()
    """What became of the corrections of cuts; a cut to be removed that is not here may be one that people show."""
    suspected: tuple[int, ...] = ()
    """Frames that may begin a shot: time may have been left out before them."""
    changes: tuple[Change, ...] = ()
    """Those inside the scenes at which the picture changes most: jump cuts, if people leap there."""
    burned_in: tuple[tuple[Box, ...], ...] = ()
    """By scene, where something was drawn over the film (captions, logos, black bars)."""

    @property
    def spans(self) -> tuple[tuple[int, int], ...]:
        starts = [0, *(t.cut_frame for t in self.transitions)]
        return tuple(zip(starts, [*starts[1:], self.num_frames], strict=True))


@dataclass(frozen=True)
class TrackPart:
    """The rows of one track of a scene in frames [start, end)."""

    track: int
    start: int
    end: int


@dataclass(frozen=True)
class Appearance:
    """One person in one shot: which track of the scene, and in which frames the detector was wrong about him."""

    person: int
    track: int
    """Index into ScenePeople.tracks of the scene that holds the shot."""
    left_right_swapped: tuple[tuple[int, int], ...] = ()
    """Frames [start, end) in which the detector has swapped left and right; `ScenePeople.track_of` puts them right."""
    tracking_failures: tuple[tuple[int, int], ...] = ()
    """Frames [start, end) in which the detector's pose is not to be trusted, although the person is seen."""
    parts: tuple[TrackPart, ...] = ()
    """What belongs to him where that is not all of `track`, by the user's corrections; no frame is in two of them."""


@dataclass(frozen=True)
class Shot:
    """Frames [start, end) seen by one camera without interruption."""

    index: int
    start: int
    end: int
    scene: int
    transition: Transition | None
    """How this shot began; None for the first."""
    people: tuple[Appearance, ...]
    ending: Transition | None = None
    """How this shot ends, the next one's `transition`; None for the last."""
    burned_in: tuple[Box, ...] = ()
    """Where something was drawn over its pictures, which is no part of the place."""

    def filmed_size(self, width: int, height: int) -> tuple[float, float]:
        """Width and height of what was filmed of pictures of this size: without the bars beside it."""
        across = [(y0, y1) for x0, y0, x1, y1 in self.burned_in if x1 - x0 > SPANNED * width]
        upright = [(x0, x1) for x0, y0, x1, y1 in self.burned_in if y1 - y0 > SPANNED * height]
        filmed = _between(upright, width), _between(across, height)
        return filmed if min(filmed) > 0 else (width, height)

    @property
    def outside_transitions(self) -> tuple[int, int]:
        """Its frames [start, end) outside gradual transitions; inside, two pictures mix, and nobody counts as observed.
        start == end where transitions leave nothing of the shot."""
        return self._within(
            self.start if self.transition is None else self.transition.end,
            self.end if self.ending is None else self.ending.start,
        )

    @property
    def clear(self) -> tuple[int, int]:
        """The same with those frames of a dissolve in which the other picture is faint: evidence of people and points,
        though not of colours and features."""
        return self._within(
            self.start if self.transition is None else self.transition.clear_from,
            self.end if self.ending is None else self.ending.clear_until,
        )

    def _within(self, first: int, last: int) -> tuple[int, int]:
        """What of [first, last) lies in the shot."""
        start = max(self.start, first)
        return start, max(start, min(self.end, last))


DOUBTFUL = 0.5
"""Probability of being a person below which somebody is delivered as doubtful."""


@dataclass(frozen=True)
class Person:
    """One human being of the video; number 0 is the main subject (largest summed visible area)."""

    person: int
    betas: np.ndarray
    """(10,) float32 shape of body24, from bone proportions over all shots, and his height if the user gave it."""
    area: float
    """Summed visible area, pixels × frames."""
    probability: float = 1.0
    """That this is a person at all; below DOUBTFUL he is delivered as doubtful, and joins no shots."""

    height_known: bool = False
    """Whether the user gave his height."""
    inset: bool = False
    """Whether he is seen in a picture within the picture alone: what is shown there was filmed somewhere else."""

    @property
    def doubtful(self) -> bool:
        """Whether this may well be nobody."""
        return self.probability < DOUBTFUL


def _between(bars: Sequence[tuple[float, float]], length: float) -> float:
    """What bars from either end leave of a length; 0 and less where one covers all of it."""
    first = max((end for start, end in bars if start <= 0), default=0.0)
    return min((start for start, end in bars if end > SPANNED * length), default=length) - first


@dataclass(frozen=True)
class LeftOut:
    """Somebody who is delivered nowhere, because he is a person with too low a probability."""

    probability: float
    shots: tuple[int, ...]
    """In which he is seen."""


@dataclass(frozen=True)
class Unfollowed:
    """Somebody whom the detector sees again and again, and whom no track follows."""

    first: int
    last: int
    """Frames of the video in which he was seen first and last."""
    box: Box
    """xyxy, source pixels, where he was seen best."""
    score: float
    """The detector's, mean."""
    crowded: bool = False
    """Whether as many people as wanted were followed meanwhile."""


@dataclass(frozen=True)
class ShotList:
    """Final shots and the people in them."""

    num_frames: int
    shots: tuple[Shot, ...]
    people: tuple[Person, ...]
    warnings: tuple[str, ...] = ()
    corrections: tuple[CorrectionNote, ...] = ()
    """What became of the corrections of cuts and people."""
    left_out: tuple[LeftOut, ...] = ()
    unfollowed: tuple[Unfollowed, ...] = ()
    """Likeliest first."""
    suspected: tuple[int, ...] = ()
    """Frames that may begin a shot, and begin none here."""

    def witnesses(self, people: Iterable[int]) -> frozenset[int]:
        """Of these people (numbers) those by whom cameras and floor are judged: who is certainly a person; where nobody
        is, who was filmed by the video's camera; else all."""
        numbers = frozenset(people)
        doubtful = {person.person for person in self.people if person.doubtful}
        return numbers - doubtful or numbers - {person.person for person in self.people if person.inset} or numbers

    def filmed_size(self, width: int, height: int) -> tuple[float, float]:
        """The largest of all shots."""
        return max((shot.filmed_size(width, height) for shot in self.shots), key=math.prod, default=(width, height))
