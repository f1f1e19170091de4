"""What a run would do: every unit is cached, will run, or depends on the result of another one.

`cached` and `will run` are never wrong: a key is only known when everything that it is made of is known.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from humanmm.errors import MissingInputError
from humanmm.storage.store.codec import Json
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.unit import Unit

State = Literal["cached", "will run", "depends"]


@dataclass(frozen=True)
class Forecast:
    """What would become of one unit; `unit` is `every scene` or `every shot` while these are unknown."""

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
    """The whole plan, in the order of the pipeline. Enters the artifacts that the store has in `run.outcomes`."""
    plan: list[Forecast] = []
    for stage in run.stages:
        units = run.units(stage)
        if units is None:
            definer = next(s.name for s in run.stages if s.defines == stage.per)
            plan.append(Forecast(stage.name, f"every {stage.per}", None, "depends", definer))
        else:
            plan += [_forecast_one(run, unit) for unit in units]
    return plan


def check_upstream(run: VideoRun, plan: Sequence[Forecast], only: str) -> None:
    """MissingInputError if an artifact is missing before STAGE of `--only STAGE`, which computes nothing there."""
    before = run.upstream(run.stage(only))
    for entry in plan:
        if entry.stage in before and entry.state != "cached":
            unit = "" if entry.unit == "video" else f" ({entry.unit})"
            reason = entry.reason if entry.state == "will run" else f"it depends on {entry.reason}'s result"
            raise MissingInputError(
                f"--only {only} needs the artifact of {entry.stage}{unit}, which the store does not have: {reason}; "
                "run without --only"
            )


def is_complete(plan: Sequence[Forecast]) -> bool:
    """True when the store has every artifact."""
    return all(entry.state == "cached" for entry in plan)


def _forecast_one(run: VideoRun, unit: Unit) -> Forecast:
    stage = unit.stage
    shot = unit.index if stage.per == "shot" else None
    missing = _missing_input(run, unit)
    if missing is not None:
        return Forecast(stage.name, unit.name, shot, "depends", missing)
    forced = run.selection.forces(stage, unit.index, run.stages)
    if not forced and run.look_up(unit) is not None:
        return Forecast(stage.name, unit.name, shot, "cached")
    only = run.selection.only
    if not forced and only is not None and stage.name not in run.upstream(run.stage(only)):
        return Forecast(stage.name, unit.name, shot, "depends", only)
    return Forecast(stage.name, unit.name, shot, "will run", run.why(unit))


def _missing_input(run: VideoRun, unit: Unit) -> str | None:
    """Name of the first input stage whose artifact this run does not have yet."""
    for name in unit.stage.inputs:
        source = run.stage(name)
        if run.units(source) is None or any(run.manifest(*u.id) is None for u in run.inputs_of(unit, source)):
            return name
    return None
