"""What a user knows better than the program: corrections of one video, in the order in which they apply.

They stand in `corrections.toml`, an array `[[correction]]` of tables, each with its `kind`. Whoever a correction is
about is named by where he is seen in a picture, not by his number: numbers change when people are found anew. Frames
count from 0, spans are [start, end), pixels belong to the upright picture. docs/correct.md shows each kind.
"""

import difflib
import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from humanmm.errors import ConfigError

Frame = Annotated[int, Field(ge=0)]
Pixel = tuple[float, float]
Json = dict[str, Any]


class _Entry(BaseModel):
    """Base of what a file says: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)


class Who(_Entry):
    """The person who is seen at a place in a frame."""

    frame: Frame
    """A frame in which he is seen."""
    x: float
    """A pixel on him; the middle of his box is best."""
    y: float
    number: int | None = None
    """His number when this was written; people read it, programs do not."""

    def __str__(self) -> str:
        name = "the person" if self.number is None else f"person {self.number}"
        return f"{name} (at {self.x:.0f}, {self.y:.0f} in frame {self.frame})"


class Correction(_Entry):
    """One correction."""

    kind: str

    @property
    def facts(self) -> Json:
        """What it says, without what only people read: part of the keys of the stages that use it."""
        return _without_numbers(self.model_dump(mode="json", exclude_none=True))

    @property
    def identity(self) -> str:
        """Its facts as text: two corrections that say the same have the same."""
        return json.dumps(self.facts, sort_keys=True)


class _InSpan(Correction):
    """A correction that holds in some frames."""

    start: Frame
    """First frame."""
    end: Frame
    """First frame after it."""

    @model_validator(mode="after")
    def _in_order(self) -> "_InSpan":
        if self.end <= self.start:
            raise ValueError(f"end = {self.end} is not after start = {self.start}; end is the first frame after it")
        return self

    @property
    def span(self) -> str:
        """Its frames in words."""
        return f"frames {self.start} to {self.end - 1}"


class AddCut(Correction):
    """A cut that was not found; one found within two frames of it gives way."""

    kind: Literal["add-cut"] = "add-cut"
    frame: Annotated[int, Field(ge=1)]
    """First frame of the new shot; of a gradual transition its first frame."""
    end: Frame | None = None
    """Of a gradual transition: the first frame after it."""

    @model_validator(mode="after")
    def _in_order(self) -> "AddCut":
        if self.end is not None and self.end <= self.frame:
            raise ValueError(f"end = {self.end} is not after frame = {self.frame}; leave it out for a hard cut")
        return self

    def __str__(self) -> str:
        if self.end is None:
            return f"a cut at frame {self.frame}"
        return f"a gradual transition in frames {self.frame} to {self.end - 1}"


class RemoveCut(Correction):
    """A cut or gradual transition that is none."""

    kind: Literal["remove-cut"] = "remove-cut"
    frame: Frame
    """First frame of the shot that it begins, or a frame of the gradual transition."""

    def __str__(self) -> str:
        return f"no cut at frame {self.frame}"


class SamePerson(Correction):
    """Two people are one."""

    kind: Literal["same-person"] = "same-person"
    who: Who
    other: Who

    def __str__(self) -> str:
        return f"{self.who} and {self.other} are one"


class Nobody(Correction):
    """A bag, a poster, a reflection; or somebody who is not wanted."""

    kind: Literal["nobody"] = "nobody"
    who: Who

    def __str__(self) -> str:
        return f"{self.who} is nobody"


class Swap(_InSpan):
    """Two people were taken for each other in some frames."""

    kind: Literal["swap"] = "swap"
    who: Who
    other: Who

    def __str__(self) -> str:
        return f"{self.who} and {self.other} change places in {self.span}"


class Sides(_InSpan):
    """Somebody's left and right are wrong in some frames."""

    kind: Literal["sides"] = "sides"
    who: Who
    joint: Literal["shoulder", "wrist", "hip", "knee", "ankle"] | None = None
    """The joint whose true places `left` and `right` are, in the frame of `who`; without it, what was found is
    swapped."""
    left: Pixel | None = None
    right: Pixel | None = None

    @model_validator(mode="after")
    def _whole(self) -> "Sides":
        given = [self.joint is not None, self.left is not None, self.right is not None]
        if any(given) and not all(given):
            raise ValueError("joint, left and right go together; give all of them or none")
        if all(given) and not self.start <= self.who.frame < self.end:
            raise ValueError(f"who.frame = {self.who.frame} is not in {self.span}; left and right belong to that frame")
        return self

    def __str__(self) -> str:
        return f"left and right of {self.who} are the other way round in {self.span}"


class StaticShot(Correction):
    """A static camera."""

    kind: Literal["static-shot"] = "static-shot"
    frame: Frame
    """A frame of the shot."""

    def __str__(self) -> str:
        return f"the camera is static in the shot of frame {self.frame}"


MAX_FOCAL_PX = 1_000_000
"""Of the longest lens of the largest picture a few times as much as there is."""


class Focal(Correction):
    """The focal length of the video."""

    kind: Literal["focal"] = "focal"
    px: Annotated[float, Field(gt=0, le=MAX_FOCAL_PX)]
    """Pixels of the video."""

    def __str__(self) -> str:
        return f"the focal length is {self.px:g} px"


class Height(Correction):
    """How tall somebody stands."""

    kind: Literal["height"] = "height"
    who: Who
    metres: Annotated[float, Field(ge=0.5, le=2.6)]
    """From the soles to the top of the head, without hat and heels."""

    def __str__(self) -> str:
        return f"{self.who} is {self.metres:.2f} m tall"


class Floor(Correction):
    """Where the floor is."""

    kind: Literal["floor"] = "floor"
    metres: Annotated[float, Field(ge=-10, le=10)]
    """Height of the true floor above the one that is found without this correction."""

    def __str__(self) -> str:
        side = "above" if self.metres >= 0 else "below"
        return f"the floor is {abs(self.metres):g} m {side} the one that is found"


class Exclude(_InSpan):
    """Frames in which nothing that is seen of somebody, or of anybody, is to be believed."""

    kind: Literal["exclude"] = "exclude"
    who: Who | None = None
    """Everybody if not given."""

    def __str__(self) -> str:
        return f"nothing is observed of {self.who or 'anybody'} in {self.span}"


class Main(Correction):
    """Who is person 0."""

    kind: Literal["main"] = "main"
    who: Who

    def __str__(self) -> str:
        return f"{self.who} is the main person"


AnyCorrection = Annotated[
    AddCut | RemoveCut | SamePerson | Nobody | Swap | Sides | StaticShot | Focal | Height | Floor | Exclude | Main,
    Field(discriminator="kind"),
]
KINDS: tuple[type[Correction], ...] = get_args(get_args(AnyCorrection)[0])
NAMES = tuple(str(kind.model_fields["kind"].default) for kind in KINDS)
ONCE = ("focal", "floor", "main")
"""Kinds of which a video has one at most."""
C = TypeVar("C", bound=Correction)


class Corrections(_Entry):
    """All corrections of one video, in the order in which they apply."""

    origin: str = ""
    """The file that they come from, or `none` where none are wanted; where it is empty, `corrections.toml` of the run
    folder is looked for."""
    of_run_folder: bool = False
    """Whether that is the run folder's own file: wherever the folder is by now, they are gone when it is."""
    video: str | None = None
    """sha256 of the video that they were written for."""
    correction: tuple[AnyCorrection, ...] = ()
    left_aside: tuple[AnyCorrection, ...] = ()
    """Those of the run folder's file if that was written for another video than the run's: none is applied."""

    @model_validator(mode="after")
    def _once(self) -> "Corrections":
        kinds: list[str] = [one.kind for one in self.correction]
        for kind in ONCE:
            if kinds.count(kind) > 1:
                raise ValueError(f"there are {kinds.count(kind)} corrections of kind {kind}; keep one of them")
        return self

    def of(self, kind: type[C]) -> tuple[C, ...]:
        """Those of one kind."""
        return tuple(one for one in self.correction if isinstance(one, kind))

    def for_video(self, sha256: str | None) -> "Corrections":
        """These, or all of them left aside if they were written for another video; None: of which it is is unknown."""
        if not self.video or sha256 in (None, self.video):
            return self
        return self.model_copy(update={"correction": (), "left_aside": self.correction})

    def chosen(self, kinds: Iterable[str], span: tuple[int, int] | None = None) -> "Corrections":
        """Those of some kinds; with the span of a shot, of those about one shot only its own."""
        wanted = set(kinds)
        kept = tuple(
            one
            for one in self.correction
            if one.kind in wanted
            and (span is None or not isinstance(one, StaticShot) or span[0] <= one.frame < span[1])
        )
        return Corrections(correction=kept)

    @property
    def facts(self) -> dict[str, Json]:
        """Number, from 1, → what the correction says."""
        return {str(number): one.facts for number, one in enumerate(self.correction, start=1)}

    @property
    def is_decided(self) -> bool:
        """Whether it is known which corrections are wanted: no file is looked for."""
        return bool(self.origin or self.correction)


NONE = Corrections(origin="none")


def read_corrections(tree: Mapping[str, Any], *, origin: str = "") -> Corrections:
    """The corrections that a tree holds; ConfigError names the first mistake, where it is, and what to do."""
    place = origin or "corrections"
    try:
        return Corrections.model_validate({**tree, "origin": origin or tree.get("origin", "")})
    except ValidationError as error:
        raise ConfigError(f"{place}{_first(error, tree)}") from None


def make(kind: type[C], **facts: Any) -> C:
    """A correction of a kind; ConfigError names the limits of a value that is beyond them."""
    try:
        return kind(**facts)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(kind.model_fields["kind"].default)
        if not first["loc"]:
            raise ConfigError(f"{name}: {first['msg'].removeprefix('Value error, ')}") from None
        key, value = str(first["loc"][0]), first["input"]
        shown = f"{value:g}" if isinstance(value, float) else repr(value)
        raise ConfigError(f"{name}: {key} must be {_limits(kind, key) or first['msg']}, not {shown}") from None


_LIMITS = {"gt": "more than", "ge": "at least", "lt": "less than", "le": "at most"}


def _limits(kind: type[Correction], key: str) -> str:
    marks = kind.model_fields[key].metadata
    known = [(words, getattr(one, limit)) for one in marks for limit, words in _LIMITS.items() if hasattr(one, limit)]
    return " and ".join(f"{words} {limit:,}" for words, limit in known)


def _first(error: ValidationError, tree: Mapping[str, Any]) -> str:
    first = error.errors()[0]
    at, kind, value = first["loc"], first["type"], first["input"]
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if not at or at[0] != "correction" or len(at) < 2:
        key = ".".join(str(part) for part in at)
        if kind == "extra_forbidden":
            return f": unknown key {key!r}; corrections stand in tables [[correction]], each with its kind"
        return f": {key + ': ' if key else ''}{message}"
    number = int(at[1]) + 1
    entries = tree.get("correction")
    entry = entries[number - 1] if isinstance(entries, list | tuple) else None
    named = entry.get("kind") if isinstance(entry, Mapping) else None
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        if named is None:
            return f", correction {number}: it has no kind; kinds are {', '.join(NAMES)}"
        close = difflib.get_close_matches(str(named), NAMES, n=1)
        hint = f"did you mean {close[0]}?" if close else f"kinds are {', '.join(NAMES)}"
        return f", correction {number}: kind {named!r} is unknown; {hint}"
    where, key = f", correction {number} ({named})", ".".join(str(part) for part in at[3:])
    if kind == "missing":
        return f"{where}: {key} is missing; add it (docs/correct.md shows the kind)"
    if kind == "extra_forbidden":
        known = _fields_of(str(named), at[3:-1])
        return f"{where}: unknown key {key}; keys are {', '.join(known)}"
    shown = f", not {value!r}" if key else ""
    return f"{where}: {key + ': ' if key else ''}{message}{shown}"


def _fields_of(kind: str, inner: tuple[int | str, ...]) -> list[str]:
    model: type[BaseModel] = Who if inner else KINDS[NAMES.index(kind)]
    return list(model.model_fields)


def _without_numbers(facts: Json) -> Json:
    return {
        name: _without_numbers(value) if isinstance(value, dict) else value
        for name, value in facts.items()
        if name != "number"
    }
