"""`humanmm dataset build NAME`: data sets for `humanmm bench`, rendered here or cut from files that the user owns."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


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


BUILDERS: tuple[Builder, ...] = ()


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
