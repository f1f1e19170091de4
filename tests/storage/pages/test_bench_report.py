"""Tables of the benchmark as files."""

import csv
import json
from pathlib import Path

import numpy as np

from humanmm.models.benchmark.tables.rows import Row, summarise
from humanmm.storage.pages.bench_report import write_report

ROWS = [
    Row("humanmm", "3 shots", 4, 1, {"wa_mpjpe100_mm": summarise([80.0, 90, 100, 130]), "roe_deg": summarise([12.5])}),
    Row("concat", "3 shots", 4, 0, {"wa_mpjpe100_mm": summarise([280.0, 290, 300, 330])}),
]


def test_the_interval_of_a_mean_holds_it_and_one_sample_is_its_own() -> None:
    many = summarise(np.random.default_rng(1).normal(50, 10, 400).tolist())
    assert many.ci95[0] < many.mean < many.ci95[1]
    assert np.isclose(many.ci95[1] - many.ci95[0], 2 * 1.96 * 10 / 20, rtol=0.15)
    assert summarise([3.0]).ci95 == (3.0, 3.0)


def test_results_json_has_the_shape_of_the_contract(tmp_path: Path) -> None:
    write_report(tmp_path, "speed", "humanmm bench speed", ROWS)
    tree = json.loads((tmp_path / "results.json").read_text())
    assert (tree["table"], tree["created_by"]) == ("speed", "humanmm bench speed")
    first = tree["rows"][0]
    assert (first["method"], first["split"], first["n"], first["failed"]) == ("humanmm", "3 shots", 4, 1)
    assert first["metrics"]["roe_deg"] == {"mean": 12.5, "median": 12.5, "ci95": [12.5, 12.5]}


def test_every_file_is_there_and_the_same_table_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_report(tmp_path / name, "ms-render", "humanmm bench ms-render", ROWS)
    files = {path.name for path in (tmp_path / "a").iterdir()}
    assert files == {"results.json", "results.csv", "README.md", "index.html"}
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_csv_has_a_line_for_every_figure(tmp_path: Path) -> None:
    write_report(tmp_path, "ms-render", "humanmm bench ms-render", ROWS)
    with (tmp_path / "results.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [(line["method"], line["metric"]) for line in lines] == [
        ("humanmm", "wa_mpjpe100_mm"),
        ("humanmm", "roe_deg"),
        ("concat", "wa_mpjpe100_mm"),
    ]
    assert float(lines[2]["median"]) == 295.0
