"""The videos of a batch: what lies in a folder, or what a CSV or JSON-lines file lists.

    video,priority,tags,out,camera.static          {"video": "a/*.mp4", "priority": "high", "tags": ["gym"],
    clips/one.mp4,high,gym;night,,true              "out": "one", "settings": {"camera": {"static": true}}}

`video` may be a pattern. Relative paths count from the manifest's own folder; `out` from the batch's output folder.
What lies in a run folder or store is humanmm's own: neither a folder nor a pattern finds it, the name of a file does.
"""

import csv
import io
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

from humanmm.config_reading import value_of, with_values
from humanmm.errors import InputError
from humanmm.machine import expanded
from humanmm.storage.batches.own_folders import OwnFolderSearch, foreign, is_run

SUFFIXES = frozenset(
    {
        ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".3gp", ".wmv",
        ".flv", ".ogv",
    }
)  # fmt: skip
PRIORITIES = ("high", "normal", "low")
SHOWN_MISTAKES = 20
"""Of a manifest; so many fit on a terminal, and the same mistake in every line is seen."""
_COLUMNS = ("video", "priority", "tags", "out")


@dataclass(frozen=True)
class Entry:
    """One video of a batch as the user wants it."""

    video: Path
    """Absolute."""
    priority: str = ""
    """high, normal or low; empty if it names none."""
    tags: tuple[str, ...] = ()
    out: str | None = None
    """Run folder, relative to the batch's output folder."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """A tree of settings that differ from the batch's."""
    origin: str = ""
    """The file and line that names it, for error messages."""
    is_named: bool = True
    """Whether it is named itself; False if a pattern has found it."""

    def with_defaults(self, *, priority: str, tags: Sequence[str]) -> "Entry":
        """The same with what it does not name itself."""
        return replace(self, priority=self.priority or priority, tags=tuple(dict.fromkeys((*self.tags, *tags))))

    def same_wish(self, other: "Entry") -> bool:
        """True if both ask for the same, whichever line asks."""
        return replace(self, origin="", is_named=True) == replace(other, origin="", is_named=True)


def read_batch(source: Path, *, pattern: str | None = None) -> list[Entry]:
    """Every video of a folder (at any depth) or of a manifest, each once, in order. InputError names what is wrong.

    A line that names a video counts more than one whose pattern finds it; two of a kind must ask for the same.
    """
    if source.is_dir():
        entries = videos_in(source, pattern=pattern)
        hint = f"{source} holds no video" + (f" named {pattern}" if pattern else "")
    else:
        if pattern is not None:
            raise InputError("--glob goes with a folder; a manifest has its patterns in `video`")
        entries = _listed_in(source)
        hint = f"{source} lists no video"
    if not entries:
        raise InputError(f"{hint}; videos end in {', '.join(sorted(SUFFIXES))}")
    by_path: dict[Path, Entry] = {}
    mistakes = []
    for entry in sorted(entries, key=lambda entry: not entry.is_named):
        known = by_path.setdefault(entry.video, entry)
        if known.is_named == entry.is_named and not known.same_wish(entry):
            other = entry.origin.removeprefix(f"{source}, ")
            mistakes.append(f"{known.origin}, and {other} want different things of {entry.video}; keep one of them")
    _raise(mistakes)
    return [by_path[video] for video in dict.fromkeys(entry.video for entry in entries)]


def videos_in(folder: Path, *, pattern: str | None = None) -> list[Entry]:
    """Every video of a folder, at any depth, in order; there may be none. Run folders and a store in it are left
    out. InputError if it lies in one."""
    own = OwnFolderSearch().around(folder)
    if own is not None:
        raise InputError(f"{folder} is in a run folder or store ({own}) with humanmm's own films; name a video's file")
    found = sorted(path for path in _videos_below(folder.absolute(), pattern) if _is_file_or_link(path))
    return [Entry(path, origin=str(folder)) for path in found]


def _videos_below(top: Path, pattern: str | None) -> Iterator[Path]:
    wanted = ("**", *Path(pattern or "*").parts)
    for place, folders, names in os.walk(top):
        here, inside = [*names, *folders], Path(place)
        folders[:] = foreign(here, folders)
        found = [] if is_run(here) else [path for path in map(inside.joinpath, names) if _is_video(path)]
        yield from (path for path in found if pattern is None or _matches(path.relative_to(top).parts, wanted))


def _matches(parts: Sequence[str], pattern: Sequence[str]) -> bool:
    """Whether a relative path fits a pattern as `Path.glob` reads it."""
    if not parts or not pattern:
        return not parts and not pattern
    if pattern[0] == "**":
        return any(_matches(parts[start:], pattern[1:]) for start in range(len(parts)))
    return fnmatchcase(parts[0], pattern[0]) and _matches(parts[1:], pattern[1:])


def _is_video(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def _is_file_or_link(path: Path) -> bool:
    """Whether it is a file, or a link to nothing: that one is kept, and fails with its reason."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def _listed_in(source: Path) -> list[Entry]:
    """The videos of all lines of a manifest; InputError names every line that is wrong."""
    own, entries, mistakes = OwnFolderSearch(), list[Entry](), list[str]()
    for read in _read_manifest(source):
        try:
            entries += _expanded(read(), source, own)
        except InputError as error:
            mistakes.append(str(error))
    _raise(mistakes)
    return entries


def _raise(mistakes: Sequence[str]) -> None:
    """InputError with the first SHOWN_MISTAKES of them, if there is one."""
    if mistakes:
        more = [f"and {len(mistakes) - SHOWN_MISTAKES} more mistakes"] if len(mistakes) > SHOWN_MISTAKES else []
        raise InputError("\n".join([*mistakes[:SHOWN_MISTAKES], *more]))


def _read_manifest(source: Path) -> Iterator[Callable[[], Entry]]:
    """For each line a function that returns its entry, or raises what is wrong with it."""
    try:
        text = source.read_bytes().decode("utf-8-sig")  # names keep their kind of newline
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror}; give a folder, a .csv or a .jsonl file") from None
    except UnicodeDecodeError:
        raise InputError(f"{source} is not UTF-8 text; give a folder, a .csv or a .jsonl file") from None
    if source.suffix.lower() == ".csv":
        yield from _read_csv(text, source)
    elif source.suffix.lower() in (".jsonl", ".ndjson"):
        yield from _read_json_lines(text, source)
    else:
        raise InputError(f"{source} is neither a folder nor a .csv or .jsonl manifest")


def _read_csv(text: str, source: Path) -> Iterator[Callable[[], Entry]]:
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    try:
        _check_header(reader.fieldnames or (), f"{source}, line 1")
        for row in reader:
            yield partial(_csv_entry, row, f"{source}, line {reader.line_num}")
    except csv.Error as error:
        raise InputError(f"{source}, line {reader.line_num}: {error}") from None


def _check_header(header: Sequence[str], origin: str) -> None:
    if any(";" in name for name in header):
        raise InputError(f"{origin}: columns are separated by commas, not by semicolons")
    names = [name.strip() for name in header]
    unknown = [name for name in names if name not in _COLUMNS and "." not in name]
    if unknown:
        raise InputError(f"{origin}: unknown column {unknown[0]!r}; known: {', '.join(_COLUMNS)}, STAGE.FIELD")
    if names and "video" not in names:
        raise InputError(f"{origin}: the column `video` is missing")


def _csv_entry(row: Mapping[str | None, Any], origin: str) -> Entry:
    if None in row or None in row.values():
        raise InputError(f"{origin}: it has not as many columns as the first line")
    columns = {str(name).strip(): value.strip() for name, value in row.items()}
    values = {name: value_of(name, value) for name, value in columns.items() if "." in name and value}
    tags = tuple(filter(None, (tag.strip() for tag in columns.get("tags", "").split(";"))))
    return _entry(columns, tags, with_values({}, values), origin)


def _read_json_lines(text: str, source: Path) -> Iterator[Callable[[], Entry]]:
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            yield partial(_json_entry, line, f"{source}, line {number}")


def _json_entry(line: str, origin: str) -> Entry:
    try:
        tree = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{origin}: {error}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{origin}: a line is one object with `video`")
    unknown = set(tree) - {*_COLUMNS, "settings"}
    if unknown:
        raise InputError(f"{origin}: unknown key {min(unknown)!r}; known: {', '.join(_COLUMNS)}, settings")
    tags, settings = tree.get("tags", []), tree.get("settings", {})
    if not isinstance(tags, list) or not isinstance(settings, dict):
        raise InputError(f"{origin}: `tags` is a list and `settings` an object")
    return _entry(tree, tuple(str(tag) for tag in tags), settings, origin)


def _entry(columns: Mapping[str, Any], tags: tuple[str, ...], settings: Mapping[str, Any], origin: str) -> Entry:
    video, priority = columns.get("video") or "", columns.get("priority") or ""
    if not isinstance(video, str) or not video:
        raise InputError(f"{origin}: `video` is missing")
    if not isinstance(columns.get("out") or "", str) or "\0" in video + (columns.get("out") or ""):
        raise InputError(f"{origin}: `video` and `out` are paths")
    if priority and priority not in PRIORITIES:
        raise InputError(f"{origin}: priority {priority!r} is none of {', '.join(PRIORITIES)}")
    return Entry(Path(video), priority, tags, columns.get("out") or None, settings, origin)


def _expanded(listed: Entry, source: Path, own: OwnFolderSearch) -> Iterator[Entry]:
    """An entry per file that its pattern finds outside humanmm's folders; a file that is named and not there stays, and
    fails with its reason."""
    folder = source.absolute().parent
    path = folder / expanded(listed.video)
    found, is_named = [path], True
    if not path.exists() and any(c in str(listed.video) for c in "*?["):
        anchor, is_named = Path(path.anchor), False
        try:
            matches = list(anchor.glob(str(path.relative_to(anchor))))
        except ValueError as error:
            raise InputError(f"{listed.origin}: the pattern {listed.video} cannot be read: {error}") from None
        found = sorted(match for match in matches if _is_file_or_link(match) and own.around(match.parent) is None)
        if listed.out is not None and len(found) > 1:
            raise InputError(f"{listed.origin}: `out` names one run folder, {listed.video} {len(found)} videos")
    for match in found:
        yield replace(listed, video=match, is_named=is_named)
