"""One slot per accelerator, shared by all processes and machines of one Prefect server."""

import contextlib
from collections.abc import Iterator

from prefect.client.orchestration import PrefectClient
from prefect.client.schemas.actions import GlobalConcurrencyLimitCreate
from prefect.concurrency.sync import concurrency
from prefect.exceptions import ObjectAlreadyExists

from humanmm.machine import nvidia_devices

LIMIT = "gpu"
LEASE_S = 60.0
"""A slot whose holder was killed is free after this many seconds and the server's next check (every 10 s)."""


@contextlib.contextmanager
def gpu_slot() -> Iterator[None]:
    """Hold a slot while a stage computes on an accelerator; without the limit `gpu` on the server, nothing waits."""
    with concurrency(LIMIT, occupy=1, lease_duration=LEASE_S, raise_on_lease_renewal_failure=False):
        yield


async def declare_gpus(client: PrefectClient) -> None:
    """Create the limit if the server has none: a slot per device of this machine, at least one."""
    with contextlib.suppress(ObjectAlreadyExists):
        await client.create_global_concurrency_limit(
            GlobalConcurrencyLimitCreate(name=LIMIT, limit=max(1, nvidia_devices()), active=True)
        )
