"""`humanmm doctor`: what is wrong is told with its cure."""

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from humanmm import installation


def _checks(toy: Any, *arguments: str, **environment: str) -> tuple[int, dict[str, dict[str, Any]]]:
    status, out, _ = toy.main("doctor", "--json", *arguments, **environment)
    tree = json.loads(out)
    assert tree["ok"] is (status == 0)
    return status, {check["name"]: check for check in tree["checks"]}


def test_this_installation_is_sound_and_every_line_has_a_cure(toy: Any) -> None:
    status, checks = _checks(toy)
    assert status == 0, [check for check in checks.values() if not check["ok"]]
    named = {"python", "torch", "weight files", "store", "free disk space", "dashboard", "free memory", "accelerators"}
    assert named <= set(checks)
    assert all(check["cure"] and check["found"] for check in checks.values())


def test_a_full_disk_a_misspelt_variable_and_a_dead_server_are_found(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "MIN_FREE_BYTES", 1 << 60)
    status, checks = _checks(toy, HUMANMM_STROE="x", PREFECT_API_URL="http://127.0.0.1:9/api")
    assert status == 1
    assert {name for name, check in checks.items() if not check["ok"]} == {
        "free disk space", "environment variables", "dashboard",
    }  # fmt: skip
    assert "HUMANMM_STROE" in checks["environment variables"]["found"]
    assert "HUMANMM_STORE" in checks["environment variables"]["cure"]
    lines = toy.main("doctor", HUMANMM_STROE="x")[1].splitlines()
    after = lines[[line.startswith("BAD  environment") for line in lines].index(True) + 1]
    assert after.strip().startswith("→ it has no effect")


def test_a_batch_table_that_is_no_database_is_reported(toy: Any) -> None:
    toy.store.mkdir()
    Path(toy.store / "batches.sqlite").write_text("this is no database, and never was one")
    status, checks = _checks(toy)
    assert status == 1 and not checks["batches"]["ok"] and "submit the batches again" in checks["batches"]["cure"]


def test_a_store_is_writable_if_a_file_can_be_written_and_nothing_of_that_stays(toy: Any) -> None:
    status, checks = _checks(toy)
    assert status == 0 and checks["store"]["found"].endswith(": writable")
    assert not list(toy.folder.glob(".humanmm-*"))
    _, checks = _checks(toy, HUMANMM_STORE="/proc/nope")  # where root has all rights and can make nothing
    assert not checks["store"]["ok"] and checks["store"]["found"].startswith("/proc/nope: not writable (")


def test_every_variable_that_the_code_reads_is_known_to_doctor() -> None:
    import re

    root = Path(__file__).resolve().parents[2]
    files = [path for name in ("src/humanmm", "flows", "tasks", "storage") for path in (root / name).rglob("*.py")]
    text = "".join(path.read_text() for path in files)
    read = set(re.findall(r"HUMANMM_([A-Z_]+)", text))
    assert read <= set(installation.VARIABLES) and {"STORE", "LOG"} <= read


@pytest.mark.parametrize(
    ("built_for", "sees", "found"),
    [
        (None, False, "is not built for CUDA"),
        ("12.6", False, "sees none of them"),
        ("12.6", True, "X runs the pose networks"),
    ],
)
def test_an_accelerator_is_told_with_what_uses_it(
    monkeypatch: pytest.MonkeyPatch, built_for: str | None, sees: bool, found: str
) -> None:
    monkeypatch.setattr(installation, "nvidia_devices", lambda: 1)
    monkeypatch.setattr(torch.version, "cuda", built_for)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: sees)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "X")
    assert found in installation._accelerators()[0]
