"""Stages on workers of Dask and Ray: the same results, log, attempts and states as in threads; nothing left behind."""

import contextlib
import importlib.util
import json
import logging
import os
import pickle
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from ipaddress import IPv6Address, ip_address
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config, RunConfig
from humanmm.errors import ConfigError, ResourceError, StageError
from humanmm.tasks.engine.runners.job import Job, Message, Setting
from humanmm.tasks.engine.runners.runner import check_runner
from humanmm.tasks.engine.runners.worker import perform
from humanmm.tasks.pipeline import STAGES
from humanmm.tasks.units.execute import Result
from humanmm.tasks.units.selection import Selection

ROOT = Path(__file__).resolve().parents[4]
CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"


# ---- without an engine


def test_an_engine_that_is_not_installed_is_reported_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    check_runner(RunConfig())
    for kind in ("dask", "ray"):
        with pytest.raises(ConfigError, match=rf"pip install 'humanmm\[{kind}\]'"):
            check_runner(RunConfig.model_validate({"runner": kind}))


def test_an_address_without_an_engine_is_refused() -> None:
    with pytest.raises(ValueError, match=r"run\.cluster needs run\.runner"):
        Config.model_validate({"run": {"cluster": "tcp://127.0.0.1:8786"}})


def test_where_stages_compute_is_part_of_no_key(toy: Any) -> None:
    assert not any("run" in stage.settings for stage in STAGES)
    run, other = toy.open(), toy.open(run={"runner": "dask", "threads": 7})
    assert run.keys.recipe(run.unit("decode")).key == other.keys.recipe(other.unit("decode")).key


def test_a_store_travels_without_what_it_has_checked(toy: Any) -> None:
    store = toy.run().store
    sent = pickle.dumps(store)
    assert len(sent) < 500
    again = pickle.loads(sent)
    assert (again.location, again.read_only) == (store.location, False)


def _job(toy: Any, stage: str, index: int) -> tuple[Setting, Job]:
    run = toy.open()
    for before in run.stages[: [s.name for s in run.stages].index(stage)]:
        for unit in run.units(before):
            run.execute(unit)
    setting = Setting(run.video, run.config, run.store, Selection(), run.stages)
    return setting, Job(stage, index, run.references(run.unit(stage, index)))


def test_a_worker_tells_what_it_logs_how_far_it_is_and_its_answer(toy: Any) -> None:
    warning = "import logging\n    logging.getLogger('humanmm.toy').warning('dark %s', 'room')"
    toy.edit("people", "inputs.progress(n, n)", f"{warning}\n    [inputs.progress(i, 999) for i in range(1000)]")
    setting, job = _job(toy, "people", 1)
    sent: list[Message] = []
    handlers = list(logging.getLogger("humanmm").handlers)
    done = perform(setting, job, "people · scene 1", isolated=False, limit_s=None, send=sent.append)
    assert isinstance(done, Result) and done.state == "computed"
    records = [message.getMessage() for message in sent if isinstance(message, logging.LogRecord)]
    assert records == ["dark room"]
    reported = [message for message in sent if isinstance(message, tuple)]
    assert reported[-1] == (999, 999) and len(reported) < 20, "now and then, not a thousand times"
    assert logging.getLogger("humanmm").handlers == handlers


def test_nothing_large_goes_to_a_worker(toy: Any) -> None:
    setting, job = _job(toy, "align", 0)
    assert len(pickle.dumps((setting, job))) < 20_000
    assert {name for name, _ in job.references} == {*setting.stages[9].inputs, "scenes"}


def test_the_error_of_a_stage_on_a_worker_travels(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    setting, job = _job(toy, "camera", 1)
    for kind, expected in (("stage", StageError), ("bug", StageError), ("memory:9", ResourceError)):
        monkeypatch.setenv("TOY_FAIL", f"camera:20={kind}")
        reported = perform(setting, job, "camera · shot 1", isolated=False, limit_s=None, send=lambda message: None)
        assert type(pickle.loads(pickle.dumps(reported))) is expected


def test_a_worker_that_is_not_as_this_process_is_reported(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    other = toy.open(camera={"static": True})
    monkeypatch.setenv("TOY_FAIL", "")
    run = toy.open(run={"isolate": True}, decode={"max_side_px": 4096})
    run._workers._setting = Setting(run.video, other.config, run.store, Selection(), run.stages)
    with pytest.raises(StageError, match=r"decode: its worker is not as this process: .*max_side_px"):
        run.execute(run.unit("decode"))
    run.close()


# ---- on Dask and Ray


@pytest.fixture(params=["dask", "ray"])
def engine(request: pytest.FixtureRequest) -> str:
    library = {"dask": "distributed", "ray": "ray"}[request.param]
    pytest.importorskip(library, reason=f"pip install 'humanmm[{request.param}]'")
    return str(request.param)


def _record(toy: Any, run_dir: str = "runs/film") -> dict[str, Any]:
    record: dict[str, Any] = json.loads((toy.folder / run_dir / "run.json").read_text())
    return record


def _unit(record: dict[str, Any], stage: str, shot: int) -> dict[str, Any]:
    (unit,) = [unit for unit in record["stages"] if unit["stage"] == stage and unit["shot"] == shot]
    return dict(unit)


def _below(pid: int) -> set[int]:
    """All processes that a process has started, and those that these have."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(folder.name))
    found, waiting = set(), [pid]
    while waiting:
        new = children.get(waiting.pop(), [])
        found.update(new)
        waiting += new
    return found


def _is_there(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


def _until(condition: Any, limit_s: float) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.1)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_an_engine_gives_the_states_log_and_attempts_of_threads(toy: Any, engine: str, server_cache: Path) -> None:
    warning = "import logging\n    logging.getLogger('humanmm.toy').warning('dark')"
    toy.edit("people", "inputs.progress(n, n)", f"inputs.progress(n, n)\n    {warning}")
    faults = {"TOY_FAIL": "camera:20=disk:2;hmr:40=stage"}
    done = toy.command("recover", "film.mp4", "--run.runner", engine, "--run.threads", "3", **faults)
    assert (done.returncode, done.stdout) == (3, "runs/film\n"), done.stderr
    assert "hmr · shot 2 failed: hmr:40 cannot be done\n" in done.stderr
    record = _record(toy)
    assert _unit(record, "camera", 1)["attempts"] == 3 and len(_unit(record, "camera", 1)["faults"]) == 2
    assert _unit(record, "hmr", 2)["state"] == "failed" and record["state"] == "partial"
    text = (toy.folder / "runs/film/run.log").read_text()
    assert text.count("humanmm.toy: dark") == 2 and "align" in text, "what workers log, once for each scene"
    executed = toy.executed()
    assert executed.count("camera:20") == 3

    for _ in range(100):
        with_states = _task_states(server_cache)
        if not {"Pending", "Running"} & set(with_states.values()) and len(with_states) == 17:
            break
        time.sleep(0.1)
    assert with_states["camera · shot 1"] == "Completed" and with_states["hmr · shot 2"] == "Failed"

    again = toy.command("recover", "film.mp4", "--run.runner", engine)
    assert again.returncode == 0, again.stderr
    assert toy.executed() == ["align", "deliver", "hmr:40", "refine"], "what failed, and what depends on it"


def _task_states(cache: Path) -> dict[str, str]:
    import sqlite3

    (file,) = cache.glob("prefect-*/prefect.db")
    with sqlite3.connect(file, timeout=30) as connection:
        (flow,) = connection.execute("select id from flow_run order by created desc limit 1").fetchone()
        return dict(connection.execute("select name, state_name from task_run where flow_run_id = ?", (flow,)))


def _start(toy: Any, engine: str, *more: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        toy.command_line("recover", "film.mp4", "--run.runner", engine, *more),
        cwd=toy.folder, env=toy.environment(**environment), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # pytest in the background ignores it
    )  # fmt: skip


def _worker_at(toy: Any, process: subprocess.Popen[str], unit: str) -> int:
    """The process that computes a unit of the toy, which writes its number down."""
    path = toy.folder / f"at-{unit}"
    _until(lambda: path.exists() or process.poll() is not None, 600)
    assert path.exists(), process.communicate()
    return int(path.read_text())


@pytest.fixture
def telling(toy: Any) -> Any:
    """The toy, whose stages write down which process computes them."""
    reported = "(log.parent / f'at-{name}').write_text(str(os.getpid()))\n    time.sleep("
    toy.edit("behaviour", "time.sleep(", reported)
    return toy


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_a_killed_worker_costs_one_attempt_of_one_unit(telling: Any, engine: str) -> None:
    process = _start(telling, engine, "--run.threads", "2", TOY_SLEEP="camera:20=5")
    os.kill(_worker_at(telling, process, "camera:20"), signal.SIGKILL)
    _, reported = process.communicate(timeout=900)
    assert process.returncode == 0, reported
    unit = _unit(_record(telling), "camera", 1)
    assert (unit["state"], unit["attempts"]) == ("computed", 2)
    assert "its worker was lost" in unit["faults"][0]
    assert telling.executed().count("camera:20") == 2 and telling.executed() == []


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_a_stage_over_its_limit_on_a_worker_is_really_ended(telling: Any, engine: str) -> None:
    limits = ("--run.stages", "{camera = {limit_s = 20}}")
    process = _start(telling, engine, *limits, TOY_SLEEP="camera:20=600")
    child = _worker_at(telling, process, "camera:20")
    _, reported = process.communicate(timeout=900)
    assert process.returncode == 3, reported
    assert "camera · shot 1 took longer than its limit of 20 s" in reported
    assert not _is_there(child)
    assert _unit(_record(telling), "camera", 1)["attempts"] == 1


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_is_left_when_the_flow_is_stopped(telling: Any, engine: str, number: signal.Signals) -> None:
    process = _start(telling, engine, TOY_SLEEP="align=600")
    worker = _worker_at(telling, process, "align")
    started = _below(process.pid)
    assert worker in started
    process.send_signal(number)
    process.communicate(timeout=300)
    _until(lambda: not _is_there(worker), 60)
    _until(lambda: not [pid for pid in started if _is_there(pid) and not _is_server(pid)], 300)
    locked = telling.command("recover", "film.mp4")
    assert locked.returncode == 0 and telling.executed().count("align") == 2, "its lock was freed"


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_workers_of_our_own_listen_on_loopback_alone(telling: Any, engine: str) -> None:
    process = _start(telling, engine, TOY_SLEEP="camera:20=5")
    worker = _worker_at(telling, process, "camera:20")
    started = _below(process.pid)
    places = _listening([process.pid, *started])
    _, reported = process.communicate(timeout=900)
    assert process.returncode == 0, reported
    assert worker in started and len(places) > 2
    assert {place for place in places if not ip_address(place).is_loopback} == set()


def _listening(pids: list[int]) -> list[str]:
    """The addresses on which processes take connections, as the kernel tells."""
    own = set()
    for pid in pids:
        for descriptor in Path(f"/proc/{pid}/fd").glob("*"):
            with contextlib.suppress(OSError):
                own.add(str(descriptor.readlink()))
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *_, inode = line.split()[:10]
            if state == "0A" and f"socket:[{inode}]" in own:  # LISTEN
                words = bytes.fromhex(local.partition(":")[0])
                address = ip_address(b"".join(words[at : at + 4][::-1] for at in range(0, len(words), 4)))
                mapped = address.ipv4_mapped if isinstance(address, IPv6Address) else None
                found.append(str(mapped or address))
    return found


def _is_server(pid: int) -> bool:
    """Prefect's server in the background, which later runs use."""
    try:
        return b"server_process" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


CLUSTERS = {
    "dask": (
        "import logging, sys\nfrom distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    with LocalCluster(n_workers=1, threads_per_worker=2, host='127.0.0.1', dashboard_address='127.0.0.1:0',\n"
        "                      silence_logs=logging.CRITICAL) as cluster:\n"
        "        print(cluster.scheduler_address, flush=True)\n        sys.stdin.read()\n"
    ),
    "ray": (
        "import ray, sys\n"
        "ray.init(address='local', num_cpus=2, include_dashboard=False, object_store_memory=100 << 20)\n"
        "print(ray.get_runtime_context().gcs_address, flush=True)\nsys.stdin.read()\nray.shutdown()\n"
    ),
}


@pytest.fixture
def cluster(toy: Any, engine: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Address of a cluster that somebody else has started."""
    script = toy.folder / f"cluster_{engine}.py"
    script.write_text(CLUSTERS[engine])
    for name, value in {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": uuid.uuid4().hex * 2}.items():
        monkeypatch.setenv(name, value)
    command, environment = [sys.executable, str(script)], toy.environment(RAY_USAGE_STATS_ENABLED="0")
    with subprocess.Popen(
        command, cwd=toy.folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        yield process.stdout.readline().strip()
        process.stdin.close()
        process.wait(timeout=120)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_a_cluster_that_runs_already_is_used_and_left_as_it_was(toy: Any, engine: str, cluster: str) -> None:
    warning = "import logging\n    logging.getLogger('humanmm.toy').warning('dark %d', start)"
    toy.edit("people", "inputs.progress(n, n)", f"inputs.progress(n, n)\n    {warning}")
    for times, run_dir in enumerate(("first", "second"), 1):
        asked = ("--run.runner", engine, "--run.cluster", cluster, "--force", "--out", run_dir)
        done = toy.command("recover", "film.mp4", *asked)
        assert done.returncode == 0, done.stderr
        text = (toy.folder / run_dir / "run.log").read_text()
        assert text.count("dark 0") == text.count("dark 20") == 1, "units in one process, each with its own log"
        assert toy.executed().count("people:0") == 1, f"run {times}"


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.usefixtures("server_cache")
def test_a_cluster_that_is_not_there_is_one_clear_error(toy: Any, engine: str) -> None:
    address = {"dask": "tcp://127.0.0.1:9", "ray": "127.0.0.1:9"}[engine]
    asked = ("--run.runner", engine, "--run.cluster", address, "--run.max_retries", "0")
    done = toy.command("recover", "film.mp4", *asked, RAY_gcs_rpc_server_connect_timeout_s="5")
    assert done.returncode == 1
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("humanmm: ")]
    assert f"at run.cluster = {address}" in line


# ---- the real stages


@pytest.fixture(scope="module")
def in_threads(tmp_path_factory: pytest.TempPathFactory, server_cache: Path) -> Path:
    """The shipped clip's run folder, computed in threads."""
    return _recovered(tmp_path_factory.mktemp("threads"), "threads")


def _recovered(folder: Path, runner: str) -> Path:
    command = [sys.executable, "-m", "humanmm.cli", "recover", str(CLIP), "--out", "run", "--run.runner", runner]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(folder / "store")}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "run"


TELLS_TIMES = {"run.json", "run.log", "view/timeline.png"}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_an_engine_leaves_the_bytes_that_threads_leave(engine: str, tmp_path: Path, in_threads: Path) -> None:
    here = _recovered(tmp_path, engine)
    for folder, other in ((here, in_threads), (in_threads, here)):
        for path in folder.rglob("*"):
            name = path.relative_to(folder)
            if path.is_file() and str(name) not in TELLS_TIMES:
                assert path.read_bytes() == (other / name).read_bytes(), name
    units = [
        {(u["stage"], u["unit"]): (u["key"], u["digest"], u["state"], u["attempts"]) for u in record["stages"]}
        for record in (json.loads((folder / "run.json").read_text()) for folder in (here, in_threads))
    ]
    assert units[0] == units[1] and len(units[0]) == 20
