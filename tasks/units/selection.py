"""Which stages the user wants computed again, whatever the store holds."""

from pydantic import BaseModel, ConfigDict

from humanmm.errors import InputError, UsageError
from humanmm.tasks.pipeline import Stage


class Selection(BaseModel):
    """`recover --force`, `--from STAGE`, `--only STAGE`, `--shot N`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    force: bool = False
    """Compute every stage again."""
    start: str | None = None
    """Compute this stage and everything after it again."""
    only: str | None = None
    """Compute this stage again, then what depends on it if its output changed; all before it must be in the store."""
    shot: int | None = None
    """Restrict `start` and `only` to one shot in stages that are per shot; 0-based."""

    def check(self, stages: tuple[Stage, ...]) -> list[str]:
        """InputError for flags that contradict each other; returns remarks for the user."""
        names = [stage.name for stage in stages]
        for name in (self.start, self.only):
            if name is not None and name not in names:
                raise UsageError(f"there is no stage {name!r}; stages are {', '.join(names)}")
        if sum([self.force, self.start is not None, self.only is not None]) > 1:
            raise UsageError("choose one of --force, --from and --only")
        if self.shot is None:
            return []
        if self.shot < 0:
            raise UsageError(f"--shot {self.shot} is negative; the first shot is 0")
        if self.start is None and self.only is None:
            raise UsageError("--shot needs --from STAGE or --only STAGE")
        chosen = [stage for stage in stages if self._names(stage, names)]
        ignoring = [stage.name for stage in chosen if stage.per != "shot"]
        if not ignoring:
            return []
        return [f"--shot {self.shot} is ignored by {', '.join(ignoring)}: not computed per shot"]

    def check_shot(self, num_shots: int) -> None:
        """InputError for a shot that the video does not have."""
        if self.shot is not None and self.shot >= num_shots:
            raise InputError(f"--shot {self.shot}: the video has {num_shots} shots, 0 to {num_shots - 1}")

    def forces(self, stage: Stage, index: int, stages: tuple[Stage, ...]) -> str | None:
        """The flag that has this unit computed again; None if its artifact in the store may be used."""
        if self.force:
            return "--force"
        if not self._names(stage, [s.name for s in stages]):
            return None
        if stage.per == "shot" and self.shot is not None and index != self.shot:
            return None
        return f"--from {self.start}" if self.start is not None else f"--only {self.only}"

    def _names(self, stage: Stage, names: list[str]) -> bool:
        if self.start is not None:
            return names.index(stage.name) >= names.index(self.start)
        return stage.name == self.only
