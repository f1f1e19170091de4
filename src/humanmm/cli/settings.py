"""The configuration on the command line: a TOML file, and a flag `--STAGE.FIELD` for every field of the tree."""

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel
from typer import Option

from humanmm.config import Config
from humanmm.config_reading import resolve, value_of
from humanmm.errors import ConfigError, UsageError


@dataclass(frozen=True)
class Settings:
    """What the user gave: a verb with a parameter of this type takes `--config` and all flags."""

    file: Path | None
    flags: Mapping[str, str]
    """`section.field` → text."""

    def config(self, **shorthands: Any) -> Config:
        """Defaults, then the file, then flags, then values such as `person=0`.

        Raises ConfigError for the file and UsageError for flags, each in one sentence.
        """
        from_file = resolve(self.file)
        try:
            return resolve(from_file, {name: value_of(text) for name, text in self.flags.items()} | shorthands)
        except ConfigError as error:
            raise UsageError(str(error)) from None

    def words(self) -> list[str]:
        """They as words of a command; a settings file is named as such, without its path."""
        flags = [word for name, text in sorted(self.flags.items()) for word in (f"--{name}", text)]
        return [*(["--config", self.file.name] if self.file else []), *flags]

    @classmethod
    def declared(cls) -> Iterator[inspect.Parameter]:
        """`--config`, and a flag for each field; the field's sentence is its help, a section is a panel."""
        text = "settings, e.g. a section \\[camera] with static = true; flags win over it"
        yield _option("config", Path, Option("--config", metavar="FILE.toml", help=text))
        for section, info in Config.model_fields.items():
            if section == "corrections":  # they come from a file of their own
                continue
            model = info.annotation
            assert isinstance(model, type) and issubclass(model, BaseModel)
            panel = f"{section}: {_short(model.__doc__ or '')}"
            for name, field in model.model_fields.items():
                default = "" if field.default is None else f" (default: {field.default})"
                text = f"{field.description}{default}".replace("[", "\\[")  # rich would take it for markup
                flag = Option(f"--{section}.{name}", metavar="VALUE", help=text, rich_help_panel=panel)
                yield _option(f"{section}__{name}", str, flag)

    @classmethod
    def given(cls, arguments: Mapping[str, Any]) -> "Settings":
        """What the user gave, from the values of `declared`."""
        flags = {name.replace("__", ".", 1): text for name, text in arguments.items() if "__" in name and text}
        return cls(arguments["config"], flags)


def _short(sentence: str) -> str:
    """As much of a section's sentence as fits into the title of a panel."""
    return re.split(r" \(|: |\.$", sentence)[0]


def _option(name: str, kind: type, option: Any) -> inspect.Parameter:
    annotation = Annotated[kind | None, option]  # type: ignore[valid-type]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
