"""A batch on the services of deploy/compose.yaml, started here without Docker: Postgres, Redis, server, worker."""

import base64
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT: dict[str, str] = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]["server"][
    "environment"
]

pytestmark = [pytest.mark.server, pytest.mark.timeout(2400)]


def _program(name: str) -> str:
    """A program of PATH or of Debian's Postgres; the test is skipped without it."""
    versions = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    found = shutil.which(name) or (str(versions[-1]) if versions else None)
    if found is None:
        pytest.skip(f"{name} is not installed (Debian: postgresql, redis-server)")
    return found


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@contextmanager
def _running(command: list[str], ready: Callable[[], bool], log: Path, **options: Any) -> Iterator[None]:
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True, **options)
    try:
        deadline = time.monotonic() + 180
        while not ready():
            assert process.poll() is None and time.monotonic() < deadline, log.read_text()[-2000:]
            time.sleep(0.2)
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def team(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, str]]:
    """The environment of a client of the team server: what compose.yaml sets, with other host names and passwords."""
    pytest.importorskip("prefect_redis", reason="the extra `team` is not installed")
    initdb, postgres, redis = _program("initdb"), _program("postgres"), _program("redis-server")
    createdb = _program("createdb")
    ports = {name: _free_port() for name in ("postgres", "redis", "server")}
    as_user: dict[str, Any] = {}
    if os.getuid() == 0:  # Postgres refuses to run as root
        as_user = {"user": "postgres", "group": "postgres", "extra_groups": []}
        for folder in (tmp_path, *tmp_path.parents):
            if not folder.stat().st_mode & 0o001:
                folder.chmod(0o755)
    data = tmp_path / "postgres"
    data.mkdir()
    if as_user:
        shutil.chown(data, "postgres", "postgres")
    subprocess.run(
        [initdb, "-D", str(data), "-U", "prefect", "-A", "trust", "--no-sync"],
        check=True, capture_output=True, cwd="/", **as_user,
    )  # fmt: skip
    client = {
        "PREFECT_API_URL": f"http://127.0.0.1:{ports['server']}/api",
        "PREFECT_API_AUTH_STRING": "team:secret",
        "HUMANMM_CACHE": str(tmp_path / "cache"),
    }
    replaced = {
        "PREFECT_API_DATABASE_CONNECTION_URL": f"postgresql+asyncpg://prefect@127.0.0.1:{ports['postgres']}/prefect",
        "PREFECT_SERVER_API_AUTH_STRING": "team:secret",
        "PREFECT_REDIS_MESSAGING_URL": f"redis://127.0.0.1:{ports['redis']}/0",
        "PREFECT_SERVER_DOCKET_URL": f"redis://127.0.0.1:{ports['redis']}/1",
        "PREFECT_HOME": str(tmp_path / "server"),
    }
    environment = {**os.environ, **ENVIRONMENT, **replaced, "NO_PROXY": "127.0.0.1", "PREFECT_API_URL": ""}
    environment.pop("PREFECT_API_URL")
    prefect = [sys.executable, "-m", "prefect", "server"]
    with ExitStack() as stack:
        sockets = f"-k{data} -h127.0.0.1 -p{ports['postgres']} -F"
        stack.enter_context(
            _running(
                [postgres, "-D", str(data), *sockets.split()], lambda: _listens(ports["postgres"]),
                tmp_path / "postgres.log", cwd="/", **as_user,
            )
        )  # fmt: skip
        redis_arguments = ["--port", str(ports["redis"]), "--bind", "127.0.0.1", "--save", "", "--dir", str(tmp_path)]
        stack.enter_context(
            _running([redis, *redis_arguments], lambda: _listens(ports["redis"]), tmp_path / "redis.log")
        )
        connect = ["-h", "127.0.0.1", "-p", str(ports["postgres"]), "-U", "prefect", "prefect"]
        subprocess.run([createdb, *connect], check=True, capture_output=True)
        subprocess.run([*prefect, "database", "upgrade", "-y"], check=True, capture_output=True, env=environment)
        start = [*prefect, "start", "--host", "127.0.0.1", "--port", str(ports["server"]), "--no-services"]
        stack.enter_context(
            _running(start, lambda: _listens(ports["server"]), tmp_path / "server.log", env=environment)
        )
        stack.enter_context(
            _running([*prefect, "services", "start"], lambda: True, tmp_path / "services.log", env=environment)
        )
        for name, value in client.items():
            monkeypatch.setenv(name, value)
        yield client | {"DATABASE": replaced["PREFECT_API_DATABASE_CONNECTION_URL"]}


def _sql(team: dict[str, str], query: str) -> list[str]:
    port = team["DATABASE"].rpartition(":")[2].partition("/")[0]
    command = [_program("psql"), "-h", "127.0.0.1", "-p", port, "-U", "prefect", "-At", "-c", query, "prefect"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def test_a_batch_runs_on_postgres_and_redis_and_every_state_arrives(
    farm: Any, place: Any, team: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "client").mkdir()
    log = tmp_path / "serve.log"
    serve = farm.command_line("serve", "--limit", "2")
    ready = lambda: log.exists() and "dashboard:" in log.read_text()  # noqa: E731
    with _running(serve, ready, log, env=farm.environment(**team), cwd=farm.folder):
        done = farm.command("batch", "submit", "films", "--wait", **team)
        assert done.returncode == 3, done.stderr
        tree = json.loads(farm.main("batch", "status", "--json", **team)[1])
        assert tree["counts"] == {"done": 3, "failed": 1}, tree["videos"]
        assert _sql(team, "select state_type from flow_run order by 1") == ["COMPLETED"] * 3 + ["FAILED"]
        units = len(json.loads((farm.folder / "runs/0/run.json").read_text())["stages"])
        completed = "select count(*) from task_run where state_type = 'COMPLETED'"
        place.until(lambda: _sql(team, completed) == [str(3 * units)], 120)
        assert farm.executed().count("people:0") == 3
        metrics = urllib.request.Request(f"{team['PREFECT_API_URL']}/metrics")
        metrics.add_header("Authorization", f"Basic {base64.b64encode(b'team:secret').decode()}")
        assert b"# TYPE python_info gauge" in urllib.request.urlopen(metrics, timeout=30).read()
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(f"{team['PREFECT_API_URL']}/flows/", timeout=30)
        yaml_file = str(ROOT / "deploy/prefect.yaml")
        command = [sys.executable, "-m", "prefect", "--no-prompt", "deploy", "--all", "--prefect-file", yaml_file]
        deployed = subprocess.run(
            command, env={**farm.environment(**team), "PREFECT_HOME": str(tmp_path / "client")}, cwd=farm.folder,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert deployed.returncode == 0, deployed.stdout + deployed.stderr
        assert _sql(team, "select name from deployment order by 1") == ["maintain", "recover-batch", "recover-video"]
    assert not place.pids("humanmm.flows."), "it leaves nothing behind, and starts no server of its own"
