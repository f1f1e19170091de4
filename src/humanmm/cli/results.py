"""`humanmm eval`, `export` and `view`: figures, files and pictures from a finished run folder."""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FORMATS = ("amass", "csv", "trc")
"""What `storage.exporters.FORMATS` holds, named here so that --help loads no science (a test compares them)."""


def add_eval(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `eval RUN_DIR TRUTH`."""
    parser = verbs.add_parser(
        "eval", parents=[common], allow_abbrev=False, help="all metrics of one run against its truth"
    )
    parser.add_argument("run_dir", type=Path, metavar="RUN_DIR")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="a run folder or an .npz truth")
    parser.add_argument("--json", action="store_true", help="one flat json object")
    parser.set_defaults(run=evaluate)


def add_export(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `export RUN_DIR --format NAME`."""
    parser = verbs.add_parser(
        "export", parents=[common], allow_abbrev=False, help="write a finished run in another tool's format"
    )
    parser.add_argument("run_dir", type=Path, metavar="RUN_DIR")
    parser.add_argument("--format", required=True, choices=FORMATS, metavar="NAME", help=", ".join(FORMATS))
    parser.add_argument("--force", action="store_true", help="replace files that exist")
    parser.set_defaults(run=export)


def add_view(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `view RUN_DIR`."""
    parser = verbs.add_parser(
        "view", parents=[common], allow_abbrev=False, help="where a finished run's pictures are; draws missing ones"
    )
    parser.add_argument("run_dir", type=Path, metavar="RUN_DIR")
    parser.add_argument("--force", action="store_true", help="draw all of them again")
    parser.set_defaults(run=view)


VERBS = (add_eval, add_export, add_view)


def evaluate(options: argparse.Namespace) -> int:
    """Print every figure, as a table or as json."""
    from humanmm.models.evaluation.evaluate import evaluate as figures_of
    from humanmm.models.evaluation.report import report_table
    from humanmm.storage.readers.truth import read_sequence

    report = figures_of(read_sequence(options.run_dir), read_sequence(options.truth))
    if options.json:
        sys.stdout.write(json.dumps(report.to_json(), allow_nan=False) + "\n")
        return 0
    from rich.console import Console

    Console(soft_wrap=True).print(report_table(report, title=f"{options.run_dir} against {options.truth}"))
    return 0


def export(options: argparse.Namespace) -> int:
    """Write RUN_DIR/export/person_<nn>.<suffix>."""
    from humanmm.storage.run_folder import exporters
    from humanmm.storage.run_folder.motion_zarr import MOTION, read_motion

    recording = read_motion(options.run_dir / MOTION)
    return _tell(exporters.export(recording, options.run_dir / "export", options.format, force=options.force))


def view(options: argparse.Namespace) -> int:
    """Draw RUN_DIR/view."""
    from humanmm.tasks.pictures import draw_again

    return _tell(draw_again(options.run_dir, force=options.force))


def _tell(paths: Iterable[Path]) -> int:
    sys.stdout.writelines(f"{path}\n" for path in paths)
    return 0
