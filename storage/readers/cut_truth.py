"""Folders of videos whose changes of shot are known: ours, and the BBC Planet Earth set for those who have it.

Ours: `<name>.mp4` beside `<name>.json` ({"transitions": [{"type", "start", "end"}]}, a hard cut has start == end) or
beside `<name>_gt.npz`. BBC Planet Earth (Baraldi et al. 2015), experimental, its layout known from its description
alone: `videos/bbc_01.mp4` … beside `fixed/01-….txt`, or videos beside `annotations/shots/<video's name>.txt`; a line of
such a file holds the first and last frame of a shot, counted from 0.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from humanmm.errors import InputError
from humanmm.storage.readers.truth import read_sequence

VIDEOS = (".mp4", ".mkv", ".avi", ".mov", ".webm")


@dataclass(frozen=True)
class CutClip:
    """One video and its true changes of shot [start, end)."""

    video: Path
    transitions: tuple[tuple[int, int], ...]


def read_cut_clips(folder: Path) -> list[CutClip]:
    """All videos of a folder whose cuts are known, by name. InputError where there is none."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one of videos beside their truths")
    clips = [*_bbc(folder)] or [clip for video in _videos(folder) if (clip := _ours(video)) is not None]
    if not clips:
        raise InputError(
            f"{folder} holds no video beside a <name>.json with transitions or a <name>_gt.npz, and neither "
            "fixed/*.txt nor annotations/shots/*.txt of BBC Planet Earth"
        )
    return clips


def _videos(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in VIDEOS) if folder.is_dir() else []


def _ours(video: Path) -> CutClip | None:
    sequence, table = video.with_name(f"{video.stem}_gt.npz"), video.with_suffix(".json")
    if sequence.is_file():
        return CutClip(video, read_sequence(sequence).transitions)
    if not table.is_file():
        return None
    try:
        tree = json.loads(table.read_text(encoding="utf-8"))
        spans = tuple((int(one["start"]), int(one["end"])) for one in tree["transitions"])
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise InputError(f"{table} is no list of transitions, each with whole numbers start and end") from None
    return CutClip(video, _checked(spans, table))


def _bbc(folder: Path) -> list[CutClip]:
    """The clips of a folder in one of the layouts of BBC Planet Earth; none if it has neither."""
    fixed, shots = sorted((folder / "fixed").glob("*.txt")), sorted((folder / "annotations" / "shots").glob("*.txt"))
    if not fixed and not shots:
        return []
    videos = _videos(folder / "videos") or _videos(folder)
    clips = []
    for table in fixed or shots:
        number = table.stem.split("-")[0]
        fits = [v for v in videos if v.stem == table.stem or (fixed and v.stem.removeprefix("bbc_") == number)]
        if not fits:
            wanted = f"videos/bbc_{number}.mp4" if fixed else f"{table.stem}.mp4"
            raise InputError(f"{table} has no video: {folder / wanted} is missing; get the BBC Planet Earth videos")
        clips.append(CutClip(fits[0], _between(table)))
    return clips


def _between(table: Path) -> tuple[tuple[int, int], ...]:
    """Transitions between shots that are listed by first and last frame; frames of no shot are gradual."""
    try:
        rows = [line.split()[:2] for line in table.read_text(encoding="utf-8").splitlines() if line.strip()]
        shots = [(int(first), int(last)) for first, last in rows]
    except (OSError, ValueError) as error:
        raise InputError(f"{table} is no list of shots (first and last frame a line): {error}") from None
    return _checked(tuple((before[1] + 1, after[0]) for before, after in pairwise(shots)), table)


def _checked(spans: Sequence[tuple[int, int]], table: Path) -> tuple[tuple[int, int], ...]:
    if any(start > end or start < 1 for start, end in spans) or any(b[0] < a[1] for a, b in pairwise(spans)):
        raise InputError(f"{table}: changes of shot must rise and not overlap, found {list(spans)[:6]}")
    return tuple(spans)
