"""What deploy/ promises is checked without Docker: names that exist, settings that Prefect knows, nothing published."""

import importlib.util
import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from humanmm.flows.server.server_process import OWN_SETTINGS

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
COMPOSE: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
DEPLOYMENTS: list[dict[str, Any]] = yaml.safe_load((DEPLOY / "prefect.yaml").read_text())["deployments"]
ASKED = dict.fromkeys(re.findall(r"\$\{(\w+):\?", (DEPLOY / "compose.yaml").read_text()))


@pytest.mark.usefixtures("server_cache")
def test_every_prefect_variable_is_a_setting_that_prefect_has() -> None:
    if importlib.util.find_spec("prefect_redis") is None:
        pytest.skip("the extra `team` is not installed")
    from prefect.settings import Settings  # only now: Prefect reads its settings on import
    from prefect.settings.legacy import _get_settings_fields
    from prefect_redis.client import RedisMessagingSettings

    of_redis = [f"PREFECT_REDIS_MESSAGING_{name}".upper() for name in RedisMessagingSettings.model_fields]
    known = [*_get_settings_fields(Settings), *of_redis]
    named = {name for service in SERVICES.values() for name in service.get("environment", {}) if "PREFECT" in name}
    assert len(named) > 10 and named <= set(known), named - set(known)


def test_what_a_service_waits_for_and_mounts_is_declared() -> None:
    for name, service in SERVICES.items():
        assert set(service.get("depends_on", {})) <= set(SERVICES), name
        for other, how in service.get("depends_on", {}).items():
            assert how["condition"] != "service_healthy" or "healthcheck" in SERVICES[other], (name, other)
        for volume in service.get("volumes", []):
            source = volume.split(":")[0]
            assert source in COMPOSE["volumes"] or source.startswith("${"), (name, volume)
        assert "image" in service
    assert [name for name, service in SERVICES.items() if "build" in service] == ["migrate"], "the image is built once"
    build = SERVICES["migrate"]["build"]
    assert (DEPLOY / build["context"] / build["dockerfile"]).is_file()


def test_only_the_dashboard_is_published_and_on_loopback_alone() -> None:
    ports = {name: service["ports"] for name, service in SERVICES.items() if "ports" in service}
    assert ports == {"server": ["127.0.0.1:4200:4200"]}
    assert "PREFECT_SERVER_API_AUTH_STRING" in SERVICES["server"]["environment"]


def test_no_secret_has_a_default_and_the_example_asks_for_all() -> None:
    example = dict(line.split("=", 1) for line in (DEPLOY / "example.env").read_text().splitlines() if "=" in line)
    assert set(ASKED) <= set(example)
    assert {example[name] for name in ASKED} == {""}, "an example password is used in the end"


def test_compose_itself_accepts_the_file() -> None:
    compose = shutil.which("docker-compose")
    if compose is None:
        pytest.skip("docker-compose is not installed")
    environment = {**os.environ, **dict.fromkeys(ASKED, "/given")}
    command = [compose, "-f", str(DEPLOY / "compose.yaml"), "config", "-q"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode != 0, "without its secrets it does not start"


@pytest.mark.usefixtures("server_cache")
def test_the_deployments_are_those_of_serve_with_parameters_that_the_flows_have() -> None:
    from prefect.utilities.importtools import import_object  # only now: Prefect reads its settings on import

    for deployment in DEPLOYMENTS:
        flow = import_object(deployment["entrypoint"])
        assert deployment["name"] == flow.name and deployment["work_pool"]["name"] == "humanmm"
        assert set(deployment.get("parameters", {})) <= set(flow.parameters.model_dump()["properties"])
    assert {deployment["name"] for deployment in DEPLOYMENTS} == {"recover-video", "recover-batch", "maintain"}


def test_the_server_has_the_settings_of_the_one_that_serve_starts() -> None:
    theirs = SERVICES["server"]["environment"]
    assert {name: theirs.get(name) for name in OWN_SETTINGS} == OWN_SETTINGS
    assert all(SERVICES[name]["environment"] == theirs for name in ("migrate", "services"))


def test_prometheus_scrapes_what_the_server_publishes() -> None:
    (job,) = yaml.safe_load((DEPLOY / "prometheus.yml").read_text())["scrape_configs"]
    assert job["static_configs"] == [{"targets": ["server:4200"]}] and "server" in SERVICES
    assert SERVICES["server"]["environment"]["PREFECT_SERVER_METRICS_ENABLED"] == "true"


def test_the_image_installs_extras_that_exist_and_runs_as_nobody_special() -> None:
    text = (DEPLOY / "Dockerfile").read_text()
    (extras,) = re.findall(r'"\.\[([\w,]+)\]"', text)
    project = tomllib.loads((DEPLOY.parent / "pyproject.toml").read_text())["project"]
    assert set(extras.split(",")) <= set(project["optional-dependencies"])
    assert re.search(r"^USER (?!root)\w+", text, re.MULTILINE)
    pinned = next(
        line for line in (DEPLOY.parent / "constraints.txt").read_text().splitlines() if line.startswith("torch==")
    )
    assert pinned in text and pinned in SERVICES["migrate"]["build"]["args"]["TORCH"]
