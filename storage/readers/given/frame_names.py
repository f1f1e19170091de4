"""Which frame of a video a file shows, by the file's name, and whether its numbers fit the video."""

import re

from humanmm.errors import InputError

MAX_EXTRA_FRAMES = 2
"""Decoders disagree about the last frames of a video."""
EARLY = 0.97
"""Part of the video before whose end files of another frame rate end: of 24 Hz in 25 at 0.96."""


def frame_number(name: str) -> int:
    """The last number in a file's name, without folder and ending; InputError where it has none."""
    found = re.findall(r"\d+", name.rsplit("/", 1)[-1].rsplit(".", 1)[0])
    if not found:
        raise InputError(f"no number in the name {name!r} says which frame it is")
    return int(found[-1])


def doubts(what: str, first: int, last: int, num_frames: int, *, sure_of_first: bool = False) -> tuple[str, ...]:
    """Warnings if a file that goes from frame `first` to `last`, counted from 0, may count otherwise than the video, of
    `num_frames`; `sure_of_first`: the file's layout says from where it counts."""
    found = []
    if last + 1 + MAX_EXTRA_FRAMES < EARLY * num_frames:
        found.append(
            f"given {what} end at frame {last}, the video at {num_frames - 1}: were they found in it at another frame "
            "rate? Nobody is followed after that"
        )
    return (*found, *(() if sure_of_first else doubt_of_first(what, first)))


def doubt_of_first(what: str, first: int) -> tuple[str, ...]:
    """A warning if frames, counted from 0, begin at 1: the program may have counted from 1."""
    if first != 1:
        return ()
    return (
        f"given {what} begin at frame 1, and are taken as counted from 0: if their first picture has number 1, "
        "subtract 1 from every frame number in the file",
    )
