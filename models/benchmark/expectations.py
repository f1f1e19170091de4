"""What must hold of a clip that somebody looked at: an entry of the golden set.

Frames count from 0 in the clip, spans [start, end) exclude their end. Boxes (x0, y0, x1, y1) and points (x, y) are
fractions of the picture's width and height, set by eye.
"""

from typing import Annotated, Literal

import numpy as np
from jaxtyping import Bool, Float
from pydantic import BaseModel, ConfigDict, Field, model_validator

Array = np.ndarray

Fraction = Annotated[float, Field(ge=0, le=1)]
Box = tuple[Fraction, Fraction, Fraction, Fraction]
Frame = Annotated[int, Field(ge=0)]
Span = tuple[Frame, Frame]
Facing = Literal[
    "towards", "towards left", "left", "away left", "away", "away right", "right", "towards right"
]  # fmt: skip
WHOLE: Box = (0.0, 0.0, 1.0, 1.0)


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Poster(_Entry):
    """One frame of another video, put up on the picture: it never moves there."""

    video: str
    frame: Frame
    crop: Box = WHOLE
    at: Box


class Part(_Entry):
    """Frames of a video, in their order and at the rate of the clip's first part."""

    video: str
    """Path below the folder of videos."""
    frames: Span | None = None
    """All of them unless given."""
    crop: Box = WHOLE
    poster: Poster | None = None


class ExpectedPerson(_Entry):
    """A human being of the clip."""

    who: str
    frames: tuple[Span, ...] = ()
    """Where he must be found."""
    maybe: tuple[Span, ...] = ()
    """Where he may be found or not: half hidden, entering, blurred."""
    at: Annotated[tuple[tuple[Frame, Fraction, Fraction, Fraction, Fraction], ...], Field(min_length=1)]
    """Frame and box of his visible body; linear between rows, constant outside."""
    crowd: bool = False
    """Stands for any number of people inside the box, none of whom must be found."""
    share: Fraction = 0.9
    """Of the frames in which he must be found, how many must have him."""
    facing: dict[Frame, Facing] = {}
    """Where his chest points, seen by the viewer of the picture."""
    points: dict[Frame, dict[str, tuple[Fraction, Fraction]]] = {}
    """Landmarks by name (`records.landmarks`), or `head`: the middle between the ears."""
    upright: tuple[Frame, ...] = ()
    """Frames in which his trunk is vertical in the world."""
    feet_m: dict[Frame, tuple[float, float]] = {}
    """Least and greatest height of his lower sole above the floor that most people of the clip stand on."""

    def boxes(self, num_frames: int) -> Float[Array, "frames 4"]:
        """His box in every frame; NaN where he is not in view."""
        rows = np.array(self.at, np.float64)
        boxes = np.stack([np.interp(np.arange(num_frames), rows[:, 0], rows[:, k]) for k in (1, 2, 3, 4)], axis=1)
        boxes[~(self.required(num_frames) | marked(self.maybe, num_frames))] = np.nan
        return boxes

    def required(self, num_frames: int) -> Bool[Array, " frames"]:
        """In which frames he must be found."""
        return marked(self.frames, num_frames)

    @model_validator(mode="after")
    def _complete(self) -> "ExpectedPerson":
        if not (self.frames or self.maybe):
            raise ValueError(f"{self.who}: `frames` or `maybe` is needed")
        if sorted({row[0] for row in self.at}) != [row[0] for row in self.at]:
            raise ValueError(f"{self.who}: the frames of `at` must rise")
        if self.crowd and self.frames:
            raise ValueError(f"{self.who}: a crowd has `maybe` only")
        return self


class ExpectedCut(_Entry):
    """A change of shot at [start, end); a hard cut has start == end == the first frame of the new shot."""

    start: Frame
    end: Frame
    linked: bool
    """Whether the new shot shows a place or a person that the clip has shown before."""


class GoldenClip(_Entry):
    """One clip and what must hold of it."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    shows: str
    """What is to be seen, in a sentence."""
    parts: Annotated[tuple[Part, ...], Field(min_length=1)]
    size: tuple[Annotated[int, Field(gt=0, multiple_of=2)], Annotated[int, Field(gt=0, multiple_of=2)]] | None = None
    """Width and height; the first part's unless given. Other parts fill it, what is too wide or high is cut off."""
    camera: Literal["static", "moving"] | None = None
    """None where nothing is to be said of it."""
    cuts: tuple[ExpectedCut, ...] = ()
    people: tuple[ExpectedPerson, ...] = ()
    """Nobody else must be found: what is not here is a bag, a poster, a statue, or nothing."""
    down_deg: dict[Frame, tuple[float, float]] = {}
    """By how much the camera looks below the horizon, least and most."""
    roll_deg: dict[Frame, tuple[float, float]] = {}
    """By how much the camera is rotated clockwise about its viewing direction, least and most."""

    @property
    def is_cut(self) -> bool:
        """Whether it must be made: it is not just a video of the folder."""
        part = self.parts[0]
        return len(self.parts) > 1 or part.frames is not None or part.crop != WHOLE or part.poster is not None


def marked(spans: tuple[Span, ...], num_frames: int) -> Bool[Array, " frames"]:
    """Which frames lie in one of the spans."""
    inside = np.zeros(num_frames, bool)
    for start, end in spans:
        inside[start:end] = True
    return inside
