"""`humanmm bench NAME`: one table of the benchmark, on the terminal and as files."""

import argparse
import sys
from pathlib import Path
from typing import Any

from humanmm.cli.settings import UsageError, add_settings, load_config
from humanmm.errors import InputError

TABLES = ("speed",)


def add_bench(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `bench NAME`."""
    parser = verbs.add_parser(
        "bench", parents=[common], allow_abbrev=False, help="measure: speed (milliseconds a frame of every stage)"
    )
    parser.add_argument("table", choices=TABLES, metavar="NAME", help=", ".join(TABLES))
    parser.add_argument("--data", type=Path, required=True, metavar="VIDEO", help="the video to recover")
    parser.add_argument("--runs", type=int, default=1, metavar="N", help="how often to measure (default: 1)")
    parser.add_argument("--report", type=Path, metavar="DIR", help="also write results.json, results.csv, README.md")
    parser.add_argument("--force", action="store_true", help="replace a report that exists")
    add_settings(parser)
    parser.set_defaults(run=bench)


def bench(options: argparse.Namespace) -> int:
    """Measure, print the table, write the report."""
    if options.runs < 1:
        raise UsageError(f"--runs {options.runs}: at least one run is needed")
    if options.report is not None and (options.report / "results.json").exists() and not options.force:
        raise InputError(f"{options.report / 'results.json'} exists already; give --force to replace it")
    if not options.data.is_file():
        raise InputError(f"{options.data} is not a file; give a video")
    config = load_config(options, {})

    from humanmm.flows.benchmark import measure_speed
    from humanmm.storage.bench_report import Row, as_markdown, summarise, write_report

    runs = [measure_speed(options.data, config).metrics() for _ in range(options.runs)]
    metrics = {key: summarise([run[key] for run in runs]) for key in runs[0]}
    row = Row("humanmm", options.data.stem, len(runs), 0, metrics)
    sys.stdout.write(as_markdown([row]))
    if options.report is not None:
        write_report(options.report, "speed", f"humanmm bench speed --runs {options.runs}", [row])
        sys.stdout.write(f"{options.report / 'results.json'}\n")
    return 0
