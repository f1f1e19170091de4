"""`bench ms-render --size tiny`: from nothing to the table, and the same again from the store."""

import json
from pathlib import Path

import pytest

from humanmm.cli import main


@pytest.mark.usefixtures("two_methods", "parsed_once")
def test_tiny_makes_its_clip_and_its_table_and_repeats_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    command = [
        "bench",
        "ms-render",
        "--size",
        "tiny",
        "--store",
        str(tmp_path / "store"),
        "--people.pose",
        "blazepose-full",
    ]
    assert main([*command, "--report", str(tmp_path / "one")]) == 0
    assert main([*command, "--report", str(tmp_path / "two")]) == 0
    one, two = ((tmp_path / name / "results.json").read_bytes() for name in ("one", "two"))
    assert one == two
    (film,) = (tmp_path / "one" / "overlays").glob("*.mp4")
    assert film.stat().st_size > 0 and f"overlays/{film.name}" in (tmp_path / "one" / "index.html").read_text()
    rows = {row["method"]: row["metrics"] for row in json.loads(one)["rows"] if row["n"] == 1}
    assert rows["humanmm"]["coverage"]["mean"] > 0.9
    assert rows["humanmm"]["roe_deg"]["mean"] < rows["concat"]["roe_deg"]["mean"]
