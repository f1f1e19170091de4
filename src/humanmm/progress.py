"""What a run does now, stage by stage: on a terminal and in a notebook, nothing anywhere else.

The display begins before anything large is imported. It says what happens between the stages (reading the file,
starting Prefect's server), then for every stage and every shot at work how many frames are done of how many, how fast,
and how long it will take.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from humanmm.logs import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

    from humanmm.tasks.engine.run import VideoRun
    from humanmm.tasks.units.artifacts import Outcome
    from humanmm.tasks.units.unit import Unit

State = Literal["waiting", "working", "done", "cached", "failed", "skipped"]
COST_MS = {
    "decode": 1.0, "scenes": 4.0, "people": 210.0, "points": 11.0, "shots": 4.0, "keyframes": 3.0, "intrinsics": 12.0,
    "camera": 25.0, "hmr": 12.0, "align": 15.0, "refine": 10.0, "deliver": 9.0,
}  # fmt: skip
"""Milliseconds a frame of each stage on two busy cores: their ratios forecast the time of stages that are to come."""
REFRESH_HZ = 4.0
MEASURED_S = 1.0
"""A rate measured for less time says nothing."""
_MARKS = {"waiting": " ", "working": "▸", "done": "✓", "cached": "✓", "failed": "✗", "skipped": "–"}
_STYLES = {"waiting": "dim", "working": "bold", "cached": "dim", "failed": "red", "skipped": "yellow"}


@dataclass
class _Work:
    """One unit: a stage on the video, a scene or a shot. `frames` is how many it is about; 0 while unknown."""

    label: str
    stage: str
    frames: int
    state: State = "working"
    done: int = 0
    begun: float = 0.0
    ended: float = 0.0

    @property
    def rate(self) -> float | None:
        """Frames a second, by what it reported; None while that says nothing."""
        seconds = (self.ended or time.monotonic()) - self.begun
        return self.done / seconds if self.done and seconds > MEASURED_S else None


@dataclass
class Watch:
    """What is known of a run while it goes on. Many threads may call it."""

    title: str = ""
    stages: Sequence[str] = ()
    clock: "Clock" = field(default_factory=lambda: Clock())
    _run: "VideoRun | None" = None
    _work: dict[str, _Work] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _begun: float = field(default_factory=time.monotonic)
    _step: str = "starting"
    _step_begun: float = field(default_factory=time.monotonic)

    def step(self, what: str) -> None:
        """Say what happens outside the stages, until the next stage begins."""
        self._step, self._step_begun = what, time.monotonic()

    def follow(self, run: "VideoRun") -> None:
        """Show the units of a run from now on."""
        self._run = run
        run.listen(self.report)
        run.on_begin, run.on_end = self.begin, self.end

    def begin(self, unit: "Unit") -> None:
        """A unit is computed from now on."""
        with self._lock:
            work = _Work(unit.label, unit.stage.name, self._frames(unit), begun=time.monotonic())
            self._work[unit.label] = work
            self._step = ""

    def report(self, unit: "Unit", done: int, total: int) -> None:
        """So much of a unit is done."""
        with self._lock:
            work = self._work.get(unit.label)
            if work is None:
                work = self._work[unit.label] = _Work(unit.label, unit.stage.name, total, begun=time.monotonic())
            work.done, work.frames = done, total

    def end(self, outcome: "Outcome") -> None:
        """A unit was found, computed, skipped, or has failed."""
        unit = outcome.unit
        with self._lock:
            new = _Work(unit.label, unit.stage.name, self._frames(unit), begun=time.monotonic())
            work = self._work.setdefault(unit.label, new)
            work.state = "done" if outcome.state == "computed" else outcome.state
            work.frames = work.frames or self._frames(unit)
            work.done, work.ended = work.frames, time.monotonic()

    def _frames(self, unit: "Unit") -> int:
        start, end = unit.span
        return end - start if unit.stage.per != "video" else self._all_frames()

    def _all_frames(self) -> int:
        """How many frames the video has; 0 while nobody knows."""
        from humanmm.models.records.video import VideoFacts
        from humanmm.tasks.units.unit import Unit

        facts = self._run.read_once(Unit(self._run.stages[0]), VideoFacts) if self._run is not None else None
        return facts.num_frames if facts is not None else 0

    # ---- what is shown

    def __rich_console__(self, console: "Console", options: "ConsoleOptions") -> "RenderResult":
        from rich.text import Text

        with self._lock:
            elapsed, left = time.monotonic() - self._begun, self.clock.left_s(self._by_stage(), self._whole())
            ahead = f", about {in_time(left)} left" if left is not None else ""
            step = f"▸ {self._step} …  {in_time(time.monotonic() - self._step_begun)}" if self._step else ""
            table = self._table(options.max_height - 3)
        yield Text(
            f"{printable(self.title or 'video')}: {in_time(elapsed)}{ahead}",
            style="bold",
            no_wrap=True,
            overflow="ellipsis",
        )
        yield table
        if step:
            yield Text(f" {step}", style="bold", no_wrap=True, overflow="ellipsis")

    def _table(self, height: int) -> "Table":
        """At most so many lines of stages and units."""
        from rich.table import Table

        table = Table(box=None, padding=(0, 1), show_header=False)
        for name in ("mark", "what", "frames", "speed", "left"):
            table.add_column(name, justify="right" if name in ("frames", "speed", "left") else "left", no_wrap=True)
        rows = [row for stage in self.stages for row in self._rows(stage)]
        for row, style in rows[: max(0, height)]:
            table.add_row(*row, style=style)
        return table

    def _whole(self) -> int:
        return max((work.frames for works in self._by_stage().values() for work in works), default=0)

    def _by_stage(self) -> Mapping[str, Sequence[_Work]]:
        return {s: [work for work in self._work.values() if work.stage == s] for s in self.stages}

    def _rows(self, stage: str) -> Iterator[tuple[tuple[str, ...], str]]:
        """A line for a stage, and one for each of its scenes or shots at work where it has several."""
        works, total = self._by_stage()[stage], self._total(stage)
        at_work = [work for work in works if work.state == "working"]
        state = self._state(works, total)
        done = sum(work.done for work in works)
        units = self._units(stage)
        name = stage if units < 2 else f"{stage} · {len(works) - len(at_work)} of {units} {self._kind(stage)}s"
        yield self._row(name, state, done, total, works), _STYLES.get(state, "")
        if units > 1:
            for work in at_work:
                name = work.label.partition(" · ")[2]
                yield self._row(f"  {name}", "working", work.done, work.frames, [work]), ""

    def _row(self, name: str, state: State, done: int, total: int, works: Sequence[_Work]) -> tuple[str, ...]:
        speed = left = ""
        if state == "working":
            rates = [work.rate for work in works if work.state == "working" and work.rate is not None]
            begun = min((work.begun for work in works if work.state == "working"), default=time.monotonic())
            speed = f"{sum(rates):.1f} frames/s" if rates else in_time(time.monotonic() - begun)
            seconds = self.clock.stage_left_s(works, total)
            left = f"{in_time(seconds)} left" if seconds is not None else ""
        elif state in ("done", "failed"):
            speed = f"{sum(work.ended - work.begun for work in works if work.state != 'cached'):.1f} s"
        elif state in ("cached", "skipped"):
            speed = "in the store" if state == "cached" else "skipped"
        frames = f"{done} of {total} frames" if total and state != "waiting" else ""
        return _MARKS[state], name, frames, speed, left

    def _total(self, stage: str) -> int:
        """Frames of all units of a stage."""
        return max(self._all_frames(), sum(work.frames for work in self._by_stage()[stage]))

    def _units(self, stage: str) -> int:
        if self._run is None:
            return 1
        return len(self._run.units(self._run.stage(stage)) or ())

    def _kind(self, stage: str) -> str:
        return self._run.stage(stage).per if self._run is not None else "video"

    def _state(self, works: Sequence[_Work], total: int) -> State:
        states: set[State] = {work.state for work in works}
        if not works:
            return "waiting"
        if "working" in states or (sum(work.done for work in works) < total and "failed" not in states):
            return "working"
        order: tuple[State, ...] = ("failed", "done", "skipped", "cached")
        return next(state for state in order if state in states)


class Clock:
    """How long a run will take: from the rates that stages report, and from what stages usually cost."""

    def stage_left_s(self, works: Sequence[_Work], total: int) -> float | None:
        """Seconds until a stage is done with all `total` frames; None if unknown."""
        at_work = [work for work in works if work.state == "working"]
        if not at_work or not total:
            return None
        rates = [work.rate for work in at_work if work.rate is not None]
        if rates:
            return (total - sum(work.done for work in works)) / sum(rates)
        if at_work[0].stage not in COST_MS:
            return None
        ended = sum(work.frames for work in works if work.state != "working")
        expected = COST_MS[at_work[0].stage] * (total - ended) / 1000
        rest = expected - (time.monotonic() - min(work.begun for work in at_work))
        return rest if rest > 0 else None

    def left_s(self, by_stage: Mapping[str, Sequence[_Work]], num_frames: int) -> float | None:
        """Seconds until the last stage is done; None while nothing was measured.

        Stages that did not begin take their usual time, on a machine as fast as those that did show.
        """
        measured = usual = ahead = 0.0
        for stage, works in by_stage.items():
            cost_s = COST_MS.get(stage, 0.0) / 1000
            total = max(num_frames, sum(work.frames for work in works))
            seconds = self.stage_left_s(works, total)
            if seconds is not None:
                ahead += seconds
            for work in works:
                if work.state in ("done", "working") and work.done:
                    measured += (work.ended or time.monotonic()) - work.begun
                    usual += cost_s * work.done
        waiting = [stage for stage, works in by_stage.items() if not works]
        if usual < 0.2 or not num_frames:
            return None
        slowness = min(max(measured / usual, 0.2), 5.0)
        return ahead + sum(COST_MS.get(stage, 0.0) / 1000 * num_frames for stage in waiting) * slowness


def in_time(seconds: float) -> str:
    """`0:07`, `12:30`, `1:02:03`."""
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}" if minutes >= 60 else f"{minutes}:{rest:02d}"


@contextmanager
def watching(title: str = "", *, shown: bool = True) -> Iterator[Watch]:
    """Show a run while the context lasts, if somebody watches: on a terminal or in a notebook."""
    from humanmm.tasks import pipeline

    watch = Watch(title, [stage.name for stage in pipeline.STAGES])
    if not shown or not _is_watched():
        yield watch
        return
    from rich.console import Console
    from rich.live import Live

    live = Live(
        watch, console=Console(stderr=True), transient=True, refresh_per_second=REFRESH_HZ, redirect_stdout=False
    )
    try:
        with contextlib.suppress(OSError):  # the terminal may have been closed: the run goes on
            live.start(refresh=True)
        yield watch
    finally:
        with contextlib.suppress(OSError):
            live.stop()


@contextmanager
def counted(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar while something is drawn, if somebody watches: call it with the frames done and all frames."""
    if not _is_watched():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True, redirect_stdout=False)
    task = bar.add_task(printable(what), total=None)
    try:
        with contextlib.suppress(OSError):
            bar.start()
        yield lambda done, total: bar.update(task, completed=done, total=total)
    finally:
        with contextlib.suppress(OSError):
            bar.stop()


def _is_watched() -> bool:
    return sys.stderr.isatty() or "ipykernel" in sys.modules
