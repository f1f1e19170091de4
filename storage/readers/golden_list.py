"""The golden set's list of clips and expectations: a TOML file with a table [[clip]] for each."""

import tomllib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from humanmm.errors import InputError
from humanmm.models.benchmark.expectations import GoldenClip


class _List(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    clip: tuple[GoldenClip, ...]


def read_golden_list(path: Path) -> tuple[GoldenClip, ...]:
    """All clips in their order; InputError that names the first thing that is wrong."""
    try:
        clips = _List.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).clip
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"{path}: {place}: {first['msg']} (found {first['input']!r:.80})") from None
    names = [clip.name for clip in clips]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{path}: several clips are named {', '.join(twice)}")
    return clips
