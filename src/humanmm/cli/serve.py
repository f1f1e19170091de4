"""`humanmm serve`: the server, the deployments and a worker, until it is told to stop."""

import argparse
import sys
from typing import Any

from humanmm.cli.settings import UsageError


def add_serve(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `serve`."""
    parser = verbs.add_parser(
        "serve", parents=[common], allow_abbrev=False,
        help="run the local Prefect server with its dashboard, and a worker for batches, until Ctrl-C",
    )  # fmt: skip
    parser.add_argument("--limit", type=int, metavar="N", help="videos at the same time (default: half the processors)")
    parser.add_argument("--idle", type=float, metavar="S", help="leave after S seconds without work (default: stay)")
    parser.set_defaults(run=run)


VERBS = (add_serve,)


def run(options: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM; status 0 then."""
    if options.limit is not None and options.limit < 1:
        raise UsageError(f"--limit {options.limit}: at least one video at a time is needed")

    from humanmm.flows.service.serve import default_limit, serve

    def tell(address: str) -> None:
        sys.stdout.write(f"dashboard: {address}\n")
        sys.stdout.flush()

    serve(limit=options.limit or default_limit(), idle_s=options.idle, on_ready=tell)
    return 0
