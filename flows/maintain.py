"""Care of the store as a flow, for the dashboard and for schedules: check every artifact, remove what nobody needs."""

from pathlib import Path
from typing import Any

from prefect import flow
from prefect.states import Completed, Failed

from humanmm.storage.store import maintenance
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import default_store
from humanmm.tasks import pipeline


@flow(name="maintain", persist_result=False)
def maintain(
    store: Path | None = None,
    deep: bool = False,
    unused_days: float = 30.0,
    with_runs: bool = False,
    remove: bool = False,
) -> Any:
    """Verify the store; list, and with `remove` delete, what was not used for so many days. Fails on damage.

    What the last run on a video is made of stays, unless `with_runs`.
    """
    place = open_store(store or default_store())
    outputs = {stage.name: stage.output for stage in pipeline.STAGES}
    findings = list(maintenance.verify(place, outputs=outputs, deep=deep))
    damaged = [finding for finding in findings if finding.problem]
    items = maintenance.removable(place, unused_days=unused_days, with_runs=with_runs)
    if remove:
        freed = f"{maintenance.remove(place, items) / 1e6:.1f} MB freed"
    else:
        freed = f"{sum(item.num_bytes for item in items) / 1e6:.1f} MB could go"
    told = f"{len(findings) - len(damaged)} artifacts are sound, {len(damaged)} damaged; {freed}"
    if damaged:
        return Failed(message=told + "; " + "; ".join(f"{f.uri}: {f.problem}" for f in damaged[:10]))
    return Completed(message=told)
