"""`humanmm bench NAME`: one table of the benchmark, on the terminal and as files."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, write
from humanmm.cli.verb import BENCHMARK, Store, app, verb

if TYPE_CHECKING:
    from humanmm.flows.bench.tables import TableRequest

TABLES = {
    "ms-mocap": "motion from multi-shot videos made of motion capture",
    "ms-aist": "motion from real 2D detections of AIST++",
    "ms-render": "motion from rendered clips with truths",
    "ms-real": "motion from real clips with truths",
    "shots": "the detector of cuts, its parts added one by one",
    "camera": "odometry, and the motion that comes of it",
    "ablation": "every module off in turn",
    "cuts": "how shots are joined, every witness of a cut left out in turn",
    "golden": "real clips that somebody looked at, expectation by expectation",
    "overlay": "how far bodies lie from people in the picture, without truths",
    "doubts": "what is wrong in recovered clips with truths, and whether a warning said so",
    "identity": "who is who across cuts, on clips whose people are known",
    "lifting": "where the lifters have landmarks in space, on clips with truths",
    "speed": "milliseconds a frame of every stage",
}
if TYPE_CHECKING:
    Table = str
else:
    Table = Literal[tuple(TABLES)]
_TABLES = "; ".join(f"{name}: {about}" for name, about in TABLES.items())
_DATA = """ms-mocap: a pack (.npz); ms-aist: a folder of AIST++ sequences (.npz; default: the sample in examples/aist);
ms-render, ms-real, doubts, lifting: a folder of <name>.mp4 beside <name>_gt.npz (ms-render renders its own without
one); ablation, camera, cuts: a pack or such a folder; shots: a folder of videos beside <name>.json or <name>_gt.npz, or
BBC Planet Earth; golden, overlay: a folder of videos; identity: a folder of <name>.mp4 beside <name>_gt.npz, of videos
of the golden set, or both; speed: a video"""
_SIZE = """ms-mocap, ms-aist: tiny, standard (60 videos each with 2, 3 and 4 transitions; default), ms20 (20 sequences,
each with 2, 3 and 4); ms-render without --data: tiny (one clip of 2 s), standard (60 clips), places (96 clips)"""
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
    size: Annotated[Literal["tiny", "standard", "ms20", "places"] | None, Option(metavar="SIZE", help=_SIZE)] = None
    check: Annotated[Path | None, Option(metavar="FILE", help="a results.json; exit 1 if a figure is worse")] = None
    imported: Annotated[list[str], Option(metavar="NAME=DIR", help=_IMPORTED)] = field(default_factory=list)
    runs: Annotated[int | None, Option(metavar="N", min=1, help="speed: how often to measure (default: 1)")] = None
    minutes: Annotated[list[float], Option(metavar="M…", help=_MINUTES)] = field(default_factory=list)
    report: Annotated[Path | None, Option(metavar="DIR", help=_REPORT)] = None
    store: Store = None
    force: Annotated[bool, Option("--force", help="replace a report that exists")] = False

    def request(self) -> "TableRequest":
        """The table that they describe."""
        from humanmm.flows.bench.tables import TableRequest

        return TableRequest(
            table=self.table, data=self.data, size=self.size, imported=self.imported, runs=self.runs,
            minutes=self.minutes, report=self.report, store=self.store, force=self.force,
            settings=self.settings.words(),
        )  # fmt: skip


@verb(app, "bench", panel=BENCHMARK)
def bench(options: Options) -> int:
    """Measure one table of the benchmark: print it, write the report, compare it with an older one."""
    from humanmm.flows.bench import tables
    from humanmm.models.benchmark.tables.regression import regressions
    from humanmm.storage.pages.bench_report import read_results
    from humanmm.storage.pages.markdown import as_markdown

    config, request = options.settings.config(), options.request()
    older = None if options.check is None else read_results(options.check)
    measured = tables.measure(request, config, announce=write)
    for failure in measured.failures:
        say(failure)
    write(as_markdown(measured.tables).removesuffix("\n"))
    if options.report is not None:
        write(tables.report(request, options.report, measured))
    worse = [] if older is None else regressions(measured.rows, older, table=options.table)
    for sentence in worse:
        say(f"worse: {sentence}")
    return 1 if worse else 0
