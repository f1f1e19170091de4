"""The configuration on the command line: a TOML file, and a flag `--STAGE.FIELD` for every field of the tree."""

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from typer import Option

from humanmm import parts
from humanmm.config import Config, GivenFile
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
            return resolve(from_file, {name: value_of(name, text) for name, text in self.flags.items()} | shorthands)
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
        for section in Config.model_fields:
            if section != "corrections":  # they come from a file of their own
                yield from _flags(section)

    @classmethod
    def given(cls, arguments: Mapping[str, Any]) -> "Settings":
        """What the user gave, from the values of `declared`."""
        flags = {name.replace("__", ".", 1): text for name, text in arguments.items() if "__" in name and text}
        return cls(arguments.get("config"), flags)


class RunSettings(Settings):
    """The settings of the section `run` alone."""

    def values(self) -> dict[str, Any]:
        """What the flags say, by `run.FIELD`; UsageError for one that makes no sense."""
        self.config()
        return {name: value_of(name, text) for name, text in self.flags.items()}

    @classmethod
    def declared(cls) -> Iterator[inspect.Parameter]:
        """A flag for each field."""
        return _flags("run")


def _flags(section: str) -> Iterator[inspect.Parameter]:
    model = Config.model_fields[section].annotation
    assert isinstance(model, type) and issubclass(model, BaseModel)
    panel = f"{section}: {_short(model.__doc__ or '')}"
    for name, field in model.model_fields.items():
        values = Values.of(f"{section}.{name}", field)
        default = "" if field.default is None else f" (default: {_as_typed(field.default)})"
        text = f"{field.description}{values.note}{default}".replace("[", "\\[")  # rich would take it for markup
        flag = Option(
            f"--{section}.{name}", metavar=values.metavar, help=text, rich_help_panel=panel,
            autocompletion=values.complete,
        )  # fmt: skip
        yield _option(f"{section}__{name}", str, flag)


@dataclass(frozen=True)
class Values:
    """What a setting takes, as help and completion say it."""

    metavar: str
    choices: tuple[str, ...] = ()
    note: str = ""
    """What does not fit into the metavar: choices of a long list, bounds."""

    @classmethod
    def of(cls, setting: str, field: FieldInfo) -> "Values":
        """The values of the field that a setting (`section.field`) stands for."""
        kind = _plain_type(field.annotation)
        if setting in parts.BUILT_IN:
            return cls._one_of(tuple(parts.BUILT_IN[setting]))
        if get_origin(kind) is Literal:
            return cls._one_of(get_args(kind))
        if kind is bool:
            return cls._one_of(("true", "false"))
        names = {int: "INT", float: "FLOAT", str: "TEXT", GivenFile: "PATH"}
        bounds = _bounds(field.metadata or _metadata(field.annotation))
        return cls(names.get(kind, "VALUE"), note=f" ({bounds})" if bounds else "")

    @classmethod
    def _one_of(cls, choices: tuple[str, ...]) -> "Values":
        named = "|".join(choices)
        return cls(named, choices) if len(named) <= _WIDEST else cls("NAME", choices, f" ({', '.join(choices)})")

    def complete(self, incomplete: str) -> list[str]:
        """The choices that begin like what was typed."""
        return [choice for choice in self.choices if choice.startswith(incomplete)]


_WIDEST = 24


def _plain_type(annotation: Any) -> Any:
    """The type without `Annotated` and without None."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    inner = [one for one in get_args(annotation) if one is not type(None)]
    if get_origin(annotation) in (Union, UnionType) and len(inner) == 1:
        return _plain_type(inner[0])
    return annotation


def _metadata(annotation: Any) -> tuple[Any, ...]:
    """What `Annotated` adds to a type that may also be None."""
    if get_origin(annotation) is Annotated:
        return tuple(get_args(annotation)[1:])
    return tuple(one for inner in get_args(annotation) for one in _metadata(inner))


def _bounds(metadata: Iterable[Any]) -> str:
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    flat = [one for item in metadata for one in (getattr(item, "metadata", None) or [item])]
    found = [f"{sign} {getattr(one, name)}" for one in flat for name, sign in signs.items() if hasattr(one, name)]
    return ", ".join(found)


def _as_typed(value: Any) -> str:
    """A default as the user would type it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _short(sentence: str) -> str:
    """As much of a section's sentence as fits into the title of a panel."""
    return re.split(r" \(|: |\.$", sentence)[0]


def _option(name: str, kind: type, option: Any) -> inspect.Parameter:
    annotation = Annotated[kind | None, option]  # type: ignore[valid-type]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
