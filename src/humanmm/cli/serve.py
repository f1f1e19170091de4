"""`humanmm serve`: the server, the deployments and a worker, until Ctrl-C or SIGTERM."""

from typing import Annotated

from typer import Option

from humanmm.cli.terminal import write
from humanmm.cli.verb import BATCHES, Limit, app, verb


@verb(app, "serve", panel=BATCHES)
def serve(
    *,
    limit: Limit = None,
    idle: Annotated[
        float | None, Option(metavar="S", help="leave after S seconds without work (default: stay)")
    ] = None,
) -> None:
    """Run the local Prefect server with its dashboard, and a worker for batches, until Ctrl-C."""
    from humanmm.flows.service import serve as service

    service.serve(
        limit=limit or service.default_limit(), idle_s=idle,
        on_ready=lambda address: write(f"dashboard: {address}")
    )  # fmt: skip
