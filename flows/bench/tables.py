"""The tables of `humanmm bench`: which data each needs, how it is measured, and its report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import InputError, UsageError
from humanmm.flows.bench.clips import clip_set, in_two_places, judged_clips, labels_of_jobs
from humanmm.flows.bench.golden import checked_clips, overlays
from humanmm.flows.bench.imported import parse_system, with_imported
from humanmm.flows.bench.motion import Job, figures_of
from humanmm.flows.bench.page import report_page
from humanmm.flows.bench.perception import identity_views, lifted_landmarks
from humanmm.flows.bench.planned import aist_set, mocap_set
from humanmm.flows.bench.render_set import own_set
from humanmm.flows.bench.shots import shot_rows
from humanmm.flows.bench.speed import growth_rows, measure_speed
from humanmm.models.benchmark.identity import cut_pairs, linked
from humanmm.models.benchmark.methods import ABLATIONS, CAMERAS, CUTS, METHODS
from humanmm.models.benchmark.scores import VideoFigures
from humanmm.models.benchmark.tables import shots
from humanmm.models.benchmark.tables.charts import OF_CUTS, bars_of
from humanmm.models.benchmark.tables.cuts import cut_tables, identity_rows, identity_tables
from humanmm.models.benchmark.tables.doubts import doubts_table, rows_of_doubts
from humanmm.models.benchmark.tables.golden import all_verdicts, golden_tables, rows_of_golden
from humanmm.models.benchmark.tables.groups import spread_tables
from humanmm.models.benchmark.tables.layout import (
    MAIN,
    OF_ABLATION,
    OF_CAMERAS,
    OF_JOINTS,
    note_on_ate,
    plain_table,
    tables_of,
)
from humanmm.models.benchmark.tables.lifting import lifting_rows, lifting_table
from humanmm.models.benchmark.tables.overlay import overlay_rows, overlay_tables
from humanmm.models.benchmark.tables.rows import Row, rows_of, summarise
from humanmm.models.benchmark.tables.statistics import SetStatistics
from humanmm.models.records.table import Table
from humanmm.storage.pages.bench_page import Page
from humanmm.storage.pages.bench_report import as_json, write_report
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import Store

SAMPLE = Path("examples/aist")
"""What ms-aist reads by default: the sequence that the repository holds."""
MODULES = {"ablation": (ABLATIONS, OF_ABLATION), "camera": (CAMERAS, OF_CAMERAS), "cuts": (CUTS, OF_JOINTS)}
"""Tables of parts of the pipeline: their methods and figures."""
CLIPS = ("ms-render", "ms-real")
WITHOUT_SIZE = ("golden", "overlay", "identity", "lifting", "doubts")


@dataclass(frozen=True, kw_only=True)
class TableRequest:
    """What `humanmm bench` was given."""

    table: str
    data: Path | None
    size: str | None
    imported: Sequence[str]
    """NAME=FOLDER of other systems' results."""
    runs: int | None
    minutes: Sequence[float]
    report: Path | None
    store: Path | None
    force: bool
    settings: Sequence[str]
    """The words of the command that name settings."""


@dataclass(frozen=True)
class Measured:
    """One table of figures, as it is printed and compared."""

    rows: Sequence[Row]
    tables: Sequence[Table]
    command: str
    """The command that measures it again, without paths."""
    failures: Sequence[str] = ()
    """A sentence for every video and reason."""
    page: Callable[[], Page] | None = None
    """The report's page, if it has one."""


def measure(request: TableRequest, config: Config, *, announce: Callable[[str], None]) -> Measured:
    """Measure a table; `announce` is called with the set in numbers before what takes long begins."""
    if request.data is not None and request.table in CLIPS and request.size is not None:
        raise UsageError("--size is for sets that are made here; a folder of clips has the size that it has")
    if request.table in WITHOUT_SIZE and (request.size is not None or request.imported):
        raise UsageError(f"{request.table} takes no --size and no --imported: the videos are those of the folder")
    if request.table != "speed" and (request.runs is not None or request.minutes):
        raise UsageError("--runs and --minutes are for the table speed")
    data = request.data or own_data(request, config)
    if request.table == "speed":
        return _speed(request, data, config)
    makers = {
        "shots": _shots, "golden": _golden, "overlay": _overlay, "identity": _identity, "lifting": _lifting,
        "doubts": _doubts,
    }  # fmt: skip
    return makers.get(request.table, _motion)(request, data, config, announce)


def report(request: TableRequest, folder: Path, measured: Measured) -> Path:
    """Write the report; the path of its results.json. Another result that is there stays, unless with --force."""
    results, rows, command = folder / "results.json", measured.rows, measured.command
    same = results.exists() and results.read_text(encoding="utf-8") == as_json(request.table, command, rows)
    if results.exists() and not same and not request.force:
        raise InputError(f"{results} exists already with other figures; give --force to replace it")
    write_report(folder, request.table, command, rows, page=measured.page() if measured.page else None)
    return results


def own_data(request: TableRequest, config: Config) -> Path:
    """The data of a table that has or makes its own."""
    if request.table == "ms-aist":
        if not SAMPLE.is_dir():
            raise InputError(f"{SAMPLE} is not here: run in the repository, or give --data DIR with AIST++ sequences")
        return SAMPLE
    if request.table != "ms-render":
        raise UsageError(f"{request.table} needs --data PATH")
    if request.size == "ms20":
        raise UsageError("ms-render comes in the sizes tiny, standard and places")
    return own_set(request.size or "standard", threads=config.run.threads)


def _speed(request: TableRequest, data: Path, config: Config) -> Measured:
    if request.size is not None:
        raise UsageError("--size is for ms-mocap; speed measures one video")
    if request.minutes and (request.runs is not None or min(request.minutes) <= 0):
        raise UsageError("--minutes takes lengths above 0, and no --runs: every length is measured once")
    if request.report is not None and (request.report / "results.json").exists() and not request.force:
        raise InputError(f"{request.report / 'results.json'} exists already; give --force to replace it")
    if not data.is_file():
        raise InputError(f"{data} is not a file; give a video")
    if request.minutes:
        command = " ".join(["humanmm bench speed --minutes", *(f"{length:g}" for length in request.minutes)])
        rows = growth_rows(data, config, request.minutes)
    else:
        runs = [measure_speed(data, config).metrics() for _ in range(request.runs or 1)]
        command = f"humanmm bench speed --runs {len(runs)}"
        metrics = {key: summarise([run[key] for run in runs]) for key in runs[0]}
        rows = [Row("humanmm", data.stem, len(runs), 0, metrics)]
    return Measured(rows, [plain_table(rows)], command)


def _shots(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    if request.size is not None:
        raise UsageError("--size is for ms-mocap; a folder of videos has the size that it has")
    rows, facts = shot_rows(data, config, open_store(request.store))
    announce(f"shots: {facts.sentence()}\n")
    tables = tables_of(rows, paper="shots", figures=shots.FIGURES, lines="methods")
    command = " ".join(["humanmm", "bench", "shots", *request.settings])
    methods = [row.method for row in rows]
    page = Page("shots", command, f"{facts.sentence()}.", tables, methods=methods, charts=bars_of(rows, OF_CUTS))
    return Measured(rows, tables, command, page=lambda: page)


def _golden(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    clips, left_out = checked_clips(data, config, open_store(request.store))
    command = " ".join(["humanmm", "bench", "golden", *request.settings])
    tables = golden_tables(clips)
    page = Page("golden", command, "", [*tables, all_verdicts(clips)])
    return Measured(rows_of_golden(clips), tables, command, failures=left_out, page=lambda: page)


def _overlay(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    videos, refused = overlays(data, config, open_store(request.store))
    command = " ".join(["humanmm", "bench", "overlay", *request.settings])
    rows, tables = overlay_rows(videos, [sentence.split(":")[0] for sentence in refused]), overlay_tables(videos)
    page = Page("overlay", command, "", tables)
    return Measured(rows, tables, command, failures=refused, page=lambda: page)


def _identity(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    views, failed = identity_views(data, config, open_store(request.store))
    figures = [linked(pair) for pair in cut_pairs(views)]
    command = " ".join(["humanmm", "bench", "identity", *request.settings])
    tables = identity_tables(figures)
    page = Page("identity", command, "", tables)
    return Measured(identity_rows(figures), tables, command, failures=failed, page=lambda: page)


def _lifting(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    lifters, failed = lifted_landmarks(data, config, open_store(request.store))
    command = " ".join(["humanmm", "bench", "lifting", *request.settings])
    rows, tables = lifting_rows(lifters, failed=len(failed)), [lifting_table(lifters)]
    page = Page("lifting", command, "", tables)
    return Measured(rows, tables, command, failures=failed, page=lambda: page)


def _doubts(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    judgements, failed = judged_clips(data, config, open_store(request.store))
    command = " ".join(["humanmm", "bench", "doubts", *request.settings])
    rows, tables = rows_of_doubts(judgements, failed=len(failed)), [doubts_table(judgements)]
    page = Page("doubts", command, "", tables)
    return Measured(rows, tables, command, failures=failed, page=lambda: page)


def _motion(request: TableRequest, data: Path, config: Config, announce: Callable[[str], None]) -> Measured:
    if not data.exists():
        raise InputError(f"{data} does not exist")
    store = open_store(request.store)
    systems = [parse_system(text) for text in request.imported]
    jobs, facts, size = _set(request, data, store)
    announce(f"{' '.join([request.table, *size[1:]])}: {facts.sentence()}\n")
    methods, shown = MODULES.get(request.table, (METHODS, MAIN))
    figures = figures_of(jobs, config, store, methods)
    figures_shown = with_imported(jobs, figures, systems, config, store)
    rows = rows_of(figures_shown)
    if request.table in MODULES:
        tables = tables_of(rows, paper=request.table, figures=shown, lines="methods")
    else:
        tables = tables_of(rows, paper="ms-Motion (20)" if request.size == "ms20" else "ms-AIST", figures=shown)
    if request.table == "cuts":
        tables = [*cut_tables(figures_shown, labels_of_jobs(jobs)), *tables]
    if request.table in CLIPS:
        tables += spread_tables(figures_shown, labels_of_jobs(jobs))
    tables += note_on_ate(in_two_places(jobs), len(jobs))
    named = [word for system in systems for word in ("--imported", system.name)]
    command = " ".join(["humanmm", "bench", request.table, *size, *named, *request.settings])

    def page() -> Page:
        assert request.report is not None
        return report_page(
            request.table, command, jobs, figures, config, store, facts=f"{facts.sentence()}.", tables=tables,
            rows=rows, methods=methods, folder=request.report,
        )  # fmt: skip

    return Measured(rows, tables, command, failures=_failures(figures_shown), page=page)


def _set(request: TableRequest, data: Path, store: Store) -> tuple[Sequence[Job], SetStatistics, list[str]]:
    """The videos, the set in numbers, and the words of the command that name its size."""
    if request.table in CLIPS or (request.table in MODULES and data.is_dir()):
        return *clip_set(data, store), ["--size", request.size] if request.size else []
    size = request.size or "standard"
    if size == "places":
        raise UsageError("the size places is for ms-render")
    made = aist_set(data, size) if request.table == "ms-aist" else mocap_set(data, size)
    return *made, ["--size", size]


def _failures(figures: Sequence[VideoFigures]) -> list[str]:
    """A sentence for every video and reason, with the methods that failed so."""
    sentences = []
    for video in figures:
        reasons: dict[str, list[str]] = {}
        for method in video.methods:
            if method.failure:
                reasons.setdefault(method.failure, []).append(method.method)
        for reason, methods in reasons.items():
            who = "every method" if len(methods) == len(video.methods) else ", ".join(methods)
            sentences.append(f"{video.video}: {who} failed: {reason}")
    return sentences
