"""`humanmm eval`, `export` and `view`: metrics, files and pictures of a finished run folder."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

import humanmm
from humanmm.cli.terminal import write, write_json
from humanmm.cli.verb import RESULTS, Force, Json, RunDir, app, verb

FORMATS = ("amass", "bvh", "glb", "fbx", "usd", "csv", "trc", "c3d", "gvhmr", "tum", "colmap", "blender")
"""What `storage.run_folder.exporters.FORMATS` holds, named here so that --help loads no science (a test compares)."""
if TYPE_CHECKING:
    FormatName = str
else:
    FormatName = Literal[FORMATS]


@verb(app, "eval", panel=RESULTS)
def evaluate(
    run_dir: RunDir,
    truth: Annotated[Path, Argument(metavar="TRUTH", help="a run folder or an .npz truth", show_default=False)],
    *,
    json: Json = False,
) -> None:
    """All metrics of one run against its truth."""
    report = humanmm.evaluate(run_dir, truth)
    if json:
        return write_json(report.to_json(), indent=None)
    from rich.console import Console

    from humanmm.models.evaluation.report import report_table

    Console(soft_wrap=True).print(report_table(report, title=f"{run_dir} against {truth}"))
    return None


@verb(app, "export", panel=RESULTS)
def export(
    run_dir: RunDir,
    *,
    format_name: Annotated[FormatName, Option("--format", metavar="NAME", help=", ".join(FORMATS), show_default=False)],
    person: Annotated[list[int] | None, Option(metavar="N", min=0, help="this person alone; may be repeated")] = None,
    start: Annotated[float | None, Option(metavar="S", help="from this second of the video on")] = None,
    end: Annotated[float | None, Option(metavar="S", help="up to this second of the video")] = None,
    fps: Annotated[float | None, Option(metavar="HZ", help="frames per second, by interpolation")] = None,
    up: Annotated[Literal["y", "z"] | None, Option(metavar="y|z", help="axis that points up")] = None,
    unit: Annotated[Literal["m", "cm", "mm"] | None, Option(metavar="m|cm|mm", help="unit of length")] = None,
    out: Annotated[Path | None, Option(metavar="DIR", help="folder (default: RUN_DIR/export)")] = None,
    force: Force = False,
) -> None:
    """Write a finished run in another tool's format; docs/export.md has a table of the formats.

    What is left out of --fps, --up and --unit is the format's own.
    """
    run = humanmm.load(run_dir)
    write(
        *run.export(format_name, person=person, start=start, end=end, fps=fps, up=up, unit=unit, out=out, force=force)
    )


@verb(app, "view", panel=RESULTS)
def view(run_dir: RunDir, *, force: Force = False) -> None:
    """Say where a finished run's pictures are; draw those that are missing, with --force all of them."""
    write(*humanmm.load(run_dir).draw(force=force))
