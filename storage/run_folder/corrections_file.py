"""corrections.toml: read as a whole, written one correction at a time, so that what people wrote in it stays.

[[correction]]
kind = "remove-cut"
frame = 84
"""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from humanmm.config import Config
from humanmm.config_reading import read_toml
from humanmm.corrections import NONE, Correction, Corrections, read_corrections
from humanmm.errors import ConfigError
from humanmm.storage.store.files import replace_text

FILE = "corrections.toml"
_TITLE = """\
# Corrections of this video, in the order in which they apply: `humanmm recover` reads them.
# `humanmm correct RUN_DIR` writes them; docs/correct.md shows every kind. Frames count from 0, end is the first frame
# after a span, pixels are those of the upright video.
"""
_HEAD = re.compile(r"^\s*\[\[\s*correction\s*\]\]")


def read_file(path: Path) -> Corrections:
    """The corrections of a file. ConfigError names the file and what is wrong in it."""
    if not path.is_file():
        raise ConfigError(f"there is no file {path}; `humanmm correct RUN_DIR` writes corrections into the run folder")
    return read_corrections(read_toml(path), origin=str(path))


def of_folder(run_dir: Path) -> Corrections:
    """The corrections that a run folder holds; none without a file."""
    path = run_dir / FILE
    return read_file(path).model_copy(update={"of_run_folder": True}) if path.is_file() else NONE


def decided(config: Config, run_dir: Path, *, sha256: str | None = None) -> Config:
    """The configuration with the corrections that it names, or else those that the run folder holds, or none.

    `sha256` is that of the run's video: corrections in the folder that were written for another are left aside.
    """
    found = config.corrections
    if not found.is_decided:
        found = of_folder(run_dir).for_video(sha256)
    elif Path(found.origin).absolute() == (run_dir / FILE).absolute():
        found = found.model_copy(update={"of_run_folder": True})
    return config.model_copy(update={"corrections": found})


def corrected(config: Config, run_dir: Path, *, sha256: str | None = None) -> Config:
    """The configuration of a run with the corrections that its folder holds now, if it holds any."""
    return config.model_copy(update={"corrections": standing(config.corrections, run_dir, sha256=sha256)})


def standing(given: Corrections, run_dir: Path, *, sha256: str | None = None) -> Corrections:
    """The corrections of a finished run, `given` those that it was computed with: what its folder's file holds now;
    without one, those that came from elsewhere."""
    if (run_dir / FILE).is_file():
        return of_folder(run_dir).for_video(sha256)
    return NONE if given.of_run_folder else given


def begin(path: Path, corrections: Iterable[Correction], *, video: str) -> None:
    """Write a new file with corrections, a comment above each."""
    _replace(path, "\n".join([_head(video), *(_table(one, str(one)) for one in corrections)]))


def append(path: Path, correction: Correction, *, video: str, remark: str = "") -> None:
    """Add a correction at the end of a file, which is made if there is none; `remark`: a comment above it."""
    text = _read(path) if path.is_file() else _head(video)
    _replace(path, f"{text.rstrip()}\n\n{_table(correction, remark)}")


def _head(video: str) -> str:
    return f"{_TITLE}video = {_toml(video)}\n"


def _table(correction: Correction, remark: str) -> str:
    comment = f"# {' '.join(remark.split())}\n" if remark else ""
    values = correction.model_dump(mode="json", exclude_none=True)
    return f"{comment}[[correction]]\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in values.items())


def remove(path: Path, number: int) -> None:
    """Take a correction, counted from 1, out of a file, with the comments right above it; all else stays."""
    lines = _read(path).splitlines(keepends=True)
    begins = [_begin(lines, k) for k, line in enumerate(lines) if _HEAD.match(line)]
    if not 1 <= number <= len(begins):
        raise ConfigError(f"{path} has {len(begins)} tables [[correction]]; there is no number {number} to take out")
    if len(begins) != len(read_file(path).correction):
        raise ConfigError(f"where the corrections of {path} begin is not clear; take number {number} out by hand")
    end = begins[number] if number < len(begins) else len(lines)
    _replace(path, "".join(lines[: begins[number - 1]] + lines[end:]).rstrip() + "\n")


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8-sig")  # some editors write a byte order mark


def _begin(lines: list[str], head: int) -> int:
    """The first line of a correction: the comments right above its table belong to it."""
    while head and lines[head - 1].lstrip().startswith("#"):
        head -= 1
    return head


def _replace(path: Path, text: str) -> None:
    """Write the file if it can be read again."""
    try:
        read_corrections(tomllib.loads(text), origin=str(path))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} would not be TOML any more: {error}; put it right by hand") from None
    replace_text(path, text)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_toml(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(round(value, 4) if isinstance(value, float) else value)
