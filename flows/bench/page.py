"""The page of a motion table: what `humanmm bench --report` shows besides the figures, with overlays of the worst."""

import logging
from collections.abc import Sequence
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import HumanMMError
from humanmm.flows.bench.motion import Job, recipes_of, traces_of
from humanmm.models.benchmark.methods import VideoMotions
from humanmm.models.benchmark.scores import VideoFigures, recording_of
from humanmm.models.benchmark.tables.charts import charts_of
from humanmm.models.benchmark.tables.drawings import case_of, error_about_cuts, median_cases, worst_cases
from humanmm.models.benchmark.tables.rows import Row
from humanmm.models.drawing.overlay import marks_of
from humanmm.models.records.table import Table
from humanmm.storage.pages.bench_page import Page
from humanmm.storage.store.files import replace_file
from humanmm.storage.store.store import Store
from humanmm.tasks.pictures import write_overlay

log = logging.getLogger(__name__)

WORST = 10


def report_page(  # noqa: PLR0913 (one a part of the page)
    title: str,
    created_by: str,
    jobs: Sequence[Job],
    figures: Sequence[VideoFigures],
    config: Config,
    store: Store,
    *,
    facts: str,
    tables: Sequence[Table],
    rows: Sequence[Row],
    methods: tuple[str, ...],
    folder: Path,
) -> Page:
    """Charts, the error about the cuts, a median video of every split and the worst ten.

    Overlays of the worst are written into `folder`/overlays where the videos have pictures.
    """
    traces = traces_of(jobs, config, store, methods)
    curves = error_about_cuts([trace for trace in traces if trace is not None])
    worst = worst_cases(figures, WORST)
    links = {k: _overlay(jobs[k], config, store, methods, folder) for k in worst}
    return Page(
        title=title,
        created_by=created_by,
        facts=facts,
        tables=tables,
        methods=methods,
        charts=charts_of(rows),
        curves=() if curves is None else (curves,),
        typical=[case_of(figures[k], traces[k], overlay=links.get(k, "")) for k in median_cases(figures)],
        worst=[case_of(figures[k], traces[k], overlay=links[k]) for k in worst],
    )


def _overlay(job: Job, config: Config, store: Store, methods: tuple[str, ...], folder: Path) -> str:
    """Draw the first method's people on the video; the link from the page, or nothing where there is none."""
    if job.video is None:
        return ""
    recipe = recipes_of(job, config, methods).motions
    manifest = store.find(recipe.stage, recipe.key)
    if manifest is None:
        return ""
    first = store.read(manifest.ref, VideoMotions).motions[0]
    if first.motion is None or first.shots is None:
        return ""
    try:
        video = job.make(config, store)
    except HumanMMError as error:
        log.warning("%s: no overlay: %s", job.name, error)
        return ""
    recording, marks = recording_of(video, first), marks_of(first.shots)
    path = folder / "overlays" / f"{job.name}.mp4"

    pictures = job.video

    def draw(fresh: Path) -> None:
        with pictures.open("rb") as stream:
            write_overlay(fresh, stream, video.facts, recording, marks, settings=config.deliver)

    replace_file(path, draw)
    return f"overlays/{path.name}"
