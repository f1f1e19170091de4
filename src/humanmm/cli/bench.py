"""`humanmm bench NAME`: one table of the benchmark, on the terminal and as files."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanmm.cli.settings import UsageError, add_settings, load_config
from humanmm.errors import InputError

if TYPE_CHECKING:
    from humanmm.config import Config
    from humanmm.flows.bench.jobs import Job
    from humanmm.models.benchmark.scores import VideoFigures
    from humanmm.models.benchmark.tables.rows import Row
    from humanmm.models.benchmark.tables.statistics import SetStatistics
    from humanmm.storage.pages.bench_page import Page
    from humanmm.storage.store.store import Store

TABLES = {
    "ms-mocap": "motion from multi-shot videos made of motion capture",
    "ms-aist": "motion from real 2D detections of AIST++",
    "ms-render": "motion from rendered clips with truths",
    "ms-real": "motion from real clips with truths",
    "shots": "the detector of cuts, its parts added one by one",
    "camera": "odometry, and the motion that comes of it",
    "ablation": "every module off in turn",
    "speed": "milliseconds a frame of every stage",
}
SAMPLE = Path("examples/aist")
"""What ms-aist reads unless told otherwise: the sequence that the repository holds."""
MODULES = ("ablation", "camera")
CLIPS = ("ms-render", "ms-real")
SIZES = ("tiny", "standard", "ms20")


def add_bench(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `bench NAME`."""
    parser = verbs.add_parser(
        "bench",
        parents=[common],
        allow_abbrev=False,
        help="measure: " + "; ".join(f"{name} ({about})" for name, about in TABLES.items()),
    )
    parser.add_argument("table", choices=tuple(TABLES), metavar="NAME", help=", ".join(TABLES))
    parser.add_argument(
        "--data",
        type=Path,
        metavar="PATH",
        help="ms-mocap: a pack (.npz); ms-aist: a folder of AIST++ sequences (.npz; default: the sample in "
        "examples/aist); ms-render, ms-real: a folder of <name>.mp4 beside <name>_gt.npz (ms-render "
        "renders its own without one); ablation, camera: either; shots: a folder of videos beside <name>.json or "
        "<name>_gt.npz, or BBC Planet Earth; speed: a video",
    )
    parser.add_argument(
        "--size", choices=SIZES, metavar="SIZE",
        help="ms-mocap, ms-aist: tiny, standard (60 videos each with 2, 3 and 4 transitions; default), ms20 (20 takes, "
        "each with 2, 3 and 4); ms-render without --data: tiny (one clip of 2 s), standard (60 clips)",
    )  # fmt: skip
    parser.add_argument(
        "--check", type=Path, metavar="FILE", help="a results.json; exit 1 if a figure is worse than it"
    )
    parser.add_argument(
        "--imported", action="append", default=[], metavar="NAME=DIR",
        help="tables of motion: a row of another system, whose result for each video lies in DIR: <video>.pt (GVHMR), "
        ".pkl (WHAM) or .npz (SLAHMR, TRAM, or motion.zarr's names); may be given again",
    )  # fmt: skip
    parser.add_argument("--runs", type=int, metavar="N", help="speed: how often to measure (default: 1)")
    parser.add_argument(
        "--minutes", type=float, nargs="+", metavar="M",
        help="speed: how time and memory grow: the video looped to each of these lengths (1 10), a process each",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="also write results.json, results.csv, README.md, index.html"
    )
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…", help="where motions and figures are kept")
    parser.add_argument("--force", action="store_true", help="replace a report that exists")
    add_settings(parser)
    parser.set_defaults(run=bench)


VERBS = (add_bench,)


def bench(options: argparse.Namespace) -> int:
    """Measure, print the table, write the report, compare."""
    config = load_config(options, {})
    if options.data is None:
        options.data = _own_data(options, config)
    elif options.table in CLIPS and options.size is not None:
        raise UsageError("--size is for sets that are made here; a folder of clips has the size that it has")
    if options.table == "speed":
        return _speed(options, config)
    if options.runs is not None or options.minutes:
        raise UsageError("--runs and --minutes are for the table speed")
    if options.table == "shots":
        return _shots(options, config)
    return _motion(options, config)


def _own_data(options: argparse.Namespace, config: "Config") -> Path:
    """The data of a table that has or makes its own."""
    if options.table == "ms-aist":
        if not SAMPLE.is_dir():
            raise InputError(f"{SAMPLE} is not here: run in the repository, or give --data DIR with AIST++ sequences")
        return SAMPLE
    if options.table != "ms-render":
        raise UsageError(f"{options.table} needs --data PATH")
    if options.size == "ms20":
        raise UsageError("ms-render comes in the sizes tiny and standard")
    from humanmm.flows.bench.render_set import own_set

    return own_set(options.size or "standard", threads=config.run.threads)


def _speed(options: argparse.Namespace, config: "Config") -> int:
    runs_wanted = 1 if options.runs is None else options.runs
    if runs_wanted < 1:
        raise UsageError(f"--runs {runs_wanted}: at least one run is needed")
    if options.size is not None:
        raise UsageError("--size is for ms-mocap; speed measures one video")
    if options.minutes and (options.runs is not None or min(options.minutes) <= 0):
        raise UsageError("--minutes takes lengths above 0, and no --runs: every length is measured once")
    if options.report is not None and (options.report / "results.json").exists() and not options.force:
        raise InputError(f"{options.report / 'results.json'} exists already; give --force to replace it")
    if not options.data.is_file():
        raise InputError(f"{options.data} is not a file; give a video")
    stored = _stored(options.check)

    from humanmm.flows.bench.speed import growth_rows, measure_speed
    from humanmm.models.benchmark.tables.layout import plain_table
    from humanmm.models.benchmark.tables.rows import Row, summarise
    from humanmm.storage.pages.bench_report import write_report
    from humanmm.storage.pages.markdown import as_markdown

    if options.minutes:
        command = " ".join(["humanmm bench speed --minutes", *(f"{length:g}" for length in options.minutes)])
        rows = growth_rows(options.data, config, options.minutes)
    else:
        command = f"humanmm bench speed --runs {runs_wanted}"
        runs = [measure_speed(options.data, config).metrics() for _ in range(runs_wanted)]
        metrics = {key: summarise([run[key] for run in runs]) for key in runs[0]}
        rows = [Row("humanmm", options.data.stem, len(runs), 0, metrics)]
    sys.stdout.write(as_markdown([plain_table(rows)]))
    if options.report is not None:
        write_report(options.report, "speed", command, rows)
        sys.stdout.write(f"{options.report / 'results.json'}\n")
    return _compare(rows, stored, "speed")


def _shots(options: argparse.Namespace, config: "Config") -> int:
    if options.size is not None:
        raise UsageError("--size is for ms-mocap; a folder of videos has the size that it has")
    stored = _stored(options.check)

    from humanmm.flows.bench.shots import shot_rows
    from humanmm.models.benchmark.shot_scores import FIGURES
    from humanmm.models.benchmark.tables.charts import OF_CUTS, bars_of
    from humanmm.models.benchmark.tables.layout import tables_of
    from humanmm.storage.pages.bench_page import Page
    from humanmm.storage.pages.markdown import as_markdown
    from humanmm.storage.store.open import open_store
    from humanmm.storage.store.store import default_store

    rows, facts = shot_rows(options.data, config, open_store(options.store or default_store()))
    sys.stdout.write(f"shots: {facts.sentence()}\n\n")
    tables = tables_of(rows, paper="shots", figures=FIGURES, lines="methods")
    sys.stdout.write(as_markdown(tables))
    command = " ".join(["humanmm", "bench", "shots", *_settings(options)])
    methods = [row.method for row in rows]
    page = Page("shots", command, f"{facts.sentence()}.", tables, methods=methods, charts=bars_of(rows, OF_CUTS))
    _report(options, command, rows, lambda: page)
    return _compare(rows, stored, "shots")


def _motion(options: argparse.Namespace, config: "Config") -> int:
    if not options.data.exists():
        raise InputError(f"{options.data} does not exist")
    stored = _stored(options.check)

    from humanmm.flows.bench.imported import parse_system, with_imported
    from humanmm.flows.bench.motion import figures_of
    from humanmm.flows.bench.page import report_page
    from humanmm.models.benchmark.methods import ABLATIONS, CAMERAS, METHODS
    from humanmm.models.benchmark.tables.layout import MAIN, OF_ABLATION, OF_CAMERAS, tables_of
    from humanmm.models.benchmark.tables.rows import rows_of
    from humanmm.storage.pages.markdown import as_markdown
    from humanmm.storage.store.open import open_store
    from humanmm.storage.store.store import default_store

    store = open_store(options.store or default_store())
    systems = [parse_system(text) for text in options.imported]
    jobs, facts, size = _set(options, store)
    sys.stdout.write(f"{' '.join([options.table, *size[1:]])}: {facts.sentence()}\n\n")
    paper = "ms-Motion (20)" if options.size == "ms20" else "ms-AIST"
    methods, shown = METHODS, MAIN
    if options.table in MODULES:
        paper = options.table
        methods, shown = (ABLATIONS, OF_ABLATION) if options.table == "ablation" else (CAMERAS, OF_CAMERAS)
    figures = figures_of(jobs, config, store, methods)
    figures_shown = with_imported(jobs, figures, systems, config, store)
    _tell_failures(figures_shown)
    rows = rows_of(figures_shown)
    tables = tables_of(rows, paper=paper, figures=shown, lines="methods" if options.table in MODULES else "figures")
    sys.stdout.write(as_markdown(tables))
    named = [word for system in systems for word in ("--imported", system.name)]
    command = " ".join(["humanmm", "bench", options.table, *size, *named, *_settings(options)])
    facts_line = f"{facts.sentence()}."
    _report(
        options, command, rows,
        lambda: report_page(
            options.table, command, jobs, figures, config, store, facts=facts_line, tables=tables, rows=rows,
            methods=methods, folder=options.report,
        ),
    )  # fmt: skip
    return _compare(rows, stored, options.table)


def _tell_failures(figures: "Sequence[VideoFigures]") -> None:
    """A line on standard error for every video and reason, with the methods that failed so."""
    for video in figures:
        reasons: dict[str, list[str]] = {}
        for method in video.methods:
            if method.failure:
                reasons.setdefault(method.failure, []).append(method.method)
        for reason, methods in reasons.items():
            who = "every method" if len(methods) == len(video.methods) else ", ".join(methods)
            sys.stderr.write(f"humanmm: {video.video}: {who} failed: {reason}\n")


def _set(options: argparse.Namespace, store: "Store") -> "tuple[Sequence[Job], SetStatistics, list[str]]":
    """The videos, the set in numbers, and the words of the command that name its size."""
    from humanmm.flows.bench.clips import clip_set
    from humanmm.flows.bench.planned import aist_set, mocap_set

    if options.table in CLIPS or (options.table in MODULES and options.data.is_dir()):
        return *clip_set(options.data, store), ["--size", options.size] if options.size else []
    size = options.size or "standard"
    made = aist_set(options.data, size) if options.table == "ms-aist" else mocap_set(options.data, size)
    return *made, ["--size", size]


def _report(options: argparse.Namespace, command: str, rows: "Sequence[Row]", page: "Callable[[], Page]") -> None:
    """Write the report, if one is wanted; another result that is there is not replaced without --force."""
    if options.report is None:
        return
    from humanmm.storage.pages.bench_report import as_json, write_report

    results = options.report / "results.json"
    same = results.exists() and results.read_text(encoding="utf-8") == as_json(options.table, command, rows)
    if results.exists() and not same and not options.force:
        raise InputError(f"{results} exists already with other figures; give --force to replace it")
    write_report(options.report, options.table, command, rows, page=page())
    sys.stdout.write(f"{results}\n")


def _settings(options: argparse.Namespace) -> list[str]:
    """The settings given as flags; a settings file is named as such, without its path."""
    given = {name: value for name, value in vars(options).items() if "." in name and value is not None}
    flags = [word for name, value in sorted(given.items()) for word in (f"--{name}", str(value))]
    return [*(["--config", options.config.name] if options.config else []), *flags]


def _stored(path: Path | None) -> dict[str, Any] | None:
    if path is None:
        return None
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as a results.json: {error}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path} is not a results.json: it holds no object")
    return tree


def _compare(rows: "Sequence[Row]", stored: dict[str, Any] | None, table: str) -> int:
    if stored is None:
        return 0
    from humanmm.models.benchmark.tables.regression import regressions

    worse = regressions(rows, stored, table=table)
    for sentence in worse:
        sys.stderr.write(f"humanmm: worse: {sentence}\n")
    return 1 if worse else 0
