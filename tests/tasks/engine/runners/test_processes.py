"""Stages in child processes: the same results, and an end that is one."""

import contextlib
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import SECTIONS_OF_NO_STAGE, Config, RunConfig, StageLimits
from humanmm.errors import ResourceError, StageError, StoreError, TimeLimitError
from humanmm.tasks import pipeline
from humanmm.tasks.engine.budget import Budget, resources_of
from humanmm.tasks.engine.runners.job import Setting
from humanmm.tasks.engine.runners.runner import workers_of
from humanmm.tasks.pipeline import Resources
from humanmm.tasks.units.faults import as_ours, is_infrastructure_fault, ran_out_of_memory


def _children_of(pid: int) -> list[int]:
    """Processes below one that compute stages."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == pid and b"humanmm.tasks.engine.runners.processes" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


@pytest.fixture(autouse=True)
def no_child_is_left() -> Iterator[None]:
    yield
    assert _children_of(os.getpid()) == []


def test_children_give_the_same_results_as_threads_and_are_used_again(toy: Any) -> None:
    run = toy.run(run={"isolate": True})
    assert {outcome.state for outcome in run.outcomes.values()} == {"computed"}
    assert len(toy.executed()) == len(run.outcomes)
    toy.run()
    assert toy.executed() == [], "keys and content are the same"


def test_a_failed_shot_costs_the_stages_in_children_that_shot_alone(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOY_FAIL", "camera:20=stage")
    run = toy.run(run={"isolate": True}, expect_failure=True)
    lost = {unit for unit, outcome in run.outcomes.items() if outcome.state != "computed"}
    assert lost == {("camera", 1), ("hmr", 1)}
    toy.executed()
    toy.run(expect_failure=True)
    assert toy.executed() == ["camera:20"], "keys are the same as in one process"


def test_damage_to_what_lists_the_units_is_mended_when_a_child_finds_it(toy: Any) -> None:
    run = toy.open(run={"isolate": True})
    for stage in run.stages:
        for unit in run.units(stage) or ():
            if stage.name == "hmr" and unit.index == 0:
                run._workers.close()  # the next child reads everything afresh
                run._workers = workers_of(Setting(run.video, run.config, run.store, run.selection, run.stages))
                result = run.store.root / run.manifest("scenes").ref.uri / "result.json"
                result.write_text(result.read_text() + " ")
                with pytest.raises(StoreError, match="scenes"):
                    run.execute(unit)
            run.execute(unit)
    run.close()
    assert toy.executed().count("scenes") == 2
    assert {outcome.state for outcome in run.outcomes.values()} == {"computed"}


def test_a_stage_over_its_limit_is_really_ended_and_the_others_go_on(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    toy.run()
    toy.executed()
    monkeypatch.setenv("TOY_SLEEP", "camera:20=60")
    began = time.monotonic()
    limits = {"stages": {"camera": {"limit_s": 4}}}
    run = toy.run(camera={"static": True}, run=limits, expect_failure=True)
    assert time.monotonic() - began < 40
    lost = run.outcomes["camera", 1]
    assert isinstance(lost.error, TimeLimitError) and lost.attempts == 1
    assert "took longer than its limit of 4 s" in lost.reason
    assert run.outcomes["camera", 2].state == run.outcomes["deliver", 0].state == "computed"
    assert not is_infrastructure_fault(lost.error), "it would take as long again"
    monkeypatch.delenv("TOY_SLEEP")
    toy.executed()
    toy.run(camera={"static": True}, run=limits)
    assert toy.executed() == ["align", "camera:20", "deliver", "hmr:20", "refine"], "its lock was freed at once"


def test_the_start_of_a_process_does_not_count_in_a_limit(
    toy: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    slow = tmp_path / "slow_python"
    slow.write_text(f'#!/bin/sh\nsleep 6\nexec {sys.executable} "$@"\n')
    slow.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(slow))
    run = toy.open(run={"isolate": True, "stages": {"decode": {"limit_s": 5}}})
    with monkeypatch.context() as impatient:
        impatient.setattr("humanmm.tasks.engine.runners.processes.START_LIMIT_S", 1.0)
        with pytest.raises(ResourceError, match="decode: its process did not start within 1 s"):
            run.execute(run.unit("decode"))
    assert run.execute(run.unit("decode")).state == "computed", "its limit begins when it can compute"
    run.close()


def test_a_killed_child_costs_one_attempt_of_one_unit(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOY_SLEEP", "people:20=30")
    run = toy.open(run={"isolate": True})
    for stage in run.stages[:2]:
        run.execute(run.unit(stage.name))

    def kill() -> None:
        while "people:20" not in (toy.log.read_text() if toy.log.exists() else ""):
            time.sleep(0.05)
        for child in _children_of(os.getpid()):
            os.kill(child, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(ResourceError, match="people · scene 1: its process was lost: it was killed") as raised:
        run.execute(run.unit("people", 1))
    killer.join()
    assert is_infrastructure_fault(raised.value)
    monkeypatch.delenv("TOY_SLEEP")
    assert run.execute(run.unit("people", 1)).state == "computed"
    assert run.outcomes["people", 1].attempts == 2
    run.close()


def test_a_run_that_is_closed_ends_its_busy_children_and_begins_no_others(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOY_SLEEP", "decode=60")
    run = toy.open(run={"isolate": True})

    def close() -> None:
        while "decode" not in (toy.log.read_text() if toy.log.exists() else ""):
            time.sleep(0.05)
        run.close()

    closing = threading.Thread(target=close)
    closing.start()
    began = time.monotonic()
    with pytest.raises(ResourceError, match="its process was lost"):
        run.execute(run.unit("decode"))
    closing.join()
    assert time.monotonic() - began < 40
    with pytest.raises(ResourceError, match="the run has ended"):
        run.execute(run.unit("decode"))


def test_errors_warnings_and_progress_come_out_of_a_child_as_they_are(
    toy: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    warning = "import logging\n    logging.getLogger('humanmm.toy').warning('dark')"
    toy.edit("people", "inputs.progress(n, n)", f"inputs.progress(1, n)\n    {warning}")
    seen: list[tuple[str, int]] = []
    run = toy.open(run={"isolate": True})
    run.listen(lambda unit, done, total: seen.append((unit.label, done)))
    monkeypatch.setattr(logging.getLogger("humanmm"), "propagate", True)
    for stage in run.stages[:2]:
        run.execute(run.unit(stage.name))
    run.execute(run.unit("people", 0))
    assert seen == [("people · scene 0", 1)] and "dark" in caplog.messages
    monkeypatch.setenv("TOY_FAIL", "people:20=bug")
    run.close()
    again = toy.open(run={"isolate": True})
    for stage in again.stages[:2]:
        again.execute(again.unit(stage.name))
    with pytest.raises(StageError, match="people · scene 1 failed unexpectedly: ZeroDivisionError: a defect"):
        again.execute(again.unit("people", 1))
    again.close()


def test_a_child_ends_when_its_parent_is_killed(toy: Any) -> None:
    script = (
        "import sys, json\nfrom pathlib import Path\nfrom humanmm.config import Config\n"
        "from humanmm.storage.store.store import Store\nfrom humanmm.storage.store.identity import identify\n"
        "from humanmm.tasks.engine.run import VideoRun\nfrom toyline.table import STAGES\n"
        "store = Store(Path(sys.argv[2]))\nconfig = Config.model_validate({'run': {'isolate': True}})\n"
        "run = VideoRun(identify(Path(sys.argv[1]), store), config, store, stages=STAGES)\n"
        "run.execute(run.unit('decode'))\n"
    )
    command = [sys.executable, "-c", script, str(toy.video), str(toy.store)]
    parent = subprocess.Popen(command, env=toy.environment(TOY_SLEEP="decode=60"))
    while not toy.log.exists():
        time.sleep(0.05)
    (child,) = _children_of(parent.pid)
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 5
    while Path(f"/proc/{child}").exists():
        assert time.monotonic() < deadline, "the child outlived its parent"
        time.sleep(0.05)


class _OutOfMemoryError(RuntimeError):
    """As torch raises it."""


_OutOfMemoryError.__name__, _OutOfMemoryError.__module__ = "OutOfMemoryError", "torch"


@pytest.mark.parametrize(
    ("error", "message"),
    [(MemoryError("2 GB"), "memory ran out"), (_OutOfMemoryError("CUDA"), "the accelerator's memory ran out")],
)
def test_lack_of_memory_is_an_infrastructure_fault(error: Exception, message: str) -> None:
    assert ran_out_of_memory(error)
    ours = as_ours(error, "hmr · shot 1")
    assert isinstance(ours, ResourceError) and is_infrastructure_fault(ours) and message in str(ours)
    assert not ran_out_of_memory(RuntimeError("a defect"))
    assert isinstance(as_ours(RuntimeError("a defect"), "hmr"), StageError)
    assert isinstance(as_ours(OSError(5, "disk"), "hmr"), StoreError)
    race = SystemError("AST constructor recursion depth mismatch (before=51, after=355)")
    assert isinstance(as_ours(race, "hmr"), ResourceError) and not is_infrastructure_fault(SystemError("a defect"))


def test_after_running_out_of_memory_a_unit_has_the_machine_to_itself(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOY_FAIL", "people:0=memory:1")
    run = toy.open()
    for stage in run.stages[:2]:
        run.execute(run.unit(stage.name))
    with pytest.raises(ResourceError, match="people · scene 0: memory ran out"):
        run.execute(run.unit("people", 0))
    shares: list[bool] = []
    taken = run._budget.taken
    run._budget.taken = lambda needed, alone=False: (shares.append(alone), taken(needed, alone=alone))[1]
    assert run.execute(run.unit("people", 0)).state == "computed"
    run.execute(run.unit("people", 1))
    run.close()
    assert shares == [True, False]


def test_a_budget_is_never_exceeded_and_what_is_too_large_runs_alone() -> None:
    budget = Budget(threads=4, memory_mb=1000)
    held, most, lock = [0, 0], [0, 0], threading.Lock()

    def work(threads: int, memory_mb: int) -> None:
        with budget.taken(Resources(threads=threads, memory_mb=memory_mb)):
            share = (min(threads, 4), min(memory_mb, 1000))
            with lock:
                for i in (0, 1):
                    held[i] += share[i]
                    most[i] = max(most[i], held[i])
            time.sleep(0.02)
            with lock:
                for i in (0, 1):
                    held[i] -= share[i]

    asked = [(1, 300), (2, 100), (8, 10), (1, 5000), (1, 300), (3, 600)] * 3
    threads = [threading.Thread(target=work, args=each) for each in asked]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
        assert not thread.is_alive()
    assert held == [0, 0] and most[0] <= 4 and most[1] <= 1000
    assert most[0] > 1, "some did run side by side"


def test_the_users_limits_stand_in_for_those_of_the_table() -> None:
    stage = next(stage for stage in pipeline.STAGES if stage.name == "camera")
    settings = RunConfig(limit_s=60, stages={"camera": StageLimits(memory_mb=9)})
    assert resources_of(stage, settings) == Resources(stage.resources.threads, 9, gpu=False, limit_s=60)
    assert resources_of(stage, RunConfig()) == stage.resources.for_unit(0, 0)
    own = RunConfig(limit_s=60, stages={"camera": StageLimits(limit_s=5, gpu=True)})
    assert (resources_of(stage, own).limit_s, resources_of(stage, own).gpu) == (5, True)


def test_the_budget_counts_the_size_of_the_picture_and_the_frames(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    resources = Resources(memory_mb=100, memory_mb_per_mpx=30, memory_mb_per_kframe=500)
    stage = replace(pipeline.STAGES[2], resources=resources)
    assert resources_of(stage, RunConfig(), megapixels=8.0, num_frames=2000).memory_mb == 1340
    own = RunConfig(stages={stage.name: StageLimits(memory_mb=9)})
    assert resources_of(stage, own, megapixels=8.0).memory_mb == 9
    monkeypatch.setattr(pipeline, "STAGES", tuple(stage if s.name == stage.name else s for s in pipeline.STAGES))
    run = toy.open(decode={"max_side_px": 1000})  # the width of the toy's picture; 480 high
    asked: dict[str, int] = {}
    taken = run._budget.taken
    run._budget.taken = lambda needed, alone=False: (
        asked.setdefault(threading.current_thread().name, needed.memory_mb), taken(needed, alone=alone)
    )[1]  # fmt: skip
    run.execute(run.unit("decode"))
    run.execute(run.unit("scenes"))
    asked.clear()
    run.execute(run.unit("people"))
    assert list(asked.values()) == [125]  # 100, 0.48 Mpx, 20 frames


def test_limits_can_be_written_as_a_flag_and_a_stage_that_does_not_exist_is_reported(toy: Any) -> None:
    done = toy.main("recover", "film.mp4", "--dry-run", "--run.stages", "{camera = {limit_s = 60}}")
    assert done[0] == 0, done
    wrong = toy.main("recover", "film.mp4", "--dry-run", "--run.stages", "{camara = {limit_s = 60}}")
    assert wrong[0] == 2 and "'camara', which is no stage" in wrong[2]
    for section in SECTIONS_OF_NO_STAGE:
        with pytest.raises(ValueError, match="which is no stage"):
            Config.model_validate({"run": {"stages": {section: {"limit_s": 60}}}})
    Config.model_validate({"run": {"stages": {stage.name: {"limit_s": 60} for stage in pipeline.STAGES}}})
    with pytest.raises(ValueError, match="greater than 0"):
        Config.model_validate({"run": {"limit_s": 0}})


def test_a_gpu_stage_computes_inside_the_slot_and_a_cached_one_asks_for_none(toy: Any) -> None:
    slots: list[str] = []

    @contextlib.contextmanager
    def slot() -> Iterator[None]:
        slots.append("taken")
        yield
        slots.append("free")

    for expected in (["taken", "free"], []):
        run = toy.open(run={"stages": {"decode": {"gpu": True}}})
        run.gpu = slot
        slots.clear()
        run.execute(run.unit("decode"))
        run.execute(run.unit("scenes"))
        run.close()
        assert slots == expected
