"""`humanmm export` and `humanmm view`: files and pictures from a finished run folder."""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FORMATS = ("amass", "csv", "trc")
"""What `storage.exporters.FORMATS` holds, named here so that --help loads no science (a test compares them)."""


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


VERBS = (add_export, add_view)


def export(options: argparse.Namespace) -> int:
    """Write RUN_DIR/export/person_<nn>.<suffix>."""
    from humanmm.storage import exporters
    from humanmm.storage.run_folder import MOTION, read_motion

    recording = read_motion(options.run_dir / MOTION)
    return _tell(exporters.export(recording, options.run_dir / "export", options.format, force=options.force))


def view(options: argparse.Namespace) -> int:
    """Draw RUN_DIR/view."""
    from humanmm.tasks.pictures import draw_again

    return _tell(draw_again(options.run_dir, force=options.force))


def _tell(paths: Iterable[Path]) -> int:
    sys.stdout.writelines(f"{path}\n" for path in paths)
    return 0
