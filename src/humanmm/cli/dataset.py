"""`humanmm dataset build NAME`: data sets for `humanmm bench`, rendered here or cut from files that the user owns."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from humanmm.cli import owners
from humanmm.cli.settings import UsageError


@dataclass(frozen=True)
class Builder:
    """One data set that can be built."""

    name: str
    about: str
    """What it is and what the user must have, for --help."""
    declare: Callable[[argparse.ArgumentParser], None]
    """Adds the flags of this data set."""
    build: Callable[[argparse.Namespace], Path]
    """Builds it and returns the path of the result. Heavy imports belong inside."""


def _declare_ms_render(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the clips go")
    parser.add_argument(
        "--size", choices=("tiny", "standard"), default="standard", metavar="SIZE",
        help="tiny (one clip of 2 s) or standard (60 clips of 7 to 12 s; default)",
    )  # fmt: skip
    parser.add_argument("--count", type=int, metavar="N", help="so many clips instead")
    parser.add_argument("--seconds", type=float, nargs=2, metavar=("LOW", "HIGH"), help="clips of this length instead")
    parser.add_argument("--resolution", type=int, nargs=2, metavar=("W", "H"), help="all clips of this size, pixels")
    parser.add_argument("--seed", type=int, metavar="S", help="another seed makes other clips")
    parser.add_argument(
        "--mocap", type=Path, nargs="+", metavar="FILE",
        help="packs of motion capture (default: data/mocap/cmu_test.npz and cmu_val.npz of the repository)",
    )  # fmt: skip
    parser.add_argument("--threads", type=int, default=2, metavar="N", help="clips made at a time (default: 2)")
    parser.add_argument("--force", action="store_true", help="replace what is there")


def _build_ms_render(options: argparse.Namespace) -> Path:
    from humanmm.flows.bench.render_set import SEED, SetPlan, build_set, shipped_packs

    if options.count is not None and options.count < 1:
        raise UsageError(f"--count {options.count}: at least one clip is needed")
    if options.resolution and (min(options.resolution) < 16 or any(side % 2 for side in options.resolution)):
        raise UsageError(f"--resolution {options.resolution}: two even numbers of at least 16 are needed")
    if options.seconds and not 0 < options.seconds[0] <= options.seconds[1]:
        raise UsageError(f"--seconds {options.seconds}: two rising positive numbers are needed")
    packs = tuple(options.mocap) if options.mocap else shipped_packs()
    seed = SEED if options.seed is None else options.seed
    plan = SetPlan(
        packs,
        options.size,
        seed,
        options.count,
        seconds=tuple(options.seconds) if options.seconds else None,
        resolution=tuple(options.resolution) if options.resolution else None,
    )
    return build_set(plan, options.out, threads=options.threads, force=options.force)


OF_OWNERS = (
    Builder(
        "ms-aist",
        "from the annotations of AIST++ (CC BY 4.0) and, for clips with pictures, the AIST videos",
        owners.declare_aist,
        owners.build_aist,
    ),
    Builder(
        "ms-h36m",
        "from Human3.6M's videos, positions and cameras; experimental: its files could not be tried here",
        owners.declare_h36m,
        owners.build_h36m,
    ),
    Builder(
        "3dpw",
        "whole videos of 3DPW with truths; experimental: its files could not be tried here",
        owners.declare_3dpw,
        owners.build_3dpw,
    ),
    Builder(
        "emdb",
        "whole videos of EMDB-1 or EMDB-2 with truths, and your SMPL model; experimental: not tried on its files",
        owners.declare_emdb,
        owners.build_emdb,
    ),
    Builder(
        "rich",
        "whole videos of RICH's standing cameras with truths, and your SMPL-X models; experimental: not tried on its "
        "files",
        owners.declare_rich,
        owners.build_rich,
    ),
)
"""Cut from what the user must have."""

BUILDERS = (
    Builder(
        "ms-render", "rendered people with exact truth; nothing else is needed", _declare_ms_render, _build_ms_render
    ),
    *OF_OWNERS,
)


def add_dataset(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `dataset build NAME`."""
    parser = verbs.add_parser("dataset", allow_abbrev=False, help="build the data sets of the benchmark")
    actions = parser.add_subparsers(required=True, metavar="build")
    names = actions.add_parser("build", allow_abbrev=False, help="build one data set").add_subparsers(
        required=True, metavar="NAME", title="data sets"
    )
    for builder in BUILDERS:
        of_set = names.add_parser(builder.name, parents=[common], allow_abbrev=False, help=builder.about)
        builder.declare(of_set)
        of_set.set_defaults(run=_build, builder=builder)


VERBS = (add_dataset,)


def _build(options: argparse.Namespace) -> int:
    sys.stdout.write(f"{options.builder.build(options)}\n")
    return 0
