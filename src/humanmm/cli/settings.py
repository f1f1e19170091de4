"""The configuration on the command line: a TOML file and a flag `--STAGE.FIELD` for every field of the tree."""

import argparse
import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from humanmm.config import Config
from humanmm.errors import ConfigError, InputError


class UsageError(InputError):
    """A flag is wrong: exit status 2."""


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add `--config` and one flag per field; the field's sentence is its help."""
    parser.add_argument("--config", type=Path, metavar="FILE.toml", help="settings, e.g. [camera] static = true")
    for section, info in Config.model_fields.items():
        model = info.annotation
        assert isinstance(model, type) and issubclass(model, BaseModel)
        group = parser.add_argument_group(f"settings of {section}", description=model.__doc__)
        for name, field in model.model_fields.items():
            sentence = (field.description or "").replace("%", "%%")
            default = "" if field.default is None else f" (default: {str(field.default).replace('%', '%%')})"
            spellings = dict.fromkeys([f"--{section}.{name}", f"--{section}.{name.replace('_', '-')}"])
            group.add_argument(*spellings, dest=f"{section}.{name}", metavar="VALUE", help=sentence + default)


def load_config(arguments: argparse.Namespace, shorthands: Mapping[str, Any] | None = None) -> Config:
    """Defaults, then the file, then flags, then shorthands such as --person (`{"shots.person": 0}`).

    Raises ConfigError for the file and UsageError for flags, each in one sentence.
    """
    tree: dict[str, Any] = {}
    if arguments.config is not None:
        tree = read_toml(arguments.config)
        validate(tree, origin=str(arguments.config))
    flags = {name: _value(text) for name, text in vars(arguments).items() if "." in name and text is not None}
    for name, value in {**flags, **(shorthands or {})}.items():
        section, _, field = name.partition(".")
        tree = {**tree, section: {**tree.get(section, {}), field: value}}
    try:
        return validate(tree)
    except ConfigError as error:
        raise UsageError(str(error)) from None


def read_toml(path: Path) -> dict[str, Any]:
    """The tree of a TOML file; ConfigError if it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read the settings file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not TOML: {error}") from None


def validate(tree: Mapping[str, Any], *, origin: str = "") -> Config:
    """The configuration of a tree; ConfigError tells the first thing that is wrong with it, in one sentence."""
    try:
        return Config.model_validate(tree)
    except ValidationError as error:
        raise ConfigError(f"{origin}: {_first(error)}" if origin else _first(error)) from None


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _names_beside(first["loc"])
        close = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(known) or 'none'}"
        return f"unknown setting {place}; {hint}"
    message = first["msg"][:1].lower() + first["msg"][1:]
    return f"setting {place}: {message}, not {first['input']!r}"


def _names_beside(place: tuple[int | str, ...]) -> list[str]:
    if len(place) < 2:
        return list(Config.model_fields)
    info = Config.model_fields.get(str(place[0]))
    model = info.annotation if info else None
    return list(model.model_fields) if isinstance(model, type) and issubclass(model, BaseModel) else []


def _value(text: str) -> Any:
    """A flag's text; `none` clears a value, lists are written as in TOML, pydantic reads the rest."""
    if text.lower() == "none":
        return None
    if text.startswith("["):
        try:
            return tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            return text
    return text
