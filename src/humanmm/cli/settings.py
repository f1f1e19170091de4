"""The configuration on the command line: a TOML file and a flag `--STAGE.FIELD` for every field of the tree."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from humanmm.config import Config
from humanmm.config_reading import read_toml, validate, value_of, with_values
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
    flags = {name: value_of(text) for name, text in vars(arguments).items() if "." in name and text is not None}
    try:
        return validate(with_values(tree, {**flags, **(shorthands or {})}))
    except ConfigError as error:
        raise UsageError(str(error)) from None
