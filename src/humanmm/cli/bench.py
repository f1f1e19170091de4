"""`humanmm bench NAME`: one table of the benchmark, on the terminal and as files."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, Option

from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, write
from humanmm.cli.verb import BENCHMARK, Store, app, verb
from humanmm.errors import InputError, UsageError

if TYPE_CHECKING:
    from humanmm.config import Config
    from humanmm.flows.bench.jobs import Job
    from humanmm.models.benchmark.scores import VideoFigures
    from humanmm.models.benchmark.tables.rows import Row
    from humanmm.models.benchmark.tables.statistics import SetStatistics
    from humanmm.storage.pages.bench_page import Page
    from humanmm.storage.store.store import Store as ArtifactStore

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


if TYPE_CHECKING:
    Table = str
else:
    Table = Literal[tuple(TABLES)]
_TABLES = "; ".join(f"{name}: {about}" for name, about in TABLES.items())
_DATA = """ms-mocap: a pack (.npz); ms-aist: a folder of AIST++ sequences (.npz; default: the sample in examples/aist);
ms-render, ms-real: a folder of <name>.mp4 beside <name>_gt.npz (ms-render renders its own without one); ablation,
camera: either; shots: a folder of videos beside <name>.json or <name>_gt.npz, or BBC Planet Earth; speed: a video"""
_SIZE = """ms-mocap, ms-aist: tiny, standard (60 videos each with 2, 3 and 4 transitions; default), ms20 (20 sequences,
each with 2, 3 and 4); ms-render without --data: tiny (one clip of 2 s), standard (60 clips)"""
_IMPORTED = """tables of motion: a row of another system, whose result for each video lies in DIR: <video>.pt (GVHMR),
.pkl (WHAM) or .npz (SLAHMR, TRAM, or motion.zarr's names); may be given again"""
_REPORT = "also write results.json, results.csv, README.md, index.html"
_MINUTES = "speed: how time and memory grow: the video looped to each of these lengths (1 10), a process each"


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of `bench`."""

    table: Annotated[Table, Argument(metavar="NAME", show_default=False, help=_TABLES)]
    settings: Settings
    data: Annotated[Path | None, Option(metavar="PATH", help=_DATA)] = None
    size: Annotated[Literal["tiny", "standard", "ms20"] | None, Option(metavar="SIZE", help=_SIZE)] = None
    check: Annotated[Path | None, Option(metavar="FILE", help="a results.json; exit 1 if a figure is worse")] = None
    imported: Annotated[list[str], Option(metavar="NAME=DIR", help=_IMPORTED)] = field(default_factory=list)
    runs: Annotated[int | None, Option(metavar="N", min=1, help="speed: how often to measure (default: 1)")] = None
    minutes: Annotated[list[float], Option(metavar="M…", help=_MINUTES)] = field(default_factory=list)
    report: Annotated[Path | None, Option(metavar="DIR", help=_REPORT)] = None
    store: Store = None
    force: Annotated[bool, Option("--force", help="replace a report that exists")] = False


@dataclass(frozen=True)
class Measured:
    """One table of figures, as it is printed and compared."""

    rows: "Sequence[Row]"
    table: str
    """In Markdown."""
    command: str
    """The command that measures it again."""
    page: "Callable[[], Page] | None" = None
    """The report's page, if it has one."""


@verb(app, "bench", panel=BENCHMARK)
def bench(options: Options) -> int:
    """Measure one table of the benchmark: print it, write the report, compare it with an older one."""
    config = options.settings.config()
    if options.data is not None and options.table in CLIPS and options.size is not None:
        raise UsageError("--size is for sets that are made here; a folder of clips has the size that it has")
    if options.table != "speed" and (options.runs is not None or options.minutes):
        raise UsageError("--runs and --minutes are for the table speed")
    data = options.data or _own_data(options, config)
    stored = _stored(options.check)
    measure = {"speed": _speed, "shots": _shots}.get(options.table, _motion)
    measured = measure(options, data, config)
    write(measured.table.removesuffix("\n"))
    _report(options, measured)
    return _compare(measured.rows, stored, options.table)


def _own_data(options: Options, config: "Config") -> Path:
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


def _speed(options: Options, data: Path, config: "Config") -> Measured:
    runs_wanted = options.runs or 1
    if options.size is not None:
        raise UsageError("--size is for ms-mocap; speed measures one video")
    if options.minutes and (options.runs is not None or min(options.minutes) <= 0):
        raise UsageError("--minutes takes lengths above 0, and no --runs: every length is measured once")
    if options.report is not None and (options.report / "results.json").exists() and not options.force:
        raise InputError(f"{options.report / 'results.json'} exists already; give --force to replace it")
    if not data.is_file():
        raise InputError(f"{data} is not a file; give a video")

    from humanmm.flows.bench.speed import growth_rows, measure_speed
    from humanmm.models.benchmark.tables.layout import plain_table
    from humanmm.models.benchmark.tables.rows import Row, summarise
    from humanmm.storage.pages.markdown import as_markdown

    if options.minutes:
        command = " ".join(["humanmm bench speed --minutes", *(f"{length:g}" for length in options.minutes)])
        rows = growth_rows(data, config, options.minutes)
    else:
        command = f"humanmm bench speed --runs {runs_wanted}"
        runs = [measure_speed(data, config).metrics() for _ in range(runs_wanted)]
        metrics = {key: summarise([run[key] for run in runs]) for key in runs[0]}
        rows = [Row("humanmm", data.stem, len(runs), 0, metrics)]
    return Measured(rows, as_markdown([plain_table(rows)]), command)


def _shots(options: Options, data: Path, config: "Config") -> Measured:
    if options.size is not None:
        raise UsageError("--size is for ms-mocap; a folder of videos has the size that it has")

    from humanmm.flows.bench.shots import shot_rows
    from humanmm.models.benchmark.tables.charts import OF_CUTS, bars_of
    from humanmm.models.benchmark.tables.layout import tables_of
    from humanmm.models.benchmark.tables.shots import FIGURES
    from humanmm.storage.pages.bench_page import Page
    from humanmm.storage.pages.markdown import as_markdown
    from humanmm.storage.store.open import open_store

    rows, facts = shot_rows(data, config, open_store(options.store))
    write(f"shots: {facts.sentence()}", "")
    tables = tables_of(rows, paper="shots", figures=FIGURES, lines="methods")
    command = " ".join(["humanmm", "bench", "shots", *_settings(options.settings)])
    methods = [row.method for row in rows]
    page = Page("shots", command, f"{facts.sentence()}.", tables, methods=methods, charts=bars_of(rows, OF_CUTS))
    return Measured(rows, as_markdown(tables), command, lambda: page)


def _motion(options: Options, data: Path, config: "Config") -> Measured:
    if not data.exists():
        raise InputError(f"{data} does not exist")

    from humanmm.flows.bench.imported import parse_system, with_imported
    from humanmm.flows.bench.motion import figures_of
    from humanmm.flows.bench.page import report_page
    from humanmm.models.benchmark.methods import ABLATIONS, CAMERAS, METHODS
    from humanmm.models.benchmark.tables.layout import MAIN, OF_ABLATION, OF_CAMERAS, tables_of
    from humanmm.models.benchmark.tables.rows import rows_of
    from humanmm.storage.pages.markdown import as_markdown
    from humanmm.storage.store.open import open_store

    store = open_store(options.store)
    systems = [parse_system(text) for text in options.imported]
    jobs, facts, size = _set(options, data, store)
    write(f"{' '.join([options.table, *size[1:]])}: {facts.sentence()}", "")
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
    named = [word for system in systems for word in ("--imported", system.name)]
    command = " ".join(["humanmm", "bench", options.table, *size, *named, *_settings(options.settings)])

    def page() -> "Page":
        assert options.report is not None
        return report_page(
            options.table, command, jobs, figures, config, store, facts=f"{facts.sentence()}.", tables=tables,
            rows=rows, methods=methods, folder=options.report,
        )  # fmt: skip

    return Measured(rows, as_markdown(tables), command, page)


def _tell_failures(figures: "Sequence[VideoFigures]") -> None:
    """A line on standard error for every video and reason, with the methods that failed so."""
    for video in figures:
        reasons: dict[str, list[str]] = {}
        for method in video.methods:
            if method.failure:
                reasons.setdefault(method.failure, []).append(method.method)
        for reason, methods in reasons.items():
            who = "every method" if len(methods) == len(video.methods) else ", ".join(methods)
            say(f"{video.video}: {who} failed: {reason}")


def _set(options: Options, data: Path, store: "ArtifactStore") -> "tuple[Sequence[Job], SetStatistics, list[str]]":
    """The videos, the set in numbers, and the words of the command that name its size."""
    from humanmm.flows.bench.clips import clip_set
    from humanmm.flows.bench.planned import aist_set, mocap_set

    if options.table in CLIPS or (options.table in MODULES and data.is_dir()):
        return *clip_set(data, store), ["--size", options.size] if options.size else []
    size = options.size or "standard"
    made = aist_set(data, size) if options.table == "ms-aist" else mocap_set(data, size)
    return *made, ["--size", size]


def _report(options: Options, measured: Measured) -> None:
    """Write the report, if one is wanted; another result that is there is not replaced without --force."""
    if options.report is None:
        return
    from humanmm.storage.pages.bench_report import as_json, write_report

    results, rows, command = options.report / "results.json", measured.rows, measured.command
    same = results.exists() and results.read_text(encoding="utf-8") == as_json(options.table, command, rows)
    if results.exists() and not same and not options.force:
        raise InputError(f"{results} exists already with other figures; give --force to replace it")
    write_report(options.report, options.table, command, rows, page=measured.page() if measured.page else None)
    write(results)


def _settings(settings: Settings) -> list[str]:
    """The settings given as flags; a settings file is named as such, without its path."""
    flags = [word for name, text in sorted(settings.flags.items()) for word in (f"--{name}", text)]
    return [*(["--config", settings.file.name] if settings.file else []), *flags]


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
        say(f"worse: {sentence}")
    return 1 if worse else 0
