"""`humanmm eval`, `export` and `view`: metrics, files and pictures of a finished run folder."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, Option

import humanmm
from humanmm.cli.terminal import open_in_browser, write, write_json
from humanmm.cli.verb import RESULTS, Force, Json, RunDir, app, verb
from humanmm.errors import UsageError

FORMATS = ("amass", "bvh", "glb", "fbx", "usd", "csv", "trc", "c3d", "gvhmr", "tum", "colmap", "blender")
"""What `storage.run_folder.exporters.FORMATS` holds, named here so that --help loads no science (a test compares)."""
_FORMATS = f"{', '.join(FORMATS)}; may be repeated"
if TYPE_CHECKING:
    FormatName = str
else:
    FormatName = StrEnum("FormatName", [(name, name) for name in FORMATS])  # a Literal Typer reads only once


@verb(app, "eval", panel=RESULTS)
def evaluate(
    run_dir: RunDir,
    truth: Annotated[Path, Argument(metavar="TRUTH", help="a run folder or an .npz truth", show_default=False)],
    *,
    per: Annotated[
        Literal["person", "shot"] | None,
        Option(metavar="person|shot", help="figures of each of the truth's people or shots, not of all together"),
    ] = None,
    json: Json = False,
) -> None:
    """All metrics of one run against its truth; docs/metrics.md defines them, and what a truth is made of."""
    report = humanmm.evaluate(run_dir, truth)
    parts = report.people if per == "person" else report.shots
    if json and per is not None:
        return write_json({f"per_{per}": [part.to_json() for part in parts], "problems": report.problems}, indent=None)
    if json:
        return write_json(report.to_json(), indent=None)
    from rich.console import Console

    from humanmm.models.evaluation.report import report_table, tables_per

    title = f"{run_dir} against {truth}"
    for table in tables_per(parts, title=title) if per is not None else [report_table(report, title=title)]:
        Console(soft_wrap=True).print(table)
    return None


@verb(app, "export", panel=RESULTS)
def export(  # noqa: PLR0913 (one a flag)
    run_dir: RunDir,
    *,
    formats: Annotated[list[FormatName], Option("--format", metavar="NAME", help=_FORMATS, show_default=False)],
    person: Annotated[list[int] | None, Option(metavar="N", min=0, help="this person alone; may be repeated")] = None,
    start: Annotated[float | None, Option(metavar="S", help="from this second after the first frame on")] = None,
    end: Annotated[float | None, Option(metavar="S", help="up to this second after the first frame")] = None,
    fps: Annotated[float | None, Option(metavar="HZ", help="frames per second, by interpolation")] = None,
    up: Annotated[Literal["y", "z"] | None, Option(metavar="y|z", help="axis that points up")] = None,
    unit: Annotated[Literal["m", "cm", "mm"] | None, Option(metavar="m|cm|mm", help="unit of length")] = None,
    keep_unseen: Annotated[
        bool, Option("--keep-unseen", help="glb, fbx, usd: show people also where they are unseen for more than 2 s")
    ] = False,
    out: Annotated[Path | None, Option(metavar="DIR", help="folder (default: RUN_DIR/export)")] = None,
    force: Force = False,
) -> None:
    """Write a finished run in other tools' formats; docs/export.md has a table of the formats.

    What is left out of --fps, --up and --unit is the format's own.
    """
    run = humanmm.load(run_dir)
    wishes: dict[str, Any] = {"person": person, "start": start, "end": end, "fps": fps, "up": up, "unit": unit}
    for format_name in dict.fromkeys(formats):
        write(*run.export(str(format_name), **wishes, keep_unseen=keep_unseen, out=out, force=force))


@verb(app, "view", panel=RESULTS)
def view(
    run_dir: RunDir,
    *,
    mp4: Annotated[
        Literal["world", "side-by-side"] | None,
        Option(
            "--mp4",
            metavar="world|side-by-side",
            help="a film of the world, or of the video, the overlay and the world",
        ),
    ] = None,
    rerun: Annotated[bool, Option("--rerun", help="a file for rerun's viewer (.rrd)")] = False,
    opacity: Annotated[float | None, Option(metavar="0…1", min=0, max=1, help="of the bodies on the video")] = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="where to write it (default: into RUN_DIR/view)")] = None,
    show: Annotated[bool, Option("--open/--no-open", help="open the page in the browser")] = True,
    force: Force = False,
) -> None:
    """Open a finished run in the browser: the video beside the world in 3D, in one file; docs/view.md describes it.

    Draws the pictures of the run that are missing, with --force all of them, and says where they are. With --mp4 or
    --rerun it writes a film or an .rrd instead.
    """
    run = humanmm.load(run_dir)
    if mp4 is not None and rerun:
        raise UsageError("--mp4 and --rerun are two files; write one at a time")
    if mp4 is not None or rerun:
        return write(run.view(mp4 or "rerun", out=out, opacity=opacity, force=force))
    if out is None and opacity is None:
        write(*run.draw(force=force))
    page = run.view(out=out, opacity=opacity, force=force)
    write(page)
    if show:
        open_in_browser(page)
    return None
