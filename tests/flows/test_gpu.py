"""The slots of accelerators: one a device, at least one, declared once."""

import asyncio
from typing import Any

import pytest
from prefect.exceptions import ObjectAlreadyExists

from humanmm.flows import gpu


class Limits:
    """Prefect's client, as far as it is used."""

    def __init__(self) -> None:
        self.limits: dict[str, int] = {}

    async def create_global_concurrency_limit(self, wanted: Any) -> None:
        if wanted.name in self.limits:
            raise ObjectAlreadyExists(RuntimeError("there is one"))
        self.limits[wanted.name] = wanted.limit


@pytest.mark.parametrize(("devices", "slots"), [(0, 1), (1, 1), (3, 3)])
def test_every_device_is_a_slot_and_a_limit_that_is_there_stays(
    monkeypatch: pytest.MonkeyPatch, devices: int, slots: int
) -> None:
    monkeypatch.setattr(gpu, "nvidia_devices", lambda: devices)
    client: Any = Limits()
    asyncio.run(gpu.declare_gpus(client))
    assert client.limits == {"gpu": slots}
    client.limits["gpu"] = 7
    asyncio.run(gpu.declare_gpus(client))
    assert client.limits == {"gpu": 7}
