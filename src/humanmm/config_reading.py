"""Settings from what people write: TOML files, flags, manifest columns; an error is one sentence."""

import difflib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from humanmm.config import Config
from humanmm.errors import ConfigError


def read_toml(path: Path) -> dict[str, Any]:
    """The tree of a TOML file; ConfigError if it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors write a byte order mark
    except OSError as error:
        raise ConfigError(f"cannot read the settings file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path} holds lists in lists without end") from None


def validate(tree: Mapping[str, Any], *, origin: str = "") -> Config:
    """The configuration of a tree; ConfigError names the first thing that is wrong with it, in one sentence."""
    try:
        return Config.model_validate(tree)
    except ValidationError as error:
        raise ConfigError(f"{origin}: {_first(error)}" if origin else _first(error)) from None


def with_values(tree: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """A tree with single values replaced, each named `section.field`."""
    changed = dict(tree)
    for name, value in values.items():
        section, _, field = name.partition(".")
        changed = with_sections(changed, {section: {field: value}})
    return changed


def with_sections(tree: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """A tree with the values of another in place of its own. A section that is none stays, for `validate` to refuse."""
    changed = dict(tree)
    for section, values in other.items():
        own = changed.get(section, {})
        if isinstance(own, Mapping):
            changed[section] = {**own, **values} if isinstance(values, Mapping) else values
    return changed


SHORTHANDS = {
    "person": "shots.person",
    "min_confidence": "shots.min_confidence",
    "focal_px": "intrinsics.focal_px",
    "fov_deg": "intrinsics.fov_deg",
    "hands": "people.hands",
    "hmr_from": "people.hmr_from",
    "keypoints_from": "people.keypoints_from",
    "detections_from": "people.detections_from",
    "masks_from": "people.masks_from",
    "cameras_from": "intrinsics.cameras_from",
}
"""Short name, of a flag or an argument → setting."""


def resolve(
    config: Config | Mapping[str, Any] | str | os.PathLike[str] | None, values: Mapping[str, Any] | None = None
) -> Config:
    """A configuration, its tree, or the path of its TOML file (default: nothing set), with some values replaced.

    Values are named `section.field` or as in SHORTHANDS. ConfigError names the file if the file is wrong.
    """
    if isinstance(config, str | os.PathLike):
        tree = read_toml(Path(config))
        validate(tree, origin=os.fspath(config))
    else:
        tree = config.model_dump() if isinstance(config, Config) else dict(config or {})
    return validate(with_values(tree, {SHORTHANDS.get(name, name): value for name, value in (values or {}).items()}))


def value_of(setting: str, text: str) -> Any:
    """A flag's text as a value of the setting `section.field`; `none` clears a value that need not be given (of others
    it may be a name), lists and tables are written as in TOML, pydantic reads the rest."""
    if text.lower() == "none" and _may_be_missing(setting):
        return None
    if text.startswith(("[", "{")):
        try:
            return tomllib.loads(f"value = {text}")["value"]
        except (tomllib.TOMLDecodeError, RecursionError):
            return text
    return text


def _may_be_missing(setting: str) -> bool:
    section, _, name = setting.partition(".")
    info = Config.model_fields.get(section)
    fields = getattr(info.annotation, "model_fields", {}) if info else {}
    return name in fields and NoneType in get_args(fields[name].annotation)


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _names_beside(first["loc"])
        close = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(known) or 'none'}"
        return f"unknown setting {place}; {hint}"
    if first["type"] == "stated":
        return first["msg"]
    message = first["msg"][:1].lower() + first["msg"][1:]
    return f"setting {place}: {message}, not {first['input']!r}"


def _names_beside(place: tuple[int | str, ...]) -> list[str]:
    if len(place) < 2:
        return list(Config.model_fields)
    info = Config.model_fields.get(str(place[0]))
    model = info.annotation if info else None
    return list(model.model_fields) if isinstance(model, type) and issubclass(model, BaseModel) else []
