"""How a verb is declared: the application, the options that verbs share, and how errors are reported."""

import inspect
import logging
from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_type_hints

import typer
from typer import Argument, Option
from typer.core import TyperCommand

from humanmm.cli.examples import epilog
from humanmm.cli.interrupts import INTERRUPTED, interruption
from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say
from humanmm.errors import HumanMMError, UsageError
from humanmm.logs import to_standard_error
from humanmm.tasks import pipeline
from humanmm.version import __version__

log = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., int | None])
STAGES = [stage.name for stage in pipeline.STAGES]
RECOVERY, RESULTS, BATCHES, STORE, BENCHMARK = "One video", "Results", "Many videos", "Store and machine", "Benchmark"
"""Panels of `humanmm --help`."""

# ---- options that several verbs have

if TYPE_CHECKING:
    StageName = str
else:
    StageName = Literal[tuple(STAGES)]
RunDir = Annotated[Path, Argument(metavar="RUN_DIR", help="a run folder", show_default=False)]
Store = Annotated[
    Path | None,
    Option(metavar="DIR|s3://…", help="artifact store (default: $HUMANMM_STORE, ~/.cache/humanmm/store)"),
]
Json = Annotated[bool, Option("--json", help="one json object, and nothing else on standard output")]
Force = Annotated[bool, Option("--force", help="replace what is there")]
Limit = Annotated[
    int | None,
    Option(metavar="N", min=1, help="videos at the same time (default: half the processors)"),
]
_VERBOSE = Annotated[bool, Option("--verbose", "-v", help="log every step, and where an error came from")]

# ---- the application


def _either_spelling(name: str) -> str:
    """`--people.max-people` is `--people.max_people`."""
    return name.replace("-", "_") if "." in name else name


def group(about: str) -> typer.Typer:
    """Verbs under one word."""
    return typer.Typer(
        help=about, rich_markup_mode="rich", pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"], "token_normalize_func": _either_spelling}
    )  # fmt: skip


app = group("One continuous human motion in one metric world, with the cameras, from a video with cuts.")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"humanmm {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, Option("--version", callback=_show_version, is_eager=True, help="the version")] = False,
) -> None:
    """One continuous human motion in one metric world, with the cameras, from a video with cuts."""


class _Command(TyperCommand):
    """A verb. An option whose metavar ends in … takes values one after the other: `--minutes 1 10`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        many = {flag for option in self.params if str(option.metavar).endswith("…") for flag in option.opts}
        words: list[str] = []
        current = ""
        for word in args:
            if word.startswith("-"):
                current = word if word in many else ""
            elif current and words[-1] != current:
                words.append(current)
            words.append(word)
        return super().parse_args(ctx, words)


def verb(parent: typer.Typer, name: str, *, panel: str | None = None) -> Callable[[F], F]:
    """Declare a function as a verb: its parameters are arguments and options, its docstring the help.

    A parameter whose type is a dataclass stands for the dataclass's fields, one of type Settings for all settings,
    one of type RunSettings for those of the section `run`.
    The function returns the exit status; None is 0.
    """

    def declare(function: F) -> F:
        kinds = get_type_hints(function, include_extras=True)
        own = inspect.signature(function).parameters.values()

        def run(**given: Any) -> int:
            verbose = given.pop("verbose")
            values = {parameter.name: _built(parameter.name, kinds[parameter.name], given) for parameter in own}
            return reported(lambda: function(**values), verbose=verbose)

        declared = [one for p in own for one in _declared(p.name, kinds[p.name], p.default)]
        verbose = inspect.Parameter("verbose", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_VERBOSE)
        run.__signature__ = inspect.Signature([*declared, verbose])  # type: ignore[attr-defined]
        run.__doc__ = function.__doc__
        named = _named(parent, name)
        parent.command(name, cls=_Command, rich_help_panel=panel, epilog=epilog(named))(run)
        return function

    return declare


def _named(parent: typer.Typer, name: str) -> str:
    """A verb with the words of the groups that hold it."""
    word = next((one.name for one in app.registered_groups if one.typer_instance is parent), None)
    return f"{word} {name}" if word else name


def _declared(name: str, kind: Any, default: Any) -> list[inspect.Parameter]:
    if isinstance(kind, type) and issubclass(kind, Settings):
        return list(kind.declared())
    if isinstance(kind, type) and is_dataclass(kind):
        kinds = get_type_hints(kind, include_extras=True)
        return [one for f in fields(kind) for one in _declared(f.name, kinds[f.name], _default_of(f))]
    return [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)]


def _default_of(field: "Field[Any]") -> Any:
    if field.default_factory is not MISSING:
        return field.default_factory()
    return inspect.Parameter.empty if field.default is MISSING else field.default


def _built(name: str, kind: Any, given: dict[str, Any]) -> Any:
    """The value of a parameter of a verb, from what Typer read."""
    if isinstance(kind, type) and issubclass(kind, Settings):
        return kind.given(given)
    if isinstance(kind, type) and is_dataclass(kind):
        kinds = get_type_hints(kind, include_extras=True)
        return kind(**{field.name: _built(field.name, kinds[field.name], given) for field in fields(kind)})
    return given[name]


def reported(run: Callable[[], int | None], *, verbose: bool) -> int:
    """The exit status; an error becomes one plain line on standard error, with -v its traceback before it."""
    to_standard_error(verbose=verbose)
    try:
        return run() or 0
    except BrokenPipeError:  # Typer ends quietly when the reader of its own output has left
        raise
    except (Exception, KeyboardInterrupt) as error:
        if verbose:
            log.exception("where it happened")
        words, status = _outcome(error)
        say(words)
        return status


def _outcome(error: BaseException) -> tuple[str, int]:
    """The message for an error, and the exit status."""
    if stopped := interruption(error):
        return f"{stopped}; resumable with the same command, what was computed stays in the store", INTERRUPTED
    match error:
        case UsageError():
            return str(error), 2
        case HumanMMError():
            return str(error), 1
        case _:
            return f"unexpected {type(error).__name__}: {error} (-v shows where)", 1
