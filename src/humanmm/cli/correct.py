"""`humanmm correct RUN_DIR …`: writes down what the user knows better; `humanmm recover` then computes what changes."""

from collections.abc import Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from humanmm.cli.terminal import say, write, write_path
from humanmm.cli.verb import RESULTS, Store, app, group, reported, verb
from humanmm.errors import UsageError

if TYPE_CHECKING:
    from humanmm.correcting import Corrector
    from humanmm.corrections import Correction
    from humanmm.tasks.engine.plan import Forecast

correct = group("Put right what a run got wrong: cuts, people, left and right, camera, height, floor.")
app.add_typer(correct, name="correct", rich_help_panel=RESULTS)
_folder: ContextVar[Path] = ContextVar("run folder that is corrected")

Number = Annotated[int, Argument(metavar="PERSON", help="number of a person", show_default=False)]
Other = Annotated[int, Argument(metavar="OTHER", help="number of another person", show_default=False)]
FrameNumber = Annotated[int, Argument(metavar="FRAME", help="frame, from 0", show_default=False)]
From = Annotated[int, Option("--from", metavar="FRAME", help="first frame", show_default=False)]
To = Annotated[int, Option("--to", metavar="FRAME", help="first frame after them", show_default=False)]


@dataclass(frozen=True, kw_only=True)
class Then:
    """What is done once the correction is written."""

    recover: Annotated[bool, Option("--recover", help="compute at once what changes")] = False
    store: Store = None


@correct.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    run_dir: Annotated[Path, Argument(metavar="RUN_DIR", help="a run folder", show_default=False)],
) -> int | None:
    """Put right what a run got wrong. Without a command: list the corrections of a run.

    Corrections stand in RUN_DIR/corrections.toml, which `humanmm recover` reads (docs/correct.md).
    """
    _folder.set(run_dir)
    return reported(_list, verbose=False) if context.invoked_subcommand is None else None


# ---- cuts and shots


@verb(correct, "add-cut")
def add_cut(
    frame: FrameNumber,
    then: Then,
    *,
    to: Annotated[int | None, Option("--to", metavar="FRAME", help="of a dissolve: first frame after it")] = None,
) -> int:
    """A cut was missed: FRAME is the first of the new shot."""
    return _write([_corrector().add_cut(frame, to)], then)


@verb(correct, "remove-cut")
def remove_cut(frame: FrameNumber, then: Then) -> int:
    """There is no cut at FRAME."""
    return _write([_corrector().remove_cut(frame)], then)


@verb(correct, "static-shot")
def static_shot(
    shot: Annotated[int, Argument(metavar="SHOT", help="number of a shot, from 0", show_default=False)], then: Then
) -> int:
    """The camera is static in SHOT."""
    return _write([_corrector().static_shot(shot)], then)


# ---- people


@verb(correct, "same-person")
def same_person(person: Number, other: Other, then: Then) -> int:
    """PERSON and OTHER are one."""
    return _write([_corrector().same_person(person, other)], then)


@verb(correct, "nobody")
def nobody(person: Number, then: Then) -> int:
    """PERSON is nobody: a bag, a poster, a reflection."""
    return _write([_corrector().nobody(person)], then)


@verb(correct, "swap")
def swap(person: Number, other: Other, then: Then, *, start: From, end: To) -> int:
    """PERSON and OTHER were taken for each other in some frames."""
    return _write([_corrector().swap(person, other, start, end)], then)


@verb(correct, "sides")
def sides(
    person: Number,
    then: Then,
    *,
    start: Annotated[int | None, Option("--from", metavar="FRAME", help="first frame (default: all of his)")] = None,
    end: Annotated[int | None, Option("--to", metavar="FRAME", help="first frame after them")] = None,
) -> int:
    """Left and right of PERSON are the wrong way round."""
    return _write(_corrector().sides(person, start, end), then)


@verb(correct, "height")
def height(
    person: Number,
    metres: Annotated[float, Argument(metavar="METRES", help="standing, without shoes", show_default=False)],
    then: Then,
) -> int:
    """PERSON is so many METRES tall."""
    corrector = _corrector()
    correction = corrector.height(person, metres)
    say(f"person {person} stands {corrector.height_of(person):.2f} m tall in the run")
    return _write([correction], then)


@verb(correct, "exclude")
def exclude(
    start: Annotated[int, Argument(metavar="FROM", help="first frame", show_default=False)],
    end: Annotated[int, Argument(metavar="TO", help="first frame after them", show_default=False)],
    then: Then,
    *,
    person: Annotated[int | None, Option(metavar="N", help="of this person alone (default: of everybody)")] = None,
) -> int:
    """Believe nothing that was seen in some frames: they are filled in."""
    return _write([_corrector().exclude(start, end, person)], then)


@verb(correct, "main")
def main(
    x: Annotated[float, Argument(metavar="X", help="a pixel on the person", show_default=False)],
    y: Annotated[float, Argument(metavar="Y", show_default=False)],
    then: Then,
    *,
    time: Annotated[float | None, Option(metavar="S", help="when, in seconds from the first frame on")] = None,
    frame: Annotated[int | None, Option(metavar="FRAME", help="or in which frame")] = None,
) -> int:
    """The main person, number 0, is at X, Y."""
    if (time is None) == (frame is None):
        raise UsageError("give --time S or --frame FRAME, one of them")
    corrector = _corrector()
    at = frame if frame is not None else corrector.frame_at(time or 0.0)
    correction = corrector.main(x, y, at)
    if correction.who.number is None:
        say(f"nobody of the run is at {x:g}, {y:g} in frame {at}; somebody who was left out of it may be")
    return _write([correction], then)


# ---- the world


@verb(correct, "focal")
def focal(
    px: Annotated[float, Argument(metavar="PX", help="pixels of the video", show_default=False)], then: Then
) -> int:
    """The focal length is PX."""
    return _write([_corrector().focal(px)], then)


@verb(correct, "floor")
def floor(
    then: Then,
    *,
    rise: Annotated[float | None, Option("--raise", metavar="M", help="it is M metres higher than z = 0")] = None,
    lower: Annotated[float | None, Option("--lower", metavar="M", help="it is M metres lower than z = 0")] = None,
) -> int:
    """The floor is higher or lower than z = 0 of the run."""
    if (rise is None) == (lower is None):
        raise UsageError("give --raise M or --lower M, one of them")
    return _write([_corrector().floor(rise if rise is not None else -(lower or 0.0))], then)


# ---- what was written


@verb(correct, "undo")
def undo(
    then: Then,
    *,
    number: Annotated[
        int | None, Argument(metavar="NUMBER", help="as listed by `humanmm correct RUN_DIR` (default: the last)")
    ] = None,
) -> int:
    """Take a correction out again."""
    from humanmm.correcting import take_out

    _check_video(then)
    _take_over()
    write(f"taken out: {take_out(_folder.get(), number)}")
    return _then(then)


def _list() -> None:
    from humanmm.correcting import states

    entries = states(_folder.get())
    for number, (one, state) in enumerate(entries, start=1):
        write(f"{number}  {one}  [{state}]")
    if not entries:
        say(f"{_folder.get()} has no corrections; `humanmm correct --help` lists what can be corrected")


def _path() -> Path:
    from humanmm.storage.run_folder.corrections_file import FILE

    return _folder.get() / FILE


def _corrector() -> "Corrector":
    import humanmm
    from humanmm.correcting import Corrector, pending_of

    run = humanmm.load(_folder.get())
    return Corrector(run.recording, run.record, pending_of(run.folder))


def _write(corrections: "Sequence[Correction]", then: Then) -> int:
    from humanmm.correcting import enter

    _check_video(then)
    _take_over()
    for correction in corrections:
        entered = enter(_folder.get(), correction)
        for one in entered.removed:
            write(f"taken out: {one}")
        if entered.number is not None:
            write(f"correction {entered.number}: {correction}")
        elif not entered.removed:
            say(f"{_path()} says so already: {correction}")
    return _then(then)


def _check_video(then: Then) -> None:
    """InputError if another video has taken the place of the run's: corrections would be of one, and computed of the
    other."""
    from humanmm.errors import InputError
    from humanmm.tasks.engine.reopened import reopen

    record, run = reopen(_folder.get(), then.store)
    if run.video.sha256 != record["video"]["sha256"]:
        raise InputError(
            f"{run.video.path} is not the video of this run any more, and nothing was written; put the video back, or "
            "recover the new one into another folder with --out"
        )


def _take_over() -> None:
    """Have corrections that the run was given with `--corrections` stand in its folder, and say so."""
    from humanmm.correcting import take_over
    from humanmm.storage.run_folder.summary import counted

    given = take_over(_folder.get())
    if given.correction:
        found = f"{counted(len(given.correction), 'correction', 'corrections')} of {given.origin or 'the caller'}"
        say(f"{found} written into {_path()}, which counts from now on: leave --corrections out")


def _then(then: Then) -> int:
    """Say what the corrections change, or compute it."""
    import humanmm
    from humanmm.cli.recover import report
    from humanmm.tasks.engine.plan import forecast
    from humanmm.tasks.engine.reopened import reopen

    folder = _folder.get()
    _, run = reopen(folder, then.store)
    if then.recover:
        store = run.store.location
        return report(humanmm.recover(run.video.path, folder, config=run.config, store=store), then.store)
    for line in _plan(forecast(run)):
        write(line)
    say(f"`humanmm recover {run.video.path} --out {folder}` computes it, with the flags of the run; or --recover here")
    write_path(_path())
    return 0


def _plan(entries: "Sequence[Forecast]") -> list[str]:
    """What will run, what may follow, and what stays, in three lines at most."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        units = [] if entry.unit in ("video", "every shot", "every scene") else [entry.unit]
        known = found.setdefault(f"{entry.state}:{entry.stage}", [])
        known += units
    lines = []
    for state, title in (
        ("will run", "will be computed"),
        ("depends", "then, as far as their inputs change"),
        ("cached", "kept"),
    ):
        names = [
            key.partition(":")[2] + (f" ({', '.join(units)})" if units and state == "will run" else "")
            for key, units in found.items()
            if key.startswith(f"{state}:")
        ]
        if names:
            lines.append(f"{title}: {', '.join(names)}")
    return lines
