"""Finding and starting our server: settings that Prefect refuses, folders that somebody else prepared."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from humanmm.errors import ResourceError
from humanmm.flows.server import local_server

ROOT = Path(__file__).resolve().parents[3]


def test_a_variable_that_prefect_refuses_is_named_before_any_server_starts(tmp_path: Path) -> None:
    script = (
        "from humanmm.errors import ConfigError\n"
        "from humanmm.flows.server import local_server\n"
        "try:\n    local_server.prefect_server().__enter__()\n"
        "except ConfigError as error:\n    print(error)\n"
    )
    environment = {
        **os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_CACHE": str(tmp_path),
        "PREFECT_SERVER_API_PORT": "high",
    }  # fmt: skip
    environment.pop("PREFECT_API_URL", None)
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.startswith("PREFECT_SERVER_API_PORT = 'high': Input should be a valid integer"), done.stderr
    assert not list(tmp_path.glob("*/server.json"))


def test_loopback_is_kept_from_proxies_beside_what_the_user_keeps_and_named_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "environ", {"NO_PROXY": "intranet,localhost"})
    for _ in range(3):
        local_server.quiet_environment()
    assert os.environ["NO_PROXY"] == "intranet,localhost,127.0.0.1" and os.environ["no_proxy"] == "127.0.0.1,localhost"


def test_the_folder_of_the_server_can_be_opened_by_its_user_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    home = local_server.server_files().home
    home.chmod(0o755)
    assert local_server.server_files().home == home and home.stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder to another user")
def test_a_folder_that_another_user_has_prepared_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cache").mkdir()
    os.chown(tmp_path / "cache", 65534, 65534)
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(local_server.tempfile, "gettempdir", lambda: str(tmp_path))
    assert local_server.server_files().home.parent == tmp_path / f"humanmm-{os.getuid()}"


def test_where_no_server_can_be_started_prefect_brings_none_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Prefect's own would serve every user of the machine and every web page."""
    for name in [name for name in os.environ if name.startswith("PREFECT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path))
    monkeypatch.setattr(os, "environ", {**os.environ})
    monkeypatch.setattr(local_server, "_start", lambda files, is_wanted: None)
    with pytest.raises(ResourceError, match=r"no Prefect server could be started within 600 s; .*server.log says"):
        local_server.prefect_server().__enter__()
    assert os.environ["PREFECT_SERVER_ALLOW_EPHEMERAL_MODE"] == "false"
    with local_server.prefect_server(is_wanted=lambda: False) as url:
        assert url == ""
