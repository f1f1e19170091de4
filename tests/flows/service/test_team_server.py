"""A batch on the services of deploy/compose.yaml, started here without Docker: Postgres, Redis, server, worker."""

import base64
import json
import os
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import yaml
from services import free_port, listens, postgres, program, running

ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT: dict[str, str] = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]["server"][
    "environment"
]

pytestmark = [pytest.mark.server, pytest.mark.timeout(2400)]


@pytest.fixture
def team(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, str]]:
    """The environment of a client of the team server: what compose.yaml sets, with other host names and passwords."""
    for name in ("prefect_redis", "pg8000"):
        pytest.importorskip(name, reason="the extra `team` is not installed")
    redis = program("redis-server")
    ports = {name: free_port() for name in ("redis", "server")}
    with ExitStack() as stack:
        ports["postgres"] = stack.enter_context(postgres(tmp_path, "prefect"))
        client = _start_services(stack, tmp_path, redis, ports)
        for name, value in client.items():
            monkeypatch.setenv(name, value)
        yield client | {"DATABASE": f"postgresql+asyncpg://prefect@127.0.0.1:{ports['postgres']}/prefect"}


def _start_services(stack: ExitStack, folder: Path, redis: str, ports: dict[str, int]) -> dict[str, str]:
    client = {
        "PREFECT_API_URL": f"http://127.0.0.1:{ports['server']}/api",
        "PREFECT_API_AUTH_STRING": "team:secret",
        "HUMANMM_CACHE": str(folder / "cache"),
        "HUMANMM_DATABASE_URL": f"postgresql://prefect@127.0.0.1:{ports['postgres']}/prefect",
    }
    replaced = {
        "PREFECT_API_DATABASE_CONNECTION_URL": f"postgresql+asyncpg://prefect@127.0.0.1:{ports['postgres']}/prefect",
        "PREFECT_SERVER_API_AUTH_STRING": "team:secret",
        "PREFECT_REDIS_MESSAGING_URL": f"redis://127.0.0.1:{ports['redis']}/0",
        "PREFECT_SERVER_DOCKET_URL": f"redis://127.0.0.1:{ports['redis']}/1",
        "PREFECT_HOME": str(folder / "server"),
    }
    environment = {**os.environ, **ENVIRONMENT, **replaced, "NO_PROXY": "127.0.0.1", "PREFECT_API_URL": ""}
    environment.pop("PREFECT_API_URL")
    prefect = [sys.executable, "-m", "prefect", "server"]
    redis_arguments = ["--port", str(ports["redis"]), "--bind", "127.0.0.1", "--save", "", "--dir", str(folder)]
    stack.enter_context(running([redis, *redis_arguments], lambda: listens(ports["redis"]), folder / "redis.log"))
    subprocess.run([*prefect, "database", "upgrade", "-y"], check=True, capture_output=True, env=environment)
    start = [*prefect, "start", "--host", "127.0.0.1", "--port", str(ports["server"]), "--no-services"]
    stack.enter_context(running(start, lambda: listens(ports["server"]), folder / "server.log", env=environment))
    stack.enter_context(
        running([*prefect, "services", "start"], lambda: True, folder / "services.log", env=environment)
    )
    return client


def _sql(team: dict[str, str], query: str) -> list[str]:
    port = team["DATABASE"].rpartition(":")[2].partition("/")[0]
    command = [program("psql"), "-h", "127.0.0.1", "-p", port, "-U", "prefect", "-At", "-c", query, "prefect"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def test_a_batch_runs_on_postgres_and_redis_and_every_state_arrives(
    farm: Any, place: Any, team: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "client").mkdir()
    log = tmp_path / "serve.log"
    serve = farm.command_line("serve", "--limit", "2")
    ready = lambda: log.exists() and "dashboard:" in log.read_text()  # noqa: E731
    with running(serve, ready, log, env=farm.environment(**team), cwd=farm.folder):
        done = farm.command("batch", "submit", "films", "--wait", **team)
        assert done.returncode == 3, done.stderr
        tree = json.loads(farm.main("batch", "status", "--json", **team)[1])
        assert tree["counts"] == {"done": 3, "failed": 1}, tree["videos"]
        assert _sql(team, "select state from humanmm_videos order by 1") == ["done"] * 3 + ["failed"]
        assert _sql(team, "select state_type from flow_run order by 1") == ["COMPLETED"] * 3 + ["FAILED"]
        units = len(json.loads((farm.folder / "runs/0/run.json").read_text())["stages"])
        completed = "select count(*) from task_run where state_type = 'COMPLETED'"
        place.until(lambda: _sql(team, completed) == [str(3 * units)], 120)
        assert farm.executed().count("people:0") == 3
        metrics = urllib.request.Request(f"{team['PREFECT_API_URL']}/metrics")
        metrics.add_header("Authorization", f"Basic {base64.b64encode(b'team:secret').decode()}")
        with urllib.request.urlopen(metrics, timeout=30) as page:
            assert b"# TYPE python_info gauge" in page.read()
        with pytest.raises(urllib.error.HTTPError, match="401") as refused:
            urllib.request.urlopen(f"{team['PREFECT_API_URL']}/flows/", timeout=30)
        refused.value.close()
        yaml_file = str(ROOT / "deploy/prefect.yaml")
        command = [sys.executable, "-m", "prefect", "--no-prompt", "deploy", "--all", "--prefect-file", yaml_file]
        deployed = subprocess.run(
            command, env={**farm.environment(**team), "PREFECT_HOME": str(tmp_path / "client")}, cwd=farm.folder,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert deployed.returncode == 0, deployed.stdout + deployed.stderr
        assert _sql(team, "select name from deployment order by 1") == ["maintain", "recover-batch", "recover-video"]
    assert not place.pids("humanmm.flows."), "it leaves nothing behind, and starts no server of its own"
