"""What a run would do, told without doing it: every stage × unit is cached, will run, or depends on another's result.

What is called cached or will run is never wrong: a key is only known when everything that it is made of is known.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from humanmm.errors import MissingInputError
from humanmm.storage.store.codec import Json
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.units import Work
from humanmm.tasks.pipeline import Stage

State = Literal["cached", "will run", "depends"]


@dataclass(frozen=True)
class Forecast:
    """What would become of one stage × unit; `unit` is `every scene` or `every shot` while these are not known."""

    stage: str
    unit: str
    shot: int | None
    state: State
    reason: str = ""

    @property
    def sentence(self) -> str:
        return {
            "cached": "cached",
            "will run": f"will run: {self.reason}",
            "depends": f"depends on {self.reason}'s result",
        }[self.state]

    def to_json(self) -> dict[str, Json]:
        return asdict(self)


def forecast(run: VideoRun) -> list[Forecast]:
    """The whole plan, in the order of the pipeline. What the store has is noted in `run.outcomes` on the way."""
    plan: list[Forecast] = []
    for stage in run.stages:
        works = run.works(stage)
        if works is None:
            definer = next(s.name for s in run.stages if s.defines == stage.per)
            plan.append(Forecast(stage.name, f"every {stage.per}", None, "depends", definer))
        else:
            plan += [_forecast_one(run, work) for work in works]
    return plan


def check_upstream(run: VideoRun, plan: Sequence[Forecast], only: str) -> None:
    """`--only STAGE` computes nothing before STAGE: what is missing there is an error that names it."""
    before = run.upstream(run.stage(only))
    for entry in plan:
        if entry.stage in before and entry.state != "cached":
            place = "" if entry.unit == "video" else f" ({entry.unit})"
            reason = entry.reason if entry.state == "will run" else f"it depends on {entry.reason}'s result"
            raise MissingInputError(
                f"--only {only} needs the artifact of {entry.stage}{place}, which the store does not have: {reason}; "
                "run without --only"
            )


def is_complete(plan: Sequence[Forecast]) -> bool:
    """True when the store can answer everything."""
    return all(entry.state == "cached" for entry in plan)


def _forecast_one(run: VideoRun, work: Work) -> Forecast:
    waiting = _waits_for(run, work)
    shot = work.index if work.stage.per == "shot" else None
    if waiting is not None:
        return Forecast(work.stage.name, work.unit, shot, "depends", waiting)
    forced = run.selection.forces(work.stage, work.index, run.stages)
    if not forced and run.look_up(work) is not None:
        return Forecast(work.stage.name, work.unit, shot, "cached")
    only = run.selection.only
    if not forced and only is not None and work.stage.name not in run.upstream(run.stage(only)):
        return Forecast(work.stage.name, work.unit, shot, "depends", only)
    return Forecast(work.stage.name, work.unit, shot, "will run", run.why(work))


def _waits_for(run: VideoRun, work: Work) -> str | None:
    """Name of the first input stage whose result is not there yet."""
    for name in work.stage.inputs:
        source: Stage = run.stage(name)
        units = run.works(source)
        if units is None or any(run.manifest(name, need.index) is None for need in run.needs_from(work, source)):
            return name
    return None
